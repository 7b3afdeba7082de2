#include "reports/diagnosis/diagnosis_figures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string>

#include "analysis/statistics/interval_95.h"
#include "reports/diagnosis/diagnosis_tables.h"

namespace metastable::reports {
namespace {

using analysis::Diagnosis;
using analysis::GapCell;
using analysis::GapMap;

constexpr double full_colour = 6;  // score beyond which colours do not change
constexpr std::size_t bars_at_most = 12;
constexpr int given_colour = 1, recalibrated_colour = 4, effect_colour = 0, floor_colour = 6;

constexpr std::string_view stance_mark = ", stance", collision_mark = ", collision",
                           since_mark = " since the previous collision";

// The phase is in the figure's title.
std::string row_name(const GapCell& cell) {
  std::string name = cell.at;
  for (const std::string_view mark : {stance_mark, collision_mark, since_mark})
    if (const std::size_t at = name.rfind(mark); at != std::string::npos) name.erase(at, mark.size());
  if (cell.swing) return "largest swing with the time";
  return cell.facet == "phase" ? "all" : name;
}

struct ModelMap {
  std::string name;
  const GapMap* map;
};

// Draws cells of one phase as rows, models and aspects as columns.
Figure map_figure(const std::vector<ModelMap>& models, bool stances, const std::string& id, const std::string& title) {
  std::vector<std::string> rows;  // as the map orders them
  std::map<std::pair<std::string, std::size_t>, double> scores;
  std::vector<std::string> columns;
  for (const char* aspect : {"mean", "spread"})
    for (const ModelMap& model : models) {
      const std::size_t column = columns.size();
      columns.push_back(fmt::format("{}, {}", aspect, model.name));
      for (const GapCell& cell : model.map->cells) {
        if (cell.aspect != aspect || cell.stance != stances) continue;
        const std::string row = row_name(cell);
        if (std::find(rows.begin(), rows.end(), row) == rows.end()) rows.push_back(row);
        double& score = scores[{row, column}];
        if (!cell.swing || std::abs(cell.statistic) > std::abs(score)) score = cell.statistic;
      }
    }
  std::reverse(rows.begin(), rows.end());  // the first on top
  Figure figure{.id = id, .title = title, .x = {""}, .y = {""}};
  HeatMap map{.x = {},
              .y = {},
              .value = {},
              .label = "score (standard normal without a gap)",
              .digits = 1,
              .format = NumberFormat::fixed};
  map.limit = full_colour;
  map.x_names = columns;
  map.y_names = rows;
  for (std::size_t i = 0; i < columns.size(); ++i) map.x.push_back(static_cast<double>(i));
  for (std::size_t j = 0; j < rows.size(); ++j) {
    map.y.push_back(static_cast<double>(j));
    map.value.emplace_back();
    for (std::size_t i = 0; i < columns.size(); ++i) {
      const auto found = scores.find({rows[j], i});
      map.value.back().push_back(found == scores.end() ? std::numeric_limits<double>::quiet_NaN() : found->second);
    }
  }
  figure.heat_map = std::move(map);
  figure.width = 820;
  figure.height = 150 + 20 * static_cast<int>(rows.size());
  return figure;
}

}  // namespace

std::vector<Figure> map_figures(const Diagnosis& d) {
  if (d.gap.recalibrated.cells.empty()) return {};
  std::vector<ModelMap> models{{"as given", &d.gap.as_given}, {"recalibrated", &d.gap.recalibrated}};
  const bool with_effect = d.verdict == analysis::Verdict::explained || d.verdict == analysis::Verdict::unexplained;
  if (with_effect) models.push_back({"with effect", &d.gap.left});
  const bool two_phases = std::any_of(d.gap.recalibrated.cells.begin(), d.gap.recalibrated.cells.end(),
                                      [](const GapCell& cell) { return cell.stance; });
  std::vector<Figure> figures;
  figures.push_back(map_figure(models, false, "map-collisions", two_phases ? "Collisions" : "Steps"));
  if (two_phases) figures.push_back(map_figure(models, true, "map-stances", "Stances"));
  return figures;
}

std::vector<Figure> profile_figures(const Diagnosis& d) {
  std::vector<Figure> figures;
  for (std::size_t c = 0; c < d.data.condition_names.size(); ++c) {
    Series measured{.label = "measured", .style = Style::points, .x = {}, .y = {}, .colour = floor_colour};
    Series given{.label = "as given", .style = Style::dashed, .x = {}, .y = {}, .colour = given_colour};
    Series effect{.label = d.verdict == analysis::Verdict::explained ? "with effect" : "best model",
                  .style = Style::line,
                  .x = {},
                  .y = {},
                  .colour = effect_colour};
    Series band{.style = Style::band, .x = {}, .lower = {}, .upper = {}, .colour = effect_colour};
    for (const analysis::ProfilePoint& p : d.shrinkage.profile) {
      if (p.condition != c) continue;
      const double x = p.collision;
      measured.x.push_back(x), measured.y.push_back(p.measured);
      measured.lower.push_back(p.measured - analysis::normal_95 * p.measured_error);
      measured.upper.push_back(p.measured + analysis::normal_95 * p.measured_error);
      if (p.baseline > 0) given.x.push_back(x), given.y.push_back(p.baseline);
      if (!(p.with_effect > 0)) continue;
      effect.x.push_back(x), effect.y.push_back(p.with_effect);
      band.x.push_back(x);
      band.lower.push_back(p.with_effect - p.band), band.upper.push_back(p.with_effect + p.band);
    }
    if (measured.x.empty()) continue;
    Figure figure{.id = fmt::format("profile-{}", c + 1),
                  .title = d.data.condition_names[c],
                  .x = {.label = "collision", .low = measured.x.front() - 0.5, .high = measured.x.back() + 0.5},
                  .y = {"mean speed before it", "rad/s"}};
    for (Series* series : {&band, &given, &effect, &measured})
      if (!series->x.empty()) figure.series.push_back(std::move(*series));
    figure.legend = Legend::below;
    figures.push_back(std::move(figure));
  }
  return figures;
}

std::vector<Figure> ranking_figures(const Diagnosis& d) {
  std::vector<std::tuple<double, std::string, int>> all{{d.causes.p_no_gap, "no gap", floor_colour},
                                                        {d.causes.p_recalibrate, "recalibration", recalibrated_colour},
                                                        {d.causes.p_none, "none of these", given_colour}};
  for (const analysis::Cause& cause : d.causes.ranked) all.emplace_back(cause.probability, cause.name(), effect_colour);
  std::stable_sort(all.begin(), all.end(),
                   [](const auto& a, const auto& b) { return std::get<0>(a) > std::get<0>(b); });
  BarChart bars{.name = {}, .value = {}};
  for (const auto& [probability, name, colour] : all) {
    if (bars.name.size() == bars_at_most || (bars.name.size() >= 3 && probability < worded_probability)) break;
    bars.name.push_back(name);
    bars.value.push_back(probability);
    bars.colour.push_back(colour);
  }
  Figure figure{.id = "ranking", .title = "", .x = {.label = "probability", .low = 0, .high = 1.15}, .y = {""}};
  figure.height = 110 + 30 * static_cast<int>(bars.name.size());
  figure.bars = std::move(bars);
  return {figure};
}

std::vector<Figure> shrinkage_figures(const Diagnosis& d) {
  std::vector<Figure> figures;
  const double none = std::numeric_limits<double>::quiet_NaN();
  for (std::size_t i = 0; i < d.shrinkage.measures.size(); ++i) {
    const analysis::Shrinkage& s = d.shrinkage.measures[i];
    Figure figure{.id = fmt::format("shrinkage-{}", i + 1), .title = s.measure, .x = {"gap", s.unit}, .y = {""}};
    figure.bars = BarChart{.name = {"as given", "recalibrated", "with effect", "floor"},
                           .value = {s.baseline, s.recalibrated, s.with_effect, s.floor},
                           .lower = {s.baseline_lower, none, none, none},
                           .upper = {s.baseline_upper, none, none, none},
                           .colour = {given_colour, recalibrated_colour, effect_colour, floor_colour}};
    figure.reference_lines = {{.vertical = true, .at = s.floor, .label = ""}};
    figure.height = 250;
    figures.push_back(std::move(figure));
  }
  return figures;
}

}  // namespace metastable::reports
