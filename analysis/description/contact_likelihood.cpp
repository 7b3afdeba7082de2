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

constexpr std::size_t columns = 161;           // eta = 0 .. 1
constexpr double gauss = 0.28867513459481288;  // 1 / (2 sqrt(3)): two-point rule on [0, 1]

// Returns the nodes of mu, with those where the loss has a kink.
std::vector<double> friction_nodes(const dynamics::WheelMap& map, int phase) {
  std::vector<double> nodes = dynamics::friction_breaks(map.contact_model(), map.collision(phase, 1));
  for (int i = 0; i <= 144; ++i) nodes.push_back(i / 160.0);
  for (int i = 1; i <= 42; ++i) nodes.push_back(0.9 + i / 20.0);
  std::erase_if(nodes, [](double mu) { return !(mu >= 0 && mu <= 3); });
  std::sort(nodes.begin(), nodes.end());
  nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
  return nodes;
}

double restitution_at(std::size_t column) { return static_cast<double>(column) / (columns - 1); }

// A node of the grid with omega+^2 there.
struct Corner {
  double restitution, friction, value;
};

}  // namespace

// Holds omega+^2 = scale x - drag sqrt(x) of one phase on the grid, column by column.
struct ContactLikelihood::Surface {
  std::vector<double> friction;
  std::vector<dynamics::StepCoefficients> node;

  Surface(const dynamics::WheelMap& map, int phase) : friction(friction_nodes(map, phase)) {
    for (std::size_t j = 0; j < columns; ++j)
      for (const double mu : friction) node.push_back(map.coefficients(phase, {restitution_at(j), mu}));
  }
  std::vector<double> after(double state) const {
    const double omega = std::sqrt(state);
    std::vector<double> values(node.size());
    for (std::size_t i = 0; i < node.size(); ++i) values[i] = node[i].scale * state - node[i].drag * omega;
    return values;
  }
};

// Returns intervals of mu that rest, for each eta.
std::vector<ContactLikelihood::Piece> ContactLikelihood::region_of_rest(const Surface& surface,
                                                                        const std::vector<double>& after,
                                                                        double barrier) {
  const std::vector<double>& mu = surface.friction;
  const std::size_t rows = mu.size();
  std::vector<Piece> pieces;
  for (std::size_t j = 0; j < columns; ++j) {
    const double* column = after.data() + j * rows;
    for (std::size_t i = 0; i + 1 < rows; ++i) {
      const double a = column[i] - barrier, b = column[i + 1] - barrier;
      if (a >= 0 && b >= 0) continue;
      double from = mu[i], to = mu[i + 1];
      if (a >= 0) from = std::isinf(b) ? to : from + (to - from) * a / (a - b);
      if (b >= 0) to = std::isinf(a) ? from : from + (to - from) * a / (a - b);
      if (!pieces.empty() && pieces.back().column == j && pieces.back().friction_to == from)
        pieces.back().friction_to = to;
      else
        pieces.push_back({from, to, j});
    }
    if (column[rows - 1] < barrier && !pieces.empty())
      pieces.back().friction_to = std::numeric_limits<double>::infinity();
  }
  return pieces;
}

// The curve of the (eta, mu) that lead from one state to its landing: omega+^2 has the level it needs there.
class ContactLikelihood::LevelCurve {
 public:
  LevelCurve(const dynamics::WheelMap& map, const MeasuredLanding& transition)
      : map_(map),
        state_(transition.state),
        phase_(transition.phase),
        level_(*transition.landing - map.stance(transition.phase).gain) {}

  CurvePoints points(const Surface& surface, const std::vector<double>& after) {
    const std::vector<double>& mu = surface.friction;
    const std::size_t rows = mu.size();
    for (std::size_t j = 0; j + 1 < columns; ++j)
      for (std::size_t i = 0; i + 1 < rows; ++i) {
        const double* p = after.data() + j * rows + i;
        const double* q = p + rows;
        const bool above = p[0] > level_;
        if (above == (p[1] > level_) && above == (q[0] > level_) && above == (q[1] > level_)) continue;
        if (!(std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(q[0]) && std::isfinite(q[1]))) continue;
        const Corner a{restitution_at(j), mu[i], p[0]}, b{restitution_at(j), mu[i + 1], p[1]},
            c{restitution_at(j + 1), mu[i], q[0]}, d{restitution_at(j + 1), mu[i + 1], q[1]};
        pass_through(a, b, c);
        pass_through(b, c, d);
      }
    return std::move(points_);
  }

 private:
  // Finds where the level lies between two corners.
  std::pair<double, double> cross(const Corner& a, const Corner& b) const {
    const double share = (level_ - a.value) / (b.value - a.value);
    return {a.restitution + share * (b.restitution - a.restitution), a.friction + share * (b.friction - a.friction)};
  }

  double after(double restitution, double friction) const {
    return map_.after_collision(state_, phase_, {restitution, friction});
  }

  // Says how far the curve lies from the triangle's chord, and |grad omega+^2| there.
  struct Bend {
    double gradient, shift_x = 0, shift_y = 0;
  };

  // Takes the gradient of the plane through the corners; the surface's own takes its place unless it changes within the
  // triangle, as it does about its extremes.
  Bend bend(const Corner& a, const Corner& b, const Corner& c, double middle_x, double middle_y) const {
    const double dx1 = b.restitution - a.restitution, dy1 = b.friction - a.friction, dv1 = b.value - a.value;
    const double dx2 = c.restitution - a.restitution, dy2 = c.friction - a.friction, dv2 = c.value - a.value;
    Bend bend{std::hypot(dv1 * dy2 - dv2 * dy1, dx1 * dv2 - dx2 * dv1) / std::abs(dx1 * dy2 - dx2 * dy1)};
    constexpr double h = 1e-5;
    const double x = std::clamp(middle_x, h, 1 - h), y = std::max(middle_y, h);
    const double gx = (after(x + h, y) - after(x - h, y)) / (2 * h), gy = (after(x, y + h) - after(x, y - h)) / (2 * h);
    const double own = std::hypot(gx, gy);
    if (own > bend.gradient / 1.5 && own < bend.gradient * 1.5) {
      const double miss = (level_ - after(x, y)) / (own * own);
      bend = {own, miss * gx, miss * gy};
    }
    return bend;
  }

  // Sums the curve's piece in one triangle, by two points of Gauss's rule.
  void pass_through(const Corner& a, const Corner& b, const Corner& c) {
    const bool above_a = a.value > level_, above_b = b.value > level_, above_c = c.value > level_;
    if (above_a == above_b && above_b == above_c) return;
    const Corner& lone = above_b == above_c ? a : above_a == above_c ? b : c;
    const Corner& one = above_b == above_c ? b : a;
    const Corner& two = above_b == above_c || above_a == above_c ? c : b;
    const auto [x1, y1] = cross(lone, one);
    const auto [x2, y2] = cross(lone, two);
    const auto [gradient, shift_x, shift_y] = bend(a, b, c, (x1 + x2) / 2, (y1 + y2) / 2);
    const double weight = std::hypot(x2 - x1, y2 - y1) / gradient / 2;
    for (const double at : {0.5 - gauss, 0.5 + gauss})
      points_.add(x1 + at * (x2 - x1) + shift_x, y1 + at * (y2 - y1) + shift_y, weight);
  }

  const dynamics::WheelMap& map_;
  double state_;
  int phase_;
  double level_;  // of omega+^2
  CurvePoints points_;
};

ContactLikelihood::ContactLikelihood(const std::vector<dynamics::WheelMap>& maps,
                                     std::span<const MeasuredLanding> transitions, int threads)
    : threads_(threads) {
  std::map<std::pair<std::size_t, int>, Surface> surfaces;
  for (const MeasuredLanding& t : transitions) surfaces.try_emplace({t.condition, t.phase}, maps[t.condition], t.phase);
  std::vector<Observed> all(transitions.size());
  markov::parallel_for(transitions.size(), threads, [&](std::size_t number) {
    const MeasuredLanding& t = transitions[number];
    const dynamics::WheelMap& map = maps[t.condition];
    const Surface& surface = surfaces.at({t.condition, t.phase});
    const std::vector<double> after = surface.after(t.state);
    all[number].landing = t.landing.has_value();
    all[number].rested = t.rested;
    if (t.landing)
      all[number].curve = LevelCurve(map, t).points(surface, after);
    else
      all[number].pieces = region_of_rest(surface, after, map.stance(t.phase).barrier);
  });
  keep_possible(std::move(all));
}

void ContactLikelihood::keep_possible(std::vector<Observed> all) {
  for (Observed& observed : all) {
    // A survivor whose region of rest is empty is certain, not impossible.
    if (observed.landing ? observed.curve.size() == 0 : observed.rested && observed.pieces.empty()) {
      ++impossible_;
      continue;
    }
    rests_ += observed.rested;
    possible_.push_back(std::move(observed));
  }
}

ContactLikelihood::Value ContactLikelihood::density(const Observed& observed, const ContactParameters& p) {
  const double a = 1 / p[1], b = 1 / p[3];
  const CurveMoments m = curve_moments(observed.curve, {p[0], a, p[2], b});
  return {a * b / (2 * std::numbers::pi) * m.sum * std::exp(-0.5 * m.nearest),
          {a * m.u / m.sum, a * (m.uu / m.sum - 1), b * m.v / m.sum, b * (m.vv / m.sum - 1)}};
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
    // This is the mass between the columns and its first moment about a, with derivatives by mean and sd.
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

ContactLikelihood::Value ContactLikelihood::rest(const Observed& observed, const std::vector<ColumnWeight>& weights,
                                                 const dynamics::TruncatedNormal& friction, const ContactParameters& p,
                                                 const ContactParameters& truncation) {
  Value rest;
  for (const Piece& piece : observed.pieces) {
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
  // It is what the truncation leaves of both normals, from the tails that do not cancel, and its logarithm's
  // derivatives.
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
  std::vector<Sum> sums((possible_.size() + block - 1) / block);
  markov::parallel_for(sums.size(), threads_, [&](std::size_t s) {
    for (std::size_t i = s * block; i < std::min(possible_.size(), (s + 1) * block); ++i) {
      const Observed& observed = possible_[i];
      if (observed.landing) {
        const Value landing = density(observed, p);
        sums[s].value += std::log(landing.value / inside);
        for (std::size_t k = 0; k < 4; ++k) sums[s].slope[k] += landing.slope[k] - truncation[k];
      } else if (observed.rested || !observed.pieces.empty()) {
        const Value stays = rest(observed, weights, friction, p, truncation);
        sums[s].value += observed.rested ? std::log(stays.value) : std::log1p(-stays.value);
        if (stays.value == 0 && !observed.rested) continue;
        const double share = observed.rested ? 1 : -stays.value / (1 - stays.value);
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
  return std::isnan(sum.value) ? -std::numeric_limits<double>::infinity() : sum.value;
}

}  // namespace metastable::analysis
