#include "dynamics/settled/settled_density.h"

#include <algorithm>
#include <boost/math/distributions/students_t.hpp>
#include <boost/math/quadrature/gauss.hpp>
#include <boost/math/tools/toms748_solve.hpp>
#include <cmath>
#include <tuple>
#include <utility>

#include "dynamics/numerics/normal_table.h"
#include "dynamics/numerics/square.h"
#include "dynamics/numerics/truncated_normal.h"
#include "dynamics/settled/next_touch_sum.h"

namespace metastable::dynamics {
namespace {

constexpr std::size_t nodes_of_restitution = 12, nodes_of_all = 8;
constexpr double far_score = 4.2, far_of_all = 3.4;  // of restitutions

// Contacts that gave one omega+, at some restitutions.
struct Contacts {
  using Values = std::array<double, nodes_of_restitution>;
  std::size_t count = 0;
  Values eta{}, weight{};             // of the rule
  Values mu{}, rate{};                // and its change with omega+
  Values of_eta{}, of_mu{}, above{};  // densities; share of higher frictions
  double mass(std::size_t k) const { return weight[k] * of_eta[k] * of_mu[k] * rate[k]; }
};

// Finds Phi and the density also where the table ends.
template <std::size_t size>
void normals(const std::array<double, size>& z, std::size_t count, std::array<double, size>& below,
             std::array<double, size>& density) {
  normals_at(z.data(), size, below.data(), density.data());
  for (std::size_t k = 0; k < count; ++k)
    if (std::abs(z[k]) > normal_reach) below[k] = normal_cdf(z[k]), density[k] = normal_density(z[k]);
}

// Weighs restitutions and frictions of one landing.
class Weights {
 public:
  Weights(const SettledContact& c, double ratio)
      : c_(c),
        friction_mean_(c.friction_mean * ratio),
        friction_sd_(c.friction_sd * ratio),
        friction_mass_(std::max(1e-300, normal_cdf(friction_mean_ / friction_sd_))),
        low_(normal_cdf(-c.restitution_mean / c.restitution_sd)),
        mass_(std::max(1e-300, normal_cdf((1 - c.restitution_mean) / c.restitution_sd) - low_)) {}
  double friction_above(double mu) const {
    return mu > 0 ? normal_cdf((friction_mean_ - mu) / friction_sd_) / friction_mass_ : 1;
  }
  // Finds the same of so many.
  void frictions_above(const LandingCells::Values& mu, std::size_t count, LandingCells::Values& above) const {
    LandingCells::Values score{}, density;
    for (std::size_t k = 0; k < count; ++k) score[k] = (friction_mean_ - mu[k]) / friction_sd_;
    normals(score, count, above, density);
    for (std::size_t k = 0; k < count; ++k) above[k] = mu[k] > 0 ? above[k] / friction_mass_ : 1;
  }
  // Finds densities and shares of contacts.
  void weigh(Contacts& at) const {
    Contacts::Values eta{}, mu{}, below;  // scores
    for (std::size_t k = 0; k < at.count; ++k) {
      eta[k] = (at.eta[k] - c_.restitution_mean) / c_.restitution_sd;
      mu[k] = (friction_mean_ - at.mu[k]) / friction_sd_;
    }
    normals(eta, at.count, below, at.of_eta);
    normals(mu, at.count, below, at.of_mu);
    for (std::size_t k = 0; k < at.count; ++k) {
      at.of_eta[k] = at.eta[k] >= 0 && at.eta[k] <= 1 ? at.of_eta[k] / (c_.restitution_sd * mass_) : 0;
      at.of_mu[k] = at.mu[k] > 0 ? at.of_mu[k] / (friction_sd_ * friction_mass_) : 0;
      at.above[k] = at.mu[k] > 0 ? below[k] / friction_mass_ : 1;
    }
  }
  double restitution_density(double eta) const {
    return eta >= 0 && eta <= 1
               ? normal_density((eta - c_.restitution_mean) / c_.restitution_sd) / (c_.restitution_sd * mass_)
               : 0;
  }
  double restitution_above(double eta) const {
    if (eta >= 1) return 0;
    return eta > 0 ? 1 - (normal_cdf((eta - c_.restitution_mean) / c_.restitution_sd) - low_) / mass_ : 1;
  }
  // Finds the shares of restitutions between ends `width` apart, the first one at `from`.
  void restitutions_between(double from, double width, LandingCells& cells) const {
    // Even within cells they would spread by more than they do: a normal variance by a sixth of the square of a cell.
    const double sd = std::sqrt(square(c_.restitution_sd) - width * width / 6);
    LandingCells::Values score{}, below, density;
    for (std::size_t k = 0; k <= cells.count; ++k)
      score[k] = (from + width * static_cast<double>(k) - c_.restitution_mean) / sd;
    normals_at(score.data(), score.size(), below.data(), density.data());
    const double all = std::max(1e-300, below[cells.count] - below[0]);
    for (std::size_t k = 0; k < cells.count; ++k) cells.mass[k] = (below[k + 1] - below[k]) / all;
  }
  // Return where restitutions end that are weighed: so many sds from the mean, or where they can be. Of a mean that no
  // restitution has they are a standard deviation wide.
  double least_restitution(double far = far_score) const {
    return std::max(0.0, std::min(c_.restitution_mean - far * c_.restitution_sd, 1 - c_.restitution_sd));
  }
  double most_restitution(double far = far_score) const {
    return std::min(1.0, std::max(c_.restitution_mean + far * c_.restitution_sd, c_.restitution_sd));
  }
  // Says how far the few restitutions of all landings reach: by so much less where no end cuts them off.
  double reach_of_all() const {
    const bool cut = c_.restitution_mean < far_of_all * c_.restitution_sd ||
                     c_.restitution_mean + far_of_all * c_.restitution_sd > 1;
    return cut ? far_score : far_of_all;
  }

 private:
  const SettledContact& c_;
  double friction_mean_, friction_sd_, friction_mass_, low_, mass_;
};

// Calls use(eta, weight) at so many restitutions, rising.
template <std::size_t nodes = nodes_of_restitution, class Use>
void restitutions(double from, double to, Use use) {
  if (!(to > from)) return;
  using Rule = boost::math::quadrature::gauss<double, nodes>;
  const auto& at = Rule::abscissa();  // the positive half
  const double middle = (from + to) / 2, half = (to - from) / 2;
  for (std::size_t k = at.size(); k-- > 0;) use(middle - half * at[k], half * Rule::weights()[k]);
  for (std::size_t k = 0; k < at.size(); ++k) use(middle + half * at[k], half * Rule::weights()[k]);
}

// Holds the contacts that give one omega+ of the first impact: mu as a function of eta up to the restitution at which
// the foot sticks, where every friction above mu_c does.
class FirstImpact {
 public:
  FirstImpact(const SettledLanding& landing, double omega_plus)
      : gyration_sq_(landing.gyration_sq),
        ahead_(landing.struck_ahead()),
        height_(landing.struck_height()),
        chord_(landing.struck_chord()),
        lever_sq_(gyration_sq_ + ahead_ * ahead_) {
    // This is the speed lost by the law itself, of which `ratio` times as much was lost.
    const double ratio = landing.first_loss_ratio();
    lost_ = (1 - omega_plus / landing.omega) / ratio;
    rate_ = 1 / (ratio * landing.omega);
    stuck_ = landing.plastic_loss();
  }
  double sticking_restitution() const { return lost_ / stuck_ - 1; }
  double sticking_rate() const { return rate_ / stuck_; }  // of that restitution with omega+
  // Returns mu, and its change with omega+.
  std::pair<double, double> friction(double eta) const {
    const double lost = lost_ / (1 + eta), arm = chord_ - lost * ahead_;
    if (!(arm > 0)) return {0, 0};
    return {(chord_ * ahead_ - lost * lever_sq_) / (height_ * arm),
            rate_ * chord_ * gyration_sq_ / (height_ * arm * arm * (1 + eta))};
  }

 private:
  double gyration_sq_, ahead_, height_, chord_;  // of the first impact
  double lever_sq_, lost_, rate_, stuck_;
};

// Landings in the order of their restitution, each standing for those half the way to its neighbours.
struct Landings {
  struct One {
    double eta, mass;
    LandingShares::Kept kept;
  };
  std::array<One, nodes_of_restitution> list;
  std::size_t count = 0;

  void add_to(NextTouchSum& sum, std::optional<double> first_edge = {}) const {
    if (count == 0) return;
    LandingCells cells{.count = count};
    for (std::size_t k = 0; k < count; ++k) {
      const double here = list[k].kept.share;
      cells.squared[k] = k > 0 ? (list[k - 1].kept.share + here) / 2 : first_edge.value_or(here);
      cells.mass[k] = list[k].mass;
      cells.slide[k] = list[k].kept.displacement;
    }
    cells.squared[count] = list[count - 1].kept.share;
    sum.add(cells);
  }
};

// Finds the contacts that gave omega+ at twelve restitutions of [low, high], which `of` maps with their weights.
template <class Map>
Contacts contacts(const FirstImpact& first, const Weights& weights, double low, double high, Map of) {
  Contacts at;
  restitutions(low, high, [&](double node, double weight) {
    std::tie(at.eta[at.count], at.weight[at.count]) = of(node, weight);
    std::tie(at.mu[at.count], at.rate[at.count]) = first.friction(at.eta[at.count]);
    ++at.count;
  });
  weights.weigh(at);
  return at;
}

Contacts contacts(const FirstImpact& first, const Weights& weights, double low, double high) {
  return contacts(first, weights, low, high, [](double eta, double weight) { return std::pair(eta, weight); });
}

// The restitution at which omega_eq^2 crosses the barrier.
struct Edge {
  double eta;
  bool rising;  // those above it go on
};

// Looks between neighbours, and between the last of them, if it rests, and `to`. @param beyond  omega_eq^2 less `level`
template <class Beyond>
std::optional<Edge> barrier(const Landings& along, double level, double to, Beyond beyond) {
  for (std::size_t k = 1; k <= along.count; ++k) {
    const bool last = k == along.count;
    const double from = along.list[k - 1].eta, here = along.list[k - 1].kept.share - level;
    if (last && here >= 0) break;
    const double next = last ? to : along.list[k].eta, there = last ? beyond(to) : along.list[k].kept.share - level;
    if ((here >= 0) == (there >= 0)) continue;
    std::uintmax_t steps = 40;
    const auto [low, high] = boost::math::tools::toms748_solve(beyond, from, next, here, there,
                                                               boost::math::tools::eps_tolerance<double>(30), steps);
    return Edge{(low + high) / 2, there >= 0};
  }
  return {};
}

// Adds landings whose first impact left omega+: cells around twelve restitutions, and the sticking foot. Where only
// some go on, the cells start at the barrier and are finest there: omega_eq rises as a root from where feet rest.
void add_along(NextTouchSum& sum, const SettledLanding& landing, const Weights& weights, double share,
               double omega_plus) {
  const FirstImpact first(landing, omega_plus);
  const double eta_stuck = first.sticking_restitution(), critical = landing.sticking();
  const auto kept = [&](double eta, double mu) { return landing.carried({eta, mu}); };
  const auto beyond = [&](double eta) { return kept(eta, first.friction(eta).first).share - landing.barrier_squared; };
  const auto landings = [&](const Contacts& at) {
    Landings all;
    for (std::size_t k = 0; k < at.count; ++k)
      if (const double mass = share * at.mass(k); mass > 0)
        all.list[all.count++] = {at.eta[k], mass, kept(at.eta[k], at.mu[k])};
    return all;
  };

  const double to = std::min(eta_stuck, weights.most_restitution());
  const double from = std::min(weights.least_restitution(), to - 1e-3);
  const Landings all = landings(contacts(first, weights, from, to));
  if (const auto edge = barrier(all, landing.barrier_squared, to, beyond)) {
    const auto [resting, going] = edge->rising ? std::pair(from, to) : std::pair(to, from);
    const Contacts rest = contacts(first, weights, std::min(resting, edge->eta), std::max(resting, edge->eta));
    for (std::size_t k = 0; k < rest.count; ++k) sum.add_rest(share * rest.mass(k));
    const double width = going - edge->eta;
    landings(contacts(first, weights, 0, 1, [&, at = edge->eta](double root, double weight) {
      return std::pair(at + width * root * root, 2 * root * weight * std::abs(width));
    })).add_to(sum, landing.barrier_squared);
  } else {
    all.add_to(sum);
  }
  const double stuck = share * weights.friction_above(critical) * first.sticking_rate();
  if (const double here = stuck * weights.restitution_density(std::max(0.0, eta_stuck)); here > 0) {
    const LandingShares::Kept at = landing.carried({std::max(0.0, eta_stuck), critical});
    sum.add(LandingCells{.count = 1, .squared = {at.share, at.share}, .mass = {here}, .slide = {at.displacement}});
  }
}

// Every second of the grid's places, and the first.
constexpr std::array<int, LandingShares::parts / 2 + 1> cell_places = [] {
  std::array<int, LandingShares::parts / 2 + 1> places{};
  for (std::size_t k = 1; k < places.size(); ++k) places[k] = 2 * static_cast<int>(k) - 1;
  return places;
}();
static_assert(cell_places.back() == LandingShares::parts - 1);

// Adds those of a foot that sticks, in cells of restitution.
void add_sticking(NextTouchSum& sum, const SettledLanding& landing, const Weights& weights, double share) {
  constexpr std::size_t count = 14;
  const double from = weights.least_restitution(), width = (weights.most_restitution() - from) / count;
  if (!(width > 0)) return;
  LandingCells cells{.count = count};
  weights.restitutions_between(from, width, cells);
  for (std::size_t k = 0; k <= count; ++k) {
    const LandingShares::Kept kept = landing.carried_as(
        landing.place.at_restitution(from + width * static_cast<double>(k)).at_place(LandingShares::parts - 1));
    cells.squared[k] = kept.share;
    cells.slide[k] = kept.displacement;
  }
  for (std::size_t k = 0; k < count; ++k) {
    cells.mass[k] *= share;
    cells.slide[k] = (cells.slide[k] + cells.slide[k + 1]) / 2;
  }
  sum.add(cells);
}

// Adds all landings: for each of some restitutions cells of friction between places of the grid, and for the sticking
// foot cells of restitution.
void add_all(NextTouchSum& sum, const SettledLanding& landing, const Weights& weights, double share) {
  const double critical = landing.sticking(), own = landing.place.leg().sticking, off = critical - own;
  LandingCells cells{.count = cell_places.size()};
  LandingCells::Values mu, above;
  const double reach = weights.reach_of_all(), least = weights.least_restitution(reach),
               most = weights.most_restitution(reach);
  restitutions<nodes_of_all>(least, most, [&](double eta, double weight) {
    const double mass = share * weight * weights.restitution_density(eta);
    const LandingShares::SharesAtRestitution at = landing.place.at_restitution(eta);
    const double of_grid = at.resting_friction(), resting = landing.resting(of_grid), width = own - resting;
    // It starts from somewhat below mu_r, that the wheel's own may be lower.
    constexpr double lower = 0.1;
    mu[0] = resting - lower * width;
    LandingShares::Kept last = landing.carried_as(at.at(of_grid - lower * (own - of_grid)));
    cells.squared[0] = last.share;
    for (std::size_t k = 0; k < cells.count; ++k) {
      mu[k + 1] = resting + LandingShares::part(cell_places[k]) * width;
      const LandingShares::Kept kept = landing.carried_as(at.at_place(cell_places[k]));
      cells.squared[k + 1] = kept.share;
      cells.slide[k] = (last.displacement + kept.displacement) / 2;
      last = kept;
    }
    for (std::size_t k = 0; k <= cells.count; ++k) mu[k] += off;
    weights.frictions_above(mu, cells.count + 1, above);
    sum.add_rest(mass * (1 - above[0]));
    for (std::size_t k = 0; k < cells.count; ++k) cells.mass[k] = mass * (above[k] - above[k + 1]);
    sum.add(cells);
  });
  add_sticking(sum, landing, weights, share * weights.friction_above(critical));
}

// Adds usual and rare frictions.
template <class Add>
void of_each_friction(const SettledContact& contact, Add add) {
  if (contact.rare_share < 1) add(Weights(contact, 1), 1 - contact.rare_share);
  if (contact.rare_share > 0) add(Weights(contact, contact.rare_ratio), contact.rare_share);
}

void add_landings(NextTouchSum& sum, const SettledLanding& landing, const SettledContact& contact,
                  std::optional<double> omega_plus) {
  if (omega_plus)
    of_each_friction(
        contact, [&](const Weights& weights, double share) { add_along(sum, landing, weights, share, *omega_plus); });
  if (!sum.empty()) return;  // else no contact gives that omega+: it says nothing
  of_each_friction(contact, [&](const Weights& weights, double share) { add_all(sum, landing, weights, share); });
}

}  // namespace

double slide_score(double share) {
  using boost::math::policies::policy, boost::math::policies::promote_double;
  using Policy = policy<promote_double<false>>;  // with long double it takes seven times as long
  return boost::math::quantile(boost::math::students_t_distribution<double, Policy>(3), share);
}

double SettledLanding::plastic_loss(double friction) const {
  const double d = struck_ahead(), h = struck_height();
  return struck_chord() * (d - friction * h) / (gyration_sq + d * d - friction * d * h);
}

double SettledLanding::first_loss_ratio() const {
  const double lost = plastic_loss(), kept = 1 - lost;
  return (1 - std::sqrt(std::max(0.0, 1 - loss_ratio * (1 - kept * kept)))) / lost;
}

double SettledLanding::first_impact(const Contact& contact) const {
  const double lost = (1 + contact.restitution) * plastic_loss(std::min(contact.friction, sticking()));
  return std::max(0.0, 1 - first_loss_ratio() * lost);
}

double SettledLanding::resting(double of_grid) const {
  constexpr double most = 0.9;  // of the way to mu_c
  return of_grid + std::min(resting_shift, most * std::max(0.0, place.leg().sticking - of_grid));
}

LandingShares::Kept SettledLanding::carried(const Contact& contact) const {
  const double own = place.leg().sticking;
  double below = sticking() - contact.friction;  // mu_c
  const LandingShares::SharesAtRestitution at = place.at_restitution(contact.restitution);
  if (const double of_grid = at.resting_friction(); resting_shift != 0 && of_grid < own)
    below *= (own - of_grid) / (own - resting(of_grid));
  return carried_as(at.at(own - below));
}

LandingShares::Kept SettledLanding::carried_as(const LandingShares::Kept& of_grid) const {
  const double share = of_grid.share + plastic_share(chord, ahead, height, gyration_sq) - place.leg().plastic;
  return {(1 - loss_ratio * (1 - share)) * omega * omega, of_grid.displacement};
}

SpeedDensity after_first_impact(const SettledLanding& landing, const SettledContact& contact, double omega_plus) {
  const FirstImpact first(landing, omega_plus);
  const double eta_stuck = first.sticking_restitution(), critical = landing.sticking();
  SpeedDensity result;
  of_each_friction(contact, [&](const Weights& weights, double share) {
    result.below += share * weights.restitution_above(eta_stuck);
    result.density +=
        share * weights.friction_above(critical) * weights.restitution_density(eta_stuck) * first.sticking_rate();
    const Contacts at =
        contacts(first, weights, weights.least_restitution(), std::min(eta_stuck, weights.most_restitution()));
    for (std::size_t k = 0; k < at.count; ++k) {
      result.density += share * at.mass(k);
      result.below += share * at.weight[k] * at.of_eta[k] * (1 - at.above[k]);
    }
  });
  result.below = std::clamp(result.below, 0.0, 1.0);
  return result;
}

NextTouch at_next_touch(const SettledLanding& landing, const SettledContact& contact, const SeenOfLanding& seen,
                        double blur, double next) {
  NextTouchSum sum(landing, seen, blur, next);
  add_landings(sum, landing, contact, seen.omega_plus);
  return sum.result();
}

double rest_share(const SettledLanding& landing, const SettledContact& contact, std::optional<double> omega_plus) {
  NextTouchSum sum(landing, {}, 1, 0);
  add_landings(sum, landing, contact, omega_plus);
  return sum.rest();
}

}  // namespace metastable::dynamics
