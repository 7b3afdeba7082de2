#include "dynamics/laboratory/ramp_surface.h"

#include <cmath>

namespace metastable::dynamics {

double RampSurface::rise(double along) const {
  if (sag_ == 0 || along < from_ || along > to_) return 0;
  const double tangent = -4 * sag_ * (from_ + to_ - 2 * along) / ((to_ - from_) * (to_ - from_));
  const bool kink = along == from_ || along == to_;
  return std::atan(tangent) / (kink ? 2 : 1);
}

}  // namespace metastable::dynamics
