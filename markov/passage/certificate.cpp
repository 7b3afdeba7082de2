#include "markov/passage/certificate.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "markov/chain/chain.h"
#include "markov/chain/solver.h"
#include "markov/parallel.h"

namespace metastable::markov {
namespace {

using Range = LandingSource::Range;
constexpr double outward = 0x1p-48;  // relative, past the rounding of the few operations behind a bound

double up(double v) { return v + (std::abs(v) * outward + 1e-300); }
double down(double v) { return v - (std::abs(v) * outward + 1e-300); }

// Holds the rows of one phase: distribution functions at (rest, cell 0, cell 1, ...), N + 1 values for N cells.
struct Rows {
  std::vector<std::vector<double>> upper, lower;  // U and D
  std::vector<double> surplus;                    // of E W(landing above the top), per node
};

class Rounding {
 public:
  Rounding(const LandingSource& source, int phase, const std::vector<double>& from, const std::vector<double>& to)
      : source_(source), phase_(phase), x_(from), e_(to) {}

  // Returns the bounds of C at (rest | mean over cell j) for node i, at index 0 | j + 1.
  std::vector<Range> node(std::size_t i) const {
    std::vector<Range> at(e_.size()), row(e_.size());
    for (std::size_t j = 0; j < e_.size(); ++j) at[j] = source_.below(phase_, x_[i], e_[j]);
    row[0] = at[0];
    for (std::size_t j = 0; j + 1 < e_.size(); ++j) {
      Range mean{at[j].lower, at[j + 1].upper};
      if (const auto bend = source_.bend(phase_, {x_[i], x_[i]}, {e_[j], e_[j + 1]})) {
        const double w = up(e_[j + 1] - e_[j]), twelfth = up(w * w / 12);
        const double low = 0.5 * (at[j].lower + at[j + 1].lower), high = 0.5 * (at[j].upper + at[j + 1].upper);
        mean.lower =
            std::max(mean.lower, down(down(low - up(twelfth * std::max(0.0, bend->edge.upper))) - bend->loose_edge));
        mean.upper =
            std::min(mean.upper, up(up(high + up(twelfth * std::max(0.0, -bend->edge.lower))) + bend->loose_edge));
        // The other sign helps: the mean is surely on that side of the trapezoid.
        const double twelfth_low = std::max(0.0, down(down(e_[j + 1] - e_[j]) * down(e_[j + 1] - e_[j]) / 12));
        if (bend->edge.upper < 0)
          mean.lower = std::max(mean.lower, down(down(low + twelfth_low * -bend->edge.upper) - bend->loose_edge));
        if (bend->edge.lower > 0)
          mean.upper = std::min(mean.upper, up(up(high - twelfth_low * bend->edge.lower) + bend->loose_edge));
      }
      row[j + 1] = {std::clamp(mean.lower, 0.0, 1.0), std::clamp(mean.upper, 0.0, 1.0)};
    }
    return row;
  }

  // Returns by how much U must exceed (D stay below) C at the ends of cell i.
  std::vector<std::pair<double, double>> excess(std::size_t i, const std::vector<Range>& left,
                                                const std::vector<Range>& right) const {
    std::vector<std::pair<double, double>> need(e_.size());
    const double w = up(x_[i + 1] - x_[i]), eighth = up(w * w / 8);
    for (std::size_t j = 0; j < e_.size(); ++j) {
      // To first order C falls along x.
      need[j] = {up(std::max(0.0, left[j].upper - right[j].upper)), up(std::max(0.0, left[j].lower - right[j].lower))};
      const Range edge = j == 0 ? Range{e_[0], e_[0]} : Range{e_[j - 1], e_[j]};
      if (const auto bend = source_.bend(phase_, {x_[i], x_[i + 1]}, edge)) {
        need[j].first = std::min(need[j].first, up(up(eighth * std::max(0.0, -bend->state.lower)) + bend->loose_state));
        need[j].second =
            std::min(need[j].second, up(up(eighth * std::max(0.0, bend->state.upper)) + bend->loose_state));
      }
    }
    return need;
  }

 private:
  const LandingSource& source_;
  int phase_;
  const std::vector<double>& x_;
  const std::vector<double>& e_;
};

Rows make_rows(const LandingSource& source, int phase, const std::vector<double>& from, const std::vector<double>& to,
               int threads) {
  const Rounding rounding(source, phase, from, to);
  const std::size_t n = from.size(), columns = to.size();
  std::vector<std::vector<Range>> exact(n);
  parallel_for(n, threads, [&](std::size_t i) { exact[i] = rounding.node(i); });
  std::vector<std::vector<std::pair<double, double>>> need(n - 1);
  parallel_for(n - 1, threads, [&](std::size_t i) { need[i] = rounding.excess(i, exact[i], exact[i + 1]); });
  Rows rows;
  rows.upper.assign(n, std::vector<double>(columns));
  rows.lower.assign(n, std::vector<double>(columns));
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < columns; ++j) {
      double more = 0, less = 0;
      if (i > 0) more = need[i - 1][j].first, less = need[i - 1][j].second;
      if (i + 1 < n) more = std::max(more, need[i][j].first), less = std::max(less, need[i][j].second);
      rows.upper[i][j] = std::min(1.0, up(exact[i][j].upper + more));
      rows.lower[i][j] = std::max(0.0, down(exact[i][j].lower - less));
    }
    // Distribution functions do not fall; raising U and lowering D keeps them bounds.
    for (std::size_t j = 1; j < columns; ++j) rows.upper[i][j] = std::max(rows.upper[i][j], rows.upper[i][j - 1]);
    for (std::size_t j = columns - 1; j-- > 0;) rows.lower[i][j] = std::min(rows.lower[i][j], rows.lower[i][j + 1]);
  }
  return rows;
}

// Solves v = rhs + Q v roughly, not falling along the nodes; the accuracy is checked afterwards.
std::vector<std::vector<double>> solve(const std::vector<Rows>& rows, bool lower) {
  const std::size_t phases = rows.size(), n = rows.front().upper.size();
  std::vector<std::size_t> start{0};
  std::vector<std::uint32_t> column;
  std::vector<double> value, kill, rhs;
  for (std::size_t p = 0; p < phases; ++p)
    for (std::size_t i = 0; i < n; ++i) {
      const std::vector<double>& c = lower ? rows[p].upper[i] : rows[p].lower[i];
      const std::size_t base = (p + 1) % phases * n;
      kill.push_back(c[0]);
      rhs.push_back(lower ? 1 : 1 + rows[p].surplus[i]);
      for (std::size_t j = 0; j < n; ++j) {
        const double weight = (j + 1 < n ? c[j + 1] : 1.0) - c[j];
        if (weight > 0 && base + j != p * n + i) {
          column.push_back(static_cast<std::uint32_t>(base + j));
          value.push_back(weight);
        }
      }
      start.push_back(column.size());
    }
  const ChainSolver solver(Chain(std::move(start), std::move(column), std::move(value), std::move(kill)));
  const std::vector<double> flat = solver.solve(rhs);
  std::vector<std::vector<double>> v(phases);
  for (std::size_t p = 0; p < phases; ++p) {
    v[p].assign(flat.begin() + static_cast<std::ptrdiff_t>(p * n),
                flat.begin() + static_cast<std::ptrdiff_t>((p + 1) * n));
    for (std::size_t i = 1; i < n; ++i) v[p][i] = std::max(v[p][i], v[p][i - 1]);
  }
  return v;
}

// Sums v - Q v at node i of a phase, from a row of C and v at the next phase.
struct Left {
  Left(const std::vector<double>& c, long double here, const std::vector<double>& next) : sum(c[0] * here) {
    const std::size_t n = next.size();
    long double size = sum;
    for (std::size_t j = 0; j < n; ++j) {
      const long double weight = (j + 1 < n ? static_cast<long double>(c[j + 1]) : 1.0L) - c[j];
      const long double term = weight * (here - next[j]);
      sum += term;
      size += std::abs(term);
    }
    // Each term has three roundings, the sum n: relative (n + 4) eps of the sum of magnitudes, and to spare.
    error = size * std::numeric_limits<long double>::epsilon() * static_cast<long double>(2 * n + 16);
  }
  long double sum, error;
};

// Bounds (v - Q v) / rhs over all nodes.
Range residual(const std::vector<Rows>& rows, const std::vector<std::vector<double>>& v, bool lower) {
  const std::size_t phases = rows.size(), n = rows.front().upper.size();
  Range all{std::numeric_limits<double>::infinity(), 0};
  for (std::size_t p = 0; p < phases; ++p)
    for (std::size_t i = 0; i < n; ++i) {
      const Left left(lower ? rows[p].upper[i] : rows[p].lower[i], v[p][i], v[(p + 1) % phases]);
      const double rhs = lower ? 1 : 1 + rows[p].surplus[i];
      all.lower = std::min(all.lower, down(down(static_cast<double>(left.sum - left.error)) / up(rhs)));
      all.upper = std::max(all.upper, up(up(static_cast<double>(left.sum + left.error)) / down(rhs)));
    }
  return all;
}

// Lowers v, where it is above 1 + Q v, until it nowhere is by much. Rows of states from which landings change sharply
// bound them loosely, so that the solution falls along some nodes, and what raised it there breaks its equations; few
// landings lead to such states, so that lowering v at them costs the others little.
void lower_to_its_rows(const std::vector<Rows>& rows, std::vector<std::vector<double>>& v) {
  constexpr double enough = 1e-9;
  constexpr int most_rounds = 100;
  const std::size_t phases = rows.size(), n = rows.front().upper.size();
  for (int round = 0; round < most_rounds; ++round) {
    bool lowered = false;
    for (std::size_t p = 0; p < phases; ++p)
      for (std::size_t i = n; i-- > 0;) {
        const Left left(rows[p].upper[i], v[p][i], v[(p + 1) % phases]);
        const double excess = static_cast<double>(left.sum) - 1;
        const double fits = excess > enough ? std::max(0.0, v[p][i] - excess) : v[p][i];
        lowered = lowered || excess > enough;
        v[p][i] = i + 1 < n ? std::min(fits, v[p][i + 1]) : fits;
      }
    if (!lowered) return;
  }
}

void check(const std::vector<std::vector<double>>& nodes, int phases, double beyond) {
  if (phases < 1 || nodes.size() != static_cast<std::size_t>(phases))
    throw std::invalid_argument("certify: nodes must be given for every phase");
  for (const auto& one : nodes) {
    if (one.size() < 3 || one.size() != nodes.front().size())
      throw std::invalid_argument("certify: every phase needs the same number of nodes, at least 3");
    for (std::size_t i = 1; i < one.size(); ++i)
      if (!(one[i] > one[i - 1])) throw std::invalid_argument("certify: nodes must ascend");
    if (one.back() != nodes.front().back())
      throw std::invalid_argument("certify: the last node must be the same in every phase");
  }
  if (!(beyond > nodes.front().back())) throw std::invalid_argument("certify: `beyond` must lie above the last node");
}

// Finds W(x) = jump + slope (x - K) that falls by one step on average wherever x > K.
bool drift(const LandingSource& source, double top, double beyond, Certificate& certificate) {
  double rate = 0, extra = 0, stay = 0;
  for (int p = 0; p < source.phases(); ++p) {
    rate = std::max(rate, source.growth(p, top));
    extra = std::max(extra, source.overshoot(p, top, top));
    stay = std::max(stay, up(1 - source.below(p, beyond, top).lower));
  }
  // Up to `beyond` it needs jump (1 - stay) >= 1 + slope extra, from there on slope ((1 - rate)(x - K) - extra) >= 1.
  const double gap = down(down(1 - rate) * down(beyond - top) - extra);
  if (!(rate < 1 && stay < 1 && gap > 0)) return false;
  certificate.top_slope = up(1 / gap);
  certificate.top_jump = up(up(1 + up(certificate.top_slope * extra)) / down(1 - stay));
  return true;
}

}  // namespace

Certificate certify(const LandingSource& source, std::vector<std::vector<double>> nodes, double beyond, int threads) {
  check(nodes, source.phases(), beyond);
  Certificate certificate;
  const auto phases = static_cast<std::size_t>(source.phases());
  std::vector<Rows> rows(phases);
  for (std::size_t p = 0; p < phases; ++p)
    rows[p] = make_rows(source, static_cast<int>(p), nodes[p], nodes[(p + 1) % phases], threads);

  certificate.lower = solve(rows, true);
  lower_to_its_rows(rows, certificate.lower);
  const Range below = residual(rows, certificate.lower, true);
  if (!(below.upper < 2))
    throw ConvergenceError("certificate", below.upper, "expected steps are too many for double precision");
  certificate.solve_slack = below.upper - 1;
  for (auto& phase : certificate.lower)
    for (double& v : phase) v = down(v / below.upper);

  const double top = nodes.front().back();
  if (!drift(source, top, beyond, certificate)) {
    certificate.no_upper = "no drift back from states above the top edge could be verified";
  } else {
    for (std::size_t p = 0; p < phases; ++p) {
      const std::size_t n = nodes[p].size();
      rows[p].surplus.resize(n);
      for (std::size_t i = 0; i < n; ++i) {
        // It rises with the state, so it is taken at the next node.
        const double x = nodes[p][std::min(i + 1, n - 1)];
        const double above = std::max(0.0, up(1 - source.below(static_cast<int>(p), x, top).lower));
        rows[p].surplus[i] = up(up(certificate.top_jump * above) +
                                up(certificate.top_slope * source.overshoot(static_cast<int>(p), x, top)));
      }
    }
    bool rests = true;
    for (const Rows& one : rows)
      rests = rests && std::any_of(one.lower.begin(), one.lower.end(), [](const auto& row) { return row[0] > 0; });
    try {
      if (!rests) throw std::domain_error("rest");
      certificate.upper = solve(rows, false);
      const Range above = residual(rows, certificate.upper, false);
      if (!(above.lower > 0.5))
        throw ConvergenceError("certificate", above.lower, "expected steps are too many for double precision");
      certificate.solve_slack = std::max(certificate.solve_slack, 1 - above.lower);
      for (auto& phase : certificate.upper)
        for (double& v : phase) v = up(v / above.lower);
    } catch (const std::domain_error&) {
      certificate.upper.clear();
      certificate.no_upper = "rest could not be shown to be reached from every state";
    }
  }
  certificate.nodes = std::move(nodes);
  return certificate;
}

}  // namespace metastable::markov
