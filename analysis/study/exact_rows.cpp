#include "analysis/study/exact_rows.h"

#include <cstdint>

#include "markov/transition_rows/collocation.h"
#include "markov/transition_rows/integrated.h"

namespace metastable::analysis {
namespace {

constexpr double density_error = 1e-5, density_tolerance = 2 * density_error;
constexpr double bulk_over_regime = 2;  // rare survivors are faster than the usual ones
constexpr std::uint64_t pilot_seed = 1;
constexpr double solver_rounding = 1e-13;                 // of the solvers
constexpr int few_generations = 2, many_generations = 8;  // of edges

// One value tells.
bool has_density(const Problem& problem) {
  const double next = problem.map.state_interval(0).first + 1;
  double density = 0;
  return problem.map.landing_density(next, 0, {&next, 1}, {&density, 1}).has_value();
}

bool has_points(const Problem& problem) {
  std::vector<std::pair<double, double>> points;
  return problem.map.landing_points(problem.map.state_interval(0).first + 1, 0, {}, points).has_value();
}

}  // namespace

ExactRows::ExactRows(const Problem& problem, double tolerance, int threads)
    : collocated_(!has_density(problem) || (tolerance < density_tolerance && has_points(problem))), threads_(threads) {
  bulk_ = bulk_over_regime * markov::bulk_below_launch(problem.map, problem.launch, pilot_seed);
  ranges_ = collocated_ ? markov::collocation_ranges(problem.map, problem.launch, threads, bulk_)
                        : markov::node_ranges(problem.map, problem.launch, threads, bulk_);
  error_ =
      collocated_ || !has_points(problem) ? solver_rounding : density_error;  // without points, densities are exact
  if (collocated_ && !ranges_.empty())
    edges_ = markov::collocation_edges(problem.map, ranges_,
                                       tolerance < density_tolerance ? many_generations : few_generations, bulk_);
}

double ExactRows::error() const { return error_; }

std::size_t ExactRows::coarsest() const {
  return markov::NodeSpace::order * (collocated_ ? edges_.front().size() - 1 : 1);
}

markov::NodeSpace ExactRows::space(std::size_t panels, const std::vector<double>& shift) const {
  auto ranges = ranges_;
  auto edges = edges_;
  for (std::size_t p = 0; p < shift.size(); ++p) {
    ranges[p].first += shift[p];
    ranges[p].second += shift[p];
    if (collocated_)
      for (double& edge : edges[p]) edge += shift[p];
  }
  return collocated_ ? markov::NodeSpace::between(edges, panels) : markov::NodeSpace(ranges, panels, bulk_);
}

markov::IntegratedChain ExactRows::chain(const Problem& problem, const markov::NodeSpace& space) const {
  return collocated_ ? markov::collocate(problem.map, space, problem.launch, threads_)
                     : markov::integrate(problem.map, space, problem.launch, threads_);
}

markov::Launch ExactRows::launch(const Problem& problem, const markov::NodeSpace& space,
                                 const markov::LaunchState& launch, int halvings) const {
  return collocated_ ? markov::collocated_launch(problem.map, space, launch, halvings, threads_)
                     : markov::integrated_launch(problem.map, space, launch, halvings, threads_);
}

}  // namespace metastable::analysis
