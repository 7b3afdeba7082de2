#include "markov/chain/flow_network.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace metastable::markov {
namespace {

constexpr std::size_t eliminated_groups = 200;  // of the coarsest level
constexpr std::size_t most_levels = 40;
constexpr double strong = 0.05;        // of the largest flow of either state: joins them
constexpr double joined_enough = 0.5;  // groups a state, above which states are joined by strongest flows
constexpr double hardly_lost = 1e-15;  // losses a flow, below which the coarsest level does without them

template <typename Real>
Real sum_of(const std::vector<Real>& v) {
  return std::accumulate(v.begin(), v.end(), Real{0});
}

/// Flows by the state they leave, or by the state they enter.
template <typename Real>
struct Arcs {
  std::vector<std::size_t> start{0};
  std::vector<std::uint32_t> end;
  std::vector<Real> flow;

  std::size_t size() const { return start.size() - 1; }
  Real over(std::size_t i, std::span<const Real> x) const {
    Real sum = 0;
    for (std::size_t e = start[i]; e < start[i + 1]; ++e) sum += flow[e] * x[end[e]];
    return sum;
  }
  std::vector<Real> sums() const {
    std::vector<Real> sums(size(), 0);
    for (std::size_t i = 0; i < size(); ++i)
      for (std::size_t e = start[i]; e < start[i + 1]; ++e) sums[i] += flow[e];
    return sums;
  }
};

template <typename Real>
Arcs<Real> transposed(const Arcs<Real>& arcs) {
  Arcs<Real> other;
  other.start.assign(arcs.size() + 1, 0);
  other.end.resize(arcs.end.size());
  other.flow.resize(arcs.end.size());
  for (const std::uint32_t to : arcs.end) ++other.start[to + 1];
  std::partial_sum(other.start.begin(), other.start.end(), other.start.begin());
  std::vector<std::size_t> next(other.start.begin(), other.start.end() - 1);
  for (std::size_t i = 0; i < arcs.size(); ++i)
    for (std::size_t e = arcs.start[i]; e < arcs.start[i + 1]; ++e) {
      const std::size_t at = next[arcs.end[e]]++;
      other.end[at] = static_cast<std::uint32_t>(i);
      other.flow[at] = arcs.flow[e];
    }
  return other;
}

/// Joins states to groups.
class Groups {
 public:
  explicit Groups(std::size_t states) : parent_(states) { std::iota(parent_.begin(), parent_.end(), std::uint32_t{0}); }
  void join(std::uint32_t a, std::uint32_t b) {
    a = root(a);
    b = root(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }
  /// Numbers the groups by their first states. @return the group of each state, and how many there are
  std::pair<std::vector<std::uint32_t>, std::size_t> numbered() {
    std::vector<std::uint32_t> group(parent_.size());
    std::size_t count = 0;
    for (std::uint32_t i = 0; i < parent_.size(); ++i) {
      const std::uint32_t first = root(i);
      group[i] = first == i ? static_cast<std::uint32_t>(count++) : group[first];
    }
    return {std::move(group), count};
  }

 private:
  std::uint32_t root(std::uint32_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  std::vector<std::uint32_t> parent_;
};

template <typename Real>
std::pair<std::vector<std::uint32_t>, std::size_t> grouped(const Arcs<Real>& out, bool by_threshold) {
  const std::size_t n = out.size();
  std::vector<Real> largest(n, 0);
  std::vector<std::uint32_t> partner(n);
  for (std::uint32_t i = 0; i < n; ++i)
    for (std::size_t e = out.start[i]; e < out.start[i + 1]; ++e)
      for (const auto& [one, other] : {std::pair(i, out.end[e]), std::pair(out.end[e], i)})
        if (out.flow[e] > largest[one]) {
          largest[one] = out.flow[e];
          partner[one] = other;
        }
  Groups groups(n);
  for (std::uint32_t i = 0; i < n; ++i) {
    if (!by_threshold && largest[i] > 0) groups.join(i, partner[i]);
    for (std::size_t e = out.start[i]; by_threshold && e < out.start[i + 1]; ++e)
      if (out.flow[e] >= strong * std::max(largest[i], largest[out.end[e]])) groups.join(i, out.end[e]);
  }
  return groups.numbered();
}

/// Adds up the flows between groups.
template <typename Real>
Arcs<Real> between(const Arcs<Real>& out, const std::vector<std::uint32_t>& group, std::size_t count) {
  std::vector<std::size_t> first(count + 1, 0);
  for (const std::uint32_t g : group) ++first[g + 1];
  std::partial_sum(first.begin(), first.end(), first.begin());
  std::vector<std::uint32_t> members(group.size());
  std::vector<std::size_t> next(first.begin(), first.end() - 1);
  for (std::uint32_t i = 0; i < group.size(); ++i) members[next[group[i]]++] = i;
  Arcs<Real> coarse;
  std::vector<Real> flow(count, 0);
  std::vector<std::uint32_t> met;
  for (std::size_t g = 0; g < count; ++g) {
    met.clear();
    for (std::size_t m = first[g]; m < first[g + 1]; ++m)
      for (std::size_t e = out.start[members[m]]; e < out.start[members[m] + 1]; ++e) {
        const std::uint32_t to = group[out.end[e]];
        if (to == g || out.flow[e] == 0) continue;
        if (flow[to] == 0) met.push_back(to);
        flow[to] += out.flow[e];
      }
    std::sort(met.begin(), met.end());
    for (const std::uint32_t to : met) {
      coarse.end.push_back(to);
      coarse.flow.push_back(std::exchange(flow[to], Real{0}));
    }
    coarse.start.push_back(coarse.end.size());
  }
  return coarse;
}

}  // namespace

template <typename Real>
struct FlowNetwork<Real>::Level {
  Arcs<Real> out, in;
  Row loss, total;
  std::vector<std::uint32_t> group;  ///< of each state, on the next level; empty on the last one

  Level(Arcs<Real> flows, Row losses)
      : out(std::move(flows)), in(transposed(out)), loss(std::move(losses)), total(out.sums()) {
    for (std::size_t i = 0; i < total.size(); ++i) total[i] += loss[i];
  }
  const Arcs<Real>& rows(FlowSide side) const { return side == FlowSide::from ? out : in; }
};

template <typename Real>
FlowNetwork<Real>::FlowNetwork(const Generator& generator, std::span<const Extended> visits, bool lossless,
                               Grouping grouping) {
  const std::size_t n = generator.size();
  Arcs<Real> out{generator.start, generator.column, Row(generator.rate.size())};
  Row loss(n, 0);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t e = out.start[i]; e < out.start[i + 1]; ++e)
      out.flow[e] = static_cast<Real>(visits[i] * generator.rate[e]);
    if (!lossless) loss[i] = static_cast<Real>(visits[i] * generator.kill[i]);
  }
  levels_.emplace_back(std::move(out), std::move(loss));
  coarsen(grouping);
}

template <typename Real>
FlowNetwork<Real>::~FlowNetwork() = default;
template <typename Real>
FlowNetwork<Real>::FlowNetwork(FlowNetwork&&) noexcept = default;
template <typename Real>
FlowNetwork<Real>& FlowNetwork<Real>::operator=(FlowNetwork&&) noexcept = default;

template <typename Real>
void FlowNetwork<Real>::coarsen(Grouping grouping) {
  while (levels_.back().total.size() > eliminated_groups && levels_.size() < most_levels) {
    Level& fine = levels_.back();
    auto [group, count] = grouped(fine.out, grouping == Grouping::threshold);
    if (static_cast<double>(count) > joined_enough * static_cast<double>(group.size()))
      std::tie(group, count) = grouped(fine.out, false);
    if (count == 1) return;  // a constant, which is no business of this network
    Row loss(count, 0);
    for (std::size_t i = 0; i < group.size(); ++i) loss[group[i]] += fine.loss[i];
    Level coarse(between(fine.out, group, count), std::move(loss));
    fine.group = std::move(group);
    levels_.push_back(std::move(coarse));
  }
  const Level& last = levels_.back();
  Generator generator{
      last.out.start, last.out.end, {last.out.flow.begin(), last.out.flow.end()}, {last.loss.begin(), last.loss.end()}};
  if (sum_of(last.loss) <= hardly_lost * sum_of(last.total)) {
    // Residuals sum to zero then, and the solution is the one that is 0 in the first group.
    std::fill(generator.kill.begin(), generator.kill.end(), Extended{0});
    generator.kill[0] = last.total[0];
  }
  coarsest_ = std::make_unique<GeneratorFactors>(generator);
}

template <typename Real>
std::span<const Real> FlowNetwork<Real>::loss() const {
  return levels_[0].loss;
}
template <typename Real>
std::span<const Real> FlowNetwork<Real>::total() const {
  return levels_[0].total;
}

template <typename Real>
std::vector<Real> FlowNetwork<Real>::apply(std::span<const Real> x, FlowSide side) const {
  const Arcs<Real>& rows = levels_[0].rows(side);
  Row y(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) {
    y[i] = levels_[0].loss[i] * x[i];
    for (std::size_t e = rows.start[i]; e < rows.start[i + 1]; ++e) y[i] += rows.flow[e] * (x[i] - x[rows.end[e]]);
  }
  return y;
}

template <typename Real>
std::vector<Real> FlowNetwork<Real>::apply_unbalanced(std::span<const Real> x) const {
  Row y(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) y[i] = levels_[0].total[i] * x[i] - levels_[0].in.over(i, x);
  return y;
}

template <typename Real>
std::vector<Real> FlowNetwork<Real>::corrected(std::span<const Real> residual, FlowSide side) const {
  return cycle(0, residual, side);
}

/// Sweeps forwards (Gauss, Seidel), corrects what is left on the next level, and sweeps backwards.
template <typename Real>
std::vector<Real> FlowNetwork<Real>::cycle(std::size_t at, std::span<const Real> residual, FlowSide side) const {
  if (at + 1 == levels_.size() && coarsest_) {
    const std::vector<Extended> right(residual.begin(), residual.end());
    const std::vector<Extended> x = side == FlowSide::from ? coarsest_->solve(right) : coarsest_->solve_left(right);
    return Row(x.begin(), x.end());
  }
  const Level& level = levels_[at];
  const Arcs<Real>& rows = level.rows(side);
  const std::size_t n = residual.size();
  Row x(n, 0);
  const auto sweep = [&](std::size_t i) { x[i] = (residual[i] + rows.over(i, x)) / level.total[i]; };
  for (std::size_t i = 0; i < n; ++i) sweep(i);
  if (!level.group.empty()) {
    Row coarse(levels_[at + 1].total.size(), 0);
    for (std::size_t i = 0; i < n; ++i)
      coarse[level.group[i]] += residual[i] - (level.total[i] * x[i] - rows.over(i, x));
    coarse = cycle(at + 1, coarse, side);
    for (std::size_t i = 0; i < n; ++i) x[i] += coarse[level.group[i]];
  }
  for (std::size_t i = n; i-- > 0;) sweep(i);
  return x;
}

template class FlowNetwork<double>;
template class FlowNetwork<Extended>;

}  // namespace metastable::markov
