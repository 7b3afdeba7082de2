#include "dynamics/settled/settled_map.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <deque>
#include <future>
#include <limits>
#include <mutex>
#include <stdexcept>
#include <utility>

namespace metastable::dynamics {
namespace {

constexpr double never = std::numeric_limits<double>::infinity();
// Is far enough above mu_c that the foot sticks under its weight, too, on every slope with a barrier.
constexpr double sticks_by = 0.02;
constexpr double smooth_restitution = 0.6;  // above it feet hop on to the next touch
constexpr double rough_step = 0.05;         // between rows there
constexpr std::size_t most_kept = 32;       // maps, of some 8 MB

// Says how far a landing gets beyond the barrier: the settled foot's omega_eq^2 less the barrier's; its sign says rest.
double beyond_barrier(const Landing& landing, double barrier) {
  constexpr double tiny = 1e-12;
  if (landing.end == LandingEnd::rest)
    return landing.settled_squared > 0 ? std::min(landing.settled_squared - barrier, -tiny) : -barrier;
  return std::max((landing.settled_squared > 0 ? landing.settled_squared : landing.carried_squared) - barrier, tiny);
}

// Finds the root of a rising function that changes sign in [low, high]: false position with the Illinois rule,
// bisection where that is slow.
template <class F>
double rising_root(const F& value, double low, double at_low, double high, double at_high, double width) {
  int side = 0;
  for (int i = 0; i < 200 && high - low > width; ++i) {
    double at = i % 4 == 3 ? (low + high) / 2 : high - at_high * (high - low) / (at_high - at_low);
    // It comes no closer to the ends than asked for: the bracket closes from both sides.
    at = std::clamp(at, low + width / 2, high - width / 2);
    const double v = value(at);
    if (v < 0) {
      low = at, at_low = v;
      if (side < 0) at_high /= 2;
      side = -1;
    } else {
      high = at, at_high = v;
      if (side > 0) at_low /= 2;
      side = 1;
    }
  }
  return high;
}

// Returns evenly spread points in the unit cube (Roberts' sequence).
double spread(std::size_t index, int dimension) {
  constexpr double g = 1.22074408460575947536;  // g^4 = g + 1
  const double step = std::pow(g, -dimension - 1);
  double whole = 0;
  return std::modf(0.5 + static_cast<double>(index + 1) * step, &whole);
}

void in_order(std::size_t count, const std::function<void(std::size_t)>& work) {
  for (std::size_t i = 0; i < count; ++i) work(i);
}

}  // namespace

SettledMap::SettledMap(SettledMotion motion, SettledMapOptions options)
    : motion_(std::move(motion)), options_(std::move(options)) {
  const SettledRange& range = options_.range;
  const auto require = [](bool fine, const char* name, double value, const char* allowed) {
    if (!fine) throw std::invalid_argument(fmt::format("settled map: {}: {} is outside {}", name, value, allowed));
  };
  require(range.omega_high > 0 && range.omega_high <= 20, "omega_high", range.omega_high, "(0, 20] rad/s");
  require(range.eta_low >= 0 && range.eta_low < std::min(range.eta_high, smooth_restitution), "eta_low", range.eta_low,
          "[0, eta_high), below 0.6");
  require(range.eta_high <= most_settled_restitution, "eta_high", range.eta_high, "(eta_low, 0.95]");
  require(options_.speeds >= 4, "speeds", options_.speeds, "[4, inf)");
  require(options_.restitutions >= 4, "restitutions", options_.restitutions, "[4, inf)");
  require(options_.frictions >= 4, "frictions", options_.frictions, "[4, inf)");
  require(options_.checks >= 0, "checks", options_.checks, "[0, inf)");
  if (!options_.executor) options_.executor = in_order;
  for (int leg = 0; leg < legs(); ++leg) sticking_.push_back(dynamics::sticking_friction(motion_.wheel(), leg));
}

std::shared_ptr<const SettledMap> SettledMap::of(const SettledWheel& wheel, const SettledMapOptions& options) {
  using Built = std::shared_future<std::shared_ptr<const SettledMap>>;
  struct Kept {
    SettledWheel wheel;
    SettledMapOptions options;
    Built built;
  };
  static std::mutex mutex;
  static std::deque<Kept> kept;  // the last used in front
  const auto is_it = [&](const Kept& one) {
    const SettledMapOptions& o = one.options;
    return one.wheel == wheel && o.range == options.range && o.direct == options.direct && o.speeds == options.speeds &&
           o.restitutions == options.restitutions && o.frictions == options.frictions && o.checks == options.checks;
  };
  std::promise<std::shared_ptr<const SettledMap>> promise;
  {
    std::unique_lock lock(mutex);
    const auto found = std::find_if(kept.begin(), kept.end(), is_it);
    if (found != kept.end()) {
      std::rotate(kept.begin(), found, found + 1);
      const Built built = kept.front().built;
      lock.unlock();
      return built.get();  // may still be built by another thread
    }
    kept.push_front({wheel, options, promise.get_future().share()});
    kept.front().options.executor = nullptr;
    kept.front().options.progress = nullptr;
    if (kept.size() > most_kept) kept.pop_back();
  }
  try {
    const std::shared_ptr<SettledMap> map(new SettledMap(SettledMotion(wheel), options));
    if (!options.direct) {
      const auto began = std::chrono::steady_clock::now();
      map->build();
      map->check();
      map->seconds_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
    }
    map->options_.executor = nullptr;
    map->options_.progress = nullptr;
    promise.set_value(map);
    return map;
  } catch (...) {
    promise.set_exception(std::current_exception());
    const std::lock_guard lock(mutex);
    std::erase_if(kept, is_it);
    throw;
  }
}

double SettledMap::standstill(int leg, double eta) const {
  // These are speeds so low that a sticking foot is carried back; there are none for a slope without barrier.
  const double barrier = motion_.foot(leg).barrier_squared();
  if (!(barrier > 0)) return 0;
  const double mu = sticking_[static_cast<std::size_t>(leg)] + sticks_by;
  const auto value = [&](double omega) { return beyond_barrier(motion_.land(leg, omega, {eta, mu}), barrier); };
  double low = 0.5 * std::sqrt(barrier), high = 1.5 * std::sqrt(barrier);
  double at_low = value(low), at_high = value(high);
  while (at_low >= 0 && low > 1e-3) low /= 2, at_low = value(low);
  while (at_high < 0 && high < 30) high *= 1.3, at_high = value(high);
  if (at_low >= 0) return 0;
  if (at_high < 0) return never;
  return rising_root(value, low, at_low, high, at_high, 1e-10 * high);
}

// @param guess from which to start, 0: none; @param off how far off it may be
double SettledMap::solve_resting(int leg, double omega, double eta, double guess, double off) const {
  const double barrier = motion_.foot(leg).barrier_squared();
  const auto value = [&](double mu) { return beyond_barrier(motion_.land(leg, omega, {eta, mu}), barrier); };
  double high = sticking_[static_cast<std::size_t>(leg)] + sticks_by, at_high = value(high);
  if (at_high < 0) return never;
  // Around the guess it searches, or step by step from above: at high omega and eta there are gaps in rest below.
  double low = high, at_low = at_high;
  constexpr double farthest = 4e-3;
  guess = std::min(guess, high);  // a table that says "rests at every mu" is tried where a foot sticks
  for (double reach = off; guess > 0 && reach <= farthest; reach *= 4) {
    const double below = std::max(0.0, guess - reach), above = std::min(guess + reach, high);
    const double at_below = value(below), at_above = value(above);
    if (at_below < 0 && at_above < 0) guess = above + reach;
    if (at_below >= 0 && at_above >= 0) guess = below - reach;
    if (!(at_below < 0 && at_above >= 0)) continue;
    low = below, at_low = at_below, high = above, at_high = at_above;
    break;
  }
  for (double step = 2e-3; at_low >= 0 && low > 0;) {
    high = low, at_high = at_low;
    low = std::max(0.0, low - step);
    at_low = value(low);
  }
  if (at_low >= 0) return 0;
  return rising_root(value, low, at_low, high, at_high, 1e-10);
}

double SettledMap::stopping_friction(int leg, double omega, double eta, int strikes, double low, double high) const {
  // The slip falls about straight to 0 and stays there: where the line through the last two meets 0 or a little above.
  double before = low, before_slip = 0, slip = motion_.slip_after(leg, omega, {eta, low}, strikes);
  if (slip <= 0) return low;
  for (int i = 0; high - low > 1e-10; ++i) {
    double at = (low + high) / 2;
    if (before_slip > slip && i % 3 != 0) {
      const double ahead = (low - before) * slip / (before_slip - slip);
      at = std::clamp(low + ahead * (i % 3 == 1 ? 1 : 1.01) + 5e-11, low, at);
    }
    const double slip_at = motion_.slip_after(leg, omega, {eta, at}, strikes);
    if (slip_at > 0) {
      before = low, before_slip = slip;
      low = at, slip = slip_at;
    } else {
      high = at;
    }
  }
  return high;
}

// Finds the bend at two speeds and three restitutions: where the landing has risen by a quarter of its rise over [mu_r,
// mu_c], log(1 + part / bend) shall have, too.
void SettledMap::find_bend(SettledTable& table, int leg) const {
  const SettledRange& range = options_.range;
  const double sticking = sticking_[static_cast<std::size_t>(leg)];
  const double high_eta = std::min(0.5, range.eta_high), low_eta = std::min(range.eta_low, high_eta - 0.1);
  std::array<double, 3> at_0{}, rate{}, eta{};
  for (std::size_t j = 0; j < 3; ++j) {
    eta[j] = std::max(0.0, low_eta + (high_eta - low_eta) * static_cast<double>(j) / 2);
    const double from = standstill(leg, eta[j]);
    std::array<double, 2> omega{}, found{};
    for (std::size_t s = 0; s < 2; ++s) {
      omega[s] = from + (std::min(range.omega_high, from + 4) - from) * (s == 0 ? 0.3 : 0.8);
      const double resting = solve_resting(leg, omega[s], eta[j], 0, 0);
      const auto kept = [&](double part) {
        return motion_.land(leg, omega[s], {eta[j], resting + part * (sticking - resting)}).carried_squared;
      };
      const double first = kept(1e-9), quarter = first + (kept(1) - first) / 4;
      double low = -20, high = 0;
      for (int i = 0; i < 20; ++i) {
        const double middle = (low + high) / 2;
        (kept(std::exp(middle)) < quarter ? low : high) = middle;
      }
      const double part = std::exp(high);
      low = -30, high = 5;
      for (int i = 0; i < 50; ++i) {
        const double middle = (low + high) / 2, bend = std::exp(middle);
        (std::log1p(part / bend) > std::log1p(1 / bend) / 4 ? low : high) = middle;
      }
      found[s] = low;
    }
    rate[j] = (found[1] - found[0]) / (omega[1] - omega[0]);
    at_0[j] = found[0] - rate[j] * omega[0];
  }
  // These are the parabolas in eta through three values.
  const auto parabola = [&](const std::array<double, 3>& value, double* term) {
    if (!(eta[1] > eta[0])) {
      term[0] = value[0];
      return;
    }
    const double first = (value[1] - value[0]) / (eta[1] - eta[0]), second = (value[2] - value[1]) / (eta[2] - eta[1]);
    const double curve = (second - first) / (eta[2] - eta[0]);
    term[2] = curve;
    term[1] = first - curve * (eta[0] + eta[1]);
    term[0] = value[0] - eta[0] * (first - curve * eta[1]);
  };
  parabola(at_0, &table.bend[0]);
  parabola(rate, &table.bend[3]);
}

// Tabulates one row of a leg's table: all speeds and frictions at one restitution.
void SettledMap::tabulate(SettledTable& table, int leg, int row) const {
  constexpr int stops = SettledTable::stops, piece = SettledTable::piece;
  const double eta = table.eta(row), still = table.standstill[static_cast<std::size_t>(row)];
  const bool smooth = row < table.smooth_rows;
  std::array<double, 4> before{};  // mu_r at the speeds before, the last one first
  for (int i = 0; i < table.speeds; ++i) {
    const double omega = table.speed(still, static_cast<double>(i) / (table.speeds - 1));
    const auto at = static_cast<std::size_t>(row * table.speeds + i);
    // The parabola, and the cubic, through the speeds before give a guess: these stand evenly on the table's axis.
    const auto [one, two, three, four] = before;
    const double parabola = 3 * (one - two) + three, cubic = 4 * (one + three) - 6 * two - four;
    double resting = i < 4 ? solve_resting(leg, omega, eta, one - (i > 0 ? 1e-3 : 0), 1e-3)
                           : solve_resting(leg, omega, eta, cubic, std::abs(cubic - parabola) / 4 + 1e-8);
    if (!(resting < table.sticking)) resting = table.sticking - 1e-9;
    before = {resting, one, two, three};
    double* edge = &table.edges[at * (stops + 1)];
    edge[stops] = resting;
    for (int n = 0; n < stops; ++n)
      edge[n] = smooth ? stopping_friction(leg, omega, eta, n + 2, resting, n == 0 ? table.sticking : edge[n - 1])
                       : table.sticking;
    double* kept = &table.kept[at * static_cast<std::size_t>(table.places())];
    double* displacement = &table.displacement[at * static_cast<std::size_t>(table.places())];
    const auto note = [&](int n, double mu) {
      const Landing landing = motion_.land(leg, omega, {eta, mu});
      *kept++ = landing.carried_squared / (omega * omega);
      *displacement++ = landing.displacement;
      if (landing.end != LandingEnd::settled || !smooth) table.unsettled[at] |= static_cast<std::uint16_t>(1 << n);
    };
    // A piece begins where the one above ended.
    const auto repeat = [&](int n, int times) {
      for (int k = 0; k < times; ++k) {
        *kept = *(kept - 1), ++kept;
        *displacement = *(displacement - 1), ++displacement;
      }
      table.unsettled[at] |= static_cast<std::uint16_t>((table.unsettled[at] >> (n - 1) & 1) << n);
    };
    for (int n = 0; n < stops; ++n) {
      const double high = n == 0 ? table.sticking : edge[n - 1];
      if (n == 0) note(n, table.sticking + sticks_by);
      if (n > 0) repeat(n, edge[n] < high ? 1 : piece);
      if (n == 0 || edge[n] < high)
        for (int k = 1; k < piece; ++k) note(n, high + (edge[n] - high) * k / (piece - 1));
    }
    const double bend = table.bend_at(omega, eta), whole = std::log1p(1 / bend);
    const double end_kept = *(kept - 1), end_displacement = *(displacement - 1);
    for (int k = 0; k < table.frictions - 1; ++k) {
      const double part = k == 0 ? 1e-9 : bend * std::expm1(whole * k / (table.frictions - 1));
      note(stops, resting + part * (edge[stops - 1] - resting));
    }
    *kept = end_kept, *displacement = end_displacement;
    table.unsettled[at] |= static_cast<std::uint16_t>((table.unsettled[at] >> (stops - 1) & 1) << stops);
  }
}

void SettledMap::build() {
  const SettledRange& range = options_.range;
  SettledTable empty;
  empty.eta_low = range.eta_low, empty.eta_high = range.eta_high;
  empty.smooth_eta = std::min(smooth_restitution, range.eta_high);
  empty.smooth_rows = options_.restitutions;
  empty.rows = empty.smooth_rows + static_cast<int>(std::ceil((empty.eta_high - empty.smooth_eta) / rough_step - 1e-9));
  empty.speeds = options_.speeds, empty.frictions = options_.frictions;
  empty.omega_high = range.omega_high;
  empty.resize();
  const std::vector<double>& length = motion_.wheel().leg_length;
  const bool alike = std::all_of(length.begin(), length.end(), [&](double one) { return one == length.front(); });
  table_.assign(alike ? 1 : length.size(), empty);
  options_.executor(table_.size(), [&](std::size_t leg) {
    SettledTable& table = table_[leg];
    table.sticking = sticking_[leg];
    for (int j = 0; j < table.rows; ++j)
      table.standstill[static_cast<std::size_t>(j)] = standstill(static_cast<int>(leg), table.eta(j));
    const double highest = *std::max_element(table.standstill.begin(), table.standstill.end());
    table.usable = highest + SettledTable::clear_of_rest < range.omega_high;
    if (table.usable) find_bend(table, static_cast<int>(leg));
  });
  std::mutex mutex;
  std::size_t rows_done = 0;
  const auto per_leg = static_cast<std::size_t>(empty.rows);
  const std::size_t rows = table_.size() * per_leg;
  options_.executor(rows, [&](std::size_t row) {
    SettledTable& table = table_[row / per_leg];
    if (table.usable) tabulate(table, static_cast<int>(row / per_leg), static_cast<int>(row % per_leg));
    const std::lock_guard lock(mutex);
    ++rows_done;
    if (options_.progress) options_.progress(static_cast<double>(rows_done) / static_cast<double>(rows));
  });
}

std::optional<SettledSlice> SettledMap::slice(int leg, double eta) const {
  if (table_.empty()) return std::nullopt;
  const SettledTable& table = table_[static_cast<std::size_t>(leg) % table_.size()];
  return table.holds(eta) ? std::optional(table.slice(eta)) : std::nullopt;
}

double SettledMap::resting_friction(int leg, double omega, double eta) const {
  const std::optional<SettledSlice> table = slice(leg, eta);
  return table && table->holds(omega) ? table->resting_friction(omega) : followed_resting_friction(leg, omega, eta);
}

double SettledMap::followed_resting_friction(int leg, double omega, double eta, double guess) const {
  constexpr double off = 2e-4;
  return solve_resting(leg, omega, eta, guess, off);
}

MappedLanding SettledMap::follow(int leg, double omega, const Contact& contact) const {
  const Landing landing = motion_.land(leg, omega, contact);
  if (landing.end == LandingEnd::rest || landing.end == LandingEnd::given_up) return {0, 0, true};
  return {landing.carried_squared, landing.displacement, false};
}

MappedLanding SettledMap::land(int leg, double omega, const Contact& contact) const {
  const std::optional<SettledSlice> table = slice(leg, contact.restitution);
  return table && table->holds(omega) ? table->at(omega).land(contact.friction) : follow(leg, omega, contact);
}

void SettledMap::check() {
  const SettledRange& range = options_.range;
  const auto per_leg = static_cast<std::size_t>(options_.checks);
  std::mutex mutex;
  double settled_sum = 0, rough_sum = 0;
  std::size_t settled = 0, rough = 0;
  std::vector<double> resting_off;
  options_.executor(table_.size() * per_leg, [&](std::size_t index) {
    const int leg = static_cast<int>(index / per_leg);
    const SettledTable& table = table_[static_cast<std::size_t>(leg)];
    if (!table.usable) return;
    const double eta = range.eta_low + (range.eta_high - range.eta_low) * spread(index, 0);
    const SettledSlice read = table.slice(eta);
    const double omega = read.lowest_speed() + (range.omega_high - read.lowest_speed()) * spread(index, 1);
    const SettledSlice::Place place = read.at(omega);
    const double resting = place.resting_friction();
    const double mu = std::max(0.0, resting + (table.sticking - resting) * (1.3 * spread(index, 2) - 0.1));
    const MappedLanding by_table = place.land(mu);
    const Landing direct = motion_.land(leg, omega, {eta, mu});
    const bool rests = direct.end == LandingEnd::rest || direct.end == LandingEnd::given_up;
    const bool is_rough = place.rough(std::max(mu, resting)) || direct.end == LandingEnd::unsettled;
    const bool solves = index % 8 == 0 && !is_rough;
    const double off_resting = solves ? std::abs(followed_resting_friction(leg, omega, eta, resting) - resting) : 0;
    const double off = (by_table.carried_squared - direct.carried_squared) / (omega * omega);
    const std::lock_guard lock(mutex);
    ++error_.landings;
    if (solves) resting_off.push_back(off_resting);
    if (is_rough) ++error_.rough;
    if (rests != by_table.rest) {
      ++(is_rough ? error_.rough_misjudged_rests : error_.misjudged_rests);
    } else if (!rests && is_rough) {
      ++rough, rough_sum += off * off;
    } else if (!rests) {
      ++settled, settled_sum += off * off;
      error_.settled_max = std::max(error_.settled_max, std::abs(off));
      error_.displacement_max =
          std::max(error_.displacement_max, std::abs(by_table.displacement - direct.displacement));
    }
  });
  if (settled > 0) error_.settled_rms = std::sqrt(settled_sum / static_cast<double>(settled));
  if (rough > 0) error_.rough_rms = std::sqrt(rough_sum / static_cast<double>(rough));
  std::sort(resting_off.begin(), resting_off.end());
  if (resting_off.empty()) return;
  error_.resting_friction_max = resting_off.back();
  error_.resting_friction_median = resting_off[resting_off.size() / 2];
}

}  // namespace metastable::dynamics
