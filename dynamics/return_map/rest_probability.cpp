#include "dynamics/return_map/rest_probability.h"

#include <algorithm>
#include <boost/math/quadrature/gauss_kronrod.hpp>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "dynamics/return_map/negative_set.h"

namespace metastable::dynamics {
namespace {

constexpr double farthest_rest = 39;      // [sd]: beyond it probabilities underflow
constexpr double rest_tolerance = 1e-11;  // of the result
constexpr std::size_t most_rest_panels = 4000;

class RestProbability {
 public:
  RestProbability(const WheelMap& map, double state, int phase)
      : map_(map),
        state_(state),
        phase_(phase),
        restitution_(map.noise().restitution()),
        friction_(map.noise().friction()),
        breaks_(friction_breaks(map.contact_model(), map.collision(phase, 1))) {}

  double over_list() const {
    const auto pairs = map_.noise().pairs();
    const auto rests = std::count_if(pairs.begin(), pairs.end(), [this](const Contact& c) { return margin(c) < 0; });
    return static_cast<double>(rests) / static_cast<double>(pairs.size());
  }

  double over_normals() const {
    if (restitution_.constant()) return given_restitution(restitution_.mean());
    if (friction_.constant()) return given_friction();
    return integrate();
  }

 private:
  struct Panel {
    double lower, upper, value, error;
    bool operator<(const Panel& other) const { return error < other.error; }
  };

  // It returns the sign of omega+^2 - barrier, squeezed into [-1, 1) to keep root finding tame next to a jam.
  double margin(const Contact& contact) const {
    const double excess = map_.after_collision(state_, phase_, contact) - map_.stance(phase_).barrier;
    return std::isfinite(excess) ? excess / (state_ + std::abs(excess)) : -1;
  }

  double given_restitution(double eta) const {
    const auto at = [&](double mu) { return margin({eta, mu}); };
    if (friction_.constant()) return at(friction_.mean()) < 0 ? 1 : 0;
    const double lower = friction_.lower();
    if (breaks_.empty() || breaks_.back() <= lower) return at(lower) < 0 ? 1 : 0;
    // The last edge stands for everything beyond it: constant, jammed, or out of reach.
    const double last = std::min(breaks_.back(), std::max(lower, friction_.mean()) + farthest_rest * friction_.sd());
    std::vector<double> edges{lower};
    for (double b : breaks_)
      if (b > lower && b < last) edges.push_back(b);
    edges.push_back(last);
    double sum = 0;
    for (const NegativeInterval& i : negative_set(at, edges, samples))
      sum += friction_.between(i.lower == lower ? -std::numeric_limits<double>::infinity() : i.lower,
                               i.upper == last ? std::numeric_limits<double>::infinity() : i.upper);
    return std::min(1.0, sum);
  }

  double given_friction() const {
    // The grid is finer towards eta = 0, where the duration of `published` grows like |ln eta|.
    std::vector<double> edges{restitution_.lower()};
    for (double edge : {1e-12, 1e-9, 1e-6, 1e-3, 0.05})
      if (edge > restitution_.lower() && edge < restitution_.upper()) edges.push_back(edge);
    edges.push_back(restitution_.upper());
    double sum = 0;
    const auto at = [&](double eta) { return margin({eta, friction_.mean()}); };
    for (const NegativeInterval& i : negative_set(at, edges, samples))
      sum +=
          restitution_.between(i.lower == edges.front() ? -std::numeric_limits<double>::infinity() : i.lower, i.upper);
    return std::min(1.0, sum);
  }

  // Edges of eta are a grid of one sd within reach, and wherever rest starts or stops being possible at all.
  std::vector<double> restitution_edges() const {
    const double sd = restitution_.sd();
    const double lower = std::max(restitution_.lower(), restitution_.mean() - farthest_rest * sd);
    const double upper = std::min(restitution_.upper(), restitution_.mean() + farthest_rest * sd);
    const int count = std::clamp(static_cast<int>(std::ceil((upper - lower) / sd)), 4, 80);
    std::vector<double> edges{lower};
    bool possible = given_restitution(lower) > 0;
    for (int i = 1; i <= count; ++i) {
      const double next = i == count ? upper : lower + (upper - lower) * i / count;
      const bool next_possible = given_restitution(next) > 0;
      if (next_possible != possible) {
        double a = edges.back(), b = next;
        for (int k = 0; k < 60; ++k) {
          const double middle = a + (b - a) / 2;
          ((given_restitution(middle) > 0) == possible ? a : b) = middle;
        }
        if (a > edges.back() && b < next) edges.push_back(a);
      }
      edges.push_back(next);
      possible = next_possible;
    }
    return edges;
  }

  Panel panel(double lower, double upper) const {
    Panel p{lower, upper, 0, 0};
    p.value = boost::math::quadrature::gauss_kronrod<double, 21>::integrate(
        [this](double eta) { return restitution_.density(eta) * given_restitution(eta); }, lower, upper, 0, 0.0,
        &p.error);
    // Boost's estimate is the difference to the Gauss rule, of the integral mapped to [-1, 1]; the Kronrod rule itself
    // is far better, by QUADPACK's experience as good as this:
    const double difference = p.error * (upper - lower) / 2;
    if (p.value > 0) p.error = p.value * std::min(1.0, std::pow(200 * difference / p.value, 1.5));
    return p;
  }

  double integrate() const {
    // Panels are taken in the order of the mass of eta they hold, until what is left cannot matter.
    const std::vector<double> edges = restitution_edges();
    std::vector<NegativeInterval> ordered;
    for (std::size_t i = 0; i + 1 < edges.size(); ++i) ordered.push_back({edges[i], edges[i + 1]});
    const auto mass = [this](const NegativeInterval& i) { return restitution_.between(i.lower, i.upper); };
    std::sort(ordered.begin(), ordered.end(),
              [&](const NegativeInterval& a, const NegativeInterval& b) { return mass(a) > mass(b); });
    std::vector<Panel> panels;  // a heap, worst on top
    double sum = 0, error = 0;
    const auto add = [&](double lower, double upper) {
      panels.push_back(panel(lower, upper));
      std::push_heap(panels.begin(), panels.end());
      sum = error = 0;
      for (const Panel& p : panels) {
        sum += p.value;
        error += p.error;
      }
    };
    for (std::size_t i = 0; i < ordered.size(); ++i) {
      if (mass(ordered[i]) * static_cast<double>(ordered.size() - i) < 0.1 * rest_tolerance * sum) break;
      add(ordered[i].lower, ordered[i].upper);
    }
    while (error > rest_tolerance * sum && panels.size() < most_rest_panels) {
      std::pop_heap(panels.begin(), panels.end());
      const Panel worst = panels.back();
      const double middle = worst.lower + (worst.upper - worst.lower) / 2;
      if (!(middle > worst.lower && middle < worst.upper)) break;
      panels.pop_back();
      add(worst.lower, middle);
      add(middle, worst.upper);
    }
    return std::min(1.0, sum);
  }

  static constexpr int samples = 12;

  const WheelMap& map_;
  double state_;
  int phase_;
  const TruncatedNormal& restitution_;
  const TruncatedNormal& friction_;
  std::vector<double> breaks_;
};

}  // namespace

double rest_probability(const WheelMap& map, double state, int phase) {
  const RestProbability probability(map, state, phase);
  if (map.noise().is_empirical()) return probability.over_list();
  if (map.noise().correlation() != 0)
    throw std::logic_error("rest_probability: restitution and friction are correlated");
  return probability.over_normals();
}

}  // namespace metastable::dynamics
