#include "analysis/motion_capture/collision_comparison.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "analysis/statistics/interval_95.h"

namespace metastable::analysis {
namespace {

constexpr double same_collision = 0.1;  // [s]

// Follows mean and spread as differences come in (Welford).
class Spreading {
 public:
  void add(double difference) {
    const double step = difference - mean_;
    mean_ += step / ++count_;
    squares_ += step * (difference - mean_);
  }
  SpeedDifferences result() const {
    SpeedDifferences d{static_cast<std::size_t>(count_), mean_, 0, 0};
    if (count_ < 2) return d;
    d.sd = std::sqrt(squares_ / (count_ - 1));
    d.bias_half_width = normal_95 * d.sd / std::sqrt(count_);
    return d;
  }

 private:
  double count_ = 0, mean_ = 0, squares_ = 0;
};

}  // namespace

CollisionComparison compare_collisions(const Experiment& known, const std::vector<MeasuredAngle>& angles,
                                       const std::vector<FoundTrial>& found, bool peak, int most) {
  std::map<int, const MeasuredTrial*> trials;
  for (const MeasuredTrial& trial : known.trials) trials[trial.number] = &trial;
  CollisionComparison result;
  Spreading written, peaks, before, after;
  for (std::size_t t = 0; t < angles.size(); ++t) {
    const auto trial = trials.find(angles[t].number);
    if (trial == trials.end()) continue;
    const auto& truth = trial->second->collisions;
    const std::size_t wanted = std::min(truth.size(), static_cast<std::size_t>(most));
    result.due += wanted;
    for (const FoundCollision& c : found[t].collisions) {
      const auto i = static_cast<std::size_t>(c.number) - 1;
      if (i >= wanted || (truth[i].time && std::abs(*truth[i].time - reported_time(c)) > same_collision)) {
        ++result.others;
        continue;
      }
      ++result.found;
      written.add(reported_speed(c, peak) - truth[i].omega_minus);
      peaks.add(c.peak - truth[i].omega_minus);
      if (!c.fit) continue;
      before.add(c.fit->omega_minus - truth[i].omega_minus);
      if (truth[i].omega_plus && c.mended_rad_s == 0) after.add(c.fit->omega_plus - *truth[i].omega_plus);
    }
  }
  result.written = written.result();
  result.peak = peaks.result();
  result.fit_before = before.result();
  result.fit_after = after.result();
  return result;
}

}  // namespace metastable::analysis
