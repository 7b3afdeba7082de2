#include "markov/transition_rows/node_space.h"

#include <algorithm>
#include <boost/math/quadrature/gauss.hpp>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace metastable::markov {
namespace {

// Boost holds the upper half of an even rule.
using Rule = boost::math::quadrature::gauss<double, NodeSpace::order>;

}  // namespace

double gauss_abscissa(std::size_t k) {
  constexpr std::size_t half = NodeSpace::order / 2;
  return k < half ? -Rule::abscissa()[half - 1 - k] : Rule::abscissa()[k - half];
}
double gauss_weight(std::size_t k) {
  constexpr std::size_t half = NodeSpace::order / 2;
  return Rule::weights()[k < half ? half - 1 - k : k - half];
}

Legendre legendre(double t) {
  Legendre p;
  legendre<1>(&t, &p);
  return p;
}

double graded_edge(std::pair<double, double> range, double bulk, double share) {
  const auto [from, to] = range;
  const double length = to - from;
  if (bulk >= length) return from + length * share * share;
  const double s = share * (1 + 0.5 * std::log(length / bulk));
  return from + bulk * (s <= 1 ? s * s : std::exp(2 * (s - 1)));
}

NodeSpace::NodeSpace(std::vector<std::pair<double, double>> range, std::size_t panels, double bulk)
    : range_(std::move(range)), panels_(panels), bulk_(bulk) {
  if (range_.empty() || panels == 0) throw std::invalid_argument("nodes: at least one phase and one panel are needed");
  for (const auto& [lower, upper] : range_) {
    if (!(lower < upper) || !std::isfinite(lower) || !std::isfinite(upper))
      throw std::invalid_argument("nodes: a range is not a finite interval");
    const auto edge = [&, range = std::pair(lower, upper)](std::size_t p) {
      return graded_edge(range, bulk, static_cast<double>(p) / static_cast<double>(panels));
    };
    for (std::size_t p = 0; p < panels; ++p) {
      const double half = 0.5 * (edge(p + 1) - edge(p)), middle = 0.5 * (edge(p + 1) + edge(p));
      for (std::size_t k = 0; k < order; ++k) {
        node_.push_back(middle + half * gauss_abscissa(k));
        weight_.push_back(half * gauss_weight(k));
      }
    }
  }
}

NodeSpace NodeSpace::between(std::vector<std::vector<double>> edges, std::size_t panels) {
  if (edges.empty() || edges.front().size() < 2 || panels == 0)
    throw std::invalid_argument("nodes: at least one phase and one panel are needed");
  NodeSpace space;
  space.divided_ = panels;
  space.panels_ = (edges.front().size() - 1) * panels;
  for (const std::vector<double>& of_phase : edges) {
    if (of_phase.size() != edges.front().size()) throw std::invalid_argument("nodes: every phase needs as many edges");
    space.range_.emplace_back(of_phase.front(), of_phase.back());
    for (std::size_t e = 1; e < of_phase.size(); ++e) {
      const double from = of_phase[e - 1], length = of_phase[e] - from;
      if (!(length > 0) || !std::isfinite(length)) throw std::invalid_argument("nodes: edges do not ascend");
      for (std::size_t k = 0; k < panels * order; ++k) {
        const double share =
            (static_cast<double>(k / order) + 0.5 + 0.5 * gauss_abscissa(k % order)) / static_cast<double>(panels);
        const double s = std::sin(std::numbers::pi / 2 * share);
        space.node_.push_back(from + length * s * s);
        space.weight_.push_back(0.5 * gauss_weight(k % order) / static_cast<double>(panels) * length *
                                std::numbers::pi / 2 * std::sin(std::numbers::pi * share));
      }
    }
  }
  space.edges_ = std::move(edges);
  return space;
}

std::pair<std::size_t, double> NodeSpace::locate(int phase, double state) const {
  const std::vector<double>& edges = edges_[static_cast<std::size_t>(phase)];
  const auto above = std::upper_bound(edges.begin() + 1, edges.end() - 1, state);
  const double from = *(above - 1), share = std::clamp((state - from) / (*above - from), 0.0, 1.0);
  // asin(sqrt) keeps digits near 0, acos near 1.
  const double t =
      2 / std::numbers::pi *
      (share < 0.5 ? std::asin(std::sqrt(share))
                   : std::numbers::pi / 2 - std::asin(std::sqrt(std::max(0.0, (*above - state) / (*above - from))))) *
      static_cast<double>(divided_);
  const std::size_t panel = std::min(static_cast<std::size_t>(std::max(t, 0.0)), divided_ - 1);
  return {static_cast<std::size_t>(above - edges.begin() - 1) * divided_ + panel,
          std::clamp(2 * (t - static_cast<double>(panel)) - 1, -1.0, 1.0)};
}

std::span<const double> NodeSpace::edges(int phase) const { return edges_[static_cast<std::size_t>(phase)]; }

std::span<const double> NodeSpace::nodes(int phase) const {
  return std::span(node_).subspan(static_cast<std::size_t>(phase) * nodes(), nodes());
}

std::span<const double> NodeSpace::weights(int phase) const {
  return std::span(weight_).subspan(static_cast<std::size_t>(phase) * nodes(), nodes());
}

StateSpace NodeSpace::cells() const {
  std::vector<Grid> grids;
  for (int p = 0; p < phases(); ++p) {
    const auto& [lower, upper] = range_[static_cast<std::size_t>(p)];
    std::vector<double> edges{lower};
    double inside = 0;
    for (std::size_t j = 0; j < nodes(); ++j) {
      inside += weights(p)[j];
      edges.push_back(lower + inside);
    }
    edges.back() = upper;
    grids.emplace_back(std::move(edges));
  }
  return StateSpace(std::move(grids));
}

}  // namespace metastable::markov
