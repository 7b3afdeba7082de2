#include "analysis/wheel_model/wheel_likelihood.h"

#include <cmath>
#include <optional>

#include "analysis/wheel_model/speed_filter.h"
#include "analysis/wheel_model/trial_follower.h"

namespace metastable::analysis {
namespace {

constexpr double far_score = -8;  // of an event whose density has no finite score

// Calls visit(follower, event) for every event, each trial with a follower of its own.
template <class Visit>
void follow(const WheelRuns& measured, const std::vector<Event>& events, const WheelHypothesis& hypothesis,
            Visit visit) {
  const std::vector<dynamics::ExtendedWheel> wheels =
      wheels_on_ramps(measured, hypothesis.contact, hypothesis.extension);
  if (wheels.empty()) return;
  const auto contacts = TrialFollower::contacts_for(wheels.front(), hypothesis);
  std::optional<TrialFollower> follower;
  std::optional<std::size_t> followed;
  for (const Event& event : events) {
    if (followed != event.trial) {
      const WheelRun& run = measured.runs[event.trial];
      follower.emplace(measured, run, wheels[run.condition], hypothesis, contacts);
      followed = event.trial;
    }
    visit(*follower, event);
  }
}

}  // namespace

Evaluation wheel_likelihood(const WheelRuns& measured, const std::vector<Event>& events,
                            const WheelHypothesis& hypothesis) {
  Evaluation result;
  result.log_density.reserve(events.size());
  result.score.reserve(events.size());
  result.unit.reserve(events.size());
  follow(measured, events, hypothesis, [&](TrialFollower& follower, const Event& event) {
    const SpeedFilter::Out out = follower.see(event);
    const double score = event.kind == EventKind::survival ? 0 : out.score;
    result.log_density.push_back(std::isfinite(out.log_density) ? out.log_density : least_log_density);
    result.score.push_back(std::isfinite(score) ? score : far_score);
    result.unit.push_back(out.unit);
  });
  return result;
}

std::vector<double> wheel_rest_chances(const WheelRuns& measured, const std::vector<Event>& events,
                                       const WheelHypothesis& hypothesis) {
  std::vector<double> chances;
  chances.reserve(events.size());
  follow(measured, events, hypothesis, [&](TrialFollower& follower, const Event& event) {
    chances.push_back(follower.chance_of_rest(event));
    follower.see(event);
  });
  return chances;
}

}  // namespace metastable::analysis
