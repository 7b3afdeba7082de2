#include "analysis/sensitivity/sensitivity.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "analysis/sensitivity/pathwise.h"
#include "analysis/statistics/interval_95.h"
#include "analysis/study/exact_rows.h"
#include "analysis/study/pilot.h"
#include "markov/parallel.h"
#include "markov/passage/adjoint.h"

namespace metastable::analysis {
namespace {

constexpr Parameter all_parameters[] = {
    Parameter::slope,        Parameter::restitution_mean,   Parameter::restitution_sd, Parameter::friction_mean,
    Parameter::friction_sd,  Parameter::leg_length,         Parameter::inertia,        Parameter::ramp_stiffness,
    Parameter::contact_mass, Parameter::radius_of_gyration, Parameter::tip_radius};

// These steps are in parts of the width over which the parameter changes what happens.
constexpr double pathwise_step = 1e-3;
constexpr double integrated_step = 2e-3;
// These are of wheel and slope under `settled`: each has a table of its own, whose error is divided by the
// step.
constexpr double table_step = 0.1, leg_table_step = 0.02;
constexpr double tip_width = 0.01;       // [m]
constexpr std::size_t table_panels = 4;  // times the coarsest nodes

double width(const Setting& setting, Parameter parameter) {
  const bool eta = parameter == Parameter::restitution_mean || parameter == Parameter::restitution_sd;
  const bool mu = parameter == Parameter::friction_mean || parameter == Parameter::friction_sd;
  if (eta && setting.restitution.sd > 0) return setting.restitution.sd;
  if (mu && setting.friction.sd > 0) return setting.friction.sd;
  if (parameter == Parameter::tip_radius) return tip_width;
  return 0.1 * parameter_value(setting, parameter);
}

Setting moved(const Setting& setting, const Sensitivity& one, double by) {
  Setting result = setting;
  if (one.leg)
    result.wheel.leg_length[static_cast<std::size_t>(*one.leg)] += by;
  else
    set_parameter(result, one.parameter, one.value + by);
  return result;
}

// Returns the end of eta's range: 1, or what `settled` takes.
double highest_restitution(const Setting& setting) { return setting.noise().restitution().upper(); }

// Lists those that can be moved to both sides: a constant at the end of its range cannot.
std::vector<Sensitivity> candidates(const Setting& setting, bool legs) {
  std::vector<Sensitivity> list;
  const auto at_end = [](const Spread& spread, double upper) {
    return spread.sd == 0 && (spread.mean <= 0 || spread.mean >= upper);
  };
  for (const Parameter parameter : all_parameters) {
    if (!matters(setting, parameter) || !(width(setting, parameter) > 0)) continue;
    if (parameter == Parameter::restitution_mean && at_end(setting.restitution, highest_restitution(setting))) continue;
    if (parameter == Parameter::friction_mean && at_end(setting.friction, INFINITY)) continue;
    list.push_back({parameter, {}, parameter_value(setting, parameter), 0, 0});
  }
  if (legs)
    for (int leg = 0; leg < setting.wheel.legs(); ++leg)
      list.push_back({Parameter::leg_length, leg, setting.wheel.leg_length[static_cast<std::size_t>(leg)], 0, 0});
  return list;
}

std::vector<Sensitivity> by_paths(const Setting& setting, const Metastability& study, const StudyOptions& options) {
  std::vector<Sensitivity> list = candidates(setting, !setting.wheel.equal_legs());
  std::vector<Neighbours> neighbours;
  for (const Sensitivity& one : list) {
    const double step = pathwise_step * width(setting, one.parameter);
    neighbours.push_back({moved(setting, one, -step), moved(setting, one, step), 2 * step});
  }
  // The draws reach as deep into the tails as the study had to go.
  const StudyOptions own = deep_enough(options, study.spectrum.failure_rate.value);
  const std::optional<Pilot> pilot = solve_pilot(setting.problem(), own);
  if (!pilot) throw markov::ConvergenceError("sensitivities", 1, "no draw came to rest");
  const markov::StateSpace coarse = pilot->graded(study.cells / 2), fine = coarse.halved();
  const auto replicates = static_cast<std::size_t>(options.replicates);
  std::vector<std::vector<double>> on_coarse(replicates), on_fine(replicates);
  markov::parallel_for(replicates, options.threads, [&](std::size_t r) {
    const markov::DrawOptions draws = draw_options(own, study.samples, static_cast<int>(r));
    on_coarse[r] = pathwise_slopes(setting, neighbours, coarse, draws);
    on_fine[r] = pathwise_slopes(setting, neighbours, fine, draws);
  });
  for (std::size_t i = 0; i < list.size(); ++i) {
    std::vector<double> extrapolated;
    double correction = 0;
    for (std::size_t r = 0; r < replicates; ++r) {
      const double third = (on_fine[r][i] - on_coarse[r][i]) / 3;
      extrapolated.push_back(on_fine[r][i] + third);
      list[i].derivative += extrapolated.back() / static_cast<double>(replicates);
      correction += third / static_cast<double>(replicates);
    }
    list[i].error = t_interval(extrapolated).half_width + std::abs(correction);
  }
  return list;
}

// Says how far a parameter is moved to either side: its range may end before.
struct Moves {
  double back = 0, forth = 0;
  bool central() const { return back == forth; }
};
Moves moves(const Setting& setting, const Sensitivity& one, double step) {
  Moves of{step, step};
  if (one.parameter == Parameter::tip_radius || one.parameter == Parameter::restitution_mean ||
      one.parameter == Parameter::friction_mean)
    of.back = std::min(step, one.value);
  if (one.parameter == Parameter::restitution_mean) of.forth = std::min(step, highest_restitution(setting) - one.value);
  return of;
}

// Takes differences of exact rows on nodes that move with the lowest state of a survivor: the densities begin there,
// and nodes that stood still would lose what lies between.
class IntegratedRows {
 public:
  // @param problem  of the setting
  // @param landings  of the tables of moved settings
  IntegratedRows(const Setting& setting, const Problem& problem, const ExactRows& rows, std::size_t panels,
                 LandingOptions landings)
      : setting_(setting), rows_(rows), panels_(panels), landings_(std::move(landings)) {
    for (int p = 0; p < problem.map.phases(); ++p) lowest_.push_back(problem.map.state_interval(p).first);
    const markov::SampledChain here = chain(setting);
    adjoint_ = markov::adjoint(markov::ChainSolver(here.chain), here.launch);
  }

  // Takes d ln M by the central difference of step `step`; by one to a side at the end of a range.
  double difference(const Sensitivity& one, double step) const {
    const Moves by = moves(setting_, one, step);
    const markov::SampledChain low = chain(moved(setting_, one, -by.back)),
                               high = chain(moved(setting_, one, by.forth));
    return markov::steps_change(adjoint_, low.chain, low.launch, high.chain, high.launch) /
           ((by.back + by.forth) * adjoint_.steps);
  }

 private:
  markov::SampledChain chain(const Setting& near) const {
    const Problem problem = near.problem(landings_);
    std::vector<double> shift;
    for (int p = 0; p < problem.map.phases(); ++p)
      shift.push_back(problem.map.state_interval(p).first - lowest_[static_cast<std::size_t>(p)]);
    return rows_.chain(problem, rows_.space(panels_, shift)).chain;
  }

  const Setting& setting_;
  const ExactRows& rows_;
  std::size_t panels_;
  LandingOptions landings_;
  std::vector<double> lowest_;  // state of a survivor, by phase
  markov::Adjoint adjoint_;
};

std::vector<Sensitivity> by_rows(const Setting& setting, const Metastability& study, const StudyOptions& options) {
  const Problem problem = setting.problem();
  const ExactRows rows(problem, options.tolerance, options.threads);
  const std::size_t panels = std::max<std::size_t>(2, study.cells / rows.coarsest());
  const IntegratedRows fine(setting, problem, rows, panels, {}), coarse(setting, problem, rows, panels / 2, {});
  std::vector<Sensitivity> list = candidates(setting, !setting.wheel.equal_legs());
  for (std::size_t i = 0; i < list.size(); ++i) {
    if (options.progress)
      options.progress(static_cast<double>(i) / static_cast<double>(list.size()), sensitivity_name(list[i]));
    const double step = integrated_step * width(setting, list[i].parameter);
    const double one = fine.difference(list[i], step), two = fine.difference(list[i], 2 * step);
    const double left = (one - two) / (moves(setting, list[i], 2 * step).central() ? 3 : 1);  // by order of the step
    list[i].derivative = one + left;
    list[i].error = std::abs(left) + std::abs(one - coarse.difference(list[i], step));
  }
  return list;
}

bool of_contact(Parameter parameter) {
  return parameter == Parameter::restitution_mean || parameter == Parameter::restitution_sd ||
         parameter == Parameter::friction_mean || parameter == Parameter::friction_sd;
}

// Takes, under `settled`, differences of rows, whatever the study was made with, with a table each for a wheel or slope
// moved to either side. The error is that of the nodes, and of two tables where there are two.
std::vector<Sensitivity> by_tables(const Setting& setting, const Metastability& study, const StudyOptions& options) {
  const Problem problem = setting.problem(landing_options(options, 0, 0));
  const ExactRows rows(problem, options.tolerance, options.threads);
  std::vector<Sensitivity> list = candidates(setting, !setting.wheel.equal_legs());
  std::size_t taken = 0;
  StudyOptions within = options;
  if (options.progress)
    within.progress = [&](double, const std::string& what) {
      options.progress(static_cast<double>(taken) / static_cast<double>(list.size()), what);
    };
  const LandingOptions landings = landing_options(within);
  const IntegratedRows fine(setting, problem, rows, table_panels, landings),
      coarse(setting, problem, rows, table_panels / 2, landings);
  for (; taken < list.size(); ++taken) {
    Sensitivity& one = list[taken];
    if (within.progress) within.progress(0, sensitivity_name(one));
    const bool same_table = of_contact(one.parameter);
    const double step = width(setting, one.parameter) * (same_table ? 10 * integrated_step
                                                         : one.leg  ? leg_table_step
                                                                    : table_step);
    one.derivative = fine.difference(one, step);
    one.error = std::abs(one.derivative - coarse.difference(one, step));
    if (same_table)
      one.error += std::abs(one.derivative - fine.difference(one, 2 * step)) / 3;
    else
      one.error += std::sqrt(2.0) * study.steps.landing_error /
                   (moves(setting, one, step).back + moves(setting, one, step).forth);
  }
  return list;
}

}  // namespace

std::string sensitivity_name(const Sensitivity& one) {
  return one.leg ? fmt::format("leg {}", *one.leg) : std::string(parameter_name(one.parameter));
}

Sensitivities sensitivities(const Metastability& study, const StudyOptions& options) {
  if (!study.setting) throw std::invalid_argument("sensitivities: the study is not of a wheel's setting");
  const Setting& setting = *study.setting;
  if (std::isinf(study.steps.from_start.value)) return {{}, "the expected steps are infinite or not resolved"};
  if (setting.noise_free()) return {{}, "without noise the steps are a staircase in every parameter"};
  if (study.method == Method::followed) return {{}, "the noise is too narrow for cells of states"};
  if (setting.law == dynamics::Law::settled && options.direct)
    return {{}, "landings that are all followed would take hours for them; leave out --direct"};
  if (setting.law == dynamics::Law::settled && (!setting.pairs.empty() || setting.correlation != 0))
    return {{}, "under settled they are taken from integrated rows, which need independent normals"};
  Sensitivities result;
  result.ranked = setting.law == dynamics::Law::settled ? by_tables(setting, study, options)
                  : study.method == Method::integrated  ? by_rows(setting, study, options)
                                                        : by_paths(setting, study, options);
  std::stable_sort(result.ranked.begin(), result.ranked.end(), [](const Sensitivity& a, const Sensitivity& b) {
    return std::abs(a.elasticity()) > std::abs(b.elasticity());
  });
  return result;
}

}  // namespace metastable::analysis
