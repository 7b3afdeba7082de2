#include "analysis/blind/blind_grade.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <stdexcept>

#include "analysis/blind/at_work_grade.h"
#include "analysis/blind/sized_effect.h"
#include "analysis/blind/sized_walker_effect.h"
#include "analysis/diagnosis/diagnosis_sentences.h"
#include "analysis/statistics/interval_95.h"
#include "dynamics/catalogue/walker_effects.h"

namespace metastable::analysis {
namespace {

constexpr double claim = 0.05;          // adjusted p-value of a claim of where
constexpr double no_power_left = 9;     // 2 Delta log likelihood after recalibration: nobody finds that reliably
constexpr double pair_power_left = 16;  // of each of two effects beside the other: 1x
constexpr double alike_share = 0.25;    // of the cause sets of an effect that another one must be in
constexpr const char* diagnosis_way = "diagnosis, first of its set";

bool contains(const std::vector<std::string>& list, const std::string& one) {
  return std::find(list.begin(), list.end(), one) != list.end();
}

std::string joined(const std::string& a, const std::string& b) { return a + "+" + b; }

using Answer = std::optional<BlindAnswer>;

bool is(const Answer& a, Verdict verdict) { return a && a->verdict == verdict; }
bool gap(const Answer& a) { return a && is_gap(a->verdict); }
bool taken_for_contact(const Answer& a) { return is(a, Verdict::recalibrate) || is(a, Verdict::no_gap); }
bool confident(const Answer& a) { return is(a, Verdict::explained) && a->cause_set.size() == 1; }

std::string said(const Answer& answer) {
  if (!answer) return "no answer";
  if (answer->verdict != Verdict::explained || answer->cause_set.empty()) return verdict_name(answer->verdict);
  return answer->cause_set.front();
}

std::string asked(const BlindTruth& truth) {
  switch (truth.kind) {
    case BlindKind::none:
      return truth.nominal_is_true ? "no gap" : "no gap, contact unlike nominal";
    case BlindKind::effect:
      return truth.effects.front().id;
    case BlindKind::pair:
      return "a pair";
    case BlindKind::outside:
      return "outside: " + truth.outside->id;
    case BlindKind::left_out:
      return "left out";
    case BlindKind::mixed:
      return "mixed";
    case BlindKind::many:
      return "three effects";
  }
  throw std::logic_error("unknown kind");
}

// Returns the true value of a parameter, where it is one number.
std::optional<double> true_value(const BlindTruth& truth, const std::string& effect, const std::string& name) {
  for (const dynamics::Effect& e : truth.effects) {
    if (e.id != effect) continue;
    const dynamics::EffectInfo& info = dynamics::any_effect_info(effect);
    for (std::size_t p = 0; p < info.parameters.size(); ++p)
      if (info.parameters[p].name == name && !info.parameters[p].per_leg) return e.values[p];
  }
  return std::nullopt;
}

// Holds what is counted over the cases; maps are by strength.
struct Tally {
  Proportion alarms, alarms_true, alarms_unlike, place_alarms;
  std::map<int, Proportion> found, found_left, cause, holds, facet;
  std::map<int, std::pair<double, int>> set_size;  // sum, sets
  double beyond_alike = 0, most_beyond_alike = 0;  // names of sets at 2x, sum and most
  Proportion absorbed, interval, shrinkage;
  Proportion both, both_findable, no_third, no_third_first, no_third_alike;
  Proportion misnamed, unexplained, unexplained_left;
  Proportion left_misnamed, left_right;
  std::vector<std::pair<double, bool>> forecasts;  // probability of the first cause, and whether it is right
};

void count_none(Tally& tally, const BlindTruth& truth, const Answer& answer) {
  const bool alarm = !answer || gap(answer) || (truth.nominal_is_true && is(answer, Verdict::recalibrate));
  tally.alarms.count(alarm);
  (truth.nominal_is_true ? tally.alarms_true : tally.alarms_unlike).count(alarm);
  tally.place_alarms.count(!answer || std::any_of(answer->where.begin(), answer->where.end(),
                                                  [](const auto& w) { return w.p_adjusted <= claim; }));
}

// Counts the 90 % intervals of an answer whose first cause is the right one.
void count_intervals(Tally& tally, const BlindTruth& truth, const BlindAnswer& answer) {
  for (const AnsweredParameter& p : answer.parameters) {
    const std::optional<double> value = true_value(truth, p.effect, p.name);
    if (value && p.lower && p.upper && *p.lower < *p.upper)
      tally.interval.count(*p.lower <= *value && *value <= *p.upper);
  }
  // The true effect leaves nothing: all of the gap is closed.
  if (answer.closed_lower && answer.closed_upper)
    tally.shrinkage.count(*answer.closed_lower <= 1 && *answer.closed_upper >= 1 - 1e-9);
}

void count_effect(Tally& tally, const BlindTruth& truth, const Answer& answer) {
  const std::string& id = truth.effects.front().id;
  const int strength = truth.strength;
  const bool in_set = answer && contains(answer->cause_set, id);
  const bool left = !is_recalibration(id) && truth.left >= no_power_left;
  tally.found[strength].count(answer && answer->verdict != Verdict::no_gap);
  if (left) {
    tally.found_left[strength].count(gap(answer));
    if (!answer || gap(answer)) tally.cause[strength].count(in_set);
  } else {
    tally.absorbed.count(in_set || taken_for_contact(answer));
  }
  if (left && strength >= 2) {
    const std::vector<std::string>& places = truth.slope_deg ? rightful_walker_places(id) : rightful_places(id);
    tally.facet[strength].count(answer && std::any_of(answer->where.begin(), answer->where.end(), [&](const auto& w) {
                                  return w.p_adjusted <= claim &&
                                         (contains(places, w.facet) || contains(places, ":" + w.aspect));
                                }));
  }
  if (!answer) return;
  const bool first = !answer->causes.empty() && answer->causes.front().first == id;
  if (answer->verdict == Verdict::explained) {
    tally.holds[strength].count(in_set);
    tally.set_size[strength].first += static_cast<double>(answer->cause_set.size());
    ++tally.set_size[strength].second;
    if (strength == 2) {
      const std::size_t group = std::max<std::size_t>(1, answer->alike.size());
      const auto beyond = static_cast<double>(answer->cause_set.size() - std::min(group, answer->cause_set.size()));
      tally.beyond_alike += beyond;
      tally.most_beyond_alike = std::max(tally.most_beyond_alike, beyond);
    }
    if (!answer->causes.empty()) tally.forecasts.emplace_back(answer->causes.front().second, first);
  }
  if (first) count_intervals(tally, truth, *answer);
}

void count_pair(Tally& tally, const BlindTruth& truth, const Answer& answer) {
  const std::string &a = truth.effects[0].id, &b = truth.effects[1].id;
  const bool named_both =
      answer && (contains(answer->cause_set, joined(a, b)) || contains(answer->cause_set, joined(b, a)));
  tally.both.count(named_both);
  if (!truth.left_by_effect.empty() && std::all_of(truth.left_by_effect.begin(), truth.left_by_effect.end(),
                                                   [](double left) { return left >= pair_power_left; }))
    tally.both_findable.count(named_both);
  if (!is(answer, Verdict::explained) || answer->cause_set.empty()) return;
  const auto of_the_two = [&](const std::string& name) {
    const std::vector<std::string> named = effects_of_cause(name);
    return std::all_of(named.begin(), named.end(), [&](const std::string& id) { return id == a || id == b; });
  };
  tally.no_third.count(std::any_of(answer->cause_set.begin(), answer->cause_set.end(), of_the_two));
  tally.no_third_first.count(of_the_two(answer->cause_set.front()));
  tally.no_third_alike.count(of_the_two(answer->cause_set.front()) || std::ranges::any_of(answer->alike, of_the_two));
}

void count_outside(Tally& tally, const BlindTruth& truth, const Answer& answer) {
  tally.misnamed.count(!answer || confident(answer));
  tally.unexplained.count(is(answer, Verdict::unexplained));
  if (truth.left >= no_power_left) tally.unexplained_left.count(is(answer, Verdict::unexplained));
}

using Groups = std::map<std::string, std::vector<std::string>>;

void count_left_out(Tally& tally, const BlindTruth& truth, const Answer& answer, const Groups& alike) {
  const auto group = alike.find(truth.effects.front().id);
  const bool own = is(answer, Verdict::explained) && group != alike.end() &&
                   std::all_of(answer->cause_set.begin(), answer->cause_set.end(),
                               [&](const std::string& name) { return contains(group->second, name); });
  tally.left_misnamed.count(!answer || (confident(answer) && !own));
  const bool absorbed = truth.left < no_power_left && taken_for_contact(answer);
  tally.left_right.count(is(answer, Verdict::unexplained) || own || absorbed);
}

// Finds ambiguity groups, from the cause sets of the effects that were in the catalogue.
Groups ambiguity_groups(const std::vector<BlindTruth>& truths, const std::vector<Answer>& answers) {
  std::map<std::string, std::map<std::string, int>> together;
  std::map<std::string, int> sets;
  for (std::size_t i = 0; i < truths.size(); ++i)
    if (truths[i].kind == BlindKind::effect && is(answers[i], Verdict::explained)) {
      const std::string& id = truths[i].effects.front().id;
      ++sets[id];
      for (const std::string& name : answers[i]->cause_set)
        if (name != id && effects_of_cause(name).size() == 1) ++together[id][name];
    }
  Groups alike;
  for (const auto& [id, others] : together)
    for (const auto& [other, count] : others)
      if (count >= alike_share * sets[id]) alike[id].push_back(other);
  return alike;
}

// Lists the effects that one way of answering names: none where the answer does not tell of a criterion.
std::vector<std::string> named_by(const std::string& way, const BlindAnswer& answer) {
  if (const auto found = answer.stepwise.find(way); found != answer.stepwise.end()) return found->second;
  if (way != diagnosis_way) return {};
  if (answer.cause_set.empty() || !is_gap(answer.verdict)) return {};
  return effects_of_cause(answer.cause_set.front());
}

void count_way(WayGrade& grade, const BlindTruth& truth, const std::vector<std::string>& named) {
  const auto is_true = [&](const std::string& id) {
    return std::ranges::any_of(truth.effects, [&](const dynamics::Effect& effect) { return effect.id == id; });
  };
  const auto right = static_cast<std::size_t>(std::ranges::count_if(named, is_true));
  switch (truth.kind) {
    case BlindKind::none:
      return grade.alarms.count(!named.empty());
    case BlindKind::effect:
      if (is_recalibration(truth.effects.front().id) || truth.left < no_power_left) return;
      grade.exact.count(right == 1 && named.size() == 1);
      grade.in.count(right == 1);
      return grade.wrong.count(named.size() > right);
    case BlindKind::pair:
      grade.both.count(right == 2);
      return grade.third.count(named.size() > right);
    case BlindKind::outside:
      return grade.outside.count(!named.empty());
    case BlindKind::left_out:
      return;
    case BlindKind::mixed:
      grade.mixed.count(right == truth.effects.size());
      return grade.mixed_wrong.count(named.size() > right);
    case BlindKind::many:
      grade.three.count(right == truth.effects.size());
      return grade.two_of_three.count(right + 1 >= truth.effects.size());
  }
}

// Sets the diagnosis beside the criteria that all answers tell of, over the cases that were answered.
std::vector<WayGrade> ways(const std::vector<BlindTruth>& truths, const std::vector<Answer>& answers) {
  std::vector<WayGrade> all(1);
  all.front().way = diagnosis_way;
  for (const Answer& answer : answers)
    if (answer) {
      for (const auto& [criterion, effects] : answer->stepwise) all.emplace_back().way = criterion;
      break;
    }
  for (std::size_t i = 0; i < truths.size(); ++i)
    if (answers[i])
      for (WayGrade& grade : all) count_way(grade, truths[i], named_by(grade.way, *answers[i]));
  return all;
}

// Lists the measures beside what is asked for.
std::vector<Grade> measures(Tally tally) {
  std::vector<Grade> grades;
  const auto add = [&](std::string measure, const Proportion& p, double low, double high) {
    grades.push_back({std::move(measure), p, low, high});
  };
  add("false alarms where there is no gap", tally.alarms, 0, 0.05);
  grades.back().most_upper = 0.09;
  add("  nominal contact true", tally.alarms_true, 0, 0.05);
  add("  nominal contact not true", tally.alarms_unlike, 0, 0.05);
  for (const auto& [strength, aim] : {std::pair{1, 0.85}, {2, 0.99}, {4, 0.99}})
    add(fmt::format("effect found, {}x", strength), tally.found[strength], aim, 1);
  for (const auto& [strength, aim] : {std::pair{1, 0.85}, {2, 0.99}, {4, 0.99}})
    add(fmt::format("effect with power left found after recalibration, {}x", strength), tally.found_left[strength], aim,
        1);
  for (const auto& [strength, aim] : {std::pair{1, 0.95}, {2, 0.99}, {4, 0.99}})
    add(fmt::format("cause right up to stated ambiguity, {}x", strength), tally.cause[strength], aim, 1);
  for (const int strength : {1, 2, 4})
    add(fmt::format("95 % set holds the truth, {}x", strength), tally.holds[strength], 0.95, 1);
  add("effect outside the catalogue confidently misnamed", tally.misnamed, 0, 0.1);
  add("effect outside the catalogue called unexplained", tally.unexplained, 0.7, 1);
  add("  with power left for who knows it", tally.unexplained_left, 0.7, 1);
  add("left-out effect confidently misnamed", tally.left_misnamed, 0, 0.1);
  add("left-out effect unexplained, or of its ambiguity group", tally.left_right, 0.7, 1);
  add("two effects: both named", tally.both, 0.7, 1);
  add("  each with power left beside the other", tally.both_findable, 0.7, 1);
  add("two effects: no false third, up to stated ambiguity", tally.no_third, 0.9, 1);
  add("  in the first of the set", tally.no_third_first, 0.9, 1);
  add("  in the first of the set, or what is alike to it", tally.no_third_alike, 0.9, 1);
  add("where: claims in cases without a gap", tally.place_alarms, 0, 0.1);
  for (const int strength : {2, 4})
    add(fmt::format("where: right facet, {}x", strength), tally.facet[strength], 0.9, 1);
  add("90 % intervals of effect size hold the truth", tally.interval, 0.87, 0.93);
  add("90 % intervals of shrinkage hold the truth", tally.shrinkage, 0.87, 0.93);
  add("effect absorbed by recalibration not blamed on another", tally.absorbed, 0.95, 1);
  return grades;
}

std::vector<CalibrationBin> calibration(const std::vector<std::pair<double, bool>>& forecasts) {
  std::vector<CalibrationBin> bins;
  for (const double from : {0.0, 0.3, 0.5, 0.7, 0.9}) {
    CalibrationBin bin{from, from == 0.9 ? 1.0 : from + (from == 0.0 ? 0.3 : 0.2), 0, 0, {}};
    for (const auto& [probability, is_right] : forecasts)
      if (probability >= bin.from && (probability < bin.to || bin.to == 1.0)) {
        bin.right.count(is_right);
        bin.mean_probability += probability;
      }
    bin.count = bin.right.of;
    if (bin.count > 0) bin.mean_probability /= bin.count;
    bins.push_back(bin);
  }
  return bins;
}

}  // namespace

std::pair<double, double> wilson(const Proportion& proportion) {
  if (proportion.of == 0) return {0, 1};
  constexpr double z = normal_95;
  const double n = proportion.of, p = proportion.right / n;
  const double middle = (p + z * z / (2 * n)) / (1 + z * z / n);
  const double half = z / (1 + z * z / n) * std::sqrt(p * (1 - p) / n + z * z / (4 * n * n));
  return {proportion.right == 0 ? 0 : std::max(0.0, middle - half),
          proportion.right == proportion.of ? 1 : std::min(1.0, middle + half)};
}

BlindGrades grade(const std::vector<BlindTruth>& truths, const std::vector<std::optional<BlindAnswer>>& answers) {
  if (truths.size() != answers.size())
    throw std::invalid_argument(fmt::format("grade: {} truths and {} answers", truths.size(), answers.size()));
  BlindGrades result;
  result.alike = ambiguity_groups(truths, answers);
  Tally tally;
  for (std::size_t i = 0; i < truths.size(); ++i) {
    const BlindTruth& truth = truths[i];
    const Answer& answer = answers[i];
    ++result.confusion[asked(truth)][said(answer)];
    switch (truth.kind) {
      case BlindKind::none:
        count_none(tally, truth, answer);
        break;
      case BlindKind::effect:
        count_effect(tally, truth, answer);
        break;
      case BlindKind::pair:
        count_pair(tally, truth, answer);
        break;
      case BlindKind::outside:
        count_outside(tally, truth, answer);
        break;
      case BlindKind::left_out:
        count_left_out(tally, truth, answer, result.alike);
        break;
      case BlindKind::mixed:
      case BlindKind::many:
        break;  // at_work_grades() has them
    }
  }
  result.grades = measures(tally);
  std::ranges::move(at_work_grades(truths, answers), std::back_inserter(result.grades));
  std::ranges::move(share_grades(truths, answers), std::back_inserter(result.grades));
  std::ranges::move(steps_grades(truths, answers), std::back_inserter(result.grades));
  for (const auto& [strength, size] : {std::pair{1, &result.mean_set_size_1x}, {2, &result.mean_set_size_2x}})
    if (tally.set_size[strength].second > 0) *size = tally.set_size[strength].first / tally.set_size[strength].second;
  if (const int sets = tally.set_size[2].second; sets > 0)
    result.mean_beyond_alike_2x = tally.beyond_alike / sets, result.most_beyond_alike_2x = tally.most_beyond_alike;
  result.calibration = calibration(tally.forecasts);
  result.ways = ways(truths, answers);
  return result;
}

}  // namespace metastable::analysis
