#include "analysis/diagnosis/at_bound.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string_view>

namespace metastable::analysis {
namespace {

constexpr double at_the_end = 1e-6;  // of the range
constexpr double inwards = 1e-3;     // of the range, to find the reported number that a parameter moves
// This number ends at Machine::most_wild, which the user states.
constexpr std::string_view most_wild_reported = "wild_share";

enum class End { none, lower, upper };

End end_of(double value, double lower, double upper) {
  const double near = at_the_end * (upper - lower);
  if (!std::isfinite(near) || !(upper > lower)) return End::none;
  return value <= lower + near ? End::lower : value >= upper - near ? End::upper : End::none;
}

// Finds the reported number that moves most, relative to itself, from one list to the other; nothing where none does.
std::optional<NamedValue> most_moved(const std::vector<NamedValue>& here, const std::vector<NamedValue>& there) {
  std::optional<NamedValue> most;
  double largest = 0;
  for (std::size_t k = 0; k < here.size(); ++k) {
    const double moved = std::abs(there[k].second - here[k].second) / std::max(1e-300, std::abs(here[k].second));
    if (moved > largest) most = here[k], largest = moved;
  }
  return most;
}

// Says whether the lower end of a nuisance is next to nothing: an error, a scatter or a share that is not there. The
// models call their logarithms "log friction_sd", so that a machine's parameter log_a or push_sd is none of them.
bool ends_at_nothing(const std::string& name) {
  if (name.starts_with("logit ")) return name.ends_with("_share");
  return name.starts_with("log tick_jitter") || name.starts_with("log sensor sd") ||
         (name.starts_with("log ") && name.ends_with("_sd"));
}

// Returns a nuisance that no reported number shows, by its own name, not as its logarithm.
NamedValue by_itself(const std::string& name, double value) {
  constexpr std::string_view logarithm = "log ";
  if (name.starts_with(logarithm)) return {name.substr(logarithm.size()), std::exp(value)};
  return {name, value};
}

AtBound told(const std::string& of, const NamedValue& number, End end) {
  return {of, number.first, end == End::upper, number.second};
}

}  // namespace

std::vector<AtBound> values_at_bound(const TransitionModel& model, const Fit& fit) {
  std::vector<AtBound> all;
  for (const EffectTerm& term : fit.terms) {
    const std::vector<NamedValue> here = term.candidate->report(term.variant, term.values);
    for (std::size_t p = 0; p < term.values.size(); ++p) {
      const FreeParameter& free = term.candidate->parameters[p];
      const double range = free.upper - free.lower;
      const End end = end_of(term.values[p], free.lower, free.upper);
      if (end == End::none || std::abs(term.values[p] - free.neutral) <= at_the_end * range) continue;
      std::vector<double> moved = term.values;
      moved[p] += (end == End::lower ? 1 : -1) * inwards * range;
      const std::optional<NamedValue> number = most_moved(here, term.candidate->report(term.variant, moved));
      all.push_back(told(term.candidate->id, number.value_or(here.front()), end));
    }
  }
  const std::vector<NamedValue> here = model.report_nuisances(fit.nuisance);
  for (std::size_t p = 0; p < fit.nuisance.size(); ++p) {
    const Nuisance& n = model.nuisances()[p];
    const End end = end_of(fit.nuisance[p], n.lower, n.upper);
    if (end == End::none || (end == End::lower && ends_at_nothing(n.name))) continue;
    std::vector<double> moved = fit.nuisance;
    moved[p] += (end == End::lower ? 1 : -1) * inwards * (n.upper - n.lower);
    const std::optional<NamedValue> number = most_moved(here, model.report_nuisances(moved));
    all.push_back(told("", number.value_or(by_itself(n.name, fit.nuisance[p])), end));
  }
  return all;
}

std::string at_bound_in_words(const AtBound& one, const std::vector<EffectTerm>& beside) {
  std::string which =
      one.of.empty() ? "The fitted " + one.parameter : fmt::format("The {} of {}", one.parameter, one.of);
  if (one.of.empty() && !beside.empty()) {
    std::vector<std::string> effects;
    for (const EffectTerm& term : beside) effects.push_back(term.candidate->id);
    which += fmt::format(", beside {},", fmt::join(effects, " and "));
  }
  if (one.of.empty() && one.upper && one.parameter == most_wild_reported)
    return fmt::format(
        "{} stands at the largest that most_wild allows, {:.4g}: more rows may be wild (spikes, missed events), and "
        "these pass for outliers, for memory or for noise of a sensor; diagnose with a larger most_wild, too.",
        which, one.value);
  return fmt::format(
      "{} stands at the {} bound of its range, {:.4g}: its interval has one side only, and the truth may lie beyond.",
      which, one.upper ? "upper" : "lower", one.value);
}

}  // namespace metastable::analysis
