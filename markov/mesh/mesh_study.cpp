#include "markov/mesh/mesh_study.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <mutex>
#include <stdexcept>

#include "markov/mesh/batch_simulation.h"
#include "markov/mesh/coupled_passage.h"
#include "markov/mesh/guided_sampling.h"
#include "markov/mesh/joined_steps.h"
#include "markov/mesh/mesh_passage.h"
#include "markov/mesh/noise_frame.h"
#include "markov/mesh/other_gaits.h"
#include "markov/mesh/study_orbit.h"
#include "markov/normal_95.h"
#include "markov/parallel.h"
#include "markov/size_extrapolation.h"
#include "markov/transition_rows/score_lattice.h"
#include "markov/work_left.h"

namespace metastable::markov {
namespace {

constexpr double disagrees = 1.7;         // joint half-widths: 99.9 % of the normal
constexpr double sampled_windows = 3;     // of guided samples: within one, failures are still few
constexpr int longest_window = 200;       // of guided samples [steps]
constexpr double least_even_share = 0.5;  // effective samples a sample: below, their scatter tells too small an error
constexpr double sampled_from = 100;      // expected steps above which guided samples settle before they fail
constexpr std::size_t enough_trials = 4000;  // Failures of so many trials tell as much (1.6 %) as guided samples.
constexpr double widest = 4;        // of the interval: its end over its beginning, beyond which it is no answer
constexpr double most_blind = 0.1;  // of the failures, in blind spots: beyond, bands are stepped over
constexpr double row_error = 5e-4;  // what reading rows off curves may leave, about so much
// In an interval of up to the first half-width, shifts may scatter as much as what else it holds, up to the second by
// this share of it; the parts of a wider one are told by all shifts.
constexpr double narrow = 0.01, wide = 0.1, little_scatter = 0.5;
constexpr std::size_t fewest_shifts = 3, most_trials = 10000000;  // so many trials leave 0.03 % of the steps
// A simulation of fewer trials than this is replaced by walks that do not end at a failure, with half of the steps that
// the trials would have: an eighth of a quick study's time.
constexpr double least_counted_share = 0.5;
// A pilot of one trial in sixteen, of 8 to 128, sees whether trials end within four times the expected steps: of 8, 7
// at least do.
constexpr std::size_t pilot_share = 16, pilot_least = 8, pilot_most = 128;
constexpr double pilot_steps = 4;
// States of a row where the chance of failing jumps, by dimension: of 32 in one dimension shifts differ by 4 per cent.
constexpr std::array<int, 4> row_states_by_dimension{256, 32, 16, 16};
constexpr double memory_side_by_side = 0.5;  // of all: for the meshes of a dear map that grow side by side
constexpr double longest_trial_factor = 30;  // times the expected steps: one trial of 1e13 takes longer

/// Returns the coarsest spacings that the extrapolation was found to bear, by dimension.
double coarsest(int dimension) {
  constexpr std::array<double, 4> spacing{0.32, 0.5, 0.7, 1.0};
  return spacing[static_cast<std::size_t>(dimension - 1)];
}

double coarsest_spacing(const BatchMap& map, const MeshStudyOptions& options) {
  return options.spacing > 0 ? options.spacing : coarsest(map.dimension);
}

double half_width(const MeshEstimate& e) { return 0.5 * std::log(e.upper / e.lower); }

/// Returns the simulations of a study: of about `simulated_steps` steps.
SimulationOptions walking(const MeshStudyOptions& options) {
  return {.seed = options.seed, .threads = options.threads, .most_steps = options.simulated_steps};
}

/// Makes one study.
class Run {
 public:
  /// @param map  as often round as a revolution of the meshes is
  Run(const BatchMap& map, std::span<const double> start, const MeshStudyOptions& options, StudyOrbit around)
      : map_(map),
        start_(start),
        options_(options),
        frames_(around.frames),
        own_(std::move(around.own)),
        sizes_(options.sizes > 0    ? static_cast<std::size_t>(options.sizes)
               : map.dimension == 4 ? 4
                                    : 3),
        most_shifts_(static_cast<std::size_t>(options.shifts)),
        at_once_(map.dear ? 1 : std::min(thread_count(options.threads), options.shifts)),
        steps_(most_shifts_, std::vector<double>(sizes_)),
        rates_(steps_),
        brackets_(steps_),
        hazards_(most_shifts_, std::vector<ForetoldHazard>(sizes_)) {
    study_.sizes.resize(sizes_);
    study_.orbit = std::move(around.orbit);
    study_.period = around.period;
    study_.fails_without_noise = around.fails_without_noise;
    study_.longer_period = around.longer_period;
    study_.frames = std::move(around.frames);
    map_.step = [this, step = map.step](int phase, auto states, auto scores, auto next, auto failed) {
      step(phase, states, scores, next, failed);
      const std::lock_guard lock(mutex_);
      work_.advance(static_cast<double>(failed.size()));
      tell();
    };
  }
  Run(const Run&) = delete;
  Run& operator=(const Run&) = delete;

  MeshStudy run() {
    foresee_memory();
    while (shifts_ < most_shifts_ && !settled()) {
      if (shifts_ > 0) foresee_shifts(1);
      make_shifts(std::max(fewest_shifts, shifts_ + 1));
      join();
    }
    list_sizes();
    over(meshes_stage);
    foresee_other_ways(study_.steps.value, study_.mixing_steps);
    if (study_.steps.upper > widest * study_.steps.lower)
      study_.disagreement = fmt::format(
          "the meshes do not converge ({:.4g} steps, {:.4g} to {:.4g}){}", study_.steps.value, study_.steps.lower,
          study_.steps.upper,
          options_.simulated_steps > 0 ? "; " + walks_in_words(map_, start_, walking(options_)).first : std::string());
    if (study_.disagreement.empty()) simulate();
    over(simulation_stage);
    if (study_.disagreement.empty()) see_blind_spots();
    if (!study_.disagreement.empty()) return std::move(study_);
    sample();
    if (study_.disagreement.empty() && study_.guided)
      study_.disagreement = disagreement("the mesh", study_.steps, "guided sampling", *study_.guided);
    return std::move(study_);
  }

 private:
  MeshOptions mesh_options(std::size_t size, std::size_t shift) {
    MeshOptions one{.spacing = coarsest_spacing(map_, options_) / std::pow(std::sqrt(2.0), static_cast<double>(size)),
                    .seed = options_.seed,
                    .shift = static_cast<std::uint32_t>(shift),
                    .margin = options_.margin > 0 ? options_.margin
                              : map_.scores == 1  ? 12.0
                                                  : 16.0,
                    .score_spacing = study_score_spacing(map_),
                    .most_bytes = options_.most_bytes / static_cast<std::size_t>(at_once_)};
    one.row_states = study_.row_states;
    if (!several_gaits()) return one;
    return with_gaits(one, study_.gaits);
  }

  /// Makes the meshes of all sizes of further shifts, up to so many in all.
  void make_shifts(std::size_t up_to) {
    // The long ones come first; the very last, the first shift of the coarsest size, has been made.
    const std::size_t more = up_to - shifts_, tasks = sizes_ * more - (shifts_ == 0 ? 1 : 0);
    const auto make = [&](std::size_t task, const BatchMap& map) {
      const std::size_t size = sizes_ - 1 - task / more, shift = up_to - 1 - task % more;
      auto mesh = std::make_unique<Mesh>(map, frames_, start_, mesh_options(size, shift));
      solve(*mesh, size, shift);
      if (guides(size, shift)) guide_ = std::move(mesh);
    };
    if (map_.dear)
      joined_for(map_, tasks, static_cast<std::size_t>(at_once_), options_.threads, make);
    else
      parallel_for(tasks, at_once_, [&](std::size_t task) { make(task, map_); });
    shifts_ = up_to;
  }

  /// Returns whether a mesh is kept for guided samples.
  bool guides(std::size_t size, std::size_t shift) const {
    return options_.guided_samples > 0 && !several_gaits() && size == 1 && shift == 0;
  }

  bool several_gaits() const { return study_.gaits.orbits.size() > 1; }

  CoupledPassage passage_of(const Mesh& mesh) const {
    return passage_with_gaits(mesh, start_, study_.gaits.orbits, frames_);
  }

  /// Looks for other gaits around the coarsest mesh, and solves that, grown anew where there are some. Returns its
  /// bytes.
  std::size_t begin() {
    const MeshOptions alone = mesh_options(0, 0);
    auto spent = [this, rows = work_.done(), at = work_.seconds()]() mutable {
      const Spent now{work_.done() - rows, work_.seconds() - at};
      rows += now.rows;
      at += now.seconds;
      return now;
    };
    const Mesh mesh(map_, frames_, start_, alone);
    coarsest_ = spent();
    study_.gaits.orbits = {own_};
    if (study_.period > 0) study_.gaits = find_other_gaits(map_, frames_, own_, start_, mesh, alone);
    searched_ = spent();
    if (!study_.gaits.trap.empty()) throw Disagreement("mesh study: " + study_.gaits.trap + ": no number is given");
    if (!several_gaits() && !failing_jumps(map_, frames_, mesh, passage_of(mesh).passage.visits, alone))
      return solve(mesh, 0, 0);
    if (several_gaits()) {
      const Mesh with_all(map_, frames_, start_, mesh_options(0, 0));
      if (!failing_jumps(map_, frames_, with_all, passage_of(with_all).passage.visits, mesh_options(0, 0))) {
        coarsest_ = spent();
        return solve(with_all, 0, 0);
      }
    }
    study_.row_states = row_states_by_dimension[static_cast<std::size_t>(map_.dimension - 1)];
    spent();
    const Mesh averaged(map_, frames_, start_, mesh_options(0, 0));
    coarsest_ = spent();
    return solve(averaged, 0, 0);
  }

  /// Plans what is left once the coarsest mesh has told how long it takes.
  void foresee_work() {
    const double rows = std::max(1.0, coarsest_.rows), mesh_rate = coarsest_.seconds / rows;
    const double row_rate = searched_.seconds / std::max(1.0, searched_.rows);
    const int threads = map_.dear ? 1 : thread_count(options_.threads);
    const double all = static_cast<double>(fewest_shifts) * work_of_a_shift() - 1;
    const std::lock_guard lock(mutex_);
    work_.plan(rows * all, mesh_rate / (map_.dear ? 1 : at_once_));
    for (int other = 0; other < 2; ++other) work_.plan(0, row_rate / threads);
    tell();
  }

  /// Foresees the rows of so many more shifts.
  void foresee_shifts(std::size_t more) {
    const std::lock_guard lock(mutex_);
    work_.add(meshes_stage, static_cast<double>(more) * coarsest_.rows * work_of_a_shift());
    tell();
  }

  /// Foresees the rows of both other ways. @param steps, mixing  as far as they are known
  void foresee_other_ways(double steps, double mixing) {
    const auto allowed = static_cast<double>(options_.simulated_steps), expected = std::max(1.0, steps);
    const bool to_failure = allowed / expected >= static_cast<double>(fewest_trials) && !several_gaits();
    const double longest = least_counted_share * allowed / static_cast<double>(walk_count);
    const double simulated = to_failure ? std::min(allowed, static_cast<double>(most_trials) * expected)
                                        : static_cast<double>(walk_count) * expected * -std::expm1(-longest / expected);
    const std::lock_guard lock(mutex_);
    work_.replan(simulation_stage, simulated);
    const int forgets = forgetting_steps(std::min(mixing, steps_to_the_orbit()));
    const bool guided = options_.guided_samples > 0 && !several_gaits() && steps > sampled_from &&
                        allowed / expected < static_cast<double>(enough_trials) &&
                        steps > sampled_windows * std::min(forgets, longest_window);
    work_.replan(guided_stage, guided ? guided_rows(forgets, std::min(forgets, longest_window), 1 / steps) : 0);
    tell();
  }

  /// Returns the e-folding of the way back to an orbit of several revolutions: in which of them a walker is bears on no
  /// rate. Infinite for all others.
  double steps_to_the_orbit() const {
    if (own_.size() == 1) return std::numeric_limits<double>::infinity();
    const double modulus = std::clamp(std::abs(study_.orbit.eigenvalues.front()), 1e-6, 1 - 1e-6);
    return static_cast<double>(study_.orbit.frames.size()) / -std::log(modulus);
  }

  double guided_rows(int forgets, int window, double rate) const {
    const double lattice = static_cast<double>(
        ScoreLattice(map_.scores, GuidedOptions().score_spacing, sampled_reach(map_.scores, window, rate)).size());
    return static_cast<double>(options_.guided_samples) * (2 * forgets + window * lattice);
  }

  static int forgetting_steps(double mixing) { return 8 + static_cast<int>(std::ceil(8 * mixing)); }

  /// Says how far the work is; called with the lock.
  void tell() {
    if (options_.progress) options_.progress(work_.share());
  }

  void over(std::size_t stage) {
    const std::lock_guard lock(mutex_);
    work_.finish(stage);
    tell();
  }

  void foresee_memory() {
    // Nodes grow by the spacing's power at most, entries of a row by that of as many dimensions as landings fill.
    const double coarse = static_cast<double>(begin());
    const double growth = std::pow(std::sqrt(2.0), static_cast<double>(sizes_ - 1));
    const double finest = coarse * std::pow(growth, map_.dimension + std::min(map_.scores, map_.dimension));
    if (map_.dear)
      at_once_ = static_cast<int>(std::clamp(memory_side_by_side * static_cast<double>(options_.most_bytes) / finest,
                                             1.0, static_cast<double>(sizes_ * fewest_shifts - 1)));
    study_.expected_bytes = finest * at_once_;
    if (study_.expected_bytes > static_cast<double>(options_.most_bytes))
      throw std::length_error(fmt::format(
          "mesh study: its finest meshes, of spacing {:.3g}, would take about {:.2g} GB, {} at a time; {:.2g} GB are "
          "allowed",
          mesh_options(sizes_ - 1, 0).spacing, study_.expected_bytes / 0x1p30, at_once_,
          static_cast<double>(options_.most_bytes) / 0x1p30));
    foresee_work();
    foresee_other_ways(std::exp(steps_[0][0]), coarse_mixing_);
  }

  /// Returns the mesh's bytes.
  std::size_t solve(const Mesh& mesh, std::size_t size, std::size_t shift) {
    const double before = work_.seconds();
    CoupledPassage coupled = passage_of(mesh);
    MeshPassage& passage = coupled.passage;
    steps_[shift][size] = std::log(passage.steps);
    rates_[shift][size] = std::log(passage.failure_rate);
    brackets_[shift][size] = std::log(passage.steps / passage.steps_lower);
    if (size == 0 && shift == 0) {
      coarsest_.seconds += work_.seconds() - before;
      study_.blind_spots = find_blind_spots(map_, frames_, mesh, passage.visits, mesh_options(0, 0));
    }
    hazards_[shift][size] = {std::move(passage.survival), coupled.first_rate};
    const std::lock_guard lock(mutex_);
    if (size == 0 && shift == 0) coarse_mixing_ = passage.mixing_steps;
    if (guides(size, shift)) guide_settled_ = std::move(passage.distribution);
    if (shift > 0) return mesh.bytes();
    study_.sizes[size] = {mesh_options(size, 0).spacing, mesh.size(), mesh.entries(), {}};
    if (size + 1 < sizes_) return mesh.bytes();
    study_.mixing_steps = passage.mixing_steps;
    if (several_gaits()) {
      study_.gait_share = std::move(coupled.share);
      study_.gait_failures = failures_by_gait(mesh, start_, passage.visits, study_.gaits.orbits, frames_);
    }
    study_.cheapest_failure = mesh.cheapest_failure();
    return mesh.bytes();
  }

  double work_of_a_shift() const {
    double all = 0;
    for (std::size_t size = 0; size < sizes_; ++size)
      all += std::pow(2.0, 0.5 * static_cast<double>(size) * map_.dimension);
    return all;
  }

  void list_sizes() {
    for (std::size_t size = 0; size < sizes_; ++size)
      for (std::size_t shift = 0; shift < shifts_; ++shift)
        study_.sizes[size].steps.push_back(std::exp(steps_[shift][size]));
  }

  /// Returns whether further shifts would hardly narrow the intervals.
  bool settled() const {
    const double half = half_width(study_.steps);
    return shifts_ > 0 && shifts_scatter_ <= (half <= narrow ? 1 : half <= wide ? little_scatter : 0);
  }

  /// Joins the shifts made so far.
  void join() {
    for (std::size_t shift = 0; shift < shifts_; ++shift)
      study_.bracket = std::max(study_.bracket, std::ranges::max(brackets_[shift]));
    // What an extrapolation says of its own error grows with what it left out: as the square of the spacing.
    const double coarser = std::max(1.0, study_.sizes.front().spacing / coarsest(map_.dimension));
    const auto extrapolated = [this, coarser](const std::vector<std::vector<double>>& logs) {
      Extrapolated e = extrapolate_sizes(std::span(logs).first(shifts_));
      e.discretization_error = std::hypot(coarser * coarser * e.discretization_error, row_error);
      return e;
    };
    const Extrapolated by_steps = extrapolated(steps_), by_rate = extrapolated(rates_);
    shifts_scatter_ = std::max(by_steps.shift_error / (by_steps.discretization_error + study_.bracket),
                               by_rate.shift_error / (by_rate.discretization_error + study_.bracket));
    study_.shift_error = by_steps.shift_error;
    study_.discretization_error = by_steps.discretization_error;
    study_.steps = estimate_of(by_steps);
    study_.steps.lower *= std::exp(-study_.bracket);
    study_.failure_rate = estimate_of(by_rate);
    study_.failure_rate.upper *= std::exp(study_.bracket);
    const std::vector made(hazards_.begin(), hazards_.begin() + static_cast<std::ptrdiff_t>(shifts_));
    study_.survival = extrapolated_survival(made, study_.bracket, extrapolated);
    study_.later_rate = extrapolated_rate(made, study_.bracket, extrapolated);
  }

  /// Widens the intervals by what the mesh may not have seen, or says that it is too much.
  void see_blind_spots() {
    const BlindSpots& blind = study_.blind_spots;
    if (blind.missed > most_blind || blind.imagined > most_blind)
      study_.disagreement = fmt::format(
          "the mesh ({:.4g} steps) and random steps ({} of {} at random places end otherwise than those around them, "
          "and stand for {}) disagree",
          study_.steps.value, blind.hits, blind.probes,
          blind.missed > blind.imagined
              ? fmt::format("up to {:.2g} times as many failures as the mesh foretells, beside these", blind.missed)
              : fmt::format("up to {:.2g} times the failures that the mesh foretells, which are none", blind.imagined));
    study_.steps.lower /= 1 + blind.missed;
    study_.steps.upper *= 1 + blind.imagined;
    for (MeshEstimate* rate : {&study_.failure_rate, &study_.later_rate}) {
      rate->upper *= 1 + blind.missed;
      rate->lower /= 1 + blind.imagined;
    }
    for (MeshEstimate& share : study_.survival) {
      share.lower = std::pow(share.lower, 1 + blind.missed);
      share.upper = std::pow(share.upper, 1 / (1 + blind.imagined));
    }
  }

  ForetoldHazard hazard() const {
    std::vector<double> survival;
    for (const MeshEstimate& share : study_.survival) survival.push_back(share.value);
    return {std::move(survival), study_.later_rate.value, std::log(study_.steps.value / study_.steps.lower),
            std::log(study_.steps.upper / study_.steps.value)};
  }

  std::vector<std::uint64_t> follow(std::size_t walks, std::uint64_t longest) const {
    return follow_walks(map_, start_, longest, {.trials = walks, .seed = options_.seed, .threads = options_.threads});
  }

  /// Holds walks against the mesh, which they may refute.
  void see_failures(const std::vector<std::uint64_t>& walked, std::uint64_t longest) {
    study_.walks = count_failures(walked, longest, hazard());
    if (study_.walks->refutes(hazard()))
      study_.disagreement =
          fmt::format("the mesh ({:.4g} steps, {:.4g} to {:.4g}) and direct simulation ({}{}) disagree",
                      study_.steps.value, study_.steps.lower, study_.steps.upper, count_text(*study_.walks),
                      simulated_beside(map_, start_, walked, longest, walking(options_)));
  }

  void count(std::size_t walks, double longest) {
    const auto steps = static_cast<std::uint64_t>(std::max(1.0, std::ceil(longest)));
    see_failures(follow(walks, steps), steps);
  }

  static std::uint64_t longest_trial(double expected) {
    return static_cast<std::uint64_t>(std::max(1.0, std::ceil(longest_trial_factor * expected)));
  }

  /// Follows all trials of a dear map side by side without a pilot, whose calls would hold few rows; returns false if
  /// they take more steps than a pilot would allow.
  bool follow_in_time(std::size_t trials, double expected, std::vector<std::uint64_t>& steps) const {
    const double most = pilot_steps * expected * static_cast<double>(trials);
    const auto found = simulate_steps(map_, start_,
                                      {.trials = trials,
                                       .seed = options_.seed,
                                       .threads = options_.threads,
                                       .most_steps = static_cast<std::uint64_t>(std::min(most, 0x1p62))});
    if (!found) return false;
    steps = found->steps;
    for (std::uint64_t& n : steps)
      if (n > longest_trial(expected)) n = 0;
    return true;
  }

  void simulate() {
    const auto allowed = static_cast<double>(options_.simulated_steps), expected = std::max(1.0, study_.steps.value);
    const auto trials = static_cast<std::size_t>(std::min(allowed / expected, static_cast<double>(most_trials)));
    if (options_.simulated_steps == 0) {
      study_.no_simulated = "not asked for";
      return;
    }
    if (trials < fewest_trials || several_gaits()) {
      const std::size_t walks = std::clamp<std::size_t>(options_.simulated_steps, 2, walk_count);
      count(walks, std::floor(least_counted_share * allowed / static_cast<double>(walks)));
      study_.no_simulated =
          (several_gaits() ? "it would know one gait; " : "too few trials would fail; ") + count_text(*study_.walks);
      return;
    }
    std::vector<std::uint64_t> steps;
    if (!map_.dear || !follow_in_time(trials, expected, steps)) {
      count(std::clamp(trials / pilot_share, pilot_least, pilot_most), pilot_steps * expected);
      if (!study_.disagreement.empty()) return;
      steps = follow(trials, longest_trial(expected));
    }
    see_failures(steps, longest_trial(expected));
    if (!study_.disagreement.empty()) return;
    study_.walks.reset();
    const SimulatedSteps all = summarize_steps(std::move(steps));
    const double half = normal_95 * all.standard_error;
    study_.simulated = MeshEstimate{all.mean, all.mean - half, all.mean + half};
    study_.simulated_trials = trials;
    study_.disagreement = disagreement("the mesh", study_.steps, "direct simulation", *study_.simulated);
  }

  void sample() {
    study_.no_guided = options_.guided_samples == 0               ? "not asked for"
                       : several_gaits()                          ? "its samples would know one gait"
                       : study_.steps.value <= sampled_from       ? "not asked: failures are too frequent"
                       : study_.simulated_trials >= enough_trials ? "not asked: direct simulation tells as much"
                                                                  : "";
    if (!study_.no_guided.empty()) return;
    // It goes from the start to where failures keep their share: the time to forget the start, some times over. A
    // window too short to reach the failures from an ordinary state leaves the weight to a few rare ones, which few
    // samples meet: the rate comes out too low. So it is as long as the mesh foretells, and lengthened until the
    // weights are even.
    const int forgets = forgetting_steps(std::min(study_.mixing_steps, steps_to_the_orbit()));
    const BatchMap turns = over_revolutions(map_, static_cast<int>(own_.size()));
    GuidedRate guided;
    double even = 0;
    int window = reaching_window(*guide_, guide_settled_, std::min(forgets, longest_window));
    const auto foresee = [&] {
      const std::lock_guard lock(mutex_);
      const double rows = guided_rows(forgets, window, study_.failure_rate.value);
      guided.samples > 0 ? work_.add(guided_stage, rows) : work_.replan(guided_stage, rows);
    };
    for (; even < least_even_share; window = std::min(2 * window, longest_window)) {
      if (study_.steps.value <= sampled_windows * window) break;
      foresee();
      guided = guided_failure_rate(turns, *guide_, start_,
                                   {.samples = options_.guided_samples,
                                    .burn_in = std::min(2 * forgets, 60000),
                                    .window = window,
                                    .seed = options_.seed,
                                    .score_reach = sampled_reach(map_.scores, window, study_.failure_rate.value),
                                    .threads = options_.threads});
      even = guided.effective_samples / static_cast<double>(options_.guided_samples);
      if (window == longest_window) break;
    }
    study_.guided_samples = guided.samples;
    study_.no_guided =
        guided.samples > 0 ? "too few of its samples lead to failure to tell" : "not asked: failures are too frequent";
    if (!(guided.rate > 0)) return;
    const double half = normal_95 * guided.standard_error / guided.rate * std::max(1.0, least_even_share / even);
    if (!(half < 1)) return;                                                   // it tells nothing
    const double beyond = study_.steps.value - 1 / study_.failure_rate.value;  // what the start is worth
    const double sampled = 1 / guided.rate + beyond;
    study_.guided = MeshEstimate{sampled, sampled / (1 + half), sampled / (1 - half)};
    study_.no_guided.clear();
  }

  static constexpr std::size_t meshes_stage = 0, simulation_stage = 1, guided_stage = 2;  // stages of the work
  struct Spent {
    double rows = 0, seconds = 0;
  };

  BatchMap map_;  ///< which counts the rows that are stepped
  std::span<const double> start_;
  const MeshStudyOptions& options_;
  std::vector<NoiseFrame> frames_;
  GaitOrbit own_;                                 ///< states of phase 0, one for each revolution of the gait
  std::size_t sizes_, most_shifts_, shifts_ = 0;  ///< shifts_: made so far
  double shifts_scatter_ = 0;                     ///< t-interval over what else the interval holds
  int at_once_;                                   ///< meshes
  std::vector<std::vector<double>> steps_, rates_, brackets_;  ///< logs, [shift][size]
  std::vector<std::vector<ForetoldHazard>> hazards_;           ///< [shift][size], with the rate beyond
  MeshStudy study_;
  double coarse_mixing_ = 0;
  Spent coarsest_, searched_;          ///< on the coarsest mesh, on the search for other gaits
  std::unique_ptr<Mesh> guide_;        ///< of guided sampling
  std::vector<double> guide_settled_;  ///< MeshPassage::distribution
  std::mutex mutex_;
  WorkLeft work_;
};

std::string long_gait_in_words(int period) {
  if (period == 0) return "";
  return fmt::format("; without noise it comes back after {} revolutions, where meshes hold gaits of up to {}", period,
                     longest_period);
}

MeshStudy study_around(const BatchMap& map, std::span<const double> start, const MeshStudyOptions& options,
                       StudyOrbit around) {
  const std::string gait = long_gait_in_words(around.longer_period);
  try {
    return Run(map, start, options, std::move(around)).run();
  } catch (const NoFailureFound& error) {
    if (options.simulated_steps == 0) throw;
    const auto [found, fails] = walks_in_words(map, start, walking(options));
    const std::string text = fmt::format("{}{}; {}", error.what(), gait, found);
    if (fails) throw Disagreement(text + ": no number is given");
    throw NoFailureFound(text);
  } catch (const ConvergenceError& error) {
    if (options.simulated_steps == 0) throw;
    throw Disagreement(fmt::format("{}{}; {}: no number is given", error.what(), gait,
                                   walks_in_words(map, start, walking(options)).first));
  }
}

}  // namespace

double study_score_spacing(const BatchMap& map) {
  // The curve of one score takes further places where it needs them. Intervals of one dimension are the narrowest.
  return map.scores > 1 ? 0.6 : map.dimension == 1 ? 0.8 : 1.0;
}

MeshStudy mesh_study(const BatchMap& map, std::span<const double> start, const MeshStudyOptions& options) {
  if (options.sizes != 0 && (options.sizes < 3 || options.sizes > 4))
    throw std::invalid_argument(fmt::format("mesh study: {} sizes, 3 or 4 expected", options.sizes));
  if (options.shifts < 6)
    throw std::invalid_argument(fmt::format("mesh study: {} shifts, 6 or more expected", options.shifts));
  try {
    return study_around(map, start, options, orbit_of_start(map, start));
  } catch (const NoOrbit& error) {
    if (auto around = orbit_of_gait(map, start, coarsest_spacing(map, options) / 2)) {
      const int revolutions = around->revolutions;
      return study_around(revolutions == 1 ? map : over_revolutions(map, revolutions), start, options,
                          std::move(*around));
    }
    if (options.simulated_steps == 0) throw;  // without a gait, a mesh alone does not vouch for its nodes
    if (auto walk = orbit_of_walk(map, start)) try {
        return study_around(map, start, options, std::move(*walk));
      } catch (const MapError&) {  // nor is it a question about first passage: what follows is said of it
      }
    std::string walked;
    try {
      walked = walks_in_words(map, start, walking(options)).first;
    } catch (const MapError& broken) {  // a walk away from an unstable orbit may leave the finite numbers
      walked = fmt::format("simulated walks end: {}", broken.what());
    }
    throw NoOrbit(fmt::format("{}; {}", error.what(), walked));
  }
}

std::string disagreement(const char* one, const MeshEstimate& a, const char* other, const MeshEstimate& b) {
  const auto& [less, more] = std::minmax(a, b, [](const auto& x, const auto& y) { return x.value < y.value; });
  const double facing = std::hypot(std::log(less.upper / less.value), std::log(more.value / more.lower));
  if (!(a.lower > 0 && b.lower > 0) || std::log(more.value / less.value) <= disagrees * facing) return {};
  return fmt::format("{} ({:.4g} steps, {:.4g} to {:.4g}) and {} ({:.4g}, {:.4g} to {:.4g}) disagree", one, a.value,
                     a.lower, a.upper, other, b.value, b.lower, b.upper);
}

void require_agreement(const MeshStudy& study, const std::string& what) {
  if (!study.disagreement.empty()) throw RefutedMesh(what, study.disagreement);
}

}  // namespace metastable::markov
