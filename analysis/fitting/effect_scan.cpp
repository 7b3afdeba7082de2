#include "analysis/fitting/effect_scan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <utility>

#include "analysis/fitting/transition_responses.h"
#include "analysis/statistics/falling_order.h"
#include "analysis/statistics/random.h"
#include "markov/dense_matrix.h"
#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

constexpr double largest_step = 0.1, small_step = 0.05;  // of a difference, in standard errors
constexpr std::size_t most_scanned = 24;                 // variants of an effect that are scanned beside another one
// Each column takes a difference of its own where fewer columns than this add to one number of the model.
constexpr std::size_t fewest_columns = 4;
constexpr double far_out = 0.03;  // share of the draws beyond which a tail follows its law instead of their count

// Returns the root of the inverse of an effect's information, that of its priors included, in the directions that the
// data resolve. @param whole  the information's diagonal before the projection
Eigen::MatrixXd root_with_priors(const Candidate& candidate, Eigen::MatrixXd info, Eigen::VectorXd whole) {
  for (Eigen::Index p = 0; p < whole.size(); ++p) {
    const FreeParameter& parameter = candidate.parameters[static_cast<std::size_t>(p)];
    const double range = parameter.upper - parameter.lower;
    const double prior = parameter.prior_sd > 0 ? 1 / (parameter.prior_sd * parameter.prior_sd) : 0;
    info(p, p) += prior;
    whole[p] = whole[p] * range * range > resolved_range ? whole[p] + prior : 0;
  }
  return markov::resolved_root(info, whole, resolved_share);
}

Eigen::MatrixXd root_of_variant(const EffectScan& scan, const Candidate& candidate, Eigen::Index first) {
  const auto count = static_cast<Eigen::Index>(candidate.parameters.size());
  return root_with_priors(candidate, scan.information.block(first, first, count, count),
                          scan.whole.segment(first, count));
}

// Returns what the score `u` gains beside the prior; one parameter at its lower bound gains only upwards.
double promised_gain(const Candidate& candidate, const Eigen::VectorXd& u, const Eigen::MatrixXd& root,
                     Eigen::VectorXd* start) {
  const Eigen::VectorXd along = root.transpose() * u;
  if (start) *start = root * along;
  if (u.size() == 1) {
    const FreeParameter& p = candidate.parameters[0];
    if ((p.lower >= p.neutral && u[0] < 0) || (p.upper <= p.neutral && u[0] > 0)) return 0;
  }
  const double gain = along.squaredNorm();
  return std::isfinite(gain) ? gain : 0;
}

// Returns [variants] what the earlier scan promises of an effect once what the other one takes up is projected out.
std::vector<double> promised_beside(const ScanBeside& beside, const ScannedEffect& effect, const ScannedEffect& other) {
  const EffectScan& scan = *beside.earlier;
  const auto count = static_cast<Eigen::Index>(effect.candidate->parameters.size());
  const auto held = static_cast<Eigen::Index>(other.candidate->parameters.size());
  const Eigen::Index at = other.first[other.best];
  const Eigen::MatrixXd root =
      markov::resolved_root(scan.information.block(at, at, held, held), scan.whole.segment(at, held), resolved_share);
  std::vector<double> promised;
  for (const Eigen::Index first : effect.first) {
    const Eigen::MatrixXd cross = scan.information.block(at, first, held, count);
    const Eigen::MatrixXd taken = root * (root.transpose() * cross);
    const Eigen::MatrixXd left = scan.information.block(first, first, count, count) - cross.transpose() * taken;
    promised.push_back(promised_gain(
        *effect.candidate, scan.scores.segment(first, count) - taken.transpose() * scan.scores.segment(at, held),
        root_with_priors(*effect.candidate, left, scan.whole.segment(first, count)), nullptr));
  }
  return promised;
}

// Returns a step that the earlier scan resolves well, where it is smaller than the parameter's own.
double first_step(const ScanBeside& beside, const EffectTerm& term, std::size_t parameter) {
  const double own = term.candidate->parameters[parameter].step;
  const ScannedEffect* effect = beside.earlier ? beside.earlier->find(term.candidate) : nullptr;
  if (!effect) return own;
  const auto variant = std::ranges::find(term.candidate->variants, term.variant) - term.candidate->variants.begin();
  const Eigen::Index column = effect->first[static_cast<std::size_t>(variant)] + static_cast<Eigen::Index>(parameter);
  return std::min(own, small_step / std::sqrt(std::max(1e-300, beside.earlier->information(column, column))));
}

// Says by variant of a candidate whether it is scanned.
std::vector<char> scanned_variants(const Candidate& candidate, const ScanBeside& beside) {
  std::vector<char> scanned(candidate.variants.size(), true);
  if (!beside.earlier || scanned.size() <= most_scanned) return scanned;
  const ScannedEffect *effect = beside.earlier->find(&candidate), *other = beside.earlier->find(beside.effect);
  if (!effect || !other) return scanned;
  const std::vector<double> promised = promised_beside(beside, *effect, *other);
  const std::vector<std::size_t> order = falling_order(promised);
  for (std::size_t k = most_scanned; k < order.size(); ++k) scanned[order[k]] = false;
  return scanned;
}

// A term at its neutral values, and the first of its columns.
struct ScannedTerm {
  Eigen::Index first;
  EffectTerm term;
};

// Gives a candidate's variants their columns and lists the terms that are scanned.
ScannedEffect list_terms(const Candidate& candidate, const ScanBeside& beside, Eigen::Index& columns,
                         std::vector<ScannedTerm>& terms) {
  ScannedEffect effect;
  effect.candidate = &candidate;
  const std::vector<char> scanned = scanned_variants(candidate, beside);
  for (std::size_t v = 0; v < candidate.variants.size(); ++v) {
    effect.first.push_back(columns);
    columns += static_cast<Eigen::Index>(candidate.parameters.size());
    if (!scanned[v]) continue;
    EffectTerm term{&candidate, candidate.variants[v], {}};
    for (const FreeParameter& p : candidate.parameters) term.values.push_back(p.neutral);
    terms.push_back({effect.first.back(), std::move(term)});
  }
  return effect;
}

// Says which parameter of a term a column of the scan belongs to.
struct ScannedColumn {
  Eigen::Index column;
  const EffectTerm* term;
  std::size_t parameter;
};

std::vector<ScannedColumn> list_columns(const std::vector<ScannedTerm>& terms) {
  std::vector<ScannedColumn> all;
  for (const ScannedTerm& one : terms)
    for (std::size_t p = 0; p < one.term.values.size(); ++p)
      all.push_back({one.first + static_cast<Eigen::Index>(p), &one.term, p});
  return all;
}

// Fills a column. Only its parameter is moved, by a small share of what the data resolve.
void differentiate(const TransitionModel& model, const Fit& fit, const ScannedColumn& scanned, const ScanBeside& beside,
                   Derivatives& all) {
  double step = first_step(beside, *scanned.term, scanned.parameter);
  const FreeParameter& p = scanned.term->candidate->parameters[scanned.parameter];
  const double way = p.upper > p.neutral ? 1 : -1;  // An effect may have room below none only.
  for (int attempt = 0; attempt < 2; ++attempt) {
    std::vector<EffectTerm> moved = fit.terms;
    moved.push_back(*scanned.term);
    moved.back().values[scanned.parameter] += way * step;
    const Evaluation there = model.evaluate(fit.nuisance, moved);
    fill_differences(fit.evaluation, there, way * step, scanned.column, all);
    const double resolved = 1 / std::sqrt(std::max(1e-300, all.change.col(scanned.column).squaredNorm()));
    if (step < largest_step * resolved) break;
    step = small_step * resolved;
  }
}

// Holds the columns that add to one number of the model, the largest of their steps, and what events answer to it.
struct AddedTo {
  std::vector<ScannedColumn> columns;
  double step = 0;
  std::unique_ptr<TransitionResponses> responses = {};
};

// Sorts columns by the number that they add to, and returns those that do more than add.
std::vector<ScannedColumn> sort_out(const TransitionModel& model, const std::vector<ScannedColumn>& columns,
                                    const ScanBeside& beside, std::map<std::size_t, AddedTo>& numbers) {
  std::vector<ScannedColumn> others;
  for (const ScannedColumn& one : columns) {
    const std::optional<Addition> addition = model.addition(*one.term, one.parameter);
    if (!addition) {
      others.push_back(one);
      continue;
    }
    double largest = 0;
    for (const double weight : addition->weights) largest = std::max(largest, std::abs(weight));
    if (largest == 0) continue;  // it adds nothing, and its column is zero
    AddedTo& number = numbers[addition->number];
    number.columns.push_back(one);
    number.step = std::max(number.step, first_step(beside, *one.term, one.parameter) * largest);
  }
  return others;
}

// Fills the columns that are sums of what events answer to single transitions, and returns the others.
std::vector<ScannedColumn> fill_by_responses(const TransitionModel& model, const Fit& fit,
                                             const std::vector<ScannedColumn>& columns, const ScanBeside& beside,
                                             int threads, Derivatives& all) {
  std::map<std::size_t, AddedTo> numbers;
  std::vector<ScannedColumn> others = sort_out(model, columns, beside, numbers);
  std::vector<std::pair<std::size_t, AddedTo*>> worth;
  for (auto& [number, added] : numbers)
    if (added.columns.size() >= fewest_columns) worth.emplace_back(number, &added);
  model.side_by_side(worth.size(), threads, [&](std::size_t i) {
    const auto& [number, added] = worth[i];
    added->responses = std::make_unique<TransitionResponses>(model, fit, number, added->step);
  });
  std::vector<std::pair<TransitionResponses*, std::size_t>> evaluations;
  for (auto& [number, added] : worth) {
    const std::size_t count = added->responses->evaluations();
    if (count == 0 || count >= added->columns.size()) added->responses.reset();
    for (std::size_t k = 0; added->responses && k < count; ++k) evaluations.emplace_back(added->responses.get(), k);
  }
  model.side_by_side(evaluations.size(), threads,
                     [&](std::size_t i) { evaluations[i].first->evaluate(evaluations[i].second); });
  for (const auto& [number, added] : numbers) {
    if (!added.responses) others.insert(others.end(), added.columns.begin(), added.columns.end());
    for (std::size_t i = 0; added.responses && i < added.columns.size(); ++i) {
      const ScannedColumn& one = added.columns[i];
      added.responses->fill(*model.addition(*one.term, one.parameter), one.column, all);
    }
  }
  return others;
}

// Projects what the fitted parameters could take up out of scores and information, which makes them efficient. Returns
// the columns after that projection.
Derivatives project(const TransitionModel& model, const Fit& fit, const Derivatives& all, EffectScan& scan) {
  const Eigen::Index events = all.slope.rows();
  const Eigen::Map<const Eigen::VectorXd> z(fit.evaluation.score.data(), events);
  const Eigen::MatrixXd stretch = all.slope + z.asDiagonal() * all.change;
  const Derivatives& held = fit.derivatives;
  const Eigen::MatrixXd held_stretch = held.slope + z.asDiagonal() * held.change;
  const Eigen::MatrixXd cross =
      held.change.transpose() * all.change + held_stretch.transpose() * stretch;  // [held x columns]
  Eigen::MatrixXd weights = cross;
  if (held.slope.cols() > 0) {
    const Eigen::MatrixXd root = resolved_root(fit.information);
    weights = root * (root.transpose() * cross);
  }
  scan.information = all.change.transpose() * all.change + stretch.transpose() * stretch;
  scan.whole = scan.information.diagonal();
  scan.information -= cross.transpose() * weights;
  Derivatives efficient{all.slope - held.slope * weights, all.change - held.change * weights};
  scan.by_trial = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(model.trials()), all.slope.cols());
  for (Eigen::Index k = 0; k < events; ++k)
    scan.by_trial.row(static_cast<Eigen::Index>(model.events()[static_cast<std::size_t>(k)].trial)) +=
        efficient.slope.row(k);
  scan.by_prior = Eigen::MatrixXd(0, all.slope.cols());
  if (const Eigen::VectorXd scatter = prior_scatter(model, fit); scatter.size() == weights.rows())
    scan.by_prior = scatter.asDiagonal() * weights;
  scan.trials_suffice =
      model.trials() >= Rules::enough_trials && model.events().size() >= Rules::enough_transitions * model.trials();
  std::size_t steps = 0;
  for (const std::size_t some : model.transitions()) steps += some;
  scan.steps_suffice =
      scan.trials_suffice || (model.trials() >= Rules::least_trials_to_explain &&
                              steps >= std::max(Rules::enough_steps_in_all, Rules::enough_long_steps * model.trials()));
  // At the fit the nuisances' scores balance their prior's: the plain sum of the slopes is efficient already.
  scan.scores = all.slope.colwise().sum();
  return efficient;
}

// Divides the gain that the best variant of an effect promises between stances and collisions, in proportion to the
// information that each holds.
PhaseGain gain_by_phase(const TransitionModel& model, const Fit& fit, const Derivatives& efficient,
                        const ScannedEffect& effect) {
  const Eigen::VectorXd& start = effect.start[effect.best];
  const Eigen::Index first = effect.first[effect.best];
  const Eigen::VectorXd slope = efficient.slope.middleCols(first, start.size()) * start;
  const Eigen::VectorXd change = efficient.change.middleCols(first, start.size()) * start;
  PhaseGain gain;
  for (std::size_t i = 0; i < model.events().size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    gain.of(model.events()[i]) +=
        std::pow(change[row], 2) + std::pow(slope[row] + fit.evaluation.score[i] * change[row], 2);
  }
  const double whole = gain.collisions + gain.stances;
  if (!(whole > 0)) return {};
  gain.collisions *= effect.gain[effect.best] / whole;
  gain.stances *= effect.gain[effect.best] / whole;
  return gain;
}

}  // namespace

const ScannedEffect* EffectScan::find(const Candidate* candidate) const {
  const auto found = std::ranges::find(effects, candidate, &ScannedEffect::candidate);
  return found == effects.end() ? nullptr : &*found;
}

EffectScan scan_effects(const TransitionModel& model, const Fit& fit, const std::vector<const Candidate*>& candidates,
                        int threads, const ScanBeside& beside) {
  EffectScan scan;
  std::vector<ScannedTerm> scanned;
  Eigen::Index columns = 0;
  for (const Candidate* candidate : candidates)
    if (!candidate->parameters.empty() && candidate->undecidable.empty())
      scan.effects.push_back(list_terms(*candidate, beside, columns, scanned));
  const auto events = static_cast<Eigen::Index>(model.events().size());
  Derivatives all{Eigen::MatrixXd::Zero(events, columns), Eigen::MatrixXd::Zero(events, columns)};
  const std::vector<ScannedColumn> alone = fill_by_responses(model, fit, list_columns(scanned), beside, threads, all);
  model.side_by_side(alone.size(), threads, [&](std::size_t i) { differentiate(model, fit, alone[i], beside, all); });
  const Derivatives efficient = project(model, fit, all, scan);
  for (ScannedEffect& effect : scan.effects) {
    const auto count = static_cast<Eigen::Index>(effect.candidate->parameters.size());
    for (const Eigen::Index first : effect.first) {
      Eigen::VectorXd start;
      effect.gain.push_back(promised_gain(*effect.candidate, scan.scores.segment(first, count),
                                          root_of_variant(scan, *effect.candidate, first), &start));
      effect.start.push_back(start);
    }
    effect.best = falling_order(effect.gain).front();
    effect.by_phase = gain_by_phase(model, fit, efficient, effect);
    effect.columns = {all.slope.middleCols(effect.first[effect.best], count),
                      all.change.middleCols(effect.first[effect.best], count),
                      std::vector<double>(effect.candidate->parameters.size())};
  }
  return scan;
}

namespace {

// Returns scores whose rows, multiplied by independent standard normals and summed, are a draw of chance.
Eigen::MatrixXd rows_of_chance(const EffectScan& scan) {
  // They are taken around their mean, so that a gap does not count as chance.
  const Eigen::RowVectorXd mean = scan.by_trial.colwise().mean();
  Eigen::MatrixXd rows = scan.by_trial.rowwise() - mean;
  if (scan.trials_suffice) {
    rows.conservativeResize(rows.rows() + scan.by_prior.rows(), Eigen::NoChange);
    rows.bottomRows(scan.by_prior.rows()) = scan.by_prior;
    return rows;
  }
  // Trials that scatter more than their transitions would by themselves widen it.
  const double trials = static_cast<double>(rows.rows());
  const Eigen::ArrayXd scatter = rows.colwise().squaredNorm().transpose() * (trials / std::max(1.0, trials - 1));
  const Eigen::ArrayXd own = scan.information.diagonal().cwiseMax(resolved_share * scan.whole).array().max(1e-300);
  rows = markov::symmetric_root(scan.information).transpose() * (scatter / own).max(1).sqrt().matrix().asDiagonal();
  return rows;
}

}  // namespace

ChanceGains::ChanceGains(const EffectScan& scan, int draws, std::uint64_t seed) {
  if (draws < 1) throw std::invalid_argument(fmt::format("draws: {} is below 1", draws));
  const Eigen::MatrixXd rows = rows_of_chance(scan);
  std::vector<std::vector<Eigen::MatrixXd>> roots(scan.effects.size());  // by effect and variant
  for (std::size_t e = 0; e < scan.effects.size(); ++e)
    for (const Eigen::Index first : scan.effects[e].first)
      roots[e].push_back(root_of_variant(scan, *scan.effects[e].candidate, first));
  std::vector<std::vector<double>> gains(scan.effects.size());  // by effect and draw
  for (int draw = 0; draw < draws; ++draw) {
    const std::vector<double> normals = normal_multipliers(
        seed, static_cast<std::uint64_t>(draw), DrawStream::chance_of_effects, static_cast<std::size_t>(rows.rows()));
    const Eigen::VectorXd multipliers = Eigen::VectorXd::Map(normals.data(), rows.rows());
    const Eigen::VectorXd score = rows.transpose() * multipliers;
    for (std::size_t e = 0; e < scan.effects.size(); ++e) {
      const ScannedEffect& effect = scan.effects[e];
      const auto count = static_cast<Eigen::Index>(effect.candidate->parameters.size());
      double largest = 0;
      for (std::size_t v = 0; v < roots[e].size(); ++v)
        largest = std::max(
            largest, promised_gain(*effect.candidate, score.segment(effect.first[v], count), roots[e][v], nullptr));
      gains[e].push_back(largest);
    }
  }
  for (std::size_t e = 0; e < gains.size(); ++e) {
    const Candidate* effect = scan.effects[e].candidate;
    const bool held = std::ranges::any_of(effect->parameters, [](const FreeParameter& p) { return p.prior_sd > 0; });
    effects_.push_back({effect, static_cast<double>(effect->parameters.size()), held, gains[e]});
    std::sort(effects_[e].sorted.begin(), effects_[e].sorted.end(), std::greater<>());
  }
  for (int draw = 0; draw < draws; ++draw) {
    double least = 1;
    for (std::size_t e = 0; e < gains.size(); ++e)
      least = std::min(least, effects_[e].p_value(gains[e][static_cast<std::size_t>(draw)]));
    least_.push_back(least);
  }
  std::sort(least_.begin(), least_.end());
}

double ChanceGains::p_value(const Candidate* effect, double gain) const {
  for (const ByChance& one : effects_)
    if (one.effect == effect) return one.p_value(gain);
  throw std::invalid_argument("ChanceGains::p_value: the effect was not scanned");
}

// An effect that a narrow prior holds near its neutral value gains almost nothing by chance, so that even a negligible
// gain would look significant. Its p-value is therefore at least the chi-squared one of a single free parameter.
double ChanceGains::ByChance::p_value(double gain) const {
  return held ? std::max(drawn_p_value(gain), std::erfc(std::sqrt(0.5 * std::max(0.0, gain)))) : drawn_p_value(gain);
}

double ChanceGains::ByChance::drawn_p_value(double gain) const {
  const auto draws = static_cast<double>(sorted.size());
  const auto more = static_cast<double>(
      std::lower_bound(sorted.begin(), sorted.end(), gain, [](double s, double g) { return s >= g; }) - sorted.begin());
  const double counted = (more + 1) / (draws + 1);
  // Beyond the largest few per cent the tail is taken as chi-squared.
  const double anchor = sorted[static_cast<std::size_t>(far_out * draws)];
  if (gain <= anchor || anchor <= 0) return counted;
  return std::min(1.0, far_out * std::pow(gain / anchor, degrees / 2 - 1) * std::exp(-(gain - anchor) / 2));
}

double ChanceGains::look_elsewhere(double p) const {
  const auto draws = static_cast<double>(least_.size());
  const auto fewer = static_cast<double>(std::upper_bound(least_.begin(), least_.end(), p) - least_.begin());
  const double anchor = least_[static_cast<std::size_t>(far_out * draws)];
  if (p >= anchor) return (fewer + 1) / (draws + 1);
  return std::min(1.0, far_out * p / anchor);
}

}  // namespace metastable::analysis
