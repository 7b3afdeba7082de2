#pragma once

#include <array>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

namespace soft_wheels {

inline constexpr int legs = 8;

/// A wheel on a ramp in Simbody, whose contact is a Hertz spring with Hunt-Crossley dissipation and a friction that is
/// continuous in the slip speed. SI units. All but the first group are effects, which the defaults leave out.
struct Machine {
  std::array<double, legs> leg_length{0.1524, 0.1524, 0.1514, 0.1514, 0.1516, 0.1508, 0.1524, 0.1528};
  double mass = 1.39, hub_inertia = 0.0025, tip_radius = 0.0005;
  double stiffness = 3e6;  ///< N/m: of the linear spring on which a foot's landing at 5 rad/s lasts as long
  double restitution = 0.4, restitution_sd = 0.05, friction = 0.4, friction_sd = 0.03;
  bool material =
      false;  ///< one dissipation a foothold, so that slower hops give back more; else each touch gives back eta

  std::array<double, legs> restitution_ratio{1, 1, 1, 1, 1, 1, 1, 1}, friction_ratio{1, 1, 1, 1, 1, 1, 1, 1};
  double slope_offset = 0;                               ///< deg
  double sag = 0;                                        ///< m, in the middle of 3.66 m
  double torque = 0, viscous_drag = 0, air_drag = 0;     ///< N m, N m s, N m s^2
  double hub_offset = 0, hub_phase = 0;                  ///< m, rad
  double inertia_ratio = 1;                              ///< of the inertia about a foot, M r_g^2 + M L^2
  double drift = 0;                                      ///< relative change of mu over all trials
  double memory = 0;                                     ///< correlation of successive scores of eta, and of mu
  double trial_spread = 0;                               ///< sd of what a trial adds to mu
  double patch_from = 0, patch_to = 0, patch_ratio = 1;  ///< m, m
  double outlier_share = 0, outlier_ratio = 1;
  double friction_speed = 0;  ///< a in mu (1 + a exp(-omega / 5 rad/s))

  double loose_mass = 0;       ///< kg, on a spring of 12 Hz along leg 0, damped
  double ramp_compliance = 0;  ///< m/N of the whole ramp, of 0.4 kg, damped
  double magnet = 0;           ///< N, pulls the hub to the ramp within 0.1 m of 1 m
  double gust = 0;             ///< N down the ramp in the third half second of a trial
};

struct Ramp {
  std::string id;
  double slope_deg, speed, speed_sd;  ///< of omega- at the first collision, about [rad/s]
};

struct Landing {
  int leg;
  double time, position, before;
  double after;  ///< NaN where the foot did not leave the ground again
};

struct Trial {
  std::vector<Landing> landings;
  std::string outcome;  ///< rest, end_of_ramp, max_collisions
};

/// Rolls trial `number` (from 0) of `trials` until rest, ramp_length (0: none) or the given number of collisions.
Trial roll(const Machine& machine, const Ramp& ramp, int number, int trials, double ramp_length, int collisions,
           std::uint64_t seed);

}  // namespace soft_wheels
