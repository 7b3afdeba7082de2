#include "tests/analysis/experiment_model/engine_wheel.h"

#include <fmt/format.h>
#include <ode/ode.h>

#include <array>
#include <cmath>
#include <iterator>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <vector>

namespace metastable::test {
namespace {

constexpr int legs = 8;
constexpr std::array<double, legs> leg_length{0.1524, 0.1524, 0.1514, 0.1514, 0.1516, 0.1508, 0.1524, 0.1528};
constexpr double mass = 1.39, hub_inertia = 0.0025, tip_radius = 0.0005, gravity = 9.81, ramp = 3.66;
constexpr double step = 5e-5;                         // [s]
constexpr double slowest_bounce = 1e-3;               // [m/s]: slower touches do not spring
constexpr double settled_after = 0.003;               // [s]: a foot that has not left the ground by then stays
constexpr double rest_speed = 0.05, rest_for = 0.05;  // [rad/s], [s]
constexpr double degree = std::numbers::pi / 180, leg_angle = 2 * std::numbers::pi / legs;

struct Ramp {
  const char* id;
  double slope_deg, speed, speed_sd;  // of omega- at the first collision, about [rad/s]
};
constexpr Ramp ramps[] = {
    {"fast-9.59", 9.59, 7.05, 0.19}, {"slow-9.59", 9.59, 6.03, 0.28}, {"fast-7.02", 7.02, 7.90, 0.10}};

struct Row {
  int leg;
  double time, position, before, after;
};
struct Trial {
  std::vector<Row> rows;
  bool rested = false;
};

// One trial in a world of its own: x down the ramp, y away from it, the wheel turning about -z.
class World {
 public:
  World(const EngineRun& run, const Ramp& on, std::mt19937_64& random) : run_(run), random_(random) {
    world_ = dWorldCreate();
    contacts_ = dJointGroupCreate(0);
    const double slope = on.slope_deg * degree;
    dWorldSetGravity(world_, gravity * std::sin(slope), -gravity * std::cos(slope), 0);
    dWorldSetCFM(world_, 1e-10);
    dWorldSetQuickStepW(world_, 1);
    body_ = dBodyCreate(world_);
    dMass all;
    dMassSetParameters(&all, mass, 0, 0, 0, 1e-3, 1e-3, hub_inertia, 0, 0, 0);
    dBodySetMass(body_, &all);
    dJointAttach(dJointCreatePlane2D(world_, nullptr), body_, nullptr);
    for (int k = 0; k < legs; ++k) {
      const double angle = -std::numbers::pi / 2 + leg_angle * k,
                   length = leg_length[static_cast<std::size_t>(k)] - tip_radius;
      tip_x_[static_cast<std::size_t>(k)] = length * std::cos(angle);
      tip_y_[static_cast<std::size_t>(k)] = length * std::sin(angle);
    }
    // Leg 0 stands upright, at the speed that lands near the one wanted.
    std::normal_distribution<double> launch(on.speed, on.speed_sd);
    const double l = leg_length[0], fall = l * (std::cos(slope) - std::cos(leg_angle / 2 + slope));
    const double wanted = launch(random_),
                 omega = std::sqrt(
                     std::max(1.0, wanted * wanted - 2 * mass * gravity * fall / (hub_inertia + mass * l * l)));
    const double height = tip_radius - tip_y_[0];
    dBodySetPosition(body_, 0, height, 0);
    dBodySetAngularVel(body_, 0, 0, -omega);
    dBodySetLinearVel(body_, omega * height, 0, 0);
    draw(0);
    draw(1);
  }
  ~World() {
    dJointGroupDestroy(contacts_);
    dWorldDestroy(world_);
  }
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  Trial roll() {
    Trial trial;
    double still = 0;
    for (double time = 0;; time += step) {
      touch(time, trial.rows);
      if (!trial.rows.empty() && trial.rows.back().position > ramp) {
        trial.rows.pop_back();
        return trial;
      }
      const double omega = -dBodyGetAngularVel(body_)[2];
      dBodyAddTorque(body_, 0, 0, run_.viscous_drag * omega);
      dWorldSetQuickStepNumIterations(world_, touching_ ? 20 : 2);  // in flight nothing is coupled
      dWorldQuickStep(world_, step);
      dJointGroupEmpty(contacts_);
      const dReal* v = dBodyGetLinearVel(body_);
      still = std::abs(omega) < rest_speed && std::hypot(v[0], v[1]) < rest_speed ? still + step : 0;
      if (still > rest_for) {
        trial.rested = true;
        return trial;
      }
    }
  }

 private:
  void draw(int leg) {
    std::normal_distribution<double> fresh;
    for (double& score : scores_)
      score = drawn_ ? run_.memory * score + std::sqrt(1 - run_.memory * run_.memory) * fresh(random_) : fresh(random_);
    drawn_ = true;
    const auto k = static_cast<std::size_t>(leg);
    restitution_[k] = std::clamp(0.4 + 0.05 * scores_[0], 0.0, 1.0);
    friction_[k] = std::max(0.0, 0.4 + 0.03 * scores_[1]) * (leg == run_.odd_leg ? run_.friction_ratio : 1);
  }

  // Gives the engine a contact for every tip in the ground, and takes down the first touch of the leg that comes next.
  void touch(double time, std::vector<Row>& rows) {
    const dReal *at = dBodyGetPosition(body_), *turned = dBodyGetRotation(body_);
    const double omega = -dBodyGetAngularVel(body_)[2];
    touching_ = false;
    for (int leg = 0; leg < legs; ++leg) {
      const auto k = static_cast<std::size_t>(leg);
      const double x = at[0] + turned[0] * tip_x_[k] + turned[1] * tip_y_[k],
                   y = at[1] + turned[4] * tip_x_[k] + turned[5] * tip_y_[k], depth = tip_radius - y;
      if (open_ && leg == rows.back().leg && depth < 0) close(rows, omega);
      if (depth < 0) continue;
      touching_ = true;
      if (leg == next_) {
        if (open_) close(rows, omega);
        rows.push_back({leg, time, x, omega, omega});
        open_ = true;
        next_ = (leg + 1) % legs;
        draw(next_);
      }
      dContact contact{};
      contact.surface.mode = dContactBounce | dContactApprox1 | dContactMu2;
      contact.surface.mu = friction_[k];
      contact.surface.bounce = restitution_[k];
      contact.surface.bounce_vel = slowest_bounce;
      contact.geom.pos[0] = x;
      contact.geom.pos[1] = y - tip_radius;
      contact.geom.normal[1] = 1;
      contact.geom.depth = depth;
      dJointAttach(dJointCreateContact(world_, contacts_, &contact), body_, nullptr);
    }
    if (open_ && time - rows.back().time > settled_after) close(rows, omega);
  }

  void close(std::vector<Row>& rows, double omega) {
    rows.back().after = omega;
    open_ = false;
  }

  const EngineRun& run_;
  std::mt19937_64& random_;
  dWorldID world_ = nullptr;
  dJointGroupID contacts_ = nullptr;
  dBodyID body_ = nullptr;
  std::array<double, legs> tip_x_{}, tip_y_{}, restitution_{}, friction_{};
  std::array<double, 2> scores_{};  // of restitution and friction at the foothold drawn last
  bool drawn_ = false;
  int next_ = 1;
  bool touching_ = false;
  bool open_ = false;  // the foot that landed last has not left the ground again
};

}  // namespace

analysis::Experiment engine_experiment(const EngineRun& run) {
  struct Engine {
    Engine() { dInitODE(); }
    ~Engine() { dCloseODE(); }
  } const engine;
  std::mt19937_64 random(run.seed);
  analysis::ExperimentSource source;
  source.folder = "engine";
  source.experiment_toml = fmt::format(
      "[wheel]\nhub_mass_kg = {}\nleg_lengths_m = [{}]\nradius_of_gyration_m = {:.6f}\ntip_radius_m = {}\n"
      "[contact]\nlaw = \"settled\"\nrestitution = {{ mean = 0.4, sd = 0.05 }}\nfriction = {{ mean = 0.4, sd = 0.03 "
      "}}\n",
      mass, fmt::join(leg_length, ", "), std::sqrt(hub_inertia / mass), tip_radius);
  std::string collisions = "condition,trial,collision,leg,time_s,position_m,omega_minus_rad_s,omega_plus_rad_s\n";
  std::string trials = "condition,trial,outcome\n";
  int number = 0;
  for (const Ramp& on : ramps) {
    source.experiment_toml +=
        fmt::format("[[condition]]\nid = \"{}\"\nslope_deg = {}\nramp_length_m = {}\nfirst_landing_leg = 1\n", on.id,
                    on.slope_deg, ramp);
    for (int i = 0; i < run.trials; ++i) {
      const Trial trial = World(run, on, random).roll();
      ++number;
      int collision = 0;
      for (const Row& row : trial.rows)
        fmt::format_to(std::back_inserter(collisions), "{},{},{},{},{:.6f},{:.6f},{:.6f},{:.6f}\n", on.id, number,
                       ++collision, row.leg, row.time, row.position, std::max(0.0, row.before),
                       std::max(0.0, row.after));
      trials += fmt::format("{},{},{}\n", on.id, number, trial.rested ? "rest" : "end_of_ramp");
    }
  }
  source.collisions_csv = std::move(collisions);
  source.trials_csv = std::move(trials);
  return analysis::parse_experiment(source);
}

}  // namespace metastable::test
