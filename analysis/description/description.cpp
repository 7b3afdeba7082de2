#include "analysis/description/description.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "analysis/description/landings.h"

namespace metastable::analysis {
namespace {

std::optional<Survival> survival(const Experiment& experiment, std::size_t condition, std::uint64_t seed) {
  std::vector<ObservedSteps> steps;
  Survival result;
  for (const MeasuredTrial& trial : experiment.trials) {
    if (trial.condition != condition) continue;
    if (!trial.outcome) return std::nullopt;
    const bool rested = *trial.outcome == dynamics::Outcome::rest;
    steps.push_back({static_cast<int>(trial.collisions.size()), rested});
    ++result.trials;
    result.rests += rested;
  }
  if (steps.empty()) return std::nullopt;
  result.curve = kaplan_meier(steps);
  result.expected = expected_steps(steps, steady_collision, seed);
  return result;
}

ConditionDescription describe_condition(const Experiment& experiment, std::size_t index, std::uint64_t seed) {
  ConditionDescription c;
  c.id = experiment.conditions[index].id;
  c.slope_deg = experiment.conditions[index].slope_deg;
  c.speeds = speeds(experiment, index);
  c.trials = c.speeds.size();
  for (const std::vector<double>& trial : c.speeds) c.collisions += trial.size();
  c.profile = speed_profile(c.speeds);
  c.steady = speed_summary(steady_trial_means(c.speeds));
  c.steady_collisions = speed_summary(steady_speeds(c.speeds));
  c.legs = speed_per_leg(experiment, index, experiment.legs() + 1);
  c.line = return_map_line(c.speeds, 1);
  c.survival = survival(experiment, index, seed);
  return c;
}

}  // namespace

std::optional<SampleComparison> compare_samples(std::span<const double> a, std::span<const double> b) {
  if (a.size() < 2 || b.size() < 2) return std::nullopt;
  return SampleComparison{a.size(),
                          b.size(),
                          welch_t_test(a, b),
                          pooled_t_test(a, b),
                          hedges_g(a, b),
                          superiority(a, b),
                          kolmogorov_smirnov_distance(a, b),
                          kolmogorov_smirnov_test(a, b),
                          anderson_darling_test(a, b)};
}

ConditionComparison compare_conditions(const TrialSpeeds& a, const TrialSpeeds& b) {
  ConditionComparison c;
  c.trial_means = compare_samples(steady_trial_means(a), steady_trial_means(b));
  c.all_collisions = compare_samples(steady_speeds(a), steady_speeds(b));
  const std::size_t last = std::min(speed_profile(a).size(), speed_profile(b).size());
  for (std::size_t k = 1; k <= last; ++k) {
    const std::vector<double> x = at_collision(a, static_cast<int>(k)), y = at_collision(b, static_cast<int>(k));
    c.p_by_collision.push_back(x.size() < 2 || y.size() < 2 ? std::nullopt : std::optional(welch_t_test(x, y).p));
  }
  for (std::size_t k = last; k > 0; --k) {
    const std::optional<double>& p = c.p_by_collision[k - 1];
    if (!p) continue;
    if (*p < 0.05) break;
    c.meet = static_cast<int>(k);
  }
  return c;
}

Description describe(const Experiment& experiment, const DescriptionOptions& options) {
  if (experiment.system != System::rimless_wheel)
    throw std::invalid_argument("describe: a coast-down has no steps to describe");
  Description description;
  description.notes = experiment.notes;
  for (std::size_t i = 0; i < experiment.conditions.size(); ++i)
    description.conditions.push_back(describe_condition(experiment, i, options.seed));
  for (std::size_t a = 0; a < description.conditions.size(); ++a)
    for (std::size_t b = a + 1; b < description.conditions.size(); ++b) {
      ConditionComparison c = compare_conditions(description.conditions[a].speeds, description.conditions[b].speeds);
      c.a = a;
      c.b = b;
      description.comparisons.push_back(std::move(c));
    }
  if (experiment.columns.leg != Presence::all)
    description.notes.push_back("Legs are not known for all collisions: no speeds per leg.");
  if (!legs_known(experiment))
    description.notes.push_back("Without legs the contact fit takes all of them at their mean length.");
  if (!experiment.columns.outcomes)
    description.notes.push_back("Outcomes are not known: no survival, and no rest enters the contact fit.");
  if (!options.fit || !has_contact_fit(experiment.contact.law)) {
    if (options.fit)
      description.notes.push_back(fmt::format("Of the nominal law, {}, no contact parameters are fitted.",
                                              dynamics::law_name(experiment.contact.law)));
    return description;
  }
  description.transition = options.transition.value_or(best_transition(experiment));
  if (!options.transition && description.transition == Transition::step &&
      experiment.columns.omega_plus == Presence::all)
    description.notes.push_back(
        "Some omega_plus would not carry the wheel over its foot, and yet it went on: omega_plus is not the speed with "
        "which the stance begins, and the contact fit uses the steps from omega_minus to the next omega_minus.");
  if (experiment.columns.omega_plus == Presence::some && description.transition == Transition::collision)
    description.notes.push_back("Collisions without omega_plus do not enter the contact fit.");
  const ContactFitOptions fit{experiment.contact.law, description.transition, options.threads, true, options.progress};
  std::vector<std::size_t> all;
  for (std::size_t i = 0; i < experiment.conditions.size(); ++i)
    if (description.conditions[i].trials > 0) all.push_back(i);
  if (all.size() > 1)
    for (const std::size_t i : all)
      description.fits.push_back({experiment.conditions[i].id, fit_contact(experiment, {i}, fit)});
  if (!all.empty()) description.fits.push_back({"all conditions", fit_contact(experiment, all, fit)});
  return description;
}

}  // namespace metastable::analysis
