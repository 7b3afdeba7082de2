#include "dynamics/return_map/settled_return_map.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/quadrature/gauss.hpp>
#include <boost/math/tools/toms748_solve.hpp>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

#include "dynamics/settled/settled_roll.h"

namespace metastable::dynamics {
namespace {

constexpr double rests = -std::numeric_limits<double>::infinity();  // as markov::rest_landing
constexpr double farthest_contact = 39;                             // [sd]: beyond it probabilities underflow
constexpr double followed_depth = 40;    // integrands are followed down to e^-followed_depth of their largest
constexpr double eta_panel = 1.5;        // [sd]
constexpr double mu_panel = 3;           // [sd]
constexpr std::size_t curve_nodes = 20;  // of a draw's landing as a function of the state
constexpr double slowest_launch = 0.1;   // of the slowest survivor's state; slower ones rest
constexpr double speed_steps = 3;        // few tables serve all launches [rad/s]
constexpr double most_speed = 20;        // of a table [rad/s]

// Calls f(place, weight) at the points of a rule on panels of [from, to]; a square root at either end is smooth there.
template <std::size_t order, class F>
void by_rule(double from, double to, std::size_t panels, const F& f) {
  using Rule = boost::math::quadrature::gauss<double, order>;
  constexpr std::size_t half = order / 2;
  for (std::size_t p = 0; p < panels; ++p)
    for (std::size_t k = 0; k < order; ++k) {
      const double place = 0.5 + (k < half ? -0.5 : 0.5) * Rule::abscissa()[k % half];
      const double t = (static_cast<double>(p) + place) / static_cast<double>(panels);
      const double sine = std::sin(std::numbers::pi / 2 * t);
      f(from + (to - from) * sine * sine, (to - from) * 0.5 * Rule::weights()[k % half] / static_cast<double>(panels) *
                                              std::numbers::pi / 2 * std::sin(std::numbers::pi * t));
    }
}

// Does the same on as many panels as are needed, with fewer points where the whole is a small part of one.
template <class F>
void over_panels(double from, double to, double panel, const F& f) {
  constexpr double narrow = 0.04;
  if (!(to > from)) return;
  if (to - from < narrow * panel)
    by_rule<8>(from, to, 1, f);
  else
    by_rule<16>(from, to, static_cast<std::size_t>(std::ceil(std::numbers::pi / 2 * (to - from) / panel)), f);
}

// Cuts [low, high], frictions of feet that slide before they stand, where the landing `next` is one of `breaks` or has
// a kink. @param next  the landing as a function of mu, rising, not less than `from`
template <class Next>
std::vector<double> cuts_of_sliding(double low, double high, const Next& next, double from,
                                    std::span<const double> breaks, std::span<const double> kinks) {
  const double to = next(high);
  std::vector<double> cuts{low, high};
  for (const double b : breaks) {
    if (!(b > from && b < to)) continue;
    std::uintmax_t iterations = 60;
    const auto bracket =
        boost::math::tools::toms748_solve([&](double mu) { return std::max(next(mu), from) - b; }, low, high, from - b,
                                          to - b, boost::math::tools::eps_tolerance<double>(40), iterations);
    cuts.push_back(0.5 * (bracket.first + bracket.second));
  }
  for (const double kink : kinks)
    if (kink > low && kink < high) cuts.push_back(kink);
  std::sort(cuts.begin(), cuts.end());
  return cuts;
}

SettledMapOptions widened(SettledMapOptions options, double highest_speed) {
  double& high = options.range.omega_high;
  while (high < highest_speed && high < most_speed) high = std::min(high + speed_steps, most_speed);
  return options;
}

}  // namespace

SettledReturnMap::SettledReturnMap(const Wheel& wheel, double slope, ContactNoise noise, double highest_speed,
                                   SettledMapOptions options)
    : geometry_(wheel, slope, Law::settled, std::move(noise)) {
  options = widened(std::move(options), highest_speed);
  if (options.progress) listener_ = std::make_shared<NowAndThen>([progress = options.progress] { progress(1); });
  landings_ = SettledMap::of(settled_wheel(wheel, slope), options);
  // A small wheel rests up to high speeds.
  if (landings_->untabulated() && options.range.omega_high < most_speed) {
    options.range.omega_high = most_speed;
    landings_ = SettledMap::of(settled_wheel(wheel, slope), options);
  }
  highest_state_ = landings_->range().omega_high * landings_->range().omega_high;
  for (int p = 0; p < phases(); ++p) advance_.push_back(landings_->motion().foot(p).pace() + mean_slide(p));
}

std::pair<double, double> SettledReturnMap::state_interval(int phase) const {
  const StandingFoot& before = landings_->motion().foot(phase - 1);
  return {before.next_squared(before.barrier_squared()), std::numeric_limits<double>::infinity()};
}

double SettledReturnMap::duration(double next_state, int phase) const {
  // A round tip rolls: its barrier is another than that of a point, for which there is a closed form.
  return landings_->motion().wheel().tip_radius > 0 ? landings_->motion().foot(phase).duration(next_state)
                                                    : geometry_.duration(next_state, phase);
}

double SettledReturnMap::arrival(int phase, const MappedLanding& landed) const {
  if (landed.rest) return rests;
  // A foot that just passes the barrier is slow, but not slower than that.
  return std::max(landings_->next_squared(phase, landed.carried_squared), state_interval(phase + 1).first);
}

MappedLanding SettledReturnMap::land(int phase, double omega, const Contact& contact) const {
  const std::optional<SettledSlice> table = landings_->slice(phase, contact.restitution);
  if (!table) {
    tell();
    return landings_->follow(phase, omega, contact);
  }
  if (omega < table->lowest_speed()) return {0, 0, true};
  return table->at(omega).land(contact.friction);
}

double SettledReturnMap::resting_friction(int phase, double omega, double eta) const {
  const std::optional<SettledSlice> table = landings_->slice(phase, eta);
  if (!table) return landings_->followed_resting_friction(phase, omega, eta, 0, [this] { tell(); });
  return omega < table->lowest_speed() ? std::numeric_limits<double>::infinity() : table->resting_friction(omega);
}

double SettledReturnMap::next_state(int phase, double omega, const Contact& contact) const {
  return arrival(phase, land(phase, omega, contact));
}

std::optional<double> SettledReturnMap::landing(double state, int phase, std::span<const double> score) const {
  const double next = next_state(phase, std::sqrt(state), noise().draw(score));
  if (next == rests) return std::nullopt;
  return next;
}

// Lists points over eta, each with its mu_r: where either the landing or the rest from there counts.
std::vector<SettledReturnMap::EtaPoint> SettledReturnMap::restitutions(double omega, int phase) const {
  tell();
  const TruncatedNormal &restitution = noise().restitution(), &friction = noise().friction();
  const auto resting = [&](double eta) { return resting_friction(phase, omega, eta); };
  if (restitution.constant()) return {{restitution.mean(), 1, resting(restitution.mean())}};
  const double sd = restitution.sd();
  const double low = std::max(restitution.lower(), restitution.mean() - farthest_contact * sd);
  const double high = std::min(restitution.upper(), restitution.mean() + farthest_contact * sd);
  const auto count = static_cast<std::size_t>(std::clamp(std::ceil((high - low) / sd), 8.0, 80.0));
  std::vector<double> eta(count + 1), limit(count + 1), landing(count + 1), resting_log(count + 1);
  double most_landing = -std::numeric_limits<double>::infinity(),
         most_resting = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i <= count; ++i) {
    eta[i] = low + (high - low) * static_cast<double>(i) / static_cast<double>(count);
    limit[i] = resting(eta[i]);
    const double z = (eta[i] - restitution.mean()) / sd;
    landing[i] = -0.5 * z * z;
    const double rest = friction.constant() ? (friction.mean() < limit[i] ? 1 : 0) : friction.cdf(limit[i]);
    resting_log[i] = landing[i] + (rest > 0 ? std::log(rest) : -std::numeric_limits<double>::infinity());
    most_landing = std::max(most_landing, landing[i]);
    most_resting = std::max(most_resting, resting_log[i]);
  }
  const auto counts = [&](std::size_t i) {
    return landing[i] > most_landing - followed_depth || resting_log[i] > most_resting - followed_depth;
  };
  // Where the foot begins to rest although it sticks (or at the one mu there is), the landing jumps: panels end there.
  const double sticks = landings_->sticking_friction(phase);
  const double decides = friction.constant() ? std::min(friction.mean(), sticks) : sticks;
  std::vector<double> cuts;
  for (std::size_t i = 0; i < count; ++i) {
    if (!counts(i) && !counts(i + 1)) continue;
    if (cuts.empty()) cuts.push_back(eta[i]);
    if ((limit[i] > decides) != (limit[i + 1] > decides)) {
      double a = eta[i], b = eta[i + 1];
      for (int k = 0; k < 50; ++k) {
        const double middle = 0.5 * (a + b);
        ((resting(middle) > decides) == (limit[i] > decides) ? a : b) = middle;
      }
      cuts.push_back(0.5 * (a + b));
    }
    if (i + 1 == count || !counts(i + 1)) cuts.push_back(eta[i + 1]);
  }
  std::vector<EtaPoint> points;
  for (std::size_t c = 0; c + 1 < cuts.size(); ++c)
    over_panels(cuts[c], cuts[c + 1], eta_panel * sd, [&](double at, double weight) {
      points.push_back({at, weight * restitution.density(at), resting(at)});
    });
  return points;
}

std::optional<double> SettledReturnMap::rest_probability(double state, int phase) const {
  const double omega = std::sqrt(state);
  if (noise().is_empirical()) {
    const auto pairs = noise().pairs();
    const auto at_rest = std::count_if(pairs.begin(), pairs.end(),
                                       [&](const Contact& c) { return next_state(phase, omega, c) == rests; });
    return static_cast<double>(at_rest) / static_cast<double>(pairs.size());
  }
  if (noise().correlation() != 0) return std::nullopt;
  const TruncatedNormal& friction = noise().friction();
  double sum = 0;
  for (const EtaPoint& p : restitutions(omega, phase))
    sum += p.weight *
           (friction.constant() ? (friction.mean() < p.resting_friction ? 1 : 0) : friction.cdf(p.resting_friction));
  return std::min(1.0, sum);
}

// Adds the landings from each pair of a list of contacts; returns the share that rests.
double SettledReturnMap::listed_points(double omega, int phase, std::vector<std::pair<double, double>>& points) const {
  const double weight = 1.0 / static_cast<double>(noise().pairs().size());
  double rest = 0;
  for (const Contact& c : noise().pairs()) {
    const double next = next_state(phase, omega, c);
    if (next == rests)
      rest += weight;
    else
      points.emplace_back(next, weight);
  }
  return std::min(1.0, rest);
}

double SettledReturnMap::landing_points(double state, int phase, std::span<const double> breaks,
                                        std::vector<std::pair<double, double>>& points) const {
  const double omega = std::sqrt(state);
  if (noise().is_empirical()) return listed_points(omega, phase, points);
  if (noise().correlation() != 0)
    throw std::invalid_argument(
        "method integrated: correlated restitution and friction have no rows by quadrature; use the sampled method");
  const TruncatedNormal& friction = noise().friction();
  const double sticks = landings_->sticking_friction(phase);
  double rest = 0;
  for (const EtaPoint& p : restitutions(omega, phase)) {
    const std::optional<SettledSlice> slice = landings_->slice(phase, p.eta);
    const auto place = slice && omega >= slice->lowest_speed() ? std::optional(slice->at(omega)) : std::nullopt;
    const auto next = [&](double mu) {
      return arrival(phase, place ? place->land(mu) : land(phase, omega, {p.eta, mu}));
    };
    if (friction.constant()) {
      const double landing = next(friction.mean());
      if (landing == rests)
        rest += p.weight;
      else
        points.emplace_back(landing, p.weight);
      continue;
    }
    rest += p.weight * friction.cdf(p.resting_friction);
    if (p.resting_friction == std::numeric_limits<double>::infinity()) continue;
    const double low =
        std::max({p.resting_friction, friction.lower(), friction.mean() - farthest_contact * friction.sd()});
    const double high = std::min(sticks, friction.mean() + farthest_contact * friction.sd());
    if (p.resting_friction < sticks && low < high) {
      const double from = next(std::nextafter(low, high));
      const std::vector<double> cuts =
          cuts_of_sliding(low, high, next, from, breaks, place ? place->edges() : std::span<const double>{});
      for (std::size_t c = 0; c + 1 < cuts.size(); ++c)
        over_panels(cuts[c], cuts[c + 1], mu_panel * friction.sd(), [&](double mu, double weight) {
          points.emplace_back(std::max(from, next(mu)), p.weight * weight * friction.density(mu));
        });
    }
    const double stuck = friction.complement(std::max(sticks, p.resting_friction));
    if (stuck > 0)
      points.emplace_back(std::max(state_interval(phase + 1).first, next(std::max(sticks, p.resting_friction))),
                          p.weight * stuck);
  }
  return std::min(1.0, rest);
}

std::vector<double> SettledReturnMap::states_of_extremes(int phase, std::span<const double> next) const {
  const bool listed = noise().is_empirical();
  std::vector<Contact> contacts(noise().pairs().begin(), noise().pairs().end());
  if (!listed) {
    const double sticks = landings_->sticking_friction(phase);
    const TruncatedNormal &restitution = noise().restitution(), &friction = noise().friction();
    const double mu = friction.constant() ? std::min(sticks, friction.mean()) : sticks;
    for (const double z : {-4.0, -2.0, 0.0, 2.0, 4.0}) {
      const double eta = restitution.mean() + z * restitution.sd();
      if (eta < restitution.lower() || eta > restitution.upper() || (z != 0 && restitution.constant())) continue;
      contacts.push_back({eta, mu});
    }
  }
  std::vector<double> found;
  const double low = state_interval(phase).first, high = highest_state_;
  for (const double landing : next)
    for (const Contact& c : contacts) {
      const auto short_of = [&](double state) { return next_state(phase, std::sqrt(state), c) < landing; };
      if (!(short_of(low) && !short_of(high))) continue;
      double a = low, b = high;
      for (int k = 0; k < 60; ++k) (short_of(0.5 * (a + b)) ? a : b) = 0.5 * (a + b);
      found.push_back(0.5 * (a + b));
    }
  std::sort(found.begin(), found.end());
  return found;
}

std::pair<double, double> SettledReturnMap::landing_range(double state, int phase) const {
  const double omega = std::sqrt(state);
  const ContactNoise::Support support = noise().support();
  double least = std::numeric_limits<double>::infinity(), most = -std::numeric_limits<double>::infinity();
  const auto look = [&](const Contact& c) {
    const double next = next_state(phase, omega, c);
    least = std::min(least, next);
    most = std::max(most, next);
  };
  for (const Contact& c : noise().pairs()) look(c);
  if (noise().is_empirical()) return {least, most};
  constexpr int parts = 8;
  const double sticks = landings_->sticking_friction(phase);
  for (int i = 0; i <= parts; ++i) {
    const double eta = support.restitution_lower + (support.restitution_upper - support.restitution_lower) * i / parts;
    look({eta, std::min(support.friction_lower, sticks)});
    look({eta, std::min(support.friction_upper, sticks)});
  }
  return {least, most};
}

// Finds the slide of the foot, at the speed that a sticking wheel keeps.
double SettledReturnMap::mean_slide(int phase) const {
  const bool listed = noise().is_empirical();
  double state = 0.5 * (state_interval(phase).first + highest_state_);
  const double usual = listed ? noise().pairs()[0].restitution : noise().restitution().truncated_mean();
  // Landings that are followed cost more, and halve what is left of the start at every step.
  const int revolutions = landings_->direct() ? std::max(1, 24 / phases()) : 50;
  for (int k = 0; k < revolutions * phases(); ++k) {
    const int p = (phase + k) % phases();
    const double next = next_state(p, std::sqrt(state), {usual, landings_->sticking_friction(p)});
    if (next == rests) return 0;
    state = next;
  }
  const double omega = std::sqrt(state);
  double sum = 0, total = 0;
  const auto add = [&](const Contact& c, double weight) {
    const MappedLanding landed = land(phase, omega, c);
    if (landed.rest) return;
    sum += weight * landed.displacement;
    total += weight;
  };
  for (const Contact& c : noise().pairs()) add(c, 1);
  if (!listed) {
    constexpr int draws = 64;
    for (int k = 0; k < draws; ++k) add({usual, noise().friction().at_score(normal_quantile((k + 0.5) / draws))}, 1);
  }
  return total > 0 ? sum / total : 0;
}

std::optional<double> SettledReturnMap::landing_defect(double state, int phase, std::span<const double> score,
                                                       const std::function<double(double)>& f) const {
  if (landings_->direct()) return std::nullopt;
  const double omega = std::sqrt(state);
  const Contact contact = noise().draw(score);
  const auto of = [&](const MappedLanding& landed) { return landed.rest ? 0 : f(arrival(phase, landed)); };
  const auto difference = [&] {
    tell();
    return of(landings_->follow(phase, omega, contact)) - of(land(phase, omega, contact));
  };
  if (noise().is_empirical() || noise().correlation() != 0 || noise().friction().constant()) return difference();
  // Between the two thresholds of rest the landing is known; few draws meet that.
  const TruncatedNormal& friction = noise().friction();
  const double read = resting_friction(phase, omega, contact.restitution);
  // Where hardly any friction lets the wheel pass, the threshold is not worth finding: feet chatter for long there.
  constexpr double reach = 0.05, negligible = 1e-9;
  if (friction.complement(read - reach) * f(state_interval(phase + 1).first) < negligible) return difference();
  const double followed =
      landings_->followed_resting_friction(phase, omega, contact.restitution, read, [this] { tell(); });
  const auto [low, high] = std::minmax(read, followed);
  if (!std::isfinite(high)) return difference();
  const double between = (friction.cdf(read) - friction.cdf(followed)) * f(state_interval(phase + 1).first);
  return contact.friction >= low && contact.friction < high ? between : between + difference();
}

double SettledReturnMap::worth(int phase, const Landing& landing, const std::function<double(double)>& f) const {
  if (landing.end == LandingEnd::rest || landing.end == LandingEnd::given_up) return 0;
  return f(arrival(phase, {landing.carried_squared, landing.displacement, false}));
}

// Returns mu_r of the landing that a rolling wheel is about to make.
double SettledReturnMap::resting_friction(const SettledRoll& roll, double restitution, double guess) const {
  const auto rests_at = [&](double mu) {
    tell();
    SettledRoll one = roll;
    one.set_contact({restitution, mu});
    const LandingEnd end = one.land().end;
    return end == LandingEnd::rest || end == LandingEnd::given_up;
  };
  constexpr double first_step = 1e-4, widest = 2, width = 1e-6;
  double step = first_step, low = guess, high = guess;
  if (rests_at(guess)) {
    do {
      if (high > widest) return std::numeric_limits<double>::infinity();
      low = high, high += step, step *= 3;
    } while (rests_at(high));
  } else {
    do {
      if (low <= 0) return 0;
      high = low, low = std::max(0.0, low - step), step *= 3;
    } while (!rests_at(low));
  }
  while (high - low > width) {
    const double middle = 0.5 * (low + high);
    (rests_at(middle) ? low : high) = middle;
  }
  return high;
}

std::optional<double> SettledReturnMap::memory_defect(double state, int phase, std::span<const double> score,
                                                      const std::function<double(double)>& f) const {
  const std::size_t dimension = score.size() / 2;
  const Contact contact = noise().draw(score.first(dimension)), second = noise().draw(score.subspan(dimension));
  const SettledMotion& motion = landings_->motion();
  SettledRoll roll(motion, phase, std::sqrt(state), contact, contact);
  const Step step = roll.step();
  if (!step.touched || (step.landing.end == LandingEnd::settled && !step.landing.slips_late)) return 0;
  const int next = (phase + 1) % phases();
  const double omega = std::sqrt(arrival(phase, {step.landing.carried_squared, 0, false}));
  SettledRoll on = roll;
  on.set_contact(second);
  const double moving = worth(next, on.land(), f), standing = worth(next, motion.land(next, omega, second), f);
  if (noise().is_empirical() || noise().correlation() != 0 || noise().friction().constant()) return moving - standing;
  const double stands = landings_->followed_resting_friction(
      next, omega, second.restitution, resting_friction(next, omega, second.restitution), [this] { tell(); });
  const double moves = resting_friction(roll, second.restitution, std::min(stands, landings_->sticking_friction(next)));
  const TruncatedNormal& friction = noise().friction();
  const auto resting = [&](double mu) { return std::isfinite(mu) ? friction.cdf(mu) : 1.0; };
  const double between = (resting(stands) - resting(moves)) * f(state_interval(next + 1).first);
  return between + (moving > 0 && standing > 0 ? moving - standing : 0);
}

std::vector<std::string> SettledReturnMap::assumptions() const { return {"foot lifts", "foot unsettled"}; }

bool SettledReturnMap::violates(int which, double state, int phase, std::span<const double> score) const {
  const double omega = std::sqrt(state);
  if (which == 0) return omega > lift_speed(geometry_, phase);
  const Contact contact = noise().draw(score);
  const std::optional<SettledSlice> slice = landings_->slice(phase, contact.restitution);
  if (slice) {
    if (omega < slice->lowest_speed()) return false;  // at rest, as below mu_r
    const SettledSlice::SliceAtSpeed place = slice->at(omega);
    if (contact.friction < place.resting_friction() || !place.rough(contact.friction)) return false;
  }
  tell();
  return landings_->motion().land(phase, omega, contact).end == LandingEnd::unsettled;
}

void SettledReturnMap::Table::add(const Contact& draw) {
  const std::optional<SettledSlice> slice = map_->landings_->slice(phase_, draw.restitution);
  // Launches may be slower than any survivor, but below the table's first speed even a sticking foot rests, or nearly.
  double low = slowest_launch * map_->state_interval(phase_).first, high = map_->highest_state_;
  if (slice) {
    low = slice->lowest_speed() * slice->lowest_speed();
    const double slowest = slice->slowest(draw.friction, std::sqrt(low), std::sqrt(high));
    low = slowest < std::sqrt(high) ? std::max(low, slowest * slowest) : std::numeric_limits<double>::infinity();
  } else {
    const auto survives = [&](double state) { return map_->next_state(phase_, std::sqrt(state), draw) != rests; };
    if (!survives(high)) {
      low = std::numeric_limits<double>::infinity();
    } else if (!survives(low)) {
      for (int k = 0; k < 34; ++k) (survives(0.5 * (low + high)) ? high : low) = 0.5 * (low + high);
      low = high;
    }
  }
  lowest_.push_back(low);
  contact_.push_back(draw);
  const double high_state = map_->highest_state_;
  kept_.push_back(slice ? slice->at(std::sqrt(high_state)).land(draw.friction).carried_squared / high_state : -1);
  const double lowest_next = map_->state_interval(phase_ + 1).first;
  for (std::size_t j = 0; j < curve_nodes; ++j) {
    const double t = static_cast<double>(j) / (curve_nodes - 1);
    double next = lowest_next;
    if (low < std::numeric_limits<double>::infinity()) {
      const double omega = std::sqrt(low + (map_->highest_state_ - low) * t * t);
      const MappedLanding landed = slice ? slice->at(std::max(omega, slice->lowest_speed())).land(draw.friction)
                                         : map_->land(phase_, omega, draw);
      if (!landed.rest) next = map_->arrival(phase_, landed);
    }
    curve_.push_back(static_cast<float>(next));
  }
}

void SettledReturnMap::Table::land(double origin, double width, std::span<const double> offset, std::size_t first,
                                   std::span<double> next) const {
  const double lowest_next = map_->state_interval(phase_ + 1).first;
  for (std::size_t k = 0; k < next.size(); ++k) {
    const double state = origin + width * offset[k], low = lowest_[first + k];
    if (state < low) {
      next[k] = rests;
      continue;
    }
    if (state > map_->highest_state_) {
      const double kept = kept_[first + k];
      next[k] = kept < 0 ? map_->next_state(phase_, std::sqrt(state), contact_[first + k])
                         : map_->arrival(phase_, {kept * state, 0, false});
      continue;
    }
    const double t = std::sqrt((state - low) / (map_->highest_state_ - low)) * (curve_nodes - 1);
    const auto at = std::clamp<std::size_t>(static_cast<std::size_t>(t), 1, curve_nodes - 3);
    const float* y = &curve_[(first + k) * curve_nodes + at - 1];
    // This reads through four neighbouring nodes.
    const double u = t - static_cast<double>(at), a = u + 1, c = u - 1, d = u - 2;
    const double value = -u * c * d / 6 * y[0] + a * c * d / 2 * y[1] - a * u * d / 2 * y[2] + a * u * c / 6 * y[3];
    next[k] = std::max(value, lowest_next);
  }
}

void SettledReturnMap::Table::reorder(std::span<const std::uint32_t> order) {
  std::vector<double> lowest, kept;
  std::vector<Contact> contact;
  std::vector<float> curve;
  for (const std::uint32_t k : order) {
    lowest.push_back(lowest_[k]);
    kept.push_back(kept_[k]);
    contact.push_back(contact_[k]);
    curve.insert(curve.end(), curve_.begin() + static_cast<std::ptrdiff_t>(k * curve_nodes),
                 curve_.begin() + static_cast<std::ptrdiff_t>((k + 1) * curve_nodes));
  }
  lowest_ = std::move(lowest);
  kept_ = std::move(kept);
  contact_ = std::move(contact);
  curve_ = std::move(curve);
}

SettledReturnMap::Table SettledReturnMap::tabulate(int phase, std::span<const double> score) const {
  const auto dimension = static_cast<std::size_t>(noise_dimension());
  Table table(*this, phase);
  for (std::size_t i = 0; i < score.size(); i += dimension) table.add(noise().draw(score.subspan(i, dimension)));
  return table;
}

}  // namespace metastable::dynamics
