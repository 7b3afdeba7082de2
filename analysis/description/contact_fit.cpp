#include "analysis/description/contact_fit.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "analysis/description/landings.h"
#include "analysis/statistics/estimate.h"
#include "analysis/statistics/minimize.h"
#include "analysis/statistics/profile_interval.h"
#include "dynamics/return_map/landing_density.h"
#include "markov/dense_matrix.h"
#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

constexpr double least_sd = 0.01;          // finer spreads are below the likelihood's grid
constexpr std::size_t thinned_size = 300;  // transitions behind the choice of a start

std::vector<dynamics::WheelMap> maps_of(const Experiment& experiment, dynamics::Law law,
                                        const ContactParameters& parameters) {
  const auto noise = dynamics::ContactNoise::normal(parameters[0], parameters[1], parameters[2], parameters[3]);
  std::vector<dynamics::WheelMap> maps;
  for (const Condition& condition : experiment.conditions)
    maps.emplace_back(fitted_wheel(experiment), condition.slope_deg * std::numbers::pi / 180, law, noise);
  return maps;
}

constexpr ContactParameters wide = {0.4, 0.2, 0.4, 0.2};  // of maps whose noise does not matter

std::vector<MeasuredLanding> collect(const Experiment& experiment, const std::vector<std::size_t>& conditions,
                                     const ContactFitOptions& options, const std::vector<dynamics::WheelMap>& maps) {
  if (experiment.system != System::rimless_wheel)
    throw std::invalid_argument("contact fit: a coast-down has neither restitution nor friction");
  for (const std::size_t condition : conditions)
    if (condition >= experiment.conditions.size())
      throw std::invalid_argument(
          fmt::format("contact fit: condition {} of {}", condition, experiment.conditions.size()));
  if (options.transition == Transition::collision && experiment.columns.omega_plus == Presence::none)
    throw std::invalid_argument("contact fit: collisions.csv has no omega_plus_rad_s to fit collisions to");
  std::vector<MeasuredLanding> all = options.transition == Transition::step
                                         ? step_landings(experiment, conditions, maps)
                                         : collision_landings(experiment, conditions, maps);
  std::erase_if(all, [](const MeasuredLanding& t) { return !(t.state > 0); });
  if (all.empty()) throw std::invalid_argument("contact fit: no transition to fit");
  return all;
}

// Turns parameters into the variables behind them. An sd is sqrt(least_sd^2 + s^2): where the data show no spread, s =
// 0 is a minimum like any other.
using Point = std::vector<double>;
Point to_point(const ContactParameters& p) {
  const auto s = [](double sd) { return std::sqrt(std::max(sd * sd - least_sd * least_sd, 0.0)); };
  return {p[0], s(p[1]), p[2], s(p[3])};
}
double to_sd(double s) { return std::hypot(least_sd, s); }
ContactParameters to_parameters(const Point& x) { return {x[0], to_sd(x[1]), x[2], to_sd(x[3])}; }

// Variables stay in these ranges. Means of mu end where the likelihood's grid is too coarse for a small spread.
constexpr ContactParameters lowest = {-0.5, 0, -0.5, 0}, highest = {1.5, 1, 0.85, 1};

// Returns minus the log-likelihood and its gradient; infinite beyond the ranges (an sd's variable may change its sign).
double cost(const ContactLikelihood& likelihood, const Point& x, Point& gradient) {
  for (std::size_t i = 0; i < 4; ++i) {
    const double value = i % 2 == 0 ? x[i] : std::abs(x[i]);
    if (!(value >= lowest[i] && value <= highest[i])) return infinite;
  }
  const ContactParameters p = to_parameters(x);
  constexpr double most = 30;  // sds between a mean and its range: beyond, the truncation leaves nothing
  if (p[0] < -most * p[1] || p[0] > 1 + most * p[1] || p[2] < -most * p[3]) return infinite;
  ContactParameters slope;
  const double value = likelihood(p, &slope);
  for (std::size_t i = 0; i < 4; ++i) gradient[i] = -slope[i] * (i % 2 == 0 ? 1 : x[i] / p[i]);
  return -value;
}

// Returns second derivatives, by central differences of the gradient.
Eigen::MatrixXd curvature(const SmoothFunction& function, const Minimum& minimum) {
  const std::size_t n = minimum.at.size();
  constexpr double step = 2e-4;
  Eigen::MatrixXd hessian(n, n);
  for (std::size_t a = 0; a < n; ++a) {
    Point above = minimum.at, below = minimum.at, up(n), down(n);
    above[a] += step;
    below[a] -= step;
    const bool inside = std::isfinite(function(above, up)) && std::isfinite(function(below, down));
    for (std::size_t b = 0; b < n; ++b)
      hessian(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b)) =
          inside ? (up[b] - down[b]) / (2 * step) : infinite;
  }
  return (hessian + hessian.transpose()) / 2;
}

// Descends from a point, in variables that the curvature there makes alike.
Minimum descend(const SmoothFunction& function, const Minimum& from) {
  const Eigen::MatrixXd hessian = curvature(function, from);
  const auto n = static_cast<Eigen::Index>(from.at.size());
  const Eigen::MatrixXd axes =
      hessian.allFinite() ? contour_axes(hessian) : Eigen::MatrixXd(0.01 * Eigen::MatrixXd::Identity(n, n));
  const auto point = [&](const Point& z) {
    const Eigen::VectorXd x =
        Eigen::Map<const Eigen::VectorXd>(from.at.data(), n) + axes * Eigen::Map<const Eigen::VectorXd>(z.data(), n);
    return Point(x.data(), x.data() + n);
  };
  const auto along_axes = [&](const Point& z, Point& gradient) {
    Point slope(z.size());
    const double value = function(point(z), slope);
    Eigen::Map<Eigen::VectorXd>(gradient.data(), n) =
        axes.transpose() * Eigen::Map<const Eigen::VectorXd>(slope.data(), n);
    return value;
  };
  Minimum minimum = quasi_newton(along_axes, Point(from.at.size(), off_the_guess), 1e-5, 300);
  minimum.at = point(minimum.at);
  for (const std::size_t sd : {1, 3}) minimum.at[sd] = std::abs(minimum.at[sd]);
  return minimum;
}

// A long narrow ridge (see ambiguities) stops descents early: they start anew until that gains nothing.
Minimum settle(const SmoothFunction& function, Minimum minimum) {
  for (int restart = 0; restart < 8; ++restart) {
    Minimum again = descend(function, minimum);
    const double gain = minimum.value - again.value;
    if (gain > 0) minimum = std::move(again);
    if (gain < 1e-3) break;
  }
  return minimum;
}

bool same(const Point& a, const Point& b, double within) {
  for (std::size_t i = 0; i < a.size(); ++i)
    if (std::abs(a[i] - b[i]) > within) return false;
  return true;
}

// Says where descents from a grid of starts and from the nominal contact end on every few-th transition, the best
// first.
std::vector<Point> best_starts(const SmoothFunction& function, const Experiment& experiment, dynamics::Law law) {
  constexpr std::size_t most = 4;
  constexpr double near = 4;  // of the best; the others' intervals would not count
  std::vector<Minimum> minima;
  Point unused(4);
  const auto add = [&](const ContactParameters& parameters) {
    const Point x = to_point(parameters);
    const double value = function(x, unused);
    if (std::isfinite(value)) minima.push_back(descend(function, {x, value}));
  };
  for (const double restitution : {0.2, 0.4, 0.6, 0.8})
    for (const double friction : {0.1, 0.25, 0.4, 0.6}) add({restitution, 0.1, friction, 0.1});
  const NominalContact& nominal = experiment.contact;
  if (nominal.law == law)
    add({nominal.restitution.mean, std::max(nominal.restitution.sd, 0.02), nominal.friction.mean,
         std::max(nominal.friction.sd, 0.02)});
  std::stable_sort(minima.begin(), minima.end(), [](const Minimum& a, const Minimum& b) { return a.value < b.value; });
  std::vector<Point> points;
  for (const Minimum& one : minima)
    if (points.size() < most && one.value < minima.front().value + near &&
        std::none_of(points.begin(), points.end(), [&](const Point& x) { return same(x, one.at, 0.02); }))
      points.push_back(one.at);
  return points;
}

void describe_curvature(ContactFit& fit, const Eigen::MatrixXd& information, const std::vector<std::size_t>& free) {
  fit.standard_error.fill(infinite);
  if (!information.allFinite()) {
    fit.status = ContactFit::Status::undetermined;
    fit.message =
        fmt::format("the likelihood rises up to the end of the range searched ({} {} to {}, {} {} to {}, sds up to {})",
                    contact_parameter_names[0], lowest[0], highest[0], contact_parameter_names[2], lowest[2],
                    highest[2], highest[1]);
    return;
  }
  const markov::SymmetricEigen eigen = markov::symmetric_eigen(information);
  for (Eigen::Index k = information.rows() - 1; k >= 0; --k) {
    FitDirection direction;
    direction.sd = eigen.values[k] > 0 ? 1 / std::sqrt(eigen.values[k]) : infinite;
    for (std::size_t a = 0; a < free.size(); ++a)
      direction.weight[free[a]] = eigen.vectors(static_cast<Eigen::Index>(a), k);
    fit.directions.push_back(direction);
  }
  // Along such a direction one standard error is longer than the widest range searched.
  constexpr double widest = highest[0] - lowest[0];
  if (!(eigen.values[0] > 1 / (widest * widest))) {
    fit.status = ContactFit::Status::undetermined;
    fit.message = "the likelihood does not fall off in every direction: the four numbers are one choice among many";
    return;
  }
  const Eigen::MatrixXd covariance = markov::inverse_of(information);
  for (std::size_t a = 0; a < free.size(); ++a) {
    const auto i = static_cast<Eigen::Index>(a);
    fit.standard_error[free[a]] = std::sqrt(covariance(i, i));
    for (std::size_t b = 0; b < free.size(); ++b) {
      const auto j = static_cast<Eigen::Index>(b);
      fit.correlation[free[a]][free[b]] = covariance(i, j) / std::sqrt(covariance(i, i) * covariance(j, j));
    }
  }
}

// Finds the minima of the cost from the best starts.
std::vector<Mode> modes_from_starts(const SmoothFunction& function, std::vector<Point> starts) {
  std::vector<Mode> modes;
  for (Point& start : starts) {
    Point unused(4);
    const double value = function(start, unused);
    if (std::isfinite(value)) modes.push_back({settle(function, {std::move(start), value}), {}});
  }
  if (modes.empty()) throw std::runtime_error("contact fit: no start with a finite likelihood");
  return modes;
}

struct Maximum {
  Mode mode;
  std::vector<ProfileInterval> profiles = std::vector<ProfileInterval>(4);
  bool settled = false;  ///< no profile finds a higher likelihood
};

// Picks the best of the modes and its profiles. A profile that finds a higher likelihood on its way starts the search
// anew from there.
Maximum best_of(const SmoothFunction& function, std::vector<Mode> modes, bool intervals) {
  Maximum result;
  for (int restart = 0; restart < 8 && !result.settled; ++restart) {
    std::stable_sort(modes.begin(), modes.end(),
                     [](const Mode& a, const Mode& b) { return a.minimum.value < b.minimum.value; });
    // Starts that came down to the same place are one mode.
    for (std::size_t m = 1; m < modes.size();)
      if (same(modes[m].minimum.at, modes[m - 1].minimum.at, 0.005))
        modes.erase(modes.begin() + static_cast<std::ptrdiff_t>(m));
      else
        ++m;
    for (Mode& mode : modes) mode.hessian = curvature(function, mode.minimum);
    result.settled = true;
    if (!intervals || !modes.front().hessian.allFinite()) break;
    std::vector<Mode> inside;
    for (const Mode& mode : modes)
      if (mode.hessian.allFinite()) inside.push_back(mode);
    result.profiles =
        profile_intervals(function, inside, {lowest.begin(), lowest.end()}, {highest.begin(), highest.end()});
    for (const ProfileInterval& profile : result.profiles)
      if (profile.better) {
        modes.push_back({settle(function, *profile.better), {}});
        result.settled = false;
      }
  }
  result.mode = modes.front();
  return result;
}

// Finds standard errors, directions and correlations from the curvature. A spread that the data do not show is at its
// least value; the others then have their standard errors given that. Returns the names of such spreads.
std::string describe_errors(ContactFit& fit, const Mode& mode) {
  std::vector<std::size_t> free;
  std::vector<std::string_view> bound;
  for (std::size_t i = 0; i < 4; ++i) {
    if (i % 2 == 0 || fit.value[i] > 1.3 * least_sd)
      free.push_back(i);
    else
      bound.push_back(contact_parameter_names[i]);
  }
  const auto size = static_cast<Eigen::Index>(free.size());
  Eigen::MatrixXd information(size, size);
  const auto slope = [&](std::size_t i) {
    return i % 2 == 0 ? 1 : fit.value[i] / mode.minimum.at[i];
  };  // of the variable
  for (Eigen::Index a = 0; a < size; ++a)
    for (Eigen::Index b = 0; b < size; ++b) {
      const std::size_t i = free[static_cast<std::size_t>(a)], j = free[static_cast<std::size_t>(b)];
      information(a, b) =
          slope(i) * slope(j) * mode.hessian(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
    }
  describe_curvature(fit, information, free);
  return fmt::format("{}", fmt::join(bound, " and "));
}

// Fills in the profile intervals, unbounded where they are not known.
void describe_intervals(ContactFit& fit, const Maximum& best, bool intervals) {
  const bool known = intervals && best.settled && best.mode.hessian.allFinite();
  for (std::size_t i = 0; i < 4; ++i) {
    const bool sd = i % 2 == 1;
    const ProfileInterval& profile = best.profiles[i];
    const double lower = sd ? to_sd(profile.lower) : profile.lower;
    const double upper = sd ? to_sd(profile.upper) : profile.upper;
    fit.lower_95[i] = known && profile.bounded_below ? lower : sd && intervals ? 0 : -infinite;
    fit.upper_95[i] = known && profile.bounded_above ? upper : infinite;
  }
}

}  // namespace

double contact_log_likelihood(const Experiment& experiment, const std::vector<std::size_t>& conditions,
                              const ContactFitOptions& options, const ContactParameters& parameters) {
  const std::vector<dynamics::WheelMap> maps = maps_of(experiment, options.law, parameters);
  const std::vector<MeasuredLanding> transitions = collect(experiment, conditions, options, maps);
  std::vector<double> terms(transitions.size());
  markov::parallel_for(transitions.size(), options.threads, [&](std::size_t i) {
    const MeasuredLanding& t = transitions[i];
    const dynamics::WheelMap& map = maps[t.condition];
    if (t.landing) {
      terms[i] = std::log(dynamics::LandingDensity(map, t.state, t.phase)(*t.landing));
    } else {
      const double rest = *map.rest_probability(t.state, t.phase);
      terms[i] = t.rested ? std::log(rest) : std::log1p(-rest);
    }
  });
  double sum = 0;
  for (const double term : terms) sum += term;
  return sum;
}

Transition best_transition(const Experiment& experiment) {
  if (experiment.columns.omega_plus != Presence::all) return Transition::step;
  const std::vector<dynamics::WheelMap> maps = maps_of(experiment, experiment.contact.law, wide);
  for (const MeasuredTrial& trial : experiment.trials)
    for (std::size_t k = 0; k + 1 < trial.collisions.size(); ++k) {
      const MeasuredCollision& c = trial.collisions[k];
      const dynamics::WheelMap& map = maps[trial.condition];
      const int phase = map.phases() == 1 ? 0 : *c.leg % map.phases();
      if (*c.omega_plus * *c.omega_plus < map.stance(phase).barrier) return Transition::step;
    }
  return Transition::collision;
}

bool has_contact_fit(dynamics::Law law) { return law == dynamics::Law::published || law == dynamics::Law::coulomb; }

ContactFit fit_contact(const Experiment& experiment, const std::vector<std::size_t>& conditions,
                       const ContactFitOptions& options) {
  ContactFit fit;
  if (!has_contact_fit(options.law)) {
    fit.status = ContactFit::Status::no_parameters;
    fit.message = options.law == dynamics::Law::plastic ? "plastic has neither restitution nor friction"
                                                        : "restitution and friction of settled are not fitted";
    return fit;
  }
  const std::vector<dynamics::WheelMap> maps = maps_of(experiment, options.law, wide);
  const std::vector<MeasuredLanding> all = collect(experiment, conditions, options, maps);
  const ContactLikelihood likelihood(maps, all, options.threads);
  fit.transitions = likelihood.possible();
  fit.rests = likelihood.possible_rests();
  fit.impossible = likelihood.impossible();
  if (fit.impossible > fit.transitions) {
    fit.status = ContactFit::Status::impossible;
    fit.message = fmt::format("{} of {} transitions are outside what {} can do at any eta and mu: nothing is fitted",
                              fit.impossible, fit.impossible + fit.transitions, dynamics::law_name(options.law));
    return fit;
  }
  const auto costs = [&](const ContactLikelihood& of) {
    return [&of, &options](const Point& x, Point& gradient) {
      if (options.progress) options.progress();
      return cost(of, x, gradient);
    };
  };
  std::vector<MeasuredLanding> thinned;
  for (std::size_t i = 0; i < all.size(); i += std::max<std::size_t>(1, all.size() / thinned_size))
    thinned.push_back(all[i]);
  const ContactLikelihood of_thinned(maps, thinned, options.threads);
  const SmoothFunction function = costs(likelihood);
  const Maximum best =
      best_of(function, modes_from_starts(function, best_starts(costs(of_thinned), experiment, options.law)),
              options.intervals);
  fit.value = to_parameters(best.mode.minimum.at);
  fit.log_likelihood = -best.mode.minimum.value;
  const std::string bound = describe_errors(fit, best.mode);
  describe_intervals(fit, best, options.intervals);
  if (fit.status == ContactFit::Status::converged && !bound.empty())
    fit.message = fmt::format("{} is at {}, the least value: likeliest is no such spread at all", bound, least_sd);
  if (fit.status == ContactFit::Status::converged && !best.settled && fit.message.empty())
    fit.message = "the search for the maximum did not converge: the likelihood is nearly flat along its ridge";
  if (fit.impossible > 0)
    fit.message += fmt::format("{}{} transitions are outside what {} can do and are left out",
                               fit.message.empty() ? "" : "; ", fit.impossible, dynamics::law_name(options.law));
  return fit;
}

std::vector<std::string> ambiguities(const ContactFit& fit) {
  std::vector<std::string> sentences;
  if (fit.directions.empty()) return sentences;
  const auto combination = [](const FitDirection& d) {
    std::string text;
    for (std::size_t i = 0; i < 4; ++i)
      if (std::abs(d.weight[i]) > 0.15)
        text += fmt::format("{}{:.2f} {}",
                            text.empty()      ? (d.weight[i] < 0 ? "-" : "")
                            : d.weight[i] < 0 ? " - "
                                              : " + ",
                            std::abs(d.weight[i]), contact_parameter_names[i]);
    return text;
  };
  const FitDirection& weakest = fit.directions.back();
  if (std::isinf(weakest.sd))
    sentences.push_back(fmt::format("These data say nothing about {}.", combination(weakest)));
  else
    sentences.push_back(
        fmt::format("These data fix best the sum {} (standard error {:.2g}), and worst the sum {} ({:.2g}).",
                    combination(fit.directions.front()), fit.directions.front().sd, combination(weakest), weakest.sd));
  if (fit.status != ContactFit::Status::converged) return sentences;
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t j = 0; j < i; ++j)
      if (std::abs(fit.correlation[i][j]) > 0.9)
        sentences.push_back(fmt::format("{} and {} can hardly be told apart: correlation {:.2f}.",
                                        contact_parameter_names[j], contact_parameter_names[i], fit.correlation[i][j]));
  for (const std::size_t i : {std::size_t{1}, std::size_t{3}})
    if (fit.lower_95[i] == 0) sentences.push_back(fmt::format("{} is not told from 0.", contact_parameter_names[i]));
  return sentences;
}

}  // namespace metastable::analysis
