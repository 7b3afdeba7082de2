#include "reports/experiment_commands/lessons_command.h"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "analysis/diagnosis/diagnosis.h"
#include "analysis/diagnosis/diagnosis_sentences.h"
#include "analysis/experiment_model/diagnose.h"
#include "analysis/paper/step_balance.h"
#include "analysis/paper/worked_examples.h"
#include "analysis/statistics/interval_95.h"
#include "reports/diagnosis/diagnosis_figures.h"
#include "reports/diagnosis/diagnosis_tables.h"
#include "reports/output/known_cell.h"
#include "reports/output/page_folder.h"
#include "reports/output/version.h"
#include "reports/study/study_progress.h"

namespace metastable::reports {
namespace {

using analysis::Diagnosis;
using analysis::Experiment;

Diagnosis diagnosed(const Experiment& experiment, const std::string& what, const LessonsRequest& request) {
  Progress progress(what, study_units);
  analysis::DiagnosisOptions options = request.options;
  options.progress = study_progress(progress);
  return analysis::diagnose(experiment, options);
}

// Puts one diagnosis a row.
Table answers(const std::string& id, const std::string& title, const std::string& what) {
  return {
      .id = id,
      .title = title,
      .notes = {"Nats: held-out log score a collision that the model falls short of the best flexible one. CRPS: of "
                "the next speed. Steps: expected before failure; observed with its 90 % interval."},
      .columns = {{what},
                  {"verdict"},
                  {"95 % set, or the nearest"},
                  {"p", "", NumberFormat::p_value},
                  {"gap, nats"},
                  {"recalibrated"},
                  {"with effect"},
                  {.name = "closed (90 %)", .level = 90},
                  {"CRPS, rad/s"},
                  {"with effect"},
                  {.name = "steps observed (90 %)", .level = 90},
                  {"as given"},
                  {"with effect"}}};
}

void add_answer(Table& table, const std::string& what, const Diagnosis& d) {
  std::string causes = fmt::format("{}", fmt::join(d.causes.set, ", "));
  if (causes.empty() && d.verdict == analysis::Verdict::unexplained && !d.causes.ranked.empty())
    causes = fmt::format("(nearest: {})", d.causes.ranked.front().name());
  std::vector<Cell> row{what, analysis::verdict_name(d.verdict), causes, d.gap.p_as_given};
  if (d.shrinkage.measures.size() >= 2) {
    const analysis::Shrinkage &nats = d.shrinkage.measures[0], &crps = d.shrinkage.measures[1];
    row.insert(row.end(),
               {nats.baseline, nats.recalibrated, nats.with_effect,
                analysis::closed_is_known(nats) ? Cell(Estimate{*nats.closed, *nats.closed_lower, *nats.closed_upper})
                                                : Cell(analysis::closed_unknown(nats)),
                crps.baseline, crps.with_effect});
  } else {
    row.insert(row.end(), {"", "", "", "", "", ""});
  }
  const analysis::StepsBeforeFailure& s = d.shrinkage.steps;
  row.push_back(s.observed > 0 && std::isfinite(s.observed)
                    ? Cell(Estimate{s.observed, s.observed_lower, s.observed_upper})
                    : positive_cell(s.observed));
  row.push_back(positive_cell(s.baseline));
  row.push_back(positive_cell(s.with_effect));
  table.rows.push_back(std::move(row));
  for (const std::string& note : d.data.notes)
    if (note.find("did not converge") != std::string::npos) table.notes.push_back(fmt::format("{}: {}.", what, note));
}

Table said(const std::string& id, const std::string& title, const Diagnosis& d) {
  Table table{.id = id, .title = title, .columns = {{"the diagnosis says"}}};
  for (const std::string& sentence : d.sentences) table.rows.push_back({sentence});
  return table;
}

const char* source_name(analysis::VariabilitySource source) {
  switch (source) {
    case analysis::VariabilitySource::none:
      return "nothing";
    case analysis::VariabilitySource::launch:
      return "launch speeds (H1)";
    case analysis::VariabilitySource::legs:
      return "differences of the legs (H2)";
    case analysis::VariabilitySource::contact:
      return "restitution and friction (H3)";
  }
  throw std::logic_error("source without a name");
}

// --- What the charge on sticking collisions does -------------------------------------------------------------------

Table charge_table(const LessonsRequest& request) {
  Table table{
      .id = "charge",
      .title = "Expected steps before failure without the charge on collisions that stick",
      .notes = {"Equal legs of 0.1519 m, eta, mu ~ N(0.4, 0.1²), the paper's launches. Uncharged: `published`, but a "
                "foot with mu above mu_c = x y/(L² + y²) does not slide: no friction loss, no shift along the "
                "ramp. coulomb: first principles, r_g = 0.05 m."},
      .columns = {{"slope", "deg"},
                  {"mu_c", "", NumberFormat::fixed, 3},
                  {"share above mu_c", "", NumberFormat::fixed, 3},
                  {"published"},
                  {"uncharged"},
                  {"coulomb"}}};
  const auto cell = [](const analysis::Estimate& e) -> Cell {
    if (!std::isfinite(e.value)) return Infinite{};
    return Estimate{e.value, e.lower, e.upper};
  };
  for (const analysis::ChargeOnSticking& ramp :
       analysis::charge_on_sticking(request.options.seed, request.options.threads))
    table.rows.push_back({ramp.slope_deg, ramp.critical_friction, ramp.share_above, cell(ramp.published),
                          cell(ramp.uncharged), cell(ramp.coulomb)});
  return table;
}

// --- Measured trials -----------------------------------------------------------------------------------------------

Table balance_table(const std::string& id, const std::string& name, const analysis::StepBalances& b) {
  const auto text = [](const std::optional<double>& r) { return r ? fmt::format("{:.2f}", *r) : "not known"; };
  Table table{
      .id = id,
      .title = "What a step keeps of omega², against a plastic collision: " + name,
      .notes =
          {"Kept: (omega² before the next collision − what the stance adds)/omega² before this one. Slide: distance "
           "between feet beyond the chord. Steps from the fourth collision on.",
           fmt::format("Correlation of (kept − plastic) with the slide {}, with omega+²/omega−² {}, with the speed "
                       "{:.2f}, with the step before {:.2f}.",
                       text(b.correlation.slide), text(b.correlation.after_collision), b.correlation.speed,
                       b.correlation.previous)},
      .columns = {{"steps of"},
                  {"number"},
                  {"omega+²/omega−²", "", NumberFormat::fixed, 3},
                  {"plastic keeps", "", NumberFormat::fixed, 3},
                  {"kept − plastic: median", "", NumberFormat::fixed, 4},
                  {"mean", "", NumberFormat::fixed, 4},
                  {"sd", "", NumberFormat::fixed, 4},
                  {"5 % quantile", "", NumberFormat::fixed, 4},
                  {"slide", "mm", NumberFormat::fixed, 1}}};
  for (const auto* list : {&b.conditions, &b.slides, &b.legs})
    for (const analysis::StepBalance& s : *list)
      if (s.steps > 0)
        table.rows.push_back({s.of, s.steps, s.after_collision ? Cell(*s.after_collision) : Cell(""), s.plastic,
                              s.median, s.mean, s.sd, s.low, s.slide ? Cell(1000 * *s.slide) : Cell("")});
  return table;
}

Figure balance_figure(const std::string& id, const analysis::StepBalances& b) {
  Figure figure{.id = id,
                .title = "",
                .x = {"slide of the foot", "mm"},
                .y = {"kept − plastic, mean of a fifth of the steps"},
                .series = {{.label = "", .style = Style::points, .x = {}}}};
  for (const analysis::StepBalance& s : b.slides) {
    figure.series[0].x.push_back(1000 * *s.slide);
    figure.series[0].y.push_back(s.mean);
    const double half = analysis::normal_95 * s.sd / std::sqrt(static_cast<double>(s.steps));
    figure.series[0].lower.push_back(s.mean - half);
    figure.series[0].upper.push_back(s.mean + half);
  }
  return figure;
}

// Holds the page as its sections are written.
class Lessons {
 public:
  explicit Lessons(const LessonsRequest& request)
      : request_(request),
        pages_(request.out),
        provenance_{request.command, "the stand-in's wheel and contact unless said otherwise", request.options.seed,
                    version()} {
    pages_.page().title = "Worked examples: what the diagnosis says";
    pages_.page().provenance = provenance_;
  }

  void coulomb_wheel() {
    const Diagnosis d = diagnosed(laboratory({{"slip_reversal", {}}}), "coulomb wheel", request_);
    Table table = answers("coulomb-wheel", "Nominal law `published`, the wheel obeys `coulomb`", "wheel");
    add_answer(table, "laboratory, coulomb, three conditions", d);
    section("coulomb-wheel", "A wheel that obeys coulomb, under the published law",
            "A laboratory wheel of the stand-in's conditions that sticks above mu_c, diagnosed with the published law.",
            map_figures(d), {table, said("coulomb-wheel-said", "In words", d)});
  }

  void charge() {
    section("charge", "The charge on sticking collisions",
            "The published law charges friction where a foot would stick; without that charge rest is rarer.", {},
            {charge_table(request_)});
  }

  void hypotheses() {
    Table table = answers("hypotheses", "The paper's hypotheses as effects: each source believed half as wide as it is",
                          "believed half as wide");
    const Experiment stand_in = laboratory({});
    for (const analysis::VariabilitySource source : analysis::variability_sources)
      add_answer(table, source_name(source),
                 diagnosed(believed_half_as_wide(stand_in, source), source_name(source), request_));
    table.notes.push_back(
        "A source that dominates moves the steps before failure when it is believed wrongly, not only the likelihood.");
    section("hypotheses", "H1, H2 and H3 as effects",
            "Simulated trials of the stand-in; the nominal model believes each source half as wide in turn.", {},
            {table});
  }

  /// @param number  from 1
  void measured(const Experiment& experiment, const std::string& name, std::size_t number) {
    const std::string id = fmt::format("data-{}", number);
    Table table = answers(id + "-answers", experiment.title, "nominal law");
    std::vector<Table> in_words;
    for (const analysis::UnderLaw& one : analysis::under_each_law(experiment)) {
      const std::string_view law = dynamics::law_name(one.law);
      const std::string what = fmt::format("{}{}", law, one.whole_steps ? ", whole steps (omega_plus left out)" : "");
      const Diagnosis d = diagnosed(one.experiment, what, request_);
      add_answer(table, what, d);
      in_words.push_back(said(fmt::format("{}-{}{}", id, law, one.whole_steps ? "-steps" : ""), what, d));
    }
    std::vector<Table> tables{table};
    tables.insert(tables.end(), in_words.begin(), in_words.end());
    std::vector<Figure> figures;
    if (experiment.system == analysis::System::rimless_wheel && experiment.columns.leg == analysis::Presence::all) {
      const analysis::StepBalances balances = analysis::step_balances(experiment);
      tables.push_back(balance_table(id + "-balance", name, balances));
      if (!balances.slides.empty()) figures.push_back(balance_figure(id + "-slides", balances));
    }
    section(id, experiment.title.empty() ? name : experiment.title,
            "Where no law of the catalogue fits, the balance of whole steps says what one would have to do.",
            std::move(figures), std::move(tables));
  }

  void finish(Answer& answer) {
    pages_.write_index();
    pages_.finish(answer);
  }

 private:
  Experiment laboratory(const std::vector<dynamics::Effect>& effects) const {
    return analysis::laboratory_stand_in(effects, request_.options.seed, request_.options.threads, request_.trials);
  }

  void section(const std::string& id, const std::string& heading, const std::string& reading,
               std::vector<Figure> figures, std::vector<Table> tables) {
    for (Figure& figure : figures) {
      if (!figure.id.starts_with(id)) figure.id = id + "-" + figure.id;
      figure.provenance = provenance_;
    }
    for (Table& table : tables) table.provenance = provenance_;
    pages_.section(id, heading, reading, figures, std::move(tables));
  }

  const LessonsRequest& request_;
  PageFolder pages_;
  Provenance provenance_;
};

}  // namespace

void run_lessons(const LessonsRequest& request) {
  std::vector<Experiment> measured;
  for (const std::string& folder : request.data) measured.push_back(analysis::read_experiment(folder));
  Lessons lessons(request);
  Answer answer(request.json);
  lessons.coulomb_wheel();
  lessons.charge();
  lessons.hypotheses();
  for (std::size_t i = 0; i < measured.size(); ++i)
    lessons.measured(measured[i], std::filesystem::path(request.data[i]).lexically_normal().filename().string(), i + 1);
  lessons.finish(answer);
}

}  // namespace metastable::reports
