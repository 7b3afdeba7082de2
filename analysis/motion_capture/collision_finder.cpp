#include "analysis/motion_capture/collision_finder.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <span>
#include <stdexcept>

#include "analysis/motion_capture/savitzky_golay.h"

namespace metastable::analysis {
namespace {

constexpr double slowest_rate = 60, fastest_rate = 1000;  // [Hz]
constexpr double default_span = 0.05;                     // of the filter's window [s]
constexpr double flight_span = 0.04;                      // behind a collision in which a foot flies [s]
constexpr std::size_t most_tries = 12;                    // of where it began to stand
constexpr double noise_error = 1.7;                       // ratio by which the noise's square is known
constexpr double noise_level = 0.99;                      // share of fits to noise alone that pass for it

struct Peak {
  std::size_t at = 0;      // sample of the largest speed
  std::size_t trough = 0;  // of the smallest one behind it, before the next peak
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

// Estimates the white noise of the samples [rad], by the smaller ones of their third differences: most stretches are
// smooth over four samples.
double noise_of(const std::vector<double>& angle) {
  constexpr double share = 0.25, normal_quantile = 0.3186, of_third_difference = 4.4721;  // sqrt(20)
  std::vector<double> differences;
  for (std::size_t i = 3; i < angle.size(); ++i)
    differences.push_back(std::abs(angle[i] - 3 * angle[i - 1] + 3 * angle[i - 2] - angle[i - 3]));
  const auto at = differences.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(differences.size()));
  std::nth_element(differences.begin(), at, differences.end());
  return *at / (normal_quantile * of_third_difference);
}

class Search {
 public:
  Search(const AngleRecording& recording, const dynamics::WheelMap& map, int first_landing_leg,
         const FinderOptions& options)
      : recording_(recording), map_(map), first_leg_(first_landing_leg), options_(options) {
    const std::vector<double>& time = recording.time;
    const double rate = time.size() < 2 ? 0 : static_cast<double>(time.size() - 1) / (time.back() - time.front());
    if (!(rate >= slowest_rate * 0.99 && rate <= fastest_rate * 1.01))
      throw std::invalid_argument(
          fmt::format("the rate of {:.6g} Hz is outside {}..{} Hz", rate, slowest_rate, fastest_rate));
    const SavitzkyGolay smooth(smoothing_window(options, rate), 3, 0), slope(smooth.window(), 3, 1);
    angle_ = smooth.apply(recording.angle_rad, 1 / rate);
    speed_ = slope.apply(recording.angle_rad, 1 / rate);
    noise_ = noise_of(recording.angle_rad);
  }

  FoundTrial run() {
    const std::vector<Peak> all = peaks(speed_, options_.rise);
    FoundTrial found;
    if (all.empty()) {
      found.stopped = fmt::format("no peak rises {} rad/s above both sides", options_.rise);
      return found;
    }
    const double leg_angle = map_.wheel().leg_angle();
    std::vector<std::size_t> chosen{0};
    while (chosen.size() < static_cast<std::size_t>(options_.collisions)) {
      const double due = angle_[all[chosen.back()].at] + leg_angle;
      std::size_t best = all.size();
      double distance = leg_angle / 2;
      for (std::size_t k = chosen.back() + 1; k < all.size(); ++k) {
        const double off = std::abs(angle_[all[k].at] - due);
        if (off < distance) distance = off, best = k;
      }
      if (best == all.size()) {
        found.stopped = fmt::format("no peak near the leg angle behind collision {}", chosen.size());
        break;
      }
      chosen.push_back(best);
    }
    for (std::size_t n = 0; n < chosen.size(); ++n) found.collisions.push_back(collision(all, chosen, n));
    return found;
  }

 private:
  const dynamics::Stance& stance(std::size_t number) const {  // that begins at collision `number`; 0: before the first
    const auto legs = static_cast<std::size_t>(map_.wheel().legs());
    const std::size_t leg = (static_cast<std::size_t>(first_leg_) + number + legs - 1) % legs;
    return map_.stance(static_cast<int>(leg) % map_.phases());
  }

  FoundCollision collision(const std::vector<Peak>& all, const std::vector<std::size_t>& chosen, std::size_t n) const {
    const Peak& peak = all[chosen[n]];
    const bool last = n + 1 == chosen.size();
    FoundCollision c;
    c.number = static_cast<int>(n) + 1;
    c.peak_time = recording_.time[peak.at];
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
    c.apex_time = recording_.time[static_cast<std::size_t>(apex)];
    c.apex = speed_[static_cast<std::size_t>(apex)];
    c.fit = fit(all, chosen[n], n);
    return c;
  }

  std::optional<StanceFit> fit(const std::vector<Peak>& all, std::size_t k, std::size_t n) const {
    const std::vector<double>& time = recording_.time;
    const Peak& peak = all[k];
    // The collision lies in the steepest fall of the smoothed speed.
    std::size_t fall = peak.at;
    for (std::size_t i = peak.at; i < peak.trough; ++i)
      if (speed_[i] - speed_[i + 1] > speed_[fall] - speed_[fall + 1]) fall = i;
    const double at = (time[fall] + time[fall + 1]) / 2;
    // It keeps away from the neighbouring peaks: half way to the fall behind the last one, and up to the next one.
    double from = at - options_.fit_span, to = at + options_.fit_span;
    if (k > 0) from = std::max(from, (time[all[k - 1].trough] + time[all[k - 1].at]) / 2);
    if (k + 1 < all.size()) to = std::min(to, time[all[k + 1].at]);
    const StanceFit guess{.time = at,
                          .angle_rad = (recording_.angle_rad[fall] + recording_.angle_rad[fall + 1]) / 2,
                          .omega_minus = speed_[peak.at],
                          .omega_plus = speed_[std::min(peak.trough, fall + (fall - peak.at) + 1)],
                          .residual_sd_rad = 0};
    const auto first = static_cast<std::size_t>(std::lower_bound(time.begin(), time.end(), from) - time.begin());
    const auto end_at = [&](double last) {
      return static_cast<std::size_t>(std::upper_bound(time.begin(), time.end(), last) - time.begin());
    };
    const auto fitted = [&](std::size_t begin, std::size_t end, AfterCollision then) {
      return fit_collision(std::span(time).subspan(begin, end - begin),
                           std::span(recording_.angle_rad).subspan(begin, end - begin), stance(n), stance(n + 1), guess,
                           then);
    };
    const std::optional<StanceFit> whole = fitted(first, end_at(to), AfterCollision::stands);
    if (whole && noise_alone(*whole, end_at(to) - first)) return whole;
    // Feet hop: the wheel stands for the last part of a step only, and flies at first.
    const std::size_t end = end_at(std::min(to, at + flight_span)),
                      stride = std::max<std::size_t>(1, (fall - first) / most_tries);
    for (std::size_t begin = first; begin + 2 <= fall; begin += stride)
      if (const std::optional<StanceFit> fit = fitted(begin, end, AfterCollision::flies);
          fit && noise_alone(*fit, end - begin))
        return fit;
    return whole;
  }

  // Says whether what a fit leaves is no more than the samples' noise.
  bool noise_alone(const StanceFit& fit, std::size_t samples) const {
    const double freedom = static_cast<double>(samples) - 4;
    if (freedom < 1) return false;
    const double most = boost::math::quantile(boost::math::chi_squared(freedom), noise_level) / freedom;
    return fit.residual_sd_rad <= std::sqrt(std::max(most, noise_error)) * noise_;
  }

  const AngleRecording& recording_;
  const dynamics::WheelMap& map_;
  int first_leg_;
  const FinderOptions& options_;
  std::vector<double> angle_, speed_;  // smoothed
  double noise_ = 0;                   // of the samples, about [rad]
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
