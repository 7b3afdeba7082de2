#include "reports/description/paper_figures.h"

#include <fmt/format.h>

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

template <std::size_t Lines>
Figure panel(const std::string& id, const std::string& title,
             const std::array<analysis::StudiedProfile, Lines>& profiles, const Provenance& provenance) {
  Figure figure = profile_figure(id, title, provenance);
  for (std::size_t i = 0; i < Lines; ++i)
    add_profile(figure, profiles[i].profile, profiles[i].label, static_cast<int>(i));
  figure.reference_lines = {{true, 9, "first leg again"}};
  return figure;
}

}  // namespace

Figure fig4_experiment_figure(const analysis::PaperExperiments& experiments, const Provenance& provenance) {
  Figure figure = profile_figure(
      "fig4-experiment", experiments.stand_in ? "Stand-in (simulated), 9.59°" : "Experiment, 9.59°", provenance);
  add_profile(figure, analysis::speed_profile(experiments.fast_959), "fast start", 0);
  add_profile(figure, analysis::speed_profile(experiments.slow_959), "slow start", 1);
  figure.reference_lines = {{true, 9, "first leg again"}};
  return figure;
}

std::vector<Figure> fig4_figures(const VariantStudy& study, const Provenance& provenance) {
  return {panel(id_of("fig4-" + study.variant.name), study.variant.name + ", 9.59°", study.fig4, provenance)};
}

std::vector<Figure> fig6_figures(const VariantStudy& study, const analysis::PaperExperiments& experiments,
                                 const Provenance& provenance) {
  std::vector<Figure> figures;
  for (std::size_t j = 0; j < 4; ++j) {
    const std::string title = fmt::format("{}, μ = {:.2f}", study.variant.name, analysis::fig6_friction[j]);
    figures.push_back(panel(id_of(fmt::format("fig6-{}-{:.2f}", study.variant.name, analysis::fig6_friction[j])), title,
                            study.fig6[j], provenance));
    add_experiment(figures.back(), experiments);
  }
  return figures;
}

std::vector<Figure> fig7_figures(const VariantStudy& study, const analysis::PaperExperiments& experiments,
                                 const Provenance& provenance) {
  std::vector<Figure> figures;
  for (std::size_t j = 0; j < 4; ++j) {
    const std::string title = fmt::format("{}, sd of μ {:.2f}", study.variant.name, analysis::fig7_friction_sd[j]);
    figures.push_back(panel(id_of(fmt::format("fig7-{}-{:.2f}", study.variant.name, analysis::fig7_friction_sd[j])),
                            title, study.fig7[j], provenance));
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
  for (std::size_t k = 0; k < 4; ++k) {
    const double sd = 0.05 * static_cast<double>(k + 1);
    const auto add = [](Series& series, double x, const analysis::MeanSpread& spread) {
      series.x.push_back(x);
      series.y.push_back(spread.mean);
      series.lower.push_back(spread.mean - spread.sd);
      series.upper.push_back(spread.mean + spread.sd);
    };
    add(tangential, sd - 0.002, study.fig8[k].tangential_net);
    add(normal, sd + 0.002, study.fig8[k].normal);
  }
  figure.series = {std::move(tangential), std::move(normal)};
  return {figure};
}

std::vector<Figure> fig9_figures(const VariantStudy& study, const analysis::PaperExperiments& experiments,
                                 const Provenance& provenance) {
  std::vector<Figure> figures;
  for (std::size_t n = 0; n < 4; ++n) {
    const std::string title = fmt::format("{}, mean of μ {:.1f}", study.variant.name, analysis::fig9_friction[n]);
    figures.push_back(panel(id_of(fmt::format("fig9-{}-{:.1f}", study.variant.name, analysis::fig9_friction[n])), title,
                            study.fig9[n], provenance));
    add_experiment(figures.back(), experiments);
  }
  return figures;
}

}  // namespace metastable::reports
