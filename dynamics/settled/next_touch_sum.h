#pragma once
// Adds up what landings of a wheel under `settled` say of the next touch.

#include <array>
#include <cstddef>
#include <optional>

#include "dynamics/settled/settled_density.h"

namespace metastable::dynamics {

/// Holds landings in cells, from end to end of each of which the next omega- is spread evenly, and omega_eq^2 where
/// some of them rest.
struct LandingCells {
  static constexpr std::size_t most = 15;
  using Values = std::array<double, most + 1>;
  std::size_t count = 0;
  Values squared{};  ///< omega_eq^2 at the ends, one more than cells [rad^2/s^2]
  Values mass{};     ///< by cell
  Values slide{};    ///< by cell, of the feet [m]
};

/// Sums cells of one landing, for what was seen of it and of the next omega-. What is further off than eight blurs
/// counts as eight.
class NextTouchSum {
 public:
  /// @param landing  must outlive the sum; @param blur, next  [rad/s]
  NextTouchSum(const SettledLanding& landing, const SeenOfLanding& seen, double blur, double next);

  void add(const LandingCells& cells);
  void add_rest(double mass) {
    all_ += mass;
    rest_ += mass;
  }
  bool empty() const { return !(all_ > 0); }
  double rest() const { return empty() ? 0 : rest_ / all_; }
  NextTouch result() const;

  /// Holds, at the ends of cells, the next omega-, and what was seen less that, in blurs: z, with Phi, phi, and Phi's
  /// integral up to there.
  struct Ends {
    LandingCells::Values next, z, below, density, area;
  };

 private:
  void find(const LandingCells::Values& squared, std::size_t count, Ends& ends) const;

  const SettledLanding& landing_;
  std::optional<double> displacement_;
  double slide_error_, blur_, at_;
  Ends barrier_;
  double all_ = 0, rest_ = 0, gone_ = 0, touch_ = 0, middle_ = 0, density_ = 0, below_ = 0, slope_ = 0, curvature_ = 0;
};

}  // namespace metastable::dynamics
