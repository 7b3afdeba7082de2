#pragma once
// The return map of the law `settled`: landings tabulated over speed, restitution and friction.

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "dynamics/settled/settled_motion.h"

namespace metastable::dynamics {

/// Where a map is tabulated; landings elsewhere are followed directly.
struct SettledRange {
  double omega_high = 8;               ///< [rad/s]; the lower end is where even a sticking foot rests
  double eta_low = 0, eta_high = 0.6;  ///< in [0, 0.95]; equal: one restitution
  bool operator==(const SettledRange&) const = default;
};

struct SettledMapOptions {
  SettledRange range;
  bool direct = false;                                 ///< no table: every landing followed
  int speeds = 26, restitutions = 13, frictions = 20;  ///< nodes of the table per leg
  int checks = 400;                                    ///< landings per leg that the table is held against
  /// Calls the work for every index in [0, count), in any order, from any threads; default: one after the other.
  std::function<void(std::size_t count, const std::function<void(std::size_t)>& work)> executor;
  std::function<void(double share)> progress;  ///< called now and then, from any thread, one at a time
};

/// What a landing leaves.
struct MappedLanding {
  /// omega_eq^2 of the standing foot that carries the same angular momentum to the next touch [rad^2/s^2]
  /// (Landing::carried_squared); 0 at rest.
  double carried_squared = 0;
  double displacement = 0;  ///< of the foot down the plane [m]; 0 at rest
  bool rest = false;
};

/// Table against direct landings at random points of its range, and where feet settle (none of them unsettled).
struct SettledMapError {
  std::size_t landings = 0, unsettled = 0, misjudged_rests = 0;
  double settled_rms = 0, settled_max = 0;  ///< of carried_squared / omega-^2, both with settled feet
  double unsettled_rms = 0;                 ///< the same where the next leg touches an unsettled foot
  double displacement_max = 0;              ///< [m], settled feet
  double resting_friction_max = 0;          ///< of mu_r
};

/// Landings by table. Const members may be called from any thread.
class SettledMap {
 public:
  /// The map of this wheel on its slope: built at the first call and kept for the life of the process (a map with other
  /// options is another map; executor and progress do not count). Table of the paper's wheel: some 5 s on two cores.
  /// @throws std::invalid_argument as SettledWheel::validate(), and for a range that is empty or out of bounds
  static std::shared_ptr<const SettledMap> of(const SettledWheel& wheel, const SettledMapOptions& options = {});

  const SettledMotion& motion() const { return motion_; }
  int legs() const { return motion_.wheel().legs(); }
  const SettledRange& range() const { return options_.range; }
  bool direct() const { return options_.direct; }

  /// mu_c of a leg: from here on a landing does not depend on mu (up to 1e-5 of omega^2 where feet settle).
  double sticking_friction(int leg) const { return sticking_[static_cast<std::size_t>(leg)]; }
  /// mu_r: the wheel rests below it and nowhere above it. 0: at no friction; infinity: at every one. It rests at every
  /// mu below but for gaps at high eta and omega (0.45, 7 rad/s), where an old foot strikes.
  /// @param omega omega- [rad/s], > 0; @param eta in [0, 1)
  double resting_friction(int leg, double omega, double eta) const;
  /// Some 0.2 us in the table's range (mu above mu_c is read as mu_c), 10 to 300 us outside.
  /// @param leg in [0, legs)
  MappedLanding land(int leg, double omega, const Contact& contact) const;
  /// Many frictions at one restitution: the part of the work that they share is done once.
  void land(int leg, double omega, double eta, std::span<const double> friction, std::span<MappedLanding> landed) const;
  /// omega-^2 at the next touch [rad^2/s^2], for a landing that does not rest.
  double next_squared(int leg, double carried_squared) const { return motion_.foot(leg).next_squared(carried_squared); }
  /// Whether landings are read from the table; some are followed nevertheless, where feet do not settle.
  bool tabulated(int leg, double omega, double eta) const;

  const SettledMapError& error() const { return error_; }
  double seconds() const { return seconds_; }  ///< that it took to build

 private:
  static constexpr int stops = 8;  // mu_2 to mu_9
  static constexpr int piece = 4;  // places on a piece but the last
  // One leg. By restitution the speed at which even a sticking foot rests; from there on, evenly spread in speed, mu_r
  // and the frictions mu_2, mu_3, ... from which slip stops in the second, third, ... impact: there the landing has a
  // kink, between them it is smooth. Landings are kept on every piece [mu_c, mu_2], ... at a few even places, on the
  // last one, down to mu_r, spread evenly in log(1 + part / bend), part = (mu - mu_r) / (its width), bend falling
  // exponentially with omega: steep above mu_r, nearly straight in that scale.
  struct Table {
    std::vector<double> standstill;          // by restitution [rad/s]
    std::vector<double> edges;               // by restitution, speed: mu_2, mu_3, ..., mu_r
    std::vector<double> kept, displacement;  // by restitution, speed, place: carried_squared / omega-^2, [m]
    std::vector<std::uint16_t> unsettled;    // by restitution, speed: a bit for each piece with an unsettled landing
    std::array<double, 6> bend{};            // of log(bend): 1, omega times 1, eta, eta^2
    bool usable = false;
  };
  // `width` neighbouring nodes around a place on an axis and their weights: Lagrange's polynomial through them.
  static constexpr std::size_t width = 6;
  struct Stencil {
    std::size_t first = 0, size = 0;
    std::array<double, width> weight{};
  };
  // Everything that does not depend on mu.
  struct TablePlace {
    Stencil eta, omega;
    std::array<double, stops + 1> edge{};  // mu_2, mu_3, ..., mu_r
    double bend = 0, scale = 0;
    std::uint16_t unsettled = 0;  // any of the nodes
  };
  SettledMap(SettledMotion motion, SettledMapOptions options);
  static Stencil stencil(double place, int count);
  void build();
  void check();
  double standstill(int leg, double eta) const;
  double solve_resting(int leg, double omega, double eta, double guess) const;
  double stopping_friction(int leg, double omega, double eta, int strikes, double low, double high) const;
  void find_bend(int leg);
  double log_bend(const Table& table, double omega, double eta) const;
  double speed(double standstill, double share) const;
  double share(double standstill, double omega) const;
  int places() const { return stops * piece + options_.frictions; }
  bool place(int leg, double omega, double eta, TablePlace& place) const;
  // From the table, or followed where some of its nodes there are unsettled.
  MappedLanding read(int leg, double omega, double eta, double friction, const TablePlace& place) const;
  MappedLanding follow(int leg, double omega, const Contact& contact) const;

  SettledMotion motion_;
  SettledMapOptions options_;
  std::vector<double> sticking_;
  std::vector<Table> table_;  // one a leg
  SettledMapError error_;
  double seconds_ = 0;
};

}  // namespace metastable::dynamics
