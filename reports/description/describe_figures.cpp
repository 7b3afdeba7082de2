#include "reports/description/describe_figures.h"

#include <algorithm>

#include "reports/description/speed_cells.h"

namespace metastable::reports {

Figure profile_figure(const std::string& id, const std::string& title, const Provenance& provenance) {
  Figure figure;
  figure.id = id;
  figure.title = title;
  figure.x = {"collision", ""};
  figure.y = {"ω before a collision", "rad/s"};
  figure.legend = Legend::below;
  figure.provenance = provenance;
  return figure;
}

void add_profile(Figure& figure, const std::vector<analysis::SpeedSummary>& profile, const std::string& label,
                 int colour) {
  Series band{"", Style::band, {}, {}, {}, {}, colour}, line{label, Style::line, {}, {}, {}, {}, colour};
  for (std::size_t k = 0; k < profile.size(); ++k) {
    const analysis::SpeedSummary& s = profile[k];
    if (s.count < 2) continue;
    band.x.push_back(static_cast<double>(k + 1));
    band.lower.push_back(s.mean - s.standard_error);
    band.upper.push_back(s.mean + s.standard_error);
    line.x.push_back(static_cast<double>(k + 1));
    line.y.push_back(s.mean);
  }
  if (line.x.empty()) return;
  if (line.x.size() == 1) line.style = Style::points;  // where all rest at the second collision
  figure.series.push_back(std::move(band));
  figure.series.push_back(std::move(line));
}

Figure profiles_figure(const analysis::Description& description, const Provenance& provenance) {
  Figure figure = profile_figure("profiles", "Mean speed of the trials (band: standard error)", provenance);
  for (std::size_t i = 0; i < description.conditions.size(); ++i)
    add_profile(figure, description.conditions[i].profile, description.conditions[i].id, static_cast<int>(i));
  figure.reference_lines = {{true, 9, "first leg again"}};
  return figure;
}

std::optional<Figure> survival_curves_figure(const analysis::Description& description, const Provenance& provenance) {
  Figure figure;
  figure.id = "survival";
  figure.title = "Share of trials still rolling (Kaplan-Meier)";
  figure.x = {"steps n", ""};
  figure.y = {.label = "P(steps > n)", .low = 0.0, .high = 1.0};
  figure.legend = Legend::below;
  figure.provenance = provenance;
  for (std::size_t i = 0; i < description.conditions.size(); ++i) {
    const analysis::ConditionDescription& c = description.conditions[i];
    if (!c.survival) continue;
    Series band{"", Style::band, {}, {}, {}, {}, static_cast<int>(i)};
    Series line{c.id, Style::steps, {0}, {1}, {}, {}, static_cast<int>(i)};
    for (const analysis::SurvivalPoint& p : c.survival->curve) {
      const auto n = static_cast<double>(p.steps);
      line.x.push_back(n), line.y.push_back(p.survival);
      band.x.push_back(n), band.lower.push_back(p.lower), band.upper.push_back(p.upper);
    }
    figure.series.push_back(std::move(band));
    figure.series.push_back(std::move(line));
  }
  if (figure.series.empty()) return std::nullopt;
  return figure;
}

std::optional<Figure> measured_map_figure(const analysis::ConditionDescription& condition,
                                          const Provenance& provenance) {
  Figure figure;
  figure.id = "return-map-" + condition.id;
  for (char& c : figure.id)
    if (!(c >= 'a' && c <= 'z') && !(c >= 'A' && c <= 'Z') && !(c >= '0' && c <= '9')) c = '-';
  figure.title = "Return map of the trials, " + condition.id;
  figure.x = {"ω before a collision", "rad/s"};
  figure.y = {"ω before the next", "rad/s"};
  figure.diagonal = Diagonal::yes;
  figure.legend = Legend::top_left;
  figure.provenance = provenance;
  Series early{"up to the 12th", Style::dots, {}, {}, {}, {}, 0}, late{"from the 13th", Style::dots, {}, {}, {}, {}, 1};
  for (const std::vector<double>& trial : condition.speeds)
    for (std::size_t k = 0; k + 1 < trial.size(); ++k) {
      Series& series = static_cast<int>(k) + 1 < analysis::steady_collision ? early : late;
      series.x.push_back(trial[k]);
      series.y.push_back(trial[k + 1]);
    }
  for (Series* series : {&early, &late})
    if (!series->x.empty()) figure.series.push_back(std::move(*series));
  if (figure.series.empty()) return std::nullopt;
  return figure;
}

std::optional<Figure> legs_figure(const analysis::Description& description, const Provenance& provenance) {
  Figure figure;
  figure.id = "legs";
  figure.title = "Speed of the trials, leg by leg (bars: 95 %)";
  std::size_t legs = 0;
  figure.x = {"leg", ""};
  figure.y = {"ω before a collision", "rad/s"};
  figure.legend = Legend::below;
  figure.provenance = provenance;
  for (std::size_t i = 0; i < description.conditions.size(); ++i) {
    const analysis::ConditionDescription& c = description.conditions[i];
    if (!c.legs) continue;
    legs = std::max(legs, c.legs->size());
    Series series{c.id, Style::points, {}, {}, {}, {}, static_cast<int>(i)};
    for (std::size_t leg = 0; leg < c.legs->size(); ++leg) {
      const analysis::SpeedSummary& s = (*c.legs)[leg];
      if (s.count < 2) continue;
      // Conditions stand beside each other about the leg's place.
      series.x.push_back(static_cast<double>(leg) +
                         0.12 *
                             (static_cast<double>(i) - 0.5 * static_cast<double>(description.conditions.size() - 1)));
      const Estimate mean = mean_interval(s);
      series.y.push_back(mean.value);
      series.lower.push_back(mean.lower);
      series.upper.push_back(mean.upper);
    }
    if (!series.x.empty()) figure.series.push_back(std::move(series));
  }
  if (figure.series.empty()) return std::nullopt;
  figure.x.low = -0.5;
  figure.x.high = static_cast<double>(legs) - 0.5;
  return figure;
}

}  // namespace metastable::reports
