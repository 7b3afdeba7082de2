#include "dynamics/wheel/settled_density.h"

#include <algorithm>
#include <boost/math/distributions/students_t.hpp>
#include <boost/math/quadrature/gauss.hpp>
#include <boost/math/tools/toms748_solve.hpp>
#include <cmath>

#include "dynamics/wheel/normal_table.h"
#include "dynamics/wheel/truncated_normal.h"

namespace metastable::dynamics {
namespace {

constexpr std::size_t nodes_of_restitution = 12, nodes_of_all = 8;
constexpr double far_score = 4.2, far_of_all = 3.4;           // of restitutions
constexpr double unknown_share = 0.002, unknown_error = 0.2;  // of landings; [rad/s]
constexpr double thin = 0.02;                                 // a cell whose ends' mean is taken, in blurs

double square(double v) { return v * v; }

// Weighs restitutions and frictions of one landing.
class Weights {
 public:
  Weights(const SettledContact& c, double ratio)
      : c_(c),
        ratio_(ratio),
        friction_mean_(c.friction_mean * ratio),
        friction_sd_(c.friction_sd * ratio),
        friction_mass_(std::max(1e-300, normal_cdf(friction_mean_ / friction_sd_))),
        low_(normal_cdf(-c.restitution_mean / c.restitution_sd)),
        mass_(std::max(1e-300, normal_cdf((1 - c.restitution_mean) / c.restitution_sd) - low_)) {}
  double friction_density(double mu) const {
    return mu > 0 ? normal_density((mu - friction_mean_) / friction_sd_) / (friction_sd_ * friction_mass_) : 0;
  }
  double friction_above(double mu) const {
    return mu > 0 ? normal_at((friction_mean_ - mu) / friction_sd_).below / friction_mass_ : 1;
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
  // Returns the same with a variance of restitution that is smaller by so much.
  Weights less_spread(double variance) const {
    SettledContact less = c_;
    less.restitution_sd = std::sqrt(std::max(0.25 * square(c_.restitution_sd), square(c_.restitution_sd) - variance));
    return {less, ratio_};
  }
  double least_restitution(double far = far_score) const {
    return std::max(0.0, c_.restitution_mean - far * c_.restitution_sd);
  }
  double most_restitution(double far = far_score) const {
    return std::min(1.0, c_.restitution_mean + far * c_.restitution_sd);
  }

 private:
  SettledContact c_;
  double ratio_, friction_mean_, friction_sd_, friction_mass_, low_, mass_;
};

// Is Student's density with three degrees of freedom: a foot that slides far does so less surely than the grid says.
double slide_density(double z) {
  const double tail = 1 + z * z / 3;
  return 0.3675525969478614 / (tail * tail);
}

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
      : landing_(landing), lever_sq_(landing.gyration_sq + landing.ahead * landing.ahead) {
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
    const double lost = lost_ / (1 + eta), arm = landing_.chord - lost * landing_.ahead;
    if (!(arm > 0)) return {0, 0};
    return {(landing_.chord * landing_.ahead - lost * lever_sq_) / (landing_.height * arm),
            rate_ * landing_.chord * landing_.gyration_sq / (landing_.height * arm * arm * (1 + eta))};
  }

 private:
  const SettledLanding& landing_;
  double lever_sq_, lost_, rate_, stuck_;
};

// Adds up what cells of landings say of the next touch.
class TouchSum {
 public:
  // Is one end of a cell.
  struct End {
    double squared = 0;      // omega_eq^2
    double next = 0, z = 0;  // the next omega-; what was seen less that, in blurs
    NormalAt at = {};        // z
    double area = 0;         // Phi's integral up to z
  };

  TouchSum(const SettledLanding& landing, const SeenOfLanding& seen, double blur, double next)
      : landing_(landing),
        displacement_(seen.displacement),
        slide_error_(seen.displacement_error),
        blur_(blur),
        at_(next),
        normal_(normal_nodes()),
        barrier_(end(landing.barrier_squared)) {}

  End end(double squared) const {
    constexpr double reach = normal_reach;
    End e{.squared = squared, .next = landing_.next(squared)};
    e.z = (at_ - e.next) / blur_;
    e.at = normal_in_reach(std::clamp(e.z, -reach, reach), normal_);
    e.area = e.z * e.at.below + e.at.density;
    return e;
  }

  // Adds landings that carry omega^2 spread evenly from `first` to `second`, whose feet slide so far.
  void add(double mass, const End& first, const End& second, double slide) {
    if (first.squared > second.squared) return add(mass, second, first, slide);
    const double barrier = barrier_.squared;
    double rests = first.squared < barrier ? 1 : 0;
    if (first.squared < barrier && second.squared > barrier)
      rests = (barrier - first.squared) / (second.squared - first.squared);
    all_ += mass;
    rest_ += mass * rests;
    mass *= 1 - rests;
    if (!(mass > 0)) return;
    gone_ += mass;
    if (displacement_) {
      const double z = (*displacement_ - slide) / slide_error_;
      mass *= slide_density(z) / slide_error_;
    }
    touch_ += mass;
    const End& low = rests > 0 ? barrier_ : first;
    middle_ += mass * (low.next + second.next) / 2;
    const double width = low.z - second.z;
    if (width < thin) {
      density_ += mass * (low.at.density + second.at.density) / 2;
      below_ += mass * (low.at.below + second.at.below) / 2;
    } else {
      density_ += mass / width * (low.at.below - second.at.below);
      below_ += mass / width * (low.area - second.area);
    }
  }

  void add_rest(double mass) {
    all_ += mass;
    rest_ += mass;
  }
  bool empty() const { return !(all_ > 0); }
  double rest() const { return empty() ? 0 : rest_ / all_; }
  NextTouch result() const {
    if (!(touch_ > 0)) return {{0, 1}, 1};
    // A slide is that of a foot whose next one touched: what it says is of those landings, beside the rests of all.
    const double width = std::hypot(blur_, unknown_error), z = (at_ - middle_ / touch_) / width;
    const double density = (1 - unknown_share) * density_ / touch_ / blur_ + unknown_share * normal_density(z) / width;
    const double below = (1 - unknown_share) * below_ / touch_ + unknown_share * normal_cdf(z);
    const double touches = gone_ / all_;
    return {{touches * density, std::clamp(rest_ / all_ + touches * below, 0.0, 1.0)},
            displacement_ ? touch_ / gone_ : 1};
  }

 private:
  const SettledLanding& landing_;
  std::optional<double> displacement_;
  double slide_error_, blur_, at_;
  const NormalNodes& normal_;
  End barrier_;
  double all_ = 0, rest_ = 0, gone_ = 0, touch_ = 0, middle_ = 0, density_ = 0, below_ = 0;
};

// Are landings in the order of their restitution, each standing for those half the way to its neighbours.
struct Cells {
  struct Cell {
    double eta, mass;
    LandingShares::Kept kept;
  };
  std::array<Cell, nodes_of_restitution> cells;
  std::size_t count = 0;

  void add_to(TouchSum& sum, std::optional<double> first_edge = {}) const {
    if (count == 0) return;
    TouchSum::End before = sum.end(first_edge.value_or(cells[0].kept.share));
    for (std::size_t k = 0; k < count; ++k) {
      const double here = cells[k].kept.share;
      const TouchSum::End after = sum.end(k + 1 < count ? (cells[k + 1].kept.share + here) / 2 : here);
      sum.add(cells[k].mass, before, after, cells[k].kept.displacement);
      before = after;
    }
  }
};

// Is the restitution at which omega_eq^2 crosses the barrier.
struct Edge {
  double eta;
  bool rising;  // those above it go on
};

// Looks between neighbours, and between the last of them, if it rests, and `to`. @param beyond  omega_eq^2 less `level`
template <class Beyond>
std::optional<Edge> barrier(const Cells& along, double level, double to, Beyond beyond) {
  for (std::size_t k = 1; k <= along.count; ++k) {
    const bool last = k == along.count;
    const double from = along.cells[k - 1].eta, here = along.cells[k - 1].kept.share - level;
    if (last && here >= 0) break;
    const double next = last ? to : along.cells[k].eta, there = last ? beyond(to) : along.cells[k].kept.share - level;
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
void add_along(TouchSum& sum, const SettledLanding& landing, const Weights& weights, double share, double omega_plus) {
  const FirstImpact first(landing, omega_plus);
  const double eta_stuck = first.sticking_restitution(), critical = landing.sticking();
  const auto mass = [&](double eta) {
    const auto [mu, rate] = first.friction(eta);
    return share * weights.restitution_density(eta) * weights.friction_density(mu) * rate;
  };
  const auto kept = [&](double eta) { return landing.carried({eta, first.friction(eta).first}); };
  const auto add = [&](Cells& cells, double eta, double weight) {
    if (const double here = weight * mass(eta); here > 0) cells.cells[cells.count++] = {eta, here, kept(eta)};
  };
  const auto beyond = [&](double eta) { return kept(eta).share - landing.barrier_squared; };

  const double to = std::min(eta_stuck, weights.most_restitution());
  const double from = std::min(weights.least_restitution(), to - 1e-3);
  Cells all;
  restitutions(from, to, [&](double eta, double weight) { add(all, eta, weight); });
  if (const auto edge = barrier(all, landing.barrier_squared, to, beyond)) {
    const auto [resting, going] = edge->rising ? std::pair(from, to) : std::pair(to, from);
    restitutions(std::min(resting, edge->eta), std::max(resting, edge->eta),
                 [&](double eta, double weight) { sum.add_rest(weight * mass(eta)); });
    Cells gone;
    const double width = going - edge->eta;
    restitutions(0, 1, [&](double root, double weight) {
      add(gone, edge->eta + width * root * root, 2 * root * weight * std::abs(width));
    });
    gone.add_to(sum, landing.barrier_squared);
  } else {
    all.add_to(sum);
  }
  const double stuck = share * weights.friction_above(critical) * first.sticking_rate();
  if (const double here = stuck * weights.restitution_density(std::max(0.0, eta_stuck)); here > 0) {
    const LandingShares::Kept at = landing.carried({std::max(0.0, eta_stuck), critical});
    const TouchSum::End end = sum.end(at.share);
    sum.add(here, end, end, at.displacement);
  }
}

// Are every second of the grid's places, and the first.
constexpr std::array<int, LandingShares::parts / 2 + 1> cell_places = [] {
  std::array<int, LandingShares::parts / 2 + 1> places{};
  for (std::size_t k = 1; k < places.size(); ++k) places[k] = 2 * static_cast<int>(k) - 1;
  return places;
}();
static_assert(cell_places.back() == LandingShares::parts - 1);

// Adds those of a foot that sticks, in cells of restitution.
void add_sticking(TouchSum& sum, const SettledLanding& landing, const Weights& weights, double share) {
  constexpr int cells = 14;
  const double from = weights.least_restitution(), width = (weights.most_restitution() - from) / cells;
  // Even within cells, landings would spread by more than they do: of normal ones the variance by a sixth of the square
  // of a cell.
  const Weights narrower = weights.less_spread(width * width / 6);
  const auto kept_at = [&](double eta) {
    return landing.carried_as(landing.place.at_restitution(eta).at_place(LandingShares::parts - 1));
  };
  double above = 1;
  LandingShares::Kept kept = kept_at(from);
  TouchSum::End end = sum.end(kept.share);
  for (int k = 1; k <= cells; ++k) {
    const double eta = from + width * k, next_above = k < cells ? narrower.restitution_above(eta) : 0;
    const LandingShares::Kept next_kept = kept_at(eta);
    const TouchSum::End next_end = sum.end(next_kept.share);
    sum.add(share * (above - next_above), end, next_end, (kept.displacement + next_kept.displacement) / 2);
    above = next_above;
    kept = next_kept;
    end = next_end;
  }
}

// Adds all landings: for each of some restitutions cells of friction between places of the grid, and for the sticking
// foot cells of restitution.
void add_all(TouchSum& sum, const SettledLanding& landing, const Weights& weights, double share) {
  const double critical = landing.sticking(), own = landing.place.leg().sticking, off = critical - own;
  constexpr std::size_t cells = cell_places.size();
  restitutions<nodes_of_all>(
      weights.least_restitution(far_of_all), weights.most_restitution(far_of_all), [&](double eta, double weight) {
        const double mass = share * weight * weights.restitution_density(eta);
        const LandingShares::SharesAtRestitution at = landing.place.at_restitution(eta);
        const double resting = at.resting_friction(), width = own - resting;
        // It starts from somewhat below the grid's mu_r, that the wheel's own may be lower. Loops of one kind of work
        // each take half the time of one.
        const double start = resting - 0.1 * width;
        std::array<LandingShares::Kept, cells + 1> kept;
        std::array<double, cells + 1> above;
        std::array<TouchSum::End, cells + 1> ends;
        kept[0] = landing.carried_as(at.at(start));
        above[0] = weights.friction_above(start + off);
        for (std::size_t k = 0; k < cells; ++k) kept[k + 1] = landing.carried_as(at.at_place(cell_places[k]));
        for (std::size_t k = 0; k < cells; ++k)
          above[k + 1] = weights.friction_above(resting + LandingShares::part(cell_places[k]) * width + off);
        for (std::size_t k = 0; k <= cells; ++k) ends[k] = sum.end(kept[k].share);
        sum.add_rest(mass * (1 - above[0]));
        for (std::size_t k = 0; k < cells; ++k)
          sum.add(mass * (above[k] - above[k + 1]), ends[k], ends[k + 1],
                  (kept[k].displacement + kept[k + 1].displacement) / 2);
      });
  add_sticking(sum, landing, weights, share * weights.friction_above(critical));
}

// Adds usual and rare frictions.
template <class Add>
void of_each_friction(const SettledContact& contact, Add add) {
  if (contact.rare_share < 1) add(Weights(contact, 1), 1 - contact.rare_share);
  if (contact.rare_share > 0) add(Weights(contact, contact.rare_ratio), contact.rare_share);
}

void add_landings(TouchSum& sum, const SettledLanding& landing, const SettledContact& contact,
                  std::optional<double> omega_plus) {
  if (omega_plus)
    of_each_friction(
        contact, [&](const Weights& weights, double share) { add_along(sum, landing, weights, share, *omega_plus); });
  if (!sum.empty()) return;  // else no contact gives that omega+: it says nothing
  of_each_friction(contact, [&](const Weights& weights, double share) { add_all(sum, landing, weights, share); });
}

}  // namespace

double slide_score(double share) { return boost::math::quantile(boost::math::students_t(3), share); }

double SettledLanding::next(double squared) const {
  const double taken = dragged[0] + squared * (dragged[1] + squared * dragged[2]);
  return next_ratio * std::sqrt(std::max(1e-6, next_rate * squared + next_gain - taken));
}

double SettledLanding::plastic_loss() const { return chord * ahead / (gyration_sq + ahead * ahead + height * height); }

double SettledLanding::first_loss_ratio() const {
  const double lost = plastic_loss(), kept = 1 - lost;
  return (1 - std::sqrt(std::max(0.0, 1 - loss_ratio * (1 - kept * kept)))) / lost;
}

double SettledLanding::first_impact(const Contact& contact) const {
  const double mu = std::min(contact.friction, sticking());
  const double lost =
      (1 + contact.restitution) * chord * (ahead - mu * height) / (gyration_sq + ahead * ahead - mu * ahead * height);
  return std::max(0.0, 1 - first_loss_ratio() * lost);
}

LandingShares::Kept SettledLanding::carried(const Contact& contact) const {
  return carried_as(place.at(contact.restitution, contact.friction - sticking() + place.leg().sticking));
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
    restitutions(weights.least_restitution(), std::min(eta_stuck, weights.most_restitution()),
                 [&](double eta, double weight) {
                   const auto [mu, rate] = first.friction(eta);
                   const double here = share * weight * weights.restitution_density(eta);
                   result.density += here * weights.friction_density(mu) * rate;
                   result.below += here * (1 - weights.friction_above(mu));
                 });
  });
  result.below = std::clamp(result.below, 0.0, 1.0);
  return result;
}

NextTouch at_next_touch(const SettledLanding& landing, const SettledContact& contact, const SeenOfLanding& seen,
                        double blur, double next) {
  TouchSum sum(landing, seen, blur, next);
  add_landings(sum, landing, contact, seen.omega_plus);
  return sum.result();
}

double rest_share(const SettledLanding& landing, const SettledContact& contact, std::optional<double> omega_plus) {
  TouchSum sum(landing, {}, 1, 0);
  add_landings(sum, landing, contact, omega_plus);
  return sum.rest();
}

}  // namespace metastable::dynamics
