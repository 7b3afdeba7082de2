#include "analysis/gap/collision_profile.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "analysis/fitting/model_fit.h"
#include "analysis/statistics/interval_95.h"

namespace metastable::analysis {
namespace {

constexpr int longest_profile = 40;  // collisions
constexpr std::uint64_t rounds = 4;  // simulated experiments
constexpr double least_trials = 3;

// Sums up the speeds before one collision.
struct Sum {
  double count = 0, sum = 0, squares = 0;

  void add(double speed) {
    count += 1;
    sum += speed;
    squares += speed * speed;
  }
  double mean() const { return count > 0 ? sum / count : std::numeric_limits<double>::quiet_NaN(); }
  double sd() const {
    return count > 1 ? std::sqrt(std::max(0.0, squares / count - mean() * mean()) * count / (count - 1)) : 0;
  }
};
using Sums = std::vector<std::vector<Sum>>;  // by condition and column, and by collision

// A collision may have two events, of which the first tells the speed before it.
void gather(const TransitionModel& model, Sums& sums) {
  const std::size_t columns = model.columns().size();
  std::vector<const Event*> previous(columns, nullptr);
  for (const Event& e : model.events()) {
    if (!is_contact(e.kind) || e.number > longest_profile || !std::isfinite(e.speed)) continue;
    const Event*& before = previous[e.column];
    if (before && before->trial == e.trial && before->number == e.number) continue;
    before = &e;
    std::vector<Sum>& of = sums[e.condition * columns + e.column];
    const auto number = static_cast<std::size_t>(e.number);
    if (of.size() < number) of.resize(number);
    of[number - 1].add(e.speed);
  }
}

}  // namespace

std::vector<ProfilePoint> collision_profile(const TransitionModel& model, const std::vector<double>& nominal,
                                            const Fit& chosen, std::uint64_t seed) {
  const std::size_t columns = model.columns().size();
  Sums measured(model.conditions() * columns), given(measured.size()), with(measured.size());
  gather(model, measured);
  for (std::uint64_t round = 0; round < rounds; ++round) {
    gather(*model.simulate(nominal, {}, seed + round), given);
    gather(*model.simulate(chosen.nuisance, chosen.terms, seed + round), with);
  }
  std::vector<ProfilePoint> points;
  for (std::size_t c = 0; c < measured.size(); ++c)
    for (std::size_t k = 0; k < measured[c].size(); ++k) {
      const Sum& m = measured[c][k];
      if (m.count < least_trials) continue;
      ProfilePoint p;
      p.condition = c / columns;
      p.column = c % columns;
      p.collision = static_cast<int>(k) + 1;
      p.trials = static_cast<std::size_t>(m.count);
      p.measured = m.mean();
      p.measured_error = m.sd() / std::sqrt(m.count);
      if (k < given[c].size()) p.baseline = given[c][k].mean();
      if (k < with[c].size()) {
        p.with_effect = with[c][k].mean();
        p.band = normal_95 * with[c][k].sd() / std::sqrt(m.count);
      }
      points.push_back(p);
    }
  return points;
}

}  // namespace metastable::analysis
