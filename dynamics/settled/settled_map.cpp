#include "dynamics/settled/settled_map.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <deque>
#include <future>
#include <limits>
#include <mutex>
#include <stdexcept>
#include <utility>

#include "dynamics/settled/now_and_then.h"

namespace metastable::dynamics {
namespace {

constexpr double never = std::numeric_limits<double>::infinity();
constexpr double smooth_restitution = 0.6;  // above it feet hop on to the next touch
constexpr double rough_step = 0.05;         // between rows there
constexpr std::size_t most_kept = 32;       // maps, of some 8 MB
// Of a processor: the table of the paper's wheel takes 8 s of its landings of 20 us, those of slopes of 15 deg or of a
// radius of gyration of 0.4 m a minute; where it is 5 mm, feet slide for milliseconds of computing.
constexpr double longest_build = 900;                    // [s]
constexpr int foreseen_from = 96;                        // landings
constexpr double landings_a_node = 2;                    // beside those kept, mu_r and the kinks are solved for
constexpr double bends_found = 0.05, rows_found = 0.95;  // share of the work once these are known

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

constexpr double resting_width = 1e-10;  // Tables and those who ask for one mu_r get it to this.

// Says what a value will be at the next of evenly spread places, from those before.
class Trend {
 public:
  void add(double value) {
    last_ = {value, last_[0], last_[1], last_[2]};
    count_ = std::min(count_ + 1, 4);
  }
  double next() const { return through(count_); }  // 0: not known
  double off() const { return count_ < 3 ? 1e-3 : std::abs(next() - through(count_ - 1)) / 4 + 1e-8; }

 private:
  // Continues the polynomial through so many values.
  double through(int count) const {
    const auto [a, b, c, d] = last_;
    return count == 1   ? a
           : count == 2 ? 2 * a - b
           : count == 3 ? 3 * (a - b) + c
           : count == 4 ? 4 * (a + c) - 6 * b - d
                        : 0;
  }
  std::array<double, 4> last_{};
  int count_ = 0;
};

// Finds the friction up to `high` from which slip stops in an impact, or before its compression ends; `high` if it does
// not stop there either.
double stopping_friction(const SettledMotion& motion, int leg, double omega, double eta, int strike,
                         double SlipLeft::*when, double high, const Trend& trend, const std::function<void()>& tell) {
  const auto value = [&](double mu) {
    tell();
    const std::optional<SlipLeft> left = motion.slip_left(leg, omega, {eta, mu}, strike);
    return left ? -((*left).*when) : -1;  // without an impact it slides on
  };
  double low = high, top = high - 1e-9, at_low = 0, at_top = 0;
  const double guess = trend.next();
  for (double off = trend.off(); guess > 0 && guess - off < top && off < 1e-2; off *= 16) {
    const double below = std::max(0.0, guess - off), above = std::min(guess + off, top);
    at_low = value(below), at_top = value(above);
    if (at_top < 0 && above == top) return high;
    if (!(at_low < 0 && at_top >= 0)) continue;
    low = below, top = above;
    break;
  }
  if (!(low < top)) {
    low = top = high - 1e-9;
    at_top = value(top);
    if (at_top < 0) return high;
    for (double step = 1e-3; (at_low = value(low = std::max(0.0, low - step))) >= 0; step *= 2) {
      if (low == 0) return 0;
      top = low, at_top = at_low;
    }
  }
  return rising_root(value, low, at_low, top, at_top, 1e-9);
}

// Names the impact in which slip stops at the n-th edge of a table, and when.
std::pair<int, double SlipLeft::*> stop_of(int n) {
  if (n < 4) return {2 + n / 2, n % 2 == 0 ? &SlipLeft::compressed : &SlipLeft::struck};
  return {n, &SlipLeft::struck};
}

// Returns evenly spread points in the unit cube (Roberts' sequence).
double spread(std::size_t index, int dimension) {
  constexpr double g = 1.22074408460575947536;  // g^4 = g + 1
  const double step = std::pow(g, -dimension - 1);
  double whole = 0;
  return std::modf(0.5 + static_cast<double>(index + 1) * step, &whole);
}

// Collects what was found at the points of one region.
struct Found {
  std::size_t landings = 0, misjudged_rests = 0;
  double displacement = 0;
  std::vector<double> off, resting_off;
  SettledMapError summary() {
    SettledMapError error{.landings = landings, .misjudged_rests = misjudged_rests, .displacement = displacement};
    for (std::vector<double>* list : {&off, &resting_off}) std::sort(list->begin(), list->end());
    if (!off.empty()) {
      double sum = 0;
      for (const double one : off) sum += one * one;
      error.rms = std::sqrt(sum / static_cast<double>(off.size()));
      error.median = off[off.size() / 2], error.largest = off.back();
    }
    if (!resting_off.empty())
      error.resting_friction = resting_off.back(), error.resting_friction_median = resting_off[resting_off.size() / 2];
    return error;
  }
};

// Tells a listener, one thread at a time, how far a part of the work has come.
class Told {
 public:
  Told(const std::function<void(double)>& progress, double from, double to, std::size_t count)
      : progress_(progress), from_(from), to_(to), count_(count) {}
  void one_more() { tell(1); }
  void still() { still_(); }  ///< nothing more is done; it may be called at every landing

 private:
  void tell(std::size_t more) {
    const std::lock_guard lock(mutex_);
    done_ += more;
    if (progress_) progress_(from_ + (to_ - from_) * static_cast<double>(done_) / static_cast<double>(count_));
  }

  const std::function<void(double)>& progress_;
  double from_, to_;
  std::size_t count_, done_ = 0;
  std::mutex mutex_;
  NowAndThen still_{[this] { tell(0); }};
};

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
      try {
        return built.get();  // may still be built by another thread
      } catch (const TableTooLong&) {
        throw;
      } catch (const std::invalid_argument&) {
        throw;
      } catch (...) {  // what ended the other caller's work does not end this one's
        return of(wheel, options);
      }
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
      map->foresee();
      map->build();
      map->check();
      map->seconds_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
    }
    map->options_.executor = nullptr;
    map->options_.progress = nullptr;
    promise.set_value(map);
    return map;
  } catch (...) {
    {
      const std::lock_guard lock(mutex);
      std::erase_if(kept, is_it);
    }
    promise.set_exception(std::current_exception());
    throw;
  }
}

double SettledMap::standstill(int leg, double eta, const std::function<void()>& tell) const {
  // These are speeds so low that a sticking foot is carried back; there are none for a slope without barrier.
  const double barrier = motion_.foot(leg).barrier_squared();
  if (!(barrier > 0)) return 0;
  const double mu = sticking_[static_cast<std::size_t>(leg)] + clear_of_sticking;
  const auto value = [&](double omega) {
    tell();
    return beyond_barrier(motion_.land(leg, omega, {eta, mu}), barrier);
  };
  double low = 0.5 * std::sqrt(barrier), high = 1.5 * std::sqrt(barrier);
  double at_low = value(low), at_high = value(high);
  while (at_low >= 0 && low > 1e-3) low /= 2, at_low = value(low);
  while (at_high < 0 && high < 30) high *= 1.3, at_high = value(high);
  if (at_low >= 0) return 0;
  if (at_high < 0) return never;
  return rising_root(value, low, at_low, high, at_high, 1e-10 * high);
}

// @param guess from which to start, 0: none; @param off how far off it may be; @param width to which it is found
double SettledMap::solve_resting(int leg, double omega, double eta, double guess, double off, double width,
                                 const std::function<void()>& tell) const {
  const double barrier = motion_.foot(leg).barrier_squared();
  const auto value = [&](double mu) {
    tell();
    return beyond_barrier(motion_.land(leg, omega, {eta, mu}), barrier);
  };
  double high = sticking_[static_cast<std::size_t>(leg)] + clear_of_sticking, at_high = value(high);
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
  const bool smooth = eta <= smooth_restitution;  // elsewhere landings are rough, and may take a millisecond
  for (const double step = smooth ? 2e-3 : 1e-2; at_low >= 0 && low > 0;) {
    high = low, at_high = at_low;
    low = std::max(0.0, low - step);
    at_low = value(low);
  }
  if (at_low >= 0) return 0;
  return rising_root(value, low, at_low, high, at_high, smooth ? width : 1e-6);
}

// Finds the bend at two speeds and three restitutions: where the landing has risen by a quarter of its rise over [mu_r,
// mu_c], log(1 + part / bend) shall have, too.
void SettledMap::find_bend(SettledTable& table, int leg, const std::function<void()>& tell) const {
  const SettledRange& range = options_.range;
  const double sticking = sticking_[static_cast<std::size_t>(leg)];
  const double high_eta = std::min(0.5, range.eta_high), low_eta = std::min(range.eta_low, high_eta - 0.1);
  std::array<double, 3> at_0{}, rate{}, eta{};
  for (std::size_t j = 0; j < 3; ++j) {
    eta[j] = std::max(0.0, low_eta + (high_eta - low_eta) * static_cast<double>(j) / 2);
    const double from = standstill(leg, eta[j], tell);
    std::array<double, 2> omega{}, found{};
    for (std::size_t s = 0; s < 2; ++s) {
      omega[s] = from + (std::min(range.omega_high, from + 4) - from) * (s == 0 ? 0.3 : 0.8);
      const double resting = solve_resting(leg, omega[s], eta[j], 0, 0, resting_width, tell);
      const auto kept = [&](double part) {
        tell();
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
      found[s] = low + std::log(sticking - resting);
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

// Finds the frictions where the landing has kinks, and mu_r, at all speeds of one restitution. It calls tell() at each
// landing: where feet chatter one search takes a second.
void SettledMap::find_edges(SettledTable& table, int leg, int row, const std::function<void()>& tell) const {
  constexpr int stops = SettledTable::stops;
  const double eta = table.eta(row), still = table.standstill[static_cast<std::size_t>(row)];
  std::array<Trend, stops + 1> trend;
  for (int i = 0; i < table.speeds; ++i) {
    const double omega = table.speed(still, static_cast<double>(i) / (table.speeds - 1));
    double* edge = &table.edges[static_cast<std::size_t>((row * table.speeds + i) * (stops + 1))];
    double resting = solve_resting(leg, omega, eta, trend[stops].next(), trend[stops].off(), resting_width, tell);
    if (!(resting < table.sticking)) resting = table.sticking - 1e-9;
    trend[stops].add(edge[stops] = resting);
    for (int n = 0; n < stops; ++n) {
      edge[n] = table.sticking;
      if (row >= table.smooth_rows) continue;
      const auto [strike, when] = stop_of(n);
      edge[n] = stopping_friction(motion_, leg, omega, eta, strike, when, n == 0 ? table.sticking : edge[n - 1],
                                  trend[static_cast<std::size_t>(n)], tell);
      trend[static_cast<std::size_t>(n)].add(edge[n]);
    }
  }
}

// Tabulates one row of a leg's table: all speeds and frictions at one restitution.
void SettledMap::tabulate(SettledTable& table, int leg, int row, const std::function<void()>& tell) const {
  constexpr int stops = SettledTable::stops, piece = SettledTable::piece;
  const double eta = table.eta(row), still = table.standstill[static_cast<std::size_t>(row)];
  const bool smooth = row < table.smooth_rows;
  find_edges(table, leg, row, tell);
  int* known = &table.known[static_cast<std::size_t>(row) * (stops + 1)];
  for (int i = 0; i < table.speeds; ++i) {
    const double omega = table.speed(still, static_cast<double>(i) / (table.speeds - 1));
    const auto at = static_cast<std::size_t>(row * table.speeds + i);
    const double* edge = &table.edges[at * (stops + 1)];
    const double resting = edge[stops];
    double* kept = &table.kept[at * static_cast<std::size_t>(table.places())];
    double* displacement = &table.displacement[at * static_cast<std::size_t>(table.places())];
    unsigned unknown = 0;
    const auto note = [&](int n, double mu) {
      tell();
      const Landing landing = motion_.land(leg, omega, {eta, mu});
      const bool rests = landing.end == LandingEnd::rest || landing.end == LandingEnd::given_up;
      *kept++ = (rests ? landing.settled_squared : landing.carried_squared) / (omega * omega);
      *displacement++ = landing.displacement;
      if (rests && !(landing.settled_squared > 0)) unknown |= 1U << n;
      if (landing.end == LandingEnd::unsettled || landing.end == LandingEnd::given_up || !smooth)
        table.unsettled[at] |= static_cast<std::uint16_t>(1 << n);
    };
    // A piece begins where the one above ended.
    const auto repeat = [&](int n, int times) {
      for (int k = 0; k < times; ++k) {
        *kept = *(kept - 1), ++kept;
        *displacement = *(displacement - 1), ++displacement;
      }
      if (unknown >> (n - 1) & 1) unknown |= 1U << n;
      table.unsettled[at] |= static_cast<std::uint16_t>((table.unsettled[at] >> (n - 1) & 1) << n);
    };
    for (int n = 0; n < stops; ++n) {
      const double high = n == 0 ? table.sticking : edge[n - 1];
      if (n == 0) note(n, table.sticking + clear_of_sticking);
      if (n > 0) repeat(n, edge[n] < high ? 1 : piece);
      if (n == 0 || edge[n] < high)
        for (int k = 1; k < piece; ++k) note(n, high + (edge[n] - high) * k / (piece - 1));
    }
    const double bend = table.bend_at(omega, eta), width = edge[stops - 1] - resting;
    const double end_kept = *(kept - 1), end_displacement = *(displacement - 1);
    for (int k = 0; k < table.frictions - 1; ++k) {
      if (!(width > 0)) {
        unknown |= 1U << stops;
        *kept++ = end_kept, *displacement++ = end_displacement;
        continue;
      }
      const double place = static_cast<double>(k) / (table.frictions - 1);
      note(stops, resting + (k == 0 ? 1e-9 * width : table.above_resting(place, width, bend)));
    }
    *kept = end_kept, *displacement = end_displacement;
    table.unsettled[at] |= static_cast<std::uint16_t>((table.unsettled[at] >> (stops - 1) & 1) << stops);
    for (int n = 0; n <= stops; ++n)
      if (smooth && 2 * i < table.speeds && (unknown >> n & 1) != 0) known[n] = i + 1;
  }
}

void SettledMap::foresee() const {
  const auto processor_seconds = [] {
    timespec now{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
  };
  constexpr double enough = 5;  // [s] for a first guess
  const SettledRange& range = options_.range;
  const std::vector<double>& length = motion_.wheel().leg_length;
  const bool alike = std::all_of(length.begin(), length.end(), [&](double one) { return one == length.front(); });
  const double rows = options_.restitutions + (range.eta_high - smooth_restitution) / rough_step;
  const double landings = (alike ? 1 : legs()) * landings_a_node * rows * options_.speeds *
                          (options_.frictions + SettledTable::stops * SettledTable::piece);
  const double from = processor_seconds();
  for (std::size_t i = 0; i < foreseen_from; ++i) {
    const int leg = static_cast<int>(i % static_cast<std::size_t>(legs()));
    const double eta = range.eta_low + (range.eta_high - range.eta_low) * spread(i, 0);
    const double still = std::sqrt(std::max(0.0, motion_.foot(leg).barrier_squared()));
    const double omega = still + (range.omega_high - still) * std::max(0.05, spread(i, 1));
    if (!(omega > 0)) return;
    motion_.land(leg, omega, {eta, sticking_[static_cast<std::size_t>(leg)] * spread(i, 2)});
    if (options_.progress) options_.progress(0);
    const double spent = processor_seconds() - from, each = spent / static_cast<double>(i + 1);
    if (each * landings > longest_build && (spent > enough || i + 1 == foreseen_from))
      throw TableTooLong(fmt::format(
          "the table of landings would take about {:.2g} min of a processor, more than {:.0f}, as one landing "
          "of this wheel takes {:.2g} ms",
          each * landings / 60, longest_build / 60, 1e3 * each));
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
  Told bends(options_.progress, 0, bends_found, table_.size());
  const auto still = [&] { bends.still(); };
  options_.executor(table_.size(), [&](std::size_t leg) {
    SettledTable& table = table_[leg];
    table.sticking = sticking_[leg];
    for (int j = 0; j < table.rows; ++j)
      table.standstill[static_cast<std::size_t>(j)] = standstill(static_cast<int>(leg), table.eta(j), still);
    const double highest = *std::max_element(table.standstill.begin(), table.standstill.end());
    table.usable = highest + SettledTable::clear_of_rest < range.omega_high;
    if (table.usable) find_bend(table, static_cast<int>(leg), still);
    bends.one_more();
  });
  const auto per_leg = static_cast<std::size_t>(empty.rows);
  const std::size_t rows = table_.size() * per_leg;
  Told told(options_.progress, bends_found, rows_found, rows);
  options_.executor(rows, [&](std::size_t row) {
    SettledTable& table = table_[row / per_leg];
    if (table.usable)
      tabulate(table, static_cast<int>(row / per_leg), static_cast<int>(row % per_leg), [&] { told.still(); });
    told.one_more();
  });
}

std::optional<int> SettledMap::untabulated() const {
  const auto found = std::ranges::find(table_, false, &SettledTable::usable);
  return found == table_.end() ? std::nullopt : std::optional(static_cast<int>(found - table_.begin()));
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

double SettledMap::followed_resting_friction(int leg, double omega, double eta, double guess,
                                             const std::function<void()>& tell) const {
  constexpr double off = 2e-4;
  return solve_resting(leg, omega, eta, guess, off, resting_width, tell);
}

std::vector<double> SettledMap::followed_resting_frictions(int leg, std::span<const double> omega, double eta,
                                                           double width) const {
  std::vector<double> all;
  Trend trend;
  for (const double one : omega) {
    all.push_back(solve_resting(leg, one, eta, trend.next(), trend.off(), width, [] {}));
    if (all.back() < sticking_[static_cast<std::size_t>(leg)]) trend.add(all.back());
  }
  return all;
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
  constexpr double barely = 0.5;  // [rad/s]
  const SettledRange& range = options_.range;
  const auto per_leg = static_cast<std::size_t>(options_.checks);
  std::mutex mutex;
  Found sliding, sticking, slow, rough;
  Told told(options_.progress, rows_found, 1, table_.size() * per_leg);
  options_.executor(table_.size() * per_leg, [&](std::size_t index) {
    told.one_more();
    const int leg = static_cast<int>(index / per_leg);
    const SettledTable& table = table_[static_cast<std::size_t>(leg)];
    if (!table.usable) return;
    const double eta = range.eta_low + (range.eta_high - range.eta_low) * spread(index, 0);
    const SettledSlice read = table.slice(eta);
    const double omega = read.lowest_speed() + (range.omega_high - read.lowest_speed()) * spread(index, 1);
    const SettledSlice::SliceAtSpeed place = read.at(omega);
    const double resting = place.resting_friction();
    const double mu = std::max(0.0, resting + (table.sticking - resting) * (1.3 * spread(index, 2) - 0.1));
    const MappedLanding by_table = place.land(mu);
    const Landing direct = motion_.land(leg, omega, {eta, mu});
    const bool rests = direct.end == LandingEnd::rest || direct.end == LandingEnd::given_up;
    const bool is_rough = place.rough(std::max(mu, resting)) || direct.end == LandingEnd::unsettled;
    Found& found = is_rough                                                             ? rough
                   : omega < read.lowest_speed() - SettledTable::clear_of_rest + barely ? slow
                   : mu < table.sticking                                                ? sliding
                                                                                        : sticking;
    const bool solves = index % 8 == 0 && !is_rough;
    const double off_resting =
        solves ? std::abs(followed_resting_friction(leg, omega, eta, resting, [&] { told.still(); }) - resting) : 0;
    const std::lock_guard lock(mutex);
    ++found.landings;
    if (solves) found.resting_off.push_back(off_resting);
    if (rests != by_table.rest) ++found.misjudged_rests;
    if (rests || by_table.rest) return;
    found.off.push_back(std::abs(by_table.carried_squared - direct.carried_squared) / (omega * omega));
    found.displacement = std::max(found.displacement, std::abs(by_table.displacement - direct.displacement));
  });
  error_ = {sliding.summary(), sticking.summary(), slow.summary(), rough.summary()};
}

}  // namespace metastable::dynamics
