#include "reports/study/splitting_text.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "reports/study/last_moments_text.h"
#include "reports/study/walker_text.h"

namespace metastable::reports {
namespace {

using Json = nlohmann::ordered_json;
using Lines = std::vector<std::pair<std::string, std::string>>;

Json interval_json(const markov::MeshEstimate& e) { return {{"value", e.value}, {"interval_95", {e.lower, e.upper}}}; }

Json study_json(const markov::SplittingStudy& s) {
  Json survival = {1.0};
  for (const double share : s.survival) survival.push_back(share);
  Json steps = interval_json(s.steps), rate, mixing;
  steps["from_quasi_stationary"] = nullptr;
  steps["from_quasi_stationary_interval_95"] = nullptr;
  if (!s.all_failed) {
    const markov::MeshEstimate regime = markov::steps_from_quasi_stationary(s);
    steps["from_quasi_stationary"] = regime.value;
    steps["from_quasi_stationary_interval_95"] = {regime.lower, regime.upper};
    rate = interval_json(s.failure_rate);
    mixing = s.mixing_steps;
  }
  return {{"expected_steps", steps},    {"failure_rate_per_step", rate},
          {"survival", survival},       {"mixing_steps", mixing},
          {"rounds", s.rounds},         {"steps_of_a_round", s.round_steps},
          {"rates_of_rounds", s.rates}, {"lines_to_failure", s.lines},
          {"steps_of_the_map", s.calls}};
}

Lines effort_lines(const markov::SplittingStudy& s) {
  return {{"rounds", fmt::format("{} of {} steps", s.rounds, s.round_steps)},
          {"independent lines to failure", fmt::format("{:.3g}", s.lines)},
          {"steps of the map", fmt::format("{:.3g}, {:.3g} of them to learn what to split by",
                                           static_cast<double>(s.calls), static_cast<double>(s.pilot_calls))}};
}

Lines steps_lines(const markov::SplittingStudy& s) {
  Lines lines{{"expected steps before failure", estimate_text(s.steps)}};
  if (!s.all_failed)
    lines.emplace_back("  from the metastable regime", estimate_text(markov::steps_from_quasi_stationary(s)));
  return lines;
}

Lines lines_of(const SplittingAnswer& answer) {
  const markov::SplittingStudy& s = answer.passage;
  Lines lines = steps_lines(s);
  lines.emplace_back("status", s.all_failed
                                   ? "all walks were followed to failure: they fail before the start is forgotten"
                                   : "by splitting: the rounds agree");
  if (!answer.no_mesh.empty()) lines.emplace_back("no mesh", answer.no_mesh);
  if (!s.all_failed) {
    lines.emplace_back("failure rate per step", estimate_text(s.failure_rate));
    lines.emplace_back("mixing", fmt::format("{:.3g} steps", s.mixing_steps));
  }
  for (auto& line : effort_lines(s)) lines.push_back(std::move(line));
  return lines;
}

std::string joined(const Lines& lines) {
  std::string text;
  for (const auto& [name, what] : lines) text += fmt::format("  {:<38}{}\n", name, what);
  return text;
}

}  // namespace

std::string splitting_json(const SplittingAnswer& answer, const std::optional<analysis::LastMoments>& moments,
                           const Provenance& provenance) {
  Json json = {{"setting", answer.name},
               {"method", "splitting"},
               {"status", answer.passage.all_failed ? "all_failed" : "rounds_agree"}};
  json["no_mesh"] = answer.no_mesh.empty() ? Json(nullptr) : Json(answer.no_mesh);
  json.update(study_json(answer.passage));
  if (moments) json["how_it_fails"] = Json::parse(last_moments_json(*moments));
  json["provenance"] = {{"command", provenance.command},
                        {"settings", provenance.settings},
                        {"seed", provenance.seed},
                        {"version", provenance.version}};
  return json.dump(2) + "\n";
}

std::string splitting_text(const SplittingAnswer& answer, const std::optional<analysis::LastMoments>& moments,
                           std::size_t width) {
  const std::string text = answer.name + "\n\n" + joined(lines_of(answer));
  return moments ? text + "\n" + last_moments_text(*moments, "phase", width) : text;
}

Table splitting_table(const SplittingAnswer& answer, const Provenance& provenance) {
  Table table{.id = "steps", .title = answer.name, .columns = {{"quantity"}, {"value"}}, .provenance = provenance};
  for (const auto& [what, value] : lines_of(answer)) table.rows.push_back({what, value});
  return table;
}

std::string with_splitting_json(const std::string& mesh_json, const SplittingAnswer& beside) {
  Json json = Json::parse(mesh_json);
  json["splitting"] =
      beside.no_splitting.empty() ? study_json(beside.passage) : Json{{"no_number", beside.no_splitting}};
  return json.dump(2) + "\n";
}

std::string with_splitting_text(const std::string& mesh_text, const SplittingAnswer& beside) {
  if (!beside.no_splitting.empty()) return mesh_text + "\nBeside it, no number: " + beside.no_splitting + "\n";
  Lines lines = steps_lines(beside.passage);
  for (auto& line : effort_lines(beside.passage)) lines.push_back(std::move(line));
  return mesh_text + "\nBeside it, by splitting (agreed: within the joint interval)\n" + joined(lines);
}

}  // namespace metastable::reports
