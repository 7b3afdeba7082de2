#include "analysis/study/integrated_study.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <utility>

#include "analysis/study/chain_summary.h"
#include "analysis/study/exact_rows.h"
#include "analysis/study/landing_error.h"
#include "analysis/study/rest_reachability.h"
#include "markov/chain/solver.h"

namespace metastable::analysis {
namespace {

constexpr std::size_t first_panels = 1;
constexpr double most_unseen = 1e-9;  // launches that land between the nodes
constexpr double safety = 2;          // of the error over the changes it is told from
constexpr int most_halvings = 7;      // of the launch's quadrature

struct Level {
  markov::NodeSpace space;
  markov::SampledChain chain;
  SolvedChain solved;
  double worst_start = 0;

  double from_start() const { return solved.from_start; }
  double failure_rate() const { return solved.quasi.failure_rate; }
};

double inner(const std::vector<double>& a, const std::vector<double>& b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

// Returns nothing if the nodes are too few to see where the launch lands or to lead to rest, or so few that
// interpolation makes nonsense of it.
std::optional<Level> solve(const Problem& problem, const ExactRows& rows, std::size_t panels) {
  const markov::NodeSpace space = rows.space(panels);
  markov::SampledChain chain = rows.chain(problem, space).chain;
  const markov::Launch& launch = chain.launch;
  if (std::accumulate(launch.after.begin(), launch.after.end(), launch.rest) < 1 - most_unseen) return std::nullopt;
  const markov::Reachability reach = markov::classify(chain.chain);
  if (std::find(reach.must_rest.begin(), reach.must_rest.end(), 0) != reach.must_rest.end()) return std::nullopt;
  std::optional<SolvedChain> solved;
  try {
    solved.emplace(chain);
  } catch (const markov::ConvergenceError&) {
    if (!rows.collocated()) throw;
    return std::nullopt;
  } catch (const std::domain_error&) {  // from some node no entry leads to rest
    return std::nullopt;
  }
  Level level{space, std::move(chain), *std::move(solved)};
  const std::vector<double>& mean = level.solved.mean;
  int worst = 0;
  for (int p = 1; p < space.phases(); ++p)
    if (mean[static_cast<std::size_t>(p) * space.nodes()] < mean[static_cast<std::size_t>(worst) * space.nodes()])
      worst = p;
  const double lowest = problem.map.state_interval(worst).first;
  level.worst_start = 1 + inner(rows.launch(problem, space, {[lowest](double) { return lowest; }, worst}).after, mean);
  if (level.from_start() >= 1 && level.worst_start >= 1 && level.failure_rate() > 0) return level;
  return std::nullopt;
}

// Halves the launch's quadrature until the expected steps settle: a launch that spreads wider than its landings meets
// rows that differ more than the coarsest sees. Returns the last change, relative.
double refine_launch(const Problem& problem, const ExactRows& rows, double settled, Level& level) {
  double change = 0;
  for (int halvings = 1; halvings <= most_halvings; ++halvings) {
    level.chain.launch = rows.launch(problem, level.space, problem.launch, halvings);
    const double steps = 1 + inner(level.chain.launch.after, level.solved.mean);
    change = std::abs(std::log(steps / level.from_start()));
    level.solved.from_start = steps;
    if (change <= settled) break;
  }
  return change;
}

// Follows the error left in one result after each refinement. Two levels may agree by chance, and the corner of the
// density leaves an error that comes and goes with the nodes: so never less than the last change, and the one before
// has its say. `rows` is the rows' own, which no node removes.
class ErrorLeft {
 public:
  explicit ErrorLeft(double rows) : rows_(rows) {}
  void refine(double fine, double coarse) {
    const double change = std::abs(std::log(fine) - std::log(coarse));
    error_ = rows_ + safety * std::sqrt(change * std::max(change, before_));
    before_ = change;
  }
  double error() const { return error_; }

 private:
  double rows_, before_ = 0, error_ = 0;
};

// Steps through 1, 2, 3, 4, 6, 8, 12, 16, ...
std::size_t more(std::size_t panels) {
  const bool power = (panels & (panels - 1)) == 0;
  return panels == 1 ? 2 : power ? panels + panels / 2 : panels / 3 * 4;
}

Estimate estimate(double value, double error) { return {value, value * std::exp(-error), value * std::exp(error)}; }

// The last two levels of nodes, and the errors left in what the finer one says.
struct Refinement {
  explicit Refinement(double rows) : steps_error(rows), rate_error(rows), worst_error(rows) {}
  // Makes the finer level the coarser one, before the next is solved: three would need half as much memory again.
  void make_room() { coarse = std::move(fine); }
  void add(std::optional<Level> level) {
    fine = std::move(level);
    if (!coarse || !fine) return;
    steps_error.refine(fine->from_start(), coarse->from_start());
    rate_error.refine(fine->failure_rate(), coarse->failure_rate());
    worst_error.refine(fine->worst_start, coarse->worst_start);
    error = std::max(steps_error.error(), rate_error.error());
  }
  bool meets(double tolerance) const { return coarse && fine && error <= tolerance; }

  std::optional<Level> coarse, fine;
  ErrorLeft steps_error, rate_error, worst_error;
  double error = 0;
};

// Adds nodes until the errors are small enough, or to the number that is asked for.
// @throws markov::ConvergenceError if the last two levels are too few nodes for an answer
Refinement refined(const Problem& problem, const ExactRows& rows, const StudyOptions& options) {
  const bool free = options.cells == 0;
  const std::size_t most =
      (problem.map.phases() > 1 ? options.largest_cells / 2 : options.largest_cells) / rows.coarsest();
  const std::size_t given = (options.cells + rows.coarsest() - 1) / rows.coarsest();
  std::size_t panels = free ? first_panels : std::max<std::size_t>(1, given / 2);
  Refinement levels(rows.error());
  double done = 0.02;
  for (;;) {
    if (options.progress) options.progress(done, fmt::format("{} nodes", panels * rows.coarsest()));
    levels.make_room();
    levels.add(solve(problem, rows, panels));
    done += 0.5 * (0.95 - done);
    const bool last = free ? levels.meets(options.tolerance) || more(panels) > std::max<std::size_t>(most, 4)
                           : panels >= given && (given == 1 || levels.coarse || !levels.fine);
    if (last) break;
    panels = free ? more(panels) : std::max(given, panels + 1);
  }
  if (!levels.fine || !levels.coarse)
    throw markov::ConvergenceError(
        "integrated rows", 1,
        fmt::format("{} nodes are too few to follow the launch and lead to rest; method sampled may tell",
                    panels * rows.coarsest()));
  return levels;
}

// Returns the estimates with their errors; all else of a study is read off the chain.
// @param launch_error  of the expected steps, by the launch's quadrature
Metastability estimates(const Refinement& levels, double launch_error, const StudyOptions& options) {
  const Level& fine = *levels.fine;
  Metastability result;
  result.method = Method::integrated;
  result.cells = fine.space.nodes();
  result.steps.from_start = estimate(fine.from_start(), levels.steps_error.error() + launch_error);
  result.spectrum.failure_rate = estimate(fine.failure_rate(), levels.rate_error.error());
  result.steps.from_quasi_stationary = estimate(1 / fine.failure_rate(), levels.rate_error.error());
  result.steps.worst_start = estimate(fine.worst_start, levels.worst_error.error());
  for (Estimate* steps : {&result.steps.from_start, &result.steps.from_quasi_stationary, &result.steps.worst_start})
    steps->lower = std::max(1.0, steps->lower);
  result.spectrum.failure_rate.upper = std::min(1.0, result.spectrum.failure_rate.upper);
  result.steps.discretization_error = std::max(levels.error, levels.steps_error.error() + launch_error);
  if (result.steps.discretization_error > options.tolerance) {
    const bool free = options.cells == 0;
    result.status = free ? Status::tolerance_not_met : Status::fixed_resolution;
    if (free)
      result.message = fmt::format("tolerance {} not met: the error left is {:.2g} at {} nodes", options.tolerance,
                                   result.steps.discretization_error, result.cells);
  }
  return result;
}

// Returns the probability of surviving the course, with an interval for what the last refinement and the launch leave
// open.
Estimate reach_end(const Problem& problem, const Level& fine, const Level& coarse, double rows_error,
                   double launch_error, const StudyOptions& options) {
  const auto told = [&](const Level& one) {
    return std::clamp(*asked_reach_end(problem, one.solved, one.chain.launch, options), 0.0, 1.0);
  };
  const double both[] = {told(fine), told(coarse)};
  const SurvivalScale scale(both);
  return scale.interval(both[0], rows_error + launch_error + safety * std::abs(scale.at(both[0]) - scale.at(both[1])));
}

}  // namespace

Metastability integrated_study(const Problem& problem, const StudyOptions& options) {
  const auto tell = [&](double done, const std::string& what) {
    if (options.progress) options.progress(done, what);
  };
  const RestReachability reach = rest_reachability(problem);
  if (!reach.certain || reach.safe_state) {
    StudyOptions sampled = options;
    sampled.method = Method::sampled;
    return study(problem, sampled);
  }
  tell(0, "pilot");
  const ExactRows rows(problem, options.tolerance, options.threads);
  if (rows.unresolved()) return rest_unresolved(problem, options, "only by noise beyond probabilities of 1e-300");

  Refinement levels = refined(problem, rows, options);
  Level &fine = *levels.fine, &coarse = *levels.coarse;
  const double launch_error = refine_launch(problem, rows, options.tolerance / 10, fine);
  Metastability result = estimates(levels, launch_error, options);
  result.steps.safe_state = reach.safe_state;
  tell(0.96, "summary");
  const std::span<const double> states = fine.space.states();
  summarize(problem, fine.space.cells(), states, fine.chain, fine.solved, options, result);
  if (options.reach_end_interval && problem.last_event)
    result.steps.reach_end_interval = reach_end(problem, fine, coarse, rows.error(), launch_error, options);
  if (!options.brief) compare_survivors(problem, coarse.space.states(), coarse.chain, coarse.solved, result);
  add_landing_error(result, landing_error(problem, result.phases, states, fine.chain, fine.solved, options),
                    options.tolerance);
  return result;
}

}  // namespace metastable::analysis
