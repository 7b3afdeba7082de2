#include "reports/description/paper_figures.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>
#include <utility>

#include "reports/description/describe_figures.h"

namespace metastable::reports {
namespace {

using analysis::VariantStudy;

std::string id_of(const std::string& text) {
  std::string id;
  for (const char c : text) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9');
    if (plain || (!id.empty() && id.back() != '-')) id += plain ? c : '-';
  }
  return id;
}

constexpr int black = 6;  // of the palette (figure.cpp)

void add_experiment(Figure& figure, const analysis::PaperExperiments& experiments) {
  add_profile(figure, analysis::speed_profile(experiments.fast_702),
              experiments.stand_in ? "stand-in (simulated)" : "experiment", black);
  // The first 16 collisions are the paper's.
  figure.x.low = 0;
  figure.x.high = 16.5;
}

// Begins a map with a column a variant.
Figure variants_map(const std::string& id, const std::string& title, const std::vector<VariantStudy>& studies,
                    const Provenance& provenance) {
  Figure figure{.id = id, .title = title, .x = {""}, .y = {""}, .provenance = provenance};
  figure.heat_map = HeatMap{.x = {}, .y = {}, .value = {}, .label = ""};
  for (const VariantStudy& study : studies) {
    figure.heat_map->x.push_back(static_cast<double>(figure.heat_map->x.size()));
    figure.heat_map->x_names.push_back(study.variant.name);
  }
  figure.width = 640;
  figure.height = 130;
  return figure;
}

// Adds a row above those that are there.
void add_row(Figure& figure, const std::string& name, std::vector<double> values) {
  constexpr int row_height = 30;  // [px]
  HeatMap& map = *figure.heat_map;
  map.y.push_back(static_cast<double>(map.y.size()));
  map.y_names.push_back(name);
  map.value.push_back(std::move(values));
  figure.height += row_height;
}

Figure panel(const std::string& id, const std::string& title,
             const std::vector<const analysis::StudiedProfile*>& profiles, const Provenance& provenance) {
  Figure figure = profile_figure(id, title, provenance);
  int colour = 0;
  for (const analysis::StudiedProfile* profile : profiles)
    add_profile(figure, profile->profile, profile->label, colour++);
  figure.reference_lines = {{true, 9, "first leg again"}};
  constexpr int lines_above = 2, legend_line = 24;  // whose legend a figure of the usual height has room for; [px]
  figure.height += legend_line * std::max(static_cast<int>(profiles.size()) + 1 - lines_above, 0);
  return figure;
}

// Draws the lines of one panel.
template <class Runs, class Run>
std::vector<const analysis::StudiedProfile*> lines(const Runs& runs, analysis::StudiedProfile Run::*profile) {
  std::vector<const analysis::StudiedProfile*> all;
  for (const Run& run : runs) all.push_back(&(run.*profile));
  return all;
}

}  // namespace

Figure claims_figure(const std::vector<analysis::Claim>& claims, const std::vector<VariantStudy>& studies,
                     const Provenance& provenance) {
  constexpr double right = -1, half = -0.5, wrong = 1;  // blue, pale blue and red; white is an empty cell's
  Figure figure =
      variants_map("claims-reproduced", "The paper's claims, under each law and reading", studies, provenance);
  HeatMap& map = *figure.heat_map;
  map.digits = 0;
  map.limit = wrong;
  map.scale_names = {{right, "reproduced"}, {half, "partly"}, {wrong, "not reproduced"}};
  for (auto claim = claims.rbegin(); claim != claims.rend(); ++claim) {
    std::vector<double> row;
    for (std::size_t v = 0; v < studies.size(); ++v) {
      const analysis::ClaimVerdict verdict = claim->findings.at(v).verdict;
      row.push_back(verdict == analysis::ClaimVerdict::reproduced       ? right
                    : verdict == analysis::ClaimVerdict::partly         ? half
                    : verdict == analysis::ClaimVerdict::not_reproduced ? wrong
                                                                        : std::numeric_limits<double>::quiet_NaN());
    }
    add_row(figure, claim->brief.empty() ? claim->where : claim->brief, std::move(row));
  }
  return figure;
}

Figure hypotheses_figure(const std::vector<analysis::Hypothesis>& hypotheses, const std::vector<VariantStudy>& studies,
                         const Provenance& provenance) {
  Figure figure = variants_map("hypotheses-shares", "Share of the steady speed's variance", studies, provenance);
  HeatMap& map = *figure.heat_map;
  map.digits = 2;
  map.format = NumberFormat::fixed;
  map.label = "total index";
  map.low = 0, map.high = 1;
  const std::map<std::string, std::string> sources{
      {"H1", "H1: launch speed"}, {"H2", "H2: leg lengths"}, {"H3", "H3: restitution, friction"}};
  for (auto h = hypotheses.rbegin(); h != hypotheses.rend(); ++h) {
    const auto source = sources.find(h->name);
    add_row(figure, source == sources.end() ? h->name : source->second, h->shares);
  }
  return figure;
}

Figure fig4_experiment_figure(const analysis::PaperExperiments& experiments, const Provenance& provenance) {
  Figure figure = profile_figure(
      "fig4-experiment", experiments.stand_in ? "Stand-in (simulated), 9.59°" : "Experiment, 9.59°", provenance);
  add_profile(figure, analysis::speed_profile(experiments.fast_959), "fast start", 0);
  add_profile(figure, analysis::speed_profile(experiments.slow_959), "slow start", 1);
  figure.reference_lines = {{true, 9, "first leg again"}};
  return figure;
}

std::vector<Figure> fig4_figures(const VariantStudy& study, const Provenance& provenance) {
  return {panel(id_of("fig4-" + study.variant.name), study.variant.name + ", 9.59°",
                {&study.fig4.fast, &study.fig4.slow}, provenance)};
}

std::vector<Figure> fig6_figures(const VariantStudy& study, const analysis::PaperExperiments& experiments,
                                 const Provenance& provenance) {
  std::vector<Figure> figures;
  for (const analysis::LaunchPanel& of : study.fig6) {
    const std::string title = fmt::format("{}, μ = {:.2f}", study.variant.name, of.friction);
    figures.push_back(panel(id_of(fmt::format("fig6-{}-{:.2f}", study.variant.name, of.friction)), title,
                            lines(of.runs, &analysis::LaunchRun::measured_legs), provenance));
    add_experiment(figures.back(), experiments);
  }
  return figures;
}

std::vector<Figure> fig7_figures(const VariantStudy& study, const analysis::PaperExperiments& experiments,
                                 const Provenance& provenance) {
  std::vector<Figure> figures;
  for (const analysis::SpreadPanel& of : study.fig7) {
    const std::string title = fmt::format("{}, sd of μ {:.2f}", study.variant.name, of.friction_sd);
    figures.push_back(panel(id_of(fmt::format("fig7-{}-{:.2f}", study.variant.name, of.friction_sd)), title,
                            lines(of.runs, &analysis::SpreadRun::profile), provenance));
    add_experiment(figures.back(), experiments);
  }
  return figures;
}

std::vector<Figure> fig8_figures(const VariantStudy& study, const Provenance& provenance) {
  Figure figure;
  figure.id = id_of("fig8-" + study.variant.name);
  figure.title = study.variant.name + ": loss of a collision, mean ± sd";
  figure.x = {"sd of η and μ", ""};
  figure.y = {"energy lost", "J"};
  figure.legend = Legend::below;
  figure.provenance = provenance;
  Series tangential{"tangential, net", Style::points, {}, {}, {}, {}, 0},
      normal{"normal", Style::points, {}, {}, {}, {}, 1};
  for (const auto& [sd, losses] : study.fig8) {
    const auto add = [](Series& series, double x, const analysis::MeanSpread& spread) {
      series.x.push_back(x);
      series.y.push_back(spread.mean);
      series.lower.push_back(spread.mean - spread.sd);
      series.upper.push_back(spread.mean + spread.sd);
    };
    add(tangential, sd - 0.002, losses.tangential_net);
    add(normal, sd + 0.002, losses.normal);
  }
  figure.series = {std::move(tangential), std::move(normal)};
  return {figure};
}

std::vector<Figure> fig9_figures(const VariantStudy& study, const analysis::PaperExperiments& experiments,
                                 const Provenance& provenance) {
  std::vector<Figure> figures;
  for (const analysis::MeanPanel& of : study.fig9) {
    const std::string title = fmt::format("{}, mean of μ {:.1f}", study.variant.name, of.friction);
    figures.push_back(panel(id_of(fmt::format("fig9-{}-{:.1f}", study.variant.name, of.friction)), title,
                            lines(of.runs, &analysis::MeanRun::profile), provenance));
    add_experiment(figures.back(), experiments);
  }
  return figures;
}

}  // namespace metastable::reports
