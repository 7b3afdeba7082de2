#include "markov/passage/survival_after.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <stdexcept>

#include "markov/chain/solver.h"
#include "markov/passage/bounded_survival.h"
#include "markov/passage/last_steps.h"
#include "markov/passage/quasi_stationary.h"

namespace metastable::markov {
namespace {

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr double followed_steps = 4096;  // that are always followed one by one
constexpr double start_tolerance = 1e-9;

double sum_of(std::span<const double> v) { return std::accumulate(v.begin(), v.end(), 0.0); }

/// Follows survivors for up to `last` steps; returns P(steps > n) for n = 0 .. last.
std::vector<double> followed(const Chain& chain, std::span<const double> start, std::size_t last) {
  std::vector<double> at{1}, survivors(start.begin(), start.end());
  long double log_survival = 0;
  for (std::size_t n = 1; n <= last; ++n) {
    const double all = sum_of(survivors);
    if (all == 0) {
      at.resize(last + 1, 0.0);
      break;
    }
    for (double& share : survivors) share /= all;
    double failing = 0;
    for (std::size_t i = 0; i < survivors.size(); ++i) failing += survivors[i] * chain.kill(i);
    survivors = apply_left(chain, survivors);
    log_survival += failing < 0.5 ? std::log1p(-failing) : std::log(sum_of(survivors));
    at.push_back(static_cast<double>(std::exp(log_survival)));
  }
  return at;
}

/// The chain watched every 2^k steps.
class Doubled {
 public:
  explicit Doubled(const Chain& chain) : fails_(Eigen::VectorXd::Zero(size_of(chain))) {
    onward_ = Matrix::Zero(size_of(chain), size_of(chain));
    for (std::size_t i = 0; i < chain.size(); ++i) {
      const auto row = static_cast<Eigen::Index>(i);
      fails_[row] = chain.kill(i);
      onward_(row, row) = chain.stay(i);
      for (std::size_t e = 0; e < chain.columns(i).size(); ++e) onward_(row, chain.columns(i)[e]) = chain.values(i)[e];
    }
  }

  void double_up() {
    fails_ = (fails_ + onward_ * fails_).eval();
    onward_ = (onward_ * onward_).eval();
    // Rows sum to what does not fail: errors of their sums would double with them.
    for (Eigen::Index i = 0; i < fails_.size(); ++i) {
      const double sum = onward_.row(i).sum();
      if (fails_[i] < 0.5 && sum > 0) onward_.row(i) *= (1 - fails_[i]) / sum;
      // A state that is hardly ever left is left as seldom as the others and failure say.
      const double leaves = sum_beside(i) + fails_[i];
      if (leaves < 0.5) onward_(i, i) = 1 - leaves;
    }
  }
  void advance(Eigen::RowVectorXd& survivors, double& failed) const {
    failed += survivors * fails_;
    survivors = (survivors * onward_).eval();
  }

 private:
  static Eigen::Index size_of(const Chain& chain) { return static_cast<Eigen::Index>(chain.size()); }
  double sum_beside(Eigen::Index i) const {
    return onward_.row(i).head(i).sum() + onward_.row(i).tail(onward_.cols() - i - 1).sum();
  }

  Matrix onward_;
  Eigen::VectorXd fails_;
};

/// Finds P(steps > n) for whole numbers n, by their binary digits.
std::vector<double> doubled(const Chain& chain, std::span<const double> start, std::vector<double> steps) {
  const Eigen::RowVectorXd from =
      Eigen::Map<const Eigen::RowVectorXd>(start.data(), static_cast<Eigen::Index>(start.size()));
  std::vector<Eigen::RowVectorXd> survivors(steps.size(), from);
  std::vector<double> failed(steps.size(), 0.0);
  for (Doubled chain_of_so_many(chain);; chain_of_so_many.double_up()) {
    bool done = true;
    for (std::size_t q = 0; q < steps.size(); ++q) {
      if (std::fmod(steps[q], 2) == 1) chain_of_so_many.advance(survivors[q], failed[q]);
      steps[q] = std::floor(steps[q] / 2);
      done = done && steps[q] == 0;
    }
    if (done) break;
  }
  std::vector<double> at;
  for (std::size_t q = 0; q < steps.size(); ++q) at.push_back(failed[q] < 0.5 ? 1 - failed[q] : survivors[q].sum());
  return at;
}

/// Finds the probability of never coming to rest.
double never(const Chain& chain, std::span<const double> start) {
  const Reachability reach = classify(chain);
  const PassageTo passage = passage_by_elimination(chain, std::vector<std::uint8_t>(chain.size(), 0));
  double never = 0;
  for (std::size_t i = 0; i < start.size(); ++i)
    if (!reach.must_rest[i]) never += start[i] * std::max(0.0, 1 - passage.fail[i]);
  return never;
}

}  // namespace

void check_survival(const Chain& chain, std::span<const double> start, std::span<const double> steps) {
  if (chain.interpolated()) throw std::invalid_argument("survival: interpolated chains are not taken");
  if (start.size() != chain.size())
    throw std::invalid_argument(fmt::format("start: {} probabilities given for {} states", start.size(), chain.size()));
  for (std::size_t i = 0; i < start.size(); ++i)
    if (!(start[i] >= 0)) throw std::invalid_argument(fmt::format("start: {} for state {} is below 0", start[i], i));
  if (!(std::abs(sum_of(start) - 1) <= start_tolerance))
    throw std::invalid_argument(fmt::format("start: probabilities sum to {:.12g}, 1 expected", sum_of(start)));
  for (const double n : steps)
    if (!(n >= 0 && n == std::floor(n)))
      throw std::invalid_argument(fmt::format("steps: {} is no whole number from 0 on, nor infinity", n));
}

std::vector<double> survival_after(const Chain& chain, std::span<const double> start, std::span<const double> steps) {
  check_survival(chain, start, steps);
  if (chain.size() > doubled_states) {
    std::optional<QuasiStationary> found;
    const auto quasi = [&]() -> const QuasiStationary& {
      if (!found) found = quasi_stationary(ChainSolver(chain));
      return *found;
    };
    return bounded_survival_after(chain, start, steps, quasi);
  }
  std::vector<double> far, at(steps.size());
  double last = 0;
  for (const double n : steps)
    if (n <= followed_steps) last = std::max(last, n);
  const std::vector<double> near = followed(chain, start, static_cast<std::size_t>(last));
  for (const double n : steps)
    if (n > followed_steps && std::isfinite(n)) far.push_back(n);
  const std::vector<double> beyond = far.empty() ? far : doubled(chain, start, far);
  auto next = beyond.begin();
  for (std::size_t q = 0; q < steps.size(); ++q) {
    if (std::isinf(steps[q]))
      at[q] = never(chain, start);
    else
      at[q] = steps[q] <= followed_steps ? near[static_cast<std::size_t>(steps[q])] : *next++;
  }
  return at;
}

}  // namespace metastable::markov
