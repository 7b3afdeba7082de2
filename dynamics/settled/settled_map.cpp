#include "dynamics/settled/settled_map.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <mutex>
#include <stdexcept>
#include <utility>

namespace metastable::dynamics {
namespace {

constexpr double never = std::numeric_limits<double>::infinity();
// Far enough above mu_c that the foot sticks under its weight, too, on every slope with a barrier.
constexpr double sticks_by = 0.02;
// The table begins this far above the speed at which even a sticking foot rests [rad/s].
constexpr double clear_of_rest = 0.02;
constexpr double crowding = 1.5;  // of nodes in speed, towards there

// How far a landing gets beyond the barrier: omega_eq^2 of the settled foot less the barrier's; its sign says rest.
double beyond_barrier(const Landing& landing, double barrier) {
  constexpr double tiny = 1e-12;
  if (landing.end == LandingEnd::rest)
    return landing.settled_squared > 0 ? std::min(landing.settled_squared - barrier, -tiny) : -barrier;
  return std::max((landing.settled_squared > 0 ? landing.settled_squared : landing.carried_squared) - barrier, tiny);
}

// Root of a rising function that changes sign in [low, high]: false position with the Illinois rule, bisection where
// that is slow.
template <class F>
double rising_root(const F& value, double low, double at_low, double high, double at_high, double width) {
  int side = 0;
  for (int i = 0; i < 200 && high - low > width; ++i) {
    double at = i % 4 == 3 ? (low + high) / 2 : high - at_high * (high - low) / (at_high - at_low);
    // Not closer to the ends than asked for: the bracket closes from both sides.
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

// Evenly spread points in the unit cube (Roberts' sequence).
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

SettledMap::Stencil SettledMap::stencil(double place, int count) {
  Stencil s;
  const int size = std::min(count, static_cast<int>(width));
  const int first = std::clamp(static_cast<int>(place) - (size - 1) / 2, 0, count - size);
  s.first = static_cast<std::size_t>(first), s.size = static_cast<std::size_t>(size);
  const double t = place - first;
  for (int k = 0; k < size; ++k) {
    double weight = 1;
    for (int j = 0; j < size; ++j)
      if (j != k) weight *= (t - j) / (k - j);
    s.weight[static_cast<std::size_t>(k)] = weight;
  }
  return s;
}

// Nodes in speed stand closer where the wheel barely passes.
double SettledMap::speed(double standstill, double share) const {
  const double from = standstill + clear_of_rest;
  return from + (options_.range.omega_high - from) * std::expm1(crowding * share) / std::expm1(crowding);
}

double SettledMap::share(double standstill, double omega) const {
  const double from = standstill + clear_of_rest;
  return std::log1p((omega - from) / (options_.range.omega_high - from) * std::expm1(crowding)) / crowding;
}

double SettledMap::log_bend(const Table& table, double omega, double eta) const {
  const auto& b = table.bend;
  return b[0] + eta * (b[1] + eta * b[2]) + omega * (b[3] + eta * (b[4] + eta * b[5]));
}

SettledMap::SettledMap(SettledMotion motion, SettledMapOptions options)
    : motion_(std::move(motion)), options_(std::move(options)) {
  const SettledRange& range = options_.range;
  const auto require = [](bool fine, const char* name, double value, const char* allowed) {
    if (!fine) throw std::invalid_argument(fmt::format("settled map: {}: {} is outside {}", name, value, allowed));
  };
  require(range.omega_high > 0 && range.omega_high <= 20, "omega_high", range.omega_high, "(0, 20] rad/s");
  require(range.eta_low >= 0 && range.eta_low <= range.eta_high, "eta_low", range.eta_low, "[0, eta_high]");
  require(range.eta_high <= 0.95, "eta_high", range.eta_high, "[eta_low, 0.95]");
  require(options_.speeds >= 4, "speeds", options_.speeds, "[4, inf)");
  require(options_.restitutions >= 4, "restitutions", options_.restitutions, "[4, inf)");
  require(options_.frictions >= 4, "frictions", options_.frictions, "[4, inf)");
  require(options_.checks >= 0, "checks", options_.checks, "[0, inf)");
  if (!options_.executor) options_.executor = in_order;
  for (int leg = 0; leg < legs(); ++leg) sticking_.push_back(dynamics::sticking_friction(motion_.wheel(), leg));
}

std::shared_ptr<const SettledMap> SettledMap::of(const SettledWheel& wheel, const SettledMapOptions& options) {
  static std::mutex mutex;
  static std::vector<std::shared_ptr<const SettledMap>> kept;
  const std::lock_guard lock(mutex);
  for (const auto& map : kept) {
    const SettledMapOptions& o = map->options_;
    if (map->motion_.wheel() == wheel && o.range == options.range && o.direct == options.direct &&
        o.speeds == options.speeds && o.restitutions == options.restitutions && o.frictions == options.frictions &&
        o.checks == options.checks)
      return map;
  }
  const std::shared_ptr<SettledMap> map(new SettledMap(SettledMotion(wheel), options));
  if (!options.direct) {
    const auto began = std::chrono::steady_clock::now();
    map->build();
    map->check();
    map->seconds_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  }
  map->options_.executor = nullptr;
  map->options_.progress = nullptr;
  kept.push_back(map);
  return map;
}

double SettledMap::standstill(int leg, double eta) const {
  // Speeds so low that a sticking foot is carried back; none for a slope without barrier.
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

double SettledMap::solve_resting(int leg, double omega, double eta, double guess) const {
  const double barrier = motion_.foot(leg).barrier_squared();
  const auto value = [&](double mu) { return beyond_barrier(motion_.land(leg, omega, {eta, mu}), barrier); };
  double high = sticking_[static_cast<std::size_t>(leg)] + sticks_by, at_high = value(high);
  if (at_high < 0) return never;
  // Around the guess, or step by step from above: at high omega and eta there are gaps in rest further down.
  double low = high, at_low = at_high;
  if (guess > 0) {
    constexpr double near = 2e-4;
    low = std::max(0.0, guess - near), at_low = value(low);
    const double above = std::min(guess + near, high), at_above = value(above);
    if (at_low < 0 && at_above >= 0)
      high = above, at_high = at_above;
    else
      low = high, at_low = at_high;
  }
  for (double step = 2e-3; at_low >= 0 && low > 0;) {
    high = low, at_high = at_low;
    low = std::max(0.0, low - step);
    at_low = value(low);
  }
  if (at_low >= 0) return 0;
  return rising_root(value, low, at_low, high, at_high, 1e-11);
}

double SettledMap::stopping_friction(int leg, double omega, double eta, int strikes, double low, double high) const {
  if (motion_.slip_after(leg, omega, {eta, low}, strikes) <= 0) return low;
  while (high - low > 1e-11) {
    const double middle = (low + high) / 2;
    (motion_.slip_after(leg, omega, {eta, middle}, strikes) > 0 ? low : high) = middle;
  }
  return high;
}

// The bend at two speeds and three restitutions: where the landing has risen by a quarter of its rise over [mu_r,
// mu_c], log(1 + part / bend) shall have, too.
void SettledMap::find_bend(int leg) {
  Table& table = table_[static_cast<std::size_t>(leg)];
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
      const double resting = solve_resting(leg, omega[s], eta[j], 0);
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
  // The parabolas in eta through three values.
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

void SettledMap::build() {
  const SettledRange& range = options_.range;
  const int speeds = options_.speeds, restitutions = options_.restitutions;
  const auto count = static_cast<std::size_t>(speeds) * static_cast<std::size_t>(restitutions);
  table_.resize(static_cast<std::size_t>(legs()));
  for (Table& table : table_) {
    table.standstill.resize(static_cast<std::size_t>(restitutions));
    table.edges.resize(count * (stops + 1));
    table.unsettled.resize(count);
    table.kept.resize(count * static_cast<std::size_t>(places()));
    table.displacement.resize(table.kept.size());
  }
  const auto eta_at = [&](int j) { return range.eta_low + (range.eta_high - range.eta_low) * j / (restitutions - 1); };
  options_.executor(table_.size(), [&](std::size_t leg) {
    Table& table = table_[leg];
    for (int j = 0; j < restitutions; ++j)
      table.standstill[static_cast<std::size_t>(j)] = standstill(static_cast<int>(leg), eta_at(j));
    const double highest = *std::max_element(table.standstill.begin(), table.standstill.end());
    table.usable = highest + clear_of_rest < range.omega_high;
    if (table.usable) find_bend(static_cast<int>(leg));
  });
  std::mutex mutex;
  std::size_t rows_done = 0;
  const std::size_t rows = table_.size() * static_cast<std::size_t>(restitutions);
  options_.executor(rows, [&](std::size_t row) {
    const int leg = static_cast<int>(row) / restitutions, j = static_cast<int>(row) % restitutions;
    Table& table = table_[static_cast<std::size_t>(leg)];
    const double eta = eta_at(j), sticking = sticking_[static_cast<std::size_t>(leg)];
    const double still = table.standstill[static_cast<std::size_t>(j)];
    double before = sticking, before_last = 0;
    for (int i = 0; i < speeds && table.usable; ++i) {
      const double omega = speed(still, static_cast<double>(i) / (speeds - 1));
      const auto at = static_cast<std::size_t>(j * speeds + i);
      double resting = solve_resting(leg, omega, eta, i < 2 ? before - 1e-3 : 2 * before - before_last);
      if (!(resting < sticking)) resting = sticking - 1e-9;
      before_last = before, before = resting;
      double* edge = &table.edges[at * (stops + 1)];
      edge[stops] = resting;
      for (int n = 0; n < stops; ++n)
        edge[n] = stopping_friction(leg, omega, eta, n + 2, resting, n == 0 ? sticking : edge[n - 1]);
      double* kept = &table.kept[at * static_cast<std::size_t>(places())];
      double* displacement = &table.displacement[at * static_cast<std::size_t>(places())];
      const auto note = [&](int n, double mu) {
        const Landing landing = motion_.land(leg, omega, {eta, mu});
        *kept++ = landing.carried_squared / (omega * omega);
        *displacement++ = landing.displacement;
        if (landing.end != LandingEnd::settled) table.unsettled[at] |= static_cast<std::uint16_t>(1 << n);
      };
      for (int n = 0; n < stops; ++n) {
        const double high = n == 0 ? sticking : edge[n - 1];
        for (int k = 0; k < piece; ++k)
          note(n, n == 0 && k == 0 ? sticking + sticks_by : high + (edge[n] - high) * k / (piece - 1));
      }
      const double bend = std::exp(log_bend(table, omega, eta)), whole = std::log1p(1 / bend);
      for (int k = 0; k < options_.frictions; ++k) {
        const double part = k == 0 ? 1e-9 : bend * std::expm1(whole * k / (options_.frictions - 1));
        note(stops, resting + std::min(1.0, part) * (edge[stops - 1] - resting));
      }
    }
    const std::lock_guard lock(mutex);
    ++rows_done;
    if (options_.progress) options_.progress(static_cast<double>(rows_done) / static_cast<double>(rows));
  });
}

bool SettledMap::place(int leg, double omega, double eta, TablePlace& place) const {
  if (table_.empty()) return false;
  const Table& table = table_[static_cast<std::size_t>(leg)];
  const SettledRange& range = options_.range;
  if (!table.usable || omega > range.omega_high || eta < range.eta_low || eta > range.eta_high) return false;
  const double span = range.eta_high - range.eta_low;
  place.eta = stencil(span > 0 ? (eta - range.eta_low) / span * (options_.restitutions - 1) : 0, options_.restitutions);
  double still = 0;
  for (std::size_t j = 0; j < place.eta.size; ++j) still += place.eta.weight[j] * table.standstill[place.eta.first + j];
  if (omega < still + clear_of_rest) return false;
  place.omega = stencil(share(still, omega) * (options_.speeds - 1), options_.speeds);
  for (std::size_t j = 0; j < place.eta.size; ++j)
    for (std::size_t i = 0; i < place.omega.size; ++i) {
      const std::size_t at = (place.eta.first + j) * static_cast<std::size_t>(options_.speeds) + place.omega.first + i;
      const double weight = place.eta.weight[j] * place.omega.weight[i];
      place.unsettled |= table.unsettled[at];
      for (std::size_t n = 0; n <= stops; ++n) place.edge[n] += weight * table.edges[at * (stops + 1) + n];
    }
  place.bend = std::exp(log_bend(table, omega, eta));
  place.scale = (options_.frictions - 1) / std::log1p(1 / place.bend);
  return true;
}

MappedLanding SettledMap::read(int leg, double omega, double eta, double friction, const TablePlace& place) const {
  const Table& table = table_[static_cast<std::size_t>(leg)];
  const double sticking = sticking_[static_cast<std::size_t>(leg)];
  MappedLanding landed;
  if (friction < place.edge[stops] && friction < sticking) {
    landed.rest = true;
    return landed;
  }
  // The piece, and the place on it.
  std::size_t n = 0;
  while (n < stops && friction < place.edge[n]) ++n;
  if ((place.unsettled >> n & 1) != 0) return follow(leg, omega, {eta, friction});
  const double high = n == 0 ? sticking : place.edge[n - 1], low = place.edge[n];
  const double part = high > low ? std::clamp((friction - low) / (high - low), 0.0, 1.0) : 1;
  const Stencil mu = n < stops ? stencil((1 - part) * (piece - 1), piece)
                               : stencil(place.scale * std::log1p(part / place.bend), options_.frictions);
  double kept = 0, displacement = 0;
  for (std::size_t j = 0; j < place.eta.size; ++j)
    for (std::size_t i = 0; i < place.omega.size; ++i) {
      const std::size_t at =
          ((place.eta.first + j) * static_cast<std::size_t>(options_.speeds) + place.omega.first + i) *
              static_cast<std::size_t>(places()) +
          n * piece + mu.first;
      const double weight = place.eta.weight[j] * place.omega.weight[i];
      double row_kept = 0, row_displacement = 0;
      for (std::size_t k = 0; k < mu.size; ++k) {
        row_kept += mu.weight[k] * table.kept[at + k];
        row_displacement += mu.weight[k] * table.displacement[at + k];
      }
      kept += weight * row_kept;
      displacement += weight * row_displacement;
    }
  landed.carried_squared = std::max(0.0, kept * omega * omega);
  landed.displacement = displacement;
  return landed;
}

bool SettledMap::tabulated(int leg, double omega, double eta) const {
  TablePlace at;
  return place(leg, omega, eta, at);
}

double SettledMap::resting_friction(int leg, double omega, double eta) const {
  TablePlace at;
  if (place(leg, omega, eta, at)) return at.edge[stops];
  return solve_resting(leg, omega, eta, 0);
}

MappedLanding SettledMap::follow(int leg, double omega, const Contact& contact) const {
  const Landing landing = motion_.land(leg, omega, contact);
  if (landing.end == LandingEnd::rest || landing.end == LandingEnd::given_up) return {0, 0, true};
  return {landing.carried_squared, landing.displacement, false};
}

MappedLanding SettledMap::land(int leg, double omega, const Contact& contact) const {
  TablePlace at;
  return place(leg, omega, contact.restitution, at) ? read(leg, omega, contact.restitution, contact.friction, at)
                                                    : follow(leg, omega, contact);
}

void SettledMap::land(int leg, double omega, double eta, std::span<const double> friction,
                      std::span<MappedLanding> landed) const {
  TablePlace at;
  const bool known = place(leg, omega, eta, at);
  for (std::size_t i = 0; i < friction.size(); ++i)
    landed[i] = known ? read(leg, omega, eta, friction[i], at) : follow(leg, omega, {eta, friction[i]});
}

void SettledMap::check() {
  const SettledRange& range = options_.range;
  const auto per_leg = static_cast<std::size_t>(options_.checks);
  std::mutex mutex;
  double settled_sum = 0, unsettled_sum = 0;
  std::size_t settled = 0;
  options_.executor(table_.size() * per_leg, [&](std::size_t index) {
    const int leg = static_cast<int>(index / per_leg);
    const Table& table = table_[static_cast<std::size_t>(leg)];
    if (!table.usable) return;
    const double eta = range.eta_low + (range.eta_high - range.eta_low) * spread(index, 0);
    const double from = *std::max_element(table.standstill.begin(), table.standstill.end()) + clear_of_rest;
    const double omega = from + (range.omega_high - from) * spread(index, 1);
    const double resting = resting_friction(leg, omega, eta), sticking = sticking_[static_cast<std::size_t>(leg)];
    const double mu = std::max(0.0, resting + (sticking - resting) * (1.3 * spread(index, 2) - 0.1));
    const MappedLanding read = land(leg, omega, {eta, mu});
    const Landing direct = motion_.land(leg, omega, {eta, mu});
    const bool rests = direct.end == LandingEnd::rest || direct.end == LandingEnd::given_up;
    const double solved = index % 16 == 0 ? solve_resting(leg, omega, eta, resting) : resting;
    const double off = (read.carried_squared - direct.carried_squared) / (omega * omega);
    const std::lock_guard lock(mutex);
    ++error_.landings;
    error_.resting_friction_max = std::max(error_.resting_friction_max, std::abs(solved - resting));
    if (rests != read.rest) {
      ++error_.misjudged_rests;
    } else if (!rests && direct.end == LandingEnd::settled) {
      ++settled;
      settled_sum += off * off;
      error_.settled_max = std::max(error_.settled_max, std::abs(off));
      error_.displacement_max = std::max(error_.displacement_max, std::abs(read.displacement - direct.displacement));
    } else if (!rests) {
      ++error_.unsettled;
      unsettled_sum += off * off;
    }
  });
  if (settled > 0) error_.settled_rms = std::sqrt(settled_sum / static_cast<double>(settled));
  if (error_.unsettled > 0) error_.unsettled_rms = std::sqrt(unsettled_sum / static_cast<double>(error_.unsettled));
}

}  // namespace metastable::dynamics
