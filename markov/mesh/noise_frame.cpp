#include "markov/mesh/noise_frame.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <optional>

#include "markov/dense_matrix.h"

namespace metastable::markov {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kRevolutions = 5000;
constexpr double orbit_tolerance = 1e-11;
constexpr double kJumps = 3;         // derivative over the change from -1 to 1 sd, beyond which the map jumps
constexpr double kNarrowest = 0.05;  // of the widest axis: nodes there are no nearer

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
  /// Does the same; nothing where it fails or leads nowhere.
  std::optional<VectorXd> surviving(int phase, const VectorXd& state, const VectorXd& scores) const {
    VectorXd next(state.size());
    std::uint8_t failed = 0;
    map_.step(phase, {state.data(), static_cast<std::size_t>(state.size())},
              {scores.data(), static_cast<std::size_t>(scores.size())},
              {next.data(), static_cast<std::size_t>(next.size())}, {&failed, 1});
    if (failed || !next.allFinite()) return std::nullopt;
    return next;
  }

 private:
  const BatchMap& map_;
};

std::vector<VectorXd> settled_orbit(const BatchMap& map, const Probe& probe, std::span<const double> start) {
  const VectorXd quiet = VectorXd::Zero(map.scores);
  VectorXd state = Eigen::Map<const VectorXd>(start.data(), map.dimension);
  for (int revolution = 0; revolution < kRevolutions; ++revolution) {
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

MatrixXd by_state(const BatchMap& map, const Probe& probe, int phase, const VectorXd& state) {
  const VectorXd quiet = VectorXd::Zero(map.scores);
  const char* const fails = "without noise it fails right beside its orbit";
  MatrixXd a(map.dimension, map.dimension);
  for (Index k = 0; k < map.dimension; ++k) {
    const double h = 1e-5 * std::max(std::abs(state[k]), 1e-2);
    VectorXd low = state, high = state;
    low[k] -= h;
    high[k] += h;
    a.col(k) = (probe(phase, high, quiet, fails) - probe(phase, low, quiet, fails)) / (2 * h);
  }
  return a;
}

MatrixXd by_scores(const BatchMap& map, const Probe& probe, int phase, const VectorXd& state) {
  constexpr double h = 1e-2;
  const char* const fails = "on its noise-free orbit a noise of 0.01 sd makes it fail";
  MatrixXd b(map.dimension, map.scores);
  for (Index k = 0; k < map.scores; ++k) {
    VectorXd low = VectorXd::Zero(map.scores), high = low;
    low[k] = -h;
    high[k] = h;
    b.col(k) = (probe(phase, state, high, fails) - probe(phase, state, low, fails)) / (2 * h);
    const auto up = probe.surviving(phase, state, high / h), down = probe.surviving(phase, state, low / h);
    if (!up || !down) continue;
    for (Index i = 0; i < map.dimension; ++i) {
      const double wide = ((*up)[i] - (*down)[i]) / 2;
      if (wide != 0 && std::abs(b(i, k)) > kJumps * std::abs(wide)) b(i, k) = wide;
    }
  }
  return b;
}

std::vector<double> row_major(const MatrixXd& m) {
  std::vector<double> out;
  for (Index i = 0; i < m.rows(); ++i)
    for (Index j = 0; j < m.cols(); ++j) out.push_back(m(i, j));
  return out;
}

}  // namespace

std::vector<NoiseFrame> noise_frames(const BatchMap& map, std::span<const double> start) {
  require_start(map, start);
  if (map.scores == 0)
    throw MapError(
        "return map: it draws for itself, so the tails of its noise cannot be weighted; it can be simulated only");
  const Probe probe(map);
  const std::vector<VectorXd> orbit = settled_orbit(map, probe, start);
  std::vector<MatrixXd> a, q;
  MatrixXd revolution = MatrixXd::Identity(map.dimension, map.dimension);
  for (int phase = 0; phase < map.phases; ++phase) {
    const VectorXd& state = orbit[static_cast<std::size_t>(phase)];
    a.push_back(by_state(map, probe, phase, state));
    const MatrixXd b = by_scores(map, probe, phase, state);
    q.push_back(b * b.transpose());
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
      if (r + 1 == revolutions) {
        const VectorXd sd = covariance.diagonal().cwiseSqrt();
        if (!(sd.minCoeff() > 0)) throw MapError("return map: the noise does not move every number of the state");
        const MatrixXd correlation = sd.cwiseInverse().asDiagonal() * covariance * sd.cwiseInverse().asDiagonal();
        const SymmetricEigen eigen = symmetric_eigen(correlation);
        const VectorXd widths = eigen.values.reverse().cwiseMax(0).cwiseSqrt();
        const VectorXd used = widths.cwiseMax(kNarrowest * widths[0]);
        const MatrixXd axes = sd.asDiagonal() * eigen.vectors.rowwise().reverse() * used.asDiagonal();
        frames[p].centre.assign(orbit[p].begin(), orbit[p].end());
        frames[p].axes = row_major(axes);
        frames[p].inverse = row_major(inverse_of(axes));
        frames[p].sds.assign(widths.begin(), widths.end());
      }
      covariance = a[p] * covariance * a[p].transpose() + q[p];
    }
  }
  return frames;
}

}  // namespace metastable::markov
