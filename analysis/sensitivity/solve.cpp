#include "analysis/sensitivity/solve.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <mutex>
#include <stdexcept>
#include <utility>

#include "analysis/statistics/number_text.h"
#include "analysis/study/steady_launch.h"
#include "dynamics/settled/settled_wheel.h"
#include "dynamics/wheel/ranges.h"
#include "markov/chain/chain.h"

namespace metastable::analysis {
namespace {

constexpr std::size_t most_scanned = 1000;

// Returns a quantity on a scale on which both expected steps and their probabilities rise about in proportion to
// ln steps.
double on_scale(const Target& target, double quantity) {
  return target.of == Target::Of::steps ? std::log(quantity) : -std::log(-std::log(quantity));
}

std::string quantity_text(const Target& target, const Estimate& quantity) {
  if (target.of == Target::Of::steps)
    return std::isinf(quantity.value) ? "infinitely many steps"
                                      : plain_text(to_decimal(quantity.value, NumberFormat::general, 3)) + " steps";
  return plain_text(to_decimal(100 * quantity.value, NumberFormat::general, 4)) + " %";
}

std::string with_unit(double value, const std::string& unit) {
  return fmt::format("{:.6g}{}", value, unit == "1" || unit.empty() ? "" : " " + unit);
}

Setting with_value(const Setting& base, Parameter parameter, double value) {
  Setting setting = base;
  set_parameter(setting, parameter, value);
  return setting;
}

// Studies the setting with the target's last step as the end of its course.
Metastability study_for(const Setting& setting, const Target& target, const StudyOptions& options) {
  const Setting launched = steadily_launched(setting, options);
  Problem problem = launched.problem(landing_options(options));
  if (target.of == Target::Of::survival) problem.last_event = target.steps;
  Metastability found = study(problem, options);
  found.setting = launched;
  return found;
}

Answered answered(const Metastability& found, const Target& target, const StudyOptions& options) {
  if (found.status == Status::rest_unresolved && options.weighting == markov::Weighting::plain)
    return {{}, found.message};
  const bool rarer_than_draws = found.status == Status::rest_unresolved;
  if (target.of == Target::Of::steps)
    return {rarer_than_draws ? Estimate{infinite, infinite, infinite} : found.steps.from_start, ""};
  if (rarer_than_draws) return {{1, 1, 1}, ""};
  return {found.steps.reach_end_interval.value_or(probability(*found.steps.reach_end, found.steps.from_start)), ""};
}

// A coarse answer so far from the target that a fine one lies on the same side of it?
bool far_from(const Target& target, const Estimate& quantity) {
  constexpr double half_widths = 5, least = 0.3;  // of a few cells, whose error is their own estimate give or take
  const double wanted = on_scale(target, target.value), here = on_scale(target, quantity.value);
  const double half = std::max(on_scale(target, quantity.upper) - here, here - on_scale(target, quantity.lower));
  return std::isinf(here) || std::abs(here - wanted) > least + half_widths * half;
}

// Returns the answer of a few cells and draws where that will do.
std::optional<Answered> coarse_answer(const Setting& setting, const Target& target, const StudyOptions& options) {
  if (options.method == Method::integrated || options.cells != 0 || options.samples != 0) return std::nullopt;
  StudyOptions coarse = options;
  coarse.cells = 32;
  coarse.samples = 512;
  coarse.replicates = std::min(coarse.replicates, 4);
  try {
    const Answered found = answered(study_for(setting, target, coarse), target, coarse);
    if (found.unknown.empty() && far_from(target, found.quantity)) return found;
  } catch (const markov::ConvergenceError&) {
    // More cells may tell.
  }
  return std::nullopt;
}

// Keeps what has been studied in full, by the parameter's value.
class Kept {
 public:
  void keep(double value, const Metastability& found) {
    const std::scoped_lock lock(mutex_);
    studies_[value] = found;
  }
  const Metastability* at(double value) const {
    const auto found = studies_.find(value);
    return found == studies_.end() ? nullptr : &found->second;
  }

 private:
  std::mutex mutex_;
  std::map<double, Metastability> studies_;
};

// Says what a user may do where the chain of a setting could not be solved.
std::string not_solved(const markov::ConvergenceError& error, const StudyOptions& options) {
  return fmt::format(
      "its chain could not be solved ({}): try --method {}, other --cells, or --from and --to that leave "
      "it out",
      error.what(), options.method == Method::integrated ? "sampled" : "integrated");
}

Answered answer_at(const Setting& setting, double value, const Target& target, const StudyOptions& options,
                   Kept& kept) {
  try {
    if (const std::optional<Answered> coarse = coarse_answer(setting, target, options)) return *coarse;
    const Metastability found = study_for(setting, target, options);
    kept.keep(value, found);
    return answered(found, target, options);
  } catch (const NoRegime&) {
    return {target.of == Target::Of::steps ? Estimate{1, 1, 1} : Estimate{0, 0, 0}, ""};
  } catch (const markov::ConvergenceError& error) {
    return {{}, not_solved(error, options)};
  }
}

}  // namespace

void require_ends(const SolveRange& range, const SolveOptions& options, const std::function<void(double end)>& check) {
  const auto require = [&](const char* name, const std::optional<double>& told, double otherwise) {
    try {
      check(told.value_or(otherwise));
    } catch (const std::invalid_argument& error) {
      if (!told) throw;
      throw std::invalid_argument(fmt::format("--{}: {}", name, error.what()));
    }
  };
  require("from", options.from, range.from);
  require("to", options.to, range.to);
}

std::string Target::text() const {
  const std::string number = plain_text(to_decimal(of == Of::steps ? value : 100 * value, NumberFormat::general, 6));
  switch (of) {
    case Of::steps:
      return number + " expected steps";
    case Of::survival:
      return fmt::format("{} % surviving {} steps", number, steps);
    case Of::ramp_end:
      return number + " % reaching the ramp's end";
  }
  throw std::logic_error("unknown target");
}

void Target::validate() const {
  if (of == Of::steps && !(value > 1 && std::isfinite(value)))
    throw std::invalid_argument(fmt::format("steps: {} is outside (1, inf)", value));
  if (of != Of::steps && !(value > 0 && value < 1))
    throw std::invalid_argument(
        fmt::format("{}: probability {} is outside (0, 1)", of == Of::survival ? "survive" : "reach", value));
  if (of == Of::survival && steps < 1) throw std::invalid_argument(fmt::format("survive: {} steps are none", steps));
}

Estimate probability(double p, const Estimate& steps) {
  if (!(p > 0 && p < 1) || std::isinf(steps.value)) return {p, p, p};
  const double rate = -std::log(p);
  return {p, std::exp(-rate * steps.value / steps.lower), std::exp(-rate * steps.value / steps.upper)};
}

SolveRange solve_range(const Setting& setting, Parameter parameter) {
  const double here = parameter_value(setting, parameter);
  const auto around = [&](double factor) { return SolveRange{here / factor, here * factor, true}; };
  switch (parameter) {
    case Parameter::slope: {
      const double half = dynamics::slope_range(setting.wheel.legs()).high;
      return {half / 50, half - half / 50, false};
    }
    case Parameter::restitution_mean:
      return {0, setting.law == dynamics::Law::settled ? dynamics::most_settled_restitution : 1, false};
    case Parameter::friction_mean:
      return {0.05, 1, false};
    case Parameter::restitution_sd:
    case Parameter::friction_sd:
      return {0.005, 0.3, false};
    case Parameter::leg_length:
      return around(2);
    case Parameter::inertia: {
      const double least = setting.wheel.hub_mass * setting.wheel.mean_leg_length() * setting.wheel.mean_leg_length();
      return {least, 2 * least, false};
    }
    case Parameter::radius_of_gyration: {
      const double usual = here > 0 ? here : 0.05;
      return {usual / 4, std::min(4 * usual, 3 * setting.wheel.mean_leg_length()), true};
    }
    case Parameter::ramp_stiffness:
    case Parameter::contact_mass:
      return around(10);
    case Parameter::tip_radius:
      return {0, *std::min_element(setting.wheel.leg_length.begin(), setting.wheel.leg_length.end()) / 20, false};
  }
  throw std::logic_error("unknown parameter");
}

Solution solve(const AnswerAt& answer, const Target& target, const SolveRange& range, const SolveOptions& options) {
  target.validate();
  if (options.points < 3 || options.points > most_scanned)
    throw std::invalid_argument(fmt::format("points: {} is outside 3..{}", options.points, most_scanned));
  Solution solution;
  solution.target = target;
  solution.from = options.from.value_or(range.from);
  solution.to = options.to.value_or(range.to);
  if (!(solution.from < solution.to))
    throw std::invalid_argument(fmt::format("from: {} is not below to: {}", solution.from, solution.to));
  const double wanted = on_scale(target, target.value);
  const Curve curve = [&](double at, int threads) {
    const Answered here = answer(at, threads);
    CurvePoint point{at, {}, here.unknown};
    if (here.unknown.empty())
      point.height = {on_scale(target, here.quantity.value) - wanted, on_scale(target, here.quantity.lower) - wanted,
                      on_scale(target, here.quantity.upper) - wanted};
    return point;
  };
  const Crossings crossings =
      level_crossings(curve, solution.from, solution.to,
                      {options.points, range.logarithmic && solution.from > 0, options.threads, options.progress});
  const auto quantity = [&](double height) {
    return target.of == Target::Of::steps ? std::exp(height + wanted) : std::exp(-std::exp(-height - wanted));
  };
  bool unknown = false;
  for (const CurvePoint& point : crossings.scanned) {
    const Estimate& h = point.height;
    solution.scanned.push_back({point.at, {{quantity(h.value), quantity(h.lower), quantity(h.upper)}, point.unknown}});
    unknown = unknown || !point.unknown.empty();
  }
  solution.found = crossings.crossings;
  if (solution.found.empty() && unknown) throw std::runtime_error(solution.sentences().back());
  return solution;
}

Solution solve(const Setting& setting, Parameter parameter, const Target& target, const SolveOptions& options,
               const StudyOptions& study_options) {
  target.validate();
  const SolveRange range = solve_range(setting, parameter);
  const double from = options.from.value_or(range.from), to = options.to.value_or(range.to);
  if (!matters(with_value(setting, parameter, 0.5 * (from + to)), parameter))
    throw std::invalid_argument(
        fmt::format("parameter: {} has no meaning under this setting", parameter_name(parameter)));
  require_ends(range, options,
               [&](double end) { check_setting(with_value(setting, parameter, end), study_options.method); });
  if (target.of == Target::Of::ramp_end && std::isinf(setting.ramp_length))
    throw std::invalid_argument("reach: the ramp has no end");
  StudyOptions brief = study_options;
  brief.brief = true;
  brief.reach_end_interval = target.of != Target::Of::steps;
  // On one slope one table of landings serves all points.
  if (parameter != Parameter::slope) {
    StudyOptions first = study_options;
    first.threads = options.threads;
    if (options.tabulating) first.progress = [&](double share, const std::string&) { options.tabulating(share); };
    tabulate_landings(with_value(setting, parameter, from), first);
  }
  Kept kept;
  const auto at = [&](double value, int threads) {
    StudyOptions own = brief;
    own.threads = threads;
    return answer_at(with_value(setting, parameter, value), value, target, own, kept);
  };
  Solution solution = solve(at, target, range, options);
  solution.parameter = parameter_name(parameter);
  solution.unit = parameter_unit(parameter);
  for (const Crossing& one : solution.found) {
    const Metastability* known = kept.at(one.at.value);
    try {
      solution.studies.push_back(known ? *known
                                       : study_for(with_value(setting, parameter, one.at.value), target, brief));
    } catch (const markov::ConvergenceError& error) {
      throw std::runtime_error(fmt::format("{}: {} at {}: the expected steps are not known: {}", solution.parameter,
                                           target.text(), with_unit(one.at.value, solution.unit),
                                           not_solved(error, brief)));
    }
  }
  return solution;
}

std::vector<std::string> Solution::sentences() const {
  std::vector<std::string> all;
  for (const Crossing& one : found) {
    const DecimalEstimate e = to_decimal(one.at, NumberFormat::general, 6);
    all.push_back(fmt::format("{}{} (95 % interval {}{} to {}{}), {} above it", plain_text(e.value),
                              unit == "1" || unit.empty() ? "" : " " + unit, one.open_below ? "from below " : "",
                              plain_text(e.lower), one.open_above ? "beyond " : "", plain_text(e.upper),
                              one.rising ? "more" : "less"));
  }
  const LookedAt *least = nullptr, *most = nullptr;
  std::string gaps;
  for (const LookedAt& one : scanned) {
    if (!one.answer.unknown.empty()) {
      if (gaps.empty()) gaps = fmt::format("not known at {}: {}", with_unit(one.at, unit), one.answer.unknown);
      continue;
    }
    if (!least || one.answer.quantity.value < least->answer.quantity.value) least = &one;
    if (!most || one.answer.quantity.value > most->answer.quantity.value) most = &one;
  }
  if (found.empty()) {
    std::string text = fmt::format("out of reach between {} and {}", with_unit(from, unit), with_unit(to, unit));
    if (least)
      text += fmt::format(": {} at {} to {} at {}", quantity_text(target, least->answer.quantity),
                          with_unit(least->at, unit), quantity_text(target, most->answer.quantity),
                          with_unit(most->at, unit));
    all.push_back(gaps.empty() ? text : text + ", as far as it is known; " + gaps);
  } else if (!gaps.empty()) {
    all.push_back(gaps);
  }
  return all;
}

}  // namespace metastable::analysis
