#pragma once
// Maps the wheel by the published law without its charge on collisions that would stick.

#include <optional>
#include <span>
#include <utility>

#include "dynamics/return_map/wheel_map.h"

namespace metastable::analysis {

/// Maps as `published` does, but a foot with mu >= mu_c = x y/(L2^2 + y^2) sticks: it does not slide, so it loses
/// nothing to friction (21) and moves nothing along the ramp (34). Below mu_c it is as printed. Satisfies
/// markov::ReturnMap.
class UnchargedSticking {
 public:
  /// @throws std::invalid_argument for another law than `published`
  explicit UnchargedSticking(dynamics::WheelMap map);

  std::pair<double, double> state_interval(int phase) const { return map_.state_interval(phase); }
  int phases() const { return map_.phases(); }
  int noise_dimension() const { return map_.noise_dimension(); }
  std::optional<double> landing(double state, int phase, std::span<const double> score) const;
  /// Returns omega+^2 [rad^2/s^2].
  double after_collision(double state, int phase, const dynamics::Contact& contact) const;
  /// Returns what omega+^2 = scale x - drag sqrt(x) is made of, as WheelMap::coefficients.
  dynamics::StepCoefficients coefficients(int phase, const dynamics::Contact& contact) const;
  /// Returns mu_c of the collision in which this leg lands.
  double sticking_friction(int phase) const;

  using Table = dynamics::WheelMap::Table;
  /// Prepares many draws of one phase.
  Table tabulate(int phase, std::span<const double> score) const;

 private:
  dynamics::WheelMap map_;
};

}  // namespace metastable::analysis
