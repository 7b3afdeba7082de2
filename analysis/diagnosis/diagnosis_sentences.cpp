#include "analysis/diagnosis/diagnosis_sentences.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <cmath>

#include "analysis/diagnosis/not_possible.h"
#include "analysis/statistics/estimate.h"
#include "analysis/statistics/number_text.h"

namespace metastable::analysis {
namespace {

constexpr std::size_t most_parameters = 3;  // of an effect that a sentence names
constexpr double shown_level = 0.05;        // of a cell, for a sentence
constexpr double worth_saying = 3;          // evidence in a facet
constexpr double worth_naming = 10;         // gain of the nearest effect where none explains the gap
// It stands for effects that act alike where the field has no word for all of them.
constexpr const char* without_word = "one of several that act alike in these trials";
constexpr std::size_t most_pieces = 10;  // So many pieces of a log that is cut put two into each of five folds.

std::string with_parameters(const Cause& cause) {
  std::string text;
  for (std::size_t e = 0; e < cause.effects.size(); ++e) {
    text += (e ? " and " : "") + cause.effects[e];
    std::vector<std::string> inside;
    for (const EstimatedParameter& p : cause.parameters[e]) inside.push_back(fmt::format("{} {:.3g}", p.name, p.value));
    if (!inside.empty() && inside.size() <= most_parameters) text += fmt::format(" ({})", fmt::join(inside, ", "));
  }
  return text;
}

// Lists the set, what acts alike as one group beside what all of that group hold.
std::string grouped_set(const Diagnosis& d) {
  if (d.causes.alike.empty()) return fmt::format("{}", fmt::join(d.causes.set, ", "));
  std::vector<std::vector<std::string>> group;
  for (const std::string& name : d.causes.alike) group.push_back(effects_of_cause(name));
  std::vector<std::string> common = d.causes.ranked.front().effects, own;
  std::erase_if(common, [&](const std::string& effect) {
    return !std::ranges::all_of(group, [&](const auto& one) { return std::ranges::find(one, effect) != one.end(); });
  });
  for (std::vector<std::string>& one : group) {
    std::erase_if(one, [&](const std::string& effect) { return std::ranges::find(common, effect) != common.end(); });
    own.push_back(fmt::format("{}", fmt::join(one, "+")));
  }
  const std::string name = common_name(d.data.groups, own);
  std::string text = name == without_word ? fmt::format("{} (alike in these trials)", fmt::join(own, " or "))
                                          : fmt::format("{} ({})", name, fmt::join(own, ", "));
  if (!common.empty()) text += fmt::format(" beside {}", fmt::join(common, " and "));
  for (const std::string& name : d.causes.set)
    if (std::ranges::find(d.causes.alike, name) == d.causes.alike.end()) text += ", " + name;
  return text;
}

// Says where something without a name acts, were it at work alone or beside a cause that is.
void say_unnamed(std::vector<std::string>& s, const Diagnosis& d) {
  const auto likelihood = [&](const Unnamed& one) {
    return one.evidence + std::log(one.beside.empty() ? d.rules.unnamed_alone : d.rules.unnamed_beside);
  };
  const auto most = std::ranges::max_element(d.causes.unnamed, {}, likelihood);
  if (most == d.causes.unnamed.end() || most->facets.empty()) return;
  const auto facet =
      std::max_element(most->facets.begin(), most->facets.end(),
                       [](const LeftInFacet& a, const LeftInFacet& b) { return a.evidence < b.evidence; });
  if (facet->evidence < worth_saying) return;
  const std::string how =
      most->beside.empty() ? "By itself" : fmt::format("Beside {}", fmt::join(most->beside, " and "));
  s.push_back(facet->aspect == "correlation" ? how + " it makes the errors of two columns go together."
              : facet->facet == facet_of_all || (facet->facet == "phase" && d.data.collides())
                  ? fmt::format("{} it acts on the {} of all {}.", how, facet->aspect,
                                facet->stance ? "stances" : d.data.step_name + "s")
                  : fmt::format("{} it acts by {}, on the {} of {}.", how, facet->facet, facet->aspect,
                                facet->stance ? "stances" : d.data.step_name + "s"));
}

constexpr double rounded_share = 0.1;  // Convention: of one effect alone, shares that differ by less are said as one.

// Held-out shares may lie below 0 or above 1 by chance. A share that rounds to 0 % is written as less than 1 %, because
// no share is known to be exactly nothing.
std::string percent(double share) {
  const double rounded = std::round(100 * std::clamp(share, 0.0, 1.0));
  return rounded < 1 ? "less than 1 %" : fmt::format("{:.0f} %", rounded);
}

std::string with_size(const AtWork& one) {
  std::vector<std::string> inside;
  for (const EstimatedParameter& p : one.parameters)
    inside.push_back(p.fitted ? fmt::format("{} {:.3g} ({:.3g} to {:.3g})", p.name, p.value, p.lower, p.upper)
                              : fmt::format("{} {:.3g}", p.name, p.value));
  std::string text = one.name;
  if (one.effects.size() > 1) text += fmt::format(" ({})", fmt::join(one.effects, ", "));
  if (!inside.empty() && inside.size() <= most_parameters) text += fmt::format(", {}", fmt::join(inside, ", "));
  return text;
}

// Says what is at work, each with its probability and the shares that it closes.
void say_what_is_at_work(std::vector<std::string>& s, const Diagnosis& d) {
  const bool several = d.causes.at_work.size() > 1;
  for (const AtWork& one : d.causes.at_work) {
    if (one.probability < d.rules.least_at_work) continue;
    std::string closes;
    // An effect that differs between steps closes little while the parameters are those of the model as given.
    const bool waits = one.closes_alone && one.closes_beside &&
                       one.closes_beside->value > one.closes_alone->value + rounded_share && !several &&
                       d.causes.ranked.front().effects.size() == 1;
    if (one.closes_alone)
      closes = fmt::format("; it closes {} of the gap{}", percent(one.closes_alone->value),
                           several ? " alone"
                           : waits ? " in the model as given"
                                   : "");
    if (one.closes_alone && one.closes_beside && (several || waits))
      closes += fmt::format(", {} when it is added {}", percent(one.closes_beside->value),
                            waits ? "to the recalibrated model" : "last");
    s.push_back(fmt::format("At work with probability {:.2f}: {}{}.", one.probability, with_size(one), closes));
  }
}

// Says what ignoring it does to the expected steps.
void say_cost_of_ignoring(std::vector<std::string>& s, const Diagnosis& d) {
  const std::optional<Estimate>& ratio = d.shrinkage.steps.without_unnamed;
  if (!ratio || !std::isfinite(ratio->upper)) return;
  const DecimalEstimate times = to_decimal(*ratio, NumberFormat::general, 2);
  s.push_back(
      fmt::format("A model without it takes {} times the {}s before failure that this machine takes (90 %: {} to {}).",
                  plain_text(times.value), d.data.step_name, plain_text(times.lower), plain_text(times.upper)));
}

// Says how much of the gap stays without a name, and where.
void say_what_stays(std::vector<std::string>& s, const Diagnosis& d) {
  std::string where;
  if (!d.causes.unnamed_facets.empty() && d.causes.unnamed_facets.front().probability >= 1 - d.rules.least_at_work) {
    const UnnamedFacet& facet = d.causes.unnamed_facets.front();
    where = fmt::format(" It acts on the {} of {} (facet: {}{}).", facet.aspect,
                        facet.stance ? "stances" : d.data.step_name + "s", facet.facet,
                        facet.size ? fmt::format(", {:+.2g} {}", *facet.size, facet.unit) : "");
  }
  s.push_back(
      fmt::format("Something without a name {}{}, with probability {:.2f}.{}",
                  d.causes.stand_ins.empty() ? "stays" : "is at work, too",
                  d.causes.unnamed_share ? fmt::format(", {} of the gap", percent(*d.causes.unnamed_share)) : "",
                  d.causes.p_unnamed, where));
  if (!d.causes.stand_ins.empty())
    s.push_back(fmt::format("The likeliest model has {} in the place of what has no name, too unlikely to be named.",
                            fmt::join(d.causes.stand_ins, " and ")));
  say_cost_of_ignoring(s, d);
}

double without_effect(const Diagnosis& d) { return d.causes.p_no_gap + d.causes.p_recalibrate; }

std::string without_effect_in_words(const Diagnosis& d) {
  return fmt::format("With probability {:.2f} no effect acts, and other {} are enough.", without_effect(d),
                     d.gap.refitted);
}

void say_explained(std::vector<std::string>& s, const Diagnosis& d) {
  const Cause& likeliest = d.causes.ranked.front();
  if (d.causes.set.size() == 1) {
    s.push_back(fmt::format("There is a gap that recalibration does not remove, and {} it: {}.",
                            likeliest.effects.size() == 1 ? "one cause explains"
                            : likeliest.effects.size() == 2
                                ? "two effects together explain"
                                : fmt::format("{} effects together explain", likeliest.effects.size()),
                            likeliest.name()));
  } else {
    s.push_back(
        fmt::format("There is a gap that recalibration does not remove. These data cannot tell {} causes apart: {}.",
                    d.causes.set.size(), grouped_set(d)));
    s.push_back(
        fmt::format("The likeliest is {} with probability {:.2f}.", with_parameters(likeliest), likeliest.probability));
  }
  say_what_is_at_work(s, d);
  if (without_effect(d) > 1 - d.rules.least_at_work) s.push_back(without_effect_in_words(d));
  if (!d.causes.size.empty()) s.push_back(d.causes.size);
  if (const auto left =
          std::ranges::count_if(d.gap.left.cells, [](const GapCell& cell) { return cell.p_adjusted < shown_level; }))
    s.push_back(fmt::format(
        "It leaves {} {} of the map beyond chance. What is left there is at most {:.0f} % of the effect, an error that "
        "its form is allowed to have.",
        left, left == 1 ? "cell" : "cells", 100 * d.rules.model_error));
}

void say_unexplained(std::vector<std::string>& s, const Diagnosis& d) {
  if (const auto would_do = trials_to_explain(d.data)) {
    s.push_back(
        fmt::format("There is a gap as given, and {} {} with {} {} are too few to say what causes it: {} "
                    "trials like these would do.",
                    d.data.trials, d.data.trials == 1 ? "trial" : "trials", d.data.collisions,
                    d.data.collisions == 1 ? "transition" : "transitions", *would_do));
    return;
  }
  const bool any = !d.causes.ranked.empty();
  if (const double none = without_effect(d);
      none > d.causes.p_none && (!any || none > d.causes.ranked.front().probability)) {
    s.push_back(fmt::format(
        "A gap shows beyond chance (p = {:.2g}), and no effect of the catalogue clearly removes it.", d.gap.p_value));
    s.push_back(without_effect_in_words(d));
  } else if (any && d.causes.ranked.front().probability > d.causes.p_none) {
    if (without_effect(d) > d.causes.p_none) {
      s.push_back(fmt::format(
          "A gap shows beyond chance (p = {:.2g}). The nearest of the catalogue is {}, with probability {:.2f}, too "
          "little for a name.",
          d.gap.p_value, with_parameters(d.causes.ranked.front()), d.causes.ranked.front().probability));
      s.push_back(without_effect_in_words(d));
      return;
    }
    s.push_back(
        fmt::format("There is a gap that recalibration does not remove. The nearest of the catalogue is {}; "
                    "that it is none of the catalogue has probability {:.2f}, too much for a name.",
                    with_parameters(d.causes.ranked.front()), d.causes.p_none));
  } else {
    s.push_back("There is a gap that no effect of the catalogue, nor several, removes: something else is at work.");
    if (d.causes.together > d.rules.most_together)
      s.push_back(fmt::format(
          "The nearest of the catalogue is {}, and it is not named. Its effects together raise the likelihood (2 Δ ln "
          "L) {:.1f} times as much as they do one by one. Separate causes would add up; these are likely to imitate "
          "something else.",
          d.causes.ranked.front().name(), d.causes.together));
    else if (any && d.causes.ranked.front().gain > worth_naming)
      s.push_back(fmt::format("The nearest of the catalogue is {}; what it leaves is in the map.",
                              d.causes.ranked.front().name()));
  }
  say_unnamed(s, d);
  say_cost_of_ignoring(s, d);
}

void say_verdict(std::vector<std::string>& s, const Diagnosis& d) {
  switch (d.verdict) {
    case Verdict::no_gap:
      s.push_back("No gap beyond chance: the data agree with the model as given.");
      break;
    case Verdict::recalibrate:
      s.push_back(
          fmt::format("There is a gap as given, and other {} remove it: no missing physics shows.", d.gap.refitted));
      break;
    case Verdict::explained:
      say_explained(s, d);
      break;
    case Verdict::partly_explained:
      s.push_back("There is a gap that recalibration does not remove, and part of it has a name.");
      say_what_is_at_work(s, d);
      say_what_stays(s, d);
      break;
    case Verdict::unexplained:
      say_unexplained(s, d);
      break;
  }
}

std::string where_in_words(const GapCell& cell, const std::string& step_name) {
  const std::string at = cell.at == step_name ? fmt::format("all {}s", step_name) : cell.at;
  if (cell.aspect == "tail")
    return fmt::format("the tail of {} ({:.2g} % {} of them far out)", at, 100 * std::abs(cell.size),
                       cell.size < 0 ? "fewer" : "more");
  if (cell.aspect == "spread" && cell.unit == "correlation")
    return fmt::format("what the {}s of a trial have in common ({:+.2g} {})", step_name, cell.size, cell.unit);
  if (cell.aspect == "spread" && cell.size >= 1)
    return fmt::format("the spread of {} ({:.2g} times the model's)", at, 1 + cell.size);
  if (cell.aspect == "spread" && cell.size <= -1)
    return fmt::format("the spread of {} (far less than the model's)", at);
  if (cell.aspect == "spread")
    return fmt::format("the spread of {} ({:.2g} % {} than the model's)", at, 100 * std::abs(cell.size),
                       cell.size < 0 ? "less" : "more");
  if (cell.aspect == "correlation") return fmt::format("the correlation of {} ({:+.2g})", at, cell.size);
  return fmt::format("the {} of {} ({:+.2g} {})", cell.aspect, at, cell.size, cell.unit);
}

void say_where(std::vector<std::string>& s, const Diagnosis& d) {
  const GapMap& map = d.verdict == Verdict::explained ? d.gap.recalibrated : d.gap.left;
  if (is_gap(d.verdict)) {
    const auto largest = std::min_element(map.cells.begin(), map.cells.end(), [](const GapCell& a, const GapCell& b) {
      return std::abs(a.statistic) > std::abs(b.statistic);
    });
    if (largest != map.cells.end() && largest->p_adjusted < shown_level)
      s.push_back(fmt::format("It shows most in {}.", where_in_words(*largest, d.data.step_name)));
  }
}

Estimate closed_percent(const Shrinkage& s) { return {100 * *s.closed, 100 * *s.closed_lower, 100 * *s.closed_upper}; }

void say_what_closes(std::vector<std::string>& s, const Diagnosis& d) {
  if (d.shrinkage.measures.empty() || !d.shrinkage.measures[0].closed || d.verdict == Verdict::no_gap) return;
  const Shrinkage& log_score = d.shrinkage.measures[0];
  const std::string change =
      log_score.with_effect > 0
          ? fmt::format("from {:.2g} to {:.2g} nats a {}", log_score.baseline, log_score.with_effect, d.data.step_name)
          : fmt::format("from {:.2g} nats a {} to none", log_score.baseline, d.data.step_name);
  if (closed_is_known(log_score)) {
    const DecimalEstimate percent = to_decimal(closed_percent(log_score), NumberFormat::general, 3);
    s.push_back(fmt::format("Held out, {} % of the gap closes (90 %: {} to {} %){}, {}.", plain_text(percent.value),
                            plain_text(percent.lower), plain_text(percent.upper),
                            d.causes.stand_ins.empty() ? "" : " in the best model", change));
  } else {
    s.push_back(
        fmt::format("Held out, the gap goes {}; the share that closes is {}.", change, closed_unknown(log_score)));
  }
}

// Says that failures come mostly at the beginning of trials, or mostly at their end: expected steps are those of trials
// as long as the measured ones.
void say_later_steps(std::vector<std::string>& s, const Diagnosis& d) {
  const StepsBeforeFailure& steps = d.shrinkage.steps;
  if (!(steps.later_times > 0)) return;
  if (steps.later_times < d.rules.later_apart && steps.later_times > 1 / d.rules.later_apart) return;
  s.push_back(
      fmt::format("That is for trials as long as these: in the later half of their {0}s {1}, so that trials without an "
                  "end take {2} "
                  "{0}s than that on average.",
                  d.data.step_name,
                  std::isfinite(steps.later)
                      ? fmt::format("the model fails once in {}", format_number(steps.later, NumberFormat::general, 2))
                      : "the model does not fail",
                  steps.later_times > 1 ? "more" : "fewer"));
}

// Says the expected steps of the machine itself, as measured and where they were asked.
void say_machine_steps(std::vector<std::string>& s, const Diagnosis& d) {
  for (const MachineSteps& machine : d.shrinkage.steps.machine) {
    // Trials of a machine end after some steps, and their first ones may fail more seldom than later ones.
    const std::string where = !machine.where.empty()       ? " " + machine.where + ", in trials as long as these"
                              : d.data.step_name == "step" ? " in trials like these"
                                                           : "";
    if (machine.at_least) {
      const bool alone = d.shrinkage.steps.observed == infinite;
      s.push_back(fmt::format("This machine takes at least {} {}s before failure{} (95 %{}).",
                              format_number(machine.steps.lower, NumberFormat::general, 2), d.data.step_name, where,
                              alone ? "; no trial failed" : ""));
      continue;
    }
    const DecimalEstimate steps = to_decimal(machine.steps, NumberFormat::general, 3);
    s.push_back(fmt::format("This machine takes {} {}s before failure{} (90 %: {} to {}).", plain_text(steps.value),
                            d.data.step_name, where, plain_text(steps.lower), plain_text(steps.upper)));
    if (machine.where.empty()) say_later_steps(s, d);
  }
}

// A number of trials that is far from what was run is known to two digits at most.
std::string rounded_trials(std::size_t trials) {
  if (trials < 100) return std::to_string(trials);
  return "about " + format_number(static_cast<double>(trials), NumberFormat::general, 2);
}

void say_what_is_hidden(std::vector<std::string>& s, const Diagnosis& d) {
  for (const MissingColumn& missing : d.limits.missing) {
    std::vector<std::string> hidden;
    for (const HiddenEffect& effect : missing.effects)
      if (!effect.smallest) hidden.push_back(effect.effect);
    if (!hidden.empty())
      s.push_back(fmt::format("Without {}, {} cannot be told; what they do may show under other names.", missing.column,
                              fmt::join(hidden, ", ")));
  }
  for (const NotPossible& n : d.limits.not_possible)
    if (n.of_the_gap)
      s.push_back(n.trials
                      ? fmt::format("It takes {} trials like these to say {}.", rounded_trials(*n.trials), n.statement)
                      : fmt::format("These trials are too few to say {}.", n.statement));
}

// Says out of what effects can be taken: errors of sensors, by their ids, are no part of the machine.
std::string taken_out_of(const std::vector<std::string>& effects) {
  const auto of_sensor = [](const std::string& id) { return id.starts_with("sensor_"); };
  if (std::ranges::all_of(effects, of_sensor)) return "the measurement";
  return std::ranges::any_of(effects, of_sensor) ? "machine and measurement" : "the machine";
}

}  // namespace

std::vector<std::string> effects_of_cause(const std::string& name) {
  std::vector<std::string> effects;
  for (std::size_t from = 0, plus = 0; plus != std::string::npos; from = plus + 1) {
    plus = name.find('+', from);
    effects.push_back(name.substr(from, plus - from));
  }
  return effects;
}

std::string common_name(const std::vector<EffectGroup>& groups, const std::vector<std::string>& alike) {
  for (const EffectGroup& group : groups)
    if (std::ranges::all_of(
            alike, [&](const std::string& id) { return std::ranges::find(group.members, id) != group.members.end(); }))
      return group.name;
  return without_word;
}

bool closed_is_known(const Shrinkage& s) {
  return s.closed && s.closed_lower && s.closed_upper && *s.closed_upper - *s.closed_lower <= 1;
}

std::string closed_unknown(const Shrinkage& s) {
  if (!s.closed || !s.closed_lower || !s.closed_upper) return "not known: the gap as given may be none";
  const DecimalEstimate percent = to_decimal(closed_percent(s), NumberFormat::general, 3);
  return fmt::format("not known: 90 % interval {} to {} %, wider than the gap", plain_text(percent.lower),
                     plain_text(percent.upper));
}

// Says what a changed experiment buys: how much evidence between the causes it is expected to give, beside the same
// experiment and beside what tells them apart.
std::string what_it_buys(const Diagnosis& d) {
  const NextExperiment& best = d.limits.next.front();
  const auto same = std::ranges::find_if(d.limits.next, [](const NextExperiment& one) { return one.changes.empty(); });
  std::string text = fmt::format(", with a likelihood ratio of {:.2g} between the likeliest and the others",
                                 std::exp(0.5 * best.separation));
  if (same != d.limits.next.end() && &*same != &best)
    text +=
        fmt::format(" expected on average ({:.2g} from the same experiment again)", std::exp(0.5 * same->separation));
  else
    text += " expected on average";
  if (best.separation < d.rules.told_apart)
    text +=
        fmt::format("; no change looked at reaches the {:.0f} that tell causes apart, so take several such experiments",
                    std::exp(0.5 * d.rules.told_apart));
  return text;
}

// Says which trials would do where there are too few. A machine's long one can be cut, because each row is judged given
// the ones before it; the first row of each piece is no transition. Wheels and drums are pushed when a trial begins.
std::string more_trials(const Diagnosis& d, std::size_t would_do) {
  const std::size_t rows = Rules::least_transitions_to_explain / Rules::least_trials_to_explain;
  const std::size_t pieces = std::min(most_pieces, d.data.collisions / (rows + 1));
  if (d.data.trials >= Rules::least_trials_to_explain || d.data.step_name != "step" || pieces < would_do)
    return fmt::format("Run {} trials like these{}, and diagnose them together.", would_do,
                       d.data.trials >= Rules::least_trials_to_explain ? ", or longer ones" : "");
  return fmt::format(
      "Run {} trials like these, or cut long ones: a trial number of its own for every {} rows makes about {}. What is "
      "stated of a launch then has to hold where each of them begins.",
      would_do, d.data.collisions / pieces, pieces);
}

// Says what to do where the data hold what they seem to hold.
std::string step_by_verdict(const Diagnosis& d) {
  switch (d.verdict) {
    case Verdict::no_gap:
      return "Use the model as it is. An effect below its smallest size under “What these data could have seen” would "
             "have gone unnoticed; more trials lower these sizes.";
    case Verdict::recalibrate:
      return "Give the model the recalibrated parameters and diagnose trials that were not used here: if "
             "these ask for other ones again, something drifts.";
    case Verdict::explained:
      if (d.causes.set.size() == 1)
        return fmt::format(
            "Give the model {} with the parameters under “Which effect”{}, or take it out of {}; "
            "new trials should then leave no gap.",
            d.causes.set.front(),
            d.causes.beside.empty() ? "" : " and its own ones as they are beside it (“Recalibrated parameters”)",
            taken_out_of(effects_of_cause(d.causes.set.front())));
      if (!d.limits.next.empty())
        return fmt::format(
            "Tell the causes apart before changing the model: {} would do it best{} (“The next experiment”).",
            d.limits.next.front().change, what_it_buys(d));
      return fmt::format("Tell the causes apart before changing the model: with more trials{}.",
                         d.limits.missing.empty() ? "" : ", or with a column under “What missing columns hide”");
    case Verdict::partly_explained: {
      std::vector<std::string> names, effects;
      for (const AtWork& one : d.causes.at_work)
        if (one.probability >= d.rules.least_at_work) {
          names.push_back(one.name);
          effects.insert(effects.end(), one.effects.begin(), one.effects.end());
        }
      return fmt::format(
          "Give the model {}, or take {} out of {}, and diagnose new trials: what stays is then the whole gap, and it "
          "shows more clearly.",
          fmt::join(names, " and "), names.size() == 1 ? "it" : "them", taken_out_of(effects));
    }
    case Verdict::unexplained:
      if (const auto would_do = trials_to_explain(d.data)) return more_trials(d, *would_do);
      return fmt::format(
          "Check the measurement first where the gap shows most (units, {}, sensor noise). If it holds, see what the "
          "cells that stay beyond chance have in common (--out DIR draws the map): no effect of the catalogue does "
          "that.",
          d.data.collides() ? "leg numbers" : "labels");
  }
  return "";
}

std::string next_step(const Diagnosis& d) {
  std::string step = step_by_verdict(d);
  const auto asked = std::ranges::count_if(d.data.notes, [](const std::string& note) { return note.ends_with('?'); });
  if (asked == 0) return step;
  step.front() = static_cast<char>(std::tolower(static_cast<unsigned char>(step.front())));
  return fmt::format(
      "First answer the {} about the data. If the answer changes the data or the machine, diagnose them anew. If it "
      "changes nothing, {}",
      asked == 1 ? "question" : "questions", step);
}

namespace {

void say_missing_state(std::vector<std::string>& all, const Diagnosis& d) {
  const auto named = [&](const auto& is) {
    return std::ranges::any_of(d.causes.at_work, [&](const AtWork& one) {
      return one.probability >= d.rules.least_at_work && std::ranges::any_of(one.effects, is);
    });
  };
  if (named([](const std::string& effect) { return effect.starts_with("hidden_state_"); }))
    all.emplace_back(
        "A hidden state is one that the model lacks, as the temperature of a wall, the speed behind a joint that "
        "gives, or what a slow sensor has not shown yet: give the model such a state, and diagnose anew.");
  else if (named([](const std::string& effect) { return effect == "memory"; }))
    all.emplace_back(
        "What the model leaves out of its state, as a second time constant or a hidden speed, shows as such a memory "
        "of the noise, too.");
}

}  // namespace

std::vector<std::string> sentences(const Diagnosis& d) {
  std::vector<std::string> all;
  say_verdict(all, d);
  if (!d.causes.even_push.empty()) all.push_back(d.causes.even_push);
  say_missing_state(all, d);
  if (!d.data.accepted_defects.empty())
    all.push_back(fmt::format("It stands on defects that were accepted: {}.", d.data.accepted_defects));
  say_where(all, d);
  say_what_closes(all, d);
  say_machine_steps(all, d);
  say_what_is_hidden(all, d);
  return all;
}

}  // namespace metastable::analysis
