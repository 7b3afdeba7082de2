#include "markov/splitting/level_pilot.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <utility>
#include <vector>

#include "markov/dense_matrix.h"
#include "markov/splitting/learnt_level.h"
#include "markov/splitting/stratified_scores.h"
#include "markov/transition_rows/score_lattice.h"

namespace metastable::markov {
namespace {

constexpr int refinements = 3;
constexpr std::uint64_t enough_failures = 50;  // replicas
constexpr double first_spread = 64;            // [steps]
constexpr double shortest_spread = 30;         // [steps]
constexpr std::size_t kept_times = 60;         // steps of which visits are kept
constexpr double frequent_failures = 0.003;    // a step: rounds that are not split see hundreds of them
constexpr std::uint64_t pairs_stream = 0xa000;

class Pilot {
 public:
  Pilot(const BatchMap& map, std::span<const double> start, const PilotOptions& options)
      : map_(map), options_(options), ensemble_(map, start, options.replicas, options.seed, options.stream) {
    visits_.phases.resize(static_cast<std::size_t>(map.phases));
  }

  LevelPilot run() {
    if (!settle()) return finish(true);
    pilot_.window = revolutions(1.5 * pilot_.mixing_steps);
    if (!(options_.level && options_.always) &&
        -std::log(ensemble_.survival()) > frequent_failures * static_cast<double>(ensemble_.steps()))
      return finish(false);
    const std::uint64_t window = pilot_.window;
    Levels levels{options_.level ? options_.level : distance_level(frames_, map_.dimension), {}};
    const std::uint64_t failed_before = ensemble_.failures(), calls_before = calls();
    std::uint64_t failed = 0;
    auto steps = std::max(window, revolutions(shortest_spread));
    std::size_t bins = 0;
    const auto push = [&] {
      if (calls() - calls_before > options_.most_calls)
        throw NoSplitting(fmt::format(
            "splitting: {} in {} steps of the map, pushed as far from the middle as they go: no number is "
            "given",
            failed == 0 ? "nothing fails" : fmt::format("only {} replicas fail", failed), calls() - calls_before));
      split(levels);
      // If no bin was added, few replicas reach beyond the last one, and the next spread gives them more steps.
      const std::size_t now = levels.edges.front().size();
      if (now <= bins) steps += revolutions(static_cast<double>(steps) / 2);
      bins = now;
      spread(steps);
      failed = ensemble_.failures() - failed_before;
      return !ensemble_.all_failed();
    };
    do
      if (!push()) return finish(true);
    while (failed < enough_failures);
    std::uint64_t lesson = 0;
    for (int k = 0; k < refinements;) {
      if (!options_.level) {
        LearntLevel learnt = learn_level(map_, frames_, visits_, levels.edges,
                                         {.anchors = options_.replicas,
                                          .window = static_cast<int>(window),
                                          .seed = options_.seed,
                                          .stream = options_.stream + 100 * lesson++});
        more_calls_ += learnt.calls;
        if (!learnt.level) {  // Replicas have failed before, but no state that is visited now leads to failure.
          if (!push()) return finish(true);
          continue;
        }
        pilot_.window = static_cast<std::uint64_t>(learnt.window);
        levels.level = std::move(learnt.level);
      }
      ++k;
      split(levels);
      spread(std::max(2 * pilot_.window, revolutions(shortest_spread)));
      if (ensemble_.all_failed()) return finish(true);
    }
    split(levels);
    pilot_.levels = std::move(levels);
    return finish(false);
  }

 private:
  LevelPilot finish(bool all_fail) {
    pilot_.all_fail = all_fail;
    pilot_.calls = calls();
    return std::move(pilot_);
  }

  std::uint64_t calls() const { return ensemble_.calls() + more_calls_; }

  std::uint64_t revolutions(double steps) const {
    const auto phases = static_cast<double>(map_.phases);
    return static_cast<std::uint64_t>(std::max(1.0, std::ceil(steps / phases)) * phases);
  }

  /// Walks on and keeps visits of the steps' second half, of so many times at most.
  void spread(std::uint64_t steps) {
    visits_.clear();
    const auto phases = static_cast<std::uint64_t>(map_.phases);
    const std::uint64_t kept = std::max<std::uint64_t>(1, (steps / 2 + kept_times - 1) / kept_times);
    for (std::uint64_t n = 0; n < steps && !ensemble_.all_failed(); ++n) {
      share_ = ensemble_.advance();
      if (options_.told) options_.told();
      if (2 * n + 2 * phases >= steps && n / phases % kept == 0) visits_.add(ensemble_);
    }
  }

  /// Lets the start be forgotten, and finds coordinates and how long memory lasts. Returns whether walks are left.
  bool settle() {
    std::uint64_t steps = revolutions(first_spread);
    for (;;) {
      const bool first = ensemble_.steps() == 0;
      spread(steps);
      if (ensemble_.all_failed() || (first && ensemble_.survival() < hardly_any * share_)) return false;
      frames_.clear();
      for (const Visits::Phase& phase : visits_.phases) frames_.emplace_back(map_, phase);
      pilot_.mixing_steps = mixing();
      if (4 * pilot_.mixing_steps <= static_cast<double>(ensemble_.steps())) return true;
      if (calls() > options_.most_calls)
        throw NoSplitting(fmt::format(
            "splitting: the start is not forgotten within {} steps (memory lasts some {:.3g}, by what is seen of "
            "it): no number is given",
            ensemble_.steps(), pilot_.mixing_steps));
      steps = revolutions(std::min(4 * pilot_.mixing_steps, 4.0 * static_cast<double>(ensemble_.steps())));
    }
  }

  /// Regresses states on those a revolution before.
  double mixing() {
    const auto d = static_cast<std::size_t>(map_.dimension), s = static_cast<std::size_t>(map_.scores);
    const Visits::Phase& visits = visits_.phases[0];
    const std::size_t n = std::min<std::size_t>(visits.weights.size(), 4000);
    std::vector<double> states, scores(n * s), next(n * d), weight;
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t from = i * visits.weights.size() / n;
      states.insert(states.end(), &visits.states[from * d], &visits.states[from * d] + d);
    }
    const std::vector<double> first = states;
    std::vector<std::uint8_t> failed(n);
    std::vector<std::uint64_t> words(n);
    std::vector<std::size_t> alive(n);
    std::iota(alive.begin(), alive.end(), std::size_t{0});
    Eigen::VectorXd weights = Eigen::VectorXd::Ones(static_cast<Eigen::Index>(n));
    for (int phase = 0; phase < map_.phases && !alive.empty(); ++phase) {
      const std::size_t m = alive.size();
      const std::uint64_t stream = pairs_stream + (options_.stream << 16);
      scores.resize(m * s), next.resize(m * d), failed.assign(m, 0), words.resize(m), weight.resize(m);
      if (s > 0) stratified_scores(options_.seed, stream, static_cast<std::uint64_t>(phase), scores, weight);
      for (std::size_t i = 0; i < m; ++i)
        words[i] = random_words(options_.seed, stream, i, static_cast<std::uint64_t>(phase))[0];
      if (s > 0)
        checked_step(map_, phase, states, scores, next, failed);
      else
        checked_draw(map_, phase, states, words, next, failed);
      more_calls_ += m;
      std::size_t left = 0;
      for (std::size_t i = 0; i < m; ++i) {
        if (s > 0) weights[static_cast<Eigen::Index>(alive[i])] *= weight[i];
        if (failed[i]) continue;
        alive[left] = alive[i];
        std::copy_n(&next[i * d], d, &states[left++ * d]);
      }
      alive.resize(left), states.resize(left * d);
    }
    if (alive.size() < 4 * d) return static_cast<double>(map_.phases);
    const Eigen::MatrixXd among = placed(first), before = ranks(among, among), landed = ranks(placed(states), among);
    Eigen::MatrixXd after =
        Eigen::MatrixXd::Zero(before.rows(), before.cols());  // what fails is recycled, and forgotten
    for (std::size_t i = 0; i < alive.size(); ++i)
      after.row(static_cast<Eigen::Index>(alive[i])) = landed.row(static_cast<Eigen::Index>(i));
    const Eigen::MatrixXd weighted = before.transpose() * weights.asDiagonal();
    const Eigen::MatrixXd gram =
        weighted * before + 1e-3 * static_cast<double>(n) * Eigen::MatrixXd::Identity(before.cols(), before.cols());
    const double radius = spectral_radius(solve_columns(gram, weighted * after));
    return map_.phases * std::max(1.0, std::log(left_of_memory) / std::log(std::clamp(radius, 1e-3, 0.9999)));
  }

  /// Returns the coordinates of states of phase 0, row by row.
  Eigen::MatrixXd placed(std::span<const double> states) const {
    const auto d = static_cast<std::size_t>(map_.dimension);
    Eigen::MatrixXd found(states.size() / d, d);
    std::vector<float> at(d);
    for (Eigen::Index i = 0; i < found.rows(); ++i) {
      frames_[0].place(states.subspan(static_cast<std::size_t>(i) * d, d), at);
      for (std::size_t k = 0; k < d; ++k) found(i, static_cast<Eigen::Index>(k)) = static_cast<double>(at[k]);
    }
    return found;
  }

  /// Returns what the memory is regressed on: the rank of each coordinate among those of `among`, from -1 to 1, and its
  /// square, which sees memory that is not linear (a state whose sign is drawn anew), less their means. Of coordinates
  /// themselves the few walks that are falling, and grow without bound, would make up the regression.
  static Eigen::MatrixXd ranks(const Eigen::MatrixXd& coordinates, const Eigen::MatrixXd& among) {
    Eigen::MatrixXd found(coordinates.rows(), 2 * coordinates.cols());
    for (Eigen::Index k = 0; k < coordinates.cols(); ++k) {
      std::vector<double> sorted(among.col(k).begin(), among.col(k).end());
      std::ranges::sort(sorted);
      for (Eigen::Index i = 0; i < coordinates.rows(); ++i) {
        const auto below = std::ranges::lower_bound(sorted, coordinates(i, k)) - sorted.begin();
        const double rank = 2 * static_cast<double>(below) / static_cast<double>(sorted.size()) - 1;
        found(i, k) = rank, found(i, coordinates.cols() + k) = rank * rank;
      }
    }
    return found.rowwise() - found.colwise().mean();
  }

  /// Gives the visits these levels, and the ensemble edges between them.
  void split(Levels& levels) {
    const auto d = static_cast<std::size_t>(map_.dimension);
    for (std::size_t p = 0; p < visits_.phases.size(); ++p) {
      Visits::Phase& visits = visits_.phases[p];
      levels.level(static_cast<int>(p), visits.states, visits.levels);
      for (std::size_t i = 0; i < visits.levels.size(); ++i)
        if (!std::isfinite(visits.levels[i]))
          throw MapError(fmt::format("level function: it is {} at the state {} (phase {}), a finite number expected",
                                     visits.levels[i], describe_state(map_, std::span(visits.states).subspan(i * d, d)),
                                     p));
    }
    levels.edges = quantile_edges(visits_);
    ensemble_.set_levels(levels);
  }

  const BatchMap& map_;
  const PilotOptions& options_;
  WeightedEnsemble ensemble_;
  double share_ = 0;  // that failed in the last step
  Visits visits_;
  std::vector<VisitFrame> frames_;
  LevelPilot pilot_;
  std::uint64_t more_calls_ = 0;
};

}  // namespace

LevelPilot level_pilot(const BatchMap& map, std::span<const double> start, const PilotOptions& options) {
  return Pilot(map, start, options).run();
}

}  // namespace metastable::markov
