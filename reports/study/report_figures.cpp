#include "reports/study/report_figures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "analysis/experiment/experiment_folder.h"
#include "dynamics/wheel/contact_law.h"
#include "markov/transition_rows/draws.h"

namespace metastable::reports {
namespace {

constexpr std::size_t survival_steps = 33;  // the paper's ramp
constexpr int cloud_trials = 150;
constexpr int cloud_collisions = 16;
constexpr std::size_t mean_draws = 1024;
constexpr std::size_t density_bins = 120;

int law_colour(dynamics::Law law) {
  switch (law) {
    case dynamics::Law::settled:
      return 0;
    case dynamics::Law::published:
      return 1;
    case dynamics::Law::coulomb:
      return 2;
    case dynamics::Law::plastic:
      break;
  }
  return 3;
}

// Returns dashes for every second ramp of the same law.
bool dashed(const std::vector<Studied>& settings, std::size_t i) {
  std::size_t before = 0;
  for (std::size_t j = 0; j < i; ++j) before += settings[j].study.setting->law == settings[i].study.setting->law;
  return before % 2 == 1;
}

// Cells carry mass over x = omega^2; spread evenly over equal bins of omega.
Series density(const analysis::Metastability& study, int colour) {
  double low = std::numeric_limits<double>::infinity(), high = 0;
  for (const analysis::PhaseDistribution& phase : study.survivors.by_phase) {
    low = std::min(low, std::sqrt(std::max(0.0, phase.edges.front())));
    high = std::max(high, std::sqrt(phase.edges.back()));
  }
  const double width = (high - low) / static_cast<double>(density_bins);
  std::vector<double> bins(density_bins, 0.0);
  for (const analysis::PhaseDistribution& phase : study.survivors.by_phase) {
    for (std::size_t c = 0; c < phase.mass.size(); ++c) {
      const double a = std::sqrt(std::max(0.0, phase.edges[c])), b = std::sqrt(phase.edges[c + 1]);
      const auto first = static_cast<std::size_t>(std::clamp((a - low) / width, 0.0, density_bins - 1.0));
      for (std::size_t k = first; k < density_bins && low + width * static_cast<double>(k) < b; ++k) {
        const double from = std::max(a, low + width * static_cast<double>(k));
        const double to = std::min(b, low + width * static_cast<double>(k + 1));
        if (to > from) bins[k] += phase.mass[c] * (to - from) / (b - a);
      }
    }
  }
  Series series{"", Style::line, {}, {}, {}, {}, colour};
  for (std::size_t k = 0; k < density_bins; ++k) {
    const double share = bins[k] / static_cast<double>(study.survivors.by_phase.size()) / width;
    if (share < 1e-6) continue;
    series.x.push_back(low + width * (static_cast<double>(k) + 0.5));
    series.y.push_back(share);
  }
  return series;
}

}  // namespace

Figure density_figure(const std::vector<Studied>& settings, const Provenance& provenance) {
  Figure figure;
  figure.id = "quasi-stationary";
  figure.title = "Speed before a collision, long run, by law and ramp";
  figure.x = {"ω before a collision", "rad/s"};
  figure.y = {"density", "s/rad"};
  figure.legend = Legend::below;
  figure.provenance = provenance;
  for (std::size_t i = 0; i < settings.size(); ++i) {
    const analysis::Setting& setting = *settings[i].study.setting;
    Series series = density(settings[i].study, law_colour(setting.law));
    if (dashed(settings, i)) series.style = Style::dashed;
    series.label = law_and_ramp(setting);
    figure.series.push_back(std::move(series));
  }
  return figure;
}

Figure survival_figure(const std::vector<Studied>& settings, const Provenance& provenance) {
  Figure figure;
  figure.id = "survival";
  figure.title = "Probability of still rolling, by law and ramp";
  figure.x = {"steps n", ""};
  figure.y = {.label = "P(steps > n)", .logarithmic = true, .high = 1.0};
  figure.legend = Legend::below;  // steep curves pass through every corner of the frame
  figure.height = 480;
  figure.provenance = provenance;
  std::set<dynamics::Law> never_rests;
  for (std::size_t i = 0; i < settings.size(); ++i) {
    const analysis::Setting& setting = *settings[i].study.setting;
    const bool endless = settings[i].study.status == analysis::Status::rest_unreachable;
    const bool everywhere = std::ranges::all_of(settings, [&](const Studied& other) {
      return other.study.setting->law != setting.law || other.study.status == analysis::Status::rest_unreachable;
    });
    // Curves that stay at one lie on each other: where a law never lets a wheel rest, one stands for all ramps.
    if (everywhere && !never_rests.insert(setting.law).second) continue;
    Series series{everywhere ? std::string(dynamics::law_name(setting.law)) : law_and_ramp(setting),
                  dashed(settings, i) ? Style::dashed_steps : Style::steps,
                  {},
                  {},
                  {},
                  {},
                  law_colour(setting.law)};
    if (endless) series.label += " (never rests)";
    const std::vector<double>& survival = settings[i].study.steps.survival;
    for (std::size_t n = 0; n < std::min(survival.size(), survival_steps); ++n) {
      series.x.push_back(static_cast<double>(n));
      series.y.push_back(survival[n]);
    }
    figure.series.push_back(std::move(series));
  }
  return figure;
}

Figure return_map_figure(const analysis::Setting& setting, const Provenance& provenance) {
  Figure figure;
  figure.id = fmt::format("return-map-{}", setting.slope_deg);
  std::replace(figure.id.begin(), figure.id.end(), '.', '-');
  figure.title = fmt::format("Return map, {}", law_and_ramp(setting));
  figure.x = {"ω before a collision", "rad/s"};
  figure.y = {"ω before the next", "rad/s"};
  figure.diagonal = Diagonal::yes;
  figure.legend = Legend::top_left;
  figure.provenance = provenance;

  Series cloud{"simulated steps", Style::dots, {}, {}, {}, {}, 0};
  double low = std::numeric_limits<double>::infinity(), high = 0;
  for (const dynamics::Trial& trial : analysis::simulate_trials(
           setting, {.trials = cloud_trials, .collisions = cloud_collisions, .seed = provenance.seed})) {
    for (std::size_t k = 0; k + 1 < trial.collisions.size(); ++k) {
      cloud.x.push_back(trial.collisions[k].omega_minus);
      cloud.y.push_back(trial.collisions[k + 1].omega_minus);
      low = std::min({low, cloud.x.back(), cloud.y.back()});
      high = std::max({high, cloud.x.back(), cloud.y.back()});
    }
  }
  figure.series.push_back(cloud);
  if (cloud.x.empty()) return figure;

  // This is the mean of sqrt(x') over the draws that survive, all legs together.
  const markov::AnyReturnMap map = setting.problem().map;
  const markov::Draws draws = markov::make_draws(
      map.noise_dimension(), {.count = mean_draws, .seed = provenance.seed, .weighting = markov::Weighting::plain});
  Series mean{"mean of the survivors", Style::line, {}, {}, {}, {}, 1};
  const auto dimension = static_cast<std::size_t>(draws.dimension);
  for (int i = 0; i <= 60; ++i) {
    const double omega = low + (high - low) * i / 60;
    double sum = 0, survivors = 0;
    for (int phase = 0; phase < map.phases(); ++phase)
      for (std::size_t k = 0; k < draws.count(); ++k)
        if (const auto next =
                map.landing(omega * omega, phase, std::span(draws.score).subspan(k * dimension, dimension))) {
          sum += std::sqrt(*next);
          survivors += 1;
        }
    if (survivors < 16) continue;
    mean.x.push_back(omega);
    mean.y.push_back(sum / survivors);
  }
  figure.series.push_back(std::move(mean));
  return figure;
}

Figure sensitivity_figure(const std::string& id, const Hanging& one, const Provenance& provenance) {
  Figure figure;
  figure.id = id;
  figure.title = law_and_ramp(one.setting);
  figure.x = {"change of the steps for 1 % more", "%"};
  figure.y = {""};
  figure.provenance = provenance;
  BarChart bars{.name = {}, .value = {}};
  for (const analysis::Sensitivity& s : one.sensitivities.ranked) {
    if (s.leg || s.value == 0) continue;
    const Estimate change = for_one_per_cent(s);
    bars.name.emplace_back(analysis::parameter_label(s.parameter));
    bars.value.push_back(change.value);
    bars.lower.push_back(change.lower);
    bars.upper.push_back(change.upper);
    bars.colour.push_back(law_colour(one.setting.law));
  }
  figure.height = 110 + 32 * static_cast<int>(bars.name.size());
  figure.bars = std::move(bars);
  return figure;
}

Figure grid_figure(const std::string& id, const std::string& title, const analysis::SweepAxis& down,
                   const analysis::SweepAxis& across, const std::vector<Estimate>& steps,
                   const std::pair<double, double>& scale, const Provenance& provenance) {
  Figure figure;
  figure.id = id;
  figure.title = title;
  figure.x = {std::string(analysis::parameter_label(across.parameter)), ""};
  figure.y = {std::string(analysis::parameter_label(down.parameter)), ""};
  figure.provenance = provenance;
  HeatMap map{across.values, down.values, {}, "expected steps", true};
  map.low = scale.first, map.high = scale.second;
  for (std::size_t i = 0; i < down.values.size(); ++i) {
    map.value.emplace_back();
    map.at_least.emplace_back();
    for (std::size_t j = 0; j < across.values.size(); ++j) {
      const Estimate& one = steps[i * across.values.size() + j];
      map.value.back().push_back(one.value);
      map.at_least.back().push_back(std::isfinite(one.value) && std::isinf(one.upper));
    }
  }
  figure.heat_map = std::move(map);
  return figure;
}

}  // namespace metastable::reports
