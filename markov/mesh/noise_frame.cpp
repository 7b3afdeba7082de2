#include "markov/mesh/noise_frame.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <deque>
#include <optional>

#include "markov/dense_matrix.h"

namespace metastable::markov {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int revolution_limit = 5000;
constexpr int longest_told_period = 1000;
constexpr double orbit_tolerance = 1e-11;
constexpr double same_state = 1e-7;         // of states that are still led to it
constexpr double period_tolerance = 1e-11;  // of a state that has come back
constexpr int least_revolutions =
    300;                               // before a gait counts as reached: a way away from an unstable one begins slowly
constexpr int walk_revolutions = 300;  // of a walk whose orbit does not count
constexpr double nudge = 1e-6;         // beside a start, relative
constexpr double jump_ratio = 3;       // derivative over the change from -1 to 1 sd, beyond which the map jumps
constexpr double narrowest = 0.05;     // of the widest axis: nodes there are no nearer

/// Steps a map once. What is wrong with a failure there is said by `when`.
class Probe {
 public:
  explicit Probe(const BatchMap& map) : map_(map) {}
  VectorXd operator()(int phase, const VectorXd& state, const VectorXd& scores, const char* when) const {
    VectorXd next(state.size());
    std::uint8_t failed = 0;
    checked_step(map_, phase, {state.data(), static_cast<std::size_t>(state.size())},
                 {scores.data(), static_cast<std::size_t>(scores.size())},
                 {next.data(), static_cast<std::size_t>(next.size())}, {&failed, 1});
    if (failed)
      throw NoOrbit(fmt::format("return map: {}, from the state {}", when,
                                describe_state(map_, {state.data(), static_cast<std::size_t>(state.size())})));
    return next;
  }

 private:
  const BatchMap& map_;
};

std::vector<VectorXd> settled_orbit(const BatchMap& map, const Probe& probe, std::span<const double> start) {
  const VectorXd quiet = VectorXd::Zero(map.scores);
  VectorXd state = Eigen::Map<const VectorXd>(start.data(), map.dimension);
  for (int revolution = 0; revolution < revolution_limit; ++revolution) {
    std::vector<VectorXd> orbit;
    VectorXd next = state;
    for (int phase = 0; phase < map.phases; ++phase) {
      orbit.push_back(next);
      next = probe(phase, next, quiet, "even without noise it fails");
    }
    const double moved = (next - state).cwiseAbs().maxCoeff();
    state = next;
    if (moved <= orbit_tolerance * (1 + state.cwiseAbs().maxCoeff())) return orbit;
  }
  throw NoOrbit(fmt::format("return map: without noise it does not settle; it was last at {}",
                            describe_state(map, {state.data(), static_cast<std::size_t>(state.size())})));
}

/// Holds the derivatives of a step by the state and by the scores.
struct Derivatives {
  MatrixXd by_state, by_scores;
};

/// Steps rows of one phase in one call, and says of a failure in those that must not fail where it is.
class Rows {
 public:
  Rows(const BatchMap& map, int phase) : map_(map), phase_(phase) {}
  void add(const VectorXd& state, const VectorXd& scores) {
    states_.insert(states_.end(), state.begin(), state.end());
    scores_.insert(scores_.end(), scores.begin(), scores.end());
  }
  void step() {
    next_.resize(states_.size());
    failed_.assign(states_.size() / static_cast<std::size_t>(map_.dimension), 0);
    map_.step(phase_, states_, scores_, next_, failed_);
  }
  VectorXd landing(Index row, const char* when) const {
    const auto d = static_cast<std::size_t>(map_.dimension), r = static_cast<std::size_t>(row);
    const auto state = std::span(states_).subspan(r * d, d), next = std::span(next_).subspan(r * d, d);
    require_landings(map_, phase_, state, next, std::span(failed_).subspan(r, 1));
    if (failed_[r]) throw NoOrbit(fmt::format("return map: {}, from the state {}", when, describe_state(map_, state)));
    return Eigen::Map<const VectorXd>(next.data(), map_.dimension);
  }
  /// Returns nothing where it fails or leads nowhere.
  std::optional<VectorXd> surviving(Index row) const {
    const VectorXd next = Eigen::Map<const VectorXd>(next_.data() + row * map_.dimension, map_.dimension);
    if (failed_[static_cast<std::size_t>(row)] || !next.allFinite()) return std::nullopt;
    return next;
  }

 private:
  const BatchMap& map_;
  int phase_;
  std::vector<double> states_, scores_, next_;
  std::vector<std::uint8_t> failed_;
};

Derivatives derivatives(const BatchMap& map, int phase, const VectorXd& state) {
  constexpr double score_step = 1e-2;
  const Index d = map.dimension, s = map.scores;
  const VectorXd quiet = VectorXd::Zero(s);
  Rows rows(map, phase);  // for each number of the state a row above and one below, for each score two of each
  std::vector<double> steps;
  for (Index k = 0; k < d; ++k) {
    steps.push_back(1e-5 * std::max(std::abs(state[k]), 1e-2));
    for (const double to : {steps.back(), -steps.back()}) {
      VectorXd moved = state;
      moved[k] += to;
      rows.add(moved, quiet);
    }
  }
  for (Index k = 0; k < s; ++k)
    for (const double to : {score_step, -score_step, 1.0, -1.0}) {
      VectorXd moved = quiet;
      moved[k] = to;
      rows.add(state, moved);
    }
  rows.step();
  Derivatives found{MatrixXd(d, d), MatrixXd(d, s)};
  const char* const beside = "without noise it fails right beside its orbit";
  for (Index k = 0; k < d; ++k)
    found.by_state.col(k) =
        (rows.landing(2 * k, beside) - rows.landing(2 * k + 1, beside)) / (2 * steps[static_cast<std::size_t>(k)]);
  const char* const noisy = "on its noise-free orbit a noise of 0.01 sd makes it fail";
  for (Index k = 0; k < s; ++k) {
    const Index row = 2 * d + 4 * k;
    found.by_scores.col(k) = (rows.landing(row, noisy) - rows.landing(row + 1, noisy)) / (2 * score_step);
    const auto up = rows.surviving(row + 2), down = rows.surviving(row + 3);
    if (!up || !down) continue;
    for (Index i = 0; i < d; ++i) {
      const double wide = ((*up)[i] - (*down)[i]) / 2;
      if (wide != 0 && std::abs(found.by_scores(i, k)) > jump_ratio * std::abs(wide)) found.by_scores(i, k) = wide;
    }
  }
  return found;
}

std::vector<double> row_major(const MatrixXd& m) {
  std::vector<double> out;
  for (Index i = 0; i < m.rows(); ++i)
    for (Index j = 0; j < m.cols(); ++j) out.push_back(m(i, j));
  return out;
}

/// Returns the frame around a state in which a covariance is the unit matrix, but for axes that are too narrow.
NoiseFrame frame_of(const VectorXd& centre, const MatrixXd& covariance) {
  const VectorXd sd = covariance.diagonal().cwiseSqrt();
  if (!(sd.minCoeff() > 0))
    throw MapError(
        "return map: along its gait the noise does not move every number of the state, or moves one alike to "
        "either side; meshes need it to, splitting does not");
  const MatrixXd correlation = sd.cwiseInverse().asDiagonal() * covariance * sd.cwiseInverse().asDiagonal();
  const SymmetricEigen eigen = symmetric_eigen(correlation);
  const VectorXd widths = eigen.values.reverse().cwiseMax(0).cwiseSqrt();
  const VectorXd used = widths.cwiseMax(narrowest * widths[0]);
  const MatrixXd axes = sd.asDiagonal() * eigen.vectors.rowwise().reverse() * used.asDiagonal();
  return {{centre.begin(), centre.end()}, row_major(axes), row_major(inverse_of(axes)), {widths.begin(), widths.end()}};
}

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Sums up the inverse covariances of responses.
struct MeanResponse {
  VectorXd first;
  MatrixXd inverses;
  double count = 0;
  void add(const VectorXd& state, const MatrixXd& covariance) {
    const NoiseFrame frame = frame_of(state, covariance);
    const Eigen::Map<const RowMajor> inverse(frame.inverse.data(), state.size(), state.size());
    if (count++ == 0) {
      first = state;
      inverses = MatrixXd::Zero(state.size(), state.size());
    }
    inverses += inverse.transpose() * inverse;
  }
};

/// Returns a state right beside a start: an orbit that is one itself may be unstable.
VectorXd beside(const BatchMap& map, std::span<const double> start) {
  VectorXd state = Eigen::Map<const VectorXd>(start.data(), map.dimension);
  return state + nudge * (state.cwiseAbs() + VectorXd::Constant(map.dimension, nudge));
}

// Returns after how many revolutions a state has come back, 0 for none.
int first_return(const std::deque<VectorXd>& before, const VectorXd& state, double tolerance) {
  for (std::size_t period = 1; period <= before.size(); ++period)
    if ((state - before[period - 1]).cwiseAbs().maxCoeff() <= tolerance * (1 + state.cwiseAbs().maxCoeff()))
      return static_cast<int>(period);
  return 0;
}

}  // namespace

std::optional<PeriodicGait> periodic_gait(const BatchMap& map, std::span<const double> start) {
  const Probe probe(map);
  const VectorXd quiet = VectorXd::Zero(map.scores);
  VectorXd state = beside(map, start);
  std::deque<VectorXd> before;  // the last states at phase 0, the latest first
  try {
    for (int revolution = 0; revolution < revolution_limit; ++revolution) {
      before.push_front(state);
      if (before.size() > static_cast<std::size_t>(longest_period)) before.pop_back();
      for (int phase = 0; phase < map.phases; ++phase) state = probe(phase, state, quiet, "without noise it fails");
      if (revolution <= least_revolutions) continue;
      // A way that alternates about the gait is near itself after twice the period first: the shortest near one counts.
      if (const auto found = first_return(before, state, period_tolerance); found > 0)
        return PeriodicGait{first_return(before, state, same_state), {state.begin(), state.end()}};
    }
  } catch (const MapError&) {  // it ends there: there is no gait to find
  }
  return std::nullopt;
}

int longer_period(const BatchMap& map, std::span<const double> start) {
  const Probe probe(map);
  const VectorXd quiet = VectorXd::Zero(map.scores);
  VectorXd state = beside(map, start), settled;
  int first = 0;  // return after the settled state
  try {
    for (int revolution = 1; revolution <= revolution_limit + 2 * longest_told_period; ++revolution) {
      for (int phase = 0; phase < map.phases; ++phase) state = probe(phase, state, quiet, "without noise it fails");
      const int since = revolution - revolution_limit;
      if (since == 0) settled = state;
      if (since <= 0 || first_return({settled}, state, same_state) == 0) continue;
      if (first > 0) return since == 2 * first && first > longest_period ? first : 0;  // a chance is not met twice
      first = since;
    }
  } catch (const MapError&) {  // it ends there
  }
  return 0;
}

std::vector<NoiseFrame> common_frames(const std::vector<NoiseFrame>& frames, int phases) {
  std::vector<NoiseFrame> common;
  for (std::size_t phase = 0; phase < static_cast<std::size_t>(phases); ++phase) {
    const std::vector<double>& centre = frames[phase].centre;
    const auto d = static_cast<Index>(centre.size());
    MatrixXd sum = MatrixXd::Zero(d, d);
    for (std::size_t k = phase; k < frames.size(); k += static_cast<std::size_t>(phases)) {
      const Eigen::Map<const RowMajor> axes(frames[k].axes.data(), d, d);
      sum += axes * axes.transpose();
    }
    const double count = static_cast<double>(frames.size()) / phases;
    common.push_back(frame_of(Eigen::Map<const VectorXd>(centre.data(), d), sum / count));
  }
  return common;
}

std::optional<NoiseFreeWalk> noise_free_walk(const BatchMap& map, std::span<const double> start) {
  require_start(map, start);
  const auto phases = static_cast<std::size_t>(map.phases), kept = static_cast<std::size_t>(map.dimension) * phases;
  const std::vector<double> quiet(static_cast<std::size_t>(map.scores), 0.0);
  NoiseFreeWalk walk;
  std::vector<MeanResponse> met(phases);
  std::vector<Derivatives> last;  // of the steps that led here, the latest last
  VectorXd state = beside(map, start);
  for (std::size_t step = 0; step < walk_revolutions * phases && walk.fails_after == 0; ++step) {
    const int phase = static_cast<int>(step % phases);
    if (last.size() == kept) {
      MatrixXd covariance = MatrixXd::Zero(map.dimension, map.dimension);
      for (const Derivatives& d : last)
        covariance = d.by_state * covariance * d.by_state.transpose() + d.by_scores * d.by_scores.transpose();
      if (covariance.diagonal().minCoeff() > 0) met[step % phases].add(state, covariance);
      last.erase(last.begin());
    }
    try {
      last.push_back(derivatives(map, phase, state));
    } catch (const NoOrbit&) {  // it fails right beside this state
      last.clear();
    }
    VectorXd next(map.dimension);
    std::uint8_t failed = 0;
    map.step(phase, {state.data(), start.size()}, quiet, {next.data(), start.size()}, {&failed, 1});
    if (!failed && !is_landing(map, (phase + 1) % map.phases, {next.data(), start.size()})) return std::nullopt;
    if (failed) walk.fails_after = step + 1;
    state = next;
  }
  for (const MeanResponse& response : met) {
    if (response.count == 0) return std::nullopt;
    walk.frames.push_back(frame_of(response.first, inverse_of(response.inverses / response.count)));
  }
  return walk;
}

BatchMap over_revolutions(const BatchMap& map, int revolutions) {
  BatchMap longer = map;
  longer.phases = map.phases * revolutions;
  const int phases = map.phases;
  if (map.step)
    longer.step = [step = map.step, phases](int phase, auto states, auto scores, auto next, auto failed) {
      step(phase % phases, states, scores, next, failed);
    };
  if (map.draw)
    longer.draw = [draw = map.draw, phases](int phase, auto states, auto words, auto next, auto failed) {
      draw(phase % phases, states, words, next, failed);
    };
  if (map.inside)
    longer.inside = [inside = map.inside, phases](int phase, auto state) { return inside(phase % phases, state); };
  return longer;
}

std::vector<NoiseFrame> noise_frames(const BatchMap& map, std::span<const double> start) {
  return noise_free_orbit(map, start).frames;
}

NoiseFreeOrbit noise_free_orbit(const BatchMap& map, std::span<const double> start) {
  require_start(map, start);
  if (map.dimension > most_mesh_dimensions)
    throw TooManyDimensions(
        fmt::format("return map: {} dimensions, where meshes hold 1 to {}; --method splitting takes up to {}",
                    map.dimension, most_mesh_dimensions, most_dimensions));
  if (map.scores == 0)
    throw MapError(
        "return map: it draws for itself, so the tails of its noise cannot be weighted; it can be simulated and split "
        "only");
  const Probe probe(map);
  const std::vector<VectorXd> orbit = settled_orbit(map, probe, start);
  std::vector<MatrixXd> a, q;
  MatrixXd revolution = MatrixXd::Identity(map.dimension, map.dimension);
  for (int phase = 0; phase < map.phases; ++phase) {
    const VectorXd& state = orbit[static_cast<std::size_t>(phase)];
    const auto [by_state, by_scores] = derivatives(map, phase, state);
    a.push_back(by_state);
    q.push_back(by_scores * by_scores.transpose());
    revolution = a.back() * revolution;
  }
  const double growth = spectral_radius(revolution);
  if (!(growth < 1))
    throw NoOrbit(fmt::format("return map: without noise its orbit through {} is unstable (largest eigenvalue {:.6g})",
                              describe_state(map, {orbit[0].data(), static_cast<std::size_t>(map.dimension)}), growth));
  MatrixXd covariance = MatrixXd::Zero(map.dimension, map.dimension);
  std::vector<NoiseFrame> frames(static_cast<std::size_t>(map.phases));
  const int revolutions = 10 + static_cast<int>(std::min(1e4, std::ceil(40 / -std::log(std::max(growth, 1e-6)))));
  for (int r = 0; r < revolutions; ++r) {
    for (int phase = 0; phase < map.phases; ++phase) {
      const auto p = static_cast<std::size_t>(phase);
      if (r + 1 == revolutions) frames[p] = frame_of(orbit[p], covariance);
      covariance = a[p] * covariance * a[p].transpose() + q[p];
    }
  }
  return {std::move(frames), eigenvalues_of(revolution)};
}

}  // namespace metastable::markov
