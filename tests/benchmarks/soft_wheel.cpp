#include "tests/benchmarks/soft_wheel.h"

#include <Simbody.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

namespace soft_wheels {
namespace {

using namespace SimTK;

constexpr int spheres = 3;  // [legs] that may touch at a time
const double gravity = 9.81, degree = Pi / 180, leg_angle = 2 * Pi / legs;
constexpr double transition_speed = 4e-3;             // [m/s]: slip below which friction is not full
constexpr double longest_step = 4e-4;                 // [s]
constexpr double slowest_bounce = 5e-3;               // [m/s]: slower touches have its dissipation
constexpr double settled_after = 0.05;                // [s]: a foot that has not left the ground by then stays
constexpr double rest_speed = 0.05, rest_for = 0.05;  // [rad/s], [s]
constexpr double landing_speed = 0.58;                // [m/s]: a foot that lands at 5 rad/s
constexpr double sag_length = 3.66;                   // [m]

// lambda v of a Hunt-Crossley impact that gives back the share eta of the speed v:
// lambda v (1 + eta) = ln((1 + lambda v)/(1 - eta lambda v)).
double dissipation_number(double eta) {
  if (eta >= 0.999) return 0;
  const auto excess = [&](double d) { return std::log((1 + d) / (1 - eta * d)) - d * (1 + eta); };
  double low = 1e-9, high = std::min(1 / std::max(eta, 1e-3), 1e3) * (1 - 1e-12);
  for (int i = 0; i < 80; ++i) {
    const double middle = 0.5 * (low + high);
    (excess(middle) < 0 ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

// E* of the Hertz tip whose undamped impact of mass m at speed v lasts as long as that of a linear spring k.
double plane_strain_modulus(double k, double radius, double m, double v) {
  // pi sqrt(m/k) = 2.9432 x/v with the depth x = (5 m v^2/(4 h))^(2/5), h = 4/3 sqrt(R) E*.
  const double depth = Pi * std::sqrt(m / k) * v / 2.9432, hertz = 1.25 * m * v * v / std::pow(depth, 2.5);
  return hertz / (4.0 / 3.0 * std::sqrt(radius));
}

// Everything but contact that acts on the wheel: weight on the local slope, drags, a magnet, a gust.
class Loads : public Force::Custom::Implementation {
 public:
  Loads(const SimbodyMatterSubsystem& matter, const MobilizedBody& wheel, const Machine& machine, double slope)
      : matter_(matter), wheel_(wheel), machine_(machine), slope_(slope) {}
  void calcForce(const State& state, Vector_<SpatialVec>& forces, Vector_<Vec3>&, Vector&) const override {
    const double x = wheel_.getBodyOriginLocation(state)[0], omega = -wheel_.getBodyAngularVelocity(state)[2];
    const double slope = slope_ + 4 * machine_.sag / sag_length * (1 - 2 * x / sag_length) * inside(x, 0, sag_length);
    const Vec3 g(gravity * std::sin(slope), -gravity * std::cos(slope), 0);
    for (MobilizedBodyIndex i(1); i < matter_.getNumBodies(); ++i) {
      const MobilizedBody& body = matter_.getMobilizedBody(i);
      const MassProperties& of = body.getBodyMassProperties(state);
      if (!body.isSameMobilizedBody(*ramp_))
        body.applyForceToBodyPoint(state, of.getMassCenter(), of.getMass() * g, forces);
    }
    const double opposing = machine_.torque * std::tanh(omega / 0.05) + machine_.viscous_drag * omega +
                            machine_.air_drag * omega * std::abs(omega);
    wheel_.applyBodyTorque(state, Vec3(0, 0, opposing), forces);
    const Vec3 push(machine_.gust * inside(state.getTime(), 1.0, 1.5),
                    -machine_.magnet * std::exp(-square((x - 1) / 0.1)), 0);
    wheel_.applyForceToBodyPoint(state, Vec3(0), push, forces);
  }
  Real calcPotentialEnergy(const State&) const override { return 0; }
  void spare(const MobilizedBody& ramp) { ramp_ = &ramp; }

 private:
  static double inside(double at, double from, double to) { return at > from && at < to ? 1 : 0; }
  const SimbodyMatterSubsystem& matter_;
  const MobilizedBody& wheel_;
  const Machine& machine_;
  double slope_;
  const MobilizedBody* ramp_ = nullptr;
};

// The bodies and forces of one machine on one ramp: x down the ramp, y away from it, the wheel turning about -z.
class Bodies {
 public:
  Bodies(const Machine& machine, double slope)
      : machine_(machine), matter_(system_), forces_(system_), contacts_(system_) {
    double square_length = 0;
    for (const double l : machine.leg_length) square_length += l * l / legs;
    const double m = machine.mass,
                 inertia = machine.inertia_ratio * (machine.hub_inertia + m * square_length) - m * square_length;
    const Vec3 centre = machine.hub_offset * radial(machine.hub_phase);
    const Inertia about_hub = Inertia(1e-3 + inertia, 1e-3 + inertia, inertia).shiftFromMassCenter(centre, m);
    wheel_ = MobilizedBody::Planar(matter_.Ground(), Transform(), Body::Rigid(MassProperties(m, centre, about_hub)),
                                   Transform());
    // The ramp stays on Ground unless it gives way along its normal.
    ramp_ = matter_.Ground();
    if (machine.ramp_compliance > 0) {
      const double k = 1 / machine.ramp_compliance, of = 4;
      MobilizedBody::Slider way(matter_.Ground(), Transform(Rotation(Pi / 2, ZAxis)),
                                Body::Rigid(MassProperties(of, Vec3(0), Inertia(1e-3))),
                                Transform(Rotation(Pi / 2, ZAxis)));
      Force::MobilityLinearSpring(forces_, way, MobilizerQIndex(0), k, 0);
      Force::MobilityLinearDamper(forces_, way, MobilizerUIndex(0), 2 * 0.2 * std::sqrt(k * of));
      ramp_ = way;
    }
    if (machine.loose_mass > 0) {
      const double k = machine.loose_mass * square(2 * Pi * 12);
      MobilizedBody::Slider weight(wheel_, Transform(Rotation(-Pi / 2, ZAxis)),
                                   Body::Rigid(MassProperties(machine.loose_mass, Vec3(0), Inertia(1e-5))),
                                   Transform());
      Force::MobilityLinearSpring(forces_, weight, MobilizerQIndex(0), k, 0);
      Force::MobilityLinearDamper(forces_, weight, MobilizerUIndex(0), 2 * 0.1 * std::sqrt(k * machine.loose_mass));
    }
    auto* loads = new Loads(matter_, wheel_, machine_, slope);
    loads->spare(ramp_);
    Force::Custom(forces_, loads);
    add_contact();
  }

  // The ramp is so stiff that the tip's own numbers act, and so rough that mu is twice the tip's.
  void set_contact(int leg, double dissipation, double friction) {
    for (Tip& tip : tips_)
      if (tip.leg == leg)
        tip.contact->setBodyParameters(ContactSurfaceIndex(0), modulus_, dissipation, friction / 2, friction / 2, 0);
  }
  // The engine looks for contacts of some legs only: the one that lands next and those before it.
  bool watched(int leg) const {
    return std::any_of(tips_.begin(), tips_.end(), [&](const Tip& tip) { return tip.leg == leg; });
  }
  void watch(int leg) {
    if (watched(leg)) return;
    for (Tip& tip : tips_)
      if (tip.leg == (leg + legs - spheres) % legs) {
        tip.leg = leg;
        contacts_.updBodyTransform(tip.set, ContactSurfaceIndex(0)) = Transform(this->tip(leg));
        return;
      }
  }
  Vec3 tip(int leg) const {
    const auto k = static_cast<std::size_t>(leg);
    return (machine_.leg_length[k] - machine_.tip_radius) * radial(leg_angle * leg);
  }
  MultibodySystem& system() { return system_; }
  const MobilizedBody::Planar& wheel() const { return wheel_; }
  const MobilizedBody& ramp() const { return ramp_; }

 private:
  // Leg 0 points down; the legs that land next follow against the wheel's turning.
  static Vec3 radial(double angle) { return Vec3(std::cos(angle - Pi / 2), std::sin(angle - Pi / 2), 0); }

  void add_contact() {
    const double foot_mass = 0.75 * machine_.mass;
    modulus_ = plane_strain_modulus(machine_.stiffness, machine_.tip_radius, foot_mass, landing_speed);
    // A set and a force for each tip: HuntCrossleyForce passes over the contacts after one that would pull.
    int leg = legs - 1;
    for (Tip& tip : tips_) {
      tip.leg = leg;
      leg = (leg + 1) % legs;
      tip.set = contacts_.createContactSet();
      contacts_.addBody(tip.set, wheel_, ContactGeometry::Sphere(machine_.tip_radius), Transform(this->tip(tip.leg)));
      contacts_.addBody(tip.set, ramp_, ContactGeometry::HalfSpace(), Transform(Rotation(-Pi / 2, ZAxis)));
      tip.contact = std::make_unique<HuntCrossleyForce>(forces_, contacts_, tip.set);
      tip.contact->setTransitionVelocity(transition_speed);
      set_contact(tip.leg, 1, machine_.friction);
      tip.contact->setBodyParameters(ContactSurfaceIndex(1), 1e6 * modulus_, 0, 1e6, 1e6, 0);
    }
  }

  struct Tip {
    int leg = -1;  // none yet
    ContactSetIndex set;
    std::unique_ptr<HuntCrossleyForce> contact;
  };
  const Machine& machine_;
  MultibodySystem system_;
  SimbodyMatterSubsystem matter_;
  GeneralForceSubsystem forces_;
  GeneralContactSubsystem contacts_;
  MobilizedBody::Planar wheel_;
  MobilizedBody ramp_;
  std::array<Tip, spheres> tips_;
  double modulus_ = 0;
};

// eta and mu of one foothold after another.
class Footholds {
 public:
  Footholds(const Machine& machine, double trial_share, std::uint64_t seed) : machine_(machine), random_(seed) {
    level_ = (1 + machine.drift * trial_share);
    added_ = machine.trial_spread * normal();
  }
  void draw(int leg, double position, double omega) {
    const auto k = static_cast<std::size_t>(leg);
    const double kept = machine_.memory, fresh = std::sqrt(1 - kept * kept);
    restitution_score_ = first_ ? normal() : kept * restitution_score_ + fresh * normal();
    friction_score_ = first_ ? normal() : kept * friction_score_ + fresh * normal();
    first_ = false;
    restitution[k] = std::clamp(
        (machine_.restitution + machine_.restitution_sd * restitution_score_) * machine_.restitution_ratio[k], 0.0,
        1.0);
    double mu = std::max(0.0, (machine_.friction + machine_.friction_sd * friction_score_) * level_ + added_);
    if (position > machine_.patch_from && position < machine_.patch_to) mu *= machine_.patch_ratio;
    if (std::uniform_real_distribution<double>()(random_) < machine_.outlier_share) mu *= machine_.outlier_ratio;
    friction[k] = mu * machine_.friction_ratio[k] * (1 + machine_.friction_speed * std::exp(-omega / 5));
  }
  double normal() { return normal_(random_); }
  std::array<double, legs> restitution{}, friction{};

 private:
  const Machine& machine_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  double level_ = 1, added_ = 0, restitution_score_ = 0, friction_score_ = 0;
  bool first_ = true;
};

struct Foot {
  double height, down, slows;  // of the tip over the ramp [m], its approach [m/s], [m/s^2]
  double x, along;             // down the ramp [m], [m/s]
  double until_touch() const {
    if (height <= 0) return 0;
    const double root = down * down + 2 * slows * height;
    if (root < 0 || down + std::sqrt(root) <= 0) return Infinity;
    return 2 * height / (down + std::sqrt(root));
  }
};

class Roller {
 public:
  Roller(const Machine& machine, const Ramp& ramp, double trial_share, std::uint64_t seed)
      : machine_(machine),
        slope_((ramp.slope_deg + machine.slope_offset) * degree),
        bodies_(machine, slope_),
        footholds_(machine, trial_share, seed),
        integrator_(bodies_.system()) {
    integrator_.setAccuracy(1e-4);
    integrator_.setMaximumStepSize(longest_step);
    integrator_.setReturnEveryInternalStep(true);
    State start = bodies_.system().realizeTopology();
    launch(start, ramp.speed + ramp.speed_sd * footholds_.normal());
    for (const int leg : {0, 1}) footholds_.draw(leg, 0, ramp.speed);
    arm(0, landing_speed);
    restart(start);
  }

  Trial roll(double ramp_length, int collisions) {
    Trial trial;
    double still = 0, last = 0;
    while (true) {
      const State& state = integrator_.getState();
      const double omega = -bodies_.wheel().getBodyAngularVelocity(state)[2];
      if (prepare(state, trial, omega)) continue;
      if (ramp_length > 0 && !trial.landings.empty() && trial.landings.back().position > ramp_length) {
        trial.landings.pop_back();
        trial.outcome = "end_of_ramp";
        return trial;
      }
      if (static_cast<int>(trial.landings.size()) == collisions &&
          state.getTime() - trial.landings.back().time > settled_after) {
        trial.outcome = "max_collisions";
        return trial;
      }
      still = std::abs(omega) < rest_speed ? still + state.getTime() - last : 0;
      last = state.getTime();
      if (still > rest_for || omega < -1) {
        trial.outcome = "rest";
        return trial;
      }
      integrator_.stepTo(state.getTime() + 1);
    }
  }

 private:
  // Leg 0 stands upright, at the speed that lands near the one wanted.
  void launch(State& state, double wanted) {
    const double l = machine_.leg_length[0], fall = l * (std::cos(slope_) - std::cos(leg_angle / 2 + slope_));
    const double omega = std::sqrt(std::max(
        1.0, wanted * wanted - 2 * machine_.mass * gravity * fall / (machine_.hub_inertia + machine_.mass * l * l)));
    bodies_.wheel().setQ(state, Vec3(0, 0, l - 1e-5));
    bodies_.wheel().setU(state, Vec3(-omega, omega * l, 0));
  }

  // Contact parameters belong to the system's topology: a change makes a new state with the old motion.
  void restart(const State& from) {
    const Vector q = from.getQ(), u = from.getU();
    const double time = from.getTime();
    State state = bodies_.system().realizeTopology();
    state.updQ() = q;
    state.updU() = u;
    state.setTime(time);
    integrator_.initialize(state);
    bodies_.system().realize(integrator_.getState(), Stage::Acceleration);
  }

  void arm(int leg, double speed) {
    const auto k = static_cast<std::size_t>(leg);
    const double v = machine_.material ? landing_speed : std::max(speed, slowest_bounce);
    bodies_.set_contact(leg, dissipation_number(footholds_.restitution[k]) / (1.5 * v), footholds_.friction[k]);
    armed_[k] = true;
  }

  Foot foot(const State& state, int leg) const {
    const MobilizedBody& wheel = bodies_.wheel();
    const Vec3 at = bodies_.tip(leg), p = wheel.findStationLocationInGround(state, at),
               v = wheel.findStationVelocityInGround(state, at), a = wheel.findStationAccelerationInGround(state, at);
    const MobilizedBody& ramp = bodies_.ramp();
    const bool still = ramp.isGround();
    const double level = still ? 0 : ramp.getBodyOriginLocation(state)[1],
                 rises = still ? 0 : ramp.getBodyOriginVelocity(state)[1];
    return {p[1] - machine_.tip_radius - level, rises - v[1], -a[1], p[0], v[0]};
  }

  // Takes down touches and lift-offs; gives a foot that is about to touch its contact. True where the system began
  // anew.
  bool prepare(const State& state, Trial& trial, double omega) {
    bodies_.system().realize(state, Stage::Acceleration);
    const double time = state.getTime();
    bool changed = false;
    for (int leg = 0; leg < legs; ++leg) {
      if (!bodies_.watched(leg)) continue;
      const auto k = static_cast<std::size_t>(leg);
      const Foot now = foot(state, leg);
      if (now.height > 0) {
        if (open_ && !trial.landings.empty() && leg == trial.landings.back().leg) close(trial, omega);
        if (touching_[k]) armed_[k] = touching_[k] = false;
        const double until = now.until_touch();
        if (until > 1.5 * longest_step || armed_[k]) continue;
        if (leg == next_) {
          const double spin = bodies_.wheel().getBodyAngularAcceleration(state)[2];
          trial.landings.push_back({leg, time + until, now.x + now.along * until, omega - spin * until,
                                    std::numeric_limits<double>::quiet_NaN()});
          opening_ = true;
          footholds_.draw(leg, trial.landings.back().position, trial.landings.back().before);
        }
        arm(leg, now.down + now.slows * until);
        changed = true;
      } else {
        touching_[k] = true;
        if (leg == next_ && opening_) {
          open_ = true;
          opening_ = false;
          next_ = (leg + 1) % legs;
          bodies_.watch(next_);
          const auto n = static_cast<std::size_t>(next_);
          armed_[n] = touching_[n] = false;
          changed = true;
        }
      }
    }
    if (open_ && time - trial.landings.back().time > settled_after) open_ = false;
    if (changed) restart(State(state));
    return changed;
  }
  void close(Trial& trial, double omega) {
    trial.landings.back().after = omega;
    open_ = false;
  }

  const Machine& machine_;
  double slope_;
  Bodies bodies_;
  Footholds footholds_;
  RungeKutta2Integrator integrator_;
  std::array<bool, legs> armed_{}, touching_{};
  int next_ = 1;
  bool opening_ = false,
       open_ = false;  // the next foot is about to land; the foot that landed last has not left the ground again
};

}  // namespace

Trial roll(const Machine& machine, const Ramp& ramp, int number, int trials, double ramp_length, int collisions,
           std::uint64_t seed) {
  const double share = trials > 1 ? static_cast<double>(number) / (trials - 1) : 0;
  Roller roller(machine, ramp, share, seed);
  return roller.roll(ramp_length, collisions);
}

}  // namespace soft_wheels
