#include "markov/transition_rows/discretization.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numeric>
#include <stdexcept>
#include <string>

#include "markov/parallel.h"

namespace metastable::markov {
namespace {

constexpr std::size_t block_size = 1024;   // draws landed at a time
constexpr std::size_t rows_together = 16;  // rows that share a block while it is in cache
constexpr double mostly_rests = 0.95;      // launches whose few survivors may be those of a tail

// Returns the draws of one phase: phases and the launch have randomisations of their own.
DrawOptions draws_of_phase(DrawOptions options, int phase) {
  options.replicate = options.replicate * 1024u + static_cast<std::uint32_t>(phase);
  return options;
}

// Holds some draws of one phase, ready to be landed: those that survive from the lowest states first.
struct Block {
  std::unique_ptr<NoiseTable> table;
  std::vector<double> offset, weight;
  std::vector<double> lowest;      // state that just survives, ascending
  std::vector<double> rest_after;  // [k]: weight of the draws k and after
};

Block make_block(const AnyReturnMap& map, int phase, const Draws& draws, std::size_t first, std::size_t count) {
  const auto dimension = static_cast<std::size_t>(draws.dimension);
  Block block;
  block.table = map.tabulate(phase, std::span(draws.score).subspan(first * dimension, count * dimension));
  std::vector<double> lowest(count);
  for (std::size_t k = 0; k < count; ++k) lowest[k] = block.table->lowest_survivor(k);
  std::vector<std::uint32_t> order(count);
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) { return lowest[a] < lowest[b]; });
  block.table->reorder(order);
  for (const std::uint32_t k : order) {
    block.offset.push_back(draws.offset[first + k]);
    block.weight.push_back(draws.weight[first + k]);
    block.lowest.push_back(lowest[k]);
  }
  block.rest_after.assign(count + 1, 0.0);
  for (std::size_t k = count; k-- > 0;) block.rest_after[k] = block.rest_after[k + 1] + block.weight[k];
  return block;
}

std::vector<Block> make_blocks(const AnyReturnMap& map, int phase, const Draws& draws, int threads) {
  std::vector<Block> blocks((draws.count() + block_size - 1) / block_size);
  parallel_for(blocks.size(), threads, [&](std::size_t b) {
    blocks[b] = make_block(map, phase, draws, b * block_size, std::min(block_size, draws.count() - b * block_size));
  });
  return blocks;
}

// Does what Grid::tally() does, which does not know where its landings come from.
template <class Origin>
void tally(const Grid& grid, std::span<const double> landing, std::span<const double> weight, std::span<double> sums,
           const Origin& origin) {
  try {
    grid.tally(landing, weight, sums);
  } catch (const std::domain_error&) {
    const auto wrong = std::find_if(landing.begin(), landing.end(), [](double x) { return std::isnan(x); });
    throw std::domain_error("return map: the landing from state " +
                            std::to_string(origin(static_cast<std::size_t>(wrong - landing.begin()))) +
                            " is not a number");
  }
}

// Adds the landings of a block's draws from [origin, origin + width) to `sums` (as Grid::tally()).
class Lander {
 public:
  explicit Lander(const Grid& target) : target_(target), next_(block_size) {}

  void add(const Block& block, double origin, double width, std::span<double> sums) {
    // From this cell the draws behind `count` rest wherever in it they start.
    const auto count = static_cast<std::size_t>(
        std::upper_bound(block.lowest.begin(), block.lowest.end(), origin + width) - block.lowest.begin());
    const std::span<double> next(next_.data(), count);
    block.table->land(origin, width, std::span(block.offset).first(count), 0, next);
    tally(target_, next, std::span(block.weight).first(count), sums,
          [&](std::size_t k) { return origin + width * block.offset[k]; });
    sums[0] += block.rest_after[count];
  }

 private:
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

}  // namespace

SampledChain discretize(const AnyReturnMap& map, const StateSpace& space, const LaunchState& launch,
                        const Discretization& options) {
  const std::size_t cells = space.cells();
  std::vector<std::size_t> row_start{0};
  std::vector<std::uint32_t> column;
  std::vector<double> value, kill;
  for (int phase = 0; phase < space.phases(); ++phase) {
    const Draws draws = make_draws(map.noise_dimension(), draws_of_phase(options.draws, phase));
    const std::vector<Block> blocks = make_blocks(map, phase, draws, options.threads);
    const Grid& grid = space.grid(phase);
    const int next_phase = (phase + 1) % space.phases();
    const bool exact = options.exact_rest && map.rest_probability(grid.lower(0), phase).has_value();
    std::vector<double> sums(cells * (cells + 1), 0.0);  // rest, then the cells of the next phase
    parallel_for((cells + rows_together - 1) / rows_together, options.threads, [&](std::size_t group) {
      Lander lander(space.grid(next_phase));
      const std::size_t begin = group * rows_together, end = std::min(cells, begin + rows_together);
      for (const Block& block : blocks)
        for (std::size_t c = begin; c < end; ++c)
          lander.add(block, grid.lower(c), grid.width(c), std::span(sums).subspan(c * (cells + 1), cells + 1));
      if (exact)
        for (std::size_t c = begin; c < end; ++c) sums[c * (cells + 1)] = mean_rest_probability(map, grid, c, phase);
    });
    const std::size_t base = space.index(next_phase, 0);
    for (std::size_t c = 0; c < cells; ++c) {
      const double* const row = sums.data() + c * (cells + 1);
      for (std::size_t to = 0; to < cells; ++to) {
        if (row[to + 1] == 0 || base + to == space.index(phase, c)) continue;
        column.push_back(static_cast<std::uint32_t>(base + to));
        value.push_back(row[to + 1]);
      }
      row_start.push_back(value.size());
      kill.push_back(row[0]);
    }
  }

  SampledChain sampled;
  sampled.chain = Chain(std::move(row_start), std::move(column), std::move(value), std::move(kill));
  sampled.launch = launch_row(map, space, launch, options.draws, options.threads);
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
                  const DrawOptions& options, int threads) {
  const int next_phase = (launch.phase + 1) % space.phases();
  const auto noise = static_cast<std::size_t>(map.noise_dimension());
  // `tails` says that the launch's score is drawn as the noise is, not by equal shares.
  const auto land = [&](bool tails) {
    const Draws draws =
        make_draws(map.noise_dimension() + (tails ? 1 : 0), draws_of_phase(options, space.phases() + (tails ? 1 : 0)));
    const auto dimension = static_cast<std::size_t>(draws.dimension);
    std::vector<double> landing(draws.count());
    parallel_for((draws.count() + block_size - 1) / block_size, threads, [&](std::size_t b) {
      const std::size_t first = b * block_size, count = std::min(block_size, draws.count() - first);
      std::vector<double> start(count), score;
      for (std::size_t k = 0; k < count; ++k) {
        const auto drawn = std::span(draws.score).subspan((first + k) * dimension, dimension);
        start[k] = launch.state(tails ? drawn.back() : normal_score(draws.offset[first + k]));
        score.insert(score.end(), drawn.begin(), drawn.begin() + static_cast<std::ptrdiff_t>(noise));
      }
      map.tabulate(launch.phase, score)->land(0.0, 1.0, start, 0, std::span(landing).subspan(first, count));
    });
    std::vector<double> sums(space.cells() + 1, 0.0);
    tally(space.grid(next_phase), landing, draws.weight, sums, [&](std::size_t k) {
      return launch.state(tails ? draws.score[(k + 1) * static_cast<std::size_t>(draws.dimension) - 1]
                                : normal_score(draws.offset[k]));
    });
    return sums;
  };
  std::vector<double> sums = land(false);
  if (sums[0] > mostly_rests && options.weighting == Weighting::weighted) sums = land(true);
  Launch row;
  row.rest = sums[0];
  row.after.assign(space.size(), 0.0);
  std::copy(sums.begin() + 1, sums.end(), row.after.begin() + static_cast<std::ptrdiff_t>(space.index(next_phase, 0)));
  return row;
}

std::vector<std::vector<double>> violation_rates(const AnyReturnMap& map, const StateSpace& space,
                                                 const LaunchState& launch, std::span<const std::size_t> counts,
                                                 DrawOptions options) {
  std::vector<std::vector<double>> rate(map.assumptions().size(), std::vector<double>(space.size() + 1, 0.0));
  options.weighting = Weighting::plain;
  const auto dimension = static_cast<std::size_t>(map.noise_dimension());
  const std::size_t launched = options.count;
  for (std::size_t i = 0; i <= space.size(); ++i) {
    const bool at_launch = i == space.size();
    options.count = at_launch ? launched : counts[i];
    if (options.count == 0) continue;
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
