#include "reports/study/splitting_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
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

Json ends_or_null(const markov::MeshEstimate& e) {
  return std::isfinite(e.lower) ? Json{e.lower, e.upper} : Json(nullptr);
}

// Returns the steps after which survival is told in words: about a tenth of those expected, as many, and three times
// as many, to one figure.
std::vector<std::uint64_t> told_steps(const markov::SplittingStudy& s) {
  std::vector<std::uint64_t> told;
  for (const double times : {0.1, 1.0, 3.0}) {
    const double steps = std::max(1.0, times * s.steps.value), unit = std::pow(10, std::floor(std::log10(steps)));
    const double rounded = std::round(steps / unit) * unit;
    if (!(rounded < 1e18)) continue;
    const auto whole = static_cast<std::uint64_t>(std::llround(rounded));
    if (told.empty() || told.back() != whole) told.push_back(whole);
  }
  return told;
}

Json survival_after_json(const markov::SplittingStudy& s) {
  Json json = Json::array();
  for (const std::uint64_t steps : told_steps(s)) {
    const markov::MeshEstimate share = markov::survival_after(s, steps);
    if (std::isfinite(share.value))
      json.push_back({{"steps", steps}, {"share", share.value}, {"interval_95", ends_or_null(share)}});
  }
  return json;
}

Lines survival_lines(const markov::SplittingStudy& s) {
  Lines lines;
  for (const std::uint64_t steps : told_steps(s)) {
    const markov::MeshEstimate share = markov::survival_after(s, steps);
    if (!std::isfinite(share.value)) continue;
    lines.emplace_back(
        fmt::format("still walking after {:.6g} step{}", static_cast<double>(steps), steps == 1 ? "" : "s"),
        std::isfinite(share.lower) ? estimate_text(share)
        : share.value > 0.5        ? "not told: too few rounds have seen a failure by then"
                                   : "not told: too few rounds have seen a survivor by then");
  }
  return lines;
}

const char* split_by(const markov::SplittingStudy& s) {
  switch (s.split_by) {
    case markov::SplitBy::nothing:
      return "nothing";
    case markov::SplitBy::given:
      return "given";
    case markov::SplitBy::learnt:
      return "learnt";
    case markov::SplitBy::mesh:
      return "mesh";
  }
  return "";
}

Json study_json(const markov::SplittingStudy& s) {
  Json survival = {1.0}, known = {Json{1.0, 1.0}};
  for (const markov::MeshEstimate& share : s.survival)
    survival.push_back(share.value), known.push_back(ends_or_null(share));
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
  return {{"expected_steps", steps},
          {"failure_rate_per_step", rate},
          {"survival", survival},
          {"survival_interval_95", known},
          {"survival_after", survival_after_json(s)},
          {"mixing_steps", mixing},
          {"rounds", s.rounds},
          {"steps_of_a_round", s.round_steps},
          {"rates_of_rounds", s.rates},
          {"split_by", split_by(s)},
          {"lines_to_failure", s.lines},
          {"steps_of_the_map", s.calls}};
}

std::string split_by_in_words(const markov::SplittingStudy& s) {
  switch (s.split_by) {
    case markov::SplitBy::nothing:
      return "nothing: failures are frequent";
    case markov::SplitBy::given:
      return "the level function that is given";
    case markov::SplitBy::learnt:
      return "the chance of failing soon, learnt";
    case markov::SplitBy::mesh:
      return fmt::format("the chance of failing within {} steps, of a mesh of {} nodes", s.level_window, s.level_nodes);
  }
  return "";
}

Lines effort_lines(const markov::SplittingStudy& s) {
  return {{"split by", split_by_in_words(s)},
          {"rounds", fmt::format("{} of {} steps", s.rounds, s.round_steps)},
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
  for (auto& line : survival_lines(s)) lines.push_back(std::move(line));
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
