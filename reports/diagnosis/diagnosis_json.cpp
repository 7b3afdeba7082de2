#include "reports/diagnosis/diagnosis_json.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "dynamics/catalogue/effect_catalogue.h"
#include "reports/diagnosis/diagnosis_tables.h"

namespace metastable::reports {
namespace {

using Json = nlohmann::ordered_json;

Json number(double value) {
  if (std::isnan(value)) return nullptr;
  if (std::isinf(value)) return value > 0 ? "infinite" : "-infinite";
  return value;
}

Json number(const std::optional<double>& value) { return value ? number(*value) : Json(nullptr); }

// Steps that are not known, and a size of an effect without one, are 0.
Json positive_or_null(double value) { return value > 0 ? number(value) : Json(nullptr); }

bool is_whole(const std::string& effect, const std::string& parameter) {
  for (const dynamics::EffectInfo& info : dynamics::effect_catalogue())
    if (info.id == effect)
      for (const dynamics::EffectParameter& p : info.parameters)
        if (p.name == parameter) return p.integer;
  return false;
}

bool is_list(const std::string& parameter) { return parameter == "leg_lengths_m"; }

struct NamedParameters {
  Json values = Json::object(), intervals = Json::object();
};

NamedParameters named_parameters(const std::string& effect,
                                 const std::vector<analysis::EstimatedParameter>& parameters) {
  NamedParameters json;
  for (const analysis::EstimatedParameter& p : parameters) {
    const Json value = is_whole(effect, p.name) ? Json(static_cast<int>(std::lround(p.value))) : number(p.value);
    const Json interval = {number(p.lower), number(p.upper)};
    if (is_list(p.name)) {
      json.values[p.name].push_back(value);
      json.intervals[p.name].push_back(interval);
      continue;
    }
    json.values[p.name] = value;
    if (p.fitted) json.intervals[p.name] = interval;
  }
  return json;
}

Json cause_json(const analysis::Cause& cause) {
  Json json = {{"effect", cause.name()}, {"probability", number(cause.probability)}};
  NamedParameters all;
  for (std::size_t e = 0; e < cause.effects.size() && e < cause.parameters.size(); ++e) {
    NamedParameters one = named_parameters(cause.effects[e], cause.parameters[e]);
    if (cause.effects.size() == 1) {
      all = std::move(one);
    } else {
      all.values[cause.effects[e]] = one.values;
      all.intervals[cause.effects[e]] = one.intervals;
    }
  }
  json["parameters"] = all.values;
  json["interval_90"] = all.intervals;
  json["gain"] = number(cause.gain);
  json["p_value"] = number(cause.p_value);
  json["log_bayes_factor"] = number(cause.evidence);
  return json;
}

Json causes_json(const analysis::Diagnosis& d) {
  std::vector<Json> all;
  for (const analysis::Cause& cause : d.causes.ranked) all.push_back(cause_json(cause));
  const NamedParameters contact = named_parameters("contact_distribution", d.gap.contact);
  const auto other = [&](const char* name, double probability, const NamedParameters& parameters) {
    all.push_back({{"effect", name},
                   {"probability", number(probability)},
                   {"parameters", parameters.values},
                   {"interval_90", parameters.intervals}});
  };
  other("no_gap", d.causes.p_no_gap, {});
  other("recalibration", d.causes.p_recalibrate, contact);
  other("none_of_these", d.causes.p_none, {});
  std::stable_sort(all.begin(), all.end(), [](const Json& a, const Json& b) {
    return a["probability"].is_number() && (!b["probability"].is_number() || a["probability"] > b["probability"]);
  });
  return all;
}

Json unnamed_json(const analysis::Unnamed& one, const std::string& step_name) {
  Json facets = Json::array();
  for (const analysis::LeftInFacet& left : one.facets)
    facets.push_back({{"facet", left.facet},
                      {"aspect", left.aspect},
                      {"of", left.stance ? "stances" : step_name + "s"},
                      {"chi_squared", number(left.quadratic)},
                      {"degrees", number(left.degrees)},
                      {"p_value", number(left.p_value)},
                      {"log_bayes_factor", number(left.evidence)}});
  return {{"beside", one.beside}, {"log_bayes_factor", number(one.evidence)}, {"facets", facets}};
}

Json share_json(const std::optional<Estimate>& share) { return share ? Json(number(share->value)) : Json(nullptr); }

Json interval_json(const std::optional<Estimate>& share) {
  return share ? Json{number(share->lower), number(share->upper)} : Json(nullptr);
}

Json at_work_json(const analysis::AtWork& one) {
  const NamedParameters parameters = named_parameters(one.effects.front(), one.parameters);
  return {{"name", one.name},
          {"effects", one.effects},
          {"probability", number(one.probability)},
          {"parameters", parameters.values},
          {"interval_90", parameters.intervals},
          {"closes",
           {{"alone", share_json(one.closes_alone)},
            {"beside", share_json(one.closes_beside)},
            {"mean", share_json(one.closes_mean)},
            {"interval_90",
             {{"alone", interval_json(one.closes_alone)},
              {"beside", interval_json(one.closes_beside)},
              {"mean", interval_json(one.closes_mean)}}}}}};
}

// Lists where something without a name acts; the share of the gap that has no name is said of the likeliest place.
Json unnamed_facets_json(const analysis::Diagnosis& d) {
  Json all = Json::array();
  for (const analysis::UnnamedFacet& one : d.causes.unnamed_facets) {
    Json closes = nullptr;
    if (all.empty() && d.causes.unnamed_share) closes = number(*d.causes.unnamed_share);
    all.push_back({{"facet", one.facet},
                   {"aspect", one.aspect},
                   {"of", one.stance ? "stances" : d.data.step_name + "s"},
                   {"size", one.size ? Json(number(*one.size)) : Json(nullptr)},
                   {"unit", one.unit},
                   {"probability", number(one.probability)},
                   {"closes", closes}});
  }
  return all;
}

Json left_json(const analysis::Diagnosis& d) {
  const std::optional<Estimate>& ignoring = d.shrinkage.steps.without_unnamed;
  Json json{{"nats", nullptr},
            {"interval_90", nullptr},
            {"steps_ratio", share_json(ignoring)},
            {"steps_ratio_interval_90", interval_json(ignoring)}};
  if (d.shrinkage.measures.empty()) return json;
  const analysis::Shrinkage& s = d.shrinkage.measures.front();
  json["nats"] = number(s.with_effect);
  json["interval_90"] = {number(s.with_effect_lower), number(s.with_effect_upper)};
  return json;
}

Json where_json(const std::vector<analysis::GapCell>& cells) {
  Json list = Json::array();
  for (const analysis::GapCell& cell : cells)
    list.push_back({{"facet", cell.facet},
                    {"aspect", cell.aspect},
                    {"at", cell.at},
                    {"p_adjusted", number(cell.p_adjusted)},
                    {"size", number(cell.size)},
                    {"band_95", {number(cell.size - cell.band), number(cell.size + cell.band)}},
                    {"unit", cell.unit},
                    {"score", number(cell.statistic)},
                    {"transitions", cell.events}});
  return list;
}

Json shrinkage_json(const analysis::Shrinkage& s) {
  Json closed_interval = nullptr;
  if (s.closed_lower && s.closed_upper) closed_interval = {number(*s.closed_lower), number(*s.closed_upper)};
  return {{"measure", s.measure},
          {"unit", s.unit},
          {"baseline", number(s.baseline)},
          {"baseline_interval_90", {number(s.baseline_lower), number(s.baseline_upper)}},
          {"recalibrated", number(s.recalibrated)},
          {"with_effect", number(s.with_effect)},
          {"floor", number(s.floor)},
          {"closed", number(s.closed)},
          {"closed_interval_90", closed_interval}};
}

// Every key is there where nothing is known.
analysis::Shrinkage unknown_shrinkage() {
  analysis::Shrinkage s;
  s.baseline = s.recalibrated = s.with_effect = s.floor = std::numeric_limits<double>::quiet_NaN();
  s.baseline_lower = s.baseline_upper = s.baseline;
  s.measure = "too few trials to hold any out";
  return s;
}

Json steps_json(const analysis::StepsBeforeFailure& s) {
  Json machine = Json::array();
  for (const analysis::MachineSteps& one : s.machine)
    machine.push_back({{"where", one.where.empty() ? "as measured" : one.where},
                       {"steps", positive_or_null(one.steps.value)},
                       {"interval_90", {positive_or_null(one.steps.lower), positive_or_null(one.steps.upper)}},
                       {"at_least", one.at_least}});
  return {{"observed", positive_or_null(s.observed)},
          {"observed_interval_90", {positive_or_null(s.observed_lower), positive_or_null(s.observed_upper)}},
          {"baseline", positive_or_null(s.baseline)},
          {"recalibrated", positive_or_null(s.recalibrated)},
          {"recalibrated_interval_90", interval_json(s.recalibrated_90)},
          {"with_effect", positive_or_null(s.with_effect)},
          {"with_effect_interval_90", interval_json(s.with_effect_90)},
          {"later", positive_or_null(s.later)},
          {"machine", machine}};
}

Json visibility_json(const analysis::Diagnosis& d, const analysis::Detectability& v) {
  Json alike = Json::object();
  for (const auto& [effect, share] : v.alike) alike[effect] = number(share);
  return {{"effect", v.effect},
          {"parameter", v.parameter},
          {"unit", unit_of(d, v.effect, v.parameter)},
          {"smallest", v.undecidable.empty() ? positive_or_null(v.smallest) : Json(nullptr)},
          {"alike", alike},
          {"undecidable", v.undecidable.empty() ? Json(nullptr) : Json(v.undecidable)}};
}

template <typename Values, typename Convert>
Json list_json(const Values& values, Convert convert) {
  Json list = Json::array();
  for (const auto& value : values) list.push_back(convert(value));
  return list;
}

Json gap_json(const analysis::Diagnosis::Gap& gap) {
  return {{"p_value_as_given", number(gap.p_as_given)},
          {"p_value", number(gap.p_value)},
          {"p_value_recalibration", number(gap.p_recalibration)},
          {"p_value_effects", number(gap.p_effects)},
          {"p_value_where", number(gap.p_where)},
          {"p_value_facets", gap.facets_tested ? number(gap.p_facets) : nullptr},
          {"p_value_variations", gap.variations_tested ? number(gap.p_variations) : nullptr}};
}

Json missing_json(const analysis::MissingColumn& missing) {
  return {{"column", missing.column}, {"effects", list_json(missing.effects, [](const auto& effect) {
                                         return Json{{"effect", effect.effect},
                                                     {"parameter", effect.parameter},
                                                     {"smallest", number(effect.smallest)},
                                                     {"smallest_with_it", number(effect.smallest_with_it)},
                                                     {"not_told_from", effect.not_told_from}};
                                       })}};
}

}  // namespace

std::string diagnosis_json(const analysis::Diagnosis& d, const Provenance& provenance) {
  Json json;
  json["schema"] = 1;
  json["verdict"] = analysis::verdict_name(d.verdict);
  json["sentences"] = d.sentences;
  json["gap"] = gap_json(d.gap);
  json["where"] = where_json(beyond_chance(d.gap.recalibrated));
  json["where_as_given"] = where_json(beyond_chance(d.gap.as_given));
  json["where_left"] = where_json(beyond_chance(d.gap.left));
  json["causes"] = causes_json(d);
  json["cause_set"] = d.causes.set;
  json["cause_set_alike"] = d.causes.alike;
  json["at_work"] = list_json(d.causes.at_work, at_work_json);
  json["unnamed"] = unnamed_facets_json(d);
  json["p_unnamed"] = number(d.causes.p_unnamed);
  json["left"] = left_json(d);
  json["unnamed_supposed"] =
      list_json(d.causes.unnamed, [&](const analysis::Unnamed& one) { return unnamed_json(one, d.data.step_name); });
  json["stepwise"] = Json::object();
  for (const auto& choice : d.causes.stepwise) json["stepwise"][choice.criterion] = choice.effects;
  json["not_decided"] = list_json(d.causes.not_decided, [](const auto& cause) {
    return Json{{"effect", cause.name()}, {"reason", cause.not_decided}};
  });
  const NamedParameters contact = named_parameters("contact_distribution", d.gap.contact);
  json["contact"] = {{"parameters", contact.values}, {"interval_90", contact.intervals}};
  const NamedParameters beside = named_parameters("contact_distribution", d.causes.beside);
  json["contact_beside_effects"] = {{"parameters", beside.values}, {"interval_90", beside.intervals}};
  json["shrinkage"] = shrinkage_json(d.shrinkage.measures.empty() ? unknown_shrinkage() : d.shrinkage.measures.front());
  json["shrinkage_by_measure"] = list_json(d.shrinkage.measures, shrinkage_json);
  json["steps_before_failure"] = steps_json(d.shrinkage.steps);
  json["visibility"] = list_json(d.limits.visible, [&](const auto& v) { return visibility_json(d, v); });
  json["missing_columns"] = list_json(d.limits.missing, missing_json);
  json["not_possible"] = list_json(d.limits.not_possible, [](const analysis::NotPossible& n) {
    return Json{
        {"statement", n.statement}, {"because", n.because}, {"trials", n.trials ? Json(*n.trials) : Json(nullptr)}};
  });
  json["at_bound"] = list_json(d.limits.at_bound, [](const analysis::AtBound& one) {
    return Json{{"effect", one.of.empty() ? Json(nullptr) : Json(one.of)},
                {"parameter", one.parameter},
                {"bound", one.upper ? "upper" : "lower"},
                {"value", number(one.value)}};
  });
  json["next_experiment"] = list_json(d.limits.next, [](const analysis::NextExperiment& next) {
    Json changes = Json::object();
    for (const auto& [kind, amount] : next.changes) changes[kind] = number(amount);
    return Json{{"change", next.change}, {"changes", changes}, {"separation", number(next.separation)}};
  });
  json["data"] = {{"trials", d.data.trials}, {"collisions", d.data.collisions}, {"transitions", d.data.events}};
  json["notes"] = d.data.notes;
  json["provenance"] = {{"command", provenance.command},
                        {"settings", provenance.settings},
                        {"seed", provenance.seed},
                        {"version", provenance.version}};
  return json.dump(2) + "\n";
}

std::string effects_json() { return effects_json(dynamics::effect_catalogue(), ""); }

std::string effects_json(const std::vector<dynamics::EffectInfo>& all, const std::string& walker) {
  Json list = Json::array();
  for (const dynamics::EffectInfo& info : all) {
    Json parameters = Json::array();
    for (const dynamics::EffectParameter& p : info.parameters)
      parameters.push_back({{"name", p.name},
                            {"unit", p.unit},
                            {"neutral", number(p.neutral)},
                            {"lower", number(p.lower)},
                            {"upper", number(p.upper)},
                            {"whole_number", p.integer},
                            {"per_leg", p.per_leg},
                            {"meaning", p.meaning}});
    list.push_back({{"id", info.id}, {"summary", info.summary}, {"parameters", parameters}});
  }
  Json json{{"schema", 1}};
  if (!walker.empty()) json["walker"] = walker;
  json["effects"] = std::move(list);
  return json.dump(2) + "\n";
}

}  // namespace metastable::reports
