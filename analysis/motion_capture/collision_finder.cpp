#include "analysis/motion_capture/collision_finder.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <iterator>
#include <map>
#include <numeric>
#include <span>
#include <stdexcept>

#include "analysis/motion_capture/angle_mending.h"
#include "analysis/motion_capture/savitzky_golay.h"
#include "analysis/statistics/median.h"

namespace metastable::analysis {
namespace {

constexpr double default_span = 0.05;  // of the filter's window [s]
// A wider window than a share of the time that a leg takes at the speed sqrt(g / L) would level whole steps.
constexpr double widest_share = 1.2;
// A difference of two smoothed speeds exceeds six of their sds by chance in one of 5e4 pairs (Phi(-6/sqrt 2)).
constexpr double noise_rise = 6;
// A collision lies this share of a leg angle from the others' raster at most: at 60 Hz a wheel of eight legs turns an
// eighth of one between two frames, and smoothing moves the steepest fall by as much.
constexpr double raster_width = 0.25;
// Two fitted collisions are a leg angle apart to this share of one, beside what the noise makes of the fits.
constexpr double step_tolerance = 0.08, noise_of_fit = 5;
// A fit further off the raster is tried again near it: legs are known to a hundredth of the angle between them, and the
// fit's own angle to about half the noise of a frame.
constexpr double near_raster = 0.01, noise_off_raster = 2.5;
constexpr double known_angle_sd = 0.003;  // of a raster that many fits have made [rad]
constexpr double flight_span = 0.04;      // behind a collision in which a foot flies [s]
constexpr std::size_t most_tries = 12;    // of where it began to stand
constexpr double stray_by = 5;            // sds of the noise by which a frame is off that a fit may leave out
constexpr std::size_t fewest_less_one = 8, most_left_out = 6;  // frames of such a fit, and how many of them are tried
constexpr double noise_error = 1.7;                            // ratio by which the noise's square is known
constexpr double noise_level = 0.99;                           // share of fits to noise alone that pass for it

// A fitted speed that is so far from what the time of the stance tells [rad/s] is none. Of 15000 collisions filmed at
// 60 to 1000 Hz the two are 0.03 apart at most with noise of 0.2 mrad; with 5 mrad 99 % are 0.27 apart or less, and
// what lies beyond 0.4 are fits that are off by as much (measured: 2 of 24 were not).
constexpr double wild_from = 0.4;
constexpr double wild_behind_flight = 0.8;  // a foot that hops does not stand for all of the time
constexpr double most_speed = 1000;         // where it is sought [rad/s]

struct Peak {
  std::size_t at = 0;      // sample of the largest speed
  std::size_t trough = 0;  // of the smallest one behind it, before the next peak
  std::size_t fall = 0;    // before the steepest fall in between
  bool shown = true;       // by the speed; otherwise the angle says that a leg lands there
};

// Finds the peaks that rise by `rise` above the troughs on both sides.
std::vector<Peak> peaks(std::span<const double> speed, double rise) {
  std::vector<Peak> all;
  std::size_t low = 0, high = 0;
  bool rising = false;
  for (std::size_t i = 0; i < speed.size(); ++i) {
    if (rising) {
      if (speed[i] > speed[high]) high = i;
      if (speed[i] > speed[high] - rise) continue;
      all.push_back({high, i});
      rising = false;
      low = i;
    } else {
      if (speed[i] < speed[low]) low = i;
      if (!all.empty()) all.back().trough = low;
      if (speed[i] < speed[low] + rise) continue;
      rising = true;
      high = i;
    }
  }
  return all;
}

class Search {
 public:
  Search(const AngleRecording& recording, const dynamics::WheelMap& map, int first_landing_leg,
         const FinderOptions& options)
      : recording_(recording), map_(map), first_leg_(first_landing_leg), options_(options) {
    if (recording.time.size() > 1) even_ = evenly(recording);
    const std::vector<double>& time = even_.time;
    const double rate = time.size() < 2 ? 0 : static_cast<double>(time.size() - 1) / (time.back() - time.front());
    if (!(rate >= slowest_rate * 0.99 && rate <= fastest_rate * 1.01))
      throw std::invalid_argument(
          fmt::format("the rate of {:.6g} Hz is outside {}..{} Hz{}", rate, slowest_rate, fastest_rate,
                      std::abs(rate - 1) < 1e-6 ? ": frame numbers are suspected in time_s; divide by the camera's rate"
                      : 1000 * rate >= slowest_rate && 1000 * rate <= fastest_rate
                          ? ": milliseconds are suspected in time_s; divide by 1000, or let 'metastable import' do it "
                            "(time=NAME[ms])"
                          : ""));
    noise_ = angle_noise(recording.angle_rad);
    const dynamics::Wheel& wheel = map.wheel();
    const double slowest_step = wheel.leg_angle() / std::sqrt(wheel.gravity / wheel.mean_leg_length());
    SavitzkyGolay slope(smoothing_window(options, rate), 3, 1);
    const auto speed_noise = [&] {
      double squares = 0;
      for (const double weight : slope.weights(slope.window() / 2)) squares += weight * weight;
      return noise_ * rate * std::sqrt(squares);
    };
    // Noise makes peaks of its own: the window grows until they stay below the rise that is asked for.
    noisy_ = noise_rise * speed_noise() > options.rise;
    while (options.window == 0 && noise_rise * speed_noise() > options.rise &&
           slope.window() + 2 <= widest_share * slowest_step * rate)
      slope = SavitzkyGolay(slope.window() + 2, 3, 1);
    half_window_ = static_cast<std::size_t>(slope.window() / 2);
    rate_ = rate, rise_ = std::max(options.rise, noise_rise * speed_noise());
    angle_ = SavitzkyGolay(slope.window(), 3, 0).apply(even_.angle_rad, 1 / rate);
    speed_ = slope.apply(even_.angle_rad, 1 / rate);
  }

  FoundTrial run() {
    std::vector<Peak> all = peaks(speed_, rise_);
    if (all.empty()) return none(fmt::format("no peak rises {:.3g} rad/s above both sides", rise_));
    for (Peak& peak : all) {
      peak.fall = peak.at;
      for (std::size_t i = peak.at; i < peak.trough; ++i)
        if (speed_[i] - speed_[i + 1] > speed_[peak.fall] - speed_[peak.fall + 1]) peak.fall = i;
    }
    std::erase_if(all, [this](const Peak& peak) { return !slows(peak.fall); });
    if (all.empty()) return none("the wheel slows down at none of its peaks");
    FoundTrial found;
    std::vector<std::size_t> chosen = on_raster(all);
    for (std::size_t dropped = 1; dropped > 0;) {
      found.collisions.clear();
      for (std::size_t n = 0; n < chosen.size(); ++n) found.collisions.push_back(collision(all, chosen, n));
      fit_again(all, chosen, found.collisions);
      dropped = keep_shown(all, chosen, found.collisions);
      chosen.erase(chosen.begin(), chosen.begin() + static_cast<std::ptrdiff_t>(dropped));  // legs count from the first
    }
    check_steps(found.collisions);
    mend_speeds(found.collisions);
    check_end(found.collisions);
    if (found.collisions.size() < static_cast<std::size_t>(options_.collisions))
      found.stopped = fmt::format("no peak near the leg angle behind collision {}", found.collisions.size());
    return found;
  }

 private:
  // Returns a trial without a collision, or refuses one that turns where noise may hide some.
  FoundTrial none(const std::string& why) const {
    const auto [least, most] = std::ranges::minmax(angle_);
    if (noisy_ && most - least > map_.wheel().leg_angle() / 2)
      throw std::invalid_argument(fmt::format("the wheel turns by {:.3g} rad; {}", most - least, hidden()));
    return {{}, why};
  }

  double turned(const Peak& peak) const { return angle_[peak.fall] / map_.wheel().leg_angle(); }  // [leg angles]

  // Says whether the wheel is slower behind a fall than before it: smoothing also rings where a wheel is let go at
  // speed.
  bool slows(std::size_t fall) const {
    const std::vector<double>& time = even_.time;
    const auto mean_speed = [&](std::size_t from, std::size_t to) {
      return (even_.angle_rad[to] - even_.angle_rad[from]) / (time[to] - time[from]);
    };
    const std::size_t span = std::max<std::size_t>(2, half_window_), begin = fall > span ? fall - span : 0,
                      end = std::min(fall + 1 + span, time.size() - 1);
    return begin == fall || end == fall + 1 || mean_speed(fall + 1, end) < mean_speed(begin, fall);
  }

  // Returns the phase of the raster, in leg angles, on which most of the falls lie, the deep ones before all.
  double raster_phase(const std::vector<Peak>& all) const {
    const auto off = [](double turned, double phase) { return turned - phase - std::round(turned - phase); };
    double best = 0, most = -1;
    for (const Peak& one : all) {
      double weight = 0;
      for (const Peak& peak : all)
        weight += (speed_[peak.at] - speed_[peak.trough]) *
                  std::max(0.0, 1 - std::abs(off(turned(peak), turned(one))) / raster_width);
      if (weight > most) most = weight, best = turned(one);
    }
    double sum = 0, moved = 0;
    for (const Peak& peak : all) {
      const double depth = speed_[peak.at] - speed_[peak.trough], from = off(turned(peak), best);
      if (std::abs(from) < raster_width) sum += depth, moved += depth * from;
    }
    return best + moved / sum;
  }

  // Returns the frame before the smoothed angle first passes one, of those in [begin, end); `end` if none is.
  std::size_t passing(double angle, std::size_t begin, std::size_t end) const {
    for (std::size_t i = begin; i + 1 < end; ++i)
      if (angle_[i] < angle && angle_[i + 1] >= angle) return i;
    return end;
  }

  // Adds what the speed does not show: a wheel that turns on past the angle of a collision has had it. Between peaks,
  // and outwards as far as a third of a step is recorded beyond.
  void complete(std::map<long, Peak>& at, double phase) const {
    const double leg_angle = map_.wheel().leg_angle();
    const auto [least, most] = std::ranges::minmax(angle_);
    const auto first = static_cast<long>(std::ceil(least / leg_angle - phase + 1.0 / 3)),
               last = static_cast<long>(std::floor(most / leg_angle - phase - 1.0 / 3));
    const long begin = std::min(first, at.begin()->first), end = std::max(last, at.rbegin()->first);
    std::size_t from = 0;
    for (long k = begin; k <= end; ++k) {
      if (const auto place = at.find(k); place != at.end()) {
        from = place->second.trough;
        continue;
      }
      const std::size_t fall = passing((phase + static_cast<double>(k)) * leg_angle, from, speed_.size());
      if (fall >= speed_.size()) continue;
      const std::size_t reach = half_window_ + 1, low = fall > reach ? fall - reach : 0,
                        high = std::min(fall + 1 + reach, speed_.size() - 1);
      Peak peak{.at = fall, .trough = fall + 1, .fall = fall, .shown = false};
      for (std::size_t i = low; i <= fall; ++i)
        if (speed_[i] > speed_[peak.at]) peak.at = i;
      for (std::size_t i = fall + 1; i <= high; ++i)
        if (speed_[i] < speed_[peak.trough]) peak.trough = i;
      at.emplace(k, peak);
      from = fall + 1;
    }
  }

  // Sorts peaks and ends each before the next begins: what the speed does not show may reach over its neighbours.
  static void put_in_order(std::vector<Peak>& all) {
    std::ranges::sort(all, {}, [](const Peak& peak) { return std::pair(peak.fall, peak.shown); });
    const auto same = std::ranges::unique(all, {}, &Peak::fall);
    all.erase(same.begin(), same.end());
    for (std::size_t k = 1; k < all.size(); ++k) {
      all[k].at = std::max(all[k].at, all[k - 1].fall + 1);
      all[k - 1].trough = std::min(all[k - 1].trough, all[k].at);
    }
  }

  // Chooses the collisions, as indices of `all`, which gets those that the speed does not show: a wheel collides once a
  // leg angle, always at the same angle of its legs. Of several peaks at one of these angles the fastest is the
  // collision, for what follows it (bounces, rocking) is slower.
  std::vector<std::size_t> on_raster(std::vector<Peak>& all) const {
    const double phase = raster_phase(all);
    std::map<long, Peak> at;  // by leg angles turned
    for (const Peak& peak : all) {
      const double step = turned(peak) - phase;
      if (std::abs(step - std::round(step)) > raster_width) continue;
      const auto [place, fresh] = at.emplace(std::lround(step), peak);
      if (!fresh && speed_[peak.at] > speed_[place->second.at]) place->second = peak;
    }
    complete(at, phase);
    std::vector<std::size_t> falls, chosen;
    for (const auto& [step, peak] : at) {
      if (!falls.empty() && peak.fall <= falls.back())
        throw std::invalid_argument(fmt::format("at {:.6g} s the wheel collides where it collided before ({:.6g} s)",
                                                even_.time[peak.fall], even_.time[falls.back()]));
      if (!peak.shown) all.push_back(peak);
      falls.push_back(peak.fall);
    }
    put_in_order(all);
    for (const std::size_t fall : falls)
      chosen.push_back(static_cast<std::size_t>(std::ranges::lower_bound(all, fall, {}, &Peak::fall) - all.begin()));
    return chosen;
  }

  // Returns how far the wheel has turned from collision 1 to collision n + 1, by its legs [rad].
  double due(std::size_t n) const {
    double angle = 0;
    for (std::size_t i = 1; i <= n; ++i) angle += stance(i).end_angle_rad - stance(i).start_angle_rad;
    return angle;
  }
  double tolerance() const { return step_tolerance * map_.wheel().leg_angle() + noise_of_fit * noise_; }

  bool near(const StanceFit& fit, double angle) const {
    return std::abs(fit.angle_rad - angle) <= near_raster * map_.wheel().leg_angle() + noise_off_raster * noise_;
  }

  // Fits anew, near the angle that the other collisions say, what is not fitted or lies off their raster.
  void fit_again(const std::vector<Peak>& all, const std::vector<std::size_t>& chosen,
                 std::vector<FoundCollision>& collisions) const {
    std::vector<double> origins;
    for (std::size_t n = 0; n < collisions.size(); ++n)
      if (collisions[n].fit) origins.push_back(collisions[n].fit->angle_rad - due(n));
    if (origins.size() < 3) return;
    const double origin = median(origins);
    for (std::size_t n = 0; n < collisions.size(); ++n) {
      const std::optional<StanceFit>& fit_now = collisions[n].fit;
      const double angle = origin + due(n);
      if (fit_now && near(*fit_now, angle)) continue;
      Peak peak = all[chosen[n]];
      const std::size_t begin = n > 0 ? all[chosen[n - 1]].trough : 0,
                        end = n + 1 < chosen.size() ? all[chosen[n + 1]].at : speed_.size();
      peak.fall = passing(angle, begin, end);
      if (peak.fall + 1 >= end) continue;
      const double from = begin > 0 ? even_.time[(begin + peak.fall) / 2] : even_.time.front(),
                   to = even_.time[end - 1];
      const Fitted again = fit(peak, from, to, n, KnownAngle{angle, std::min(1.0, noise_ / known_angle_sd)});
      if (again.fit && near(*again.fit, angle)) take(collisions[n], again);
    }
  }

  // Says what the noise of the angle hides, where it is so large that the smoothing or the rise had to give way to it.
  std::string hidden() const {
    return fmt::format(
        "the noise of the angle is about {:.2g} rad: at {:.4g} Hz, smoothed over {:.2g} s, it hides collisions whose "
        "speed falls by less than {:.2g} rad/s",
        noise_, rate_, static_cast<double>(2 * half_window_ + 1) / rate_, rise_);
  }

  // Drops at both ends what only the angle says and no fall of the speed bears out; in between that is refused, and at
  // the ends where noise may hide the fall. Returns how many are dropped before the first.
  std::size_t keep_shown(const std::vector<Peak>& all, const std::vector<std::size_t>& chosen,
                         std::vector<FoundCollision>& collisions) const {
    std::vector<double> residuals;
    for (const FoundCollision& c : collisions)
      if (c.fit) residuals.push_back(c.fit->residual_sd_rad);
    const double usual = residuals.empty() ? 0 : median(residuals);
    const auto borne_out = [&](const FoundCollision& c) {
      return all[chosen[static_cast<std::size_t>(c.number) - 1]].shown ||
             (c.fit && c.fit->omega_minus - c.fit->omega_plus >= options_.rise &&
              c.fit->residual_sd_rad <= 2 * std::max(usual, noise_));
    };
    if (noisy_)
      for (const FoundCollision* c : {&collisions.front(), &collisions.back()})
        if (!borne_out(*c))
          throw std::invalid_argument(fmt::format("at {:.6g} s the wheel turns on past the angle of a collision; {}",
                                                  reported_time(*c), hidden()));
    while (!collisions.empty() && !borne_out(collisions.back())) collisions.pop_back();
    const auto dropped = std::ranges::find_if(collisions, borne_out) - collisions.begin();
    if (dropped > 0) return static_cast<std::size_t>(dropped);
    for (const FoundCollision& c : collisions)
      if (!borne_out(c))
        throw std::invalid_argument(fmt::format(
            "at {:.6g} s a leg lands, and no fall of the speed shows, though it does before and behind; the "
            "noise of the angle is about {:.2g} rad",
            reported_time(c), noise_));
    if (const auto most = static_cast<std::size_t>(options_.collisions); collisions.size() > most)
      collisions.resize(most);
    return 0;
  }

  // Refuses a wheel that turns on past further landings which noise hides.
  void check_end(const std::vector<FoundCollision>& collisions) const {
    if (!noisy_ || collisions.empty() || collisions.size() >= static_cast<std::size_t>(options_.collisions)) return;
    const FoundCollision& last = collisions.back();
    const double beyond = std::ranges::max(angle_) - (last.fit ? last.fit->angle_rad : last.peak_angle_rad);
    if (beyond > (1 + 1.0 / 3) * map_.wheel().leg_angle())
      throw std::invalid_argument(fmt::format("behind the collision at {:.6g} s the wheel turns on by {:.3g} rad; {}",
                                              reported_time(last), beyond, hidden()));
  }

  // Holds what was found against what a wheel can do: from landing to landing it turns by the angle between its legs.
  void check_steps(const std::vector<FoundCollision>& collisions) const {
    for (std::size_t n = 1; n < collisions.size(); ++n) {
      const FoundCollision &last = collisions[n - 1], &next = collisions[n];
      if (reported_time(next) <= reported_time(last))
        throw std::invalid_argument(fmt::format("collision {} at {:.6g} s is not after the one before ({:.6g} s)",
                                                next.number, reported_time(next), reported_time(last)));
      if (!last.fit || !next.fit) continue;
      const dynamics::Stance& between = stance(n);
      const double turned = next.fit->angle_rad - last.fit->angle_rad,
                   due = between.end_angle_rad - between.start_angle_rad;
      if (std::abs(turned - due) > tolerance())
        throw std::invalid_argument(
            fmt::format("between the collisions at {:.6g} and {:.6g} s the wheel turns by {:.4g} rad, where its legs "
                        "are {:.4g} rad apart; the noise of the angle is about {:.2g} rad",
                        last.fit->time, next.fit->time, turned, due, noise_));
    }
  }

  // The time from one collision to the next tells the speed at its end, however few frames lie around the collision and
  // whatever is wrong with them.
  void mend_speeds(std::vector<FoundCollision>& collisions) const {
    for (std::size_t n = 1; n < collisions.size(); ++n) {
      const FoundCollision& last = collisions[n - 1];
      FoundCollision& next = collisions[n];
      if (!last.fit || !next.fit) continue;
      const double by_time = speed_after(next.fit->time - last.fit->time, n);
      const double off = std::abs(by_time - next.fit->omega_minus);
      if (off <= (last.flies ? wild_behind_flight : wild_from)) continue;
      next.fit->omega_minus = by_time;
      next.mended_rad_s = off;
    }
  }

  // Returns the speed of a wheel that has been so long [s] on the stance that begins at collision `number`, at its end.
  double speed_after(double seconds, std::size_t number) const {
    const int phase = phase_of(number);
    double low = map_.state_interval((phase + 1) % map_.phases()).first, high = most_speed * most_speed;
    for (int i = 0; i < 60; ++i) {
      const double middle = 0.5 * (low + high);
      (map_.duration(middle, phase) > seconds ? low : high) = middle;
    }
    return std::sqrt(low);
  }

  int phase_of(std::size_t number) const {  // of collision `number`; 0: before the first
    const auto legs = static_cast<std::size_t>(map_.wheel().legs());
    const std::size_t leg = (static_cast<std::size_t>(first_leg_) + number + legs - 1) % legs;
    return static_cast<int>(leg) % map_.phases();
  }

  const dynamics::Stance& stance(std::size_t number) const {  // that begins at collision `number`; 0: before the first
    return map_.stance(phase_of(number));
  }

  FoundCollision collision(const std::vector<Peak>& all, const std::vector<std::size_t>& chosen, std::size_t n) const {
    const Peak& peak = all[chosen[n]];
    const bool last = n + 1 == chosen.size();
    FoundCollision c;
    c.number = static_cast<int>(n) + 1;
    c.peak_time = even_.time[peak.at];
    c.peak = speed_[peak.at];
    c.peak_angle_rad = angle_[peak.at];
    // The apex lies within one leg angle of the collision: behind the last one the recording may go on with others.
    std::size_t behind = last ? all.size() : chosen[n + 1];
    if (last)
      while (behind > chosen[n] + 1 && angle_[all[behind - 1].at] > c.peak_angle_rad + 0.5 * map_.wheel().leg_angle())
        --behind;
    c.bounces = static_cast<int>(behind - chosen[n]) - 1;
    const std::size_t end = behind < all.size() ? all[behind].at : speed_.size();
    const auto apex = std::min_element(speed_.begin() + static_cast<std::ptrdiff_t>(peak.at),
                                       speed_.begin() + static_cast<std::ptrdiff_t>(end)) -
                      speed_.begin();
    c.apex_time = even_.time[static_cast<std::size_t>(apex)];
    c.apex = speed_[static_cast<std::size_t>(apex)];
    take(c, fit(all, chosen[n], n));
    return c;
  }

  // A fit, whether it leaves no more than noise, and how far the frame that it leaves out is off.
  struct Fitted {
    std::optional<StanceFit> fit;
    bool noise_alone = false;
    double stray = 0;
    bool flies = false;
  };

  static void take(FoundCollision& collision, const Fitted& fitted) {
    collision.fit = fitted.fit;
    collision.stray_rad = fitted.stray;
    collision.flies = fitted.flies;
    collision.rough_rad = fitted.fit && !fitted.noise_alone ? fitted.fit->residual_sd_rad : 0;
  }

  Fitted fit(const std::vector<Peak>& all, std::size_t k, std::size_t n) const {
    // It keeps away from the neighbouring peaks: half way to the fall behind the last one, and up to the next one.
    const std::vector<double>& time = even_.time;
    return fit(all[k], k > 0 ? (time[all[k - 1].trough] + time[all[k - 1].at]) / 2 : time.front(),
               k + 1 < all.size() ? time[all[k + 1].at] : time.back(), n, {});
  }

  // Fits the collision at a fall to the frames at times [from, to] at most.
  Fitted fit(const Peak& peak, double from, double to, std::size_t n, std::optional<KnownAngle> known) const {
    const std::vector<double>& time = recording_.time;
    const std::size_t fall = peak.fall;
    const double at = (even_.time[fall] + even_.time[fall + 1]) / 2;
    from = std::max(from, at - options_.fit_span), to = std::min(to, at + options_.fit_span);
    const StanceFit guess{.time = at,
                          .angle_rad = (even_.angle_rad[fall] + even_.angle_rad[fall + 1]) / 2,
                          .omega_minus = speed_[peak.at],
                          .omega_plus = speed_[std::min(peak.trough, fall + (fall - std::min(fall, peak.at)) + 1)],
                          .residual_sd_rad = 0,
                          .omega_minus_se = 0};
    const auto first = static_cast<std::size_t>(std::lower_bound(time.begin(), time.end(), from) - time.begin());
    const auto end_at = [&](double last) {
      return static_cast<std::size_t>(std::upper_bound(time.begin(), time.end(), last) - time.begin());
    };
    const auto fitted = [&](std::size_t begin, std::size_t end, AfterCollision then) {
      return fit_collision(std::span(time).subspan(begin, end - begin),
                           std::span(recording_.angle_rad).subspan(begin, end - begin), stance(n), stance(n + 1), guess,
                           then, known);
    };
    const std::size_t last = end_at(to);
    const std::optional<StanceFit> whole = fitted(first, last, AfterCollision::stands);
    if (whole && noise_alone(*whole, last - first)) return {whole, true};
    if (const Fitted less = whole ? without_one(*whole, first, last, n, known) : Fitted{}; less.fit) return less;
    // Feet hop: the wheel stands for the last part of a step only, and flies at first.
    const std::size_t end = end_at(std::min(to, at + flight_span)), before = end_at(even_.time[fall]);
    if (before < first + 3) return {whole};
    const std::size_t stride = std::max<std::size_t>(1, (before - first) / most_tries);
    for (std::size_t begin = first; begin + 3 <= before; begin += stride)
      if (const std::optional<StanceFit> fit = fitted(begin, end, AfterCollision::flies);
          fit && noise_alone(*fit, end - begin))
        return {fit, true, 0, true};
    return {whole};
  }

  // Fits the frames [first, end) less one of them, if that leaves no more than noise: a tracker loses a marker for a
  // frame by less than what shows beside the steps between frames.
  Fitted without_one(const StanceFit& whole, std::size_t first, std::size_t end, std::size_t n,
                     std::optional<KnownAngle> known) const {
    const std::span<const double> all_times = std::span(recording_.time).subspan(first, end - first),
                                  all_angles = std::span(recording_.angle_rad).subspan(first, end - first);
    if (all_times.size() < fewest_less_one) return {};
    const std::vector<double> off = fit_residuals(all_times, all_angles, stance(n), stance(n + 1), whole);
    std::vector<std::size_t> order(off.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::ranges::sort(order, [&](std::size_t i, std::size_t k) { return std::abs(off[i]) > std::abs(off[k]); });
    order.resize(std::min(order.size(), most_left_out));
    Fitted best;
    for (const std::size_t left_out : order) {
      std::vector<double> time(all_times.begin(), all_times.end()), angle(all_angles.begin(), all_angles.end());
      time.erase(time.begin() + static_cast<std::ptrdiff_t>(left_out));
      angle.erase(angle.begin() + static_cast<std::ptrdiff_t>(left_out));
      const std::optional<StanceFit> less =
          fit_collision(time, angle, stance(n), stance(n + 1), whole, AfterCollision::stands, known);
      if (!less || !noise_alone(*less, time.size()) || (best.fit && best.fit->residual_sd_rad <= less->residual_sd_rad))
        continue;
      const double stray = fit_residuals(all_times, all_angles, stance(n), stance(n + 1), *less)[left_out];
      if (std::abs(stray) >= stray_by * noise_) best = {less, true, std::abs(stray)};
    }
    return best;
  }

  // Says whether what a fit leaves is no more than the samples' noise.
  bool noise_alone(const StanceFit& fit, std::size_t samples) const {
    const double freedom = static_cast<double>(samples) - 4;
    if (freedom < 1) return false;
    const double most = boost::math::quantile(boost::math::chi_squared(freedom), noise_level) / freedom;
    return fit.residual_sd_rad <= std::sqrt(std::max(most, noise_error)) * noise_;
  }

  const AngleRecording& recording_;
  AngleRecording even_;  // whose frames the indices count
  const dynamics::WheelMap& map_;
  int first_leg_;
  const FinderOptions& options_;
  std::vector<double> angle_, speed_;  // smoothed
  double rate_ = 0;                    // of the frames [Hz]
  bool noisy_ = false;                 // more than the filter alone leaves room for
  double noise_ = 0;                   // of the samples, about [rad]
  double rise_ = 0;                    // of a peak [rad/s]
  std::size_t half_window_ = 0;        // of the smoothing [samples]
};

}  // namespace

void FinderOptions::validate() const {
  if (window != 0 && (window < 5 || window > 10001 || window % 2 == 0))
    throw std::invalid_argument(fmt::format("window: {} is not an odd number of samples in 5..10001", window));
  if (!(rise > 0) || !std::isfinite(rise))
    throw std::invalid_argument(fmt::format("rise: {} rad/s is outside (0, inf)", rise));
  if (collisions < 1) throw std::invalid_argument(fmt::format("collisions: {} is outside 1..", collisions));
  if (!(fit_span > 0) || !std::isfinite(fit_span))
    throw std::invalid_argument(fmt::format("fit span: {} s is outside (0, inf)", fit_span));
}

double reported_speed(const FoundCollision& c, bool peak) { return peak || !c.fit ? c.peak : c.fit->omega_minus; }

double reported_time(const FoundCollision& c) { return c.fit ? c.fit->time : c.peak_time; }

int smoothing_window(const FinderOptions& options, double rate) {
  if (options.window != 0) return options.window;
  return std::max(5, 2 * static_cast<int>(std::lround(rate * default_span / 2)) + 1);
}

FoundTrial find_collisions(const AngleRecording& recording, const dynamics::WheelMap& map, int first_landing_leg,
                           const FinderOptions& options) {
  options.validate();
  return Search(recording, map, first_landing_leg, options).run();
}

}  // namespace metastable::analysis
