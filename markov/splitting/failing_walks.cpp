#include "markov/splitting/failing_walks.h"

#include <algorithm>
#include <utility>

namespace metastable::markov {
namespace {

void append(std::vector<double>& to, std::span<const double> values) {
  to.insert(to.end(), values.begin(), values.end());
}

}  // namespace

void FailingWalks::add(const FailingWalks& others) {
  steps = others.steps, dimension = others.dimension, scores = others.scores;
  append(weights, others.weights), append(states, others.states), append(noise, others.noise);
  phases.insert(phases.end(), others.phases.begin(), others.phases.end());
}

void FailingWalks::thin(std::size_t most, double offset) {
  if (size() <= most) return;
  double whole = 0;
  for (const double weight : weights) whole += weight;
  FailingWalks kept{steps, dimension, scores, {}, {}, {}, {}};
  const double share = whole / static_cast<double>(most);
  double reached = 0, place = offset;
  for (std::size_t i = 0; i < size(); ++i) {
    reached += weights[i] / share;
    for (; place < reached; place += 1) {
      kept.weights.push_back(share), kept.phases.push_back(phases[i]);
      append(kept.states, std::span(states).subspan(i * steps * dimension, steps * dimension));
      append(kept.noise, std::span(noise).subspan(i * steps * scores, steps * scores));
    }
  }
  *this = std::move(kept);
}

WalkMemory::WalkMemory(std::size_t steps, std::size_t dimension, std::size_t scores) : asked_(steps) {
  walks_.steps = steps, walks_.dimension = dimension, walks_.scores = scores;
}

void WalkMemory::begin_step(int phase, std::span<const double> states, std::span<const double> scores) {
  steps_.push_back({phase, {states.begin(), states.end()}, {scores.begin(), scores.end()}, std::move(places_)});
  if (steps_.size() > asked_) steps_.pop_front();
}

void WalkMemory::failed(std::size_t replica, double weight) {
  if (steps_.size() < asked_) return;
  walks_.weights.push_back(weight);
  walks_.phases.push_back(steps_.back().phase);
  std::size_t at = replica;
  for (std::size_t k = 0; k < asked_; ++k) {
    const Step& step = steps_[asked_ - 1 - k];
    append(walks_.states, std::span(step.states).subspan(at * walks_.dimension, walks_.dimension));
    append(walks_.noise, std::span(step.scores).subspan(at * walks_.scores, walks_.scores));
    if (k + 1 < asked_) at = step.before[at];
  }
}

}  // namespace metastable::markov
