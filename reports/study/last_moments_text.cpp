#include "reports/study/last_moments_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "reports/output/text_table.h"

namespace metastable::reports {
namespace {

using analysis::Estimate;
using analysis::LastMoments;
using analysis::StepProfile;
using Json = nlohmann::ordered_json;

std::string step_name(std::size_t k) { return k == 0 ? "the one that fails" : fmt::format("{} before", k); }

// Numbers are those of the state, then those of the noise.
const Estimate& number_of(const StepProfile& profile, std::size_t i, std::size_t states) {
  return i < states ? profile.state[i] : profile.noise[i - states];
}

std::vector<Cell> profile_row(const std::string& name, const StepProfile& profile) {
  std::vector<Cell> row{name};
  for (const Estimate& one : profile.state) row.emplace_back(one);
  for (const Estimate& one : profile.noise) row.emplace_back(one);
  if (!std::isnan(profile.bound_to_fail)) row.emplace_back(profile.bound_to_fail);
  return row;
}

Json ends_json(const Estimate& e) { return std::isfinite(e.lower) ? Json{e.lower, e.upper} : Json(nullptr); }

Json spreads_json(const std::vector<std::string>& names, const std::vector<Estimate>& spreads,
                  const std::vector<analysis::SpreadIntervals>& known) {
  Json json = Json::object();
  for (std::size_t i = 0; i < names.size(); ++i) {
    json[names[i]] = {{"median", spreads[i].value}, {"middle_90", {spreads[i].lower, spreads[i].upper}}};
    if (known.empty()) continue;
    json[names[i]]["median_interval_95"] = ends_json(known[i].median);
    json[names[i]]["middle_90_intervals_95"] = {ends_json(known[i].low), ends_json(known[i].high)};
  }
  return json;
}

Json profile_json(const LastMoments& moments, const StepProfile& profile) {
  return {{"state", spreads_json(moments.state_names, profile.state, profile.state_95)},
          {"noise", spreads_json(moments.noise_names, profile.noise, profile.noise_95)},
          {"bound_to_fail", std::isnan(profile.bound_to_fail) ? Json(nullptr) : Json(profile.bound_to_fail)}};
}

std::string numbers(const std::vector<double>& values) { return fmt::format("{:.4g}", fmt::join(values, ", ")); }

// Says whether walks tell it, who do not know what they are bound to.
bool followed(const LastMoments& moments) { return std::isnan(moments.regime.bound_to_fail); }

// Lists the medians again, with the intervals that rounds give them.
Table medians_table(const LastMoments& moments) {
  Table table{
      .id = "last-steps-medians", .title = "The medians, with 95 % intervals from the rounds", .columns = {{"step"}}};
  for (const auto* names : {&moments.state_names, &moments.noise_names})
    for (const std::string& name : *names) table.columns.push_back({.name = name});
  const auto row = [](const std::string& name, const StepProfile& profile) {
    std::vector<Cell> cells{name};
    for (const auto* known : {&profile.state_95, &profile.noise_95})
      for (const analysis::SpreadIntervals& one : *known)
        if (!std::isfinite(one.median.lower))
          cells.emplace_back("not known");
        else if (one.median.lower == one.median.upper)
          cells.emplace_back(one.median.value);
        else
          cells.emplace_back(one.median);
    return cells;
  };
  for (std::size_t k = moments.last.size(); k-- > 0;) table.rows.push_back(row(step_name(k), moments.last[k]));
  table.rows.push_back(row("all steps of the regime", moments.regime));
  return table;
}

std::string phase_share(const LastMoments& moments, std::size_t p) {
  const std::string share = fmt::format("{:.3g} %", 100 * moments.by_phase[p]);
  if (moments.by_phase_95.empty() || !std::isfinite(moments.by_phase_95[p].lower)) return share;
  const Estimate& known = moments.by_phase_95[p];
  return fmt::format("{} ({:.3g} to {:.3g} %)", share, 100 * known.lower, 100 * known.upper);
}

std::string path_text(const LastMoments& moments, const std::string& phase) {
  std::vector<std::string> names = moments.state_names;
  names.insert(names.end(), moments.noise_names.begin(), moments.noise_names.end());
  std::string text =
      fmt::format("{} ({}):\n",
                  followed(moments) ? "Of the walks that failed, the one of least noise" : "The most likely last steps",
                  fmt::join(names, ", "));
  for (const analysis::PathStep& step : moments.likeliest) {
    const std::string leg = moments.by_phase.size() > 1 ? fmt::format("{} {}: ", phase, step.phase) : "";
    const std::string met = step.noise.empty() ? "" : " meets " + numbers(step.noise);
    text += fmt::format("  {}{}{}\n", leg, numbers(step.state), met);
  }
  return text;
}

}  // namespace

Table last_moments_table(const LastMoments& moments, const std::string& id, const std::string& where,
                         const Provenance& provenance) {
  Table table{.id = id,
              .title = where.empty() ? "How it fails: the last steps" : "The last steps, " + where,
              .notes = {"Medians with the middle 90 % of what a step begins with and meets."},
              .columns = {{"step"}},
              .provenance = provenance};
  for (const auto* names : {&moments.state_names, &moments.noise_names})
    for (const std::string& name : *names) table.columns.push_back({.name = name, .level = 90});
  if (!followed(moments)) {
    table.notes[0] +=
        " Bound to fail: the mean chance of failing before being back in the middle of the metastable regime.";
    table.columns.push_back({.name = "bound to fail", .digits = 2});
  }
  for (std::size_t k = moments.last.size(); k-- > 0;) table.rows.push_back(profile_row(step_name(k), moments.last[k]));
  table.rows.push_back(profile_row("all steps of the regime", moments.regime));
  return table;
}

std::size_t telling_number(const LastMoments& moments) {
  std::size_t most = 0;
  double furthest = 0;
  const std::size_t states = moments.state_names.size();
  for (std::size_t i = 0; i < states + moments.noise_names.size(); ++i) {
    const Estimate &last = number_of(moments.last.front(), i, states), &all = number_of(moments.regime, i, states);
    const double shift = all.upper > all.lower ? std::abs(last.value - all.value) / (all.upper - all.lower) : 0;
    if (shift > furthest) most = i, furthest = shift;
  }
  return most;
}

std::string last_moments_sentence(const LastMoments& moments) {
  const std::size_t states = moments.state_names.size(), i = telling_number(moments);
  const DecimalEstimate last = to_decimal(number_of(moments.last.front(), i, states), NumberFormat::general, 3),
                        all = to_decimal(number_of(moments.regime, i, states), NumberFormat::general, 3);
  std::string name = i < states ? moments.state_names[i] : moments.noise_names[i - states], unit;
  if (const std::size_t at = name.find(" ["); at != std::string::npos) {
    unit = " " + name.substr(at + 2, name.size() - at - 3);
    name.resize(at);
  }
  return fmt::format("the step that fails {} a {} of {}{} (middle 90 %: {} to {}), all steps of {}{} ({} to {})",
                     i < states ? "begins with" : "meets", name, plain_text(last.value), unit, plain_text(last.lower),
                     plain_text(last.upper), plain_text(all.value), unit, plain_text(all.lower), plain_text(all.upper));
}

std::string last_moments_text(const LastMoments& moments, const std::string& phase, std::size_t width) {
  if (!moments.reason.empty()) return "How it fails is not told: " + moments.reason + ".\n";
  std::string text = to_text(last_moments_table(moments, "last-steps", "", {}), 1000, width);
  if (!moments.regime.state_95.empty()) text += "\n" + to_text(medians_table(moments), 1000, width) + "\n";
  if (moments.by_phase.size() > 1) {
    std::string shares;
    for (std::size_t p = 0; p < moments.by_phase.size(); ++p)
      shares += fmt::format("{}{} {} {}", p == 0 ? "" : ", ", phase, p, phase_share(moments, p));
    text += wrapped("The step that fails begins with " + shares + ".", "  ", width);
  }
  return text + path_text(moments, phase);
}

std::string last_moments_json(const LastMoments& moments) {
  if (!moments.reason.empty()) return Json{{"reason", moments.reason}}.dump();
  Json last = Json::array(), path = Json::array();
  for (std::size_t k = 0; k < moments.last.size(); ++k) {
    last.push_back(profile_json(moments, moments.last[k]));
    last.back()["steps_before_the_last"] = k;
  }
  for (const analysis::PathStep& step : moments.likeliest)
    path.push_back({{"phase", step.phase}, {"state", step.state}, {"noise", step.noise}});
  Json json{{"last_steps", last},
            {"regime", profile_json(moments, moments.regime)},
            {"by_phase", moments.by_phase},
            {"most_likely_path", path}};
  if (!moments.by_phase_95.empty()) {
    json["by_phase_intervals_95"] = Json::array();
    for (const Estimate& share : moments.by_phase_95) json["by_phase_intervals_95"].push_back(ends_json(share));
  }
  return json.dump();
}

std::vector<Figure> last_moments_figures(const LastMoments& moments, const std::string& id, const std::string& where,
                                         const Provenance& provenance) {
  std::vector<Figure> figures;
  const auto add = [&](const std::string& name, const auto& of) {
    Figure figure;
    figure.id = fmt::format("{}-{}", id, figures.size() + 1);
    figure.title = "Before it fails, " + where;
    figure.x = {"steps before the one that fails"};
    figure.x.low = -static_cast<double>(moments.last.size() - 1);
    figure.x.high = 0.0;
    figure.y = {name};
    figure.legend = Legend::below;
    figure.height = 410;
    figure.provenance = provenance;
    Series band{"", Style::band, {}, {}, {}, {}, 1}, line{"median and middle 90 %", Style::line, {}, {}, {}, {}, 1};
    for (std::size_t k = moments.last.size(); k-- > 0;) {
      const Estimate& one = of(moments.last[k]);
      for (Series* series : {&band, &line}) series->x.push_back(-static_cast<double>(k));
      band.lower.push_back(one.lower);
      band.upper.push_back(one.upper);
      line.y.push_back(one.value);
    }
    figure.series = {band, line};
    const Estimate& regime = of(moments.regime);
    for (const double level : {regime.lower, regime.value, regime.upper}) {
      Series usual{level == regime.value ? "the same of all steps" : "", Style::dashed, line.x, {}, {}, {}, 0};
      usual.y.assign(line.x.size(), level);
      figure.series.push_back(std::move(usual));
    }
    figures.push_back(std::move(figure));
  };
  for (std::size_t i = 0; i < moments.state_names.size(); ++i)
    add(moments.state_names[i], [i](const StepProfile& p) { return p.state[i]; });
  for (std::size_t i = 0; i < moments.noise_names.size(); ++i)
    add(moments.noise_names[i], [i](const StepProfile& p) { return p.noise[i]; });
  return figures;
}

}  // namespace metastable::reports
