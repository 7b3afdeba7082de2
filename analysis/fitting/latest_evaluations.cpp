#include "analysis/fitting/latest_evaluations.h"

#include <utility>

namespace metastable::analysis {
namespace {

constexpr std::size_t most_held = 1000, most_bytes = 50'000'000;

// Returns all that tells one hypothesis from another.
std::string key_of(std::span<const double> nuisance, std::span<const EffectTerm> terms) {
  std::string key;
  const auto add = [&](std::span<const double> values) {
    key.append(reinterpret_cast<const char*>(values.data()), values.size_bytes());
  };
  add(nuisance);
  for (const EffectTerm& term : terms) {
    key.append(term.candidate->id.c_str(), term.candidate->id.size() + 1);
    add(term.variant);
    add(term.values);
  }
  return key;
}

}  // namespace

Evaluation LatestEvaluations::of(std::span<const double> nuisance, std::span<const EffectTerm> terms,
                                 const std::function<Evaluation()>& evaluate) {
  const std::string key = key_of(nuisance, terms);
  {
    const std::lock_guard lock(mutex_);
    if (const auto held = held_.find(key); held != held_.end()) return held->second;
  }
  Evaluation made = evaluate();
  const std::lock_guard lock(mutex_);
  if (!held_.emplace(key, made).second) return made;
  order_.push_back(key);
  const std::size_t each = 3 * sizeof(double) * made.score.size();
  while (order_.size() > most_held || order_.size() * each > most_bytes) {
    held_.erase(order_.front());
    order_.pop_front();
  }
  return made;
}

}  // namespace metastable::analysis
