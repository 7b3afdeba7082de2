#include "analysis/description/contact_likelihood.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <utility>

#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr std::size_t columns = 161;           // eta = 0 .. 1
constexpr double gauss = 0.28867513459481288;  // 1 / (2 sqrt(3)): two-point rule on [0, 1]

// Nodes of mu, with those where the loss has a kink.
std::vector<double> friction_nodes(const dynamics::WheelMap& map, int phase) {
  std::vector<double> nodes = dynamics::friction_breaks(map.contact_model(), map.collision(phase, 1));
  for (int i = 0; i <= 144; ++i) nodes.push_back(i / 160.0);
  for (int i = 1; i <= 42; ++i) nodes.push_back(0.9 + i / 20.0);
  std::erase_if(nodes, [](double mu) { return !(mu >= 0 && mu <= 3); });
  std::sort(nodes.begin(), nodes.end());
  nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
  return nodes;
}

// omega+^2 = scale x - drag sqrt(x) of one phase on the grid, column by column.
struct Surface {
  std::vector<double> friction;
  std::vector<dynamics::StepCoefficients> node;
  Surface(const dynamics::WheelMap& map, int phase) : friction(friction_nodes(map, phase)) {
    for (std::size_t j = 0; j < columns; ++j)
      for (const double mu : friction)
        node.push_back(map.coefficients(phase, {static_cast<double>(j) / (columns - 1), mu}));
  }
  std::vector<double> after(double state) const {
    const double omega = std::sqrt(state);
    std::vector<double> values(node.size());
    for (std::size_t i = 0; i < node.size(); ++i) values[i] = node[i].scale * state - node[i].drag * omega;
    return values;
  }
};

struct Corner {
  double restitution, friction, value;
};

}  // namespace

ContactLikelihood::ContactLikelihood(const std::vector<dynamics::WheelMap>& maps,
                                     std::span<const MeasuredTransition> transitions, int threads)
    : threads_(threads) {
  std::map<std::pair<std::size_t, int>, Surface> surfaces;
  for (const MeasuredTransition& t : transitions)
    surfaces.try_emplace({t.condition, t.phase}, maps[t.condition], t.phase);

  std::vector<Term> terms(transitions.size());
  markov::parallel_for(transitions.size(), threads, [&](std::size_t number) {
    const MeasuredTransition& t = transitions[number];
    const dynamics::WheelMap& map = maps[t.condition];
    const dynamics::Stance& stance = map.stance(t.phase);
    const Surface& surface = surfaces.at({t.condition, t.phase});
    const std::vector<double> after = surface.after(t.state);
    const std::vector<double>& mu = surface.friction;
    const std::size_t rows = mu.size();
    Term& term = terms[number];
    term.landing = t.landing.has_value();
    term.rested = t.rested;
    const auto eta = [](std::size_t j) { return static_cast<double>(j) / (columns - 1); };
    if (!term.landing) {
      // Intervals of mu that rest, for each eta.
      for (std::size_t j = 0; j < columns; ++j) {
        const double* column = after.data() + j * rows;
        for (std::size_t i = 0; i + 1 < rows; ++i) {
          const double a = column[i] - stance.barrier, b = column[i + 1] - stance.barrier;
          if (a >= 0 && b >= 0) continue;
          double from = mu[i], to = mu[i + 1];
          if (a >= 0) from = std::isinf(b) ? to : from + (to - from) * a / (a - b);
          if (b >= 0) to = std::isinf(a) ? from : from + (to - from) * a / (a - b);
          if (!term.pieces.empty() && term.pieces.back().column == j && term.pieces.back().friction_to == from)
            term.pieces.back().friction_to = to;
          else
            term.pieces.push_back({eta(j), from, 0, to, j});
        }
        if (column[rows - 1] < stance.barrier && !term.pieces.empty()) term.pieces.back().friction_to = infinity;
      }
      return;
    }
    const double level = *t.landing - stance.gain;
    const auto cross = [&](const Corner& a, const Corner& b) {
      const double share = (level - a.value) / (b.value - a.value);
      return std::pair{a.restitution + share * (b.restitution - a.restitution),
                       a.friction + share * (b.friction - a.friction)};
    };
    const auto triangle = [&](const Corner& a, const Corner& b, const Corner& c) {
      const bool above_a = a.value > level, above_b = b.value > level, above_c = c.value > level;
      if (above_a == above_b && above_b == above_c) return;
      const Corner& lone = above_b == above_c ? a : above_a == above_c ? b : c;
      const Corner& one = above_b == above_c ? b : a;
      const Corner& two = above_b == above_c || above_a == above_c ? c : b;
      const auto [x1, y1] = cross(lone, one);
      const auto [x2, y2] = cross(lone, two);
      const double dx1 = b.restitution - a.restitution, dy1 = b.friction - a.friction, dv1 = b.value - a.value;
      const double dx2 = c.restitution - a.restitution, dy2 = c.friction - a.friction, dv2 = c.value - a.value;
      double gradient = std::hypot(dv1 * dy2 - dv2 * dy1, dx1 * dv2 - dx2 * dv1) / std::abs(dx1 * dy2 - dx2 * dy1);
      double shift_x = 0, shift_y = 0;
      // That is the gradient of the plane through the corners; the surface's own takes its place unless it changes
      // within the triangle, as it does about its extremes.
      constexpr double h = 1e-5;
      const double x = std::clamp((x1 + x2) / 2, h, 1 - h), y = std::max((y1 + y2) / 2, h);
      const auto value = [&](double dx, double dy) { return map.after_collision(t.state, t.phase, {x + dx, y + dy}); };
      const double gx = (value(h, 0) - value(-h, 0)) / (2 * h), gy = (value(0, h) - value(0, -h)) / (2 * h);
      const double own = std::hypot(gx, gy);
      if (own > gradient / 1.5 && own < gradient * 1.5) {
        const double miss = (level - value(0, 0)) / (own * own);
        shift_x = miss * gx;
        shift_y = miss * gy;
        gradient = own;
      }
      const double weight = std::hypot(x2 - x1, y2 - y1) / gradient / 2;
      for (const double at : {0.5 - gauss, 0.5 + gauss})
        term.pieces.push_back({x1 + at * (x2 - x1) + shift_x, y1 + at * (y2 - y1) + shift_y, weight, 0, 0});
    };
    for (std::size_t j = 0; j + 1 < columns; ++j)
      for (std::size_t i = 0; i + 1 < rows; ++i) {
        const double* p = after.data() + j * rows + i;
        const double* q = p + rows;
        const bool above = p[0] > level;
        if (above == (p[1] > level) && above == (q[0] > level) && above == (q[1] > level)) continue;
        if (!(std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(q[0]) && std::isfinite(q[1]))) continue;
        const Corner a{eta(j), mu[i], p[0]}, b{eta(j), mu[i + 1], p[1]}, c{eta(j + 1), mu[i], q[0]},
            d{eta(j + 1), mu[i + 1], q[1]};
        triangle(a, b, c);
        triangle(b, c, d);
      }
  });
  for (Term& term : terms) {
    // A survivor whose region of rest is empty is certain, not impossible.
    if (term.pieces.empty() && (term.landing || term.rested)) {
      ++impossible_;
      continue;
    }
    rests_ += term.rested;
    terms_.push_back(std::move(term));
  }
}

ContactLikelihood::Value ContactLikelihood::density(const Term& term, const ContactParameters& p) {
  double sum = 0, u1 = 0, u2 = 0, v1 = 0, v2 = 0;  // moments along the curve
  const double a = 1 / p[1], b = 1 / p[3];
  for (const Piece& piece : term.pieces) {
    const double u = (piece.restitution - p[0]) * a, v = (piece.friction - p[2]) * b;
    const double share = piece.weight * std::exp(-0.5 * (u * u + v * v));
    sum += share;
    u1 += share * u, u2 += share * u * u;
    v1 += share * v, v2 += share * v * v;
  }
  return {a * b / (2 * std::numbers::pi) * sum, {a * u1 / sum, a * (u2 / sum - 1), b * v1 / sum, b * (v2 / sum - 1)}};
}

// A function that is linear between the columns has its mean over eta as the sum of its values there by these weights,
// however narrow the density: a mean far outside [0, 1] leaves a sliver at the bound.
std::vector<ContactLikelihood::ColumnWeight> ContactLikelihood::column_weights(
    const dynamics::TruncatedNormal& restitution) {
  const double mean = restitution.mean(), sd = restitution.sd(), h = 1.0 / (columns - 1);
  std::vector<ColumnWeight> weights(columns);
  for (std::size_t j = 0; j + 1 < columns; ++j) {
    const double a = static_cast<double>(j) * h, b = static_cast<double>(j + 1) * h;
    const double at_a = restitution.density(a), at_b = restitution.density(b);
    // Mass between the columns and its first moment about a, with their derivatives by mean and sd.
    const double mass[3] = {restitution.between(a, b), at_a - at_b, (at_a * (a - mean) - at_b * (b - mean)) / sd};
    const double moment[3] = {(mean - a) * mass[0] - sd * sd * (at_b - at_a), mass[0] - h * at_b,
                              -h * at_b * (b - mean) / sd - sd * (at_b - at_a)};
    for (std::size_t k = 0; k < 3; ++k) {
      const double right = moment[k] / h;
      weights[j][k] += mass[k] - right;
      weights[j + 1][k] += right;
    }
  }
  return weights;
}

ContactLikelihood::Value ContactLikelihood::rest(const Term& term, const std::vector<ColumnWeight>& weights,
                                                 const dynamics::TruncatedNormal& friction, const ContactParameters& p,
                                                 const ContactParameters& truncation) {
  Value rest;
  for (const Piece& piece : term.pieces) {
    const ColumnWeight& weight = weights[piece.column];
    if (!(weight[0] > 0)) continue;
    const double within = friction.between(piece.friction, piece.friction_to);
    rest.value += weight[0] * within;
    rest.slope[0] += weight[1] * within;
    rest.slope[1] += weight[2] * within;
    // The limits of mu move against its normal.
    const double from = friction.density(piece.friction), v = (piece.friction - p[2]) / p[3];
    rest.slope[2] += weight[0] * from;
    rest.slope[3] += weight[0] * from * v;
    if (std::isfinite(piece.friction_to)) {
      const double to = friction.density(piece.friction_to);
      rest.slope[2] -= weight[0] * to;
      rest.slope[3] -= weight[0] * to * (piece.friction_to - p[2]) / p[3];
    }
  }
  for (std::size_t i = 0; i < 4; ++i) rest.slope[i] = rest.slope[i] / rest.value - truncation[i];
  rest.value = std::min(rest.value, 1.0);
  return rest;
}

double ContactLikelihood::operator()(const ContactParameters& p, ContactParameters* gradient) const {
  const dynamics::TruncatedNormal restitution(p[0], p[1], 0, 1), friction(p[2], p[3], 0);
  // What the truncation leaves of both normals, from the tails that do not cancel, and its logarithm's derivatives.
  const double low = -p[0] / p[1], high = (1 - p[0]) / p[1];
  const double of_restitution = p[0] < 0.5 ? dynamics::normal_cdf(-low) - dynamics::normal_cdf(-high)
                                           : dynamics::normal_cdf(high) - dynamics::normal_cdf(low);
  const double inside = of_restitution * dynamics::normal_cdf(p[2] / p[3]);
  const double at_low = restitution.density(0), at_high = restitution.density(1), at_zero = friction.density(0);
  const ContactParameters truncation = {at_low - at_high, at_low * low - at_high * high, at_zero,
                                        -at_zero * p[2] / p[3]};
  const std::vector<ColumnWeight> weights = column_weights(restitution);
  struct Sum {
    double value = 0;
    ContactParameters slope{};
  };
  constexpr std::size_t block = 256;  // sums in an order that does not depend on the threads
  std::vector<Sum> sums((terms_.size() + block - 1) / block);
  markov::parallel_for(sums.size(), threads_, [&](std::size_t s) {
    for (std::size_t i = s * block; i < std::min(terms_.size(), (s + 1) * block); ++i) {
      const Term& term = terms_[i];
      if (term.landing) {
        const Value landing = density(term, p);
        sums[s].value += std::log(landing.value / inside);
        for (std::size_t k = 0; k < 4; ++k) sums[s].slope[k] += landing.slope[k] - truncation[k];
      } else if (term.rested || !term.pieces.empty()) {
        const Value stays = rest(term, weights, friction, p, truncation);
        sums[s].value += term.rested ? std::log(stays.value) : std::log1p(-stays.value);
        if (stays.value == 0 && !term.rested) continue;
        const double share = term.rested ? 1 : -stays.value / (1 - stays.value);
        for (std::size_t k = 0; k < 4; ++k) sums[s].slope[k] += share * stays.slope[k];
      }
    }
  });
  Sum sum;
  for (const Sum& one : sums) {
    sum.value += one.value;
    for (std::size_t k = 0; k < 4; ++k) sum.slope[k] += one.slope[k];
  }
  if (gradient) *gradient = sum.slope;
  return std::isnan(sum.value) ? -infinity : sum.value;
}

}  // namespace metastable::analysis
