#include "analysis/gap/facet_evidence.h"

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <tuple>

#include "analysis/fitting/bayes_factor.h"
#include "analysis/fitting/model_fit.h"
#include "analysis/fitting/transition_model.h"
#include "analysis/gap/map_columns.h"
#include "markov/dense_matrix.h"

namespace metastable::analysis {
namespace {

constexpr int most_waves = 3;             // of a smooth change along a trial
constexpr int most_cycles = 4;            // of a slow swing over the trials
constexpr std::size_t least_events = 40;  // of a column that the map lacks
constexpr double most_promised = 1;       // rise of the log likelihood that a fit may still promise, to be judged
constexpr double least_own = 0.1;         // share of a facet's direction that the fitted parameters leave, to be judged

// Holds columns by facet, aspect and phase.
using Key = std::tuple<std::string, std::string, bool>;
using Facets = std::map<Key, std::vector<MapColumn>>;

// Gathers columns of the scores of one phase: contrasts of means, and products with earlier scores.
class Gatherer {
 public:
  Gatherer(const TransitionModel& model, const std::vector<EventResidual>& left, const EventPhase& phase)
      : model_(model), left_(left), members_(phase.members), stance_(phase.stance) {}

  template <class Weight>  // of an event; 0 leaves it out
  void contrast(Facets& facets, const char* facet, Weight weight) const {
    MapColumn column{Measure::shift, {}, 0, {}};
    for (const std::size_t i : members_) {
      const double w = weight(model_.events()[i]);
      if (w == 0) continue;
      column.terms.emplace_back(i, w * left_[i].mean);
      column.variance += w * w;
    }
    if (column.terms.size() >= least_events) facets[{facet, "mean", stance_}].push_back(std::move(column));
  }

  // With the score of the same trial `lag` events before.
  void memory(Facets& facets, const char* facet, std::size_t lag) const {
    MapColumn column{Measure::correlation, {}, 0, {}};
    for (std::size_t k = lag; k < members_.size(); ++k)
      if (trial(k - lag) == trial(k))
        column.terms.emplace_back(members_[k], left_[members_[k]].mean * left_[members_[k - lag]].mean);
    column.variance = static_cast<double>(column.terms.size());
    if (column.terms.size() >= least_events) facets[{facet, "memory", stance_}].push_back(std::move(column));
  }

  void change_of_speed(Facets& facets) const {
    MapColumn column{Measure::shift, {}, 0, {}};
    for (std::size_t k = 1; k < members_.size(); ++k)
      if (trial(k - 1) == trial(k)) {
        const double change = speed(k - 1) - speed(k);
        if (!std::isfinite(change)) continue;
        column.terms.emplace_back(members_[k], change * left_[members_[k]].mean);
        column.variance += change * change;
      }
    if (column.terms.size() >= least_events) facets[{"step before", "mean", stance_}].push_back(std::move(column));
  }

 private:
  std::size_t trial(std::size_t k) const { return model_.events()[members_[k]].trial; }
  double speed(std::size_t k) const { return model_.events()[members_[k]].speed; }

  const TransitionModel& model_;
  const std::vector<EventResidual>& left_;
  std::vector<std::size_t> members_;
  bool stance_;
};

// Adds facets that the map lacks.
void add_unmapped(Facets& facets, const TransitionModel& model, const std::vector<EventResidual>& left,
                  const EventPhase& phase) {
  const Gatherer gather(model, left, phase);
  const double trials = static_cast<double>(model.trials());
  double longest = 1;
  for (const Event& e : model.events()) longest = std::max(longest, static_cast<double>(e.number));
  gather.contrast(facets, "every other trial", [](const Event& e) { return e.trial % 2 == 0 ? 1.0 : -1.0; });
  for (int cycles = 1; cycles <= most_cycles; ++cycles)
    for (const double phase : {0.0, 0.5 * std::numbers::pi})
      gather.contrast(facets, "order", [&](const Event& e) {
        return std::cos(2 * std::numbers::pi * cycles * static_cast<double>(e.trial) / trials - phase);
      });
  for (int leg = 0; leg < model.legs(); ++leg)
    gather.contrast(facets, "leg in order", [&](const Event& e) {
      return e.leg && *e.leg == leg ? 2 * static_cast<double>(e.trial) / trials - 1 : 0;
    });
  for (int waves = 1; waves <= most_waves; ++waves)  // half ones
    gather.contrast(facets, "along the trial", [&](const Event& e) {
      return std::cos(std::numbers::pi * waves * static_cast<double>(e.number - 1) / longest);
    });
  gather.contrast(facets, "every other collision", [](const Event& e) { return e.number % 2 == 0 ? 1.0 : -1.0; });
  for (const std::size_t lag : {std::size_t{2}, std::size_t{3}}) gather.memory(facets, "earlier collisions", lag);
  if (model.legs() > 0) gather.memory(facets, "turn before", static_cast<std::size_t>(model.legs()));
  gather.change_of_speed(facets);
}

// How many of all collisions are far ones is the form of the contact's distribution, which no law holds to be normal:
// restitution with a skewness of .7 shows there and nowhere else. Rare contacts of another kind are an effect by name.
bool is_form_of_contact(const GapCell& cell) { return cell.of_all() && cell.aspect == "tail" && !cell.stance; }

// Weighs the columns' sums by what they scatter without a gap, in the directions that the fitted parameters leave.
LeftInFacet judge(const Key& key, const Eigen::MatrixXd& dense, const Eigen::VectorXd& sums,
                  const Eigen::VectorXd& whole, const std::vector<MapColumn>& columns, double forgiven,
                  const Rules& rules) {
  LeftInFacet left{.facet = std::get<0>(key), .aspect = std::get<1>(key), .stance = std::get<2>(key)};
  const Eigen::ArrayXd root = whole.array().max(1e-300).sqrt();
  const Eigen::MatrixXd scaled = dense * root.inverse().matrix().asDiagonal();
  const markov::SymmetricEigen split = markov::symmetric_eigen(scaled.transpose() * scaled);
  // Events that scatter less than the model's are no surer of it: scores close together have close squares, too.
  Eigen::ArrayXd unit = root;
  for (std::size_t k = 0; k < columns.size(); ++k) {
    double& of_column = unit[static_cast<Eigen::Index>(k)];
    of_column = std::max(of_column, std::sqrt(columns[k].variance));
  }
  const Eigen::VectorXd along = split.vectors.transpose() * (sums.array() / unit).matrix();
  for (Eigen::Index d = 0; d < along.size(); ++d)
    if (split.values[d] > least_own) {
      left.quadratic += along[d] * along[d] / split.values[d];
      ++left.degrees;
    }
  if (left.degrees == 0) return left;
  const boost::math::chi_squared chance(left.degrees);
  left.p_value = boost::math::cdf(boost::math::complement(chance, left.quadratic));
  left.evidence = evidence_of_gain(std::max(0.0, left.quadratic - forgiven), left.degrees, rules);
  return left;
}

}  // namespace

std::vector<LeftInFacet> left_by_facet(const TransitionModel& model, const Fit& fit, const PhaseGain& forgiven,
                                       const Rules& rules) {
  // A fit that did not converge leaves mostly its own error.
  if (!fit.converged && fit.promised > most_promised) return {};
  Facets facets;
  MapColumns mapped = map_columns(model, fit);
  for (std::size_t c = 0; c < mapped.cells.size(); ++c)
    if (const GapCell& cell = mapped.cells[c]; !cell.swing && cell.facet != "outcome" && !is_form_of_contact(cell)) {
      const bool memory = mapped.columns[c].measure == Measure::correlation;  // a facet of its own
      facets[{memory && cell.aspect != "correlation" ? cell.at : cell.facet, cell.aspect, cell.stance}].push_back(
          std::move(mapped.columns[c]));
    }
  const std::vector<EventResidual> left = residuals(model, fit.evaluation);
  for (const EventPhase& phase : event_phases(model)) add_unmapped(facets, model, left, phase);

  std::vector<LeftInFacet> all;
  for (const auto& [key, columns] : facets) {
    const EfficientColumns efficient = project(columns, model, fit);
    if (!efficient.sums.allFinite()) continue;  // a fit far off may have no slopes to project on
    all.push_back(judge(key, efficient.dense, efficient.sums.transpose(), efficient.whole_norm.transpose(), columns,
                        std::get<2>(key) ? forgiven.stances : forgiven.collisions, rules));
  }
  return all;
}

void bound_evidence(std::vector<LeftInFacet>& alone, double gain, const std::vector<LeftInFacet>& beside,
                    const Rules& rules) {
  for (LeftInFacet& facet : alone)
    for (const LeftInFacet& left : beside)
      if (left.facet == facet.facet && left.aspect == facet.aspect && left.stance == facet.stance)
        facet.evidence = std::min(facet.evidence, evidence_of_gain(std::max(0.0, gain) + left.quadratic,
                                                                   std::max(1.0, facet.degrees), rules));
}

double evidence_of_more(const std::vector<LeftInFacet>& facets) {
  if (facets.empty()) return -std::numeric_limits<double>::infinity();
  double most = -std::numeric_limits<double>::infinity(), sum = 0;
  for (const LeftInFacet& facet : facets) most = std::max(most, facet.evidence);
  for (const LeftInFacet& facet : facets) sum += std::exp(facet.evidence - most);
  return most + std::log(sum / static_cast<double>(facets.size()));
}

}  // namespace metastable::analysis
