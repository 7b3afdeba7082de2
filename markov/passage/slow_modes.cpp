#include "markov/passage/slow_modes.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numeric>

#include "markov/chain/generator_solver.h"

namespace metastable::markov {
namespace {

using Row = std::vector<Extended>;
using Complex = std::complex<Extended>;
using Projection = Eigen::Matrix<Extended, Eigen::Dynamic, Eigen::Dynamic>;

constexpr int most_modes = 100;
constexpr int asked_each_time = 12;     // Up to so many modes each one is tried, then each sixth. This saves time.
constexpr Extended none_left = 1e-17L;  // A share of survivors below this is rounding.
constexpr Extended none_proven = std::numeric_limits<Extended>::infinity();

Extended product(std::span<const Extended> a, std::span<const Extended> b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), Extended{0});
}

/// Returns log(1 - mu) to as many digits as a small mu has.
Complex log_kept(const Complex& mu) {
  const Extended square = mu.real() * mu.real() + mu.imag() * mu.imag();
  return {std::log1p(square - 2 * mu.real()) / 2, std::atan2(-mu.imag(), 1 - mu.real())};
}

/// Holds what is needed of a mode u_j, of which (1 - mu_j)^m is left after m steps.
struct Mode {
  Complex log_kept, sum;          ///< log(1 - mu_j); the sum of u_j over the states
  Extended size = 0, missed = 0;  ///< sums over the states of |u_j| and of |D_j|, which it misses in a step
  Extended weighted_size = 0, weighted_missed = 0;  ///< the same, states weighted by w
};

/// Takes the quasi-stationary part out of survivors, and the rest apart in a Krylov space of (I - Q)^-1 that grows.
class SlowModes {
 public:
  SlowModes(const Chain& chain, const QuasiStationary& quasi, std::span<const double> survivors, const Heard& heard)
      : generator_(generator_of(chain)),
        distribution_(quasi.distribution.begin(), quasi.distribution.end()),
        weight_(quasi.survival_weight.begin(), quasi.survival_weight.end()),
        log_quasi_(std::log1p(-static_cast<Extended>(quasi.failure_rate))),
        solver_(generator_, heard),
        left_(survivors.begin(), survivors.end()) {
    least_weight_ = *std::min_element(weight_.begin(), weight_.end());
    settled_ = without_quasi(left_);
    length_ = std::sqrt(product(left_, left_));
    basis_.push_back(left_);
    for (Extended& entry : basis_[0]) entry /= length_;
    ended_ = !(length_ > none_left);
  }

  bool ended() const { return ended_; }
  int size() const { return static_cast<int>(hessenberg_.cols()); }
  /// Adds a vector to the space, unless it has ended.
  void grow() {
    const auto k = static_cast<Eigen::Index>(basis_.size());
    Row next = solver_.solve_left(basis_.back());
    without_quasi(next);
    hessenberg_.conservativeResizeLike(Projection::Zero(k + 1, k));
    for (const int pass : {0, 1}) {  // The second pass takes out what rounding left in the first.
      static_cast<void>(pass);
      for (Eigen::Index i = 0; i < k; ++i) {
        const Row& one = basis_[static_cast<std::size_t>(i)];
        const Extended along = product(next, one);
        hessenberg_(i, k - 1) += along;
        for (std::size_t s = 0; s < next.size(); ++s) next[s] -= along * one[s];
      }
    }
    const Extended length = std::sqrt(product(next, next));
    hessenberg_(k, k - 1) = length;
    ended_ = !(length > none_left * hessenberg_.col(k - 1).head(k).norm());
    if (ended_) return;
    for (Extended& entry : next) entry /= length;
    basis_.push_back(std::move(next));
  }

  /// Takes what is left apart into the modes of the space.
  void find() {
    const Eigen::Index k = hessenberg_.cols();
    const Eigen::EigenSolver<Projection> solved(hessenberg_.topRows(k));
    const Eigen::Matrix<Complex, Eigen::Dynamic, Eigen::Dynamic> vectors = solved.eigenvectors();
    Eigen::Matrix<Complex, Eigen::Dynamic, 1> first = Eigen::Matrix<Complex, Eigen::Dynamic, 1>::Zero(k);
    first[0] = length_;
    const Eigen::Matrix<Complex, Eigen::Dynamic, 1> parts = vectors.partialPivLu().solve(first);
    modes_.clear();
    Row rest = left_;
    for (Eigen::Index j = 0; j < k; ++j) {
      std::vector<Complex> u(left_.size());
      for (Eigen::Index i = 0; i < k; ++i) {
        const Complex share = parts[j] * vectors(i, j);
        for (std::size_t s = 0; s < u.size(); ++s) u[s] += share * basis_[static_cast<std::size_t>(i)][s];
      }
      for (std::size_t s = 0; s < u.size(); ++s) rest[s] -= u[s].real();
      modes_.push_back(measured(u, Extended{1} / solved.eigenvalues()[j]));
    }
    rounded_ = weighted_rounded_ = 0;
    for (std::size_t s = 0; s < rest.size(); ++s) {
      rounded_ += std::abs(rest[s]);
      weighted_rounded_ += std::abs(rest[s]) * weight_[s];
    }
  }

  struct Told {
    Extended survival = 0, error = none_proven;  ///< the error relative
  };
  /// Returns the probability of surviving m more steps.
  Told after(Extended m) const {
    const Extended faded = std::exp(m * log_quasi_);
    Told told{.survival = settled_ * faded};
    Extended error = rounded_, weighted = weighted_rounded_;
    for (const Mode& mode : modes_) {
      // The mode loses such a share in a step, as it is and relative to the quasi-stationary part.
      const Extended fading = -std::expm1(mode.log_kept.real());
      const Extended beside = -std::expm1(mode.log_kept.real() - log_quasi_) * std::exp(log_quasi_);
      const Extended missed = mode.missed * std::min(m, 1 / fading);
      const bool kept = beside > 0 && missed < mode.size;
      if (kept) told.survival += (std::exp(m * mode.log_kept) * mode.sum).real();
      error += kept ? missed : mode.size;
      weighted += kept ? mode.weighted_missed / beside : mode.weighted_size;
    }
    if (told.survival > 0) told.error = error / told.survival;
    // Survival that is too small for a floating-point number has its error relative to the quasi-stationary part.
    const Extended faded_in_all = told.survival > 0 ? faded / told.survival : faded == 0 ? 1 / settled_ : none_proven;
    if (least_weight_ > 0) told.error = std::min(told.error, weighted / least_weight_ * faded_in_all);
    return told;
  }

 private:
  /// Takes the quasi-stationary part out of a row vector and returns how much it was.
  Extended without_quasi(Row& v) const {
    const Extended part = product(v, weight_) / product(distribution_, weight_);
    for (std::size_t i = 0; i < v.size(); ++i) v[i] -= part * distribution_[i];
    return part;
  }

  Mode measured(const std::vector<Complex>& u, const Complex& mu) const {
    Mode mode{.log_kept = log_kept(mu), .sum = std::accumulate(u.begin(), u.end(), Complex{})};
    std::vector<Complex> missed(u.size());  // u (I - Q) - mu u
    for (std::size_t i = 0; i < u.size(); ++i) {
      missed[i] += u[i] * generator_.exit(i) - mu * u[i];
      for (std::size_t e = generator_.start[i]; e < generator_.start[i + 1]; ++e)
        missed[generator_.column[e]] -= u[i] * generator_.rate[e];
    }
    for (std::size_t i = 0; i < u.size(); ++i) {
      mode.size += std::abs(u[i]);
      mode.weighted_size += std::abs(u[i]) * weight_[i];
      mode.missed += std::abs(missed[i]);
      mode.weighted_missed += std::abs(missed[i]) * weight_[i];
    }
    return mode;
  }

  Generator generator_;
  Row distribution_, weight_;
  Extended log_quasi_;
  GeneratorSolver solver_;
  Row left_;
  Extended least_weight_ = 0, settled_ = 0, length_ = 0, rounded_ = 0, weighted_rounded_ = 0;
  bool ended_ = false;
  std::vector<Row> basis_;  ///< orthonormal
  Projection hessenberg_;
  std::vector<Mode> modes_;
};

}  // namespace

std::vector<double> survival_by_slow_modes(const Chain& chain, const QuasiStationary& quasi,
                                           std::span<const double> survivors, std::span<const double> more,
                                           double widest, const Heard& heard) {
  SlowModes modes(chain, quasi, survivors, heard);
  Extended worst = none_proven;
  while (!modes.ended() && modes.size() < most_modes) {
    if (heard) heard();
    modes.grow();
    const int size = modes.size();
    if (!modes.ended() && size > asked_each_time && size % 6 != 0 && size < most_modes) continue;
    modes.find();
    worst = 0;
    std::vector<double> told;
    for (const double m : more) {
      const SlowModes::Told at = modes.after(m);
      worst = std::max(worst, at.error);
      told.push_back(static_cast<double>(at.survival));
    }
    if (worst <= widest) return told;
  }
  throw ConvergenceError(
      "survival", static_cast<double>(worst),
      fmt::format("survivors have not settled, and {} slow modes do not tell how they do", modes.size()));
}

}  // namespace metastable::markov
