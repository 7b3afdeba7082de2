#pragma once
// The laboratory's ramp is a plane, or a plane with a parabolic sag over a stretch of it.

namespace metastable::dynamics {

/// Gives the height of the surface over the plane of the stated slope, along that plane [m].
class RampSurface {
 public:
  RampSurface() = default;
  /// Sags by `sag` [m] halfway between `from` and `to` [m] (from < to); negative: bows up. Elsewhere it is plane.
  RampSurface(double sag, double from, double to) : sag_(sag), from_(from), to_(to) {}

  double height(double along) const {
    if (sag_ == 0 || along <= from_ || along >= to_) return 0;
    return -4 * sag_ * (along - from_) * (to_ - along) / ((to_ - from_) * (to_ - from_));
  }
  /// Returns the angle by which it rises down the ramp, against the plane [rad]; at a kink the mean of both sides.
  double rise(double along) const;

 private:
  double sag_ = 0, from_ = 0, to_ = 1;
};

}  // namespace metastable::dynamics
