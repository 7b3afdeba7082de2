#include "markov/splitting/weighted_ensemble.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "markov/splitting/stratified_scores.h"
#include "markov/transition_rows/score_lattice.h"

namespace metastable::markov {
namespace {

constexpr std::uint64_t noise_stream = 0x6000, choice_stream = 0x7000, thinning_stream = 0x8000;

}  // namespace

WeightedEnsemble::WeightedEnsemble(const BatchMap& map, std::span<const double> start, std::size_t replicas,
                                   std::uint64_t seed, std::uint64_t stream)
    : map_(map), replicas_(replicas), seed_(seed), stream_(stream) {
  require_start(map, start);
  for (std::size_t i = 0; i < replicas; ++i) states_.insert(states_.end(), start.begin(), start.end());
  weights_.assign(replicas, 1 / static_cast<double>(replicas));
  levels_.assign(replicas, 0);
  bins_.assign(replicas, 0);
  line_.assign(replicas, 0);
  older_line_.assign(replicas, 0);
}

void WeightedEnsemble::set_levels(Levels levels) {
  split_ = std::move(levels);
  place();
}

void WeightedEnsemble::mark() {
  for (const double weight : failed_of_line_)
    if (weight > 0) ended_lines_.push_back(weight);
  older_line_ = line_;
  std::iota(line_.begin(), line_.end(), 0U);
  const std::uint32_t most = older_line_.empty() ? 0 : *std::max_element(older_line_.begin(), older_line_.end());
  failed_of_line_.assign(marks_ > 0 ? most + 1 : 0, 0);
  ++marks_;
}

std::vector<double> WeightedEnsemble::lines() const {
  std::vector<double> all = ended_lines_;
  for (const double weight : failed_of_line_)
    if (weight > 0) all.push_back(weight);
  return all;
}

void WeightedEnsemble::remember(std::size_t steps, std::size_t most) {
  memory_.emplace(steps, static_cast<std::size_t>(map_.dimension), static_cast<std::size_t>(map_.scores));
  most_remembered_ = most;
}

void WeightedEnsemble::step() {
  const std::size_t n = size();
  next_.resize(states_.size());
  failed_.assign(n, 0);
  if (map_.scores > 0) {
    const auto s = static_cast<std::size_t>(map_.scores);
    scores_.resize(n * s);
    std::vector<double> weight(n);
    for (std::size_t first = 0, last = 0; first < n; first = last) {  // bins stand one after another
      while (last < n && bins_[last] == bins_[first]) ++last;
      stratified_scores(seed_, noise_stream + (stream_ << 16) + static_cast<std::uint64_t>(bins_[first]), steps_,
                        std::span(scores_).subspan(first * s, (last - first) * s),
                        std::span(weight).subspan(first, last - first));
    }
    for (std::size_t i = 0; i < n; ++i) weights_[i] *= weight[i];
    checked_step(map_, phase_, states_, scores_, next_, failed_);
  } else {
    words_.resize(n);
    for (std::size_t i = 0; i < n; ++i) words_[i] = random_words(seed_, noise_stream + (stream_ << 16), i, steps_)[0];
    checked_draw(map_, phase_, states_, words_, next_, failed_);
  }
  if (memory_) memory_->begin_step(phase_, states_, scores_);
  calls_ += n;
  ++steps_;
  phase_ = (phase_ + 1) % map_.phases;
}

double WeightedEnsemble::advance() {
  step();
  const auto d = static_cast<std::size_t>(map_.dimension);
  double lost = 0, kept = 0;
  std::size_t left = 0;
  std::vector<std::uint32_t> survivors;
  for (std::size_t i = 0; i < size(); ++i) {
    if (failed_[i]) {
      lost += weights_[i];
      ++failures_;
      if (memory_) memory_->failed(i, weights_[i]);
      if (older_line_[i] < failed_of_line_.size()) failed_of_line_[older_line_[i]] += weights_[i];
      continue;
    }
    kept += weights_[i];
    survivors.push_back(static_cast<std::uint32_t>(i));
    weights_[left] = weights_[i];
    line_[left] = line_[i];
    older_line_[left] = older_line_[i];
    std::copy_n(&next_[i * d], d, &states_[left++ * d]);
  }
  states_.resize(left * d), weights_.resize(left), line_.resize(left), older_line_.resize(left);
  survival_ *= kept / (lost + kept);
  if (left == 0) return 1;
  const double share = lost / (lost + kept);
  for (double& weight : weights_) weight /= kept;
  place();
  std::vector<std::uint32_t> places = resample();
  if (memory_) {
    for (std::uint32_t& at : places) at = survivors[at];
    memory_->end_step(std::move(places));
    if (memory_->walks().size() > 2 * most_remembered_)
      memory_->walks().thin(most_remembered_, uniforms(seed_, thinning_stream + (stream_ << 16), 0, steps_)[0]);
  }
  return share;
}

void WeightedEnsemble::place() {
  levels_.assign(size(), 0);
  bins_.assign(size(), 0);
  if (!split_.level) return;
  split_.level(phase_, states_, levels_);
  const std::vector<double>& edges = split_.edges[static_cast<std::size_t>(phase_)];
  const auto d = static_cast<std::size_t>(map_.dimension);
  for (std::size_t i = 0; i < size(); ++i) {
    if (!std::isfinite(levels_[i]))
      throw MapError(fmt::format("level function: it is {} at the state {} (phase {}), a finite number expected",
                                 levels_[i], describe_state(map_, std::span(states_).subspan(i * d, d)), phase_));
    bins_[i] = static_cast<int>(std::upper_bound(edges.begin(), edges.end(), levels_[i]) - edges.begin());
  }
}

/// Chooses in every bin as many replicas as it is to have, at evenly spaced places along the weights of those it holds,
/// in the order of their levels. Returns the places that they had.
std::vector<std::uint32_t> WeightedEnsemble::resample() {
  const auto d = static_cast<std::size_t>(map_.dimension);
  std::vector<std::size_t> order(size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return levels_[a] < levels_[b]; });
  std::size_t occupied = 0;
  for (std::size_t k = 0; k < order.size(); ++k) occupied += k == 0 || bins_[order[k]] != bins_[order[k - 1]];
  const std::size_t each = std::max<std::size_t>(2, replicas_ / occupied);
  std::vector<double> states, weights, levels;
  std::vector<int> bins;
  std::vector<std::uint32_t> line, older, places;
  for (std::size_t first = 0, last = 0; first < order.size(); first = last) {
    double whole = 0;
    for (; last < order.size() && bins_[order[last]] == bins_[order[first]]; ++last) whole += weights_[order[last]];
    const double share = whole / static_cast<double>(each);
    double place = uniforms(seed_, choice_stream + (stream_ << 16), static_cast<std::uint64_t>(bins_[order[first]]),
                            steps_)[0],
           reached = 0;
    for (std::size_t k = first; k < last && share > 0; ++k) {
      const std::size_t i = order[k];
      reached += weights_[i] / share;
      for (; place < reached || (k + 1 == last && weights.size() % each != 0 && place < reached + 1e-9); place += 1) {
        states.insert(states.end(), &states_[i * d], &states_[i * d] + d);
        weights.push_back(share), levels.push_back(levels_[i]), bins.push_back(bins_[i]);
        line.push_back(line_[i]), older.push_back(older_line_[i]), places.push_back(static_cast<std::uint32_t>(i));
      }
    }
  }
  double sum = 0;
  for (const double weight : weights) sum += weight;
  for (double& weight : weights) weight /= sum;
  states_ = std::move(states), weights_ = std::move(weights), levels_ = std::move(levels), bins_ = std::move(bins);
  line_ = std::move(line), older_line_ = std::move(older);
  return places;
}

}  // namespace metastable::markov
