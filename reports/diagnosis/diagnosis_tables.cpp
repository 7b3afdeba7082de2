#include "reports/diagnosis/diagnosis_tables.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "analysis/diagnosis/diagnosis_sentences.h"
#include "analysis/statistics/falling_order.h"
#include "analysis/statistics/interval_95.h"
#include "reports/output/known_cell.h"

namespace metastable::reports {
namespace {

using analysis::Cause;
using analysis::Diagnosis;
using analysis::EstimatedParameter;
using analysis::GapCell;

std::string short_number(double value) {
  return std::isnan(value) ? "unknown" : format_number(value, NumberFormat::general, 3);
}

// Shows a number whose 90 % interval may not be known.
Cell with_interval(double value, double lower, double upper) {
  if (std::isnan(value) || std::isnan(lower) || std::isnan(upper)) return known_cell(value);
  return Estimate{value, lower, upper};
}

Cell with_interval(const EstimatedParameter& p) {
  return p.fitted ? with_interval(p.value, p.lower, p.upper) : known_cell(p.value);
}

// A nested model that comes out worse than the one it holds, or evidence of e^-100, says that the fit is no good.
Cell unless_hopeless(double value) {
  constexpr double hopeless = -100;
  if (value < hopeless)
    return NotShown{{value, value, value}, fmt::format("< {}", format_number(hopeless, NumberFormat::general, 3))};
  return known_cell(value);
}

// Returns "leg 4, friction_ratio 0.879 (0.864 to 0.894)"; a list without its intervals, to the digits that they know.
std::string parameters_text(const std::vector<EstimatedParameter>& parameters) {
  std::string text;
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const EstimatedParameter& p = parameters[i];
    const bool goes_on = i > 0 && parameters[i - 1].name == p.name;
    const bool in_list = goes_on || (i + 1 < parameters.size() && parameters[i + 1].name == p.name);
    text += goes_on ? "; " : (text.empty() ? "" : ", ") + p.name + " ";
    const Estimate estimate{p.value, p.lower, p.upper};
    const bool interval = p.fitted && !std::isnan(p.value + p.lower + p.upper);
    text += !interval  ? short_number(p.value)
            : !in_list ? format_estimate(estimate, NumberFormat::general)
                       : plain_text(to_decimal(estimate, NumberFormat::general, 3).value);
  }
  return text;
}

std::string parameters_text(const Cause& cause) {
  std::string text;
  for (const std::vector<EstimatedParameter>& one : cause.parameters) {
    const std::string part = parameters_text(one);
    if (!part.empty()) text += (text.empty() ? "" : " + ") + part;
  }
  return text;
}

}  // namespace

std::string unit_of(const Diagnosis& d, const std::string& effect, const std::string& parameter) {
  return d.model ? d.model->unit_of(effect, parameter) : "";
}

// Adjusted p-values rise as statistics fall.
std::vector<GapCell> beyond_chance(const analysis::GapMap& map) {
  std::vector<double> sizes;
  for (const GapCell& cell : map.cells) sizes.push_back(std::abs(cell.statistic));
  std::vector<GapCell> cells;
  for (const std::size_t k : analysis::falling_order(sizes))
    if (map.cells[k].p_adjusted < where_level) cells.push_back(map.cells[k]);
  return cells;
}

Table data_table(const Diagnosis& d) {
  Table table{.id = "data",
              .title = "Data",
              .notes = d.data.notes,
              .columns = {{"trials"}, {d.data.step_name + "s"}, {"transitions"}}};
  table.rows.push_back({d.data.trials, d.data.collisions, d.data.events});
  return table;
}

// Tests put together are factors above the 1e-12 at which each of them stops, and say no more than it does.
Cell together(double p, bool tested = true) {
  if (!tested) return Cell("not tested");
  return p < 1e-11 ? Cell(NotShown{{p, p, p}, "< 10⁻¹¹"}) : Cell(p);
}

Table gap_table(const Diagnosis& d) {
  return {
      .id = "gap",
      .title = "Is there a gap?",
      .notes = {"p is the chance that a model that is right looks at least as wrong as this one does, in what its "
                "row says may be wrong."},
      .columns = {{"model"}, {"what may be wrong"}, {"p", "", NumberFormat::p_value, 2}},
      .rows = {{"as given", "anything", together(d.gap.p_as_given)},
               {"as given", "its parameters", together(d.gap.p_recalibration)},
               {"recalibrated", "anything else", together(d.gap.p_value)},
               {"recalibrated", "an effect of the catalogue", together(d.gap.p_effects)},
               {"recalibrated", "a cell of the map", together(d.gap.p_where)},
               {"recalibrated", "all cells of a facet", together(d.gap.p_facets, d.gap.facets_tested)},
               {"recalibrated", "a variation without a name", together(d.gap.p_variations, d.gap.variations_tested)}}};
}

Table contact_table(const Diagnosis& d) {
  Table table{.id = "contact",
              .title = "Recalibrated parameters",
              .columns = {{"parameter"}, {.name = "value (90 %)", .level = 90}}};
  for (const EstimatedParameter& p : d.gap.contact) table.rows.push_back({p.name, with_interval(p)});
  if (d.causes.beside.empty()) return table;
  table.columns.push_back({.name = "beside the likeliest effects (90 %)", .level = 90});
  for (std::size_t k = 0; k < table.rows.size(); ++k) table.rows[k].push_back(with_interval(d.causes.beside[k]));
  return table;
}

Table where_table(const Diagnosis& d) {
  Table table{.id = "where",
              .title = "Where it lies, after recalibration",
              .notes = {},
              .columns = {{"facet"},
                          {"aspect"},
                          {"at"},
                          {"size (simultaneous 95 % band)", "", NumberFormat::significant, 2},
                          {"of"},
                          {"score"},
                          {"adjusted p", "", NumberFormat::p_value, 2}}};
  for (const GapCell& cell : beyond_chance(d.gap.recalibrated))
    table.rows.push_back({cell.facet, cell.aspect, cell.at,
                          Estimate{cell.size, cell.size - cell.band, cell.size + cell.band}, cell.unit, cell.statistic,
                          cell.p_adjusted});
  return table;
}

Table map_table(const Diagnosis& d) {
  Table table{.id = "map",
              .title = "The whole map",
              .notes = {"Score: standard normal where there is no gap. Adjusted p: step-down over all cells, after "
                        "recalibration; false discovery: Benjamini and Hochberg's. Band: half-width of the "
                        "simultaneous 95 % band of the size."},
              .columns = {{"facet"},
                          {"aspect"},
                          {"at"},
                          {"transitions"},
                          {"score as given"},
                          {"score recalibrated"},
                          {"score with effect"},
                          {"size"},
                          {"band"},
                          {"of"},
                          {"adjusted p", "", NumberFormat::p_value},
                          {"false discovery", "", NumberFormat::p_value}}};
  const auto score_of = [](const analysis::GapMap& map, std::size_t i, const GapCell& cell) {
    const bool same = i < map.cells.size() && map.cells[i].facet == cell.facet && map.cells[i].at == cell.at &&
                      map.cells[i].aspect == cell.aspect;
    return same ? known_cell(map.cells[i].statistic) : Cell("");
  };
  for (std::size_t i = 0; i < d.gap.recalibrated.cells.size(); ++i) {
    const GapCell& cell = d.gap.recalibrated.cells[i];
    table.rows.push_back({cell.facet, cell.aspect, cell.at, cell.events, score_of(d.gap.as_given, i, cell),
                          cell.statistic, score_of(d.gap.left, i, cell), cell.size, cell.band, cell.unit,
                          cell.p_adjusted, cell.false_discovery});
  }
  return table;
}

Table at_work_table(const Diagnosis& d) {
  Table table{
      .id = "at-work",
      .title = "What is at work",
      .notes = {"Probability: over all hypotheses that hold it, whatever else is at work. Alone: the share of the "
                "held-out gap that it closes in the model as given; last: added to the recalibrated model with "
                "the others; mean: of the two."},
      .columns = {{"effect"},
                  {"probability", "", NumberFormat::fixed, 3},
                  {"parameters (90 % intervals)"},
                  {"closes alone", "%", NumberFormat::significant, 2},
                  {"closes last", "%", NumberFormat::significant, 2},
                  {"mean", "%", NumberFormat::significant, 2}}};
  const auto percent = [](const std::optional<Estimate>& share) {
    return share ? Cell(Estimate{100 * share->value, 100 * share->lower, 100 * share->upper}) : Cell("");
  };
  for (const analysis::AtWork& one : d.causes.at_work) {
    std::string name = one.name;
    if (one.effects.size() > 1) name += fmt::format(" ({})", fmt::join(one.effects, ", "));
    table.rows.push_back({name, one.probability, parameters_text(one.parameters), percent(one.closes_alone),
                          percent(one.closes_beside), percent(one.closes_mean)});
  }
  if (!table.rows.empty()) table.rows.push_back({"something without a name", d.causes.p_unnamed, "", "", "", ""});
  return table;
}

Table causes_table(const Diagnosis& d) {
  Table table{.id = "causes",
              .title = "Which effect",
              .notes = {},
              .columns = {{"cause"},
                          {"probability", "", NumberFormat::fixed, 3},
                          {"95 % set"},
                          {"2 Δ ln L", "", NumberFormat::fixed, 1},
                          {"p alone", "", NumberFormat::p_value, 2},
                          {"ln Bayes factor", "", NumberFormat::fixed, 1},
                          {"parameters (90 % intervals)"}}};
  std::vector<std::pair<double, std::vector<Cell>>> rows;
  for (const Cause& cause : d.causes.ranked) {
    const std::string name = cause.name();
    const bool inside = std::find(d.causes.set.begin(), d.causes.set.end(), name) != d.causes.set.end();
    rows.push_back({cause.probability,
                    {name, cause.probability, inside ? "in" : "", unless_hopeless(cause.gain),
                     known_cell(cause.p_value), unless_hopeless(cause.evidence), parameters_text(cause)}});
  }
  for (const auto& [name, p] :
       {std::pair("no gap", d.causes.p_no_gap), std::pair("recalibration", d.causes.p_recalibrate),
        std::pair("none of these", d.causes.p_none)})
    rows.push_back({p, {name, p, "", "", "", "", ""}});
  std::stable_sort(rows.begin(), rows.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  for (auto& [probability, row] : rows) table.rows.push_back(std::move(row));
  return table;
}

Table parameters_table(const Diagnosis& d) {
  Table table{.id = "parameters",
              .title = "Parameters of the effects",
              .notes = {"Without interval: chosen from a list (a leg, an interval, a frequency)."},
              .columns = {{"cause"}, {"effect"}, {"parameter"}, {.name = "value (90 %)", .level = 90}, {"unit"}}};
  for (const Cause& cause : d.causes.ranked)
    for (std::size_t e = 0; e < cause.parameters.size(); ++e)
      for (const EstimatedParameter& p : cause.parameters[e])
        table.rows.push_back(
            {cause.name(), cause.effects.at(e), p.name, with_interval(p), unit_of(d, cause.effects.at(e), p.name)});
  return table;
}

Table shrinkage_table(const Diagnosis& d) {
  Table table{
      .id = "shrinkage",
      .title = "How far it shrinks, held out",
      .notes =
          {"Floor: the same measure on data of the last model itself. Closed: (as given − with effect) / (as given "
           "− floor); not known where the gap may be none or the interval is wider than the gap.",
           fmt::format("Nats: natural logarithms of the likelihood; a model better by 0.1 nats a {0} makes each {0} "
                       "exp(0.1) = 1.1 times as probable.",
                       d.data.step_name)},
      .columns = {{"measure"},
                  {"unit"},
                  {.name = "as given (90 %)", .level = 90},
                  {"recalibrated"},
                  {"with effect"},
                  {"floor"},
                  {.name = "closed (90 %)", .level = 90}}};
  for (const analysis::Shrinkage& s : d.shrinkage.measures) {
    Cell closed = analysis::closed_unknown(s);
    if (s.closed && s.closed_lower && s.closed_upper) {
      const Estimate share{*s.closed, *s.closed_lower, *s.closed_upper};
      closed = analysis::closed_is_known(s) ? Cell(share) : Cell(NotShown{share, analysis::closed_unknown(s)});
    }
    table.rows.push_back({s.measure, s.unit, with_interval(s.baseline, s.baseline_lower, s.baseline_upper),
                          known_cell(s.recalibrated), known_cell(s.with_effect), known_cell(s.floor), closed});
  }
  return table;
}

Table steps_table(const Diagnosis& d) {
  const analysis::StepsBeforeFailure& s = d.shrinkage.steps;
  Table table{.id = "steps",
              .title = "Expected steps before failure (90 % intervals)",
              .notes = {"This machine: the models, what they lack, and the count of failures."},
              .columns = {{.name = "place"},
                          {.name = "observed", .level = 90},
                          {"as given"},
                          {.name = "recalibrated", .level = 90},
                          {.name = "with effect", .level = 90},
                          {.name = "this machine", .level = 90}}};
  const auto model = [](double value, const std::optional<Estimate>& interval) {
    return value > 0 && interval ? estimate_cell({value, interval->lower, interval->upper}) : positive_cell(value);
  };
  const auto own = [](const analysis::MachineSteps& machine) {
    return machine.at_least ? Cell(fmt::format("at least {} (95 %)", short_number(machine.steps.lower)))
                            : Cell(machine.steps);
  };
  // A machine that is not known to fail has no steps before it does, and models may have none to tell.
  const auto tells = [](double steps) { return steps > 0 && std::isfinite(steps); };
  if (!(s.observed > 0) && s.machine.empty() && !tells(s.baseline) && !tells(s.recalibrated) && !tells(s.with_effect))
    return table;
  const auto here = std::ranges::find(s.machine, "", &analysis::MachineSteps::where);
  table.rows.push_back({"as measured",
                        s.observed > 0 ? estimate_cell({s.observed, s.observed_lower, s.observed_upper}) : Cell(""),
                        positive_cell(s.baseline), model(s.recalibrated, s.recalibrated_90),
                        model(s.with_effect, s.with_effect_90), here == s.machine.end() ? Cell("") : own(*here)});
  for (const analysis::MachineSteps& machine : s.machine)
    if (!machine.where.empty())
      table.rows.push_back({machine.where, Cell(""), Cell(""), Cell(""), Cell(""), own(machine)});
  return table;
}

bool of_speeds(const Diagnosis& d) { return !d.model || d.model->columns().front().name == "speed"; }

Table profile_table(const Diagnosis& d) {
  const bool speeds = of_speeds(d);
  const std::string unit = speeds ? "rad/s" : "";
  Table table{.id = "profile",
              .title = speeds ? "Mean speed before a collision, measured and simulated"
                              : "Mean of each column by step, measured and simulated",
              .notes = {"Band: half-width of the 95 % band of the simulated mean of as many trials."},
              .columns = {{"condition"},
                          {speeds ? "collision" : "step"},
                          {"trials"},
                          {"measured", unit, NumberFormat::significant, 4},
                          {"as given", unit, NumberFormat::significant, 4},
                          {"with effect", unit, NumberFormat::significant, 4},
                          {"band", unit}}};
  if (!speeds) table.columns.insert(table.columns.begin() + 1, {"column"});
  for (const analysis::ProfilePoint& p : d.shrinkage.profile) {
    const double half = analysis::normal_95 * p.measured_error;
    table.rows.push_back({d.data.condition_names.at(p.condition), p.collision, p.trials,
                          std::isnan(p.measured) ? Cell("")
                          : std::isnan(half)     ? Cell(p.measured)
                                                 : Cell(Estimate{p.measured, p.measured - half, p.measured + half}),
                          known_cell(p.baseline), known_cell(p.with_effect), known_cell(p.band)});
    if (!speeds) table.rows.back().insert(table.rows.back().begin() + 1, Cell(d.model->columns().at(p.column).name));
  }
  return table;
}

Table visibility_table(const Diagnosis& d) {
  Table table{
      .id = "visibility",
      .title = "What these data could have seen",
      .notes = {fmt::format("Smallest: the size that most experiments like this one would find (2 Δ ln L of "
                            "{:.0f}). Looks like: another effect that would explain this share of what the effect does "
                            "to the data (half of it at least).",
                            d.rules.seen_gain)},
      .columns = {{"effect"}, {"parameter"}, {"smallest"}, {"unit"}, {"looks like"}, {"cannot be told because"}}};
  for (const analysis::Detectability& v : d.limits.visible) {
    std::string alike;
    for (const auto& [effect, share] : v.alike)
      alike += fmt::format("{}{} {:.0f} %", alike.empty() ? "" : ", ", effect, 100 * share);
    table.rows.push_back({v.effect, v.parameter, v.undecidable.empty() ? positive_cell(v.smallest) : Cell(""),
                          unit_of(d, v.effect, v.parameter), alike, v.undecidable});
  }
  return table;
}

Table missing_table(const Diagnosis& d) {
  Table table{
      .id = "missing-columns",
      .title = "What missing columns hide",
      .notes = {"Smallest visible sizes by the design's own information, without the column and as if it had "
                "been measured; empty: not at all. Not told from: effects that imitate more than nine tenths "
                "of it without the column and less than eight with it."},
      .columns = {
          {"column"}, {"effect"}, {"parameter"}, {"smallest without"}, {"smallest with"}, {"unit"}, {"not told from"}}};
  for (const analysis::MissingColumn& m : d.limits.missing) {
    if (m.effects.empty()) table.rows.push_back({m.column, "no effect is much harder to see", "", "", "", "", ""});
    for (const analysis::HiddenEffect& e : m.effects) {
      table.rows.push_back({m.column, e.effect, e.parameter, known_cell(e.smallest), known_cell(e.smallest_with_it),
                            unit_of(d, e.effect, e.parameter), fmt::format("{}", fmt::join(e.not_told_from, ", "))});
    }
  }
  return table;
}

Table not_possible_table(const Diagnosis& d) {
  Table table{.id = "not-possible",
              .title = "What these data cannot say",
              .notes = {"Trials: of this kind that would do; empty where no number of them would."},
              .columns = {{"statement"}, {"because"}, {"trials"}}};
  for (const analysis::NotPossible& n : d.limits.not_possible)
    table.rows.push_back({n.statement, n.because, n.trials ? Cell(*n.trials) : Cell("")});
  return table;
}

Table undecided_table(const Diagnosis& d) {
  Table table{.id = "not-decided", .title = "Not decided", .columns = {{"effect"}, {"because"}}};
  for (const Cause& cause : d.causes.not_decided) table.rows.push_back({cause.name(), cause.not_decided});
  return table;
}

Table next_table(const Diagnosis& d) {
  Table table{
      .id = "next-experiment",
      .title = "The next experiment",
      .notes = {fmt::format("Separation: 2 Δ ln L to be expected between the first cause, at the fitted size, and "
                            "the others, on average, each counted up to {:.0f}, from where on most experiments "
                            "like it tell two apart.",
                            d.rules.seen_gain)},
      .columns = {{"change"}, {"separation"}}};
  for (const analysis::NextExperiment& n : d.limits.next) table.rows.push_back({n.change, known_cell(n.separation)});
  return table;
}

}  // namespace metastable::reports
