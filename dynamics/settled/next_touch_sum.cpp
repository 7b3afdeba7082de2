#include "dynamics/settled/next_touch_sum.h"

#include <algorithm>
#include <cmath>

#include "dynamics/numerics/normal_table.h"
#include "dynamics/numerics/truncated_normal.h"

namespace metastable::dynamics {
namespace {

constexpr double unknown_share = 0.002, unknown_error = 0.2;  // of landings; [rad/s]
constexpr double thin = 0.02;                                 // a cell whose ends' mean is taken, in blurs

// Student's density with three degrees of freedom: a foot that slides far does so less surely than the grid says.
double slide_density(double z) {
  const double tail = 1 + z * z / 3;
  return 0.3675525969478614 / (tail * tail);
}

METASTABLE_WIDE void find_next(const SettledLanding& landing, double at, double per_blur,
                               const LandingCells::Values& squared, std::size_t count, NextTouchSum::Ends& ends) {
  for (std::size_t k = 0; k < count; ++k) {
    ends.next[k] = landing.next(squared[k]);
    ends.z[k] = (at - ends.next[k]) * per_blur;
  }
}

METASTABLE_WIDE void find_area(std::size_t count, NextTouchSum::Ends& ends) {
  for (std::size_t k = 0; k < count; ++k) ends.area[k] = ends.z[k] * ends.below[k] + ends.density[k];
}

// The amount that a cell adds by unit of mass.
struct OfCell {
  double middle, density, below, slope, curvature;  // the last two are the density's, in z
};

[[gnu::always_inline]] inline OfCell between(const NextTouchSum::Ends& ends, std::size_t k,
                                             const NextTouchSum::Ends& others, std::size_t j) {
  const double z = ends.z[k], other = others.z[j], width = z - other;
  const double phi = ends.density[k], its = others.density[j];
  const bool is_thin = std::abs(width) < thin;
  const auto rise = [&](double here, double there) { return (here - there) / width; };
  return {.middle = (ends.next[k] + others.next[j]) / 2,
          .density = is_thin ? (phi + its) / 2 : std::abs(rise(ends.below[k], others.below[j])),
          .below = is_thin ? (ends.below[k] + others.below[j]) / 2 : std::abs(rise(ends.area[k], others.area[j])),
          .slope = is_thin ? -(z * phi + other * its) / 2 : rise(phi, its),
          .curvature = is_thin ? ((z * z - 1) * phi + (other * other - 1) * its) / 2 : rise(-z * phi, -other * its)};
}

struct OfCells {
  LandingCells::Values middle, density, below, slope, curvature;
};

METASTABLE_WIDE void weigh_cells(const NextTouchSum::Ends& ends, std::size_t count, OfCells& cells) {
  for (std::size_t k = 0; k < count; ++k) {
    const OfCell cell = between(ends, k, ends, k + 1);
    cells.middle[k] = cell.middle;
    cells.density[k] = cell.density;
    cells.below[k] = cell.below;
    cells.slope[k] = cell.slope;
    cells.curvature[k] = cell.curvature;
  }
}

constexpr std::size_t whole_vectors(std::size_t count) { return (count + 3) / 4 * 4; }

}  // namespace

NextTouchSum::NextTouchSum(const SettledLanding& landing, const SeenOfLanding& seen, double blur, double next)
    : landing_(landing),
      displacement_(seen.displacement),
      slide_error_(seen.displacement_error),
      blur_(blur),
      at_(next) {
  find({landing.barrier_squared}, 1, barrier_);
}

// Finds what is at the first ends, rounded up to whole vectors.
void NextTouchSum::find(const LandingCells::Values& squared, std::size_t count, Ends& ends) const {
  const std::size_t whole = whole_vectors(count);
  find_next(landing_, at_, 1 / blur_, squared, whole, ends);
  normals_at(ends.z.data(), whole, ends.below.data(), ends.density.data());
  find_area(whole, ends);
}

void NextTouchSum::add(const LandingCells& cells) {
  Ends ends;
  OfCells of;
  find(cells.squared, cells.count + 1, ends);
  weigh_cells(ends, cells.count, of);
  const double barrier = landing_.barrier_squared;
  for (std::size_t k = 0; k < cells.count; ++k) {
    double mass = cells.mass[k];
    OfCell cell{of.middle[k], of.density[k], of.below[k], of.slope[k], of.curvature[k]};
    all_ += mass;
    const double first = cells.squared[k], second = cells.squared[k + 1], least = std::min(first, second);
    if (least < barrier) {
      const double most = std::max(first, second);
      const double rests = most > barrier ? (barrier - least) / (most - least) : 1;
      rest_ += mass * rests;
      mass *= 1 - rests;
      cell = between(ends, first < second ? k + 1 : k, barrier_, 0);
    }
    if (!(mass > 0)) continue;
    gone_ += mass;
    if (displacement_) mass *= slide_density((*displacement_ - cells.slide[k]) / slide_error_) / slide_error_;
    touch_ += mass;
    middle_ += mass * cell.middle;
    density_ += mass * cell.density;
    below_ += mass * cell.below;
    slope_ += mass * cell.slope;
    curvature_ += mass * cell.curvature;
  }
}

NextTouch NextTouchSum::result() const {
  if (!(touch_ > 0)) return {{0, 1}, 1};
  // A slide is that of a foot whose next one touched: what it says is of those landings, beside the rests of all.
  const double width = std::hypot(blur_, unknown_error), z = (at_ - middle_ / touch_) / width;
  const auto known = [&](double sum) { return (1 - unknown_share) * sum / touch_ / blur_; };
  const double unknown = unknown_share * normal_density(z) / width, density = known(density_) + unknown;
  const double below = (1 - unknown_share) * below_ / touch_ + unknown_share * normal_cdf(z);
  const double touches = gone_ / all_;
  NextTouch next{{touches * density, std::clamp(rest_ / all_ + touches * below, 0.0, 1.0)},
                 displacement_ ? touch_ / gone_ : 1};
  if (density > 0) {
    next.slope = (known(slope_) / blur_ - unknown * z / width) / density;
    const double bend = known(curvature_) / (blur_ * blur_) + unknown * (z * z - 1) / (width * width);
    next.curvature = bend / density - next.slope * next.slope;
  }
  return next;
}

}  // namespace metastable::dynamics
