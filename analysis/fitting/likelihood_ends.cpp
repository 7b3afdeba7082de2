#include "analysis/fitting/likelihood_ends.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "analysis/fitting/model_fit.h"
#include "analysis/statistics/interval_95.h"

namespace metastable::analysis {
namespace {

constexpr int most_tries = 16;         // An end takes three on most sides.
constexpr double close_enough = 0.03;  // The root of twice the fall at an end may be off by so many sds.
constexpr double least_factor = 0.3, most_factor = 3;  // A distance changes by these at most from one try to the next.

// Holds the fitted values of a hypothesis, which move together along a line.
class FitLine {
 public:
  FitLine(const TransitionModel& model, const Fit& fit, const Eigen::MatrixXd& covariance, Eigen::Index slot)
      : model_(model), fit_(fit), slot_(static_cast<std::size_t>(slot)) {
    if (covariance(slot, slot) > 0) along_ = covariance.col(slot) / covariance(slot, slot);
    for (std::size_t i = 0; i < fit.nuisance.size(); ++i)
      parts_.push_back({fit.nuisance[i], model.nuisances()[i].lower, model.nuisances()[i].upper});
    for (const EffectTerm& term : fit.terms)
      for (std::size_t i = 0; i < term.values.size(); ++i) {
        const FreeParameter& p = term.candidate->parameters[i];
        parts_.push_back({term.values[i], p.lower, p.upper});
      }
  }
  double value() const { return parts_[slot_].value; }
  double room(int side) const {
    const Part& own = parts_[slot_];
    return side > 0 ? own.upper - own.value : own.value - own.lower;
  }
  // Returns the root of twice what the penalised likelihood falls by from the top to there; 0 if it rises.
  double fallen(double distance) const {
    std::vector<double> nuisance = fit_.nuisance;
    std::vector<EffectTerm> terms = fit_.terms;
    std::size_t part = 0;
    const auto move = [&](double& value) {
      const Part& one = parts_[part];
      value = std::clamp(one.value + distance * along_[static_cast<Eigen::Index>(part++)], one.lower, one.upper);
    };
    for (double& value : nuisance) move(value);
    for (EffectTerm& term : terms)
      for (double& value : term.values) move(value);
    const double fall = fit_.penalised - fit(model_, nuisance, terms, {.count = {}, .most_iterations = 0}).penalised;
    return std::isnan(fall) ? std::numeric_limits<double>::infinity() : std::sqrt(2 * std::max(0.0, fall));
  }

 private:
  struct Part {
    double value, lower, upper;
  };
  const TransitionModel& model_;
  const Fit& fit_;
  std::size_t slot_;
  Eigen::VectorXd along_;  // All parameters move by these where this one moves by 1.
  std::vector<Part> parts_;
};

// The root of twice the fall is nearly proportional to the distance. If a step by that rule leaves the interval that
// holds the end, the interval is halved.
double distance_to_end(const FitLine& line, int side, double expected) {
  const double room = std::max(0.0, line.room(side));
  double distance = std::min(expected, room), inside = 0, outside = room;
  bool bounded = false;  // The end lies before `outside`.
  for (int tries = 0; tries < most_tries && distance > 0; ++tries) {
    const double fallen = line.fallen(side * distance);
    if (std::abs(fallen - normal_90) < close_enough) break;
    if (fallen > normal_90) {
      outside = distance;
      bounded = true;
    } else if (!bounded && distance >= room) {
      break;
    } else {
      inside = distance;
    }
    const double factor = fallen > 0 ? normal_90 / fallen : most_factor;
    const double next = distance * std::clamp(factor, least_factor, most_factor);
    distance = next > inside && (next < outside || !bounded) ? std::min(next, room) : (inside + outside) / 2;
  }
  return distance;
}

}  // namespace

std::pair<double, double> likelihood_ends(const TransitionModel& model, const Fit& fit,
                                          const Eigen::MatrixXd& covariance, Eigen::Index slot) {
  const FitLine line(model, fit, covariance, slot);
  if (!(covariance(slot, slot) > 0)) return {line.value(), line.value()};
  const double expected = normal_90 * std::sqrt(covariance(slot, slot));
  return {line.value() - distance_to_end(line, -1, expected), line.value() + distance_to_end(line, 1, expected)};
}

}  // namespace metastable::analysis
