#pragma once
// Measures how accurate the program is: stability under doubling, known values, solvers side by side, coverage.

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "analysis/study/problem.h"
#include "dynamics/settled/settled_map.h"
#include "markov/transition_rows/discretization.h"

namespace metastable::analysis {

/// One problem to verify on, with what is known of it.
struct Benchmark {
  std::string name;
  Problem problem;
  double tolerance = 1e-8;  ///< wanted stability of the expected steps and the failure rate under doubling of nodes
  std::optional<double> known_failure_rate, known_from_quasi_stationary, known_from_start;
  bool by_collocation = false;  ///< compared with a study that collocates (analysis/study/exact_rows.h), to `tolerance`
};

/// Returns the rough-terrain wheel (mean slope 8 deg, from its fixed point; sixty-digit values for sds of 2, 1.5 and 1
/// deg) out to about 1e40 steps, and the paper's wheel from 3 to about 1e17.
std::vector<Benchmark> rough_terrain_benchmarks();
std::vector<Benchmark> wheel_benchmarks();

/// Holds the answers of one benchmark on Gauss-Legendre nodes doubled until the tolerance is met.
struct Verified {
  std::size_t nodes = 0;  ///< per phase, of the finest
  double from_start = 0, from_quasi_stationary = 0, failure_rate = 0;
  double change = 0;            ///< largest relative change of the three at the last doubling
  std::optional<double> error;  ///< largest relative distance from the known values, or those of collocation
  /// Give the same by other solvers: expected steps from the launch by sparse LU, from the
  /// quasi-stationary distribution as 1 / (1 - lambda_1) by Arnoldi; nothing where they give up. Neither has to be
  /// positive.
  std::optional<double> lu_from_start, arnoldi_from_quasi_stationary;
  markov::SampledChain chain;  ///< of the finest nodes
};
/// @param most_nodes per phase, where doubling stops whatever the change
Verified verify(const Benchmark& benchmark, int threads, std::size_t most_nodes = 512);

/// Holds the table that `settled` is read from against landings that are followed (SettledMapErrors).
struct VerifiedTable {
  std::string wheel;
  double slope_deg = 0;
  dynamics::SettledMapErrors error;
};
/// Verifies the tables of the paper's wheel with J = 0.0025 kg m^2 at 7.02 deg, and of one with equal legs, an eighth
/// of the work, at 9.59.
std::vector<VerifiedTable> verify_tables(int threads);

/// Says how often the sampled study's 95 % interval holds a value.
struct Coverage {
  int seeds = 0, inside = 0;
  double widest = 0;  ///< half-width over value; infinite where a study does not resolve rest
};
/// Makes the default study at seeds 1 .. seeds. Cost: that many studies.
Coverage coverage(const Problem& problem, double from_start, int seeds, int threads);

}  // namespace metastable::analysis
