#pragma once
// Bounds the expected number of steps of a map with a continuous state, with a guarantee.

#include <optional>
#include <string>
#include <vector>

namespace metastable::markov {

/// Bounds the landings of a return map, proven, phase by phase: C(x, e) = P(rest, or landing below e, from state x).
/// C must fall as x rises (the landing rises with the state).
class LandingSource {
 public:
  struct Range {
    double lower = 0, upper = 0;
  };
  /// Bounds C over a rectangle of x and e: ranges of its second derivatives, and by how much it may deviate from its
  /// chord across the rectangle beyond what they say (where it has none).
  struct Bend {
    Range state, edge;
    double loose_state = 0, loose_edge = 0;
  };
  virtual ~LandingSource() = default;
  virtual int phases() const = 0;
  /// Encloses C(x, e); at e = the lowest node of the next phase it is the probability of rest.
  virtual Range below(int phase, double state, double edge) const = 0;
  virtual std::optional<Bend> bend(int phase, Range state, Range edge) const = 0;
  /// Bounds E max(0, landing - edge) from a state from above.
  virtual double overshoot(int phase, double state, double edge) const = 0;
  /// Bounds the growth of overshoot() with the state from above, from `state` on.
  virtual double growth(int phase, double state) const = 0;
};

/// Bounds m(x), the expected steps before rest from state x, at the nodes. Between nodes both bounds are linear;
/// above the last node m lies between its lower bound there and upper + top_jump + top_slope (x - last node).
struct Certificate {
  std::vector<std::vector<double>> nodes;  ///< per phase
  std::vector<std::vector<double>> lower;  ///< per phase and node, not falling along the nodes
  std::vector<std::vector<double>> upper;  ///< the same; empty if there is no upper bound
  double top_jump = 0;                     ///< [steps]
  double top_slope = 0;                    ///< [steps per state unit]
  double solve_slack = 0;                  ///< relative width spent on the rounding of the solves
  std::string no_upper;                    ///< why there is no upper bound; empty if there is one
};

/// The proof is this: if v >= 0 is bounded and v(x) <= 1 + E v(x') for all x, then v <= m; if v >= 0 and v(x) >= 1 + E
/// v(x'), then v >= m (rest counts as v = 0; iterate n times and let n grow). Take v linear between nodes and not
/// falling. Then
///     E v(x') = v_0 (1 - C(x, e_0)) + sum_j (v_{j+1} - v_j) (1 - mean of C(x, e) over e in [e_j, e_{j+1}]),
/// so that upper bounds of C give lower bounds of E v, and the other way round. The means are the trapezoidal values
/// less width^2/12 times the second derivative. Along x, with t the place in a cell [x_i, x_{i+1}], C(x) lies below (1
/// - t) U_i + t U_{i+1} if U exceeds C at the nodes by width^2/8 times the largest downward second derivative (or,
/// first order, by the fall of C across the cell: monotone rounding); so it is enough to have the inequality at nodes,
/// with U or its lower counterpart D in the place of C. The rows of these finite chains are their distribution
/// functions, doubles taken as exact; each chain is solved by subtraction-free elimination, the solution v is then
/// taken for granted: the smallest and largest of v - Q v, as sums of products of non-negative numbers and differences
/// of v with the a-priori bound of their rounding errors, say by how much v must be scaled to satisfy the inequality
/// strictly.
///
/// Above the last node K the lower v stays constant. The upper one adds W(x) = top_jump + top_slope (x - K), verified
/// to fall by one step on average; if no such drift exists, `no_upper` says so.
///
/// Width: second order in the spacing of the nodes.
/// @param nodes  per phase, ascending, the same number in each; the first is the lowest state of a survivor (or less),
/// the
///               last is the same K for all phases
/// @param beyond  a state above K up to which the source can be asked
/// @throws std::invalid_argument for nodes of different or too small numbers; ConvergenceError when expected
///         steps are too many for double precision (the rounding of v alone uses up the bound, about 1e14 steps)
/// Cost: about a microsecond per pair of nodes, and two solves with the chains.
Certificate certify(const LandingSource& source, std::vector<std::vector<double>> nodes, double beyond,
                    int threads = 0);

}  // namespace metastable::markov
