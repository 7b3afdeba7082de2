#include "analysis/machine_model/score_plan.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "analysis/machine_model/machine_stepper.h"

namespace metastable::analysis {
namespace {

constexpr double straight_share = 1e-3;  // of a slope, by which the map of a straight score may bend
constexpr double tried_score = 1.7320508075688772;
constexpr double far_score = 4.5;  // beyond it no failure is sought
constexpr std::size_t on_a_lattice = 2;

// The findings about each score: the largest second difference as a share of the slope, and how often it leads to
// failure.
struct Told {
  std::vector<double> bends, fails;
  bool ever = false;  // some point failed
};

// The measured states, those that were not measured at their launch's mean, or else at the mean of their column.
std::vector<Eigen::VectorXd> measured_states(const Machine& machine, const MachineRuns& runs,
                                             std::vector<TransitionPlace>& places) {
  std::vector<Eigen::VectorXd> all;
  Eigen::VectorXd usual = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(machine.states.size()));
  for (std::size_t j = 0; j < machine.observe.size(); ++j)
    usual[static_cast<Eigen::Index>(machine.state_index(machine.observe[j].state))] = column_spread(runs, j).mean;
  for (const MachineLaunch& launch : machine.launches)
    usual[static_cast<Eigen::Index>(machine.state_index(launch.state))] = launch.mean;
  for (std::size_t t = 0; t < runs.trials.size(); ++t)
    for (std::size_t k = 0; k < runs.trials[t].rows.size(); ++k) {
      if (k + 1 == runs.trials[t].rows.size() && runs.trials[t].outcome != MachineOutcome::failed) continue;
      Eigen::VectorXd state = usual;
      for (std::size_t j = 0; j < machine.observe.size(); ++j)
        if (const double seen = runs.trials[t].rows[k].seen[j]; !std::isnan(seen))
          state[static_cast<Eigen::Index>(machine.state_index(machine.observe[j].state))] = seen;
      all.push_back(std::move(state));
      places.push_back({t, k, 0});
    }
  return all;
}

// Points of one row: the middle, pairs at sqrt 3, pairs far out, and one for each two scores together.
std::vector<Eigen::VectorXd> tried_scores(Eigen::Index scores) {
  std::vector<Eigen::VectorXd> all{Eigen::VectorXd::Zero(scores)};
  for (Eigen::Index m = 0; m < scores; ++m)
    for (const double z : {tried_score, -tried_score, far_score, -far_score})
      all.push_back(z * Eigen::VectorXd::Unit(scores, m));
  for (Eigen::Index m = 0; m < scores; ++m)
    for (Eigen::Index o = 0; o < m; ++o)
      all.push_back(tried_score * (Eigen::VectorXd::Unit(scores, m) + Eigen::VectorXd::Unit(scores, o)));
  return all;
}

void look(Told& told, const MachineStepper& stepper, std::size_t first, const std::vector<double>& scale) {
  const std::size_t scores = told.bends.size(), cross = first + 1 + 4 * scores;
  const auto at = [&](std::size_t point, std::size_t state) {
    return stepper.next(point)[static_cast<Eigen::Index>(state)];
  };
  const auto lives = [&](std::size_t point) { return !stepper.failed(point); };
  for (std::size_t s = 0; s < scale.size() && lives(first); ++s) {
    const double centre = at(first, s);
    double slope = 0;
    for (std::size_t m = 0; m < scores; ++m) {
      const std::size_t pair = first + 1 + 4 * m;
      if (lives(pair) && lives(pair + 1))  // Both sides move alike where the map folds in a score.
        slope += std::abs(at(pair, s) - centre) + std::abs(at(pair + 1, s) - centre);
    }
    if (!(slope > 1e-9 * scale[s])) continue;
    std::size_t point = cross;
    for (std::size_t m = 0; m < scores; ++m) {
      const std::size_t pair = first + 1 + 4 * m;
      if (lives(pair) && lives(pair + 1))
        told.bends[m] = std::max(told.bends[m], std::abs(at(pair, s) + at(pair + 1, s) - 2 * centre) / slope);
      for (std::size_t o = 0; o < m; ++o, ++point) {
        if (!lives(point) || !lives(pair) || !lives(first + 1 + 4 * o)) continue;
        const double mixed = std::abs(at(point, s) - at(pair, s) - at(first + 1 + 4 * o, s) + centre) / slope;
        told.bends[m] = std::max(told.bends[m], mixed);
        told.bends[o] = std::max(told.bends[o], mixed);
      }
    }
  }
  for (std::size_t m = 0; m < scores; ++m)
    for (std::size_t z = 0; z < 4; ++z) {
      told.fails[m] += stepper.failed(first + 1 + 4 * m + z) != stepper.failed(first);
      told.ever = told.ever || stepper.failed(first + 1 + 4 * m + z);
    }
}

// Scores that fail come first, then those that bend most.
ScorePlan planned(const Told& told, bool failed) {
  ScorePlan plan;
  const auto most = std::ranges::max_element(told.fails);
  if (failed || told.ever || *most > 0) {
    plan.failing = static_cast<std::size_t>(most - told.fails.begin());
    plan.lattice.push_back(*plan.failing);
  }
  std::vector<std::size_t> order(told.bends.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, [&](std::size_t a, std::size_t b) {
    return std::pair(told.fails[a], told.bends[a]) > std::pair(told.fails[b], told.bends[b]);
  });
  for (const std::size_t m : order) {
    if (plan.failing == m || !(told.fails[m] > 0 || told.bends[m] > straight_share)) continue;
    if (plan.lattice.size() < on_a_lattice)
      plan.lattice.push_back(m);
    else
      plan.others_fail = plan.others_fail || told.fails[m] > 0;
  }
  return plan;
}

}  // namespace

ScorePlan score_plan(const Machine& machine, const MachineRuns& runs, const MachineHypothesis& nominal) {
  MachineStepper stepper(machine, runs, nominal);
  if (stepper.size() != stepper.states())
    throw std::invalid_argument("score_plan: a hypothesis without spreads and memory is expected");
  const auto scores = static_cast<std::size_t>(machine.scores);
  std::vector<TransitionPlace> places;
  const std::vector<Eigen::VectorXd> states = measured_states(machine, runs, places);
  const std::vector<Eigen::VectorXd> tried = tried_scores(machine.scores);
  for (std::size_t i = 0; i < states.size(); ++i)
    for (const Eigen::VectorXd& fresh : tried) stepper.add(places[i], states[i], fresh);
  stepper.run();
  std::vector<double> scale(machine.states.size(), 0.0);
  for (std::size_t i = 0; i < states.size(); ++i)
    for (std::size_t s = 0; s < scale.size(); ++s)
      scale[s] = std::max(scale[s], std::abs(states[i][static_cast<Eigen::Index>(s)]));
  Told told{std::vector<double>(scores), std::vector<double>(scores), false};
  std::size_t went_on = 0, lost = 0, last_lost = 0;
  for (std::size_t i = 0; i < states.size(); ++i) {
    if (stepper.lost(i * tried.size()))
      throw std::invalid_argument(fmt::format("step: no finite state comes of trial {}, row {}",
                                              runs.name_of(places[i].trial), places[i].row + 1));
    look(told, stepper, i * tried.size(), scale);
    if (places[i].row + 1 == runs.trials[places[i].trial].rows.size()) continue;
    ++went_on;
    if (!stepper.failed(i * tried.size())) continue;
    ++lost;
    last_lost = i;
  }
  if (2 * lost > went_on)
    throw FailsFromMostRows(
        fmt::format("step: fails without noise from {} of {} rows that went on, as from trial {}, "
                    "row {}",
                    lost, went_on, runs.name_of(places[last_lost].trial), places[last_lost].row + 1));
  return planned(told, std::ranges::any_of(runs.trials, [](const MachineTrial& trial) {
                   return trial.outcome == MachineOutcome::failed;
                 }));
}

}  // namespace metastable::analysis
