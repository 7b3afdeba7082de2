#include "reports/study/report_tables.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string_view>

#include "dynamics/wheel/contact_law.h"

namespace metastable::reports {
namespace {

Cell cell(const analysis::Estimate& estimate) {
  if (std::isinf(estimate.value)) return Infinite{};
  return Estimate{estimate.value, estimate.lower, estimate.upper};
}

Cell cell(const std::optional<double>& value) {
  if (value) return *value;
  return "";
}

// Of what there may be none, NaN then.
Cell known(double value) { return std::isnan(value) ? Cell("") : Cell(value); }

}  // namespace

Table ramps_table(const std::vector<Studied>& columns, const Provenance& provenance) {
  Table table;
  table.id = "ramps";
  table.title = "The ramps side by side under each contact law";
  table.provenance = provenance;
  table.columns = {{"quantity"}, {"unit"}};
  for (const Studied& one : columns)
    table.columns.push_back(
        {fmt::format("{}, {} deg", dynamics::law_name(one.study.setting->law), one.study.setting->slope_deg), "",
         NumberFormat::general, 4});
  const auto add = [&](const std::string& name, const std::string& unit,
                       const std::function<Cell(const Studied&)>& of) {
    std::vector<Cell> row{name, unit};
    for (const Studied& one : columns) row.push_back(of(one));
    table.rows.push_back(std::move(row));
  };
  using S = const Studied&;
  add("expected steps before failure, from the launch", "steps", [](S s) { return cell(s.study.steps.from_start); });
  add("the same from the metastable regime", "steps", [](S s) { return cell(s.study.steps.from_quasi_stationary); });
  add("the same from the worst start", "steps", [](S s) { return cell(s.study.steps.worst_start); });
  add("standard deviation of the steps", "steps", [](S s) { return Cell(s.study.steps.distribution.sd); });
  add("median of the steps", "steps", [](S s) {
    const std::optional<double> median = s.study.steps.distribution.quantile(0.5);
    return median ? Cell(*median) : Cell(Infinite{});
  });
  add("mean time to failure", "s",
      [](S s) { return s.study.steps.seconds ? Cell(s.study.steps.seconds->mean) : Cell(Infinite{}); });
  add("mean distance to failure", "m",
      [](S s) { return s.study.steps.metres ? Cell(s.study.steps.metres->mean) : Cell(Infinite{}); });
  add("failure rate per step, 1 − λ₁", "1", [](S s) { return Cell(s.study.spectrum.failure_rate.value); });
  add("mixing, spectral", "steps", [](S s) { return Cell(s.study.spectrum.mixing_steps); });
  add("mixing from the launch, total variation", "steps", [](S s) {
    return s.study.spectrum.total_variation_steps ? Cell(*s.study.spectrum.total_variation_steps) : Cell("");
  });
  add("reaches the end of the ramp", "1", [](S s) { return cell(s.study.steps.reach_end); });
  add("speed before a collision, long-run mean", "rad/s", [](S s) { return known(s.study.survivors.mean); });
  add("its standard deviation", "rad/s", [](S s) { return known(s.study.survivors.sd); });
  add("the same mean with a new launch after each rest", "rad/s",
      [](S s) { return known(s.study.survivors.restart_mean); });
  add("rest is unreachable for launches from", "rad/s", [](S s) { return cell(s.thresholds.safe_speed); });
  add("slope above which such launches exist", "deg", [](S s) { return cell(s.thresholds.safe_slope_deg); });
  std::vector<std::string> assumptions;  // of any law, in their order
  for (const Studied& one : columns)
    for (const analysis::ViolationShare& share : one.study.violations)
      if (std::find(assumptions.begin(), assumptions.end(), share.name) == assumptions.end())
        assumptions.push_back(share.name);
  for (const std::string& name : assumptions) {
    using Share = analysis::ViolationShare;
    const auto share = [&](double Share::*which, double Share::*error) {
      return [name, which, error](S s) {
        for (const Share& one : s.study.violations) {
          if (one.name != name) continue;
          if (std::isnan(one.*which)) break;
          if (!(one.*error > 0)) return Cell(one.*which);
          const analysis::Estimate drawn = with_error(one.*which, one.*error);
          return Cell(analysis::Estimate{drawn.value, std::max(0.0, drawn.lower), std::min(1.0, drawn.upper)});
        }
        return Cell("");
      };
    };
    add(fmt::format("“{}”, share of collisions, long run", name), "1",
        share(&Share::quasi_stationary, &Share::quasi_stationary_error));
    add(fmt::format("“{}”, share of all collisions until rest", name), "1",
        share(&Share::until_rest, &Share::until_rest_error));
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

std::string laws_text(const std::vector<Studied>& columns) {
  constexpr double seldom = 0.02, mostly = 0.9;  // trials that rest on the ramp, as for the paper's failures
  std::vector<std::string_view> both, all;
  for (const Studied& one : columns) {
    const dynamics::Law law = one.study.setting->law;
    const std::string_view name = dynamics::law_name(law);
    if (!all.empty() && all.back() == name) continue;
    all.push_back(name);
    const bool on_all = std::ranges::all_of(columns, [&](const Studied& other) {
      if (other.study.setting->law != law || !other.study.steps.reach_end) return other.study.setting->law != law;
      const double rests = 1 - *other.study.steps.reach_end;
      return rests > seldom && rests < mostly;
    });
    if (on_all) both.push_back(name);
  }
  return both.empty()
             ? std::string("Real wheels both rest now and then and mostly roll on; here no law has them do so.")
             : fmt::format(
                   "Real wheels both rest now and then and mostly roll on; of {} only {} has them do so here (2 "
                   "to 90 % of the trials rest on each ramp).",
                   fmt::join(all, ", "), fmt::join(both, " and "));
}

Table grid_table(const std::string& id, const std::string& title, const analysis::SweepAxis& down,
                 const analysis::SweepAxis& across, const std::vector<analysis::Metastability>& studies,
                 const Provenance& provenance) {
  Table table;
  table.id = id;
  table.title = title;
  table.provenance = provenance;
  table.columns = {{std::string(analysis::parameter_label(down.parameter)), "", NumberFormat::general, 3}};
  for (const double value : across.values)
    table.columns.push_back({fmt::format("{} {}", analysis::parameter_label(across.parameter), value), "steps",
                             NumberFormat::significant, 3});
  for (std::size_t i = 0; i < down.values.size(); ++i) {
    std::vector<Cell> row{down.values[i]};
    for (std::size_t j = 0; j < across.values.size(); ++j)
      row.push_back(cell(studies[i * across.values.size() + j].steps.from_start));
    table.rows.push_back(std::move(row));
  }
  table.notes = {"Expected steps before failure from the launch, with 95 % intervals."};
  return table;
}

Table energy_table(const std::vector<analysis::EnergyLosses>& losses, const Provenance& provenance) {
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
  Table table;
  table.id = "energy-losses";
  table.title = "Energy lost in a collision, beside the figures of the paper's Fig. 8";
  table.provenance = provenance;
  table.columns = {{"sd of η and μ", "", NumberFormat::fixed, 2}};
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
