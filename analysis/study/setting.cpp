#include "analysis/study/setting.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <stdexcept>
#include <utility>

#include "analysis/statistics/estimate.h"
#include "analysis/study/consistency.h"
#include "dynamics/return_map/settled_return_map.h"
#include "dynamics/return_map/trials.h"
#include "dynamics/settled/settled_roll.h"
#include "dynamics/wheel/ranges.h"
#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

constexpr double slowest_roll = 1e-9;  // [rad/s]: a motion starts with some speed
constexpr double launch_reach = 5;  // [sd]: faster launches keep the share of omega^2 that the table's last speed does

void require_range(const std::string& name, double value, const std::string& unit, const dynamics::Range& range) {
  if (!range.holds(value))
    throw std::invalid_argument(
        fmt::format("{} {}{}{} is outside {}", name, value, unit.empty() ? "" : " ", unit, range.text()));
}

void require_spread(const std::string& name, const Spread& spread, const std::string& unit,
                    const dynamics::Range& range) {
  require_range(name + ": mean", spread.mean, unit, range);
  require_range(name + ": sd", spread.sd, unit, range);
}

// Follows a wheel under `settled` whose contact never changes.
std::function<Run(double, int)> rolls(std::shared_ptr<const dynamics::SettledMotion> motion,
                                      const dynamics::ContactNoise& noise) {
  const std::vector<double> middle(static_cast<std::size_t>(noise.dimension()));
  return [motion = std::move(motion), contact = noise.draw(middle)](double state, int phase) -> Run {
    const double omega = std::max(std::sqrt(state), slowest_roll);
    return [motion, contact, roll = dynamics::SettledRoll(*motion, phase, omega, contact, contact), seconds = 0.0,
            metres = 0.0]() mutable -> std::optional<FollowedEvent> {
      try {
        if (!roll.step().touched) return std::nullopt;
      } catch (const dynamics::RunsAway& error) {
        throw WithoutRegime(error.what());
      }
      roll.set_contact(contact);
      const FollowedEvent event{roll.spin() * roll.spin(), roll.time() - seconds, roll.position() - metres};
      seconds = roll.time(), metres = roll.position();
      return event;
    };
  };
}

// Returns where the wheel without noise comes to at that phase; the last state there, or a fast one, where it rests,
// and the fastest launch that a setting may have where it goes ever faster.
template <typename Map>
double noise_free_state(const Map& map, int phase) {
  constexpr int fewest_steps = 512;  // after which a wheel without noise has settled on its orbit
  constexpr double fast = 16;        // times the slowest survivor's energy
  const std::vector<double> no_noise(static_cast<std::size_t>(map.noise_dimension()), 0.0);
  double state = fast * map.state_interval(phase).first, at_phase = state;
  for (int step = 0; step < std::max(fewest_steps, 64 * map.phases()) || step % map.phases() != 0; ++step) {
    const std::optional<double> next = map.landing(state, (phase + step) % map.phases(), no_noise);
    if (!next) return at_phase;
    state = std::min(*next, dynamics::range::speed.high * dynamics::range::speed.high);
    if ((step + 1) % map.phases() == 0) at_phase = state;
  }
  return at_phase;
}

}  // namespace

dynamics::ContactNoise Setting::noise() const {
  if (!pairs.empty()) return dynamics::ContactNoise::empirical(pairs);
  return dynamics::ContactNoise::normal(restitution.mean, restitution.sd, friction.mean, friction.sd, correlation,
                                        law == dynamics::Law::settled ? dynamics::most_settled_restitution : 1);
}

bool Setting::noise_free() const {
  if (law == dynamics::Law::plastic) return true;
  const auto same = [&](const dynamics::Contact& one) {
    return one.restitution == pairs.front().restitution && one.friction == pairs.front().friction;
  };
  return pairs.empty() ? restitution.sd == 0 && friction.sd == 0 : std::all_of(pairs.begin(), pairs.end(), same);
}

dynamics::SettledMotion Setting::motion() const {
  return dynamics::SettledMotion(dynamics::settled_wheel(wheel, slope_deg * std::numbers::pi / 180.0));
}

dynamics::LaunchSpeed Setting::launch() const {
  if (steady_launch) {
    if (!steady_speed) throw std::logic_error("initial speed: of a steady launch it has to be found first");
    return *steady_speed;
  }
  if (!(initial_speed.mean >= 0))
    throw std::invalid_argument(fmt::format("initial speed: mean {} rad/s is below 0", initial_speed.mean));
  try {
    return {dynamics::TruncatedNormal(initial_speed.mean, initial_speed.sd, 0.0)};
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(fmt::format("initial speed: {}", error.what()));
  }
}

dynamics::WheelMap Setting::map() const {
  return dynamics::WheelMap(wheel, slope_deg * std::numbers::pi / 180.0, law, noise(), rebound_lost);
}

void Setting::validate() const {
  namespace range = dynamics::range;
  for (std::size_t i = 0; i < wheel.leg_length.size(); ++i)
    require_range(fmt::format("leg_length[{}]:", i), wheel.leg_length[i], "m", range::leg_length);
  const dynamics::WheelMap wheel_map = map();
  require_range("hub_mass:", wheel.hub_mass, "kg", range::mass);
  if (wheel.contact_mass) require_range("contact_mass:", *wheel.contact_mass, "kg", range::mass);
  require_range("ramp_stiffness:", wheel.ramp_stiffness, "N/m", range::ramp_stiffness);
  require_range("gravity:", wheel.gravity, "m/s^2", range::gravity);
  for (const auto& [name, objection] : {std::pair("inertia", dynamics::inertia_objection(wheel)),
                                        std::pair("radius_of_gyration", dynamics::gyration_objection(wheel, law))})
    if (!objection.empty()) throw std::invalid_argument(fmt::format("{}: {}", name, objection));
  require_range("slope:", slope_deg, "deg", dynamics::slope_range(wheel.legs()));
  if (pairs.empty()) {
    require_spread("restitution", restitution, "", range::restitution);
    require_spread("friction", friction, "", range::friction);
  }
  for (std::size_t i = 0; i < pairs.size(); ++i)
    require_range(fmt::format("pairs[{}]: friction", i), pairs[i].friction, "", range::friction);
  if (!steady_launch) require_spread("initial speed", initial_speed, "rad/s", range::speed);
  if (law == dynamics::Law::settled) {
    motion();
    if (!steady_launch && initial_speed.mean == 0 && initial_speed.sd == 0)
      throw std::invalid_argument(
          "initial speed: 0 without spread is outside (0, 1000] rad/s, the range of law settled");
    if (pairs.empty() && restitution.mean > dynamics::most_settled_restitution)
      throw std::invalid_argument(fmt::format("restitution: mean {} is outside [0, {}], the range of law settled",
                                              restitution.mean, dynamics::most_settled_restitution));
    for (std::size_t i = 0; i < pairs.size(); ++i)
      if (pairs[i].restitution > dynamics::most_settled_restitution)
        throw std::invalid_argument(
            fmt::format("pairs[{}]: restitution {} is outside [0, {}], the range of law settled", i,
                        pairs[i].restitution, dynamics::most_settled_restitution));
  }
  if (!steady_launch) launch();
  if (ramp_length != infinite) require_range("ramp length:", ramp_length, "m", range::ramp_length);
  if (first_landing_leg < 0 || first_landing_leg >= wheel.legs())
    throw std::invalid_argument(
        fmt::format("first landing leg: {} is outside 0..{}", first_landing_leg, wheel.legs() - 1));
}

Problem Setting::problem(const LandingOptions& landings) const {
  validate();
  const bool found = !steady_launch || steady_speed;
  const std::optional<dynamics::LaunchSpeed> speed = found ? std::optional(launch()) : std::nullopt;
  const auto problem_of = [&](const auto& map) {
    const int phase = first_landing_leg % map.phases();
    Problem problem{map, {{}, phase}, [](double x) { return std::sqrt(x); }, {}, {}};
    problem.observed = "omega-";
    problem.observed_unit = " rad/s";
    if (speed)
      problem.launch.state = [speed](double score) {
        const double omega = speed->at_score(score);
        return omega * omega;
      };
    else
      problem.launch.state = [state = noise_free_state(map, phase)](double) { return state; };
    std::vector<double> advance;
    for (int p = 0; p < map.phases(); ++p) advance.push_back(map.advance(p));
    if (std::isfinite(ramp_length))
      problem.last_event = dynamics::last_collision_on_ramp(advance, problem.launch.phase, ramp_length);
    return problem;
  };
  if (law != dynamics::Law::settled) return problem_of(map());
  dynamics::SettledMapOptions options;
  options.direct = landings.direct || noise_free();  // few landings are asked for then
  options.progress = landings.progress;
  options.executor = markov::on_threads(landings.threads);
  Problem problem = problem_of([&] {
    try {
      dynamics::SettledReturnMap map(wheel, slope_deg * std::numbers::pi / 180.0, noise(),
                                     speed ? speed->at_score(launch_reach) : 0, std::move(options));
      if (const std::optional<int> leg = map.landings().untabulated())
        throw NotTabulated(fmt::format("at some restitution leg {} rests from every speed up to {} rad/s", *leg,
                                       map.landings().range().omega_high));
      return map;
    } catch (const dynamics::TableTooLong& error) {
      throw NotTabulated(error.what());
    } catch (const dynamics::RunsAway& error) {
      throw WithoutRegime(error.what());
    }
  }());
  if (!found) return problem;
  problem.follow = [=, motion = motion(), noise = noise(), leg = first_landing_leg](auto seed, auto index, auto most) {
    try {
      return dynamics::steps_to_rest(motion, noise, *speed, leg, seed, index, most);
    } catch (const dynamics::RunsAway& error) {
      throw WithoutRegime(error.what());
    }
  };
  if (noise_free()) problem.run = rolls(std::make_shared<const dynamics::SettledMotion>(motion()), noise());
  return problem;
}

std::string Setting::describe() const {
  std::string legs;
  if (wheel.equal_legs()) {
    legs = fmt::format("{} legs of {} m", wheel.legs(), wheel.leg_length.front());
  } else {
    legs = fmt::format("legs {} m", fmt::join(wheel.leg_length, ", "));
  }
  std::string contact = pairs.empty() ? fmt::format("eta ~ N({}, {}^2), mu ~ N({}, {}^2)", restitution.mean,
                                                    restitution.sd, friction.mean, friction.sd)
                                      : fmt::format("(eta, mu) from a list of {} pairs", pairs.size());
  if (pairs.empty() && correlation != 0) contact += fmt::format(", correlation {}", correlation);
  const dynamics::ContactModel model = dynamics::contact_model(wheel, law, rebound_lost);
  std::string law_text = fmt::format("law {}", dynamics::law_name(law));
  if (law != dynamics::Law::published) law_text += fmt::format(" (r_g = {} m)", model.radius_of_gyration);
  if (law == dynamics::Law::coulomb && rebound_lost != 0) law_text += fmt::format(", rebound lost {}", rebound_lost);
  std::string launch_text = fmt::format("omega_0 ~ N({}, {}^2) rad/s", initial_speed.mean, initial_speed.sd);
  if (steady_launch) launch_text = "omega_0 of the metastable regime";
  if (steady_launch && steady_speed)
    launch_text += fmt::format(" ({:.4g} rad/s, sd {:.3g})", steady_speed->mean(), steady_speed->sd());
  std::string text = fmt::format("{} deg, {}, {}, {}, {}", slope_deg, legs, law_text, contact, launch_text);
  // What follows is said where it is not the paper's.
  const Setting paper;
  if (wheel.hub_mass != paper.wheel.hub_mass) text += fmt::format(", M = {} kg", wheel.hub_mass);
  if (wheel.inertia) text += fmt::format(", I = {} kg m^2", *wheel.inertia);
  if (wheel.tip_radius != 0) text += fmt::format(", tips of {} m", wheel.tip_radius);
  if (wheel.ramp_stiffness != paper.wheel.ramp_stiffness) text += fmt::format(", K_r = {} N/m", wheel.ramp_stiffness);
  if (wheel.contact_mass) text += fmt::format(", m_c = {} kg", *wheel.contact_mass);
  if (wheel.gravity != paper.wheel.gravity) text += fmt::format(", g = {} m/s^2", wheel.gravity);
  if (ramp_length != paper.ramp_length) text += fmt::format(", ramp {} m", ramp_length);
  if (first_landing_leg != 0) text += fmt::format(", leg {} lands first", first_landing_leg);
  return text;
}

std::optional<Spread> paper_launch(double slope_deg) {
  if (std::abs(slope_deg - 7.02) < 1e-9) return Spread{7.35, 0.19};
  if (std::abs(slope_deg - 9.59) < 1e-9) return Spread{5.83, 0.28};
  return std::nullopt;
}

}  // namespace metastable::analysis
