#include "reports/study/report_tables.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string_view>

#include "dynamics/wheel/contact_law.h"
#include "reports/output/known_cell.h"

namespace metastable::reports {
namespace {

// Holds a quantity, with its unit, and its number in a study.
struct Quantity {
  std::string name, unit;
  std::function<Cell(const Studied&)> of;
};

Cell mean_cell(const std::optional<analysis::Accumulated>& total) {
  return total ? Cell(total->mean) : Cell(Infinite{});
}

const std::vector<Quantity>& quantities() {
  using S = const Studied&;
  static const std::vector<Quantity> all = {
      {"expected steps before failure, from the launch", "steps",
       [](S s) { return estimate_cell(s.study.steps.from_start); }},
      {"the same from the metastable regime", "steps",
       [](S s) { return estimate_cell(s.study.steps.from_quasi_stationary); }},
      {"the same from the worst start", "steps", [](S s) { return estimate_cell(s.study.steps.worst_start); }},
      {"standard deviation of the steps", "steps", [](S s) { return Cell(s.study.steps.distribution.sd); }},
      {"median of the steps", "steps",
       [](S s) {
         const std::optional<double> median = s.study.steps.distribution.quantile(0.5);
         return median ? Cell(*median) : Cell(Infinite{});
       }},
      {"mean time to failure", "s", [](S s) { return mean_cell(s.study.steps.seconds); }},
      {"mean distance to failure", "m", [](S s) { return mean_cell(s.study.steps.metres); }},
      {"failure rate per step, 1 − λ₁", "1", [](S s) { return Cell(s.study.spectrum.failure_rate.value); }},
      {"mixing, spectral", "steps", [](S s) { return Cell(s.study.spectrum.mixing_steps); }},
      {"mixing from the launch, total variation", "steps",
       [](S s) {
         return s.study.spectrum.total_variation_steps ? Cell(*s.study.spectrum.total_variation_steps) : Cell("");
       }},
      {"reaches the end of the ramp", "1", [](S s) { return known_cell(s.study.steps.reach_end); }},
      {"speed before a collision, long-run mean", "rad/s", [](S s) { return known_cell(s.study.survivors.mean); }},
      {"its standard deviation", "rad/s", [](S s) { return known_cell(s.study.survivors.sd); }},
      {"the same mean with a new launch after each rest", "rad/s",
       [](S s) { return known_cell(s.study.survivors.restart_mean); }},
      {"rest is unreachable for launches from", "rad/s", [](S s) { return known_cell(s.thresholds.safe_speed); }},
      {"slope above which such launches exist", "deg", [](S s) { return known_cell(s.thresholds.safe_slope_deg); }}};
  return all;
}

// Returns the names of the assumptions of any law, in their order.
std::vector<std::string> assumptions_of(const std::vector<Studied>& columns) {
  std::vector<std::string> names;
  for (const Studied& one : columns)
    for (const analysis::ViolationShare& share : one.study.violations)
      if (std::find(names.begin(), names.end(), share.name) == names.end()) names.push_back(share.name);
  return names;
}

// Shows how often an assumption is left, with the interval of a share that was drawn; "" where the law has none such.
Cell share_cell(const Studied& study, const std::string& assumption, double analysis::ViolationShare::*which,
                double analysis::ViolationShare::*error) {
  const std::vector<analysis::ViolationShare>& all = study.study.violations;
  const auto one = std::ranges::find(all, assumption, &analysis::ViolationShare::name);
  if (one == all.end() || std::isnan((*one).*which)) return "";
  if (!((*one).*error > 0)) return (*one).*which;
  const analysis::Estimate drawn = with_error((*one).*which, (*one).*error);
  return analysis::Estimate{drawn.value, std::max(0.0, drawn.lower), std::min(1.0, drawn.upper)};
}

}  // namespace

Table ramps_table(const std::vector<Studied>& columns, const Provenance& provenance) {
  Table table{
      .id = "ramps",
      .title = columns.size() == 1 ? "How long the wheel rolls" : "The ramps side by side under each contact law",
      .columns = {{"quantity"}, {"unit"}},
      .provenance = provenance};
  for (const Studied& one : columns)
    table.columns.push_back({law_and_ramp(*one.study.setting), "", NumberFormat::general, 4});
  const auto add = [&table, &columns](const std::string& name, const std::string& unit, const auto& of) {
    std::vector<Cell> row{name, unit};
    for (const Studied& one : columns) row.push_back(of(one));
    table.rows.push_back(std::move(row));
  };
  for (const Quantity& one : quantities()) add(one.name, one.unit, one.of);
  using Share = analysis::ViolationShare;
  for (const std::string& name : assumptions_of(columns)) {
    add(fmt::format("“{}”, share of collisions, long run", name), "1", [&name](const Studied& s) {
      return share_cell(s, name, &Share::quasi_stationary, &Share::quasi_stationary_error);
    });
    add(fmt::format("“{}”, share of all collisions until rest", name), "1",
        [&name](const Studied& s) { return share_cell(s, name, &Share::until_rest, &Share::until_rest_error); });
  }
  table.notes = {
      "Brackets hold 95 % intervals: replicated randomisations plus the estimated discretization error. An empty cell "
      "means "
      "that there is no such number. Long run: the metastable regime of wheels that still roll; where none ever rests, "
      "the "
      "stationary one, and “until rest” is then on the ramp.",
      "The published law charges friction work on collisions in which Coulomb friction would stick; the coulomb law "
      "does "
      "not, and keeps enough speed to make rest unreachable. Its radius of gyration about the hub is an assumption "
      "where "
      "none is given (0.05 m), as it is for settled, which follows a rigid body through impacts, hops and slides until "
      "the landed foot stands."};
  return table;
}

std::string law_words(dynamics::Law law) {
  const std::string_view name = dynamics::law_name(law);
  if (law == dynamics::Law::settled) return fmt::format("the law of rigid bodies ({})", name);
  if (law == dynamics::Law::published) return fmt::format("the paper’s law ({})", name);
  return fmt::format("the law {}", name);
}

std::string law_and_ramp(const analysis::Setting& setting) {
  return fmt::format("{}, {} deg", dynamics::law_name(setting.law), setting.slope_deg);
}

std::string answer_sentence(const analysis::Metastability& study, const analysis::Metastability* beside) {
  const auto law = [](const analysis::Metastability& of) { return law_words(of.setting->law); };
  const auto steps = [](const analysis::Metastability& of) {
    const analysis::Estimate& e = of.steps.from_start;
    if (!std::isinf(e.value)) return plain_text(to_decimal(e, NumberFormat::significant, 3).value);
    return std::isfinite(e.lower) ? "more than " + format_number(e.lower, NumberFormat::general, 3) : std::string();
  };
  const std::string first = steps(study);
  std::string text = fmt::format("On {} deg ", study.setting->slope_deg);
  if (first.empty()) {
    text += fmt::format("the wheel never rests under {}", law(study));
  } else {
    text += fmt::format("the wheel rests after {} steps", first);
    if (const analysis::Estimate& e = study.steps.from_start; std::isfinite(e.value)) {
      const DecimalEstimate d = to_decimal(e, NumberFormat::significant, 3);
      text += fmt::format(" (95 %: {} to {})", plain_text(d.lower), plain_text(d.upper));
    }
    text += " under " + law(study);
  }
  if (beside) {
    const std::string second = steps(*beside);
    text += second.empty() ? fmt::format(", never under {}", law(*beside))
                           : fmt::format(", after {} under {}", second, law(*beside));
  }
  return text + ".";
}

Table answer_table(const std::vector<Studied>& studies, const Provenance& provenance) {
  Table table{.id = "answer",
              .title = "Expected steps before the wheel rests, by contact law",
              .columns = {},
              .provenance = provenance};
  table.columns = {{"ramp"}};
  std::vector<dynamics::Law> laws;
  std::vector<double> ramps;
  for (const Studied& one : studies) {
    const analysis::Setting& setting = *one.study.setting;
    if (std::ranges::find(laws, setting.law) == laws.end()) laws.push_back(setting.law);
    if (std::ranges::find(ramps, setting.slope_deg) == ramps.end()) ramps.push_back(setting.slope_deg);
  }
  for (const dynamics::Law law : laws) table.columns.push_back({std::string(dynamics::law_name(law)), "steps"});
  for (const double ramp : ramps) {
    std::vector<Cell> row{fmt::format("{} deg", ramp)};
    for (const dynamics::Law law : laws) {
      const auto found = std::ranges::find_if(studies, [&](const Studied& one) {
        return one.study.setting->law == law && one.study.setting->slope_deg == ramp;
      });
      row.push_back(found == studies.end() ? Cell("") : estimate_cell(found->study.steps.from_start));
    }
    table.rows.push_back(std::move(row));
  }
  table.notes = {"From the launch, on a ramp without end; below each number its 95 % interval."};
  return table;
}

std::string rests_text(const std::vector<Studied>& studies) {
  constexpr double rounding = 1e-12;  // of a share that is one minus another
  const auto percent = [](double share) {
    // A share that is not all must not be rounded up to it.
    const double shown = share < rounding ? 0 : 100 * share;
    return shown > 99.9 && shown < 100 ? std::string("more than 99.9") : format_number(shown, NumberFormat::general, 3);
  };
  std::string text;
  for (std::size_t i = 0; i < studies.size();) {
    const dynamics::Law law = studies[i].study.setting->law;
    double low = 1, high = 0;
    for (; i < studies.size() && studies[i].study.setting->law == law; ++i)
      if (const std::optional<double>& end = studies[i].study.steps.reach_end)
        low = std::min(low, 1 - *end), high = std::max(high, 1 - *end);
    if (low > high) continue;  // no ramp end
    const std::string name(dynamics::law_name(law)), first = percent(low), last = percent(high);
    text += text.empty() ? "Before the ramp ends, " : ", ";
    text += high < rounding ? "none rest under " + name
            : first == last ? fmt::format("{} % of the trials rest under {}", first, name)
                            : fmt::format("{} to {} % of the trials rest under {}", first, last, name);
  }
  return text.empty() ? text : text + ".";
}

Table resolution_table(const std::vector<Studied>& studies, const Provenance& provenance) {
  Table table{.id = "resolution",
              .title = "How each number was obtained, by law and ramp",
              .columns = {},
              .provenance = provenance};
  table.columns = {{"law and ramp"},
                   {"status"},
                   {"cells a leg"},
                   {"draws a cell"},
                   {"cell size", "%", NumberFormat::general, 2},
                   {"draws", "%", NumberFormat::general, 2},
                   {"table of landings", "%", NumberFormat::general, 2}};
  for (const Studied& one : studies) {
    const analysis::Metastability& s = one.study;
    const bool finite = std::isfinite(s.steps.from_start.value);
    const auto error = [&](double relative) { return finite ? Cell(100 * relative) : Cell(""); };
    table.rows.push_back({law_and_ramp(*s.setting), status_text(s.status), s.cells, s.samples,
                          error(s.steps.discretization_error), error(s.steps.sampling_error),
                          s.setting->law == dynamics::Law::settled ? error(s.steps.landing_error) : Cell("")});
  }
  table.notes = {
      "The last three columns: relative errors of the expected steps, all of them within the interval. “tolerance_not_"
      "met”: the interval is wider than asked for, and stands."};
  for (const Studied& one : studies)
    if (!one.study.message.empty())
      table.notes.push_back(fmt::format("{}: {}.", law_and_ramp(*one.study.setting), one.study.message));
  return table;
}

Estimate for_one_per_cent(const analysis::Sensitivity& one) {
  const auto grows = [&](double derivative) { return 100 * std::expm1(0.01 * derivative * one.value); };
  return {grows(one.derivative), grows(one.derivative - one.error), grows(one.derivative + one.error)};
}

Table sensitivity_table(const std::string& id, const std::vector<Hanging>& laws, const Provenance& provenance) {
  Table table{.id = id, .title = "", .columns = {}, .provenance = provenance};
  table.columns = {{"one per cent more"}, {"value", "", NumberFormat::general, 4}, {"unit"}};
  std::vector<std::string> names;
  for (const Hanging& one : laws) {
    table.title = fmt::format("What the expected steps depend on at {} deg, by law", one.setting.slope_deg);
    table.columns.push_back({fmt::format("steps under {}", dynamics::law_name(one.setting.law)), "%"});
    for (const analysis::Sensitivity& s : one.sensitivities.ranked) {
      const std::string name = s.leg ? sensitivity_name(s) : std::string(analysis::parameter_label(s.parameter));
      if (s.value == 0 || std::ranges::find(names, name) != names.end()) continue;
      names.push_back(name);
      const std::string_view unit = analysis::parameter_unit(s.parameter);
      std::vector<Cell> row{name, s.value, unit == "1" ? std::string() : std::string(unit)};
      for (const Hanging& other : laws) {
        const auto found = std::ranges::find_if(other.sensitivities.ranked, [&](const analysis::Sensitivity& o) {
          return o.parameter == s.parameter && o.leg == s.leg;
        });
        row.push_back(found == other.sensitivities.ranked.end() ? Cell("") : Cell(for_one_per_cent(*found)));
      }
      table.rows.push_back(std::move(row));
    }
  }
  table.notes = {
      "By how many per cent the expected steps from the launch change, all else kept; intervals are numerical, 95 %. "
      "Empty: the law does not know the parameter, or it was not varied."};
  for (const Hanging& one : laws)
    if (!one.sensitivities.reason.empty())
      table.notes.push_back(
          fmt::format("None under {}: {}.", dynamics::law_name(one.setting.law), one.sensitivities.reason));
  return table;
}

std::string sensitivity_sentence(const Hanging& one) {
  std::string text;
  std::size_t told = 0;
  for (const analysis::Sensitivity& s : one.sensitivities.ranked) {
    const Estimate change = for_one_per_cent(s);
    if (s.leg || !(change.lower > 0 || change.upper < 0)) continue;  // what is not sure of its sign is not told
    text += fmt::format(
        "{}1 % more {} makes {} % {} steps", told == 0 ? "" : ", ", analysis::parameter_label(s.parameter),
        format_number(std::abs(change.value), NumberFormat::significant, 2), change.value > 0 ? "more" : "fewer");
    if (++told == 2) break;
  }
  return text;
}

Table grid_table(const std::string& id, const std::string& title, const analysis::SweepAxis& down,
                 const analysis::SweepAxis& across, const std::vector<Estimate>& steps, const Provenance& provenance) {
  Table table{.id = id,
              .title = title,
              .columns = {{std::string(analysis::parameter_label(down.parameter)), "", NumberFormat::general, 3}},
              .provenance = provenance};
  for (const double value : across.values)
    table.columns.push_back({fmt::format("{} {}", analysis::parameter_label(across.parameter), value), "steps",
                             NumberFormat::significant, 3});
  for (std::size_t i = 0; i < down.values.size(); ++i) {
    std::vector<Cell> row{down.values[i]};
    for (std::size_t j = 0; j < across.values.size(); ++j)
      row.push_back(estimate_cell(steps[i * across.values.size() + j]));
    table.rows.push_back(std::move(row));
  }
  table.notes = {"Expected steps before failure from the launch, with 95 % intervals."};
  if (std::ranges::any_of(steps, [](const Estimate& e) { return std::isfinite(e.value) && std::isinf(e.upper); }))
    table.notes.push_back("Where an interval has no upper end the number is a 95 % lower bound.");
  return table;
}

Table energy_table(const std::vector<analysis::EnergyLosses>& losses, dynamics::Law law, const Provenance& provenance) {
  // The paper prints with Fig. 8: tangential from N(0.05, 0.03^2) to N(0.11, 0.19^2), normal about 0.17 with sd 0.06 to
  // 0.1.
  struct Printed {
    const char *tangential, *tangential_sd, *normal, *normal_sd;
  };
  const auto printed = [&](std::size_t k) -> Printed {
    if (k == 0) return {"0.05", "0.03", "0.17", "0.06"};
    if (k + 1 == losses.size()) return {"0.11", "0.19", "0.17", "0.1"};
    return {"", "", "0.17", ""};
  };
  Table table{.id = "energy-losses",
              .title = fmt::format("Energy lost in a collision under {}, beside the figures of the paper's Fig. 8",
                                   dynamics::law_name(law)),
              .columns = {{"sd of η and μ", "", NumberFormat::fixed, 2}},
              .provenance = provenance};
  for (const char* name : {"tangential net mean", "tangential net sd", "normal mean", "normal sd"}) {
    table.columns.push_back({name, "J", NumberFormat::fixed, 3});
    table.columns.push_back({fmt::format("paper: {}", name), "J"});
  }
  for (std::size_t k = 0; k < losses.size(); ++k) {
    const analysis::EnergyLosses& loss = losses[k];
    const auto mean = [](const analysis::MeanSpread& spread) { return with_error(spread.mean, spread.standard_error); };
    const Printed paper = printed(k);
    table.rows.push_back({0.05 * static_cast<double>(k + 1), mean(loss.tangential_net), paper.tangential,
                          loss.tangential_net.sd, paper.tangential_sd, mean(loss.normal), paper.normal, loss.normal.sd,
                          paper.normal_sd});
  }
  table.notes = {
      "Reading of Fig. 8: no rest rule, x′ < 0 is set to 0, all collisions of all trials. The tangential net loss is "
      "the "
      "friction loss less the potential energy gained by slipping downhill.",
      "The paper prints figures for the smallest and the largest spread only, and a normal mean of “around 0.17” for "
      "all."};
  return table;
}

}  // namespace metastable::reports
