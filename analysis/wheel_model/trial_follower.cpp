#include "analysis/wheel_model/trial_follower.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "dynamics/numerics/truncated_normal.h"

namespace metastable::analysis {
namespace {

using dynamics::StepContext;

// Gauss-Hermite's rule serves where a trial tells less of its friction than was known before. Else its posterior is
// narrow beside the prior: trapezoids of this width in its sds are right to 1e-3 of a likelihood. The others are in sds
// of the prior.
constexpr double wide_posterior = 0.5, width = 1.6, widest = 0.8, narrowest = 0.05, farthest = 4.2;
// A trial's friction is known to this times the noise of a speed [rad/s] at best, a collision.
constexpr double told_by_noise = 0.2;
constexpr double negligible = 8;  // log weight below the largest: four of the posterior's sds away

std::size_t collision_of(const Event& event) { return static_cast<std::size_t>(event.number) - 1; }

// Returns what a step says given that the wheel went on. Where it is not known how a trial ended, the collision that it
// may have come to rest in is missing, and the steps that are seen must not count against rests.
SpeedFilter::Out given_that_it_went_on(SpeedFilter::Out out, double rests) {
  const double goes_on = std::max(1e-9, 1 - rests), before = out.score;
  out.score = -score_of_probability(dynamics::normal_cdf(-before) / goes_on);
  out.log_density -= std::log(goes_on);
  out.unit *= goes_on * dynamics::normal_density(out.score) / std::max(1e-300, dynamics::normal_density(before));
  out.unit = std::clamp(out.unit, 1e-4, 2.0);
  return out;
}

}  // namespace

// @param told  root of what a trial may tell of its friction, in sds of the prior
std::vector<TrialFollower::ScoreNode> TrialFollower::nodes_for(double told) {
  if (told == 0) return {{0, 1}};
  if (told < wide_posterior)
    return {{-2.856970013872806, 0.01125741132772069},
            {-1.355626179974266, 0.2220759220056126},
            {0, 0.5333333333333333},
            {1.355626179974266, 0.2220759220056126},
            {2.856970013872806, 0.01125741132772069}};
  const double spacing = std::clamp(width / told, narrowest, widest);
  std::vector<ScoreNode> nodes;
  const int most = static_cast<int>(farthest / spacing);
  for (int k = -most; k <= most; ++k) nodes.push_back({k * spacing, spacing * dynamics::normal_density(k * spacing)});
  return nodes;
}

std::shared_ptr<const ContactNodes> TrialFollower::contacts_for(const dynamics::ExtendedWheel& wheel,
                                                                const WheelHypothesis& hypothesis) {
  if (wheel.settles() || wheel.certain()) return nullptr;
  return std::make_shared<const ContactNodes>(contact_nodes(hypothesis.contact));
}

TrialFollower::TrialFollower(const WheelRuns& measured, const WheelRun& run, const dynamics::ExtendedWheel& wheel,
                             const WheelHypothesis& hypothesis, std::shared_ptr<const ContactNodes> contacts)
    : measured_(measured),
      run_(run),
      wheel_(wheel),
      hypothesis_(hypothesis),
      day_shift_(hypothesis.shift_of(run.condition)),
      friction_sd_(hypothesis.extension.contact.trial_friction_sd),
      nodes_(nodes_for(
          friction_sd_ * std::sqrt(static_cast<double>(run.collisions.size())) /
          std::max(hypothesis.contact.friction_sd, told_by_noise * hypothesis.noise.value_or(measured.noise)))),
      filters_(nodes_.size(), SpeedFilter(hypothesis.extension, hypothesis.tilt,
                                          hypothesis.noise.value_or(measured.noise), measured.slack, measured.law_error,
                                          measured.slide_error, measured.memory, std::move(contacts))) {
  for (const ScoreNode& node : nodes_) log_weight_.push_back(std::log(node.weight));
}

void TrialFollower::come_to(const Event& event) {
  const std::size_t k = collision_of(event);
  if (!is_contact(event.kind) || next_ == k) return;
  for (SpeedFilter& filter : filters_) filter.start(run_.collisions[k].before);
  next_ = k;
}

double TrialFollower::friction_shift(std::size_t node) const { return day_shift_ + nodes_[node].score * friction_sd_; }

StepContext TrialFollower::context_of(const Event& event, double friction_shift) const {
  const std::size_t k = collision_of(event);
  StepContext here = run_.collisions[k].context;
  here.friction_shift = friction_shift;
  if (hypothesis_.varied)
    hypothesis_.varied(collision_place(run_, event.trial, k, run_.collisions[k], run_.collisions[k].before), here);
  return here;
}

double TrialFollower::largest_log_weight() const { return *std::max_element(log_weight_.begin(), log_weight_.end()); }

double TrialFollower::chance_of_rest(const Event& event) {
  if (!is_contact(event.kind)) return 0;
  come_to(event);
  const double largest = largest_log_weight();
  double sum = 0, weights = 0;
  for (std::size_t q = 0; q < nodes_.size(); ++q) {
    if (log_weight_[q] < largest - negligible) continue;
    const StepContext here = context_of(event, friction_shift(q));
    const double w = std::exp(log_weight_[q] - largest);
    sum += w * filters_[q].chance_below(wheel_, here, wheel_.barrier(here));
    weights += w;
  }
  return sum / weights;
}

SpeedFilter::Out TrialFollower::seen_by(SpeedFilter& filter, const Event& event, double friction_shift) const {
  const std::size_t k = collision_of(event);
  const RunCollision& m = run_.collisions[k];
  const StepContext here = context_of(event, friction_shift);
  switch (event.kind) {
    case EventKind::launch:
      return filter.launch(measured_.conditions[run_.condition], m.before);
    case EventKind::collision:
      return filter.collision(wheel_, here, *m.after);
    case EventKind::stance:
    case EventKind::step: {
      const RunCollision& next = run_.collisions[k + 1];
      const SpeedFilter::Touch touch{next.before, next.law_error, m.slide};
      const bool may_rest = event.kind == EventKind::step || wheel_.settles();
      const double rests = may_rest && !run_.outcome ? filter.chance_below(wheel_, here, wheel_.barrier(here)) : 0.0;
      const SpeedFilter::Out out =
          event.kind == EventKind::stance ? filter.stance(wheel_, here, touch) : filter.step(wheel_, here, touch);
      return rests > 0 ? given_that_it_went_on(out, rests) : out;
    }
    case EventKind::rest:
    case EventKind::survival:
      return filter.rest(wheel_, here, m.after ? jam_bound(measured_) : wheel_.barrier(here),
                         event.kind == EventKind::rest);
  }
  throw std::logic_error("TrialFollower: unknown kind of event");
}

SpeedFilter::Out TrialFollower::see(const Event& event) {
  come_to(event);
  next_.reset();
  if (event.kind == EventKind::launch) next_ = 0;
  if (event.kind == EventKind::collision) next_ = collision_of(event);  // whether it rested may follow
  if (event.kind == EventKind::stance || event.kind == EventKind::step) next_ = collision_of(event) + 1;
  if (nodes_.size() == 1) return seen_by(filters_[0], event, day_shift_);
  // The density is averaged over the nodes, which are weighed anew by it.
  const double largest = largest_log_weight();
  double before = 0, now = 0, below = 0, unit = 0;
  for (std::size_t q = 0; q < nodes_.size(); ++q) {
    if (log_weight_[q] < largest - negligible) {  // its filter is left behind, and it does not come back
      log_weight_[q] = -std::numeric_limits<double>::infinity();
      continue;
    }
    const SpeedFilter::Out out = seen_by(filters_[q], event, friction_shift(q));
    const double w = std::exp(log_weight_[q] - largest);
    before += w;
    now += w * std::exp(out.log_density);
    below += w * dynamics::normal_cdf(out.score);
    unit += w * out.unit;
    log_weight_[q] += out.log_density;
  }
  return {now > 0 ? std::max(least_log_density, std::log(now / before)) : least_log_density,
          score_of_probability(below / before), unit / before};
}

}  // namespace metastable::analysis
