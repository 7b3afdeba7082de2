#include "analysis/wheel_model/wheel_nuisances.h"

#include <algorithm>
#include <cmath>

namespace metastable::analysis {
namespace {

// The share of stated contact parameters that are those of another wheel or another unit altogether: an assumption.
// It lets a fit leave them behind at a cost of 4.6 in log likelihood, and no effect gains more by bringing them back.
constexpr double misstated_contact = 0.01;

// An sd of the contact so many times the noise [rad/s] changes the variance of a noisy speed by less than half a per
// cent.
constexpr double hidden_by_noise = 0.01;
constexpr double smallest_sd = 1e-6;  // with which densities are still told

// Returns the least sd that a contact is told to have where its stated one is small.
double least_sd(const NominalContact& nominal, std::optional<double> noise) {
  if (nominal.law == dynamics::Law::settled || !noise) return least_scatter;
  return std::clamp(hidden_by_noise * *noise, smallest_sd, least_scatter);
}

Nuisance sd_nuisance(const char* name, double stated, double least, double upper) {
  const double start = std::max(least, stated), usual = least_scatter / 2,
               lower = stated < least_scatter ? std::min(usual, least) : usual;
  return {name, std::log(start), 0.4, 1e-3, std::log(lower), std::log(upper)};
}

}  // namespace

dynamics::ContactSpread stated_contact(const NominalContact& nominal, double noise) {
  const Spread &eta = nominal.restitution, &mu = nominal.friction;
  const double least = least_sd(nominal, noise);
  return {eta.mean, std::max(least, eta.sd), mu.mean, std::max(least, mu.sd)};
}

std::vector<Nuisance> wheel_nuisances(const NominalContact& nominal, std::optional<double> noise,
                                      std::optional<double> seen) {
  const Spread &eta = nominal.restitution, &mu = nominal.friction;
  using Slot = WheelSlot;
  const bool settled = nominal.law == dynamics::Law::settled;
  const std::size_t at_noise = settled ? Slot::log_settled_noise_sd : Slot::log_noise_sd;
  const double least = least_sd(nominal, seen);
  std::vector<Nuisance> all(noise ? at_noise + 1 : at_noise);
  all[Slot::restitution_mean] = {"restitution_mean", eta.mean, 0.08, 1e-4, 0.02, 0.98};
  all[Slot::log_restitution_sd] = sd_nuisance("log restitution_sd", eta.sd, least, 0.4);
  all[Slot::friction_mean] = {"friction_mean", mu.mean, 0.08, 1e-4, 0.02, 1.5};
  all[Slot::log_friction_sd] = sd_nuisance("log friction_sd", mu.sd, least, 0.5);
  for (const std::size_t stated :
       {Slot::restitution_mean, Slot::log_restitution_sd, Slot::friction_mean, Slot::log_friction_sd})
    all[stated].misstated = misstated_contact;
  all[Slot::skew] = {"skew", 0, 0.06, 1e-3, -0.5, 0.5};
  all[Slot::tails] = {"tails", 0, 0.06, 1e-3, -0.4, 0.4};
  if (settled) {
    all[Slot::log_hub_inertia_ratio] = {"log hub_inertia_ratio", 0, 0.1, 1e-3, -0.7, 0.7};
    all[Slot::log_sticking_ratio] = {"log sticking_ratio", 0, 0.003, 1e-4, -0.03, 0.03};
    all[Slot::log_plus_ratio] = {"log plus_ratio", 0, 0.003, 1e-4, -0.03, 0.03};
    all[Slot::log_next_ratio] = {"log next_ratio", 0, 5e-4, 1e-5, -0.005, 0.005};
    // In Chipmunk next omega- is off by -0.0016 rad/s at 9.59 deg and by 0.0004 at 7.02, 1.4e-4 of it a degree: 2e-4.
    all[Slot::next_by_slope] = {"next_by_slope", 0, 0.012, 1e-3, -0.12, 0.12};
    // Of two engines (five runs without an effect in ODE and Chipmunk) eta comes out 0.006 to 0.014 and J 0 to 8 % low,
    // most in the one whose steps part most from the law.
    all[Slot::restitution_mean].form_sd = 0.008;
    all[Slot::log_hub_inertia_ratio].form_sd = 0.045;
  }
  if (noise) all[at_noise] = {"log noise_sd", std::log(*noise), 0.5, 1e-3, std::log(5e-6), 0, true};
  return all;
}

WheelHypothesis hypothesis_at(std::span<const double> nuisance) {
  using Slot = WheelSlot;
  WheelHypothesis hypothesis{.contact = {nuisance[Slot::restitution_mean], std::exp(nuisance[Slot::log_restitution_sd]),
                                         nuisance[Slot::friction_mean], std::exp(nuisance[Slot::log_friction_sd])},
                             .tilt = ScoreTilt(nuisance[Slot::skew], nuisance[Slot::tails]),
                             .extension = {}};
  if (nuisance.size() == Slot::log_noise_sd + 1) hypothesis.noise = std::exp(nuisance[Slot::log_noise_sd]);
  if (nuisance.size() > Slot::next_by_slope) {
    hypothesis.extension.geometry.hub_inertia_ratio = std::exp(nuisance[Slot::log_hub_inertia_ratio]);
    hypothesis.extension.law_error.sticking_ratio = std::exp(nuisance[Slot::log_sticking_ratio]);
    hypothesis.extension.law_error.plus_ratio = std::exp(nuisance[Slot::log_plus_ratio]);
    hypothesis.extension.law_error.next_ratio = std::exp(nuisance[Slot::log_next_ratio]);
    hypothesis.extension.law_error.next_by_slope = nuisance[Slot::next_by_slope];
  }
  if (nuisance.size() > Slot::log_settled_noise_sd) hypothesis.noise = std::exp(nuisance[Slot::log_settled_noise_sd]);
  return hypothesis;
}

void set_contact(std::vector<double>& nuisance, const dynamics::ContactSpread& contact) {
  nuisance[WheelSlot::restitution_mean] = contact.restitution_mean;
  nuisance[WheelSlot::log_restitution_sd] = std::log(contact.restitution_sd);
  nuisance[WheelSlot::friction_mean] = contact.friction_mean;
  nuisance[WheelSlot::log_friction_sd] = std::log(contact.friction_sd);
}

}  // namespace metastable::analysis
