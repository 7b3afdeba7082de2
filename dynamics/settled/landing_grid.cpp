#include "dynamics/settled/landing_grid.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "dynamics/settled/settled_map.h"

namespace metastable::dynamics {
namespace {

constexpr int speeds = 15, grid_restitutions = 13;
constexpr double sds = 4, least_width = 0.3;  // of the restitutions around their mean; [1]
constexpr double single_width = 1e-8;         // mu_r is found to this, because the grid holds it in single precision
constexpr double just_above = 1e-7;           // mu_r, of the first place
// The places at which a wheel of so much more J is followed, for the changes with J: every so many speeds and
// restitutions.
constexpr double more_inertia = 1.1;
constexpr int speed_stride = 2, restitution_stride = 2;
constexpr double most_rate = 0.03;  // of the share kept with ln J, beside what a plastic landing keeps

// Fills all places of one leg at one restitution.
void fill(LandingShares& grid, const SettledMap& map, int leg, int row) {
  LandingShares::Leg& of_leg = grid.legs[static_cast<std::size_t>(leg)];
  const double eta = grid.restitution.at(row);
  std::vector<double> speeds_of_grid;
  for (int i = 0; i < grid.speed.count; ++i) speeds_of_grid.push_back(grid.speed.at(i));
  const std::vector<double> found = map.followed_resting_frictions(leg, speeds_of_grid, eta, single_width);
  for (int i = 0; i < grid.speed.count; ++i) {
    const double omega = grid.speed.at(i), square = omega * omega;
    const double resting = std::min(found[static_cast<std::size_t>(i)], of_leg.sticking - 2e-6);
    const std::size_t cell = grid.cell(leg, i, row);
    grid.resting[cell] = static_cast<float>(resting);
    for (int k = 0; k < LandingShares::parts; ++k) {
      const double part = std::max(just_above, LandingShares::part(k));
      const double mu = k == LandingShares::parts - 1 ? of_leg.sticking + clear_of_sticking
                                                      : resting + part * (of_leg.sticking - resting);
      const Landing landing = map.motion().land(leg, omega, {eta, mu});
      const bool rests = landing.end == LandingEnd::rest || landing.end == LandingEnd::given_up;
      const double carried =
          rests ? std::min(landing.settled_squared, 0.999 * of_leg.barrier_squared) : landing.carried_squared;
      const std::size_t at = cell * static_cast<std::size_t>(LandingShares::parts) + static_cast<std::size_t>(k);
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

// Finds by speed the largest restitution with which a sticking foot settles.
void fill_settling(LandingShares& grid, const SettledMap& map) {
  constexpr int looks = 38;
  const double width = most_settled_restitution / looks;
  for (int leg = 0; leg < static_cast<int>(grid.legs.size()); ++leg) {
    const double mu = map.sticking_friction(leg) + clear_of_sticking;
    for (int i = 0; i < grid.speed.count; ++i) {
      double settles = 0;
      for (int k = 1; k <= looks; ++k) {
        if (map.motion().land(leg, grid.speed.at(i), {k * width, mu}).end == LandingEnd::unsettled) break;
        settles = k * width;
      }
      grid.settling.push_back(static_cast<float>(settles));
    }
  }
}

// Returns the friction below which a wheel comes to rest; nothing where even a sticking foot does, or none.
std::optional<double> resting_friction(const SettledMotion& motion, int leg, double omega, double eta) {
  constexpr double step = 2e-3, width = 1e-7;
  const auto rests = [&](double mu) {
    const LandingEnd end = motion.land(leg, omega, {eta, mu}).end;
    return end == LandingEnd::rest || end == LandingEnd::given_up;
  };
  double high = sticking_friction(motion.wheel(), leg) + clear_of_sticking;
  if (rests(high)) return {};
  double low = high;
  while (!rests(low)) {
    high = low;
    low -= step;
    if (!(low > 0)) return {};
  }
  while (high - low > width) {
    const double middle = (low + high) / 2;
    (rests(middle) ? low : high) = middle;
  }
  return high;
}

// Finds it by landings with small torques: of a sticking foot, none where it does not get on, and of one that slides.
LandingShares::Drag drag_of(const SettledMotion& motion, int leg, double omega, double eta) {
  const Contact contact{eta, sticking_friction(motion.wheel(), leg) + clear_of_sticking};
  const Step free = motion.step(leg, omega, contact);
  LandingShares::Drag drag{free.landing.carried_squared, {}};
  if (!free.touched) return drag;
  constexpr double share = 1e-3, share_sliding = 1e-2;  // of the weight's torque about the foot
  const SettledWheel& wheel = motion.wheel();
  const double torque = share * wheel.mass * wheel.gravity * wheel.length(leg);
  const std::optional<double> resting = resting_friction(motion, leg, omega, eta);
  for (std::size_t power = 0; power < drag.lost.size(); ++power) {
    const double size = torque / std::pow(omega, static_cast<double>(power));
    const auto with = [&](double times) {
      SettledWheel dragged = wheel;
      (power == 0 ? dragged.constant_drag : power == 1 ? dragged.linear_drag : dragged.quadratic_drag) = times * size;
      return SettledMotion(dragged);
    };
    const Step slowed = with(1).step(leg, omega, contact);
    if (slowed.touched)
      drag.lost[power] = (free.omega_minus * free.omega_minus - slowed.omega_minus * slowed.omega_minus) / size;
    const double more = share_sliding / share;
    if (const auto dragged = resting ? resting_friction(with(more), leg, omega, eta) : std::nullopt)
      drag.resting[power] = (*dragged - *resting) / (more * size);
  }
  return drag;
}

// Says what a leg's landings are at the axes that `grid` has.
LandingShares::Leg plain_leg(const SettledMap& map, int leg) {
  const SettledWheel& wheel = map.motion().wheel();
  const Triangle both = triangle(wheel.length(leg - 1), wheel.length(leg), wheel.leg_angle());
  LandingShares::Leg one;
  one.sticking = map.sticking_friction(leg);
  one.gyration_sq = wheel.gyration_sq();
  one.chord = both.chord;
  one.ahead = both.contact_x;
  one.height = both.hub_height + wheel.tip_radius;
  one.plastic = plastic_share(one.chord, one.ahead, one.height, one.gyration_sq);
  const StandingFoot& foot = map.motion().foot(leg);
  one.barrier_squared = foot.barrier_squared();
  one.next_gain = foot.next_squared(0);
  one.next_rate = foot.next_squared(1) - one.next_gain;
  one.pace = foot.pace();
  return one;
}

// Fills the changes with ln J of one leg from those of a heavier wheel on a coarse grid, by straight lines.
void fill_rates(LandingShares& grid, const LandingShares& heavier, int leg) {
  const auto values_at = [&](std::vector<float>& rates, const std::vector<float>& own, const std::vector<float>& its,
                             std::size_t stride) {
    const auto coarse = [&](int i, int j, std::size_t k) {
      return (its[heavier.cell(leg, i, j) * stride + k] -
              own[grid.cell(leg, i * speed_stride, j * restitution_stride) * stride + k]) /
             std::log(more_inertia);
    };
    for (int i = 0; i < grid.speed.count; ++i)
      for (int j = 0; j < grid.restitution.count; ++j) {
        const int slow = std::min(i / speed_stride, heavier.speed.count - 2),
                  low = std::min(j / restitution_stride, heavier.restitution.count - 2);
        const double fast = static_cast<double>(i) / speed_stride - slow,
                     high = static_cast<double>(j) / restitution_stride - low;
        for (std::size_t k = 0; k < stride; ++k)
          rates[grid.cell(leg, i, j) * stride + k] =
              static_cast<float>((1 - fast) * ((1 - high) * coarse(slow, low, k) + high * coarse(slow, low + 1, k)) +
                                 fast * ((1 - high) * coarse(slow + 1, low, k) + high * coarse(slow + 1, low + 1, k)));
      }
  };
  const auto parts = static_cast<std::size_t>(LandingShares::parts);
  values_at(grid.resting_rate, grid.resting, heavier.resting, 1);
  values_at(grid.kept_rate, grid.kept, heavier.kept, parts);
  // Where feet are unsettled a kink has passed between the two: that is no rate.
  const auto of_leg = static_cast<std::size_t>(leg);
  const double plastic = (heavier.legs[of_leg].plastic - grid.legs[of_leg].plastic) / std::log(more_inertia);
  const std::size_t count = grid.kept_rate.size() / grid.legs.size();
  for (std::size_t i = of_leg * count; i < (of_leg + 1) * count; ++i)
    if (std::abs(grid.kept_rate[i] - plastic) > most_rate) grid.kept_rate[i] = static_cast<float>(plastic);
}

// Returns a grid without landings: its axes, and what is known of each leg.
LandingShares empty_grid(const SettledMap& map, double slowest, double fastest, const ContactSpread& contact,
                         bool every_speed) {
  LandingShares grid;
  const double mean = contact.restitution_mean, sd = contact.restitution_sd;
  const double reach = std::max(sds * sd, least_width / 2);
  const double top = std::clamp(mean + reach, least_width, most_settled_restitution);
  grid.restitution = {std::clamp(mean - reach, 0.0, top - least_width), top, grid_restitutions};
  double settles = slowest;
  for (int leg = 0; leg < map.motion().wheel().legs(); ++leg) {
    LandingShares::Leg one = plain_leg(map, leg);
    one.settles_below =
        settles_below(map, leg, std::min(mean + settling_sds * sd, most_settled_restitution), slowest, fastest);
    settles = std::max(settles, one.settles_below);
    one.drag =
        drag_of(map.motion(), leg, (slowest + one.settles_below) / 2, std::clamp(mean, 0.0, most_settled_restitution));
    grid.legs.push_back(one);
  }
  grid.speed = {slowest, every_speed ? fastest : std::max(settles, slowest + (fastest - slowest) / 10), speeds};
  grid.resize();
  return grid;
}

// Returns a coarse grid without landings, of a wheel with more inertia, over the axes of `grid`.
LandingShares empty_coarse_grid(const LandingShares& grid, const SettledMap& heavier) {
  LandingShares coarse = grid;
  coarse.speed.count = (speeds - 1) / speed_stride + 1;
  coarse.restitution.count = (grid_restitutions - 1) / restitution_stride + 1;
  for (int leg = 0; leg < heavier.motion().wheel().legs(); ++leg)
    coarse.legs[static_cast<std::size_t>(leg)] = plain_leg(heavier, leg);
  coarse.resize();
  return coarse;
}

// Gives every leg of a wheel whose legs are alike what was followed of the first.
void copy_first_leg(LandingShares& grid) {
  for (std::vector<float>* values :
       {&grid.resting, &grid.kept, &grid.displacement, &grid.resting_rate, &grid.kept_rate, &grid.displacement_rate}) {
    const auto of_leg = static_cast<std::ptrdiff_t>(values->size() / grid.legs.size());
    for (std::size_t leg = 1; leg < grid.legs.size(); ++leg)
      std::copy_n(values->begin(), of_leg, values->begin() + static_cast<std::ptrdiff_t>(leg) * of_leg);
  }
}

}  // namespace

std::shared_ptr<const LandingShares> landing_grid(
    const SettledWheel& wheel, double slowest, double fastest, const ContactSpread& contact,
    const std::function<void(std::size_t count, const std::function<void(std::size_t)>& work)>& executor,
    bool every_speed, bool settling) {
  SettledMapOptions options;
  options.direct = true;
  SettledWheel more = wheel;
  more.radius_of_gyration *= std::sqrt(more_inertia);
  const std::shared_ptr<const SettledMap> map = SettledMap::of(wheel, options),
                                          map_of_more = SettledMap::of(more, options);
  auto grid = std::make_shared<LandingShares>(empty_grid(*map, slowest, fastest, contact, every_speed));
  if (settling) fill_settling(*grid, *map);
  LandingShares heavier = empty_coarse_grid(*grid, *map_of_more);

  const auto rows = static_cast<std::size_t>(grid_restitutions),
             coarse = static_cast<std::size_t>(heavier.restitution.count);
  const bool alike = std::all_of(wheel.leg_length.begin(), wheel.leg_length.end(),
                                 [&](double length) { return length == wheel.leg_length.front(); });
  const std::size_t followed = alike ? 1 : grid->legs.size();
  const auto work = [&](std::size_t i) {
    const auto leg = static_cast<int>(i / (rows + coarse)), row = static_cast<int>(i % (rows + coarse));
    if (row < grid_restitutions)
      fill(*grid, *map, leg, row);
    else
      fill(heavier, *map_of_more, leg, row - grid_restitutions);
  };
  const std::size_t all = followed * (rows + coarse);
  if (executor)
    executor(all, work);
  else
    for (std::size_t i = 0; i < all; ++i) work(i);

  grid->resting_rate.resize(grid->resting.size());
  grid->kept_rate.resize(grid->kept.size());
  grid->displacement_rate.resize(grid->displacement.size());
  for (std::size_t leg = 0; leg < followed; ++leg) fill_rates(*grid, heavier, static_cast<int>(leg));
  if (alike) copy_first_leg(*grid);
  return grid;
}

}  // namespace metastable::dynamics
