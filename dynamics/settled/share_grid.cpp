#include "dynamics/settled/share_grid.h"

#include <algorithm>
#include <cmath>

#include "dynamics/settled/settled_map.h"

namespace metastable::dynamics {
namespace {

constexpr int speeds = 15, restitutions = 13, places = 20;
constexpr double sds = 4, least_width = 0.3;  // of the restitutions around their mean; [1]
constexpr double just_above = 1e-7;           // mu_r, of the first place

// Fills all places of one leg at one restitution.
void fill(LandingShares& grid, const SettledMap& map, int leg, int row) {
  LandingShares::Leg& of_leg = grid.legs[static_cast<std::size_t>(leg)];
  const double eta = grid.restitution.at(row);
  double one = 0, two = 0;  // mu_r at the speeds before
  for (int i = 0; i < grid.speed.count; ++i) {
    const double omega = grid.speed.at(i), square = omega * omega;
    const double found = map.followed_resting_friction(leg, omega, eta, two > 0 ? 2 * one - two : one);
    const double resting = std::min(found, of_leg.sticking - 2e-6);
    if (found < of_leg.sticking) two = one, one = found;
    const std::size_t cell = grid.cell(leg, i, row);
    grid.resting[cell] = static_cast<float>(resting);
    for (int k = 0; k < grid.parts; ++k) {
      const double part = std::max(just_above, grid.part(k));
      const double mu =
          k == grid.parts - 1 ? of_leg.sticking + clear_of_sticking : resting + part * (of_leg.sticking - resting);
      const Landing landing = map.motion().land(leg, omega, {eta, mu});
      const bool rests = landing.end == LandingEnd::rest || landing.end == LandingEnd::given_up;
      const double carried =
          rests ? std::min(landing.settled_squared, 0.999 * of_leg.barrier_squared) : landing.carried_squared;
      const std::size_t at = cell * static_cast<std::size_t>(grid.parts) + static_cast<std::size_t>(k);
      grid.kept[at] = static_cast<float>(carried / square);
      grid.displacement[at] = static_cast<float>(landing.displacement);
    }
  }
}

// Finds the highest speed up to which a sticking foot settles.
double settles_below(const SettledMap& map, int leg, double eta, double low, double high) {
  const double mu = map.sticking_friction(leg) + clear_of_sticking;
  constexpr int looks = 60;
  double fine = low;
  for (int i = 0; i <= looks; ++i) {
    const double omega = low + (high - low) * i / looks;
    if (map.motion().land(leg, omega, {eta, mu}).end == LandingEnd::unsettled) break;
    fine = omega;
  }
  return fine;
}

// Finds it by landings of a sticking foot with small torques; none where it does not get on.
LandingShares::Drag drag_of(const SettledMotion& motion, int leg, double omega, double eta) {
  const Contact contact{eta, sticking_friction(motion.wheel(), leg) + clear_of_sticking};
  const Step free = motion.step(leg, omega, contact);
  LandingShares::Drag drag{free.landing.carried_squared, {}};
  if (!free.touched) return drag;
  constexpr double share = 1e-3;  // of the weight's torque about the foot
  const SettledWheel& wheel = motion.wheel();
  const double torque = share * wheel.mass * wheel.gravity * wheel.length(leg);
  for (std::size_t power = 0; power < drag.lost.size(); ++power) {
    SettledWheel dragged = wheel;
    const double size = torque / std::pow(omega, static_cast<double>(power));
    (power == 0 ? dragged.constant_drag : power == 1 ? dragged.linear_drag : dragged.quadratic_drag) = size;
    const Step slowed = SettledMotion(dragged).step(leg, omega, contact);
    if (slowed.touched)
      drag.lost[power] = (free.omega_minus * free.omega_minus - slowed.omega_minus * slowed.omega_minus) / size;
  }
  return drag;
}

}  // namespace

std::shared_ptr<const LandingShares> share_grid(
    const SettledWheel& wheel, double slowest, double fastest, const ContactSpread& contact,
    const std::function<void(std::size_t count, const std::function<void(std::size_t)>& work)>& executor) {
  SettledMapOptions options;
  options.direct = true;
  const std::shared_ptr<const SettledMap> map = SettledMap::of(wheel, options);
  auto grid = std::make_shared<LandingShares>();
  const double mean = contact.restitution_mean, sd = contact.restitution_sd;
  const double reach = std::max(sds * sd, least_width / 2);
  const double top = std::clamp(mean + reach, least_width, most_settled_restitution);
  grid->restitution = {std::clamp(mean - reach, 0.0, top - least_width), top, restitutions};
  grid->parts = places;
  double settles = slowest;
  for (int leg = 0; leg < wheel.legs(); ++leg) {
    const StandingFoot& foot = map->motion().foot(leg);
    LandingShares::Leg one;
    one.sticking = map->sticking_friction(leg);
    const Triangle both = triangle(wheel.length(leg - 1), wheel.length(leg), wheel.leg_angle());
    const double height = both.hub_height + wheel.tip_radius;
    one.plastic = plastic_share(both.chord, both.contact_x, height, wheel.gyration_sq());
    one.barrier_squared = foot.barrier_squared();
    one.next_gain = foot.next_squared(0);
    one.next_rate = foot.next_squared(1) - one.next_gain;
    one.pace = foot.pace();
    one.settles_below = settles_below(*map, leg, std::min(mean + sd, most_settled_restitution), slowest, fastest);
    settles = std::max(settles, one.settles_below);
    one.drag =
        drag_of(map->motion(), leg, (slowest + one.settles_below) / 2, std::clamp(mean, 0.0, most_settled_restitution));
    grid->legs.push_back(one);
  }
  grid->speed = {slowest, std::max(settles, slowest + (fastest - slowest) / 10), speeds};
  grid->resize();
  const auto rows = static_cast<std::size_t>(restitutions);
  const bool alike = std::all_of(wheel.leg_length.begin(), wheel.leg_length.end(),
                                 [&](double length) { return length == wheel.leg_length.front(); });
  const std::size_t followed = alike ? 1 : grid->legs.size();
  const auto work = [&](std::size_t i) { fill(*grid, *map, static_cast<int>(i / rows), static_cast<int>(i % rows)); };
  if (executor)
    executor(followed * rows, work);
  else
    for (std::size_t i = 0; i < followed * rows; ++i) work(i);
  for (std::vector<float>* values : {&grid->resting, &grid->kept, &grid->displacement}) {
    const auto of_leg = static_cast<std::ptrdiff_t>(values->size() / grid->legs.size());
    for (std::size_t leg = followed; leg < grid->legs.size(); ++leg)
      std::copy_n(values->begin(), of_leg, values->begin() + static_cast<std::ptrdiff_t>(leg) * of_leg);
  }
  return grid;
}

}  // namespace metastable::dynamics
