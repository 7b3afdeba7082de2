#include "analysis/study/followed_study.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <queue>
#include <utility>

#include "analysis/statistics/interval_95.h"
#include "analysis/study/chain_summary.h"
#include "markov/parallel.h"
#include "markov/transition_rows/draws.h"

namespace metastable::analysis {
namespace {

// How far a launch is followed: where it neither rests nor shows a cycle within them, nothing is said. A landing of a
// map costs 0.1 us, one that is followed 50 us. A limit shows long before an orbit is there, from its last changes.
constexpr std::uint64_t most_followed = 2'000'000, most_run = 20'000;
constexpr std::size_t longest_cycle = 8;  // revolutions
constexpr int repeats = 8;                // of a cycle
constexpr double same_state = 1e-13, same_run = 1e-10;
constexpr std::size_t settling = 4096;  // events by which a cycle's last digits are found
constexpr int tried_states = 9;         // of an interval that leads into itself
constexpr double endless = 1e30;        // states above it grow without limit
constexpr double reach = 8.3;           // [sd] of a launch: less than 1e-16 is beyond
constexpr std::size_t cuts = 512, cuts_of_runs = 128;
constexpr std::size_t most_launches = 20000, launches_of_runs = 1500;
constexpr double resolved = 1e-12;  // relative, of the expected steps over the launch
constexpr double rarest = 1e-15;    // share of the launches that counts: what lies beyond `reach`
constexpr std::size_t shown_launches = 1024, shown_runs = 64;  // for seconds, metres and speeds

double between(double low_score, double high_score) {
  // The difference of tails, taken on the side where it loses no digits.
  const auto tail = [](double z) { return 0.5 * std::erfc(z / std::sqrt(2.0)); };
  return low_score >= 0 ? tail(low_score) - tail(high_score) : tail(-high_score) - tail(-low_score);
}

// Says where a launch that was followed ended.
enum class End { rests, cycles, grows, undecided };
struct Course {
  End end = End::undecided;
  std::uint64_t steps = 0;    // until rest, or followed
  std::vector<double> cycle;  // states before the events of whole revolutions, from the launch's phase on

  bool ever() const { return end == End::cycles || end == End::grows; }
  double count() const { return ever() ? infinite : static_cast<double>(steps); }
};

Run start(const Problem& problem, double state, int phase) {
  if (problem.run) return problem.run(state, phase);
  return [&map = problem.map, noise = std::vector<double>(static_cast<std::size_t>(problem.map.noise_dimension())),
          state, phase]() mutable -> std::optional<FollowedEvent> {
    const std::optional<double> next = map.landing(state, phase, noise);
    if (!next) return std::nullopt;
    const FollowedEvent event{*next, map.duration(*next, phase).value_or(0), map.advance(phase).value_or(0)};
    state = *next;
    phase = (phase + 1) % map.phases();
    return event;
  };
}

// Follows a launch until it rests or is known never to.
class Follower {
 public:
  Follower(const Problem& problem, double state, int phase) : problem_(problem), phase_(phase) {
    // Durations are not asked for here: elliptic integrals cost more than landings.
    if (problem.run) run_ = problem.run(state, phase);
    state_ = state;
  }

  Course follow() {
    const auto phases = static_cast<std::uint64_t>(problem_.map.phases());
    const std::uint64_t most = run_ ? most_run : most_followed;
    after_ = {state_};
    for (std::uint64_t revolution = 1; course_.steps < most; ++revolution) {
      for (std::uint64_t k = 0; k < phases; ++k) {
        ++course_.steps;
        if (!step()) return ended(End::rests);
      }
      after_.push_back(state_);
      if (after_.size() > 2 * longest_cycle + 1) after_.erase(after_.begin());
      if (state_ > endless) return ended(End::grows);
      if (const std::size_t length = comes_again()) return cycling(length, state_);
      // Looked for often at first, then at every doubling.
      if (revolution >= 3 && (revolution < 64 || (revolution & (revolution - 1)) == 0))
        if (const std::optional<double> limit = trapped()) return cycling(1, *limit);
    }
    return ended(End::undecided);
  }

 private:
  bool step() {
    if (run_) {
      const std::optional<FollowedEvent> event = run_();
      if (event) state_ = event->state;
      return event.has_value();
    }
    const std::optional<double> next = problem_.map.landing(state_, phase_of(course_.steps - 1), no_noise_);
    if (next) state_ = *next;
    return next.has_value();
  }

  int phase_of(std::uint64_t event) const {
    return static_cast<int>((static_cast<std::uint64_t>(phase_) + event) %
                            static_cast<std::uint64_t>(problem_.map.phases()));
  }

  Course ended(End end) {
    course_.end = end;
    return course_;
  }

  // Returns the cycle's length in revolutions, 0 if there is none yet.
  std::size_t comes_again() {
    const double same = run_ ? same_run : same_state;
    for (std::size_t m = 1; m <= longest_cycle && m < after_.size(); ++m) {
      const double before = after_[after_.size() - 1 - m];
      again_[m - 1] = std::abs(state_ - before) <= same * std::abs(state_) ? again_[m - 1] + 1 : 0;
      if (again_[m - 1] >= repeats * static_cast<int>(m)) return m;
    }
    return 0;
  }

  // Returns the state after one revolution of the map; nothing where that rests.
  std::optional<double> revolved(double state, std::vector<double>* passed = nullptr) const {
    for (int k = 0; k < problem_.map.phases(); ++k) {
      if (passed) passed->push_back(state);
      const std::optional<double> next =
          problem_.map.landing(state, phase_of(static_cast<std::uint64_t>(k)), no_noise_);
      if (!next) return std::nullopt;
      state = *next;
    }
    return state;
  }

  // Returns the limit that the last changes point at if states around it, and the orbit's, stay around it.
  std::optional<double> trapped() const {
    const double now = after_.back(), change = now - after_[after_.size() - 2],
                 before = after_[after_.size() - 2] - after_[after_.size() - 3];
    const double ratio = before == 0 ? 0 : change / before;
    if (!(std::abs(ratio) < 1)) return std::nullopt;
    const double left = change * ratio / (1 - ratio), limit = now + left;
    const double half = std::max(2 * std::abs(left), 1e-9 * std::abs(limit)), low = limit - half, high = limit + half;
    if (!(low > problem_.map.state_interval(phase_).first)) return std::nullopt;
    for (int k = 0; k < tried_states; ++k) {
      const std::optional<double> next = revolved(low + (high - low) * k / (tried_states - 1));
      if (!next || *next < low || *next > high) return std::nullopt;
    }
    return limit;
  }

  Course cycling(std::size_t length, double state) {
    course_.end = End::cycles;
    for (std::size_t m = 0; m < length; ++m) state = revolved(state, &course_.cycle).value_or(state);
    return course_;
  }

  const Problem& problem_;
  int phase_;
  double state_ = 0;
  Run run_;
  std::vector<double> no_noise_ = std::vector<double>(static_cast<std::size_t>(problem_.map.noise_dimension()));
  std::vector<double> after_;  // the last revolutions
  std::array<int, longest_cycle> again_{};
  Course course_;
};

Course follow(const Problem& problem, double state, int phase) { return Follower(problem, state, phase).follow(); }

// A share of the launches, between two scores, that takes equally many steps, or from `fewest` to `most`.
struct Piece {
  double low = 0, high = 0, mass = 0;
  double fewest = 0, most = 0;
  double doubt() const { return fewest == most ? 0 : mass * (std::isinf(most) ? 1 : 1 - fewest / most); }
};

// Holds how many steps the launches take.
struct Launches {
  std::vector<Piece> pieces;
  Course typical;              // of the middle launch
  std::optional<Course> ever;  // of one that never rests
  bool undecided = false;      // of some launch it is not known whether it rests
  double unsorted = 0;         // in steps: where steps do not rise with the launch
};

// Cuts a launch with a spread into pieces.
class LaunchCutter {
 public:
  explicit LaunchCutter(const Problem& problem) : problem_(problem) {}

  Launches cut() {
    const double first = problem_.launch.state(-reach), last = problem_.launch.state(reach);
    all_.typical = follow(problem_, problem_.launch.state(0), problem_.launch.phase);
    note(all_.typical);
    if (first == last) {
      const double count = all_.typical.count();
      all_.pieces = {{-reach, reach, 1, count, count}};
      return std::move(all_);
    }
    const std::size_t count = problem_.run ? cuts_of_runs : cuts;
    std::vector<double> score(count + 1), steps(count + 1);
    for (std::size_t i = 0; i <= count; ++i) {
      score[i] = reach * (2 * static_cast<double>(i) / static_cast<double>(count) - 1);
      steps[i] = steps_at(score[i]);
    }
    for (std::size_t i = 0; i < count; ++i) add(score[i], score[i + 1], steps[i], steps[i + 1]);
    if (!std::is_sorted(steps.begin(), steps.end())) all_.unsorted = change_from_coarse(score, steps);
    halve(problem_.run ? launches_of_runs : most_launches);
    return std::move(all_);
  }

 private:
  double steps_at(double score) {
    const Course course = follow(problem_, problem_.launch.state(score), problem_.launch.phase);
    note(course);
    return course.count();
  }

  void note(const Course& course) {
    all_.undecided = all_.undecided || course.end == End::undecided;
    if (course.ever() && !all_.ever) all_.ever = course;
  }

  void add(double low, double high, double at_low, double at_high) {
    const auto [fewest, most] = std::minmax(at_low, at_high);
    const Piece piece{low, high, between(low, high), fewest, most};
    if (fewest == most)
      all_.pieces.push_back(piece);
    else
      doubtful_.push(piece), ends_[low] = at_low, ends_[high] = at_high;
  }

  void halve(std::size_t most) {
    for (std::size_t followed = 0; !doubtful_.empty(); ++followed) {
      const Piece piece = doubtful_.top();
      const double middle = 0.5 * (piece.low + piece.high);
      if (followed == most || piece.doubt() < resolved || !(middle > piece.low && middle < piece.high)) break;
      doubtful_.pop();
      const double at_low = ends_.at(piece.low), at_high = ends_.at(piece.high), at_middle = steps_at(middle);
      add(piece.low, middle, at_low, at_middle);
      add(middle, piece.high, at_middle, at_high);
    }
    for (; !doubtful_.empty(); doubtful_.pop()) all_.pieces.push_back(doubtful_.top());
  }

  // Compares the steps by all cuts with those by every second one.
  static double change_from_coarse(const std::vector<double>& score, const std::vector<double>& steps) {
    const auto sum = [&](std::size_t stride) {
      double total = 0;
      for (std::size_t i = 0; i + stride < score.size(); i += stride)
        if (std::isfinite(steps[i]) && std::isfinite(steps[i + stride]))
          total += between(score[i], score[i + stride]) * 0.5 * (steps[i] + steps[i + stride]);
      return total;
    };
    return std::abs(sum(1) - sum(2));
  }

  struct LessDoubt {
    bool operator()(const Piece& a, const Piece& b) const { return a.doubt() < b.doubt(); }
  };
  const Problem& problem_;
  Launches all_;
  std::priority_queue<Piece, std::vector<Piece>, LessDoubt> doubtful_;
  std::map<double, double> ends_;  // steps at the ends of doubtful pieces
};

std::vector<Quantile> quantiles_of(const StepShares& shares) {
  std::vector<Quantile> all;
  for (const double level : quantile_levels) {
    double below = 0, value = shares.rbegin()->first;
    for (const auto& [steps, share] : shares)
      if ((below += share) >= level * (1 - 1e-12)) {
        value = steps;
        break;
      }
    all.push_back({level, value});
  }
  return all;
}

Accumulated accumulated(const StepShares& shares) {
  double mean = 0, square = 0;
  for (const auto& [value, share] : shares) mean += share * value;
  for (const auto& [value, share] : shares) square += share * (value - mean) * (value - mean);
  if (std::isinf(mean)) return {infinite, infinite, quantiles_of(shares)};
  if (shares.size() == 1) return {shares.begin()->first, 0, quantiles_of(shares)};
  return {mean, std::sqrt(square), quantiles_of(shares)};
}

// Adds up what goes with the steps of some launches: seconds, metres, speeds, assumptions that fail.
class Beside {
 public:
  explicit Beside(const Problem& problem)
      : problem_(problem),
        names_(problem.map.assumptions()),
        violated_(names_.size()),
        no_noise_(static_cast<std::size_t>(problem.map.noise_dimension())) {}

  void follow(double state, double weight, std::uint64_t most) {
    const Run run = start(problem_, state, problem_.launch.phase);
    double seconds = 0, metres = 0;
    int phase = problem_.launch.phase;
    for (std::uint64_t n = 0; n < most; ++n) {
      events_ += weight;
      for (std::size_t a = 0; a < names_.size(); ++a)
        if (problem_.map.violates(static_cast<int>(a), state, phase, no_noise_)) violated_[a] += weight;
      const std::optional<FollowedEvent> event = run();
      if (!event) break;
      seconds += event->seconds;
      metres += event->metres;
      state = event->state;
      phase = (phase + 1) % problem_.map.phases();
      const double seen = problem_.observable(state);
      visits_ += weight, first_ += weight * seen, second_ += weight * seen * seen;
    }
    seconds_[seconds] += weight;
    metres_[metres] += weight;
  }

  void fill(bool brief, bool rests, const std::vector<double>& cycle, Metastability& result) const {
    const bool goes_on = rests && visits_ > 0;
    result.survivors.restart_mean = goes_on ? first_ / visits_ : undefined;
    result.survivors.restart_sd =
        goes_on ? std::sqrt(std::max(0.0, second_ / visits_ - std::pow(first_ / visits_, 2))) : undefined;
    if (brief) return;
    if (rests && problem_.map.advance(0)) result.steps.metres = accumulated(metres_);
    if (rests && problem_.map.duration(problem_.map.state_interval(0).first + 1, 0))
      result.steps.seconds = accumulated(seconds_);
    for (std::size_t a = 0; a < names_.size(); ++a) {
      double often = 0;
      for (std::size_t k = 0; k < cycle.size(); ++k) {
        const int phase = static_cast<int>((static_cast<std::size_t>(problem_.launch.phase) + k) %
                                           static_cast<std::size_t>(problem_.map.phases()));
        often += problem_.map.violates(static_cast<int>(a), cycle[k], phase, no_noise_) ? 1 : 0;
      }
      result.violations.push_back({names_[a], cycle.empty() ? undefined : often / static_cast<double>(cycle.size()),
                                   violated_[a] / events_, 0, 0});
    }
  }

 private:
  const Problem& problem_;
  std::vector<std::string> names_;
  std::vector<double> violated_, no_noise_;
  double events_ = 0, visits_ = 0, first_ = 0, second_ = 0;
  StepShares seconds_, metres_;
};

// Describes the limit cycle as the regime: a point at every phase, or a few.
void describe_cycle(const Problem& problem, const std::vector<double>& cycle, Metastability& result) {
  const auto phases = static_cast<std::size_t>(problem.map.phases());
  double first = 0, second = 0;
  for (std::size_t p = 0; p < phases && !cycle.empty(); ++p) {
    std::vector<double> states;
    const std::size_t from = (p + phases - static_cast<std::size_t>(problem.launch.phase)) % phases;
    for (std::size_t k = from; k < cycle.size(); k += phases) states.push_back(cycle[k]);
    std::sort(states.begin(), states.end());
    PhaseDistribution phase{states, std::vector<double>(states.size(), 1.0 / static_cast<double>(states.size())), 0, 0};
    phase.edges.push_back(std::nextafter(states.back(), infinite));
    double square = 0;
    for (const double state : states) {
      const double seen = problem.observable(state), share = 1.0 / static_cast<double>(states.size());
      phase.mean += share * seen, square += share * seen * seen;
    }
    phase.sd = states.size() == 1 ? 0 : std::sqrt(std::max(0.0, square - phase.mean * phase.mean));
    first += phase.mean / static_cast<double>(phases), second += square / static_cast<double>(phases);
    result.survivors.by_phase.push_back(std::move(phase));
  }
  result.survivors.mean = cycle.empty() ? undefined : first;
  result.survivors.sd = cycle.empty()       ? undefined
                        : cycle.size() == 1 ? 0
                                            : std::sqrt(std::max(0.0, second - first * first));
}

// Says at which speed a launch settles, leg by leg where those differ.
std::string settles_text(const Problem& problem, const Course& course) {
  if (course.end == End::grows) return "gains speed without limit";
  std::string list;
  constexpr std::size_t most_listed = 16;
  for (std::size_t k = 0; k < std::min(course.cycle.size(), most_listed); ++k)
    list += fmt::format("{}{:.6g}", k == 0 ? "" : ", ", problem.observable(course.cycle[k]));
  if (course.cycle.size() > most_listed) list += ", ...";
  return fmt::format("settles at {} = {}{}{}", problem.observed, list, problem.observed_unit,
                     course.cycle.size() > 1 ? " in turn" : "");
}

// Goes around a cycle until its last digits have settled, where revolutions contract.
void settle(const Problem& problem, std::vector<double>& cycle) {
  const std::vector<double> no_noise(static_cast<std::size_t>(problem.map.noise_dimension()));
  if (cycle.empty()) return;
  double state = cycle.front();
  const std::size_t rounds = std::max<std::size_t>(1, (problem.run ? settling / 16 : settling) / cycle.size());
  for (std::size_t k = 0; k < rounds * cycle.size(); ++k) {
    cycle[k % cycle.size()] = state;
    const int phase = static_cast<int>((static_cast<std::size_t>(problem.launch.phase) + k) %
                                       static_cast<std::size_t>(problem.map.phases()));
    const std::optional<double> next = problem.map.landing(state, phase, no_noise);
    if (!next) return;
    state = *next;
  }
}

// Finds the lowest state at the launch's phase from which it never rests, where there is one below all launches looked
// at, or among them.
std::optional<double> safe_state(const Problem& problem) {
  const int phase = problem.launch.phase;
  double low = std::min(0.0, problem.map.state_interval(phase).first);
  double high = std::max(problem.launch.state(reach), 2 * std::max(low, 1e-3));
  const auto safe = [&](double state) { return follow(problem, state, phase).ever(); };
  constexpr double fastest = 100;  // of the lowest state
  if (!safe(high) && !(!problem.run && safe(high = std::max(high, fastest * std::max(1.0, low))))) return std::nullopt;
  const double width = problem.run ? 1e-8 : 1e-10;
  while (high - low > width * std::max(1e-3, std::abs(high))) {
    const double middle = 0.5 * (low + high);
    (middle > 0 && safe(middle) ? high : low) = middle;
  }
  return high;
}

Estimate worst_start(const Problem& problem) {
  double fewest = infinite;
  for (int p = 0; p < problem.map.phases(); ++p) {
    // The last digits of the lowest state may lie below the barrier.
    const double lowest = problem.map.state_interval(p).first;
    fewest = std::min(fewest, follow(problem, lowest + 1e-12 * std::abs(lowest), p).count());
  }
  return {fewest, fewest, fewest};
}

Metastability unresolved(const Problem& problem, const StudyOptions& options, const Launches& launches) {
  double least = 0;
  for (const Piece& piece : launches.pieces) least += piece.mass * (std::isinf(piece.fewest) ? 1 : piece.fewest);
  Metastability result = rest_unresolved(problem, options, "");
  result.method = Method::followed;
  result.message = fmt::format(
      "rest and rolling on for ever cannot be told apart: some launch neither rests nor settles within {} steps",
      problem.run ? most_run : most_followed);
  result.steps.from_start.lower = std::max(1.0, least);
  return result;
}

// Fills steps, rates and status from the pieces.
void fill_expected(const Problem& problem, const Launches& launches, const StudyOptions& options,
                   Metastability& result) {
  double total = 0, lower = 0, upper = 0, never = 0, apart = 0;
  StepShares shares;
  for (const Piece& piece : launches.pieces) total += piece.mass;
  for (const Piece& piece : launches.pieces) {
    const double share = piece.mass / total;
    if (std::isinf(piece.fewest)) never += share;
    if (share > 0 && std::isfinite(piece.fewest)) lower += share * piece.fewest;
    if (share > 0 && std::isfinite(piece.most)) upper += share * piece.most;
    if (std::isinf(piece.most) && std::isfinite(piece.fewest)) apart += share, upper += share * piece.fewest;
    const double shown = std::isinf(piece.fewest) || std::isfinite(piece.most) ? piece.most : piece.fewest;
    shares[std::isinf(piece.fewest) ? infinite : 0.5 * (piece.fewest + shown)] += share;
  }
  if (never > rarest) {
    result.status = Status::rest_unreachable;
    result.steps.from_start = {infinite, infinite, infinite};
    const std::string settles = settles_text(problem, *launches.ever);
    result.message = 1 - never > rarest
                         ? fmt::format(
                               "infinite: rest is unreachable for {:.6g} % of the launches, the others rest: "
                               "without noise what never rests {}",
                               100 * never, settles)
                         : fmt::format("infinite: rest is unreachable: without noise it never rests and {}", settles);
  } else {
    const double value = 0.5 * (lower + upper);
    result.steps.from_start = {value, std::max(1.0, lower - launches.unsorted), upper + launches.unsorted};
    result.steps.discretization_error = 0.5 * (upper - lower) / value + launches.unsorted / value;
    result.status =
        result.steps.discretization_error <= options.tolerance ? Status::converged : Status::tolerance_not_met;
    if (result.status == Status::tolerance_not_met)
      result.message =
          fmt::format("tolerance {} not met: launches differ too finely in their steps", options.tolerance);
  }
  fill_steps(problem, shares, result);
}

}  // namespace

void fill_steps(const Problem& problem, const StepShares& shares, Metastability& result) {
  result.steps.distribution = accumulated(shares);
  const std::size_t shown = survival_steps(problem);
  for (std::size_t n = 0; n < shown; ++n) {
    double more = 0;
    for (auto at = shares.upper_bound(static_cast<double>(n)); at != shares.end(); ++at) more += at->second;
    result.steps.survival.push_back(n == 0 ? 1 : std::min(more, result.steps.survival.back()));
  }
  if (problem.last_event) {
    double more = 0;
    for (auto at = shares.upper_bound(*problem.last_event); at != shares.end(); ++at) more += at->second;
    result.steps.reach_end = std::min(1.0, more);
  }
}

bool without_noise(const Problem& problem) {
  const markov::AnyReturnMap& map = problem.map;
  if (map.noise_dimension() == 0) return true;
  const auto known = [&](double state, int phase) {
    const auto range = map.landing_range(state, phase);
    return range && range->first == range->second;
  };
  for (const double score : {-2.0, 0.0, 2.0})
    if (!known(problem.launch.state(score), problem.launch.phase)) return false;
  for (int p = 0; p < map.phases(); ++p)
    for (const double times : {1.1, 2.0, 5.0})
      if (const double lowest = map.state_interval(p).first; !known(lowest > 0 ? times * lowest : times, p))
        return false;
  return true;
}

bool rests_at_once(const Problem& problem) {
  for (const double score : {-reach, -2.0, 0.0, 2.0, reach}) {
    const auto range = problem.map.landing_range(problem.launch.state(score), problem.launch.phase);
    if (!range || range->second != markov::rest_landing) return false;
  }
  return true;
}

Metastability followed_study(const Problem& problem, const StudyOptions& options) {
  if (options.progress) options.progress(0, "following launches");
  Launches launches = LaunchCutter(problem).cut();
  if (launches.ever) settle(problem, launches.ever->cycle);
  if (launches.undecided) return unresolved(problem, options, launches);
  Metastability result;
  result.method = Method::followed;
  result.replicates = 1;
  result.phases = result.spectrum.period = problem.map.phases();
  fill_expected(problem, launches, options, result);
  const bool rests = result.status != Status::rest_unreachable;
  const std::vector<double> cycle = launches.ever ? launches.ever->cycle : std::vector<double>();
  // Without noise no wheel that comes to rest rolls on for long: a chain of such states forgets all within a few steps.
  const double failing = rests ? 1 : 0;
  result.spectrum.failure_rate = {failing, failing, failing};
  result.spectrum.moduli = {1 - failing};
  const double after = rests ? 1 : infinite;
  result.steps.from_quasi_stationary = {after, after, after};
  result.steps.worst_start =
      rests && without_noise(problem) ? worst_start(problem) : result.steps.from_quasi_stationary;
  describe_cycle(problem, rests ? std::vector<double>() : cycle, result);
  if (without_noise(problem)) result.steps.safe_state = safe_state(problem);
  if (options.progress) options.progress(0.9, "summary");
  Beside beside(problem);
  const bool one = problem.launch.state(-reach) == problem.launch.state(reach);
  const std::size_t count = one ? 1 : problem.run ? shown_runs : shown_launches;
  const auto most = static_cast<std::uint64_t>(
      rests ? 1e6 : std::clamp<double>(problem.last_event.value_or(0), 1, static_cast<double>(shown_launches)));
  for (std::size_t k = 0; k < count; ++k) {
    const double share = 1 / static_cast<double>(count);
    const double score = one ? 0 : markov::normal_score((static_cast<double>(k) + 0.5) * share);
    beside.follow(problem.launch.state(score), share, most);
  }
  beside.fill(options.brief, rests, rests ? std::vector<double>() : cycle, result);
  if (!rests) result.survivors.restart_mean = result.survivors.mean, result.survivors.restart_sd = result.survivors.sd;
  return result;
}

}  // namespace metastable::analysis
