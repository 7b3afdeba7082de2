#include "markov/discretization.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include "markov/parallel.h"

namespace metastable::markov {
namespace {

constexpr std::size_t chunk = 1024;         // draws landed at a time
constexpr std::size_t rows_per_block = 16;  // rows that share a chunk while it is in cache

// Draws of one phase: phases and the launch have randomisations of their own.
DrawOptions draws_of_phase(DrawOptions options, int phase) {
  options.replicate = options.replicate * 1024u + static_cast<std::uint32_t>(phase);
  return options;
}

// Adds the landings of all draws from [origin, origin + width) to a dense row and returns the weight that rests.
class RowSampler {
 public:
  RowSampler(const NoiseTable& table, const Draws& draws, const Grid& target)
      : table_(table), draws_(draws), target_(target), next_(chunk) {}

  double add(double origin, double width, std::size_t first, std::size_t count, std::span<double> row) {
    const std::span<double> next(next_.data(), count);
    table_.land(origin, width, std::span(draws_.offset).subspan(first, count), first, next);
    double rest = 0;
    for (std::size_t k = 0; k < count; ++k) {
      const double weight = draws_.weight[first + k];
      if (next[k] == rest_landing)
        rest += weight;
      else
        row[target_.cell(next[k])] += weight;
    }
    return rest;
  }

 private:
  const NoiseTable& table_;
  const Draws& draws_;
  const Grid& target_;
  std::vector<double> next_;
};

double mean_rest_probability(const AnyReturnMap& map, const Grid& grid, std::size_t cell, int phase) {
  constexpr std::array<double, 3> node = {0.1127016653792583, 0.5, 0.8872983346207417};
  constexpr std::array<double, 3> weight = {5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0};
  double mean = 0;
  for (std::size_t g = 0; g < node.size(); ++g)
    mean += weight[g] * *map.rest_probability(grid.lower(cell) + node[g] * grid.width(cell), phase);
  return mean;
}

struct DenseRow {
  std::vector<double> landing;  // over the cells of the next phase
  double rest = 0;
};

}  // namespace

SampledChain discretize(const AnyReturnMap& map, const StateSpace& space, const LaunchState& launch,
                        const Discretization& options) {
  const std::size_t cells = space.cells();
  std::vector<DenseRow> rows(space.size());
  for (int phase = 0; phase < space.phases(); ++phase) {
    const Draws draws = make_draws(map.noise_dimension(), draws_of_phase(options.draws, phase));
    const std::unique_ptr<NoiseTable> table = map.tabulate(phase, draws.score);
    const Grid& grid = space.grid(phase);
    const Grid& target = space.grid((phase + 1) % space.phases());
    const bool exact = options.exact_rest && map.rest_probability(grid.lower(0), phase).has_value();
    const std::size_t blocks = (cells + rows_per_block - 1) / rows_per_block;
    parallel_for(blocks, options.threads, [&](std::size_t block) {
      RowSampler sampler(*table, draws, target);
      const std::size_t begin = block * rows_per_block, end = std::min(cells, begin + rows_per_block);
      for (std::size_t c = begin; c < end; ++c) rows[space.index(phase, c)].landing.assign(cells, 0.0);
      for (std::size_t first = 0; first < draws.count(); first += chunk) {
        const std::size_t count = std::min(chunk, draws.count() - first);
        for (std::size_t c = begin; c < end; ++c) {
          DenseRow& row = rows[space.index(phase, c)];
          row.rest += sampler.add(grid.lower(c), grid.width(c), first, count, row.landing);
        }
      }
      if (exact)
        for (std::size_t c = begin; c < end; ++c)
          rows[space.index(phase, c)].rest = mean_rest_probability(map, grid, c, phase);
    });
  }

  std::vector<std::size_t> row_start{0};
  std::vector<std::uint32_t> column;
  std::vector<double> value, kill;
  row_start.reserve(space.size() + 1);
  kill.reserve(space.size());
  for (std::size_t i = 0; i < space.size(); ++i) {
    const std::size_t base = space.index((space.phase(i) + 1) % space.phases(), 0);
    for (std::size_t c = 0; c < cells; ++c) {
      if (base + c == i || rows[i].landing[c] == 0) continue;
      column.push_back(static_cast<std::uint32_t>(base + c));
      value.push_back(rows[i].landing[c]);
    }
    row_start.push_back(value.size());
    kill.push_back(rows[i].rest);
    std::vector<double>().swap(rows[i].landing);
  }

  SampledChain sampled;
  sampled.chain = Chain(std::move(row_start), std::move(column), std::move(value), std::move(kill));
  sampled.launch = launch_row(map, space, launch, options.draws);
  const auto before = [&](std::size_t i) { return (space.phase(i) + space.phases() - 1) % space.phases(); };
  if (map.duration(space.grid(0).midpoint(0), before(0))) {
    sampled.duration.resize(space.size());
    for (std::size_t i = 0; i < space.size(); ++i)
      sampled.duration[i] = *map.duration(space.grid(space.phase(i)).midpoint(space.cell(i)), before(i));
  }
  if (map.advance(0)) {
    sampled.advance.resize(space.size());
    for (std::size_t i = 0; i < space.size(); ++i) sampled.advance[i] = *map.advance(before(i));
  }
  return sampled;
}

Launch launch_row(const AnyReturnMap& map, const StateSpace& space, const LaunchState& launch,
                  const DrawOptions& options) {
  const Draws draws = make_draws(map.noise_dimension(), draws_of_phase(options, space.phases()));
  std::vector<double> start(draws.count()), landing(draws.count());
  for (std::size_t k = 0; k < draws.count(); ++k) start[k] = launch.state(normal_score(draws.offset[k]));
  map.tabulate(launch.phase, draws.score)->land(0.0, 1.0, start, 0, landing);
  const int next_phase = (launch.phase + 1) % space.phases();
  Launch row;
  row.after.assign(space.size(), 0.0);
  for (std::size_t k = 0; k < draws.count(); ++k) {
    if (landing[k] == rest_landing)
      row.rest += draws.weight[k];
    else
      row.after[space.index(next_phase, space.grid(next_phase).cell(landing[k]))] += draws.weight[k];
  }
  return row;
}

std::vector<std::vector<double>> violation_rates(const AnyReturnMap& map, const StateSpace& space,
                                                 const LaunchState& launch, std::span<const double> mask,
                                                 DrawOptions options) {
  std::vector<std::vector<double>> rate(map.assumptions().size(), std::vector<double>(space.size() + 1, 0.0));
  options.weighting = Weighting::plain;
  const auto dimension = static_cast<std::size_t>(map.noise_dimension());
  for (std::size_t i = 0; i <= space.size(); ++i) {
    const bool at_launch = i == space.size();
    if (!at_launch && mask[i] == 0) continue;
    options.replicate = static_cast<std::uint32_t>(i);
    const Draws draws = make_draws(map.noise_dimension(), options);
    const int phase = at_launch ? launch.phase : space.phase(i);
    for (std::size_t k = 0; k < draws.count(); ++k) {
      const double state =
          at_launch ? launch.state(normal_score(draws.offset[k]))
                    : space.grid(phase).lower(space.cell(i)) + space.grid(phase).width(space.cell(i)) * draws.offset[k];
      const auto score = std::span(draws.score).subspan(k * dimension, dimension);
      for (std::size_t a = 0; a < rate.size(); ++a)
        if (map.violates(static_cast<int>(a), state, phase, score)) rate[a][i] += draws.weight[k];
    }
  }
  return rate;
}

}  // namespace metastable::markov
