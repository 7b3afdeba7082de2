#include "reports/description/stopping_pages.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace metastable::reports {
namespace {

using analysis::Stopping;
using analysis::StoppingLeg;

constexpr double shown_sds = 3.5;
constexpr int density_points = 80, density_colour = 4, others_colour = 6;  // of the palette (figure.cpp)

// Draws the density of mu as a hill on the bottom of a figure.
Series density(const Stopping& stopping, double bottom, double top) {
  const auto [mean, sd] = stopping.setting.friction;
  Series hill{fmt::format("density of μ ~ N({}, {}²)", mean, sd), Style::band, {}, {}, {}, {}, density_colour};
  for (int i = 0; i <= density_points; ++i) {
    const double z = shown_sds * (2.0 * i / density_points - 1);
    hill.x.push_back(mean + z * sd);
    hill.lower.push_back(bottom);
    hill.upper.push_back(bottom + (top - bottom) * std::exp(-0.5 * z * z));
  }
  return hill;
}

FigureAxis friction_axis(const Stopping& stopping) {
  const auto [mean, sd] = stopping.setting.friction;
  return {"friction μ of the landing", "", false, mean - shown_sds * sd, mean + shown_sds * sd};
}

const StoppingLeg& leg_of(const Stopping& stopping, int leg) { return stopping.legs.at(static_cast<std::size_t>(leg)); }

double share(int part, int whole) { return whole > 0 ? static_cast<double>(part) / whole : 0; }

double mean_speed(const Stopping& stopping) {
  double sum = 0;
  for (const StoppingLeg& leg : stopping.legs) sum += leg.speed * leg.landings;
  return stopping.landings() > 0 ? sum / stopping.landings() : 0;
}

Figure over_density(const std::string& id, const std::string& title, FigureAxis y, const Stopping& stopping,
                    const Provenance& provenance) {
  Figure figure;
  figure.id = id;
  figure.title = title;
  figure.x = friction_axis(stopping);
  figure.y = std::move(y);
  figure.legend = Legend::below;
  figure.height = 500;
  figure.provenance = provenance;
  return figure;
}

}  // namespace

std::string stopping_story(const Stopping& s) {
  const StoppingLeg &least = leg_of(s, s.curves.front().leg), &most = leg_of(s, s.curves.back().leg);
  return fmt::format(
      "A foot that lands sticks if μ ≥ μ_c = d h/(J/M + h²), d being its distance ahead of the hub and h the hub's "
      "height; above μ_c the landing does not depend on μ. A leg that lands after a shorter one reaches further ahead "
      "of a lower hub: leg {} ({:+.1f} mm against the leg before it) needs {:.3f}, leg {} ({:+.1f} mm) {:.3f}, so that "
      "{:.0f} and {:.0f} % of their landings slide. The less friction a sliding foot has, the more its impact takes of "
      "the spin (the first one leaves ω+/ω− = 1 − (1 + η) c (d − μ h)/(J/M + d² − μ d h), c being the chord between "
      "the feet), and below μ_r the wheel no longer passes over it. μ_r falls with the speed ω−: a wheel that one "
      "slide "
      "has slowed down stops more easily at the next. Steady wheels touch at {:.2f} rad/s, where μ_r is {:.3f} for leg "
      "{} and {:.3f} for leg {}: {:.0f} % of the {} rests rolled are on leg {}, with {:.0f} % of the landings. Rest is "
      "thus a tail of μ: what moves μ_r or the mean of μ by a few per cent multiplies the steps (last table).",
      most.leg, 1e3 * most.longer, most.sticking, least.leg, 1e3 * least.longer, least.sticking, 100 * most.slides,
      100 * least.slides, mean_speed(s), most.resting, most.leg, least.resting, least.leg,
      100 * share(most.rests, s.rests()), s.rests(), most.leg, 100 * share(most.landings, s.landings()));
}

Figure sticking_figure(const Stopping& stopping, const Provenance& provenance) {
  Figure figure = over_density("stopping-sticking", "Friction below which a foot slides, μ_c (settled)",
                               {"longer than the leg before it", "mm"}, stopping, provenance);
  double low = 0, high = 0;
  for (const StoppingLeg& leg : stopping.legs) {
    low = std::min(low, 1e3 * leg.longer);
    high = std::max(high, 1e3 * leg.longer);
  }
  figure.y.low = low - 0.2, figure.y.high = high + 0.4;
  figure.series = {density(stopping, *figure.y.low, *figure.y.high - 0.2)};
  Series others{"other legs", Style::points, {}, {}, {}, {}, others_colour};
  for (const StoppingLeg& leg : stopping.legs) {
    const auto shown = std::ranges::find(stopping.curves, leg.leg, &analysis::RestingCurve::leg);
    if (shown == stopping.curves.end()) {
      others.x.push_back(leg.sticking);
      others.y.push_back(1e3 * leg.longer);
      continue;
    }
    const auto colour = static_cast<int>(shown - stopping.curves.begin());
    figure.series.push_back({fmt::format("leg {}: {:.0f} % of its landings slide", leg.leg, 100 * leg.slides),
                             Style::points,
                             {leg.sticking},
                             {1e3 * leg.longer},
                             {},
                             {},
                             colour});
  }
  if (!others.x.empty()) figure.series.push_back(std::move(others));
  return figure;
}

Figure resting_figure(const Stopping& stopping, const Provenance& provenance) {
  Figure figure = over_density(
      "stopping-resting",
      fmt::format("Friction below which the wheel stops, μ_r, η = {} (settled)", stopping.setting.restitution.mean),
      {"speed before the landing, ω−", "rad/s"}, stopping, provenance);
  double low = 100, high = 0;
  for (const analysis::RestingCurve& curve : stopping.curves) {
    low = std::min(low, *std::ranges::min_element(curve.speed));
    high = std::max(high, *std::ranges::max_element(curve.speed));
  }
  low = std::floor(4 * low) / 4 - 0.25;
  figure.y.low = low, figure.y.high = high;
  figure.series = {density(stopping, low, high - 0.3)};
  for (std::size_t k = 0; k < stopping.curves.size(); ++k) {
    const analysis::RestingCurve& curve = stopping.curves[k];
    const auto colour = static_cast<int>(k);
    const double sticking = leg_of(stopping, curve.leg).sticking;
    figure.series.push_back({fmt::format("leg {}: stops left of the line", curve.leg),
                             Style::line,
                             curve.friction,
                             curve.speed,
                             {},
                             {},
                             colour});
    figure.series.push_back({k == 0 ? "dashed: μ_c, the foot slides left of it" : "",
                             Style::dashed,
                             {sticking, sticking},
                             {curve.speed.front(), high},
                             {},
                             {},
                             colour});
  }
  figure.reference_lines = {{false, mean_speed(stopping), "steady"}};
  return figure;
}

Table stopping_table(const Stopping& stopping, const Provenance& provenance) {
  Table table{.id = "stopping",
              .title = "Where the wheel stops under settled, leg by leg",
              .columns = {{"leg"},
                          {"longer than the leg before it", "mm", NumberFormat::fixed, 1},
                          {"μ_c", "", NumberFormat::fixed, 4},
                          {"landings that slide", "%", NumberFormat::fixed, 0},
                          {"steady ω−", "rad/s", NumberFormat::fixed, 2},
                          {"μ_r there", "", NumberFormat::fixed, 4},
                          {"landings that rest", "%", NumberFormat::fixed, 2},
                          {"share of the rests", "%", NumberFormat::fixed, 0}},
              .provenance = provenance};
  for (const StoppingLeg& leg : stopping.legs)
    table.rows.push_back({leg.leg, 1e3 * leg.longer, leg.sticking, 100 * leg.slides, leg.speed, leg.resting,
                          100 * share(leg.rests, leg.landings), 100 * share(leg.rests, stopping.rests())});
  table.notes = {
      fmt::format("{}. μ_r at the mean of η; rests counted in {} landings rolled from the 13th collision on, "
                  "no end of the ramp.",
                  stopping.setting.describe(), stopping.landings())};
  return table;
}

Table design_table(const std::vector<analysis::DesignChange>& changes, const Provenance& provenance) {
  Table table{.id = "designs",
              .title = "What a designer changes to walk longer, under settled",
              .columns = {{"change"}, {"from"}, {"to"}, {"expected steps"}, {"times as many"}},
              .provenance = provenance};
  for (const analysis::DesignChange& change : changes)
    table.rows.push_back({change.what, change.from, change.to, change.steps, change.times});
  table.notes = {
      fmt::format("Expected steps before failure from the launch, no end of the ramp, each with the one "
                  "change: {}. Wheels rolled with the same random numbers.",
                  changes.empty() ? std::string() : changes.front().setting.describe())};
  return table;
}

}  // namespace metastable::reports
