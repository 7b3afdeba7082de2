#pragma once
// Makes the return map of the law `settled`: landings tabulated over speed, restitution and friction.

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <vector>

#include "dynamics/settled/settled_motion.h"
#include "dynamics/settled/settled_table.h"

namespace metastable::dynamics {

/// Says where a map is tabulated; landings elsewhere are followed directly.
struct SettledRange {
  double omega_high = 9;                ///< [rad/s]; the lower end is where even a sticking foot rests
  double eta_low = 0, eta_high = 0.95;  ///< in [0, 0.95]
  bool operator==(const SettledRange&) const = default;
};

struct SettledMapOptions {
  SettledRange range;
  bool direct = false;                                 ///< no table: every landing followed
  int speeds = 28, restitutions = 15, frictions = 20;  ///< nodes of the table per leg; restitutions up to 0.6
  int checks = 400;                                    ///< landings per leg that the table is held against
  /// Calls the work for every index in [0, count), in any order, from any threads; by default one after the other.
  std::function<void(std::size_t count, const std::function<void(std::size_t)>& work)> executor;
  /// Called now and then, within the search of one mu_r too, from any thread, one at a time; it may throw to stop.
  std::function<void(double share)> progress;
};

/// Holds a table against landings that are followed, in one region.
struct SettledMapError {
  std::size_t landings = 0, misjudged_rests = 0;
  double rms = 0, median = 0, largest = 0;  ///< of carried_squared / omega-^2, where both roll on
  double displacement = 0;                  ///< the largest [m]
  /// Those of mu_r, the largest and the median.
  double resting_friction = 0, resting_friction_median = 0;
};

/// Holds a table against landings that are followed at points spread over its range.
struct SettledMapErrors {
  SettledMapError sliding;   ///< mu < mu_c, 0.5 rad/s and more above the speed at which a sticking foot rests
  SettledMapError sticking;  ///< mu > mu_c, likewise: the atom
  SettledMapError slow;      ///< less than 0.5 rad/s above it: the wheel barely passes
  /// eta above 0.6, or the next leg touches an unsettled foot at some node around.
  SettledMapError rough;
};

/// Says that a table would take too long to build; the message says how long.
class TableTooLong : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Reads landings by table. Const members may be called from any thread.
class SettledMap {
 public:
  /// Returns the map of this wheel on its slope: built at the first call and kept for the life of the process (the last
  /// 32 of them; a map with other options is another map, executor and progress do not count). The table of the paper's
  /// wheel takes some 4 s on two cores.
  /// @throws std::invalid_argument as SettledWheel::validate(), and for a range that is empty or out of bounds;
  /// TableTooLong where landings (feet that chatter, a wheel of hardly any inertia that slides) take so long that the
  /// table would take more than 15 min of a processor: foreseen from some landings, before it is begun
  static std::shared_ptr<const SettledMap> of(const SettledWheel& wheel, const SettledMapOptions& options = {});

  const SettledMotion& motion() const { return motion_; }
  int legs() const { return motion_.wheel().legs(); }
  const SettledRange& range() const { return options_.range; }
  bool direct() const { return options_.direct; }

  /// Returns mu_c of a leg: from here on a landing does not depend on mu (up to 1e-5 of omega^2 where feet settle).
  double sticking_friction(int leg) const { return sticking_[static_cast<std::size_t>(leg)]; }
  /// Returns mu_r: the wheel rests below it and nowhere above it. 0 says at no friction, infinity at every one. It
  /// rests at every mu below but for gaps at high eta and omega (0.45, 7 rad/s), where an old foot strikes.
  /// @param omega omega- [rad/s], > 0; @param eta in [0, 1)
  double resting_friction(int leg, double omega, double eta) const;
  /// Takes some 2 us in the table's range (mu above mu_c is read as mu_c), 10 to 300 us outside.
  /// @param leg in [0, legs)
  MappedLanding land(int leg, double omega, const Contact& contact) const;
  /// Does the same, followed whatever the table holds.
  MappedLanding follow(int leg, double omega, const Contact& contact) const;
  /// Returns mu_r, found by some dozens of landings that are followed. @param guess from which to start; 0: none
  /// @param tell  called before each of them; it may throw to stop
  double followed_resting_friction(
      int leg, double omega, double eta, double guess = 0, const std::function<void()>& tell = [] {}) const;
  /// Returns mu_r at speeds that rise by equal steps [rad/s], each to `width`.
  std::vector<double> followed_resting_frictions(int leg, std::span<const double> omega, double eta,
                                                 double width) const;
  /// Returns the table at one restitution, to read many landings from; nothing where there is no table.
  std::optional<SettledSlice> slice(int leg, double eta) const;
  /// Returns omega-^2 at the next touch [rad^2/s^2], for a landing that does not rest.
  double next_squared(int leg, double carried_squared) const { return motion_.foot(leg).next_squared(carried_squared); }
  /// Returns the first leg of which there is no table although one was asked for, since even a foot that sticks rests
  /// up to the highest speed of the range at some restitution; nothing if there is none.
  std::optional<int> untabulated() const;
  const SettledMapErrors& error() const { return error_; }
  double seconds() const { return seconds_; }  ///< that it took to build

 private:
  SettledMap(SettledMotion motion, SettledMapOptions options);
  void foresee() const;
  void build();
  void find_edges(SettledTable& table, int leg, int row, const std::function<void()>& tell) const;
  void tabulate(SettledTable& table, int leg, int row, const std::function<void()>& tell) const;
  void find_bend(SettledTable& table, int leg, const std::function<void()>& tell) const;
  void check();
  double standstill(int leg, double eta, const std::function<void()>& tell) const;
  double solve_resting(int leg, double omega, double eta, double guess, double off, double width,
                       const std::function<void()>& tell) const;

  SettledMotion motion_;
  SettledMapOptions options_;
  std::vector<double> sticking_;
  std::vector<SettledTable> table_;  // one a leg; one in all if they are alike
  SettledMapErrors error_;
  double seconds_ = 0;
};

}  // namespace metastable::dynamics
