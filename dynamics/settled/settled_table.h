#pragma once
// Keeps landings of one leg under `settled` at nodes of restitution, speed and friction, and reads between them.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace metastable::dynamics {

class SettledSlice;

/// Says what a landing leaves.
struct MappedLanding {
  /// The omega_eq^2 of the standing foot that carries the same angular momentum to the next touch [rad^2/s^2]
  /// (Landing::carried_squared); 0 at rest.
  double carried_squared = 0;
  double displacement = 0;  ///< of the foot down the plane [m]; 0 at rest
  bool rest = false;
};

/// One leg's table. It holds by restitution the speed at which even a sticking foot rests; from there on, spread in
/// speed, mu_r and the frictions at which the landing has a kink: mu_2', from which slip stops before the second
/// compression ends, and mu_2, mu_3, ..., from which it stops in the second, third, ... impact; between them it is
/// smooth. Landings are kept on every piece [mu_c, mu_2'], [mu_2', mu_2], ... at a few even places, on the last one,
/// down to mu_r, spread so as to follow the landing, which is steep within some `bend` of mu_r. Where the wheel barely
/// passes, mu_r lies above kinks: there the pieces go on below it, with the omega_eq^2 of feet that stood and were
/// turned back. Between the nodes polynomials of degree 5 are read, straight lines in eta above smooth_eta. What is
/// read is continuous, so that chains made of it converge; where feet are still unsettled the landings themselves jump.
struct SettledTable {
  static constexpr int stops = 9;                // mu_2', mu_2, mu_3', mu_3 to mu_8
  static constexpr int piece = 4;                // places on a piece but the last
  static constexpr double clear_of_rest = 0.02;  // the first speed, over the one at which a sticking foot rests [rad/s]

  double eta_low = 0, smooth_eta = 0.6, eta_high = 0.95;  // rows stand as densely on either side of smooth_eta
  int smooth_rows = 13, rows = 20;                        // up to smooth_eta, all
  int speeds = 26, frictions = 20;                        // nodes
  double omega_high = 9;                                  // [rad/s]
  double sticking = 0;                                    // mu_c
  bool usable = false;
  std::array<double, 6> bend{};            // of log(bend), a friction: 1, omega times 1, eta, eta^2
  std::vector<double> standstill;          // by row [rad/s]
  std::vector<double> edges;               // by row, speed: mu_2', mu_2, mu_3, ..., mu_r
  std::vector<double> kept, displacement;  // by row, speed, place: carried_squared / omega-^2, [m]
  std::vector<std::uint16_t> unsettled;    // by row, speed: a bit for each piece with an unsettled landing
  std::vector<int> known;                  // by row, piece: the first speed at which its landings are known

  void resize();
  double eta(int row) const;
  int places() const { return stops * piece + frictions; }
  /// Speeds stand closer where the wheel barely passes. @param still standstill [rad/s]; @param share in [0, 1]
  double speed(double still, double share) const;
  double share(double still, double omega) const;
  double bend_at(double omega, double eta) const;
  /// Says where a friction above mu_r stands on the last piece, in [0, 1]; and back. Even in log(1 + above / bend),
  /// with some of a straight line. @param width of the piece
  static double place(double above, double width, double bend);
  static double above_resting(double place, double width, double bend);
  bool holds(double eta) const { return usable && eta >= eta_low && eta <= eta_high; }
  SettledSlice slice(double eta) const;  ///< @param eta that holds()
};

/// The table at one restitution. It refers to the table.
class SettledSlice {
  // Holds neighbouring nodes around a place on an axis and their weights: Lagrange's polynomial through them.
  static constexpr std::size_t smooth = 6, straight = 2, beyond = 3;  // nodes: between them, and outside
  struct Stencil {
    std::size_t first = 0, size = 0;
    std::array<double, smooth> weight{};
  };

 public:
  SettledSlice(const SettledTable& table, double eta);

  double lowest_speed() const { return standstill_ + SettledTable::clear_of_rest; }
  bool holds(double omega) const { return omega >= lowest_speed() && omega <= table_->omega_high; }
  /// The table at one of its speeds.
  class SliceAtSpeed {
   public:
    double resting_friction() const { return edge_[SettledTable::stops]; }
    /// Returns mu_2', mu_2, mu_3, ..., mu_r: where the landing has a kink.
    std::span<const double> edges() const { return edge_; }
    MappedLanding land(double friction) const;  ///< friction above mu_c is read as mu_c
    /// Says whether feet are unsettled at some of the nodes around.
    bool rough(double friction) const;

   private:
    friend class SettledSlice;
    std::size_t piece_of(double friction) const;
    const SettledSlice* slice_ = nullptr;
    double omega_ = 0, place_ = 0, bend_ = 0;
    Stencil speed_;
    std::array<double, SettledTable::stops + 1> edge_{};
    std::uint16_t rough_ = 0;  // of any node around: a bit for each piece
  };
  /// @param omega at least lowest_speed(); above the table's speeds the last one's share of omega^2 is kept
  SliceAtSpeed at(double omega) const;
  double resting_friction(double omega) const;  ///< likewise
  /// Returns the least speed in [low, high] that `friction` survives; high if none.
  double slowest(double friction, double low, double high) const;

 private:
  double place_of(double omega) const;  // on the axis of speeds
  double resting_at(double place) const;
  static Stencil stencil(double place, int count, std::size_t size);
  double value(const std::vector<double>& values, std::size_t speed, std::size_t stride, std::size_t place) const;

  const SettledTable* table_;
  double eta_, standstill_ = 0;
  Stencil row_;
  std::vector<double> edges_;         // by speed
  std::vector<std::uint16_t> rough_;  // by speed: of any row around, a bit for each piece
  friend class SliceAtSpeed;
};

}  // namespace metastable::dynamics
