#include "analysis/description/leg_landings.h"

#include "analysis/statistics/two_sample_tests.h"

namespace metastable::analysis {
namespace {

template <class Collision>
void add_trial(std::vector<LegLandings>& legs, const std::vector<Collision>& collisions,
               const dynamics::SettledMotion& wheel) {
  for (std::size_t k = steady_collision - 1; k + 1 < collisions.size(); ++k) {
    const Collision &one = collisions[k], &next = collisions[k + 1];
    const std::optional<int> leg = one.leg;
    if (!leg) continue;
    const dynamics::StandingFoot& foot = wheel.foot(*leg);
    LegLandings& of = legs[static_cast<std::size_t>(*leg)];
    of.kept.push_back(foot.landing_squared(next.omega_minus * next.omega_minus) / (one.omega_minus * one.omega_minus));
    const std::optional<double> from = one.position, to = next.position;
    if (from && to) of.slide.push_back(*to - *from - foot.pace());
  }
}

std::optional<double> same(const std::vector<double>& a, const std::vector<double>& b) {
  return a.size() < 2 || b.size() < 2 ? std::nullopt : std::optional(welch_t_test(a, b).p);
}

}  // namespace

std::vector<LegLandings> leg_landings(const Experiment& experiment, std::size_t condition,
                                      const dynamics::SettledMotion& wheel) {
  std::vector<LegLandings> legs(static_cast<std::size_t>(wheel.wheel().legs()));
  for (const MeasuredTrial& trial : experiment.trials)
    if (trial.condition == condition) add_trial(legs, trial.collisions, wheel);
  return legs;
}

std::vector<LegLandings> leg_landings(const std::vector<dynamics::Trial>& trials,
                                      const dynamics::SettledMotion& wheel) {
  std::vector<LegLandings> legs(static_cast<std::size_t>(wheel.wheel().legs()));
  for (const dynamics::Trial& trial : trials) add_trial(legs, trial.collisions, wheel);
  return legs;
}

LegRow compare_landings(const LegLandings& measured, const LegLandings& predicted) {
  LegRow row;
  row.kept_measured = speed_summary(measured.kept);
  row.kept = speed_summary(predicted.kept);
  row.slide_measured = speed_summary(measured.slide);
  row.slide = speed_summary(predicted.slide);
  row.p_kept = same(measured.kept, predicted.kept);
  row.p_slide = same(measured.slide, predicted.slide);
  return row;
}

}  // namespace metastable::analysis
