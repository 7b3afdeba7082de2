#include "markov/splitting/splitting_study.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <boost/math/distributions/fisher_f.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <span>
#include <stdexcept>
#include <utility>

#include "markov/parallel.h"
#include "markov/splitting/level_pilot.h"
#include "markov/splitting/mesh_level.h"
#include "markov/splitting/start_gait.h"

namespace metastable::markov {
namespace {

constexpr double fewest_lines = 30;
constexpr double shortest_burn_in = 30;  // steps, as memory that is not linear is seen in part only
constexpr double refused_level = 1e-3;
constexpr std::size_t walks_of_a_round = 1000;  // that failed, whose last steps are kept
// These numbers say when walks that slip into another gait leave no number. A slip a thousand times rarer than failure
// changes the expected steps by a thousandth for each time that walks last as long again in the other gait.
constexpr double much_rarer = 7;            // ln 1000
constexpr double met_when_heated = 6;       // under larger noise an event of this action comes once in some 400 steps
constexpr double settled_growth = 0.1;      // of the share in other gaits, from the burn-in to the end of the rounds
constexpr std::uint64_t most_attempts = 3;  // to learn levels that agree
constexpr std::uint64_t streams_of_an_attempt = 1 << 14;  // streams of random numbers that one attempt may use

/// One independent ensemble and what was seen of it.
struct Round {
  std::unique_ptr<WeightedEnsemble> ensemble;
  std::vector<double> early;            ///< share that fails in each step of the burn-in
  std::vector<double> shares;           ///< and after it
  std::vector<double> states, weights;  ///< at the end of the burn-in
};

class Study {
 public:
  Study(const BatchMap& map, std::span<const double> start, const SplittingOptions& options)
      : map_(map), start_(start), options_(options) {}

  SplittingStudy run() {
    level_ = options_.level;
    if (options_.level_of_mesh) take_level_of_mesh();
    if (!begin()) return walk_until_all_fail();
    const std::uint64_t revolution = static_cast<std::uint64_t>(map_.phases);
    for (;;) {
      estimate();
      const double half = 0.5 * std::log(found_.steps.upper / found_.steps.lower);
      if (half <= options_.tolerance && found_.lines >= fewest_lines) break;
      const double wanted =
          std::isfinite(half) ? std::clamp(1.1 * half * half / (options_.tolerance * options_.tolerance) - 1, 0.25, 3.0)
                              : 3.0;
      const double affordable = (static_cast<double>(options_.most_calls) - static_cast<double>(calls_)) /
                                (static_cast<double>(options_.replicas) * options_.rounds);
      const auto taken = static_cast<double>(rounds_.front().shares.size());
      if (affordable < 0.25 * taken) break;
      if (!walk(whole(std::min(wanted * taken, affordable), 2 * revolution))) return walk_until_all_fail();
    }
    judge();
    tell_survival();
    if (options_.last_steps > 0) tell_failing();
    return std::move(found_);
  }

 private:
  static std::uint64_t whole(double steps, std::uint64_t revolution) {
    return std::max<std::uint64_t>(1, static_cast<std::uint64_t>(std::ceil(steps / static_cast<double>(revolution)))) *
           revolution;
  }

  void tell(double share) const {
    if (options_.progress) options_.progress(share);
  }

  /// Learns levels and lets the rounds walk a first stretch by them. Where rounds of different levels find different
  /// failure rates, new levels are learnt: now and then a pilot learns a level that misses the way to failure, and its
  /// rounds would need very many steps. Returns whether walks are left.
  bool begin() {
    const std::uint64_t revolution = static_cast<std::uint64_t>(map_.phases);
    for (attempt_ = 0;; ++attempt_) {
      learn();
      if (std::ranges::any_of(pilots_, &LevelPilot::all_fail)) return false;
      rounds_.clear();
      rounds_.resize(static_cast<std::size_t>(options_.rounds));
      burn_in_ = whole(std::max({3 * mixing_, 2.0 * static_cast<double>(window_), shortest_burn_in}), revolution);
      const std::uint64_t first =
          whole(std::max({4 * mixing_, 4.0 * static_cast<double>(window_), 100.0}), 2 * revolution);
      const double first_walk =
          static_cast<double>(burn_in_ + first) * static_cast<double>(options_.replicas) * options_.rounds;
      if (first_walk > static_cast<double>(options_.most_calls))
        throw NoSplitting(fmt::format(
            "splitting: the start is forgotten in some {:.3g} steps, so that the rounds would take {:.3g} steps of "
            "the map: no number is given",
            mixing_, first_walk));
      if (!walk(first)) return false;
      if (attempt_ + 1 == most_attempts) return true;
      estimate();
      if (pilots_disagree() >= refused_level) return true;
      for (const Round& round : rounds_) lost_calls_ += round.ensemble->calls();
      scatter_of_steps_ = scatter_of_rate_ = 0;
    }
  }

  /// Returns the stream of a pilot or a round.
  std::uint64_t stream(std::uint64_t number) const { return attempt_ * streams_of_an_attempt + number; }

  void take_level_of_mesh() {
    MeshLevel read = mesh_level(map_, start_,
                                {.seed = options_.seed,
                                 .most_bytes = options_.level_bytes,
                                 .most_calls = options_.most_calls / 4,
                                 .told = [this] { tell(0); }});
    level_ = std::move(read.level), found_.level_window = read.window, found_.level_nodes = read.nodes;
    found_.pilot_calls = calls_ = read.calls;
  }

  void learn() {
    mixing_ = 0, window_ = 1;
    pilots_.assign(static_cast<std::size_t>(options_.pilots), {});
    const auto told = one_at_a_time([this] { tell(0); });
    parallel_for(pilots_.size(), options_.threads, [&](std::size_t k) {
      pilots_[k] = level_pilot(map_, start_,
                               {.level = level_,
                                .always = bool{options_.level},
                                .replicas = options_.replicas,
                                .most_calls = options_.most_calls / 4 / pilots_.size(),
                                .seed = options_.seed,
                                .stream = stream(1000 + k),
                                .told = told});
    });
    for (const LevelPilot& pilot : pilots_) {
      mixing_ = std::max(mixing_, pilot.mixing_steps);
      window_ = std::max(window_, pilot.window);
      calls_ += pilot.calls;
      found_.pilot_calls += pilot.calls;
    }
    if (std::ranges::any_of(pilots_, [](const LevelPilot& pilot) { return bool{pilot.levels.level}; }))
      found_.split_by = options_.level_of_mesh ? SplitBy::mesh : options_.level ? SplitBy::given : SplitBy::learnt;
  }

  /// Returns whether walks are left in all rounds.
  bool walk(std::uint64_t more) {
    const std::uint64_t before = rounds_.front().shares.size();
    const double whole_work =
        static_cast<double>(rounds_.size()) * static_cast<double>(more + (before == 0 ? burn_in_ : 0));
    std::atomic<std::uint64_t> done = 0;
    const auto told = one_at_a_time([&] { tell(std::min(1.0, static_cast<double>(done) / whole_work)); });
    parallel_for(rounds_.size(), options_.threads, [&](std::size_t r) {
      Round& round = rounds_[r];
      if (!round.ensemble) {
        round.ensemble = std::make_unique<WeightedEnsemble>(map_, start_, options_.replicas, options_.seed, stream(r));
        round.ensemble->set_levels(pilots_[r % pilots_.size()].levels);
        for (std::uint64_t n = 0; n < burn_in_ && !round.ensemble->all_failed(); ++n) {
          round.early.push_back(round.ensemble->advance());
          ++done, told();
        }
        const auto states = round.ensemble->states(), weights = round.ensemble->weights();
        round.states.assign(states.begin(), states.end()), round.weights.assign(weights.begin(), weights.end());
        if (options_.last_steps > 0) round.ensemble->remember(options_.last_steps, walks_of_a_round);
      }
      for (std::uint64_t n = 0; n < more && !round.ensemble->all_failed(); ++n) {
        if (round.shares.size() % window_ == 0) round.ensemble->mark();
        round.shares.push_back(round.ensemble->advance());
        ++done, told();
      }
    });
    count_calls();
    return std::ranges::none_of(rounds_, [](const Round& round) { return round.ensemble->all_failed(); });
  }

  void count_calls() {
    calls_ = found_.pilot_calls + lost_calls_;
    for (const Round& round : rounds_) calls_ += round.ensemble->calls();
  }

  /// Starts rounds anew that are not split, and follows each until hardly_any steps are left to expect.
  SplittingStudy walk_until_all_fail() {
    lost_calls_ = calls_ - found_.pilot_calls;
    rounds_.clear();
    rounds_.resize(static_cast<std::size_t>(options_.rounds));
    const auto told = one_at_a_time([this] { tell(0); });
    const std::uint64_t most = (options_.most_calls - std::min(calls_, options_.most_calls)) / rounds_.size();
    parallel_for(rounds_.size(), options_.threads, [&](std::size_t r) {
      Round& round = rounds_[r];
      round.ensemble = std::make_unique<WeightedEnsemble>(map_, start_, options_.replicas, options_.seed, r);
      for (int mark = 0; mark < 2; ++mark) round.ensemble->mark();
      if (options_.last_steps > 0) round.ensemble->remember(options_.last_steps, walks_of_a_round);
      double share = 0;  // that failed in the last step
      while (round.ensemble->survival() > hardly_any * share) {
        if (round.ensemble->calls() > most)
          throw NoSplitting(fmt::format(
              "splitting: all {} replicas of a pilot fail in one step, and those of another ensemble walk on "
              "after {} steps: no number is given",
              options_.replicas, round.ensemble->steps()));
        round.early.push_back(share = round.ensemble->advance());
        told();
      }
    });
    found_.all_failed = true;
    found_.split_by = SplitBy::nothing;
    burn_in_ = 0;
    for (const Round& round : rounds_) burn_in_ = std::max<std::uint64_t>(burn_in_, round.early.size());
    for (Round& round : rounds_) round.early.resize(burn_in_, 1.0);
    mixing_ = std::numeric_limits<double>::quiet_NaN();
    count_calls();
    estimate();
    judge();
    tell_survival();
    for (std::size_t r = 0; options_.last_steps > 0 && r < rounds_.size(); ++r) add_failing(rounds_[r]);
    return std::move(found_);
  }

  /// Returns the mean share that fails at each phase, of one round, after its burn-in.
  std::vector<double> shares_by_phase(const Round& round) const {
    const auto phases = static_cast<std::size_t>(map_.phases);
    std::vector<double> sum(phases, 0);
    for (std::size_t n = 0; n < round.shares.size(); ++n) sum[n % phases] += round.shares[n];
    for (double& one : sum) one /= static_cast<double>(round.shares.size() / phases);
    return sum;
  }

  /// Returns an interval that is no narrower than each earlier one would be at the steps taken by now. The rounds end
  /// where the interval is as narrow as asked, and so at estimates of the scatter that happen to be small. The first
  /// estimate for which 30 lines vouch is not chosen in this way (C. Stein, Ann. Math. Stat. 16, 243, 1945).
  /// @param scatter  the largest half-width of the logarithm so far, times the root of the steps
  MeshEstimate unchosen(const MeshEstimate& found, double& scatter) const {
    const double root = std::sqrt(static_cast<double>(rounds_.front().shares.size()));
    const double half = 0.5 * std::log(found.upper / found.lower);
    if (found_.all_failed || !(found_.lines >= fewest_lines) || !std::isfinite(half)) return found;
    scatter = std::max(scatter, half * root);
    return {found.value, found.value * std::exp(-scatter / root), found.value * std::exp(scatter / root)};
  }

  void estimate() {
    found_.rounds = options_.rounds;
    found_.round_steps = burn_in_ + rounds_.front().shares.size();
    found_.calls = calls_;
    found_.mixing_steps = mixing_ / -std::log(left_of_memory);
    std::vector<RoundShares> shares;
    found_.rates.clear();
    for (const Round& round : rounds_) {
      shares.push_back({round.early, found_.all_failed ? std::vector<double>() : shares_by_phase(round)});
      if (found_.all_failed) continue;
      double mean = 0;
      for (const double one : round.shares) mean += one;
      found_.rates.push_back(mean / static_cast<double>(round.shares.size()));
    }
    found_.pool = PooledRounds(std::move(shares));
    double sum = 0, squares = 0;
    for (const Round& round : rounds_)
      for (const double weight : round.ensemble->lines()) sum += weight, squares += weight * weight;
    found_.lines = squares > 0 ? sum * sum / squares : 0;
    found_.steps = unchosen(found_.pool.steps(), scatter_of_steps_);
    const MeshEstimate rate = found_.pool.failure_rate();
    found_.failure_rate = unchosen(rate, scatter_of_rate_);
    found_.widened =
        std::log(found_.failure_rate.upper / found_.failure_rate.lower) / std::log(rate.upper / rate.lower);
    if (!(found_.widened >= 1 && std::isfinite(found_.widened))) found_.widened = 1;
  }

  void tell_survival() {
    for (std::uint64_t n = 1; n <= burn_in_; ++n) found_.survival.push_back(survival_after(found_, n));
  }

  void add_failing(const Round& round) {
    found_.failing.add(round.ensemble->failing());
    found_.failing_ends.push_back(found_.failing.size());
  }

  // Rounds count alike: each has walked as many steps.
  void tell_failing() {
    for (const Round& round : rounds_) {
      add_failing(round);
      for (int p = 0; p < map_.phases; ++p) {
        const auto states = round.ensemble->states();
        const auto weights = round.ensemble->weights();
        found_.regime_states.insert(found_.regime_states.end(), states.begin(), states.end());
        found_.regime_weights.insert(found_.regime_weights.end(), weights.begin(), weights.end());
        if (p + 1 < map_.phases) round.ensemble->advance();
      }
      found_.regime_ends.push_back(found_.regime_weights.size());
    }
  }

  void judge() {
    const double ratio = found_.steps.upper / found_.steps.lower;
    if (!(found_.lines >= fewest_lines))
      found_.disagreement = fmt::format(
          "splitting: {:.3g} independent lines of descent lead to failure in {} steps of the map, where {} are the "
          "fewest that vouch for a number",
          found_.lines, found_.calls, fewest_lines);
    else if (!(ratio <= widest_interval))
      found_.disagreement = fmt::format(
          "splitting: {} rounds of {} steps say {:.3g} to {:.3g} steps: they lie too far apart for a number",
          found_.rounds, found_.round_steps, found_.steps.lower, found_.steps.upper);
    else if (changing() < refused_level)
      found_.disagreement = fmt::format(
          "splitting: the failure rate of later steps differs from that of earlier ones, {} steps after the start: the "
          "machine has not settled by then",
          burn_in_);
    else if (pilots_disagree() < refused_level)
      found_.disagreement =
          "splitting: rounds split by different levels find different failure rates: some ways to fail are not found "
          "by all";
    else if (!found_.all_failed)
      see_other_gaits();
  }

  /// Refuses where walks slip into another gait, and the share of those that have still grows: the rounds then say how
  /// failures come from the start's gait, and not yet how from the other.
  void see_other_gaits() {
    StartGait gait(map_, start_, regime_sds());
    if (gait.none()) return;
    const auto slipped = [&](std::span<const double> states, std::span<const double> weights) {
      const std::vector<std::uint8_t> left = gait.left(states);
      double sum = 0;
      for (std::size_t i = 0; i < left.size(); ++i) sum += left[i] ? weights[i] : 0;
      return sum;
    };
    const auto slipped_by_now = [&](const Round& round) {
      return slipped(round.ensemble->states(), round.ensemble->weights());
    };
    // The states of one round for each level are followed first, and those of all rounds where some lead elsewhere.
    // Slips that are too rare for the rounds are found by walks under larger noise.
    std::vector<double> before, after;
    for (std::size_t r = 0; r < pilots_.size(); ++r) after.push_back(slipped_by_now(rounds_[r])), tell(1);
    const double heat = std::sqrt(std::max(1.0, (std::log(found_.steps.value) + much_rarer) / met_when_heated));
    gait.left(gait.heated(start_, heat, options_.seed));
    if (!gait.elsewhere().empty()) {
      for (std::size_t r = pilots_.size(); r < rounds_.size(); ++r)
        after.push_back(slipped_by_now(rounds_[r])), tell(1);
      for (const Round& round : rounds_) before.push_back(slipped(round.states, round.weights)), tell(1);
      judge_slips(before, after, describe_state(map_, gait.elsewhere()), heat);
    }
    calls_ += gait.calls();
    found_.calls = calls_;
  }

  /// @param before, after  shares of each round at the end of the burn-in and of the round
  void judge_slips(const std::vector<double>& before, const std::vector<double>& after, const std::string& where,
                   double heat) {
    const double first = mean_of(before), last = mean_of(after);
    if (!(last > 0 || first > 0)) {
      found_.disagreement = fmt::format(
          "splitting: none of the walks has slipped into another gait, at {}, within {} steps, and under {:.2g} times "
          "the noise some do: how failures come from there is not known",
          where, found_.round_steps, heat);
      return;
    }
    const RatioOfSums grown = ratio_of_sums(after, before);
    const double changed = std::abs(grown.value - 1), error = 2 * standard_error(grown);
    if (changed + error < settled_growth) return;
    found_.disagreement = fmt::format(
        "splitting: of the walks {:.2g} % are in another gait, at {}, after {} steps, and {:.2g} % after {}: {}",
        100 * first, where, burn_in_, 100 * last, found_.round_steps,
        changed > error || !std::isfinite(error)
            ? "these slip too seldom for rounds of such a length to tell how failures come from there"
            : "whether that share has settled is not known to a tenth");
  }

  static double mean_of(const std::vector<double>& all) {
    return std::accumulate(all.begin(), all.end(), 0.0) / static_cast<double>(all.size());
  }

  /// Returns the sds of the numbers of a state at the end of the rounds.
  std::vector<double> regime_sds() const {
    const auto d = static_cast<std::size_t>(map_.dimension);
    const auto mean_over_rounds = [&](const auto& of) {
      std::vector<double> mean(d);
      for (const Round& round : rounds_) {
        const auto states = round.ensemble->states(), weights = round.ensemble->weights();
        for (std::size_t i = 0; i < weights.size(); ++i)
          for (std::size_t k = 0; k < d; ++k)
            mean[k] += weights[i] * of(k, states[i * d + k]) / static_cast<double>(rounds_.size());
      }
      return mean;
    };
    const std::vector<double> mean = mean_over_rounds([](std::size_t, double x) { return x; });
    std::vector<double> sd = mean_over_rounds([&](std::size_t k, double x) { return (x - mean[k]) * (x - mean[k]); });
    for (std::size_t k = 0; k < d; ++k) sd[k] = std::max(std::sqrt(sd[k]), 1e-12 * (1 + std::abs(mean[k])));
    return sd;
  }

  /// Returns the level at which the rates of the first and the second half differ.
  double changing() const {
    std::vector<double> change;
    double mean = 0, squares = 0;
    const double n = static_cast<double>(rounds_.size());
    for (const Round& round : rounds_) {
      const std::size_t half = round.shares.size() / 2;
      double first = 0, second = 0;
      for (std::size_t k = 0; k < half; ++k) first += round.shares[k], second += round.shares[half + k];
      change.push_back(second - first);
      mean += change.back() / n;
    }
    for (const double one : change) squares += (one - mean) * (one - mean);
    if (!(squares > 0)) return 1;
    const double t = std::abs(mean) / std::sqrt(squares / (n - 1) / n);
    return 2 * boost::math::cdf(boost::math::complement(boost::math::students_t(n - 1), t));
  }

  /// Returns the level at which rates differ between the pilots' levels by more than between rounds of one.
  double pilots_disagree() const {
    const std::size_t groups = pilots_.size(), each = rounds_.size() / groups;
    if (groups < 2 || each < 2 || found_.all_failed) return 1;
    double grand = 0, between = 0, within = 0;
    for (const double rate : found_.rates) grand += rate / static_cast<double>(rounds_.size());
    for (std::size_t g = 0; g < groups; ++g) {
      double mean = 0;
      for (std::size_t r = g; r < rounds_.size(); r += groups) mean += found_.rates[r] / static_cast<double>(each);
      for (std::size_t r = g; r < rounds_.size(); r += groups) within += std::pow(found_.rates[r] - mean, 2);
      between += static_cast<double>(each) * std::pow(mean - grand, 2);
    }
    const auto a = static_cast<double>(groups - 1), b = static_cast<double>(rounds_.size() - groups);
    if (!(within > 0)) return 1;
    return boost::math::cdf(boost::math::complement(boost::math::fisher_f(a, b), (between / a) / (within / b)));
  }

  const BatchMap& map_;
  std::span<const double> start_;
  const SplittingOptions& options_;
  LevelFunction level_;  ///< given, or a mesh's; empty: learnt
  std::vector<LevelPilot> pilots_;
  std::vector<Round> rounds_;
  double mixing_ = 0, scatter_of_steps_ = 0, scatter_of_rate_ = 0;
  std::uint64_t window_ = 1, burn_in_ = 0, calls_ = 0, lost_calls_ = 0, attempt_ = 0;
  SplittingStudy found_;
};

}  // namespace

MeshEstimate steps_from_quasi_stationary(const SplittingStudy& study) {
  return {1 / study.failure_rate.value, 1 / study.failure_rate.upper, 1 / study.failure_rate.lower};
}

MeshEstimate survival_after(const SplittingStudy& study, std::uint64_t steps) {
  return study.pool.survival_after(steps, study.widened);
}

void require_agreement(const SplittingStudy& study, const std::string& what) {
  if (!study.disagreement.empty()) throw Disagreement(fmt::format("{}: {}", what, study.disagreement));
}

void require_agreement(const MeshStudy& mesh, const SplittingStudy& splitting, const std::string& what) {
  const std::string found = disagreement("the mesh", mesh.steps, "splitting", splitting.steps);
  if (!found.empty()) throw Disagreement(fmt::format("{}: {}: no number is given", what, found));
}

SplittingStudy splitting_study(const BatchMap& map, std::span<const double> start, const SplittingOptions& options) {
  require_start(map, start);
  for (std::size_t k = 0; k < start.size(); ++k)
    if (!std::isfinite(start[k]))
      throw std::invalid_argument(fmt::format("start: number {} is {}, a finite number expected", k + 1, start[k]));
  if (options.level && options.level_of_mesh)
    throw std::invalid_argument("splitting: a level function or a mesh's level expected, not both");
  if (!(options.tolerance > 0))
    throw std::invalid_argument(fmt::format("splitting: a tolerance of {}, above 0 expected", options.tolerance));
  if (options.replicas == 0) {
    SplittingOptions chosen = options;
    chosen.replicas = static_cast<std::size_t>(std::clamp(50 / options.tolerance, 200.0, 1000.0));
    return splitting_study(map, start, chosen);
  }
  if (options.replicas < 100)
    throw std::invalid_argument(fmt::format("splitting: {} replicas, 100 or more expected", options.replicas));
  if (options.pilots < 1 || options.rounds < 8 || options.rounds % options.pilots != 0)
    throw std::invalid_argument(fmt::format("splitting: {} rounds, 8 or more and a multiple of the {} pilots expected",
                                            options.rounds, options.pilots));
  return Study(map, start, options).run();
}

}  // namespace metastable::markov
