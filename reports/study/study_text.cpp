#include "reports/study/study_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "reports/output/table.h"
#include "reports/output/text_table.h"

namespace metastable::reports {
namespace {

// Shows the significant digits that a relative error leaves, six at most; three where none is known.
std::string show(double value, double error) {
  if (std::isinf(value)) return "infinite";
  const int digits = error > 0 ? std::clamp(static_cast<int>(std::ceil(-std::log10(error))), 2, 6) : 3;
  return plain_text(to_decimal(value, NumberFormat::general, digits));
}

// Shows a share of draws; of none seen it says what so many draws would have shown.
std::string percent(double share, double standard_error) {
  constexpr double shown = 1e-4;
  if (std::isnan(share)) return "none";
  if (share < shown) return "< 0.01 %";
  return show(100 * share, analysis::normal_95 * standard_error / share) + " %";
}

/// Shows mean and sd of a speed, both known to `error` [rad/s]: to as many decimals as that knows.
std::string speed_text(double mean, double sd, double error) {
  if (std::isnan(mean)) return "none: fewer than 1e-12 of the wheels survive a step";
  const int decimals = error > 0 ? std::clamp(static_cast<int>(std::floor(-std::log10(error))), 1, 4) : 4;
  return fmt::format("{:.{}f} rad/s, sd {:.{}f}", mean, decimals, sd, decimals);
}

double relative_error(const analysis::Estimate& e) {
  return std::isfinite(e.value) ? 0.5 * (e.upper - e.lower) / e.value : 0;
}

std::string line(const std::string& name, const std::string& value) { return fmt::format("  {:<38}{}\n", name, value); }

struct Word {
  const char *name, *line, *more;
};

constexpr Word always[] = {
    {"step", "one collision of the next leg with the ramp",
     "The collision that leads to rest is counted too, so that expected steps are 1 at least."},
    {"failure", "after a collision the wheel is too slow to vault over its standing leg: it rests",
     "Reaching the end of the ramp is no failure: the expected steps are those of a ramp without end."}};
constexpr Word until_failure[] = {
    {"metastable regime", "wheels that still roll long after the launch",
     "Their speeds no longer remember the launch: they have the quasi-stationary distribution, the left eigenvector of "
     "the chain for its largest eigenvalue lambda_1, and every further step fails with probability 1 - lambda_1."},
    {"worst start", "the slowest speed with which a step can end and the wheel roll on",
     "Expected steps from there are the fewest that a rolling wheel has."},
    {"relaunched", "the long-run mean if every wheel that rests is launched again at once", ""}};
constexpr Word of_the_chain[] = {
    {"quasi-stationary speed", "mean and sd of the speed in the metastable regime, just before a collision", ""},
    {"eigenvalue moduli", "shares that are left of differences between two wheels after a step, the largest first",
     "The first is the share of rolling wheels in the metastable regime that a step leaves rolling."},
    {"mixing", "how many steps it takes until the launch is forgotten",
     "The spectral number is that of the steps in which differences fade by a factor of e. The one of total variation "
     "counts the steps from this launch until its distribution of speeds is within 0.05 of that of the regime."},
    {"resolution", "how finely the speeds are cut, and how many contacts are drawn, if any", ""},
    {"relative error", "what cells and draws leave open, as shares of the expected steps",
     "Discretization is the part of the cells, sampling that of the draws."}};
constexpr Word assumptions[] = {
    {"foot lifts", "too fast for gravity alone to hold the standing foot on the ramp",
     "The model holds it there. Where this is frequent, real wheels hop and the numbers are the model's alone."},
    {"negative loss", "one of the two losses of the collision, normal or along the ramp, is below zero",
     "The contact law is used outside the range that it was made for."},
    {"foot unsettled", "the next leg lands while the foot before it still hops or slides",
     "The chain takes every landing as one from a standing foot, with the momentum that the moving one carries."},
    {"energy gain", "the collision gives energy to the wheel",
     "No passive contact does; a share that is not small speaks against the law or its friction and restitution."}};

std::string quantiles_text(const analysis::Accumulated& total, double error) {
  return fmt::format("median {}, 5 to 95 %: {} to {}", show(*total.quantile(0.5), error),
                     show(*total.quantile(0.05), error), show(*total.quantile(0.95), error));
}

std::string total_line(const std::string& name, const analysis::Accumulated& total, double error) {
  // Mean and sd are the chain's; the quantiles' shape is matched (markov::reward_quantiles).
  return line(name, fmt::format("mean {}, sd {}, {}", show(total.mean, error), show(total.sd, error),
                                quantiles_text(total, std::max(error, 0.002))));
}

// Says how long wheels roll, where there is a number.
std::string steps_lines(const analysis::Metastability& study, const std::string& beside, double error) {
  const analysis::StepsToRest& steps = study.steps;
  const bool followed = study.method == analysis::Method::followed;
  std::string text = line("expected steps before failure", estimate_text(steps.from_start));
  if (!followed) text += line("  from the metastable regime", estimate_text(steps.from_quasi_stationary));
  if (std::isfinite(steps.worst_start.upper)) text += line("  from the worst start", estimate_text(steps.worst_start));
  text += beside;
  if (!followed) text += line("failure rate per step", estimate_text(study.spectrum.failure_rate));
  text += line("steps",
               fmt::format("sd {}, {}", show(steps.distribution.sd, error), quantiles_text(steps.distribution, error)));
  if (steps.seconds) text += total_line("seconds", *steps.seconds, error);
  if (steps.metres) text += total_line("metres", *steps.metres, error);
  return text;
}

std::string end_line(double reached, double ramp_length, double error) {  // about exp(-n / steps)
  return line(fmt::format("reaches the end of {} m", ramp_length),
              show(reached, reached > 0 ? -std::log(reached) * std::max(error, 0.001) : 0));
}

std::string speed_lines(const analysis::Metastability& study) {
  const analysis::Survivors& survivors = study.survivors;
  const bool endless = study.status == analysis::Status::rest_unreachable;
  const bool followed = study.method == analysis::Method::followed;
  std::string text;
  if (endless || !followed)
    text += line(endless ? "stationary speed" : "quasi-stationary speed",
                 speed_text(survivors.mean, survivors.sd, survivors.error));
  if (!endless && !(followed && study.samples > 0))
    text += line("stationary speed, relaunched",
                 std::isnan(survivors.restart_mean)
                     ? "none: every launch rests at its first collision"
                     : speed_text(survivors.restart_mean, survivors.restart_sd, survivors.restart_error));
  return text;
}

std::string spectrum_lines(const analysis::Metastability& study) {
  const analysis::Spectrum& spectrum = study.spectrum;
  std::string text, mixing;
  if (study.method != analysis::Method::followed)
    text += line("eigenvalue moduli per step", fmt::format("{:.6g}", fmt::join(spectrum.moduli, ", ")));
  if (spectrum.moduli.size() > 1) mixing = fmt::format("{:.4g} steps (spectral)", spectrum.mixing_steps);
  if (spectrum.total_variation_steps)
    mixing += fmt::format("{}{} {}from the launch (total variation)", mixing.empty() ? "" : ", ",
                          *spectrum.total_variation_steps, mixing.empty() ? "steps " : "");
  if (!mixing.empty()) text += line("mixing", mixing);
  return text;
}

std::string violation_line(const analysis::ViolationShare& share, bool endless) {
  return line(fmt::format("collisions with '{}'", share.name),
              fmt::format("{} in the {} regime, {} {}", percent(share.quasi_stationary, share.quasi_stationary_error),
                          endless ? "stationary" : "metastable", percent(share.until_rest, share.until_rest_error),
                          endless ? "on the ramp" : "until rest"));
}

std::string resolution_text(const analysis::Metastability& study) {
  if (study.method == analysis::Method::followed)
    return study.samples > 0 ? fmt::format("none: {} trials were followed", study.samples)
                             : "none: without noise launches are followed";
  const std::string legs = study.phases > 1 ? fmt::format(" for each of {} legs", study.phases) : "";
  if (study.method == analysis::Method::integrated) return fmt::format("{} nodes{}, integrated", study.cells, legs);
  return fmt::format("{} cells{}, {} draws a cell, {}", study.cells, legs, study.samples,
                     study.replicates > 1 ? fmt::format("{} replicates", study.replicates) : "one randomisation");
}

// Says how far the numbers may be off, and by what.
std::string error_lines(const analysis::Metastability& study) {
  const analysis::StepsToRest& steps = study.steps;
  std::string text = line("relative error", fmt::format("discretization {:.2g}, sampling {:.2g} (95 %)",
                                                        steps.discretization_error, steps.sampling_error));
  if (steps.landing_error > 0)
    text += line("landings", fmt::format("read from a table, which moves the steps by {:.2g} at most (in the interval)",
                                         steps.landing_error));
  if (steps.memory.upper > steps.memory.lower)
    text += line("feet still moving at the next touch",
                 fmt::format("move the steps by {:.2g} ({:.2g} to {:.2g}, in the interval)", steps.memory.value,
                             steps.memory.lower, steps.memory.upper));
  constexpr double rounding = 1e-9;  // what is below it differs from processor to processor
  const double apart = steps.solver_disagreement;
  if (study.method != analysis::Method::followed)
    text += line("solvers", apart < rounding ? "elimination and KLU agree to nine digits"
                                             : fmt::format("elimination and KLU differ by {:.2g} at most", apart));
  return text;
}

}  // namespace

std::string words_text(const analysis::Metastability& study, bool more, std::size_t width) {
  std::string text = "Words\n";
  const auto say = [&](const Word& word) {
    text += wrapped(fmt::format("{}: {}{}", word.name, word.line, more ? "." : ""), "  ", width);
    if (more && *word.more != '\0') text += wrapped(word.more, "    ", width);
  };
  for (const Word& word : always) say(word);
  if (study.status != analysis::Status::rest_unreachable) {
    for (const Word& word : until_failure) say(word);
    if (more && study.method != analysis::Method::followed)
      for (const Word& word : of_the_chain) say(word);
  }
  for (const analysis::ViolationShare& share : study.violations)
    for (const Word& word : assumptions)
      if (share.name == word.name) say(word);
  if (!more) text += "  --explain says more\n";
  return text;
}

std::string estimate_text(const analysis::Estimate& estimate) {
  if (std::isinf(estimate.value)) return "infinite";
  const DecimalEstimate e = to_decimal(estimate, NumberFormat::general, 12);
  return fmt::format("{} (95 % interval {} to {})", plain_text(e.value), plain_text(e.lower), plain_text(e.upper));
}

std::string sensitivities_text(const analysis::Sensitivities& sensitivities) {
  if (!sensitivities.reason.empty()) return "No sensitivities: " + sensitivities.reason + ".\n";
  std::string text = fmt::format("{:<22}{:>10} {:<8}{:>15}{:>11}{:>24}\n", "Sensitivities to", "value", "",
                                 "d ln steps / d", "+- (95 %)", "steps for 1 % more");
  for (const analysis::Sensitivity& one : sensitivities.ranked) {
    const std::string_view unit = analysis::parameter_unit(one.parameter);
    text += fmt::format("  {:<20}{:>10.5g} {:<8}{:>15}{:>11.2g}{:>22.3f} %\n", analysis::sensitivity_name(one),
                        one.value, unit == "1" ? "" : unit,
                        plain_text(to_decimal({one.derivative, one.derivative - one.error, one.derivative + one.error},
                                              NumberFormat::significant, 3)
                                       .value),
                        one.error, 100 * std::expm1(0.01 * one.elasticity()));
  }
  return text;
}

std::string propagated_text(const analysis::Propagated& propagated) {
  const DecimalEstimate e = to_decimal(propagated.interval, NumberFormat::general, 6);
  std::string shares;
  for (const analysis::Propagated::VarianceShare& one : propagated.shares)
    shares += fmt::format("{}{} {:.0f} %", shares.empty() ? "" : ", ", analysis::parameter_name(one.parameter),
                          100 * one.share);
  return fmt::format("{} to {} (variance: {})", plain_text(e.lower), plain_text(e.upper), shares);
}

std::string thresholds_text(const analysis::RestThresholds& thresholds) {
  std::string text = thresholds.safe_speed
                         ? fmt::format("out of reach for launches of {:.4g} rad/s and faster", *thresholds.safe_speed)
                         : std::string("within reach at every speed");
  if (!thresholds.slope_sought) return text;
  text += thresholds.safe_slope_deg
              ? fmt::format("; on slopes above {:.3f} deg fast enough launches never rest", *thresholds.safe_slope_deg)
              : std::string("; no slope puts it out of reach");
  return text;
}

std::string study_text(const analysis::Metastability& study, const analysis::RestThresholds& thresholds,
                       const analysis::BesideRigidBodies* rigid_bodies) {
  const analysis::Setting& setting = study.setting.value();
  const bool endless = study.status == analysis::Status::rest_unreachable;
  const double error = relative_error(study.steps.from_start);
  std::string text = setting.describe() + "\n\n";
  const std::string beside =
      rigid_bodies ? line("  of rigid bodies (law settled)", analysis::rigid_body_steps_text(rigid_bodies->check)) : "";
  if (study.status == analysis::Status::rest_unresolved) return text + "  " + study.message + "\n" + beside;
  text += endless ? line("expected steps before failure", study.message) + beside : steps_lines(study, beside, error);
  if (study.steps.reach_end) text += end_line(*study.steps.reach_end, setting.ramp_length, error);
  text += speed_lines(study) + spectrum_lines(study) + "\n";
  text += line("rest", thresholds_text(thresholds));
  for (const analysis::ViolationShare& share : study.violations) text += violation_line(share, endless);
  text += line("resolution", resolution_text(study));
  if (endless) return text;
  text += error_lines(study);
  if (!study.message.empty()) text += "\n" + study.message + "\n";
  return text;
}

}  // namespace metastable::reports
