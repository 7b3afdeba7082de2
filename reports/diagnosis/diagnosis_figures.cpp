#include "reports/diagnosis/diagnosis_figures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <optional>
#include <string>

#include "analysis/statistics/interval_95.h"
#include "reports/diagnosis/diagnosis_tables.h"

namespace metastable::reports {
namespace {

using analysis::Diagnosis;
using analysis::GapCell;
using analysis::GapMap;

constexpr double full_colour = 6;  // score beyond which colours do not change
constexpr std::size_t bars_at_most = 8;
constexpr std::size_t letters_of_a_line = 28;  // They take half of a figure's width.
constexpr std::size_t most_return_maps = 6;
constexpr std::size_t furthest_rows = 8, least_rows = 3, most_rows = 14;  // of one figure
// A place is shown alone where its score is beyond this: of some hundred that are chance, one in three maps has such
// one.
constexpr double telling = 3;
constexpr int shrinkage_height = 250, least_width = 520, scale_width = 110, cell_width = 70, letter_width = 8,
              row_height = 30;  // [px]
constexpr int given_colour = 1, recalibrated_colour = 4, effect_colour = 0, floor_colour = 6;

constexpr std::string_view stance_mark = ", stance", collision_mark = ", collision",
                           since_mark = " since the previous collision";

// The phase is in the figure's title.
std::string row_name(const GapCell& cell) {
  std::string name = cell.at;
  for (const std::string_view mark : {stance_mark, collision_mark, since_mark})
    if (const std::size_t at = name.rfind(mark); at != std::string::npos) {
      const std::size_t end = at + mark.size();  // a column's name may begin with the word
      if (end == name.size() || name[end] == ' ' || name[end] == ',') name.erase(at, mark.size());
    }
  if (cell.swing) return "largest swing with the time";
  return cell.of_all() ? "all" : name;
}

struct ModelMap {
  std::string name;
  const GapMap* map;
};

// Lists the models that the map is told under.
std::vector<ModelMap> models_of(const Diagnosis& d) {
  std::vector<ModelMap> models{{"as given", &d.gap.as_given}, {"recalibrated", &d.gap.recalibrated}};
  if (analysis::is_gap(d.verdict)) models.push_back({"with effect", &d.gap.left});
  return models;
}

bool two_phases(const Diagnosis& d) {
  return std::ranges::any_of(d.gap.recalibrated.cells, [](const GapCell& cell) { return cell.stance; });
}

// One line of a map's figure: the cells of one place, of all aspects and models.
struct Row {
  std::string facet, name, phase;  // phase: "" where there is one
  std::vector<double> scores;      // a column each; NaN: no such cell
};

// Finds how far a row's scores of one aspect are from 0 at most. @param columns  of the aspect, from the first
double furthest(const Row& row, std::size_t first, std::size_t columns) {
  double most = 0;
  for (std::size_t i = first; i < first + columns; ++i)
    if (!std::isnan(row.scores[i])) most = std::max(most, std::abs(row.scores[i]));
  return most;
}

// Lists rows as the map orders them; columns are aspects by models.
std::vector<Row> rows_of(const Diagnosis& d, std::vector<std::string>& columns) {
  const std::vector<ModelMap> models = models_of(d);
  const bool phases = two_phases(d);
  std::vector<Row> rows;
  for (const char* aspect : {"mean", "spread"})
    for (const ModelMap& model : models) columns.push_back(fmt::format("{}, {}", aspect, model.name));
  for (std::size_t m = 0; m < models.size(); ++m)
    for (const GapCell& cell : models[m].map->cells) {
      if (cell.aspect != "mean" && cell.aspect != "spread") continue;
      const std::string name = row_name(cell), phase = !phases ? "" : cell.stance ? "stance" : "collision";
      auto row = std::ranges::find_if(rows, [&](const Row& r) { return r.name == name && r.phase == phase; });
      if (row == rows.end())
        row = rows.insert(rows.end(), {cell.facet, name, phase,
                                       std::vector<double>(columns.size(), std::numeric_limits<double>::quiet_NaN())});
      double& score = row->scores[m + (cell.aspect == "spread" ? models.size() : 0)];
      if (std::isnan(score) || !cell.swing || std::abs(cell.statistic) > std::abs(score)) score = cell.statistic;
    }
  return rows;
}

// Draws the rows, the first on top, in letters one can read. @param digits  behind the points of the scores in the
// cells; 0: colours alone
Figure map_figure(const std::vector<Row>& rows, const std::vector<std::string>& columns, const std::string& id,
                  const std::string& title, bool with_phase, int digits) {
  Figure figure{.id = id, .title = title, .x = {""}, .y = {""}};
  HeatMap map{.x = {}, .y = {}, .value = {}, .label = "score", .digits = digits, .format = NumberFormat::fixed};
  map.limit = full_colour;
  map.x_names = columns;
  for (std::size_t i = 0; i < columns.size(); ++i) map.x.push_back(static_cast<double>(i));
  for (auto row = rows.rbegin(); row != rows.rend(); ++row) {
    map.y.push_back(static_cast<double>(map.y.size()));
    map.y_names.push_back(with_phase && !row->phase.empty() ? row->name + ", " + row->phase : row->name);
    map.value.push_back(row->scores);
  }
  std::size_t longest = 0;
  for (const std::string& name : map.y_names) longest = std::max(longest, name.size());
  figure.heat_map = std::move(map);
  figure.width = std::max(least_width, scale_width + cell_width * static_cast<int>(columns.size()) +
                                           letter_width * static_cast<int>(longest));
  figure.height = 140 + row_height * static_cast<int>(rows.size());
  return figure;
}

// Draws the places where one aspect tells most. @param first  its first column of the rows
std::optional<Figure> furthest_figure(std::vector<Row> rows, const std::vector<ModelMap>& models, std::size_t first,
                                      const std::string& id, std::string title, std::size_t least) {
  const auto far = [&](const Row& row) { return furthest(row, first, models.size()); };
  std::ranges::stable_sort(rows, [&](const Row& a, const Row& b) { return far(a) > far(b); });
  const auto beyond =
      static_cast<std::size_t>(std::ranges::count_if(rows, [&](const Row& r) { return far(r) > telling; }));
  rows.resize(std::min({rows.size(), furthest_rows, std::max(beyond, least)}));
  if (rows.empty()) return std::nullopt;
  std::vector<std::string> columns;
  for (const ModelMap& model : models) columns.push_back(model.name);
  for (Row& row : rows)
    row.scores = {row.scores.begin() + static_cast<std::ptrdiff_t>(first),
                  row.scores.begin() + static_cast<std::ptrdiff_t>(first + models.size())};
  const bool mixed = std::ranges::any_of(rows, [&](const Row& row) { return row.phase != rows.front().phase; });
  if (!mixed && !rows.front().phase.empty()) title += fmt::format(", {}s", rows.front().phase);
  return map_figure(rows, columns, id, title, mixed, 1);
}

// Draws the means of one condition and column, collision by collision. @param points  one or more
Figure profile_figure(const Diagnosis& d, const std::vector<analysis::ProfilePoint>& points) {
  Series measured{.label = "measured", .style = Style::points, .x = {}, .y = {}, .colour = floor_colour};
  Series given{.label = "as given", .style = Style::dashed, .x = {}, .y = {}, .colour = given_colour};
  Series effect{.label = d.verdict == analysis::Verdict::explained ? "with effect" : "best model",
                .style = Style::line,
                .x = {},
                .y = {},
                .colour = effect_colour};
  Series band{.style = Style::band, .x = {}, .lower = {}, .upper = {}, .colour = effect_colour};
  for (const analysis::ProfilePoint& p : points) {
    const double x = p.collision;
    measured.x.push_back(x), measured.y.push_back(p.measured);
    measured.lower.push_back(p.measured - analysis::normal_95 * p.measured_error);
    measured.upper.push_back(p.measured + analysis::normal_95 * p.measured_error);
    if (std::isfinite(p.baseline)) given.x.push_back(x), given.y.push_back(p.baseline);
    if (!std::isfinite(p.with_effect)) continue;
    effect.x.push_back(x), effect.y.push_back(p.with_effect);
    band.x.push_back(x);
    band.lower.push_back(p.with_effect - p.band), band.upper.push_back(p.with_effect + p.band);
  }
  Figure figure{.id = {},
                .title = {},
                .x = {.label = d.data.step_name, .low = measured.x.front() - 0.5, .high = measured.x.back() + 0.5},
                .y = of_speeds(d) ? FigureAxis{"mean speed before it", "rad/s"}
                     : d.model    ? FigureAxis{"mean " + d.model->columns()[points.front().column].name}
                                  : FigureAxis{"mean"}};
  for (Series* series : {&band, &given, &effect, &measured})
    if (!series->x.empty()) figure.series.push_back(std::move(*series));
  figure.legend = Legend::below;
  return figure;
}

}  // namespace

std::vector<Figure> closes_figures(const Diagnosis& d) {
  BarChart bars{.name = {}, .value = {}};
  const auto add = [&](const std::string& name, const std::optional<Estimate>& share, int colour) {
    if (!share || bars.name.size() >= bars_at_most) return;
    bars.name.push_back(name);
    bars.value.push_back(100 * share->value);
    bars.lower.push_back(100 * share->lower);
    bars.upper.push_back(100 * share->upper);
    bars.colour.push_back(colour);
  };
  for (const analysis::AtWork& one : d.causes.at_work) {
    if (one.probability < worded_probability) continue;
    add(one.name + ", alone", one.closes_alone, effect_colour);
    add(one.name + ", last", one.closes_beside, recalibrated_colour);
  }
  if (bars.name.empty()) return {};
  Figure figure{.id = "closes", .title = "What each effect closes", .x = {"share of the held-out gap", "%"}, .y = {""}};
  figure.height = std::max(130 + 30 * static_cast<int>(bars.name.size()), shrinkage_height);
  figure.bars = std::move(bars);
  return {figure};
}

std::vector<Figure> return_map_figures(const Diagnosis& d) {
  if (of_speeds(d)) return {};
  const auto simulated = d.model->simulate(analysis::nominal_values(*d.model), {}, 1);
  const auto columns = d.model->columns();
  std::vector<Figure> figures;
  for (std::size_t c = 0; c < columns.size() && c < most_return_maps; ++c) {
    Series drawn{.label = "simulated, as given", .style = Style::dots, .x = {}, .y = {}, .colour = given_colour};
    Series mended{
        .label = d.verdict == analysis::Verdict::explained ? "simulated, with effect" : "simulated, best model",
        .style = Style::dots,
        .x = {},
        .y = {},
        .colour = recalibrated_colour};
    Series measured{.label = "measured", .style = Style::dots, .x = {}, .y = {}, .colour = effect_colour};
    const auto fill = [&](const analysis::TransitionModel& model, Series& series) {
      const analysis::Event* before = nullptr;
      for (const analysis::Event& event : model.events()) {
        if (event.column != c || event.kind != analysis::EventKind::step) continue;
        if (before && before->trial == event.trial && before->number + 1 == event.number &&
            std::isfinite(before->speed) && std::isfinite(event.speed)) {
          series.x.push_back(before->speed);
          series.y.push_back(event.speed);
        }
        before = &event;
      }
    };
    fill(*simulated, drawn);
    if (d.shrinkage.drawn_with_effect) fill(*d.shrinkage.drawn_with_effect, mended);
    fill(*d.model, measured);
    if (measured.x.empty()) continue;
    Figure figure{.id = fmt::format("return-map-{}", c + 1),
                  .title = columns[c].name,
                  .x = {"this step", columns[c].unit},
                  .y = {"next step", columns[c].unit}};
    for (Series* series : {&drawn, &mended, &measured})
      if (!series->x.empty()) figure.series.push_back(std::move(*series));
    figure.diagonal = Diagonal::yes;
    figure.legend = Legend::below;
    figures.push_back(std::move(figure));
  }
  return figures;
}

std::vector<Figure> furthest_figures(const Diagnosis& d) {
  std::vector<std::string> columns;
  const std::vector<Row> rows = rows_of(d, columns);
  const std::vector<ModelMap> models = models_of(d);
  std::vector<Figure> figures;
  if (auto mean = furthest_figure(rows, models, 0, "map-furthest", of_speeds(d) ? "Mean speed" : "Mean", least_rows))
    figures.push_back(std::move(*mean));
  if (auto spread = furthest_figure(rows, models, models.size(), "map-furthest-spread",
                                    of_speeds(d) ? "Spread of the speed" : "Spread", 0))
    figures.push_back(std::move(*spread));
  return figures;
}

std::vector<Figure> map_figures(const Diagnosis& d) {
  std::vector<std::string> columns;
  const std::vector<Row> all = rows_of(d, columns);
  std::vector<Figure> figures;
  const std::vector<std::string> phases =
      two_phases(d) ? std::vector<std::string>{"collision", "stance"} : std::vector<std::string>{""};
  for (const std::string& phase : phases) {
    const std::string name = phase.empty() ? "steps" : phase + "s";
    std::vector<Row> rows;
    std::vector<std::string> facets;
    int part = 0;
    const auto draw = [&] {
      if (rows.empty()) return;
      const std::string id = "map-" + name;  // of the first part; then map-stances-2, ...
      figures.push_back(map_figure(rows, columns, ++part == 1 ? id : fmt::format("{}-{}", id, part),
                                   fmt::format("The map of {}: {}", name, fmt::join(facets, ", ")), false, 0));
      rows.clear(), facets.clear();
    };
    // A facet's rows stay together.
    for (std::size_t from = 0; from < all.size();) {
      std::size_t to = from;
      std::vector<Row> facet;
      for (; to < all.size() && all[to].facet == all[from].facet; ++to)
        if (all[to].phase == phase) facet.push_back(all[to]);
      if (rows.size() + facet.size() > most_rows) draw();
      if (!facet.empty()) facets.push_back(all[from].facet);
      rows.insert(rows.end(), facet.begin(), facet.end());
      from = to;
    }
    draw();
  }
  return figures;
}

std::vector<Figure> profile_figures(const Diagnosis& d) {
  const std::size_t columns = d.model ? d.model->columns().size() : 1;
  std::vector<Figure> figures;
  for (std::size_t c = 0; c < d.data.condition_names.size(); ++c)
    for (std::size_t column = 0; column < columns; ++column) {
      std::vector<analysis::ProfilePoint> points;
      std::ranges::copy_if(d.shrinkage.profile, std::back_inserter(points),
                           [&](const analysis::ProfilePoint& p) { return p.condition == c && p.column == column; });
      if (points.empty()) continue;
      Figure figure = profile_figure(d, points);
      figure.id = fmt::format("profile-{}", figures.size() + 1);
      figure.title = d.data.condition_names[c];
      if (columns > 1)
        figure.title = d.data.condition_names.size() > 1 ? figure.title + ", " + figure.y.label : figure.y.label;
      figures.push_back(std::move(figure));
    }
  return figures;
}

namespace {

// Breaks the name of a set of effects into lines that leave room for the bars.
std::string in_lines(const std::string& name) {
  std::string all;
  std::size_t line = 0;  // where the last one begins
  for (std::size_t from = 0; from < name.size();) {
    const std::size_t plus = name.find('+', from), to = plus == std::string::npos ? name.size() : plus + 1;
    if (from > 0 && all.size() - line + to - from > letters_of_a_line) {
      all += '\n';
      line = all.size();
    }
    all += name.substr(from, to - from);
    from = to;
  }
  return all;
}

}  // namespace

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
    bars.name.push_back(in_lines(name));
    bars.value.push_back(probability);
    bars.colour.push_back(colour);
  }
  std::ptrdiff_t lines = 0;  // of the bar that has most
  for (const std::string& name : bars.name) lines = std::max(lines, 1 + std::ranges::count(name, '\n'));
  Figure figure{.id = "ranking", .title = "Causes", .x = {.label = "probability", .low = 0, .high = 1.15}, .y = {""}};
  figure.height = std::max(130 + static_cast<int>((10 + 21 * lines) * std::ssize(bars.name)), shrinkage_height);
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
    figure.height = shrinkage_height;
    figures.push_back(std::move(figure));
  }
  return figures;
}

}  // namespace metastable::reports
