#pragma once
// Lists the catalogue's effects on the wheel, as they are fitted. Each has one entry: what is free in it, what its
// values do to the wheel, what they are called in the catalogue and which of them the catalogue's values are, and what
// it needs.

#include <cstddef>
#include <functional>
#include <vector>

#include "analysis/fitting/transition_model.h"
#include "analysis/wheel_model/contact_variation.h"
#include "dynamics/extended_wheel/extended_wheel.h"

namespace metastable::analysis {

/// Says what the data allow, for the choice of variants and for saying what cannot be told.
struct WheelDesign {
  int legs = 8;
  bool legs_known = true, speeds_after = true;
  bool launches_stated = true, noise_stated = true;
  double noise = 0.01;    ///< of reported speeds in the nominal model [rad/s]
  double noise_seen = 0;  ///< by how much stances scatter [rad/s]; 0: too few to say
  std::size_t trials = 0;
  std::size_t launches = 0;         ///< for which a launch speed is stated
  std::size_t successive = 0;       ///< collisions with one before them in their trial
  std::size_t away = 0;             ///< collisions away from the start of the ramp
  std::vector<double> leg_lengths;  ///< stated [m]
  std::vector<double> speeds;       ///< between the measured omega-, rising: quantiles [rad/s]
  double furthest = 1.8;            ///< landing foot [m]
  /// By collision number: where its foot lands [m], while all trials land it there; empty: they start anywhere.
  std::vector<double> footholds;
  double ramp_length = 3.66;  ///< [m]
  dynamics::Law law = dynamics::Law::published;
};

/// Holds a candidate, and what its variant and values do to the wheel.
struct WheelCandidate {
  Candidate candidate;
  std::function<void(dynamics::Extension&, const std::vector<double>& variant, const std::vector<double>& values)>
      apply;
  /// Returns by how much a unit of a parameter, from its neutral value on, changes an aspect of a contact. Each variant
  /// changes one aspect. An effect that does more than that has no such function.
  std::function<AspectChange(const dynamics::StepContext&, const std::vector<double>& variant, std::size_t parameter)>
      changes = {};
};

/// Lists all but contact_distribution, which is the recalibration; in the order of the catalogue.
std::vector<WheelCandidate> wheel_candidates(const WheelDesign& design);

}  // namespace metastable::analysis
