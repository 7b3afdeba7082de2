#pragma once
// Makes the wheel's stochastic return map on x = omega^2 just before a collision.

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "dynamics/wheel/contact_law.h"
#include "dynamics/wheel/contact_noise.h"
#include "dynamics/wheel/wheel.h"

namespace metastable::dynamics {

class PublishedDensity;

/// Describes the stance on one leg, from the collision in which it lands to the next.
struct Stance {
  double inertia = 0;  ///< I about this foot [kg m^2]
  double barrier =
      0;  ///< omega+^2 needed to carry the hub over the foot [rad^2/s^2]: 2/I M g L (1 - sin(beta2 + gamma))
  double gain =
      0;  ///< omega^2 gained until the next collision [rad^2/s^2]: 2/I M g L (sin(beta2+gamma) - sin(beta1'-gamma))
  double start_angle_rad = 0;  ///< beta2 + gamma [rad], leg to the horizontal at landing
  double end_angle_rad = 0;    ///< pi - (beta1' - gamma) [rad], at the next collision
  double pendulum = 0;         ///< 2 M g L / I [rad^2/s^2]
  double length = 0;           ///< L [m]
};

/// One collision is followed by one stance. For u0 = 0 the losses that the return map needs are proportional to
/// omega^2 and omega: omega+^2 = scale * x - drag * sqrt(x) (one draw of eta and mu serves every speed).
struct StepCoefficients {
  double scale = 0;  ///< -infinity when the foot jams
  double drag = 0;   ///< [rad/s]
};

/// Maps the wheel on one ramp. Phases are the legs in landing order; a wheel with equal legs has one phase.
/// At phase p leg p lands and leg p-1 (mod legs) is the stance leg. Satisfies markov::ReturnMap.
class WheelMap {
 public:
  /// @param slope gamma [rad], 0 < slope < alpha/2
  /// @throws std::invalid_argument naming the quantity and its range (slope in degrees)
  WheelMap(Wheel wheel, double slope, Law law, ContactNoise noise, double rebound_lost = 0);

  const Wheel& wheel() const { return wheel_; }
  double slope() const { return slope_; }
  Law law() const { return model_.law; }
  const ContactNoise& noise() const { return noise_; }
  const ContactModel& contact_model() const { return model_; }
  const Stance& stance(int phase) const { return stance_[static_cast<std::size_t>(phase)]; }
  const Triangle& triangle(int phase) const { return triangle_[static_cast<std::size_t>(phase)]; }

  /// Returns the collision at `phase` with speed omega [rad/s].
  Collision collision(int phase, double omega) const;
  /// Returns the losses of that collision [J].
  Loss loss(int phase, double omega, const Contact& contact) const;
  /// Returns the same as coefficients of omega+^2, for u0 = 0.
  StepCoefficients coefficients(int phase, const Contact& contact) const;
  /// Returns omega+^2 [rad^2/s^2] just after the collision (negative: the wheel has stopped; -infinity: it jammed).
  double after_collision(double state, int phase, const Contact& contact) const;

  // These make up the return-map concept.
  std::pair<double, double> state_interval(int phase) const;  ///< {lowest state a survivor can have, +infinity}
  int phases() const { return static_cast<int>(stance_.size()); }
  int noise_dimension() const { return noise_.dimension(); }
  std::optional<double> landing(double state, int phase, std::span<const double> score) const;
  /// Returns it exactly, by quadrature over eta and the distribution function of mu in closed form (independent eta,
  /// mu, or a list); returns nothing for a correlated pair.
  std::optional<double> rest_probability(double state, int phase) const;
  /// Gives the density of the landing at each of the next states [1/(rad^2/s^2)]: density[k] belongs to next[k]
  /// (PublishedDensity, and LandingDensity for states slower than any survivor); returns the probability of rest.
  /// Returns nothing where PublishedDensity does not cover the map.
  std::optional<double> landing_density(double state, int phase, std::span<const double> next,
                                        std::span<double> density) const;
  /// Gives points with weights for expectations over the landing; states where those are not smooth follow
  /// (dynamics/return_map/landing_quadrature.h).
  double landing_points(double state, int phase, std::span<const double> breaks,
                        std::vector<std::pair<double, double>>& points) const;
  std::vector<double> states_of_extremes(int phase, std::span<const double> next) const;
  /// Returns infimum and supremum of the landing over the support of (eta, mu); -infinity stands for rest.
  std::pair<double, double> landing_range(double state, int phase) const;
  /// Returns the time of the stance from `phase` to next_state [s], in closed form (Carlson's R_F, the elliptic
  /// integral of the first kind). It is infinite for a state that no wheel coming over the foot can have.
  double duration(double next_state, int phase) const;
  /// Returns the chord from this foot to the next [m].
  double advance(int phase) const;
  /// Names "foot lifts" (leg force would pull, just before this collision or just after it), "negative loss" (any
  /// of the law's losses is negative), "energy gain" (the total loss is negative).
  std::vector<std::string> assumptions() const;
  bool violates(int which, double state, int phase, std::span<const double> score) const;

  /// Holds many draws of one phase as arrays of coefficients.
  class Table {
   public:
    explicit Table(const Stance& landed) : barrier_(landed.barrier), gain_(landed.gain) {}
    void add(const StepCoefficients& draw);
    void land(double origin, double width, std::span<const double> offset, std::size_t first,
              std::span<double> next) const;
    double lowest_survivor(std::size_t k) const;
    void reorder(std::span<const std::uint32_t> order);

   private:
    std::vector<double> scale_, drag_;
    double barrier_ = 0, gain_ = 0;
  };
  Table tabulate(int phase, std::span<const double> score) const;

 private:
  Wheel wheel_;
  double slope_;
  ContactNoise noise_;
  ContactModel model_;
  std::vector<Triangle> triangle_;  // of the collision in which leg p lands
  std::vector<Stance> stance_;      // on leg p after it
  struct FastDensities;
  /// Holds them by phase; it is empty where PublishedDensity does not cover the map.
  const std::vector<PublishedDensity>& fast_densities() const;
  std::shared_ptr<FastDensities> fast_densities_;  // shared by copies
};

/// Returns the speed above which the foot lifts just before the collision at `phase` [rad/s]: omega^2 L1 = g sin(beta1
/// - gamma).
double lift_speed(const WheelMap& map, int phase);

}  // namespace metastable::dynamics
