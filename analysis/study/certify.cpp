#include "analysis/study/certify.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <utility>

#include "analysis/statistics/estimate.h"
#include "dynamics/bounds/landing_bounds.h"
#include "markov/chain/chain.h"
#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

using dynamics::Interval;
using markov::LandingSource;

constexpr double beyond_top = 1.3;     // how far above the top edge the drift looks, relative
constexpr double top_noise = 4;        // the top edge: where noise of so many sds leads no higher
constexpr double usual_noise = 3;      // launches of so many sds count where nodes are spent on them
constexpr double launch_noise = 8;     // and launches of so many sds lie below
constexpr double least_range = 2;      // states the nodes cover, over the lowest
constexpr double least_launch = 0.01;  // of the lowest state: launches below it are not told apart
constexpr int pieces = 16;             // of a cell, for the mean over the launch

LandingSource::Range range(const Interval& i) { return {i.lower, i.upper}; }
Interval interval(const LandingSource::Range& r) { return {r.lower, r.upper}; }

class Wheel final : public LandingSource {
 public:
  Wheel(const dynamics::WheelMap& map, const std::vector<double>& lowest, double highest,
        const dynamics::BoundsResolution& resolution, int threads) {
    const auto for_each = [threads](std::size_t count, const std::function<void(std::size_t)>& work) {
      markov::parallel_for(count, threads, work);
    };
    for (int p = 0; p < map.phases(); ++p)
      bounds_.emplace_back(map, p, lowest[static_cast<std::size_t>(p)], highest, resolution, for_each);
  }
  int phases() const override { return static_cast<int>(bounds_.size()); }
  Range below(int phase, double state, double edge) const override { return range(at(phase).below(state, edge)); }
  std::optional<Bend> bend(int phase, Range state, Range edge) const override {
    const auto c = at(phase).curvature(interval(state), interval(edge));
    if (!c) return std::nullopt;
    return Bend{range(c->state), range(c->edge), c->loose_state, c->loose_edge};
  }
  double overshoot(int phase, double state, double edge) const override { return at(phase).overshoot(state, edge); }
  double growth(int phase, double state) const override { return at(phase).growth(state); }

 private:
  const dynamics::LandingBounds& at(int phase) const { return bounds_[static_cast<std::size_t>(phase)]; }
  std::vector<dynamics::LandingBounds> bounds_;
};

// Finds a state from which even fortunate noise leads no higher, above all launches and well above `lowest`.
double top_state(const dynamics::WheelMap& map, const dynamics::TruncatedNormal& launch, double lowest) {
  const dynamics::TruncatedNormal &eta = map.noise().restitution(), &mu = map.noise().friction();
  const double fastest = launch.mean() + launch_noise * launch.sd() + 0.1;
  double top = std::max(fastest * fastest, least_range * lowest);
  const double most = 4 * top;
  const double share = top_noise / std::numbers::sqrt2;
  for (const auto& [by_eta, by_mu] :
       {std::pair(top_noise, 0.0), std::pair(share, -share), std::pair(0.0, -top_noise)}) {
    const dynamics::Contact fortunate{eta.at_score(by_eta), mu.at_score(by_mu)};
    for (int p = 0; p < map.phases(); ++p)
      for (int i = 0; i < 100 && top < most; ++i)
        top = std::max(top, 1.02 * (map.after_collision(top, p, fortunate) + map.stance(p).gain));
  }
  return std::min(top, most);
}

// Says where nodes have to begin for launches too slow to come from a step: less is as good as rest at the first one.
double lowest_of_launch(const dynamics::TruncatedNormal& launch, double lowest) {
  const double usual = std::max(0.0, launch.mean() - usual_noise * launch.sd());
  if (usual * usual >= lowest) return lowest;
  const double slow = std::max(0.0, launch.mean() - launch_noise * launch.sd() - 0.1);
  return std::max(slow * slow, least_launch * lowest);
}

// Spaces nodes in proportion to the state, as the noise of the landing is.
std::vector<double> geometric(double lowest, double top, std::size_t cells) {
  std::vector<double> nodes;
  for (std::size_t i = 0; i < cells; ++i)
    nodes.push_back(lowest * std::pow(top / lowest, static_cast<double>(i) / static_cast<double>(cells)));
  nodes.front() = lowest;
  nodes.push_back(top);
  return nodes;
}

// Takes means over the launch of bounds that are linear between nodes and do not fall.
class LaunchMean {
 public:
  LaunchMean(const dynamics::TruncatedNormal& speed, const std::vector<double>& nodes) : speed_(speed), nodes_(nodes) {
    if (!speed.constant()) mass_ = dynamics::normal_tail(score(0.0));
  }

  double lower(const std::vector<double>& v) const {
    if (speed_.constant()) {
      const Interval x = dynamics::square(Interval(speed_.mean()));
      return x.lower < nodes_.front() ? 1 : at(v, x.lower).lower;
    }
    // A launch below the first node takes at least one step.
    Interval sum = Interval(1) + (Interval(v.front()) - Interval(1)) * exceeding(nodes_.front());
    each_piece(v, [&](const Interval& rise, double, double to) {
      sum += Interval(std::max(0.0, rise.lower)) * exceeding(to);
    });
    return sum.lower;
  }

  double upper(const std::vector<double>& v, double jump, double slope) const {
    if (speed_.constant()) {
      const Interval x = dynamics::square(Interval(speed_.mean()));
      return x.upper <= nodes_.back()
                 ? at(v, std::max(x.upper, nodes_.front())).upper
                 : (Interval(v.back()) + Interval(jump) + Interval(slope) * (x - Interval(nodes_.back()))).upper;
    }
    Interval sum(v.front());
    each_piece(v, [&](const Interval& rise, double from, double) {
      sum += Interval(std::max(0.0, rise.upper)) * exceeding(from);
    });
    sum += Interval(jump) * exceeding(nodes_.back());
    const double first = std::sqrt(nodes_.back());
    for (int i = 0; i < 80; ++i) {
      const Interval faster(first * (1 + 1e-12) + (i + 1) * speed_.sd());
      const Interval from(first * (1 - 1e-12) + i * speed_.sd());
      sum += Interval(slope) * (dynamics::square(faster) - Interval(nodes_.back())) * tail(from);
    }
    // What lies 80 sds out weighs less than 1e-300 in every moment; the last term above has covered it in size.
    return sum.upper;
  }

 private:
  Interval score(const Interval& omega) const { return (omega - Interval(speed_.mean())) / Interval(speed_.sd()); }
  Interval tail(const Interval& omega) const {
    const Interval p = dynamics::normal_tail(score(omega)) / mass_;
    return {p.lower, std::min(1.0, p.upper)};
  }
  Interval exceeding(double state) const { return tail(dynamics::sqrt(Interval(state))); }

  Interval at(const std::vector<double>& v, double x) const {
    if (x >= nodes_.back()) return v.back();
    const auto i = static_cast<std::size_t>(std::upper_bound(nodes_.begin(), nodes_.end(), x) - nodes_.begin()) - 1;
    return piece(v, i, x);
  }
  Interval piece(const std::vector<double>& v, std::size_t i, double x) const {
    const Interval share = (Interval(x) - Interval(nodes_[i])) / (Interval(nodes_[i + 1]) - Interval(nodes_[i]));
    return Interval(v[i]) + (Interval(v[i + 1]) - Interval(v[i])) * share;
  }
  template <class F>
  void each_piece(const std::vector<double>& v, F f) const {
    for (std::size_t i = 0; i + 1 < nodes_.size(); ++i)
      for (int k = 0; k < pieces; ++k) {
        const double width = nodes_[i + 1] - nodes_[i];
        const double from = nodes_[i] + width * k / pieces,
                     to = k + 1 < pieces ? nodes_[i] + width * (k + 1) / pieces : nodes_[i + 1];
        f(piece(v, i, to) - piece(v, i, from), from, to);
      }
  }

  dynamics::TruncatedNormal speed_;
  const std::vector<double>& nodes_;
  Interval mass_{1};
};

struct Size {
  std::size_t cells;
  dynamics::BoundsResolution resolution;
};

std::vector<Size> ladder_sizes(int phases, std::size_t largest) {
  if (largest == 0) largest = phases == 1 ? 1600 : 640;
  std::vector<Size> all;
  for (std::size_t cells = phases == 1 ? 400 : 320; cells <= largest; cells *= 2) {
    const double fine = static_cast<double>(cells) / 400;
    all.push_back({cells, {0.1 / std::sqrt(fine), 0.0625 / fine, 12}});
  }
  if (all.empty()) all.push_back({largest, {0.1, 0.0625, 12}});
  return all;
}

}  // namespace

CertifiedSteps certify(const Setting& setting, const CertifyOptions& options) {
  if (!(options.tolerance > 0))
    throw std::invalid_argument(fmt::format("tolerance: {} is not above 0", options.tolerance));
  setting.validate();
  const dynamics::WheelMap map = setting.map();
  const auto phase = static_cast<std::size_t>(setting.first_landing_leg % map.phases());
  CertifiedSteps result;
  result.upper = infinite;
  if (setting.law == dynamics::Law::settled) {
    result.reason = "landings under settled are followed event by event, and of that there are no proven bounds";
    return result;
  }
  if (setting.steady_launch) {
    result.reason = "the speeds of a steady launch are computed, and of them there are no proven bounds";
    return result;
  }
  const dynamics::TruncatedNormal launch = setting.launch().normal().value();
  try {
    std::vector<double> lowest;
    for (int p = 0; p < map.phases(); ++p) lowest.push_back(map.state_interval(p).first * (1 - 0x1p-44));
    const double top = top_state(map, launch, *std::max_element(lowest.begin(), lowest.end()));
    const double beyond = beyond_top * top;
    lowest[phase] = lowest_of_launch(launch, lowest[phase]);
    const std::vector<Size> ladder = ladder_sizes(map.phases(), options.largest_cells);
    for (std::size_t s = 0; s < ladder.size(); ++s) {
      if (options.progress)
        options.progress(static_cast<double>(s) / static_cast<double>(ladder.size()),
                         fmt::format("certificate, {} cells", ladder[s].cells));
      const Wheel source(map, lowest, beyond, ladder[s].resolution, options.threads);
      std::vector<std::vector<double>> nodes;
      for (const double low : lowest) nodes.push_back(geometric(low, top, ladder[s].cells));
      markov::Certificate certificate = markov::certify(source, std::move(nodes), beyond, options.threads);
      result.cells = ladder[s].cells;
      result.exists = true;
      result.reason = certificate.no_upper;
      result.from_state = std::move(certificate);
      const markov::Certificate& c = result.from_state;
      const LaunchMean mean(launch, c.nodes[phase]);
      result.lower = std::max(1.0, mean.lower(c.lower[phase]));
      if (!c.upper.empty()) result.upper = mean.upper(c.upper[phase], c.top_jump, c.top_slope);
      if (result.width() <= options.tolerance) break;
    }
  } catch (const dynamics::NoBounds& none) {
    result.reason = none.what();
  } catch (const markov::ConvergenceError& error) {
    if (!result.exists) result.reason = error.what();
  } catch (const std::domain_error& error) {
    if (!result.exists) result.reason = error.what();
  }
  return result;
}

namespace {

// Writes seven digits, rounded away from what is enclosed.
std::string outward(double bound, bool up) {
  constexpr int digits = 7;
  std::string text = fmt::format("{:.{}e}", bound, digits - 1);
  const double shown = std::stod(text);
  if (up ? shown < bound : shown > bound) {
    const double unit = std::pow(10.0, std::stoi(text.substr(text.find('e') + 1)) - digits + 1);
    text = fmt::format("{:.{}e}", up ? shown + unit : shown - unit, digits - 1);
  }
  return fmt::format("{:.{}g}", std::stod(text), digits);
}

}  // namespace

std::string certificate_text(const CertifiedSteps& certified) {
  if (!certified.exists) return "no certificate: " + certified.reason;
  if (std::isinf(certified.upper))
    return fmt::format("at least {}, guaranteed; no upper bound: {}", outward(certified.lower, false),
                       certified.reason);
  return fmt::format("between {} and {} (width {:.2g} %), guaranteed", outward(certified.lower, false),
                     outward(certified.upper, true), 100 * certified.width());
}

}  // namespace metastable::analysis
