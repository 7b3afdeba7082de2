#include "reports/study/walker_figures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <tuple>

namespace metastable::reports {
namespace {

constexpr std::size_t most_survival_points = 200;
constexpr double most_of = 0.9;  // of the regime, or of the last steps

Cell estimate_cell(const markov::MeshEstimate& e) { return Estimate{e.value, e.lower, e.upper}; }

/// Finds the points with the largest weights that hold together `most_of` them.
std::vector<std::size_t> heaviest(const std::vector<analysis::SectionPoint>& points,
                                  double analysis::SectionPoint::*weight) {
  std::vector<std::size_t> order(points.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](auto a, auto b) { return points[a].*weight > points[b].*weight; });
  double all = 0, held = 0;
  for (const analysis::SectionPoint& point : points) all += point.*weight;
  std::size_t count = 0;
  while (count < order.size() && held < most_of * all) held += points[order[count++]].*weight;
  order.resize(count);
  return order;
}

// Rates go with angles: their ratio spreads what would else lie along one line.
void add_state(Series& series, const std::vector<double>& state) {
  series.x.push_back(state[0]);
  series.y.push_back(state[1] / state[0]);
}

// Shows which states near the plane of the section are bound to fall, in three classes.
std::vector<Series> basin_series(const analysis::WalkerFalls& falls) {
  const auto near_plane = [&falls](const analysis::SectionPoint& point) {
    return std::all_of(point.place.begin() + 2, point.place.end(),
                       [&falls](double u) { return std::abs(u) <= 0.75 * falls.spacing; });
  };
  struct Class {
    const char* label;
    double low, high;
    int colour;
  };
  std::vector<Series> all;
  for (const Class& of : {Class{"recovers (falls first: below 10 %)", 0, 0.1, 2}, Class{"10 to 90 %", 0.1, 0.9, 4},
                          Class{"bound to fall (above 90 %)", 0.9, 2, 1}}) {
    Series series{of.label, Style::dots, {}, {}, {}, {}, of.colour};
    for (const analysis::SectionPoint& point : falls.section)
      if (near_plane(point) && point.state[0] > 0 && point.bound_to_fail >= of.low && point.bound_to_fail < of.high)
        add_state(series, point.state);
    if (!series.x.empty()) all.push_back(std::move(series));
  }
  return all;
}

// Shows where most steps begin, and most of the last ones.
std::vector<Series> density_series(const std::vector<analysis::SectionPoint>& points) {
  std::vector<Series> all;
  for (const auto& [label, colour, weight] :
       {std::tuple("90 % of the last steps before a fall", 1, &analysis::SectionPoint::last),
        std::tuple("90 % of all steps", 0, &analysis::SectionPoint::regime)}) {
    Series series{label, Style::dots, {}, {}, {}, {}, colour};
    for (const std::size_t i : heaviest(points, weight))
      if (points[i].state[0] > 0) add_state(series, points[i].state);
    all.push_back(std::move(series));
  }
  return all;
}

Series path_series(const analysis::LastMoments& moments) {
  Series path{"most likely last steps", Style::line, {}, {}, {}, {}, 6};
  for (const analysis::PathStep& step : moments.likeliest) add_state(path, step.state);
  return path;
}

// Cuts an axis to twice the range of the series.
void cut_axis(FigureAxis& axis, const std::vector<Series>& all, std::vector<double> Series::*values) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const Series& series : all)
    for (const double value : series.*values) {
      low = std::min(low, value);
      high = std::max(high, value);
    }
  axis.low = low - 0.5 * (high - low);
  axis.high = high + 0.5 * (high - low);
}

// Draws the series, and the most likely last steps over them.
Figure section_figure(const StudiedWalker& walker, const std::string& id, const std::string& title,
                      std::vector<Series> series, const Provenance& provenance) {
  Figure figure;
  figure.id = id;
  figure.title = fmt::format("{}: {}", title, walker_label(walker));
  figure.x = {walker.falls.moments.state_names[0]};
  figure.y = {"stance rate / half angle"};
  figure.series = std::move(series);
  figure.series.push_back(path_series(walker.falls.moments));
  figure.legend = Legend::below;
  figure.height = 470;
  figure.provenance = provenance;
  return figure;
}

}  // namespace

std::string walker_label(const StudiedWalker& walker) {
  return fmt::format("{}, {:.4g} deg, sd {:.4g} deg", analysis::walker_name(walker.setting.walker),
                     walker.setting.slope_deg, walker.setting.slope_sd_deg);
}

std::string walker_sentence(const StudiedWalker& walker) {
  const markov::MeshEstimate& steps = walker.study.passage.steps;
  const DecimalEstimate e = to_decimal(Estimate{steps.value, steps.lower, steps.upper}, NumberFormat::significant, 3);
  return fmt::format(
      "On {:.4g} deg, {:.4g} deg rough, the {} walker falls after {} steps on average (95 % interval {} to {}).",
      walker.setting.slope_deg, walker.setting.slope_sd_deg, analysis::walker_name(walker.setting.walker),
      plain_text(e.value), plain_text(e.lower), plain_text(e.upper));
}

std::string eigenvalues_text(const std::vector<std::complex<double>>& eigenvalues) {
  std::string all;
  for (std::size_t i = 0; i < eigenvalues.size(); ++i) {
    const auto& value = eigenvalues[i];
    if (!all.empty()) all += ", ";
    if (value.imag() == 0) {
      all += fmt::format("{:.4f}", value.real());
    } else {
      all += fmt::format("{:.4f} ± {:.4f} i", value.real(), std::abs(value.imag()));
      ++i;  // its conjugate
    }
  }
  return all;
}

Table walkers_table(const std::vector<StudiedWalker>& columns, const Provenance& provenance) {
  Table table{.id = "walkers",
              .title = "Walkers on rough ground",
              .notes = {"Lengths of the simplest walker are in legs, its times in sqrt(leg / g). Guided sampling and "
                        "direct simulation are independent of the mesh, and stand beside it where they reach."},
              .columns = {{"quantity"}},
              .provenance = provenance};
  for (const StudiedWalker& walker : columns) table.columns.push_back({.name = walker_label(walker), .digits = 4});
  const auto row = [&](const std::string& name, const auto& cell) {
    table.rows.push_back({name});
    for (const StudiedWalker& walker : columns) table.rows.back().push_back(cell(walker));
  };
  row("expected steps before failure", [](const auto& w) { return estimate_cell(w.study.passage.steps); });
  const auto other = [](const std::optional<markov::MeshEstimate>& e) { return e ? estimate_cell(*e) : Cell(""); };
  row("  by guided sampling", [&](const auto& w) { return other(w.study.passage.guided); });
  row("  by direct simulation", [&](const auto& w) { return other(w.study.passage.simulated); });
  row("failure rate a step", [](const auto& w) { return estimate_cell(w.study.passage.failure_rate); });
  row("mixing [steps]", [](const auto& w) { return Cell(w.study.passage.mixing_steps); });
  row("gait: half angle [rad]", [](const auto& w) { return Cell(fmt::format("{:.9f}", w.study.gait.state[0])); });
  row("gait: eigenvalues", [](const auto& w) { return Cell(eigenvalues_text(w.study.gait.eigenvalues)); });
  return table;
}

Table meshes_table(const StudiedWalker& walker, const std::string& id, const Provenance& provenance) {
  Table table{.id = id,
              .title = fmt::format("Meshes of the walker {}", walker_label(walker)),
              .notes = {"Steps come out low on coarse meshes, smoothly in the square of the spacing; each random shift "
                        "of the nodes is extrapolated to spacing 0 by itself."},
              .columns = {{"spacing", "sd"}, {"nodes"}, {"entries"}, {"steps, lowest shift"}, {"steps, highest shift"}},
              .provenance = provenance};
  for (const markov::MeshSize& size : walker.study.passage.sizes) {
    const auto [low, high] = std::minmax_element(size.steps.begin(), size.steps.end());
    table.rows.push_back({size.spacing, size.nodes, size.entries, *low, *high});
  }
  return table;
}

Figure walker_survival_figure(const std::vector<StudiedWalker>& walkers, const Provenance& provenance) {
  Figure figure;
  figure.id = "walker-survival";
  figure.title = "Probability of still walking, by walker";
  figure.x = {.label = "steps n", .logarithmic = true};
  figure.y = {.label = "P(steps > n)", .low = 0.0, .high = 1.0};
  figure.legend = Legend::below;
  figure.provenance = provenance;
  for (const StudiedWalker& walker : walkers) {
    const markov::MeshStudy& study = walker.study.passage;
    Series line{walker_label(walker), Style::line, {}, {}};
    const double last = 6 * study.steps.value;
    for (std::size_t i = 0; i <= most_survival_points; ++i) {
      const double n = std::floor(std::pow(last, static_cast<double>(i) / most_survival_points));
      if (!line.x.empty() && n <= line.x.back()) continue;
      line.x.push_back(n);
      line.y.push_back(markov::survival_after(study, static_cast<std::uint64_t>(n)).value);
    }
    figure.series.push_back(std::move(line));
  }
  return figure;
}

std::vector<Figure> section_figures(const StudiedWalker& walker, const std::string& id, const Provenance& provenance) {
  Figure basin = section_figure(walker, id + "-basin", "Basin and failure", basin_series(walker.falls), provenance);
  Figure density =
      section_figure(walker, id + "-density", "Where steps begin", density_series(walker.falls.section), provenance);
  // What lies far from where steps begin says nothing: the basin is cut to twice their range.
  cut_axis(basin.x, density.series, &Series::x);
  cut_axis(basin.y, density.series, &Series::y);
  return {basin, density};
}

}  // namespace metastable::reports
