#pragma once
// Makes the wheel's stochastic return map under `settled`, on x = omega^2 just before a collision.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "dynamics/return_map/wheel_map.h"
#include "dynamics/settled/now_and_then.h"
#include "dynamics/settled/settled_map.h"

namespace metastable::dynamics {

class SettledRoll;

/// Maps landings of the law `settled` under random (eta, mu), with the phases of WheelMap: one for equal legs, else one
/// a leg. Every landing starts from a standing foot: (leg, omega-) is taken for the whole state (steady steps touch an
/// unsettled foot in 0 to 0.1 % of all cases; "foot unsettled" counts them). Rest is mu < mu_r(omega-, eta), so that
/// its probability is a normal's tail however small; above mu_c the landing is an atom. Satisfies markov::ReturnMap.
class SettledReturnMap {
 public:
  /// @param wheel with its slope; @param noise eta within [0, most_settled_restitution]
  /// @param options of the table; its range is widened to `highest_speed` [rad/s], at most 20 rad/s. Its progress is
  /// told 1 now and then once the table is built, while landings are followed or integrated: it may throw to stop
  /// @throws std::invalid_argument as SettledMap::of and WheelMap
  SettledReturnMap(const Wheel& wheel, double slope, ContactNoise noise, double highest_speed,
                   SettledMapOptions options = {});

  const SettledMap& landings() const { return *landings_; }
  const ContactNoise& noise() const { return geometry_.noise(); }

  std::pair<double, double> state_interval(int phase) const;
  int phases() const { return geometry_.phases(); }
  int noise_dimension() const { return noise().dimension(); }
  std::optional<double> landing(double state, int phase, std::span<const double> score) const;
  /// Takes Gauss-Legendre panels over eta, the distribution of mu in closed form; nothing for a correlated pair.
  std::optional<double> rest_probability(double state, int phase) const;
  /// Takes panels over eta and, between mu_r and mu_c, over mu, cut where the landing crosses a break; one point an eta
  /// above mu_c. @throws std::invalid_argument for correlated eta and mu (names the sampled method)
  double landing_points(double state, int phase, std::span<const double> breaks,
                        std::vector<std::pair<double, double>>& points) const;
  /// Lists the states from which a sticking foot, at the mean of eta and some sds from it, lands at one of `next`.
  std::vector<double> states_of_extremes(int phase, std::span<const double> next) const;
  /// Returns {infimum, supremum} over the noise's support, by a grid over eta and mu's bounds; -infinity stands
  /// for rest.
  std::pair<double, double> landing_range(double state, int phase) const;
  /// Returns the time of the stance as if the foot stood from the collision on [s].
  double duration(double next_state, int phase) const;
  /// Measures from this touch to the next one, the mean slide of the foot at its usual speed included [m].
  double advance(int phase) const { return advance_[static_cast<std::size_t>(phase)]; }
  /// Takes one draw of E[f(landing that is followed)] - E[f(landing)], with f(rest) = 0: its mean over the scores is
  /// what the table does to E f. Nothing where landings are followed anyway.
  std::optional<double> landing_defect(double state, int phase, std::span<const double> score,
                                       const std::function<double(double next)>& f) const;
  /// Takes one draw of what the motion of a foot that has not settled when the next leg touches does to f after the
  /// next landing, f(rest) being 0; 0 where the foot stands. The scores are those of both landings. Of what lies
  /// between the frictions below which the wheel rests, on a moving foot and on a standing one, nothing is left to
  /// chance.
  std::optional<double> memory_defect(double state, int phase, std::span<const double> score,
                                      const std::function<double(double after_next)>& f) const;
  /// Names "foot lifts" as under the other laws, just before the collision; "foot unsettled": the next leg touches
  /// while the landed foot still hops or slides.
  std::vector<std::string> assumptions() const;
  bool violates(int which, double state, int phase, std::span<const double> score) const;

  /// Holds draws of one phase: each a curve over the states, from the slowest that survives it upwards.
  class Table {
   public:
    Table(const SettledReturnMap& map, int phase) : map_(&map), phase_(phase) {}
    void add(const Contact& draw);
    void land(double origin, double width, std::span<const double> offset, std::size_t first,
              std::span<double> next) const;
    double lowest_survivor(std::size_t k) const { return lowest_[k]; }
    void reorder(std::span<const std::uint32_t> order);

   private:
    const SettledReturnMap* map_;
    int phase_;
    std::vector<double> lowest_;
    std::vector<double> kept_;  // share of omega-^2 above the highest state; below 0 where landings are followed
    std::vector<Contact> contact_;
    std::vector<float> curve_;  // landings of a draw, from lowest_ to the highest state
  };
  Table tabulate(int phase, std::span<const double> score) const;

 private:
  struct EtaPoint {
    double eta, weight, resting_friction;
  };
  // Reads from the table where there is one: below its speeds the wheel rests, above them it keeps the last's share.
  void tell() const {
    if (listener_) (*listener_)();
  }
  MappedLanding land(int phase, double omega, const Contact& contact) const;
  double resting_friction(int phase, double omega, double eta) const;
  double next_state(int phase, double omega, const Contact& contact) const;  // rest_landing's value at rest
  double arrival(int phase, const MappedLanding& landed) const;
  double worth(int phase, const Landing& landing, const std::function<double(double)>& f) const;
  double resting_friction(const SettledRoll& roll, double restitution, double guess) const;
  std::vector<EtaPoint> restitutions(double omega, int phase) const;
  double listed_points(double omega, int phase, std::vector<std::pair<double, double>>& points) const;
  double mean_slide(int phase) const;

  WheelMap geometry_;
  std::shared_ptr<const SettledMap> landings_;
  double highest_state_;
  std::vector<double> advance_;
  std::shared_ptr<NowAndThen> listener_;
};

}  // namespace metastable::dynamics
