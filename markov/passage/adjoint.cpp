#include "markov/passage/adjoint.h"

#include <algorithm>
#include <numeric>
#include <stdexcept>

namespace metastable::markov {
namespace {

// Returns sum_j q_ij (m_j - m_i) - k_i m_i, row i's share of (Q - I) m.
double drift(const Adjoint& at, const Chain& chain, std::size_t i) {
  const auto columns = chain.columns(i);
  const auto values = chain.values(i);
  double sum = 0;
  for (std::size_t e = 0; e < columns.size(); ++e) sum += values[e] * (at.excess[columns[e]] - at.excess[i]);
  return sum - chain.kill(i) * at.mean[i];
}

}  // namespace

Adjoint adjoint(const ChainSolver& solver, const Launch& launch) {
  Adjoint at;
  at.mean = mean_first_passage(solver);
  at.visits = solver.solve_left(launch.after);
  at.steps = 1 + std::inner_product(launch.after.begin(), launch.after.end(), at.mean.begin(), 0.0);
  at.reference = static_cast<std::size_t>(std::max_element(at.visits.begin(), at.visits.end()) - at.visits.begin());
  const Chain& chain = solver.chain();
  at.excess.assign(chain.size(), 0.0);
  if (chain.size() == 1) return at;
  std::vector<std::uint32_t> others;
  std::vector<double> kill;
  for (std::size_t i = 0; i < chain.size(); ++i) {
    if (i == at.reference) continue;
    others.push_back(static_cast<std::uint32_t>(i));
    kill.push_back(chain.kill(i));
  }
  const ChainSolver without = on_states(others, [&] { return ChainSolver(chain.restricted_to(others)); });
  const std::vector<double> time = without.solve(std::vector<double>(others.size(), 1.0)), rest = without.solve(kill);
  for (std::size_t k = 0; k < others.size(); ++k) at.excess[others[k]] = time[k] - rest[k] * at.mean[at.reference];
  return at;
}

double steps_change(const Adjoint& at, const Chain& from, const Launch& launch_from, const Chain& to,
                    const Launch& launch_to) {
  const std::size_t n = at.mean.size();
  if (from.size() != n || to.size() != n || launch_from.after.size() != n || launch_to.after.size() != n)
    throw std::invalid_argument("steps_change: chains of different sizes");
  double change = -(launch_to.rest - launch_from.rest) * at.mean[at.reference];
  for (std::size_t i = 0; i < n; ++i) {
    change += (launch_to.after[i] - launch_from.after[i]) * at.excess[i];
    if (at.visits[i] > 0) change += at.visits[i] * (drift(at, to, i) - drift(at, from, i));
  }
  return change;
}

}  // namespace metastable::markov
