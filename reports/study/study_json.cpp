#include "reports/study/study_json.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <span>

#include "dynamics/wheel/contact_law.h"
#include "reports/study/last_moments_text.h"

namespace metastable::reports {
namespace {

using Json = nlohmann::ordered_json;

Json number(double value) {
  if (std::isinf(value)) return value > 0 ? "infinite" : "-infinite";
  return value;
}

Json interval(const analysis::Estimate& estimate) { return {number(estimate.lower), number(estimate.upper)}; }

Json optional_number(const std::optional<double>& value) { return value ? number(*value) : Json(nullptr); }

Json accumulated(const analysis::Accumulated& total) {
  Json json = {{"mean", number(total.mean)}, {"sd", number(total.sd)}};
  Json quantiles = Json::object();
  for (const analysis::Quantile& one : total.quantiles)
    quantiles[format_number(one.level, NumberFormat::general, 3)] = number(one.value);
  json["quantiles"] = quantiles;
  return json;
}

Json certificate_json(const analysis::CertifiedSteps& certified) {
  Json json = {{"exists", certified.exists}};
  if (!certified.reason.empty()) json["reason"] = certified.reason;
  if (!certified.exists) return json;
  json["expected_steps"] = {{"lower", number(certified.lower)}, {"upper", number(certified.upper)}};
  json["relative_width"] = number(certified.width());
  json["cells"] = certified.cells;
  // Interpolates from any omega^2 just before a collision: linear between states.
  Json legs = Json::array();
  const markov::Certificate& all = certified.from_state;
  for (std::size_t p = 0; p < all.nodes.size(); ++p)
    legs.push_back({{"state_rad2_s2", all.nodes[p]},
                    {"lower", all.lower[p]},
                    {"upper", all.upper.empty() ? Json(nullptr) : Json(all.upper[p])}});
  json["per_leg"] = legs;
  return json;
}

Json sensitivities_json(const analysis::Sensitivities& sensitivities) {
  if (!sensitivities.reason.empty()) return {{"reason", sensitivities.reason}};
  Json list = Json::array();
  for (const analysis::Sensitivity& one : sensitivities.ranked)
    list.push_back({{"parameter", analysis::sensitivity_name(one)},
                    {"unit", analysis::parameter_unit(one.parameter)},
                    {"value", one.value},
                    {"d_ln_steps", one.derivative},
                    {"d_ln_steps_error", one.error},
                    {"elasticity", one.elasticity()}});
  return list;
}

Json propagated_json(const analysis::Propagated& propagated) {
  Json shares = Json::object();
  for (const analysis::Propagated::VarianceShare& one : propagated.shares)
    shares[std::string(analysis::parameter_name(one.parameter))] = one.share;
  return {{"interval_95", interval(propagated.interval)},
          {"log_standard_error", propagated.log_sd},
          {"variance_shares", shares}};
}

// Says of the law of rigid bodies what a study beside it would: expected steps, or a bound, or why there are none.
Json rigid_bodies_json(const analysis::BesideRigidBodies& beside) {
  const analysis::RigidBodyCheck& check = beside.check;
  Json json = {{"law", dynamics::law_name(dynamics::Law::settled)}};
  if (!check.reason.empty()) {
    json["reason"] = check.reason;
    return json;
  }
  json["expected_steps"] = {{"from_start", check.at_least ? Json(nullptr) : number(check.steps.value)},
                            {"interval_95", interval(check.steps)}};
  json["verdict"] = analysis::verdict_text(beside.verdict());
  json["wheels"] = check.wheels;
  json["collisions"] = check.collisions;
  json["rests"] = check.rests;
  return json;
}

Json provenance_json(const Provenance& provenance) {
  return {{"command", provenance.command},
          {"settings", provenance.settings},
          {"seed", provenance.seed},
          {"version", provenance.version}};
}

Json expected_steps_json(const analysis::StepsToRest& steps) {
  const double median = steps.distribution.quantile(0.5).value_or(steps.from_start.value);
  return {{"from_start", number(steps.from_start.value)},
          {"interval_95", interval(steps.from_start)},
          {"from_quasi_stationary", number(steps.from_quasi_stationary.value)},
          {"from_quasi_stationary_interval_95", interval(steps.from_quasi_stationary)},
          {"worst_start", number(steps.worst_start.value)},
          {"worst_start_interval_95", interval(steps.worst_start)},
          {"sd", number(steps.distribution.sd)},
          {"median", number(median)},
          {"quantiles", accumulated(steps.distribution)["quantiles"]}};
}

// Work without a total is without end, or its end is not known.
Json total_json(const std::optional<analysis::Accumulated>& total, bool endless) {
  if (total) return accumulated(*total);
  return endless ? Json("infinite") : Json(nullptr);
}

Json regime_json(const analysis::Survivors& survivors) {
  Json legs = Json::array();
  for (const analysis::PhaseDistribution& phase : survivors.by_phase)
    legs.push_back({{"mean_rad_s", phase.mean}, {"sd_rad_s", phase.sd}});
  return {
      {"mean_rad_s", survivors.mean}, {"sd_rad_s", survivors.sd}, {"error_rad_s", survivors.error}, {"per_leg", legs}};
}

Json violations_json(const std::vector<analysis::ViolationShare>& violations) {
  Json shares = Json::object();
  for (const analysis::ViolationShare& share : violations)
    shares[share.name] = {{"quasi_stationary", share.quasi_stationary},
                          {"quasi_stationary_standard_error", share.quasi_stationary_error},
                          {"until_rest", share.until_rest},
                          {"until_rest_standard_error", share.until_rest_error}};
  return shares;
}

Json error_json(const analysis::StepsToRest& steps) {
  Json json = {{"discretization", number(steps.discretization_error)}, {"sampling", number(steps.sampling_error)}};
  if (steps.landing_error > 0) json["landings"] = steps.landing_error;
  if (steps.memory.upper > steps.memory.lower)
    json["moving_feet"] = {{"value", steps.memory.value}, {"interval_95", {steps.memory.lower, steps.memory.upper}}};
  return json;
}

Json study_json(const analysis::Metastability& study, const analysis::RestThresholds& thresholds) {
  const analysis::Setting& setting = study.setting.value();
  const bool endless = study.status == analysis::Status::rest_unreachable;
  Json json;
  json["slope_deg"] = setting.slope_deg;
  json["law"] = dynamics::law_name(setting.law);
  json["launch"] = {{"steady", setting.steady_launch},
                    {"mean_rad_s", setting.initial_speed.mean},
                    {"sd_rad_s", setting.initial_speed.sd}};
  json["method"] = analysis::method_name(study.method);
  json["status"] = analysis::status_text(study.status);
  if (!study.message.empty()) json["message"] = study.message;
  json["expected_steps"] = expected_steps_json(study.steps);
  json["failure_rate_per_step"] = study.spectrum.failure_rate.value;
  json["failure_rate_interval_95"] = interval(study.spectrum.failure_rate);
  json["seconds_before_failure"] = total_json(study.steps.seconds, endless);
  json["metres_before_failure"] = total_json(study.steps.metres, endless);
  json["survival"] = study.steps.survival;
  json["eigenvalue_moduli"] = study.spectrum.moduli;
  json["mixing_steps"] = number(study.spectrum.mixing_steps);
  json["total_variation_mixing_steps"] =
      study.spectrum.total_variation_steps ? Json(*study.spectrum.total_variation_steps) : Json(nullptr);
  json["quasi_stationary"] = regime_json(study.survivors);
  json["stationary_with_restart"] = {{"mean_rad_s", study.survivors.restart_mean},
                                     {"sd_rad_s", study.survivors.restart_sd},
                                     {"error_rad_s", study.survivors.restart_error}};
  json["reach_ramp_end"] = optional_number(study.steps.reach_end);
  json["outside_assumptions"] = violations_json(study.violations);
  json["rest_unreachable_above"] = {{"speed_rad_s", optional_number(thresholds.safe_speed)},
                                    {"slope_deg", optional_number(thresholds.safe_slope_deg)}};
  json["error"] = error_json(study.steps);
  json["resolution"] = {{"cells", study.cells},
                        {"samples", study.samples},
                        {"replicates", study.replicates},
                        {"phases", study.phases},
                        {"period", study.spectrum.period}};
  json["solver_disagreement"] = study.steps.solver_disagreement;
  return json;
}

}  // namespace

std::string steps_json(const analysis::Metastability& study, const analysis::RestThresholds& thresholds,
                       const Provenance& provenance, const StepsExtras& extras) {
  Json json = {{"schema", 1}};
  json.update(study_json(study, thresholds));
  if (extras.certified) json["certificate"] = certificate_json(*extras.certified);
  if (extras.sensitivities) json["sensitivities"] = sensitivities_json(*extras.sensitivities);
  if (extras.last_moments) json["how_it_fails"] = Json::parse(last_moments_json(*extras.last_moments));
  if (extras.propagated) json["from_standard_errors"] = propagated_json(*extras.propagated);
  if (extras.rigid_bodies) {
    json["rigid_bodies"] = rigid_bodies_json(*extras.rigid_bodies);
    json["rigid_bodies"]["sentence"] =
        analysis::rigid_body_sentence(std::span(&*extras.rigid_bodies, 1), study.setting.value().law);
  }
  json["provenance"] = provenance_json(provenance);
  return json.dump(2) + "\n";
}

std::string compare_json(const analysis::Comparison& comparison,
                         const std::vector<analysis::RestThresholds>& thresholds, const Provenance& provenance,
                         const CompareExtras& extras) {
  Json json = {{"schema", 1}, {"settings", Json::array()}, {"contrasts", Json::array()}};
  for (std::size_t i = 0; i < comparison.studies.size(); ++i) {
    json["settings"].push_back({{"label", comparison.labels[i]}});
    json["settings"].back().update(study_json(comparison.studies[i], thresholds[i]));
    if (!extras.steps.empty()) json["settings"].back()["from_standard_errors"] = propagated_json(extras.steps[i]);
    if (!extras.rigid_bodies.empty())
      json["settings"].back()["rigid_bodies"] = rigid_bodies_json(extras.rigid_bodies[i]);
  }
  const auto estimate = [](const std::optional<analysis::Estimate>& value) {
    return value ? Json{{"value", number(value->value)}, {"interval_95", interval(*value)}} : Json(nullptr);
  };
  for (std::size_t i = 0; i < comparison.contrasts.size(); ++i) {
    const analysis::Contrast& contrast = comparison.contrasts[i];
    json["contrasts"].push_back({{"label", comparison.labels[contrast.of]},
                                 {"against_label", comparison.labels[contrast.against]},
                                 {"slope_deg", comparison.studies[contrast.of].setting->slope_deg},
                                 {"against_slope_deg", comparison.studies[contrast.against].setting->slope_deg},
                                 {"ratio", estimate(contrast.ratio)},
                                 {"difference", estimate(contrast.difference)},
                                 {"trials_needed", optional_number(contrast.trials_needed)},
                                 {"power", optional_number(contrast.power)},
                                 {"sentence", contrast.sentence}});
    if (!extras.ratios.empty())
      json["contrasts"].back()["ratio_from_standard_errors"] = propagated_json(extras.ratios[i]);
  }
  if (!extras.rigid_bodies.empty())
    json["rigid_bodies"] =
        analysis::rigid_body_sentence(extras.rigid_bodies, comparison.studies.front().setting.value().law);
  json["provenance"] = provenance_json(provenance);
  return json.dump(2) + "\n";
}

}  // namespace metastable::reports
