#include "analysis/gap/trial_groups.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <string_view>
#include <utility>

#include "analysis/fitting/rules.h"
#include "analysis/statistics/median.h"
#include "analysis/statistics/random.h"
#include "dynamics/numerics/truncated_normal.h"

namespace metastable::analysis {
namespace {

constexpr std::size_t fewest_in_group = 3;
constexpr double least_share = 0.1;  // The smaller group holds this share of the trials.
constexpr int split_draws = 2000;    // for the chance level of one split
constexpr int counted_draws = 60;    // beyond which its tail follows an exponential law
constexpr double poor_share = 0.1;   // A trial says next to nothing with this share of a step's usual information.
constexpr double most_poor = 0.1;    // Trials that say so little may hold this share of the steps.
// Nearly all steps gain, or nearly all lose, by a parameter that changes the spread of scores; some gain and others
// lose by one that moves their mean. One machine of two that is far off the model outweighs the other, so that the
// trials that fit best are asked by themselves, too.
constexpr double one_sided = 0.8;        // Such a share of all gains and losses goes one way.
constexpr std::size_t best_fitting = 5;  // The best fitting trials are one of so many.
constexpr double least_apart = 3;        // Groups that lie fewer sds of a trial apart are none.
constexpr std::size_t most_named = 5;    // The sentence names so many trials.
constexpr double least_weight = 1e-12;
constexpr int drift_degree = 3;                 // of a polynomial that a break is held against
constexpr std::size_t fewest_for_a_break = 12;  // trials
constexpr std::string_view by_label = "_by_";   // in the id of an effect, before the label that it goes by
constexpr std::size_t one_astray = 10;          // One trial of so many in the smaller group may have another label.

struct GroupSums {
  double weight = 0, first = 0, second = 0;
  void add(const TrialValue& one, double sign = 1) {
    weight += sign * one.weight;
    first += sign * one.weight * one.value;
    second += sign * one.weight * one.value * one.value;
  }
  double mean() const { return first / weight; }
  double squares() const { return std::max(0.0, second - first * first / weight); }
};

std::size_t fewest_of(std::size_t trials) {
  return std::max(fewest_in_group, static_cast<std::size_t>(std::ceil(least_share * static_cast<double>(trials))));
}

// Subtracts the mean of each condition: what a model lacks may say something else in each. Conditions of few trials
// are left out, because their values would next to vanish.
std::vector<TrialValue> beside_their_condition(const TransitionModel& model, std::vector<TrialValue> values) {
  std::vector<std::size_t> condition(model.trials());
  for (const Event& event : model.events()) condition[event.trial] = event.condition;
  std::map<std::size_t, GroupSums> sums;
  std::map<std::size_t, std::size_t> trials;
  for (const TrialValue& one : values) sums[condition[one.trial]].add(one), ++trials[condition[one.trial]];
  std::erase_if(values, [&](const TrialValue& one) { return trials[condition[one.trial]] < fewest_in_group; });
  for (TrialValue& one : values) one.value -= sums[condition[one.trial]].mean();
  return values;
}

// A parameter along which trials may lie apart.
struct Direction {
  std::string name;
  Eigen::VectorXd change;   // [events] of the score with the parameter
  Eigen::VectorXd stretch;  // [events] of log d score / d observed speed with the parameter
};

// Returns the direction of one parameter. @param score  [events] where the derivatives were taken
Direction direction(std::string name, const Derivatives& columns, Eigen::Index p, const std::vector<double>& score) {
  const Eigen::Map<const Eigen::VectorXd> z(score.data(), static_cast<Eigen::Index>(score.size()));
  return {std::move(name), columns.change.col(p), columns.slope.col(p) + z.cwiseProduct(columns.change.col(p))};
}

// Sums up what the steps of a trial gain from a parameter.
struct OneSided {
  double gains = 0, sizes = 0, squares = 0, steps = 0;
  void add(double gain, double score) {
    gains += gain;
    sizes += std::abs(gain);
    squares += score * score;
    ++steps;
  }
};

// Says whether a parameter changes the spread of scores: nearly all steps gain by it, or nearly all lose.
bool changes_spread(std::vector<OneSided> trials) {
  std::erase_if(trials, [](const OneSided& one) { return one.steps == 0; });
  std::ranges::sort(trials, {}, [](const OneSided& one) { return one.squares / one.steps; });
  const auto goes_one_way = [&](std::size_t count) {
    double gains = 0, sizes = 0;
    for (std::size_t t = 0; t < count; ++t) gains += trials[t].gains, sizes += trials[t].sizes;
    return std::abs(gains) > one_sided * sizes;
  };
  const std::size_t few = std::min(trials.size(), std::max(fewest_in_group, trials.size() / best_fitting));
  return goes_one_way(trials.size()) && goes_one_way(few);
}

// Returns [trials] what the scores say of a parameter by itself, in the trials whose steps tell of it; nothing where
// trials with many of the steps do not, as of what depends on their order, and of what changes the spread of scores.
// Steps weigh alike: trials far off the model have another information, and few of them must not stand for all. Where
// the change of a score depends on what was observed, change times score is not 0 in the mean, but what the stretch is:
// without it, trials that differ by their design alone, as slow stretches of a run do from fast ones, would lie apart.
std::vector<TrialValue> trial_values(const TransitionModel& model, const Direction& direction,
                                     const std::vector<double>& score) {
  std::vector<double> along(model.trials()), weight(model.trials()), events(model.trials());
  std::vector<OneSided> sides(model.trials());
  for (std::size_t e = 0; e < model.events().size(); ++e) {
    const Event& event = model.events()[e];
    if (event.kind == EventKind::launch) continue;
    const bool outcome = event.kind == EventKind::rest || event.kind == EventKind::survival;  // which has no speed
    const double c = direction.change[static_cast<Eigen::Index>(e)];
    along[event.trial] += c * score[e] - (outcome ? 0 : direction.stretch[static_cast<Eigen::Index>(e)]);
    sides[event.trial].add(c * score[e], score[e]);
    weight[event.trial] += c * c;
    ++events[event.trial];
  }
  std::vector<double> rates;
  for (std::size_t t = 0; t < weight.size(); ++t)
    if (events[t] > 0) rates.push_back(weight[t] / events[t]);
  if (rates.empty() || changes_spread(std::move(sides))) return {};
  const double usual = median(rates);
  double poor = 0, all = 0;
  for (std::size_t t = 0; t < weight.size(); ++t) {
    all += events[t];
    if (!(weight[t] > poor_share * usual * events[t])) poor += events[t];
  }
  if (!(usual > least_weight) || poor > most_poor * all) return {};
  std::vector<TrialValue> values;
  for (std::size_t t = 0; t < weight.size(); ++t)
    if (events[t] > 0 && weight[t] > poor_share * usual * events[t])
      values.push_back({t, along[t] / weight[t], usual * events[t]});
  return beside_their_condition(model, std::move(values));
}

// Says whether an effect is that trials differ from each other.
bool is_spread(const std::string& id) { return id.find("_spread") != std::string::npos; }

// Returns the scores under a hypothesis without what it says of a spread between trials: two groups pass for one.
Evaluation without_spreads(const TransitionModel& model, const Fit& chosen) {
  std::vector<EffectTerm> terms;
  for (const EffectTerm& term : chosen.terms)
    if (!is_spread(term.candidate->id)) terms.push_back(term);
  return terms.size() == chosen.terms.size() ? chosen.evaluation : model.evaluate(chosen.nuisance, terms);
}

std::vector<Direction> directions(const TransitionModel& model, const EffectScan& scan, const Fit& recalibrated) {
  std::vector<Direction> all;
  const Derivatives& held = recalibrated.derivatives;
  const std::vector<double>& score = recalibrated.evaluation.score;
  for (Eigen::Index p = 0; p < std::min(held.change.cols(), static_cast<Eigen::Index>(model.nuisances().size())); ++p)
    all.push_back(direction(model.nuisances()[static_cast<std::size_t>(p)].name, held, p, score));
  for (const ScannedEffect& effect : scan.effects)
    for (Eigen::Index p = 0; p < effect.columns.change.cols(); ++p)
      if (!is_spread(effect.candidate->id)) all.push_back(direction(effect.candidate->id, effect.columns, p, score));
  return all;
}

// Returns the sum of squares that a polynomial in the order of trials leaves.
double left_by_a_drift(const std::vector<TrialValue>& values) {
  const auto n = static_cast<Eigen::Index>(values.size());
  Eigen::MatrixXd basis(n, drift_degree + 1);
  Eigen::VectorXd y(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const TrialValue& one = values[static_cast<std::size_t>(i)];
    const double root = std::sqrt(one.weight), at = 2 * (static_cast<double>(i) + 0.5) / static_cast<double>(n) - 1;
    for (int power = 0; power <= drift_degree; ++power) basis(i, power) = root * std::pow(at, power);
    y[i] = root * one.value;
  }
  return (y - basis * basis.householderQr().solve(y)).squaredNorm();
}

// Returns how often values drawn trial by trial gain as much.
// @param value  of a uniform number  @param groups  of the values: their gain counts
template <class Value, class Groups>
double by_chance(double gain, std::size_t trials, std::uint64_t seed, Value value, Groups groups) {
  std::vector<double> gains;
  for (std::uint64_t draw = 0; draw < split_draws; ++draw) {
    std::vector<TrialValue> values;
    for (std::size_t t = 0; t < trials; ++t)
      values.push_back({t, value(uniform_at(seed, draw, t, static_cast<std::uint64_t>(DrawStream::trial_groups))), 1});
    const std::optional<TwoGroups> found = groups(std::move(values));
    gains.push_back(found ? found->gain : 0);
  }
  std::ranges::sort(gains, std::greater<>());
  const double edge = gains[counted_draws];
  if (gain <= edge)
    return static_cast<double>(std::ranges::count_if(gains, [&](double g) { return g >= gain; })) / split_draws;
  double excess = 0;
  for (int i = 0; i < counted_draws; ++i) excess += (gains[static_cast<std::size_t>(i)] - edge) / counted_draws;
  return excess > 0 ? static_cast<double>(counted_draws) / split_draws * std::exp(-(gain - edge) / excess) : 0;
}

// Returns [trials] whether an effect acts on a trial; nothing where it acts on some of a trial's steps alone.
std::optional<std::vector<bool>> acts_on(const TransitionModel& model, const EffectTerm& term) {
  const std::optional<Addition> added = model.addition(term, 0);
  if (!added) return {};
  double most = 0;
  for (const double weight : added->weights) most = std::max(most, std::abs(weight));
  std::vector<bool> acts;
  auto step = added->weights.begin();
  for (const std::size_t steps : model.transitions()) {
    const auto end = step + static_cast<std::ptrdiff_t>(steps);
    const auto on = std::count_if(step, end, [&](double weight) { return std::abs(weight) > most / 2; });
    if (on > 0 && on < end - step) return {};
    acts.push_back(on > 0);
    step = end;
  }
  return acts;
}

// Returns the label whose values are the two groups, as the effects by it tell them; empty: there is none.
std::string label_of(const TransitionModel& model, const TwoGroups& groups) {
  const std::size_t most_astray = groups.fewer.size() / one_astray, not_sorted = model.trials() - groups.sorted;
  const auto are_these = [&](const std::vector<bool>& acts, bool value) {
    std::size_t others = 0, missing = 0;
    for (std::size_t t = 0; t < acts.size(); ++t) {
      const bool in_group = std::ranges::binary_search(groups.fewer, t);
      others += acts[t] == value && !in_group;
      missing += acts[t] != value && in_group;
    }
    return missing <= most_astray && others <= most_astray + not_sorted;
  };
  for (const Candidate& one : model.candidates()) {
    const std::size_t at = one.id.rfind(by_label);
    if (at == std::string::npos || one.parameters.size() != 1) continue;
    for (const std::vector<double>& value : one.variants) {
      if (value.size() != 1) continue;
      const auto acts = acts_on(model, {&one, value, {one.parameters[0].neutral}});
      if (acts && (are_these(*acts, true) || are_these(*acts, false))) return one.id.substr(at + by_label.size());
    }
  }
  return "";
}

}  // namespace

std::optional<TwoGroups> split(std::vector<TrialValue> values) {
  const std::size_t n = values.size(), fewest = fewest_of(n);
  if (n < 2 * fewest) return {};
  std::ranges::sort(values, {}, &TrialValue::value);
  GroupSums all, below, above;
  for (const TrialValue& one : values) all.add(one);
  above = all;
  std::size_t best = 0;
  double within = all.squares(), gap = 0;
  for (std::size_t k = 1; k <= n - fewest; ++k) {
    below.add(values[k - 1]);
    above.add(values[k - 1], -1);
    const double left = below.squares() + above.squares();
    if (k < fewest || left >= within) continue;
    best = k;
    within = left;
    gap = above.mean() - below.mean();
  }
  if (best == 0 || !(within > 0)) return {};
  TwoGroups groups;
  groups.sorted = n;
  groups.within = within;
  groups.gain = static_cast<double>(n) * std::log(all.squares() / within);
  groups.apart = gap / std::sqrt(within / all.weight);
  const bool few_above = 2 * best >= n;
  for (std::size_t i = few_above ? best : 0; i < (few_above ? n : best); ++i) groups.fewer.push_back(values[i].trial);
  std::ranges::sort(groups.fewer);
  return groups;
}

std::optional<TwoGroups> broken(const std::vector<TrialValue>& values) {
  const std::size_t n = values.size(), fewest = fewest_of(n);
  if (n < std::max<std::size_t>(2 * fewest, fewest_for_a_break)) return {};
  GroupSums below, above;
  for (const TrialValue& one : values) above.add(one);
  const double all = above.weight;
  std::size_t best = 0;
  TwoGroups groups;
  for (std::size_t k = 1; k <= n - fewest; ++k) {
    below.add(values[k - 1]);
    above.add(values[k - 1], -1);
    const double left = below.squares() + above.squares();
    if (k < fewest || (best > 0 && left >= groups.within)) continue;
    best = k;
    groups.within = left;
    groups.apart = std::abs(above.mean() - below.mean()) / std::sqrt(left / all);
  }
  if (!(groups.within > 0)) return {};
  groups.sorted = n;
  groups.gain = static_cast<double>(n) * std::log(left_by_a_drift(values) / groups.within);
  const bool few_after = 2 * best >= n;
  for (std::size_t i = few_after ? best : 0; i < (few_after ? n : best); ++i) groups.fewer.push_back(values[i].trial);
  return groups;
}

double split_p_value(double gain, std::size_t trials, std::uint64_t seed) {
  return by_chance(
      gain, trials, seed, [](double u) { return std::sin(2 * std::numbers::pi * u); },
      [](std::vector<TrialValue> values) { return split(std::move(values)); });
}

double break_p_value(double gain, std::size_t trials, std::uint64_t seed) {
  return by_chance(gain, trials, seed, dynamics::normal_quantile,
                   [](const std::vector<TrialValue>& values) { return broken(values); });
}

std::optional<TrialGroups> trial_groups(const TransitionModel& model, const EffectScan& scan, const Fit& recalibrated,
                                        const Fit& chosen, std::uint64_t seed) {
  const std::vector<Direction> all = directions(model, scan, recalibrated);
  for (const bool in_order : {false, true}) {
    const Direction* along = nullptr;
    TwoGroups most;
    for (const Direction& one : all) {
      std::vector<TrialValue> values = trial_values(model, one, recalibrated.evaluation.score);
      std::optional<TwoGroups> groups = in_order ? broken(values) : split(std::move(values));
      if (!groups || (along && groups->gain <= most.gain)) continue;
      along = &one;
      most = *std::move(groups);
    }
    if (!along || !(most.gain > 0) || most.apart < least_apart) continue;
    const double p = (in_order ? break_p_value : split_p_value)(most.gain, most.sorted, seed);
    if (!(p * static_cast<double>(all.size()) < Rules::two_machines_level / 2)) continue;
    if (&chosen != &recalibrated) {
      GroupSums left;
      for (const TrialValue& one : trial_values(model, *along, without_spreads(model, chosen).score)) left.add(one);
      if (left.weight > 0 && most.within > Rules::most_left_by_groups * left.squares()) continue;
    }
    std::string label = label_of(model, most);
    return TrialGroups{along->name, std::move(most), in_order, std::move(label)};
  }
  return {};
}

std::string trial_groups_in_words(const TransitionModel& model, const TrialGroups& found) {
  const std::vector<std::size_t>& fewer = found.groups.fewer;
  std::vector<std::string> names;
  for (std::size_t i = 0; i < std::min(most_named, fewer.size()); ++i) names.push_back(model.trial_name(fewer[i]));
  return fmt::format(
      "the trials fall into two groups{} that one set of parameters does not hold: {} of {} (trials {}{}) lie {:.2g} "
      "sds of a trial from the others along {}{}",
      found.in_order ? ", one after the other," : "", fewer.size(), found.groups.sorted, fmt::join(names, ", "),
      fewer.size() > most_named ? ", ..." : "", found.groups.apart, found.along,
      found.label.empty() ? ": are these the trials of two machines, or of one that was changed?"
                          : fmt::format("; the label {} tells the same groups apart", found.label));
}

}  // namespace metastable::analysis
