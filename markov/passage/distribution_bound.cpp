#include "markov/passage/distribution_bound.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>

#include "markov/chain/elimination.h"
#include "markov/chain/generator_solver.h"

namespace metastable::markov {
namespace {

using Row = std::vector<Extended>;

constexpr Extended extended_unit = std::numeric_limits<Extended>::epsilon();
constexpr Extended unbounded = std::numeric_limits<Extended>::infinity();
constexpr double wide_of_it = 4 * std::numeric_limits<double>::epsilon();  // a bound as a double
constexpr Extended sums = 1e-9L;          // what long sums of positive terms may round, and more
constexpr double quickly_extended = 3e8;  // multiply-adds of an elimination in extended precision
constexpr Extended caught_at = 16;        // rate of leaving the most visited state, of the largest rate
constexpr Extended beside_all = 1e-20L;   // scale of states that do not lead back, of the least other one
constexpr Extended well_solved = 0.9L;    // g from which phi is not refined
constexpr int most_corrections = 3;

/// A number and what rounding may have done to it.
struct Rounded {
  Extended value = 0, error = 0;
};

/// Returns ((G - shift) x)_i.
Rounded image(const Chain& chain, const Row& x, Extended shift, std::size_t i) {
  const auto columns = chain.columns(i);
  const auto values = chain.values(i);
  const Extended failing = chain.kill(i) * x[i], shifted = shift * x[i];
  Extended value = failing - shifted, size = failing + shifted;
  for (std::size_t e = 0; e < columns.size(); ++e) {
    const Extended part = values[e] * (x[i] - x[columns[e]]);
    value += part;
    size += std::abs(part);
  }
  return {value, 2 * extended_unit * static_cast<Extended>(columns.size() + 5) * size};
}

/// Returns y (G - shift).
std::vector<Rounded> left_image(const Chain& chain, const Row& y, Extended shift) {
  std::vector<Rounded> image(y.size());  // at first what arrives, and of how many terms
  for (std::size_t i = 0; i < y.size(); ++i)
    for (std::size_t e = 0; e < chain.columns(i).size(); ++e) {
      Rounded& to = image[chain.columns(i)[e]];
      to.value += y[i] * chain.values(i)[e];
      ++to.error;
    }
  for (std::size_t i = 0; i < y.size(); ++i) {
    const auto values = chain.values(i);
    const Extended exit = std::accumulate(values.begin(), values.end(), static_cast<Extended>(chain.kill(i)));
    const auto [arriving, terms] = image[i];
    const Extended own = exit * y[i], shifted = shift * y[i];
    image[i] = {own - arriving - shifted,
                2 * extended_unit * (terms + static_cast<Extended>(values.size()) + 6) * (own + arriving + shifted)};
  }
  return image;
}

/// Scales states such that survivors fail at about one rate everywhere (Doob's transform): by the right vector, and by
/// next to nothing where that is zero. There, states are left sooner than survivors fail.
Row scale_of(const Generator& generator, std::span<const Extended> right, const Heard& heard) {
  Row scale(right.begin(), right.end());
  std::vector<std::uint32_t> aside;
  Extended least = 1;
  for (std::uint32_t i = 0; i < scale.size(); ++i) {
    if (scale[i] > 0) least = std::min(least, scale[i]);
    if (!(scale[i] > 0)) aside.push_back(i);
  }
  if (aside.empty()) return scale;
  std::vector<std::uint32_t> scratch(generator.size(), Generator::outside);
  const Row steps = GeneratorSolver(generator.restricted_to(aside, scratch), heard).solve(Row(aside.size(), 1));
  const Extended longest = *std::max_element(steps.begin(), steps.end());
  for (std::size_t k = 0; k < aside.size(); ++k) scale[aside[k]] = beside_all * least * steps[k] / longest;
  return scale;
}

/// Solves G - rate without the most visited state, about: what it answers is held against the rows.
class WithoutState {
 public:
  WithoutState(const Chain& chain, const Row& scale, std::span<const Extended> right, std::span<const Extended> left,
               Extended rate, std::uint32_t state, Way way, const Heard& heard)
      : scale_(scale), state_(state) {
    Generator scaled = generator_of(chain);
    for (std::size_t i = 0; i < scale.size(); ++i) {
      Extended own = scaled.kill[i] - rate;
      for (std::size_t e = scaled.start[i]; e < scaled.start[i + 1]; ++e) {
        own += scaled.rate[e] * (1 - scale[scaled.column[e]] / scale[i]);
        scaled.rate[e] *= scale[scaled.column[e]] / scale[i];
      }
      scaled.kill[i] = right[i] > 0 ? 0 : std::max<Extended>(0, own);
    }
    for (std::size_t i = 0; i < scale.size(); ++i) fastest_ = std::max(fastest_, scaled.exit(i));
    scaled.kill[state] = caught_at * fastest_;
    fastest_ *= 1 + caught_at;
    if (way == Way::eliminated && envelope_of(chain).multiply_adds > quickly_extended) {
      eliminated_ = std::make_unique<Elimination>(in_double_precision(scaled));
      return;
    }
    Row visits;
    for (std::size_t i = 0; i < scale.size(); ++i) visits.push_back(left[i] * scale[i]);
    const bool everywhere = std::all_of(visits.begin(), visits.end(), [](Extended visit) { return visit > 0; });
    solver_ = std::make_unique<GeneratorSolver>(scaled, heard, everywhere ? visits : Row());
  }

  /// Returns x with ((G - rate) x)_i = right_i but in the state, where x is zero; 0 <= right.
  Row solve(const Row& right) {
    Row scaled = right;
    scaled[state_] = 0;
    for (std::size_t i = 0; i < scaled.size(); ++i) scaled[i] /= scale_[i];
    Row x = solved(scaled, false);
    const Extended there = x[state_];
    for (std::size_t i = 0; i < x.size(); ++i) x[i] = (x[i] - there) * scale_[i];
    return x;
  }
  /// Returns y with (y (G - rate))_i = right_i but in the state.
  Row solve_left(const Row& right) {
    Row scaled = right;
    for (std::size_t i = 0; i < scaled.size(); ++i) scaled[i] *= scale_[i];
    scaled[state_] = 0;
    scaled[state_] = -std::accumulate(scaled.begin(), scaled.end(), Extended{0});
    Row y = solved(scaled, true);
    for (std::size_t i = 0; i < y.size(); ++i) y[i] /= scale_[i];
    return y;
  }

 private:
  Chain in_double_precision(const Generator& scaled) const {
    std::vector<double> values, kill;
    for (const Extended rate : scaled.rate) values.push_back(static_cast<double>(rate / fastest_));
    for (const Extended rate : scaled.kill) kill.push_back(static_cast<double>(rate / fastest_));
    return Chain(scaled.start, scaled.column, values, kill);
  }
  /// Takes right sides of any sign, those of either sign by themselves.
  Row solved(const Row& right, bool left) {
    if (solver_) return left ? solver_->solve_left(right) : solver_->solve(right);
    Row sum(right.size(), 0);
    for (const Extended sign : {Extended{1}, Extended{-1}}) {
      std::vector<double> part;
      for (const Extended entry : right) part.push_back(static_cast<double>(std::max<Extended>(0, sign * entry)));
      const std::vector<double> x = left ? eliminated_->solve_left(part) : eliminated_->solve(part);
      for (std::size_t i = 0; i < x.size(); ++i) sum[i] += sign * x[i] / fastest_;
    }
    return sum;
  }

  const Row& scale_;
  std::uint32_t state_;
  Extended fastest_ = 0;
  std::unique_ptr<Elimination> eliminated_;
  std::unique_ptr<GeneratorSolver> solver_;
};

/// Holds phi, divided by g.
struct Reach {
  Row phi;
  bool proven = false;
};

/// Finds how much an error that arises in a state counts until survivors are in the most visited one.
/// @param rate  an upper bound of the failure rate
Reach reach_of(const Chain& chain, WithoutState& solver, std::uint32_t state, Extended rate) {
  Reach reach{solver.solve(Row(chain.size(), 1))};
  for (int refined = 0;; ++refined) {
    reach.phi[state] = 0;
    Extended least = unbounded;
    Row left(chain.size(), 0);
    for (std::size_t i = 0; i < chain.size(); ++i) {
      if (i == state) continue;
      const Rounded one = image(chain, reach.phi, rate, i);
      left[i] = 1 - one.value;
      least = std::min(least, reach.phi[i] > 0 && std::isfinite(reach.phi[i]) ? one.value - one.error : -1);
    }
    reach.proven = least > 0;
    if (least >= well_solved || refined == 2) {
      for (Extended& entry : reach.phi) entry = entry / least * (1 + sums);
      return reach;
    }
    const Row correction = solver.solve(left);
    for (std::size_t i = 0; i < chain.size(); ++i) reach.phi[i] += correction[i];
  }
}

/// Says, of a vector w, how much of an error of the left vector arrives in left G w / left w, which is the failure
/// rate otherwise: it is within (own + sum |d| share) / weight of the shift.
struct Weighing {
  Extended own = 0, share = 0, weight = 0;
};

Weighing weighing(const Chain& chain, const Row& y, const Row& w, Extended shift, const BoundedQuasiStationary& found) {
  Weighing weighed;
  Extended signed_sum = 0, size = 0;
  for (std::size_t i = 0; i < y.size(); ++i) {
    const Rounded one = image(chain, w, 0, i);
    const Extended off = one.value - shift * w[i];
    signed_sum += y[i] * off;
    size += y[i] * std::abs(off);
    weighed.own += y[i] * (one.error + 2 * extended_unit * (std::abs(one.value) + shift * w[i]));
    weighed.share = std::max({weighed.share, std::abs(one.value - found.rate_lower * w[i]) + one.error,
                              std::abs(one.value - found.rate_upper * w[i]) + one.error});
    weighed.weight += y[i] * w[i];
  }
  weighed.own += std::abs(signed_sum) + 2 * static_cast<Extended>(y.size()) * extended_unit * size;
  return weighed;
}

/// Holds what is proven of one left vector: its sum |d| where its entries sum to one, and how far the failure rate is
/// from its shift.
struct Proven {
  Extended error = unbounded, shift = 0, rate_off = 1;
};

Proven proven_of(const Chain& chain, const Row& y, const Row& right, const Reach& reach, std::uint32_t state,
                 const BoundedQuasiStationary& found) {
  Proven proven;
  const Extended sum = std::accumulate(y.begin(), y.end(), Extended{0});
  for (std::size_t i = 0; i < y.size(); ++i) proven.shift += y[i] * chain.kill(i) / sum;
  const std::vector<Rounded> residual = left_image(chain, y, proven.shift);
  Extended direct = 0, by_rate = 0;  // parts of sum |d|: from the residual, and of the rate's error
  for (std::size_t i = 0; i < y.size(); ++i) {
    if (i == state) continue;
    direct += (std::abs(residual[i].value) + residual[i].error) * reach.phi[i];
    by_rate += y[i] * reach.phi[i];
  }
  proven.rate_off = std::max(found.rate_upper - proven.shift, proven.shift - found.rate_lower);
  Extended off = direct + proven.rate_off * by_rate;
  const Weighing weighed[] = {weighing(chain, y, Row(y.size(), 1), proven.shift, found),
                              weighing(chain, y, right, proven.shift, found)};
  for (const Weighing& one : weighed) {
    const Extended kept = 1 - one.share * by_rate / one.weight * (1 + sums);
    if (kept > 0) off = std::min(off, (direct + one.own * by_rate / one.weight) / kept);
  }
  off *= 1 + sums;
  for (const Weighing& one : weighed)
    proven.rate_off = std::min(proven.rate_off, (one.own + off * one.share) / one.weight * (1 + sums));
  if (std::isfinite(off)) proven.error = off / sum * (1 + sums);
  return proven;
}

/// Returns half of the sum of differences between a distribution and a vector scaled to the sum one.
Extended variation(const std::vector<double>& distribution, const Row& y) {
  const Extended sum = std::accumulate(y.begin(), y.end(), Extended{0});
  Extended own = 0, apart = 0;
  for (const double share : distribution) own += share;
  for (std::size_t i = 0; i < y.size(); ++i) apart += std::abs(distribution[i] / own - y[i] / sum);
  const Extended of_sums = 4 * static_cast<Extended>(y.size()) * extended_unit;
  return (apart / 2 + of_sums) * (1 + sums) + std::abs(own - 1) / 2;
}

std::string why_not(std::uint32_t state, const BoundedQuasiStationary& found) {
  return fmt::format(
      "survivors come to state {} too slowly for what is known of the failure rate ({:.6g} to {:.6g}): the "
      "distribution has no proven bound",
      state, found.rate_lower, found.rate_upper);
}

void take(const Proven& proven, const Row& y, BoundedQuasiStationary& found) {
  const Extended error = proven.error + variation(found.quasi.distribution, y);
  const auto as_double = static_cast<double>(error) * (1 + wide_of_it);
  if (as_double < found.distribution_error && as_double < 1) found.distribution_error = as_double;
  const Extended low = proven.shift - proven.rate_off, high = proven.shift + proven.rate_off;
  if (!std::isfinite(proven.error)) return;
  found.rate_lower = std::max(found.rate_lower, static_cast<double>(low) * (1 - wide_of_it));
  found.rate_upper = std::min(found.rate_upper, static_cast<double>(high) * (1 + wide_of_it));
}

/// Holds psi with ((G - rate) psi)_i >= w_i in all states but the most visited one, where psi is zero.
Row return_weight(const Chain& chain, WithoutState& solver, std::uint32_t state, const Row& w, Extended rate) {
  Row psi = solver.solve(w);
  psi[state] = 0;
  Extended least = unbounded;
  for (std::size_t i = 0; i < w.size(); ++i) {
    if (i == state) continue;
    const Rounded one = image(chain, psi, rate, i);
    least = std::min(least, psi[i] > 0 && std::isfinite(psi[i]) ? (one.value - one.error) / w[i] : -1);
  }
  if (!(least > 0)) return {};
  for (Extended& entry : psi) entry = entry / least * (1 + sums);
  return psi;
}

/// Bounds the survival weight. With e = w - a u, u the true one and a such that e is zero in the most visited state,
/// |((G - rate) w)_i| <= off first_i in the others bounds |e_i| by off psi_i.
void bound_weight(const Chain& chain, const Row& first, WithoutState& solver, std::uint32_t state,
                  BoundedQuasiStationary& found, const Heard& heard) {
  if (std::ranges::any_of(first, [](Extended weight) { return !(weight > 0); })) return;
  const Row psi = return_weight(chain, solver, state, first, found.rate_upper);
  if (psi.empty()) return;
  const Extended shift = (static_cast<Extended>(found.rate_lower) + found.rate_upper) / 2,
                 rate_off = found.rate_upper - shift + extended_unit;
  Row w = first;
  for (int corrected = 0; corrected <= most_corrections; ++corrected) {
    if (heard) heard();
    Row residual(w.size(), 0);
    Extended off = 0, reached = 0, apart = 0;
    const Extended largest = *std::max_element(w.begin(), w.end());
    for (std::size_t i = 0; i < w.size(); ++i) {
      const Rounded one = image(chain, w, shift, i);
      if (i != state) off = std::max(off, (std::abs(one.value) + one.error + rate_off * w[i]) / first[i]);
      residual[i] = one.value;
      reached = std::max(reached, psi[i] / w[i]);
      apart = std::max(apart, std::abs(found.quasi.survival_weight[i] * largest / w[i] - 1));
    }
    const Extended relative = off * reached * (1 + sums);
    if (!(relative < 0.5L)) return;
    // The largest weight is 1, so that its own error comes to that of each entry.
    const auto error = static_cast<double>((1 + relative) / (1 - relative) * (1 + apart) - 1) * (1 + wide_of_it);
    const bool settled = !(error < found.weight_error / 2);
    found.weight_error = std::min(found.weight_error, error);
    if (settled) return;
    const Row correction = solver.solve(residual);
    for (std::size_t i = 0; i < w.size(); ++i) w[i] -= correction[i];
    if (std::ranges::any_of(w, [](Extended weight) { return !(weight > 0); })) return;
  }
}

void bounded_by_returns(const Chain& chain, std::span<const Extended> left, std::span<const Extended> right, Way way,
                        std::uint32_t state, BoundedQuasiStationary& found, const Heard& heard) {
  const Row scale = scale_of(generator_of(chain), right, heard), weight(right.begin(), right.end());
  WithoutState solver(chain, scale, right, left, found.quasi.failure_rate, state, way, heard);
  const Reach reach = reach_of(chain, solver, state, found.rate_upper);
  if (!reach.proven) return;
  Row y(left.begin(), left.end());
  for (int corrected = 0;; ++corrected) {
    if (heard) heard();
    const Proven proven = proven_of(chain, y, weight, reach, state, found);
    const double before = found.distribution_error;
    take(proven, y, found);
    if (corrected == most_corrections || found.distribution_error > before / 2) break;
    Row off;
    for (const Rounded& one : left_image(chain, y, proven.shift)) off.push_back(one.value);
    const Row correction = solver.solve_left(off);
    for (std::size_t i = 0; i < y.size(); ++i) y[i] = std::max<Extended>(0, y[i] - correction[i]);
  }
  bound_weight(chain, weight, solver, state, found, heard);
}

}  // namespace

void bound_distribution(const Chain& chain, std::span<const Extended> left, std::span<const Extended> right, Way way,
                        BoundedQuasiStationary& found, const Heard& heard) {
  found.distribution_error = found.weight_error = std::numeric_limits<double>::infinity();
  if (found.quasi.failure_rate == 1) {
    found.unproven = "no state is visited twice: what the last survivors look like depends on the start";
    return;
  }
  if (chain.size() == 1) {  // there is one distribution
    found.distribution_error = found.weight_error = 0;
    found.unproven.clear();
    return;
  }
  std::uint32_t state = 0;
  for (std::uint32_t i = 0; i < chain.size(); ++i)
    if (left[i] * right[i] > left[state] * right[state]) state = i;
  const auto lost = std::ranges::find(right, Extended{0});
  found.unproven = lost == right.end() ? why_not(state, found)
                                       : fmt::format(
                                             "the survival weight of state {} is none or below all doubles: the "
                                             "distribution has no proven bound",
                                             lost - right.begin());
  if (!(left[state] > 0 && right[state] > 0)) return;
  try {
    bounded_by_returns(chain, left, right, way, state, found, heard);
  } catch (const ConvergenceError& error) {
    found.unproven = fmt::format("the distribution has no proven bound: {}", error.what());
  } catch (const std::logic_error& error) {  // as where numbers of an elimination are beyond doubles
    found.unproven = fmt::format("the distribution has no proven bound: {}", error.what());
  }
  if (std::isfinite(found.distribution_error)) found.unproven.clear();
  found.quasi.failure_rate =
      std::clamp(found.quasi.failure_rate, found.rate_lower, std::max(found.rate_lower, found.rate_upper));
}

}  // namespace metastable::markov
