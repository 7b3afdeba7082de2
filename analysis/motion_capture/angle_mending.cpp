#include "analysis/motion_capture/angle_mending.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <utility>

#include "analysis/experiment/input_error.h"
#include "analysis/experiment/rolling_speeds.h"
#include "analysis/statistics/median.h"

namespace metastable::analysis {
namespace {

constexpr double turn = 2 * std::numbers::pi;
constexpr double speed_span = 0.025;    // over which a speed is taken to judge the unit by [s]
constexpr double most_mended = 0.1;     // share of a trial's frames
constexpr std::size_t most_in_row = 3;  // frames lost, repeated or stray one after the other
// A frame is stray by ten sds of the noise or three tenths of what the wheel turns in a frame: a collision bends the
// motion by 1.5 rad/s of 5, which moves the frame beside it by less.
constexpr double stray_noise = 10, stray_share = 0.3;
constexpr double moving_noise = 6;  // sds of the noise that a wheel turns in a frame, or repeats tell nothing
// A step in which frames are missing exceeds those around it by this share of one, and by eight of its own sds: a share
// of 1e-15 of the steps does so by chance.
constexpr double lost_share = 0.15, lost_noise = 8 * std::numbers::sqrt2;

struct Unmended : std::invalid_argument {
  using std::invalid_argument::invalid_argument;
};

double frame_of(const std::vector<double>& time) {
  return (time.back() - time.front()) / static_cast<double>(time.size() - 1);
}

// Returns the step of the last digit that all values share, if they have five or less.
double last_digit(const std::vector<double>& values) {
  if (const auto [least, most] = std::ranges::minmax(values); least == most) return 0;
  double in_one = 1;
  for (int digits = 0; digits <= 5; ++digits, in_one *= 10)
    if (std::ranges::all_of(values, [&](double v) { return std::abs(v * in_one - std::round(v * in_one)) < 1e-6; }))
      return 1 / in_one;
  return 0;
}

// Returns a quantile of the speeds over `speed_span`, whatever their sign [rad/s].
double speed_quantile(const AngleRecording& recording, double share) {
  const std::size_t frames = recording.time.size();
  const auto stride = std::clamp<std::size_t>(
      static_cast<std::size_t>(std::lround(speed_span / frame_of(recording.time))), 1, frames - 1);
  std::vector<double> speeds;
  for (std::size_t i = stride; i < frames; ++i)
    speeds.push_back(std::abs(recording.angle_rad[i] - recording.angle_rad[i - stride]) /
                     (recording.time[i] - recording.time[i - stride]));
  const auto at = speeds.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(speeds.size() - 1));
  std::ranges::nth_element(speeds, at);
  return *at;
}

// What was mended in one trial; frames are counted.
struct Mended {
  double wrapped = 0;  // the period; 0: not
  bool turned = false, rounded = false;
  std::size_t repeated = 0, pushed_in = 0, lost = 0, stray = 0;
  double first_repeat = 0, first_lost = 0, first_stray = 0, largest_stray = 0;  // [s], [rad]
};

class Mending {
 public:
  Mending(AngleRecording& recording, double leg_angle, RollingSpeeds speeds)
      : time_(recording.time), angle_(recording.angle_rad), leg_angle_(leg_angle), speeds_(speeds) {}

  // Times that were rounded as they were printed lie on the straight line of even frames to half a digit.
  void round_times() {
    const double frame = frame_of(time_), digit = last_digit(time_);
    if (digit == 0) return;
    double off = 0;
    for (std::size_t i = 0; i < time_.size(); ++i)
      off = std::max(off, std::abs(time_[i] - time_.front() - static_cast<double>(i) * frame));
    // Both ends of the line are rounded too.
    if (off < 0.01 * frame || off > 1.5 * digit) return;
    mended_.rounded = true;
    for (std::size_t i = 0; i < time_.size(); ++i) time_[i] = time_.front() + static_cast<double>(i) * frame;
  }

  void check_unit() const {
    const AngleRecording now{time_, angle_};
    const double speed = speed_quantile(now, 0.75);
    if (speed <= speeds_.fastest) return;
    const double degrees = speed * turn / 360;
    throw Unmended(fmt::format(
        "angle_rad turns by {:.4g} a second, where a wheel of these legs rolls at {:.3g} rad/s at most{}", speed,
        speeds_.fastest,
        degrees <= speeds_.fastest
            ? ": degrees are suspected; multiply by pi/180, or let 'metastable import' do it (angle=NAME[deg])"
            : ""));
  }

  // Angles that fit no wheel by being too slow, judged while it moves and by no jump.
  void check_slow() const {
    const double furthest = speeds_.fastest * frame_of(time_);
    const auto stride = std::clamp<std::size_t>(static_cast<std::size_t>(std::lround(speed_span / frame_of(time_))), 1,
                                                angle_.size() - 1);
    std::vector<double> speeds;
    double path = 0;
    for (std::size_t i = stride; i < angle_.size(); i += stride) {
      const double turned = std::abs(angle_[i] - angle_[i - stride]);
      if (turned > furthest * static_cast<double>(stride)) continue;
      path += turned;
      speeds.push_back(turned / (time_[i] - time_[i - stride]));
    }
    std::ranges::sort(speeds);
    double speed = 0, so_far = 0, all = 0;  // under which three quarters of the path are gone
    for (const double one : speeds) all += one;
    for (const double one : speeds)
      if (so_far += one; so_far <= 0.75 * all) speed = one;
    if (path * turn < 1.5 * leg_angle_ || speed >= speeds_.slowest) return;
    if (path < 1.5 * leg_angle_ && speed * turn < speeds_.slowest) return;  // it may have come over no leg
    throw Unmended(fmt::format(
        "angle_rad turns by {:.3g} in all, three quarters of it by less than {:.3g} a second, where a wheel that comes "
        "over its legs on this ramp reaches {:.3g} rad/s{}",
        path, speed, speeds_.slowest / RollingSpeeds::room,
        speed * turn >= speeds_.slowest && speed * turn <= speeds_.lifting
            ? ": revolutions are suspected; multiply by 2 pi, or let 'metastable import' do it (angle=NAME[rev])"
            : ": is time_s in seconds, and the frame rate right?"));
  }

  void unwrap() {
    const double furthest = speeds_.fastest * frame_of(time_);
    for (const double period : {turn, turn / 2, leg_angle_}) {
      // A wrap is a jump by whole periods; one there and back again is a stray frame.
      const auto is_wrap = [&](double step) {
        return std::abs(step) > std::max(furthest, period / 2) &&
               std::abs(step - period * std::round(step / period)) <= furthest;
      };
      std::size_t wraps = 0, others = 0;
      std::ptrdiff_t balance = 0;
      for (std::size_t i = 1; i < angle_.size(); ++i) {
        const double step = angle_[i] - angle_[i - 1];
        if (is_wrap(step))
          ++wraps, balance += step > 0 ? 1 : -1;
        else if (std::abs(step) > std::max(furthest, period / 2))
          ++others;
      }
      // Jumps of half a turn or of a leg angle may be a marker that was taken for another: wraps come again, one way.
      const bool whole_turn = period == turn;
      if (wraps < (whole_turn ? 1 : 3) ||
          (!whole_turn && (others > 0 || std::abs(balance) != static_cast<std::ptrdiff_t>(wraps))))
        continue;
      double moved = 0, last = angle_.front();
      for (std::size_t i = 1; i < angle_.size(); ++i) {
        const double step = angle_[i] - last;
        last = angle_[i];
        if (is_wrap(step)) moved -= period * std::round(step / period);
        angle_[i] += moved;
      }
      mended_.wrapped = period;
      return;
    }
  }

  // Says which way the wheel turns: 1 the right one, -1 the other, 0 too little to say.
  int sense() const {
    const double turned = angle_.back() - angle_.front();
    return std::abs(turned) < leg_angle_ / 2 ? 0 : turned > 0 ? 1 : -1;
  }

  void reverse() {
    for (double& angle : angle_) angle = -angle;
    mended_.turned = true;
  }

  void frames() {
    noise_ = angle_noise(angle_);
    made_up_.assign(angle_.size(), 0);
    repeated_frames();
    lost_frames();
    stray_frames();
    const std::size_t mended = mended_.repeated + mended_.pushed_in + mended_.lost + mended_.stray;
    if (static_cast<double>(mended) > most_mended * static_cast<double>(angle_.size()))
      throw Unmended(fmt::format(
          "{} of {} frames repeat the one before, are lost or lie off the motion of their neighbours: more than {:.0f} "
          "% are not mended",
          mended, angle_.size(), 100 * most_mended));
    check_jumps();
    take_out();
  }

  const Mended& mended() const { return mended_; }

 private:
  // Returns what the wheel turns in a frame around the steps [first, last] between frames, these left out [rad].
  std::optional<double> usual_step(std::size_t first, std::size_t last) const {
    constexpr std::size_t beside = 4;
    std::vector<double> steps;
    for (std::size_t k = 1; k <= beside; ++k) {
      if (first > k) steps.push_back(angle_[first - k] - angle_[first - k - 1]);
      if (last + k < angle_.size()) steps.push_back(angle_[last + k] - angle_[last + k - 1]);
    }
    if (steps.size() < beside) return std::nullopt;
    return median(steps);
  }

  void refuse_at(std::size_t frame, const std::string& what) const {
    throw Unmended(fmt::format("at {:.6g} s {}", time_[frame], what));
  }

  // Puts the frames [from, to) on the straight line between their neighbours, for as long as others are judged by them.
  void bridge(std::size_t from, std::size_t to) {
    std::fill(made_up_.begin() + static_cast<std::ptrdiff_t>(from), made_up_.begin() + static_cast<std::ptrdiff_t>(to),
              1);
    const double begin = angle_[from - 1], slope = (angle_[to] - begin) / static_cast<double>(to - from + 1);
    for (std::size_t i = from; i < to; ++i) angle_[i] = begin + static_cast<double>(i - from + 1) * slope;
  }

  void repeated_frames() {
    for (std::size_t i = 1; i + 1 < angle_.size(); ++i) {
      if (angle_[i] != angle_[i - 1]) continue;
      std::size_t end = i + 1;  // of the frames that repeat
      while (end < angle_.size() && angle_[end] == angle_[i]) ++end;
      const std::optional<double> step = end < angle_.size() ? usual_step(i, end) : std::nullopt;
      // Where it stood before, or stands behind, it stands now; or it is too slow to tell.
      if (!step || std::abs(*step) < moving_noise * noise_ || i < 2 ||
          std::abs(angle_[i - 1] - angle_[i - 2]) < std::abs(*step) / 4) {
        i = end - 1;
        continue;
      }
      const std::size_t count = end - i;
      if (count > most_in_row)
        refuse_at(i, fmt::format("the angle stays the same for {} frames, and turns on behind them", count + 1));
      if (mended_.repeated + mended_.pushed_in == 0) mended_.first_repeat = time_[i];
      const double made_up = (angle_[end] - angle_[i]) / *step;  // frames
      if (made_up > 1 + static_cast<double>(count) / 2) {
        mended_.repeated += count;
        bridge(i, end);
      } else {
        mended_.pushed_in += count;
        angle_.erase(angle_.begin() + static_cast<std::ptrdiff_t>(i),
                     angle_.begin() + static_cast<std::ptrdiff_t>(end));
        made_up_.erase(made_up_.begin() + static_cast<std::ptrdiff_t>(i),
                       made_up_.begin() + static_cast<std::ptrdiff_t>(end));
        time_.resize(angle_.size());  // the later frames move up: frames are even
      }
    }
  }

  // Returns the usual step before (or behind) the step between frames i - 1 and i, of up to four [rad].
  std::optional<double> step_on_side(std::size_t i, bool before) const {
    constexpr std::size_t most = 4, least = 2;
    std::vector<double> steps;
    for (std::size_t k = 1; k <= most; ++k) {
      if (before && i > k) steps.push_back(angle_[i - k] - angle_[i - k - 1]);
      if (!before && i + k < angle_.size()) steps.push_back(angle_[i + k] - angle_[i + k - 1]);
    }
    if (steps.size() < least) return std::nullopt;
    return median(steps);
  }

  // Returns how many frames are missing between i - 1 and i. A step in which none is missing lies between those of both
  // sides, for a wheel speeds up or slows down from one to the other; beside a collision the nearest says it best.
  std::size_t missing_before(std::size_t i) const {
    const std::optional<double> before = step_on_side(i, true), behind = step_on_side(i, false);
    if (!before || !behind || std::min(*before, *behind) <= 0) return 0;
    const double step = angle_[i] - angle_[i - 1], last = angle_[i - 1] - angle_[i - 2],
                 next = angle_[i + 1] - angle_[i];
    const auto [low, high] = std::minmax(*before, *behind);
    const double largest = std::max({high, last, next});
    if (step - largest < std::max(lost_share * largest, lost_noise * noise_)) return 0;
    const double frames = std::max(2.0, std::round(2 * step / (low + high)));
    if (frames - 1 > most_in_row || step < (frames - 0.3) * low || step > (frames + 0.3) * high) return 0;
    // A frame that is itself off would look like it, but comes back.
    if (std::abs(next / *behind - 1) > 0.5 || std::abs(last / *before - 1) > 0.5) return 0;
    return static_cast<std::size_t>(frames) - 1;
  }

  void lost_frames() {
    for (std::size_t i = 1; i < angle_.size(); ++i) {
      const std::size_t lost = missing_before(i);
      if (lost == 0) continue;
      if (mended_.lost == 0) mended_.first_lost = time_[i];
      mended_.lost += lost;
      const double frame = frame_of(time_);
      angle_.insert(angle_.begin() + static_cast<std::ptrdiff_t>(i), lost, 0);
      made_up_.insert(made_up_.begin() + static_cast<std::ptrdiff_t>(i), lost, 0);
      bridge(i, i + lost);
      for (std::size_t k = 0; k < lost; ++k) time_.push_back(time_.back() + frame);
      i += lost;
    }
  }

  // Extrapolates four frames by their parabola of least squares to the frame beside them.
  static double beyond(double nearest, double second, double third, double fourth) {
    return (9 * nearest - 3 * second - 5 * third + 3 * fourth) / 4;
  }

  // Returns how far a frame lies from where either side sees it, the nearer side of the two.
  std::optional<double> off(std::size_t i) const {
    std::optional<double> least;
    const auto see = [&](double from) {
      const double seen = angle_[i] - from;
      if (!least || std::abs(seen) < std::abs(*least)) least = seen;
    };
    if (i >= 4) see(beyond(angle_[i - 1], angle_[i - 2], angle_[i - 3], angle_[i - 4]));
    if (i + 4 < angle_.size()) see(beyond(angle_[i + 1], angle_[i + 2], angle_[i + 3], angle_[i + 4]));
    return least;
  }

  // Returns how far a frame is off, in units of what is allowed.
  double strayed(std::size_t i) const {
    const double step = std::abs(usual_step(i, i + 1).value_or(0)),
                 room = std::max(stray_noise * noise_, stray_share * std::max(step, least_step()));
    return std::abs(off(i).value_or(0)) / room;
  }

  void stray_frames() {
    constexpr std::size_t seen_from = 6;  // frames to either side that a frame is judged by
    if (angle_.size() < 3) return;
    std::vector<char> stray(angle_.size());
    std::vector<double> share(angle_.size(), 0);
    for (std::size_t i = 1; i + 1 < angle_.size(); ++i) share[i] = strayed(i);
    const auto most = static_cast<std::size_t>(most_mended * static_cast<double>(angle_.size()));
    // A frame beside a stray one is seen badly from there: the worst is taken first, and those around it judged anew.
    while (mended_.stray <= most) {
      const auto worst = static_cast<std::size_t>(std::ranges::max_element(share) - share.begin());
      if (share[worst] <= 1) return;
      if (mended_.stray++ == 0 || time_[worst] < mended_.first_stray) mended_.first_stray = time_[worst];
      mended_.largest_stray = std::max(mended_.largest_stray, std::abs(off(worst).value_or(0)));
      stray[worst] = true;
      std::size_t from = worst, to = worst + 1;
      while (from > 1 && stray[from - 1]) --from;
      while (to + 1 < angle_.size() && stray[to]) ++to;
      if (to - from > most_in_row)
        refuse_at(from, fmt::format("{} frames one after the other lie off the motion around them", to - from));
      bridge(from, to);
      for (std::size_t i = from > seen_from ? from - seen_from : 1; i + 1 < std::min(to + seen_from, angle_.size());
           ++i)
        share[i] = stray[i] ? 0 : strayed(i);
    }
  }

  void take_out() {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < angle_.size(); ++i) {
      if (made_up_[i]) continue;
      time_[kept] = time_[i];
      angle_[kept++] = angle_[i];
    }
    time_.resize(kept);
    angle_.resize(kept);
  }

  void check_jumps() const {
    const double furthest = speeds_.fastest * frame_of(time_) + moving_noise * noise_;
    for (std::size_t i = 1; i < angle_.size(); ++i)
      if (std::abs(angle_[i] - angle_[i - 1]) > furthest)
        refuse_at(i, fmt::format("the angle jumps by {:.4g} rad between two frames", angle_[i] - angle_[i - 1]));
  }

  // What a wheel turns in a frame at an ordinary speed: the motion of one that stands has no spread to be held against.
  double least_step() const { return speeds_.fastest / 5 * frame_of(time_); }

  std::vector<double>&time_, &angle_;
  double leg_angle_;
  RollingSpeeds speeds_;
  double noise_ = 0;
  std::vector<char> made_up_;  // frames
  Mended mended_;
};

// Tells which trials a sentence is about.
std::string of_trials(const std::vector<int>& trials, std::size_t all) {
  if (trials.size() == 1) return fmt::format("trial {}", trials.front());
  if (trials.size() == all) return fmt::format("all {} trials", all);
  return fmt::format("{} trials, the first of them trial {},", trials.size(), trials.front());
}

std::vector<std::string> sentences(const std::vector<MeasuredAngle>& angles, const std::vector<Mended>& mended) {
  std::vector<std::string> said;
  const auto say = [&](const auto& holds, const auto& sentence) {
    std::vector<int> trials;
    std::size_t first = 0;
    for (std::size_t t = angles.size(); t-- > 0;)
      if (holds(mended[t])) trials.push_back(angles[t].number), first = t;
    std::ranges::reverse(trials);
    if (!trials.empty()) said.push_back(sentence(of_trials(trials, angles.size()), mended[first]));
  };
  const auto total = [&](std::size_t Mended::*count) {
    std::size_t sum = 0;
    for (const Mended& one : mended) sum += one.*count;
    return sum;
  };
  say([](const Mended& m) { return m.rounded; },
      [](const std::string& who, const Mended&) {
        return fmt::format("the times of {} are rounded to their last digit; frames are taken as even", who);
      });
  say([](const Mended& m) { return m.wrapped > 0; },
      [](const std::string& who, const Mended& m) {
        return fmt::format("the angle of {} is wrapped every {:.4g} rad; it was unwrapped", who, m.wrapped);
      });
  say([](const Mended& m) { return m.turned; },
      [](const std::string& who, const Mended&) {
        return fmt::format("the angle of {} falls as the wheel rolls; its sign was turned", who);
      });
  say([](const Mended& m) { return m.repeated > 0; },
      [&](const std::string& who, const Mended& m) {
        return fmt::format("{} frames of {} repeat the one before (the first at {:.6g} s); they were taken out",
                           total(&Mended::repeated), who, m.first_repeat);
      });
  say([](const Mended& m) { return m.pushed_in > 0; },
      [&](const std::string& who, const Mended& m) {
        return fmt::format(
            "{} frames of {} were pushed in, each a copy of the one before (the first at {:.6g} s); they were taken "
            "out, and the later ones moved up",
            total(&Mended::pushed_in), who, m.first_repeat);
      });
  say([](const Mended& m) { return m.lost > 0; },
      [&](const std::string& who, const Mended& m) {
        return fmt::format(
            "{} frames of {} are left out, though the times run on evenly (the first before {:.6g} s); the later "
            "ones were moved back",
            total(&Mended::lost), who, m.first_lost);
      });
  say([](const Mended& m) { return m.stray > 0; },
      [&](const std::string& who, const Mended& m) {
        double largest = 0;
        for (const Mended& one : mended) largest = std::max(largest, one.largest_stray);
        return fmt::format(
            "{} frames of {} lie off the motion of their neighbours by up to {:.3g} rad (the first at {:.6g} s); they "
            "were taken out",
            total(&Mended::stray), who, largest, m.first_stray);
      });
  return said;
}

}  // namespace

double angle_noise(const std::vector<double>& angle) {
  constexpr double share = 0.25, normal_quantile = 0.3186, of_third_difference = 4.4721;  // sqrt(20)
  std::vector<double> differences;
  for (std::size_t i = 3; i < angle.size(); ++i)
    if (angle[i] != angle[i - 1] || angle[i - 1] != angle[i - 2])  // a copied frame has no noise of its own
      differences.push_back(std::abs(angle[i] - 3 * angle[i - 1] + 3 * angle[i - 2] - angle[i - 3]));
  if (differences.empty()) return 0;
  const auto at = differences.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(differences.size()));
  std::ranges::nth_element(differences, at);
  return std::max(*at / (normal_quantile * of_third_difference), last_digit(angle) / std::sqrt(12.0));
}

AngleRecording evenly(const AngleRecording& recording) {
  const std::vector<double>& time = recording.time;
  std::vector<double> intervals;
  for (std::size_t i = 1; i < time.size(); ++i) intervals.push_back(time[i] - time[i - 1]);
  const auto frames = static_cast<std::size_t>(std::lround((time.back() - time.front()) / median(intervals)));
  const double frame = (time.back() - time.front()) / static_cast<double>(frames);
  double off = frames + 1 == time.size() ? 0 : frame;
  for (std::size_t i = 0; i < time.size() && off < frame; ++i)
    off = std::max(off, std::abs(time[i] - time.front() - static_cast<double>(i) * frame));
  if (off < 0.01 * frame) return recording;
  AngleRecording even;
  std::size_t next = 1;
  for (std::size_t i = 0; i <= frames; ++i) {
    const double at = time.front() + static_cast<double>(i) * frame;
    while (next + 1 < time.size() && time[next] < at) ++next;
    const double share = (at - time[next - 1]) / (time[next] - time[next - 1]);
    even.time.push_back(at);
    even.angle_rad.push_back(recording.angle_rad[next - 1] +
                             share * (recording.angle_rad[next] - recording.angle_rad[next - 1]));
  }
  return even;
}

MendedAngles mend_angles(std::vector<MeasuredAngle> angles, const Experiment& description, const std::string& file) {
  Defects defects;
  std::vector<Mended> mended(angles.size());
  std::vector<Mending> mending;
  for (MeasuredAngle& angle : angles)
    mending.emplace_back(angle.recording, description.wheel.leg_angle(), rolling_speeds(description, angle.condition));
  const auto each = [&](const auto& work) {
    for (std::size_t t = 0; t < angles.size(); ++t) {
      try {
        if (angles[t].recording.time.size() > 1) work(mending[t]);
      } catch (const Unmended& error) {
        defects.add(file, {}, fmt::format("trial {}: {}", angles[t].number, error.what()));
      }
    }
    defects.check();
  };
  // Rates that the finder refuses are its to name: the times may be in another unit.
  for (const MeasuredAngle& angle : angles)
    if (const double frame = angle.recording.time.size() > 1 ? frame_of(angle.recording.time) : 0;
        !(frame > 0.99 / fastest_rate && frame < 1.01 / slowest_rate))
      return {std::move(angles), {}};
  int forward = 0;
  each([&](Mending& one) {
    one.round_times();
    one.check_unit();
    one.check_slow();
    one.unwrap();
    forward += one.sense();
  });
  each([&](Mending& one) {
    const int sense = one.sense();
    if (sense < 0 || (sense == 0 && forward < 0)) one.reverse();
    one.frames();
  });
  for (std::size_t t = 0; t < angles.size(); ++t) mended[t] = mending[t].mended();
  std::vector<std::string> said = sentences(angles, mended);
  return {std::move(angles), std::move(said)};
}

}  // namespace metastable::analysis
