#include "reports/diagnosis/blind_json.h"

#include <fmt/format.h>

#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <utility>

namespace metastable::reports {
namespace {

using nlohmann::ordered_json;

ordered_json spread(const analysis::Spread& s) { return {{"mean", s.mean}, {"sd", s.sd}}; }
analysis::Spread spread(const ordered_json& j) { return {j.at("mean").get<double>(), j.at("sd").get<double>()}; }

// Returns an interval whose upper end is infinite where it is not a number; nothing without a lower end.
std::optional<std::pair<double, double>> interval(const ordered_json& j) {
  if (!j.is_array() || j.size() != 2 || !j[0].is_number()) return std::nullopt;
  return std::pair{j[0].get<double>(), j[1].is_number() ? j[1].get<double>() : std::numeric_limits<double>::infinity()};
}

// The facet "phase" is the whole of a wheel's phase; of walkers, whose phases are what a wheel's legs are, it is one of
// them, and the whole is "all".
analysis::BlindAnswer::ClaimedPlace claimed_place(const ordered_json& w) {
  const auto facet = w.at("facet").get<std::string>();
  const bool leg = facet == "phase" && w.value("at", "").starts_with("phase ");
  return {leg                               ? "leg"
          : facet == analysis::facet_of_all ? "phase"
                                            : facet,
          w.at("aspect").get<std::string>(), w.at("p_adjusted").get<double>()};
}

}  // namespace

std::string truth_json(const analysis::BlindTruth& truth, const std::string& salt) {
  ordered_json j;
  j["case"] = truth.number;
  j["kind"] = std::string(analysis::blind_kind_name(truth.kind));
  j["law"] = std::string(dynamics::law_name(truth.law));
  j["laboratory"] = truth.slope_deg ? "walkers" : truth.law == dynamics::Law::settled ? "second" : "first";
  if (truth.slope_deg) j["slope_deg"] = spread(*truth.slope_deg);
  j["effects"] = ordered_json::array();
  for (const dynamics::Effect& effect : truth.effects)
    j["effects"].push_back({{"id", effect.id}, {"values", effect.values}, {"text", dynamics::effect_text(effect)}});
  j["outside"] =
      truth.outside ? ordered_json{{"id", truth.outside->id}, {"size", truth.outside->size}} : ordered_json();
  j["strength"] = truth.strength;
  j["power"] = truth.power;
  j["power_left_after_recalibration"] = truth.left;
  if (truth.left_of_outside) j["power_left_of_outside"] = *truth.left_of_outside;
  j["collisions_counted"] = truth.collisions_counted;
  j["rests_counted"] = truth.rests_counted;
  j["nominal_is_true"] = truth.nominal_is_true;
  j["restitution"] = spread(truth.restitution);
  j["friction"] = spread(truth.friction);
  j["restitution_skewness"] = truth.skewness;
  j["sensor_noise_rad_s"] = truth.noise;
  j["seed"] = truth.seed;
  j["left_out"] = truth.left_out;
  j["salt"] = salt;
  return j.dump(1) + "\n";
}

analysis::BlindTruth read_truth(const std::string& file, std::string_view text) {
  try {
    const ordered_json j = ordered_json::parse(text);
    analysis::BlindTruth truth;
    truth.number = j.at("case").get<int>();
    truth.kind = analysis::blind_kind(j.at("kind").get<std::string>());
    truth.law = dynamics::law_from_name(j.value("law", "published"));
    if (j.contains("slope_deg")) truth.slope_deg = spread(j.at("slope_deg"));
    for (const ordered_json& effect : j.at("effects"))
      truth.effects.push_back({effect.at("id").get<std::string>(), effect.at("values").get<std::vector<double>>()});
    if (!j.at("outside").is_null())
      truth.outside = {j.at("outside").at("id").get<std::string>(), j.at("outside").at("size").get<double>()};
    truth.strength = j.at("strength").get<int>();
    truth.power = j.at("power").get<double>();
    truth.left = j.at("power_left_after_recalibration").get<double>();
    if (j.contains("power_left_of_outside")) truth.left_of_outside = j.at("power_left_of_outside").get<double>();
    truth.collisions_counted = j.value("collisions_counted", 0.0);
    truth.rests_counted = j.value("rests_counted", 0.0);
    truth.nominal_is_true = j.at("nominal_is_true").get<bool>();
    truth.restitution = spread(j.at("restitution"));
    truth.friction = spread(j.at("friction"));
    truth.skewness = j.at("restitution_skewness").get<double>();
    truth.noise = j.at("sensor_noise_rad_s").get<double>();
    truth.seed = j.at("seed").get<std::uint64_t>();
    truth.left_out = j.at("left_out").get<std::vector<std::string>>();
    return truth;
  } catch (const nlohmann::json::exception& error) {
    throw std::invalid_argument(fmt::format("{}: not a sealed truth: {}", file, error.what()));
  }
}

analysis::BlindAnswer read_answer(const std::string& file, std::string_view text) {
  try {
    const ordered_json j = ordered_json::parse(text);
    analysis::BlindAnswer answer;
    try {
      answer.verdict = analysis::verdict_from_name(j.at("verdict").get<std::string>());
    } catch (const std::invalid_argument& error) {
      throw std::invalid_argument(fmt::format("{}: {}", file, error.what()));
    }
    for (const ordered_json& cause : j.at("causes"))
      answer.causes.emplace_back(cause.at("effect").get<std::string>(), cause.at("probability").get<double>());
    answer.cause_set = j.at("cause_set").get<std::vector<std::string>>();
    if (!j.at("causes").empty()) {
      const ordered_json& first = j.at("causes").front();
      const ordered_json intervals = first.value("interval_90", ordered_json::object());
      for (const auto& [name, value] : first.at("parameters").items()) {
        if (!value.is_number()) continue;
        analysis::AnsweredParameter p{first.at("effect").get<std::string>(), name, value.get<double>(), {}, {}};
        if (intervals.contains(name) && intervals.at(name).is_array() && intervals.at(name).size() == 2 &&
            intervals.at(name)[0].is_number() && intervals.at(name)[1].is_number()) {
          p.lower = intervals.at(name)[0].get<double>();
          p.upper = intervals.at(name)[1].get<double>();
        }
        answer.parameters.push_back(std::move(p));
      }
    }
    if (j.contains("cause_set_alike")) answer.alike = j.at("cause_set_alike").get<std::vector<std::string>>();
    if (j.contains("at_work"))
      for (const ordered_json& one : j.at("at_work")) {
        const ordered_json closes =
            one.value("closes", ordered_json::object()).value("interval_90", ordered_json::object());
        answer.at_work.push_back({one.at("effects").get<std::vector<std::string>>(),
                                  one.at("probability").get<double>(), interval(closes.value("alone", ordered_json())),
                                  interval(closes.value("beside", ordered_json()))});
      }
    answer.p_unnamed = j.value("p_unnamed", 0.0);
    if (j.contains("steps_before_failure")) {
      const ordered_json& steps = j.at("steps_before_failure");
      const ordered_json machine = steps.value("machine", ordered_json::array());
      if (!machine.empty()) answer.steps = interval(machine.front().at("interval_90"));
      answer.steps_counted = interval(steps.value("observed_interval_90", ordered_json()));
    }
    if (j.contains("stepwise"))
      answer.stepwise = j.at("stepwise").get<std::map<std::string, std::vector<std::string>>>();
    for (const ordered_json& w : j.at("where")) answer.where.push_back(claimed_place(w));
    const ordered_json& shrinkage = j.at("shrinkage");
    const ordered_json interval = shrinkage.value("closed_interval_90", ordered_json());
    if (interval.is_array() && interval.size() == 2 && interval[0].is_number() && interval[1].is_number()) {
      answer.closed_lower = interval[0].get<double>();
      answer.closed_upper = interval[1].get<double>();
    }
    return answer;
  } catch (const nlohmann::json::exception& error) {
    throw std::invalid_argument(fmt::format("{}: not an answer of `diagnose --json`: {}", file, error.what()));
  }
}

}  // namespace metastable::reports
