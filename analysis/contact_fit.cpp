#include "analysis/contact_fit.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

#include "analysis/minimize.h"
#include "analysis/transitions.h"
#include "dynamics/landing_density.h"
#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double least_sd = 0.005;         // finer spreads are below the likelihood's grid
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

std::vector<MeasuredTransition> collect(const Experiment& experiment, const std::vector<std::size_t>& conditions,
                                        const ContactFitOptions& options, const std::vector<dynamics::WheelMap>& maps) {
  if (experiment.system != System::rimless_wheel)
    throw std::invalid_argument("contact fit: a coast-down has neither restitution nor friction");
  for (const std::size_t condition : conditions)
    if (condition >= experiment.conditions.size())
      throw std::invalid_argument(
          fmt::format("contact fit: condition {} of {}", condition, experiment.conditions.size()));
  if (options.transition == Transition::collision && experiment.columns.omega_plus == Presence::none)
    throw std::invalid_argument("contact fit: collisions.csv has no omega_plus_rad_s to fit collisions to");
  std::vector<MeasuredTransition> all = options.transition == Transition::step
                                            ? step_transitions(experiment, conditions, maps)
                                            : collision_transitions(experiment, conditions, maps);
  std::erase_if(all, [](const MeasuredTransition& t) { return !(t.state > 0); });
  if (all.empty()) throw std::invalid_argument("contact fit: no transition to fit");
  return all;
}

// The unbounded variables behind the parameters: sds by their logarithm.
using Point = std::vector<double>;
Point to_point(const ContactParameters& p) { return {p[0], std::log(p[1]), p[2], std::log(p[3])}; }
ContactParameters to_parameters(const Point& x) { return {x[0], std::exp(x[1]), x[2], std::exp(x[3])}; }

// Minus the log-likelihood; infinite where parameters make no sense or are finer than the likelihood's grid.
double cost(const ContactLikelihood& likelihood, const Point& x) {
  const ContactParameters p = to_parameters(x);
  const bool inside =
      p[0] > -0.5 && p[0] < 1.5 && p[2] > -0.5 && p[2] < 2 && p[1] > 0.005 && p[1] < 1 && p[3] > 0.005 && p[3] < 1;
  return inside ? -likelihood(p) : infinity;
}

using Cost = std::function<double(const Point&)>;

// The best of a grid of starts and of the nominal contact, improved on every few-th transition.
Point best_start(const Cost& function, const Experiment& experiment, dynamics::Law law) {
  std::vector<std::pair<double, Point>> starts;
  const auto add = [&](const ContactParameters& parameters) {
    const Point x = to_point(parameters);
    const double value = function(x);
    if (std::isfinite(value)) starts.emplace_back(value, x);
  };
  for (const double restitution : {0.2, 0.4, 0.6, 0.8})
    for (const double friction : {0.1, 0.25, 0.4, 0.6}) add({restitution, 0.1, friction, 0.1});
  const NominalContact& nominal = experiment.contact;
  if (nominal.law == law)
    add({nominal.restitution.mean, std::max(nominal.restitution.sd, 0.02), nominal.friction.mean,
         std::max(nominal.friction.sd, 0.02)});
  if (starts.empty()) throw std::runtime_error("contact fit: no start with a finite likelihood");
  std::stable_sort(starts.begin(), starts.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  Minimum best;
  best.value = infinity;
  for (std::size_t s = 0; s < std::min<std::size_t>(3, starts.size()); ++s) {
    Minimum one = nelder_mead(function, starts[s].second, {0.05, 0.3, 0.05, 0.3}, 0.05, 150);
    if (one.value < best.value) best = std::move(one);
  }
  return best.at;
}

// Second derivatives in the free variables by central differences, at steps that change the cost by about a unit where
// that is possible.
Eigen::MatrixXd curvature(const Cost& function, const Point& x, double value, const std::vector<std::size_t>& free) {
  const auto n = static_cast<Eigen::Index>(free.size());
  std::vector<double> step(free.size());
  const auto at = [&](std::size_t a, double da, std::size_t b, double db) {
    Point y = x;
    y[free[a]] += da;
    y[free[b]] += db;
    return function(y);
  };
  Eigen::MatrixXd hessian(n, n);
  for (std::size_t a = 0; a < free.size(); ++a) {
    step[a] = free[a] % 2 == 0 ? 0.004 : 0.04;
    double rise = 0;
    for (int halving = 0; halving < 6; ++halving) {
      rise = at(a, step[a], a, 0) + at(a, -step[a], a, 0) - 2 * value;
      if (rise < 4) break;
      step[a] /= 2;
    }
    const auto e = static_cast<Eigen::Index>(a);
    hessian(e, e) = rise / (step[a] * step[a]);
  }
  for (std::size_t a = 0; a < free.size(); ++a)
    for (std::size_t b = 0; b < a; ++b) {
      const double mixed = (at(a, step[a], b, step[b]) - at(a, step[a], b, -step[b]) - at(a, -step[a], b, step[b]) +
                            at(a, -step[a], b, -step[b])) /
                           (4 * step[a] * step[b]);
      const auto i = static_cast<Eigen::Index>(a), j = static_cast<Eigen::Index>(b);
      hessian(i, j) = hessian(j, i) = mixed;
    }
  return hessian;
}

void describe_curvature(ContactFit& fit, const Eigen::MatrixXd& information, const std::vector<std::size_t>& free) {
  fit.standard_error.fill(infinity);
  if (!information.allFinite()) {
    fit.status = ContactFit::Status::undetermined;
    fit.message =
        "the likelihood rises up to the edge of what eta and mu can be distributed as: no law of this form fits";
    return;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(information);
  for (Eigen::Index k = information.rows() - 1; k >= 0; --k) {
    FitDirection direction;
    direction.sd = eigen.eigenvalues()[k] > 0 ? 1 / std::sqrt(eigen.eigenvalues()[k]) : infinity;
    for (std::size_t a = 0; a < free.size(); ++a)
      direction.weight[free[a]] = eigen.eigenvectors()(static_cast<Eigen::Index>(a), k);
    fit.directions.push_back(direction);
  }
  if (!(eigen.eigenvalues()[0] > 0)) {
    fit.status = ContactFit::Status::undetermined;
    fit.message = "the likelihood does not fall off in every direction: the four numbers are one choice among many";
    return;
  }
  const Eigen::MatrixXd covariance = information.inverse();
  for (std::size_t a = 0; a < free.size(); ++a) {
    const auto i = static_cast<Eigen::Index>(a);
    fit.standard_error[free[a]] = std::sqrt(covariance(i, i));
    for (std::size_t b = 0; b < free.size(); ++b) {
      const auto j = static_cast<Eigen::Index>(b);
      fit.correlation[free[a]][free[b]] = covariance(i, j) / std::sqrt(covariance(i, i) * covariance(j, j));
    }
  }
}

}  // namespace

double contact_log_likelihood(const Experiment& experiment, const std::vector<std::size_t>& conditions,
                              const ContactFitOptions& options, const ContactParameters& parameters) {
  const std::vector<dynamics::WheelMap> maps = maps_of(experiment, options.law, parameters);
  const std::vector<MeasuredTransition> transitions = collect(experiment, conditions, options, maps);
  std::vector<double> terms(transitions.size());
  markov::parallel_for(transitions.size(), options.threads, [&](std::size_t i) {
    const MeasuredTransition& t = transitions[i];
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

ContactFit fit_contact(const Experiment& experiment, const std::vector<std::size_t>& conditions,
                       const ContactFitOptions& options) {
  ContactFit fit;
  if (options.law == dynamics::Law::plastic) {
    fit.status = ContactFit::Status::no_parameters;
    fit.message = "plastic has neither restitution nor friction";
    return fit;
  }
  const std::vector<dynamics::WheelMap> maps = maps_of(experiment, options.law, wide);
  const std::vector<MeasuredTransition> all = collect(experiment, conditions, options, maps);
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
    return [&of, &options](const Point& x) {
      if (options.progress) options.progress();
      return cost(of, x);
    };
  };
  std::vector<MeasuredTransition> thinned;
  for (std::size_t i = 0; i < all.size(); i += std::max<std::size_t>(1, all.size() / thinned_size))
    thinned.push_back(all[i]);
  const ContactLikelihood of_thinned(maps, thinned, options.threads);
  const Cost function = costs(likelihood);
  // A long narrow ridge (see ambiguities) makes a simplex collapse early: started anew until that gains nothing.
  Minimum minimum =
      nelder_mead(function, best_start(costs(of_thinned), experiment, options.law), {0.01, 0.1, 0.01, 0.1}, 1e-4, 1000);
  bool settled = false;
  for (int restart = 0; restart < 8 && !settled; ++restart) {
    Minimum again = nelder_mead(function, minimum.at, {0.03, 0.2, 0.01, 0.05}, 1e-4, 1000);
    settled = minimum.value - again.value < 1e-3;
    minimum = std::move(again);
  }
  fit.value = to_parameters(minimum.at);
  fit.log_likelihood = -minimum.value;
  // A spread that the data do not show goes to its least value; the others then have their errors given that.
  std::vector<std::size_t> free;
  std::string bound;
  for (std::size_t i = 0; i < 4; ++i) {
    if (i % 2 == 0 || fit.value[i] > 1.3 * least_sd)
      free.push_back(i);
    else
      bound += fmt::format("{}{}", bound.empty() ? "" : " and ", contact_parameter_names[i]);
  }
  Eigen::VectorXd jacobian(static_cast<Eigen::Index>(free.size()));  // d point / d parameter
  for (std::size_t a = 0; a < free.size(); ++a)
    jacobian[static_cast<Eigen::Index>(a)] = free[a] % 2 == 0 ? 1 : 1 / fit.value[free[a]];
  describe_curvature(
      fit, jacobian.asDiagonal() * curvature(function, minimum.at, minimum.value, free) * jacobian.asDiagonal(), free);
  if (fit.status == ContactFit::Status::converged && !bound.empty())
    fit.message = fmt::format(
        "{} is at {}, the least value: likeliest is no such spread at all; the other errors hold given that, and are "
        "too small if there is some",
        bound, least_sd);
  if (fit.status == ContactFit::Status::converged && !settled && fit.message.empty())
    fit.message = "the search for the maximum did not settle: the likelihood is nearly flat along its ridge";
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
    sentences.push_back(fmt::format("Best known is {} (standard error {:.2g}), least known {} ({:.2g}).",
                                    combination(fit.directions.front()), fit.directions.front().sd,
                                    combination(weakest), weakest.sd));
  if (fit.status != ContactFit::Status::converged) return sentences;
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t j = 0; j < i; ++j)
      if (std::abs(fit.correlation[i][j]) > 0.9)
        sentences.push_back(fmt::format("{} and {} can hardly be told apart: correlation {:.2f}.",
                                        contact_parameter_names[j], contact_parameter_names[i], fit.correlation[i][j]));
  for (const std::size_t i : {std::size_t{1}, std::size_t{3}})
    if (std::isfinite(fit.standard_error[i]) && fit.value[i] < 1.96 * fit.standard_error[i])
      sentences.push_back(fmt::format("{} is not told from 0.", contact_parameter_names[i]));
  return sentences;
}

}  // namespace metastable::analysis
