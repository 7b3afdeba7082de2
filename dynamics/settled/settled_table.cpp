#include "dynamics/settled/settled_table.h"

#include <algorithm>
#include <cmath>

namespace metastable::dynamics {
namespace {

constexpr double crowding = 1.5;        // of nodes in speed, towards the slowest
constexpr double straight_share = 0.5;  // of the straight line in the places on the last piece

std::size_t index(int i) { return static_cast<std::size_t>(i); }

// Returns, of the k-th of `size` weights, the product of k - j over all other j.
constexpr double denominator(std::size_t k, std::size_t size) {
  constexpr double factorial[] = {1, 1, 2, 6, 24, 120};
  const std::size_t above = size - 1 - k;
  return (above % 2 == 0 ? 1 : -1) * factorial[k] * factorial[above];
}

}  // namespace

void SettledTable::resize() {
  const std::size_t count = index(rows) * index(speeds);
  standstill.resize(index(rows));
  edges.resize(count * (stops + 1));
  unsettled.resize(count);
  known.resize(index(rows) * (stops + 1));
  kept.resize(count * index(places()));
  displacement.resize(kept.size());
}

double SettledTable::eta(int row) const {
  return row < smooth_rows ? eta_low + (smooth_eta - eta_low) * row / (smooth_rows - 1)
                           : smooth_eta + (eta_high - smooth_eta) * (row - smooth_rows + 1) / (rows - smooth_rows);
}

double SettledTable::speed(double still, double share) const {
  const double from = std::sqrt(clear_of_rest), root = from + share * (std::sqrt(omega_high - still) - from);
  return still + root * root;
}

double SettledTable::share(double still, double omega) const {
  const double from = std::sqrt(clear_of_rest);
  return (std::sqrt(omega - still) - from) / (std::sqrt(omega_high - still) - from);
}

double SettledTable::bend_at(double omega, double eta) const {
  return std::exp(bend[0] + eta * (bend[1] + eta * bend[2]) + omega * (bend[3] + eta * (bend[4] + eta * bend[5])));
}

double SettledTable::place(double above, double width, double bend) {
  return (std::log1p(above / bend) / std::log1p(width / bend) + straight_share * above / width) / (1 + straight_share);
}

double SettledTable::above_resting(double place, double width, double bend) {
  double low = 0, high = width;
  for (int i = 0; i < 60; ++i) {
    const double middle = (low + high) / 2;
    (SettledTable::place(middle, width, bend) < place ? low : high) = middle;
  }
  return high;
}

SettledSlice SettledTable::slice(double eta) const { return {*this, eta}; }

SettledSlice::Stencil SettledSlice::stencil(double place, int count, std::size_t size) {
  Stencil s;
  s.size = std::min(index(count), size);
  const int last = count - static_cast<int>(s.size);
  const int first = std::clamp(static_cast<int>(place) - static_cast<int>(s.size - 1) / 2, 0, last);
  s.first = index(first);
  // These are the products of (t - j) / (k - j) over all j but k.
  const double t = place - first;
  double before = 1;
  for (std::size_t k = 0; k < s.size; ++k) {
    s.weight[k] = before;
    before *= t - static_cast<double>(k);
  }
  double after = 1;
  for (std::size_t k = s.size; k-- > 0;) {
    s.weight[k] *= after / denominator(k, s.size);
    after *= t - static_cast<double>(k);
  }
  return s;
}

SettledSlice::SettledSlice(const SettledTable& table, double eta)
    : table_(&table), eta_(eta), edges_(index(table.speeds) * (SettledTable::stops + 1)), rough_(index(table.speeds)) {
  constexpr std::size_t stops = SettledTable::stops;
  const bool below_smooth = eta <= table.smooth_eta;
  const int below = table.smooth_rows - 1;
  const double place = below_smooth ? (eta - table.eta_low) / (table.smooth_eta - table.eta_low) * below
                                    : below + (eta - table.smooth_eta) / (table.eta_high - table.smooth_eta) *
                                                  (table.rows - table.smooth_rows);
  row_ = below_smooth ? stencil(place, table.smooth_rows, smooth) : stencil(place, table.rows, straight);
  for (std::size_t j = 0; j < row_.size; ++j) standstill_ += row_.weight[j] * table.standstill[row_.first + j];
  for (std::size_t i = 0; i < rough_.size(); ++i) {
    for (std::size_t j = 0; j < row_.size; ++j) rough_[i] |= table.unsettled[(row_.first + j) * rough_.size() + i];
    for (std::size_t n = 0; n <= stops; ++n) edges_[i * (stops + 1) + n] = value(table.edges, i, stops + 1, n);
  }
}

double SettledSlice::value(const std::vector<double>& values, std::size_t speed, std::size_t stride,
                           std::size_t place) const {
  double sum = 0;
  for (std::size_t j = 0; j < row_.size; ++j)
    sum += row_.weight[j] * values[((row_.first + j) * rough_.size() + speed) * stride + place];
  return sum;
}

SettledSlice::SliceAtSpeed SettledSlice::at(double omega) const {
  constexpr std::size_t stops = SettledTable::stops;
  SliceAtSpeed place;
  place.slice_ = this;
  place.omega_ = omega;
  place.place_ = place_of(omega);
  const Stencil speed = place.speed_ = stencil(place.place_, table_->speeds, smooth);
  for (std::size_t i = 0; i < speed.size; ++i) place.rough_ |= rough_[speed.first + i];
  for (std::size_t i = 0; i < speed.size; ++i)
    for (std::size_t n = 0; n <= stops; ++n)
      place.edge_[n] += speed.weight[i] * edges_[(speed.first + i) * (stops + 1) + n];
  place.bend_ = table_->bend_at(std::min(omega, table_->omega_high), eta_);
  return place;
}

double SettledSlice::resting_at(double place) const {
  constexpr std::size_t stops = SettledTable::stops;
  const Stencil speed = stencil(place, table_->speeds, smooth);
  double resting = 0;
  for (std::size_t i = 0; i < speed.size; ++i)
    resting += speed.weight[i] * edges_[(speed.first + i) * (stops + 1) + stops];
  return resting;
}

double SettledSlice::resting_friction(double omega) const { return resting_at(place_of(omega)); }

double SettledSlice::place_of(double omega) const {
  return table_->share(standstill_, std::min(omega, table_->omega_high)) * (table_->speeds - 1);
}

std::size_t SettledSlice::SliceAtSpeed::piece_of(double friction) const {
  std::size_t n = 0;
  while (n < SettledTable::stops && friction < edge_[n]) ++n;
  return n;
}

bool SettledSlice::SliceAtSpeed::rough(double friction) const { return (rough_ >> piece_of(friction) & 1) != 0; }

MappedLanding SettledSlice::SliceAtSpeed::land(double friction) const {
  constexpr int stops = SettledTable::stops, piece = SettledTable::piece;
  const SettledTable& table = *slice_->table_;
  if (friction < resting_friction() && friction < table.sticking) return {0, 0, true};
  const std::size_t n = piece_of(friction);
  const Stencil& row = slice_->row_;
  const double high = n == 0 ? table.sticking : edge_[n - 1], low = n < stops ? edge_[n] : resting_friction();
  const double above = std::clamp(friction - low, 0.0, std::max(0.0, high - low));
  const double part = high > low ? (n < stops ? above / (high - low) : table.place(above, high - low, bend_)) : 1;
  const Stencil mu = n < stops ? stencil((1 - part) * (piece - 1), piece, smooth)
                               : stencil(part * (table.frictions - 1), table.frictions, smooth);
  const std::size_t stride = index(table.places()), first = n * piece + mu.first;
  double kept = 0, displacement = 0;
  for (std::size_t j = 0; j < row.size; ++j) {
    // Where the wheel barely passes a row's piece may begin at a higher speed.
    const int known = table.known[(row.first + j) * (stops + 1) + n];
    Stencil speed = speed_;
    if (index(known) > speed.first) {
      speed = stencil(place_ - known, table.speeds - known, place_ < known ? beyond : smooth);
      speed.first += index(known);
    }
    for (std::size_t i = 0; i < speed.size; ++i) {
      const std::size_t at = ((row.first + j) * index(table.speeds) + speed.first + i) * stride + first;
      double kept_here = 0, displacement_here = 0;
      for (std::size_t k = 0; k < mu.size; ++k) {
        kept_here += mu.weight[k] * table.kept[at + k];
        displacement_here += mu.weight[k] * table.displacement[at + k];
      }
      kept += row.weight[j] * speed.weight[i] * kept_here;
      displacement += row.weight[j] * speed.weight[i] * displacement_here;
    }
  }
  return {std::max(0.0, kept * omega_ * omega_), displacement, false};
}

double SettledSlice::slowest(double friction, double low, double high) const {
  double from = place_of(low), to = place_of(high);
  if (!(resting_at(to) <= friction)) return high;
  if (resting_at(from) <= friction) return low;
  while (to - from > 1e-10) {  // mu_r falls with the speed
    const double middle = (from + to) / 2;
    (resting_at(middle) <= friction ? to : from) = middle;
  }
  return table_->speed(standstill_, to / (table_->speeds - 1));
}

}  // namespace metastable::dynamics
