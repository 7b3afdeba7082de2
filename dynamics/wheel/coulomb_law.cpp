#include "dynamics/wheel/coulomb_law.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace metastable::dynamics {
namespace {

// Says how the contact speeds respond to the normal impulse in one mode (stick, or slip in a fixed direction).
struct Mode {
  double normal;      // dv_n/dP [1/kg]
  double tangential;  // dv_t/dP [1/kg], downhill; 0 when sticking
};

class Contactor {
 public:
  Contactor(const ContactModel& model, const Collision& c, double friction)
      : friction_(friction),
        x_(c.contact_x),
        y_(c.contact_y),
        r2_(coulomb_squared_gyration(model, c)),
        mass_(model.mass) {}

  // With downhill = +1 the foot slips downhill, friction pushes uphill; -1 is the reverse.
  Mode slip(double downhill) const {
    const double coupling = x_ * y_, scale = 1 / (mass_ * r2_), mu = downhill * friction_;
    return {(r2_ + x_ * x_ - mu * coupling) * scale, (coupling - mu * (r2_ + y_ * y_)) * scale};
  }
  Mode after_slip() const {
    if (std::abs(x_ * y_) <= friction_ * (r2_ + y_ * y_))
      return {(r2_ + x_ * x_ + y_ * y_) / (mass_ * (r2_ + y_ * y_)), 0};
    return slip(x_ * y_ > 0 ? 1 : -1);
  }

 private:
  double friction_, x_, y_, r2_, mass_;
};

}  // namespace

Loss coulomb_loss(const ContactModel& model, const Collision& c, const Contact& contact) {
  const double mu = contact.friction, restored = contact.restitution * contact.restitution;
  const double v0 = c.normal_speed;
  const double slip0 = -c.tangential_speed;  // v_t, downhill
  const Contactor contactor(model, c, mu);
  Loss loss;

  double impulse = 0;   // P so far
  double normal = -v0;  // v_n now
  double absorbed = 0;  // normal work taken up in compression
  double released = 0;  // and given back so far
  bool finished = false;
  if (slip0 != 0) {
    const double direction = slip0 > 0 ? 1 : -1;
    const Mode mode = contactor.slip(direction);
    const double decay = -direction * mode.tangential;  // of |v_t| per impulse
    const double stop = decay > 0 ? std::abs(slip0) / decay : std::numeric_limits<double>::infinity();
    const double turn = mode.normal > 0 ? v0 / mode.normal : std::numeric_limits<double>::infinity();
    if (turn <= stop) {  // compression ends while slipping
      absorbed = v0 * turn / 2;
      const double end = turn * (1 + contact.restitution);
      finished = end <= stop;
      impulse = std::min(end, stop);
      normal = mode.normal * (impulse - turn);
      released = normal * (impulse - turn) / 2;
    } else {
      impulse = stop;
      normal = -v0 + mode.normal * stop;
      absorbed = (v0 - normal) * stop / 2;
    }
    loss.normal_pre = absorbed - released;
    const double slip_end = finished ? std::abs(slip0) - decay * impulse : 0;
    loss.tangential_pre = mu * impulse * (std::abs(slip0) + slip_end) / 2;
  }
  if (!finished) {
    const Mode mode = contactor.after_slip();
    const double compression = normal < 0 ? normal * normal / (2 * mode.normal) : 0;
    absorbed += compression;
    const double to_release = restored * absorbed - released;
    const double last = std::sqrt((normal > 0 ? normal * normal : 0) + 2 * mode.normal * std::max(0.0, to_release));
    const double more = (last - normal) / mode.normal;
    loss.normal_post = compression - to_release;
    loss.tangential_post = mu * std::abs(mode.tangential) * more * more / 2;
  }
  loss.rebound = model.rebound_lost * restored * absorbed;
  return loss;
}

double coulomb_squared_gyration(const ContactModel& model, const Collision& c) {
  const double floor = 1e-16 * (c.contact_x * c.contact_x + c.contact_y * c.contact_y);
  return std::max(model.radius_of_gyration * model.radius_of_gyration, floor);
}

double coulomb_sticking_friction(const ContactModel& model, const Collision& c) {
  return std::abs(c.contact_x * c.contact_y) / (coulomb_squared_gyration(model, c) + c.contact_y * c.contact_y);
}

}  // namespace metastable::dynamics
