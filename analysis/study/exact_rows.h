#pragma once
// Chooses which exact rows a problem gets: densities on nodes, or collocation.

#include <cstddef>
#include <utility>
#include <vector>

#include "analysis/study/problem.h"
#include "markov/transition_rows/node_rows.h"

namespace metastable::analysis {

/// Densities of the landing (markov/transition_rows/integrated.h) are fast, but `published` alone has smooth ones, and
/// theirs keep an error that more nodes do not remove: measured, up to 6e-6 of the expected steps where an eta near 0
/// is not rare, 1e-7 with the paper's eta. Every other noise, and tolerances below 2e-5, get collocation
/// (markov/transition_rows/collocation.h).
class ExactRows {
 public:
  /// @throws std::invalid_argument where the map tells neither (names the sampled method)
  ExactRows(const Problem& problem, double tolerance, int threads);

  bool collocated() const { return collocated_; }
  /// Returns the rows' error of the expected steps, relative, however many the nodes.
  double error() const;
  /// Says whether rest is out of the reach of doubles.
  bool unresolved() const { return ranges_.empty(); }
  /// Counts the nodes of the coarsest space, per phase.
  std::size_t coarsest() const;
  /// Has coarsest() times `panels` nodes a phase; phase p moved by shift[p], if given.
  markov::NodeSpace space(std::size_t panels, const std::vector<double>& shift = {}) const;
  markov::IntegratedChain chain(const Problem& problem, const markov::NodeSpace& space) const;
  /// Says where a launch leads, by a quadrature of its states that is halved so often.
  markov::Launch launch(const Problem& problem, const markov::NodeSpace& space, const markov::LaunchState& launch,
                        int halvings = 0) const;

 private:
  bool collocated_ = false;
  int threads_ = 1;
  double error_ = 0;
  double bulk_ = 0;  // over the lowest state; infinite if the launch lies in it
  std::vector<std::pair<double, double>> ranges_;
  std::vector<std::vector<double>> edges_;  // if collocated
};

}  // namespace metastable::analysis
