#include "analysis/blind/at_work_grade.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <tuple>

#include "analysis/diagnosis/at_work.h"
#include "analysis/statistics/interval_95.h"

namespace metastable::analysis {
namespace {

constexpr double power_of_one = 9, power_of_several = 16;  // left beside the others: less is not asked for
constexpr double enough_rests = 30;                        // counted, to know the expected steps by
constexpr double unnamed_said = 0.2;                       // probability of something without a name

using Answer = std::optional<BlindAnswer>;

bool is_there(const BlindTruth& truth, const BlindAnswer::SaidAtWork& said) {
  return std::ranges::any_of(truth.effects, [&](const dynamics::Effect& effect) {
    return std::ranges::find(said.effects, effect.id) != said.effects.end();
  });
}

bool is_said(const BlindAnswer& answer, const std::string& effect) {
  return std::ranges::any_of(answer.at_work, [&](const BlindAnswer::SaidAtWork& said) {
    return said.probability >= Rules{}.least_at_work && std::ranges::find(said.effects, effect) != said.effects.end();
  });
}

bool says_a_false_one(const BlindTruth& truth, const BlindAnswer& answer) {
  return std::ranges::any_of(answer.at_work, [&](const BlindAnswer::SaidAtWork& said) {
    return said.probability >= Rules{}.least_at_work && !is_there(truth, said);
  });
}

std::size_t said_of(const BlindTruth& truth, const BlindAnswer& answer) {
  return static_cast<std::size_t>(
      std::ranges::count_if(truth.effects, [&](const dynamics::Effect& effect) { return is_said(answer, effect.id); }));
}

struct AtWorkTally {
  Proportion none, outside, one, second, both, third, three, two, fourth, mixed, mixed_unnamed, mixed_unnamed_left,
      mixed_false;
  Proportion likely, surely;  // said with 0.8 to 0.95, with 0.95 and more
};

bool all_have_power(const BlindTruth& truth) {
  return !truth.left_by_effect.empty() &&
         std::ranges::all_of(truth.left_by_effect, [](double left) { return left >= power_of_several; });
}

void count_kind(AtWorkTally& tally, const BlindTruth& truth, const Answer& answer) {
  const std::size_t right = answer ? said_of(truth, *answer) : 0;
  const bool wrong = !answer || says_a_false_one(truth, *answer);
  switch (truth.kind) {
    case BlindKind::none:
      return tally.none.count(wrong);
    case BlindKind::outside:
      return tally.outside.count(wrong);
    case BlindKind::effect:
      if (truth.strength < 2 || truth.left < power_of_one || is_recalibration(truth.effects.front().id)) return;
      tally.one.count(right == 1);
      return tally.second.count(wrong);
    case BlindKind::pair:
      if (!all_have_power(truth)) return;
      tally.both.count(right == 2);
      return tally.third.count(wrong);
    case BlindKind::many:
      if (!all_have_power(truth)) return;
      tally.three.count(right == 3);
      tally.two.count(right >= 2);
      return tally.fourth.count(wrong);
    case BlindKind::mixed:
      if (!all_have_power(truth)) return;
      tally.mixed.count(right == truth.effects.size());
      tally.mixed_unnamed.count(answer && answer->p_unnamed >= unnamed_said);
      if (truth.left_of_outside.value_or(0) >= power_of_several)
        tally.mixed_unnamed_left.count(answer && answer->p_unnamed >= unnamed_said);
      return tally.mixed_false.count(wrong);
    case BlindKind::left_out:
      return;
  }
}

// Says whether an interval holds what the laboratory counted, which chance moves as well: the interval and the count
// may differ by as much as both leave open together, on the scale of ratios.
bool holds_counted(const std::pair<double, double>& interval, const BlindTruth& truth) {
  const auto [lower, upper] = interval;
  const double steps = truth.collisions_counted / truth.rests_counted;
  if (!std::isfinite(upper) || !(lower > 0)) return lower <= steps && steps <= upper;
  const double half = 0.5 * std::log(upper / lower), by_count = normal_90 / std::sqrt(truth.rests_counted);
  return std::abs(std::log(steps / std::sqrt(lower * upper))) <= std::hypot(half, by_count);
}

}  // namespace

std::vector<Grade> steps_grades(const std::vector<BlindTruth>& truths, const std::vector<Answer>& answers) {
  Proportion held, narrow;
  for (std::size_t i = 0; i < truths.size(); ++i) {
    const BlindTruth& truth = truths[i];
    if (!answers[i] || !answers[i]->steps || truth.rests_counted < enough_rests) continue;
    const auto [lower, upper] = *answers[i]->steps;
    held.count(holds_counted(*answers[i]->steps, truth));
    const auto& counted = answers[i]->steps_counted;
    const bool outside = truth.kind == BlindKind::outside || truth.kind == BlindKind::mixed;
    if (counted && std::isfinite(counted->second) && !outside)
      narrow.count(std::log(upper / lower) <= std::log(counted->second / counted->first) / std::sqrt(2.0));
  }
  return {{"expected steps of the machine: 90 % intervals hold", held, 0.88, 0.95},
          {"  as narrow as twice the trials would count them, nothing outside the catalogue", narrow, 0.5, 1}};
}

std::vector<Grade> share_grades(const std::vector<BlindTruth>& truths, const std::vector<Answer>& answers) {
  Proportion alone, beside;
  const auto count = [](Proportion& tally, const auto& interval, double share) {
    if (interval) tally.count(interval->first <= share && share <= interval->second);
  };
  for (std::size_t i = 0; i < truths.size(); ++i) {
    const BlindTruth& truth = truths[i];
    if (!answers[i] || !truth.gap_as_given || truth.gap_as_given->all < power_of_one) continue;
    for (const BlindAnswer::SaidAtWork& said : answers[i]->at_work)
      for (std::size_t e = 0; e < truth.effects.size(); ++e) {
        if (said.probability < Rules{}.least_at_work || said.effects != std::vector{truth.effects[e].id}) continue;
        count(alone, said.alone, truth.gap_as_given->alone[e] / truth.gap_as_given->all);
        count(beside, said.beside, truth.gap_as_given->beside[e] / truth.gap_as_given->all);
      }
  }
  return {{"shares of the gap that effects close alone: 90 % intervals hold", alone, 0.87, 0.93},
          {"  beside the others", beside, 0.87, 0.93}};
}

std::vector<Grade> at_work_grades(const std::vector<BlindTruth>& truths, const std::vector<Answer>& answers) {
  AtWorkTally tally;
  for (std::size_t i = 0; i < truths.size(); ++i) {
    count_kind(tally, truths[i], answers[i]);
    if (!answers[i] || truths[i].kind == BlindKind::left_out) continue;
    for (const BlindAnswer::SaidAtWork& said : answers[i]->at_work)
      if (said.probability >= Rules{}.least_at_work)
        (said.probability < 0.95 ? tally.likely : tally.surely).count(is_there(truths[i], said));
  }
  std::vector<Grade> grades;
  for (const auto& [measure, proportion, low, high] :
       {std::tuple<const char*, const Proportion&, double, double>{"at work: anything where there is no gap",
                                                                   tally.none, 0, 0.05},
        {"at work: an effect of the catalogue where one outside acts alone", tally.outside, 0, 0.1},
        {"at work: the effect, 2x and 4x, with power left", tally.one, 0.95, 1},
        {"  a false second", tally.second, 0, 0.05},
        {"at work: both of two effects, each with power beside the other", tally.both, 0.85, 1},
        {"  a false third", tally.third, 0, 0.05},
        {"at work: all of three effects, likewise", tally.three, 0.6, 1},
        {"  at least two of them", tally.two, 0.9, 1},
        {"  a false fourth", tally.fourth, 0, 0.1},
        {"at work: those named beside an outside effect", tally.mixed, 0.8, 1},
        {"  and something unnamed is said", tally.mixed_unnamed, 0.8, 1},
        {"  the same where the outside effect, too, has power beside them", tally.mixed_unnamed_left, 0.8, 1},
        {"  a false name", tally.mixed_false, 0, 0.1},
        {"said to be at work with 0.8 to 0.95: true", tally.likely, 0.75, 1},
        {"said to be at work with 0.95 and more: true", tally.surely, 0.93, 1}})
    grades.push_back({measure, proportion, low, high});
  return grades;
}

}  // namespace metastable::analysis
