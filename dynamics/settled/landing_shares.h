#pragma once
// Holds landings of a rigid wheel (`settled`) on a coarse grid of speed, restitution and friction: fast enough for
// likelihoods of whole experiments. dynamics/settled/landing_grid fills it.

#include <array>
#include <cstddef>
#include <vector>

namespace metastable::dynamics {

/// Says what landings on one slope keep, leg by leg. Along the axes of speed and restitution values are read by
/// straight lines, along friction by parabolas through places as the squares of even numbers between mu_r, where it is
/// steep, and mu_c.
struct LandingShares {
  struct GridAxis {
    double low = 0, high = 1;
    int count = 2;
    double at(int i) const { return low + (high - low) * i / (count - 1); }
  };
  /// Says what resisting torques take off the next omega-^2 of a foot that carries on `carried_squared`, per torque:
  /// constant, by omega, by omega^2. It is more than of a standing foot, as the wheel turns slower while it hops.
  struct Drag {
    double carried_squared = 0;
    std::array<double, 3> lost{};
    /// Torques raise mu_r by so much, because a foot that slides while they slow the wheel needs more friction to stop:
    /// per constant torque [1/(N m)], by omega [1/(N m s)], by omega^2 [1/(N m s^2)].
    std::array<double, 3> resting{};
  };
  struct Leg {
    Drag drag;
    double sticking = 0;         ///< mu_c
    double gyration_sq = 0;      ///< J / M about the centre of mass [m^2]
    double chord = 0;            ///< between the feet [m]
    double ahead = 0;            ///< of the landing foot, ahead of the centre of mass [m]
    double height = 0;           ///< below it [m]
    double plastic = 0;          ///< share of omega^2 that a foot keeps which sticks and does not spring
    double barrier_squared = 0;  ///< least omega_eq^2 that passes [rad^2/s^2]
    double next_rate = 1;        ///< omega-^2 of the next touch is next_rate omega_eq^2 + next_gain
    double next_gain = 0;        ///< [rad^2/s^2]
    double pace = 0;             ///< from touch to touch of two standing feet [m]
    double settles_below = 0;    ///< omega- up to which the landed foot stands before the next leg touches [rad/s]
  };
  GridAxis speed, restitution;
  static constexpr int parts = 20;  ///< places between mu_r and mu_c, both included
  std::vector<Leg> legs;
  std::vector<float> resting;             ///< by leg, speed, restitution: mu_r; mu_c where even a sticking foot rests
  std::vector<float> kept, displacement;  ///< ... and place: carried omega^2 / omega-^2, slide of the foot [m]

  /// The changes of these with ln J, by straight lines; a grid without them is not read at another J.
  std::vector<float> resting_rate, kept_rate, displacement_rate;

  /// By leg and speed: the largest restitution with which a sticking foot stands before the next leg touches. Empty: it
  /// was not asked for.
  std::vector<float> settling;

  /// Returns up to which restitution every landing around a speed is read from feet that stand alone: the least of both
  /// nodes, less one cell, in which values lie between those of feet that stand and of feet that do not (a next omega-
  /// is 0.02 to 0.05 rad/s off there). 1 where it was not asked for. @param omega omega- [rad/s]
  double settling_restitution(int leg, double omega) const;
  /// Sizes the lists for `legs`, but for the changes.
  void resize();
  std::size_t cell(int leg, int speed, int restitution) const;
  /// Returns the landings of a wheel of other J. @param gyration_sq  J / M by leg [m^2]
  LandingShares of_gyration(const std::vector<double>& gyration_sq) const;
  static constexpr double part(int place) {
    return static_cast<double>(place) * place / ((parts - 1.0) * (parts - 1.0));
  }

  /// Holds a landing's omega_eq^2 / omega-^2 and the slide of its foot [m].
  struct Kept {
    double share = 0, displacement = 0;
  };
  /// One leg at one speed and one restitution; beyond the axes the last values are kept. It refers to the grid.
  class SharesAtRestitution {
   public:
    double resting_friction() const { return resting_; }
    /// Friction above mu_c is read as mu_c; below mu_r the share falls on by the straight line through the first two
    /// places.
    Kept at(double friction) const;
    Kept at_place(int place) const;  ///< of the grid: from mu_r to mu_c as `part` says

   private:
    friend LandingShares;
    SharesAtRestitution(const LandingShares& grid, const Leg& leg, std::array<std::size_t, 4> cells,
                        std::array<double, 4> weights);
    double of(const std::vector<float>& values, int stride, int place) const;
    const LandingShares* grid_;
    const Leg* leg_;
    std::array<std::size_t, 4> cells_;  // of speeds and restitutions around
    std::array<double, 4> weights_;
    double resting_;
  };
  /// One leg at one speed; beyond the axes as above.
  class SharesAtSpeed {
   public:
    SharesAtSpeed(const LandingShares& grid, int leg, double omega);
    const Leg& leg() const { return *leg_; }
    SharesAtRestitution at_restitution(double eta) const;
    Kept at(double eta, double friction) const { return at_restitution(eta).at(friction); }

   private:
    const LandingShares* grid_;
    const Leg* leg_;
    std::size_t slow_, fast_;  // first cells of the speeds around
    double faster_;            // weight of the second
  };
  SharesAtSpeed place(int leg, double omega) const { return {*this, leg, omega}; }
};

/// Returns mu_c.
double sticking_friction(double ahead, double height, double gyration_sq);
/// Returns the share of omega^2 that a foot keeps which sticks and does not spring. @param chord between the feet [m]
/// @param ahead, height of the landing foot: ahead of the centre of mass, below it [m]; @param gyration_sq J / M [m^2]
double plastic_share(double chord, double ahead, double height, double gyration_sq);

}  // namespace metastable::dynamics
