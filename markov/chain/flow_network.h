#pragma once
// Corrects residuals of a large irreducible chain on ever coarser groups of states that change places quickly.

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "markov/chain/generator.h"

namespace metastable::markov {

enum class FlowSide { from, into };  ///< A x = g, or its transpose, whose rows are the flows into a state
/// threshold: joins states along every strong flow; strongest: along the strongest one of each state only, which makes
/// more levels
enum class Grouping { threshold, strongest };

/// Holds the flows f_ij = y_i q_ij between the states of a generator and the losses l_i = y_i kill_i, on all levels, in
/// the precision Real: double, or Extended where the flows leave its range or it gains nothing.
///
/// The equations are (A x)_i = l_i x_i + sum_j f_ij (x_i - x_j) = g_i and their transposes. On a coarser level the
/// states of a group stand for one: flows and losses are added up, nothing is subtracted (aggregation and
/// disaggregation of Takahashi 1975; Koury, McAllister, Stewart, SIAM J. Alg. Disc. Meth. 5, 1984, level after level).
/// Groups are joined by their strongest flows, so that weak couplings are left for the coarsest level, which is
/// eliminated.
template <typename Real>
class FlowNetwork {
 public:
  using Row = std::vector<Real>;

  /// @param visits  y, size n, > 0
  /// @param lossless  takes the losses for zero
  FlowNetwork(const Generator& generator, std::span<const Extended> visits, bool lossless, Grouping grouping);
  ~FlowNetwork();
  FlowNetwork(FlowNetwork&&) noexcept;
  FlowNetwork& operator=(FlowNetwork&&) noexcept;

  std::span<const Real> loss() const;
  /// Returns loss and flows out of each state.
  std::span<const Real> total() const;
  /// Returns A x by differences, of the transpose as if as much arrived in each state as leaves it.
  Row apply(std::span<const Real> x, FlowSide side) const;
  /// Returns A^T x, whatever arrives.
  Row apply_unbalanced(std::span<const Real> x) const;
  /// Returns a correction x with A x near the residual (a cycle over all levels).
  Row corrected(std::span<const Real> residual, FlowSide side) const;

 private:
  struct Level;
  Row cycle(std::size_t at, std::span<const Real> residual, FlowSide side) const;
  void coarsen(Grouping grouping);

  std::vector<Level> levels_;
  std::unique_ptr<GeneratorFactors> coarsest_;
};

extern template class FlowNetwork<double>;
extern template class FlowNetwork<Extended>;

}  // namespace metastable::markov
