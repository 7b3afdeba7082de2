#include "reports/lessons_command.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>

#include "analysis/experiment_model.h"
#include "analysis/metastability.h"
#include "analysis/reality.h"
#include "analysis/stand_in.h"
#include "analysis/step_balance.h"
#include "analysis/uncharged_sticking.h"
#include "reports/diagnosis_figures.h"
#include "reports/diagnosis_tables.h"
#include "reports/page_folder.h"
#include "reports/study_progress.h"
#include "reports/version.h"

namespace metastable::reports {
namespace {

using analysis::Diagnosis;
using analysis::Experiment;
using analysis::Setting;

analysis::ExperimentSource source_of(const analysis::ExperimentFiles& files, const std::string& name) {
  return {name, files.experiment_toml, files.collisions_csv, files.trials_csv, {}};
}

// The stand-in's trials in the virtual laboratory, with effects.
Experiment laboratory_experiment(std::vector<dynamics::Effect> effects, const LessonsRequest& request) {
  const auto conditions = analysis::stand_in_conditions(analysis::stand_in_setting());
  analysis::RealityOptions options;
  options.effects = std::move(effects);
  options.sensor_noise = 0.008;
  options.seed = request.seed;
  options.threads = request.threads;
  const dynamics::LaboratorySetup setup = analysis::laboratory_setup(conditions, options);
  const auto trials = analysis::run_laboratory(setup, request.threads);
  return analysis::parse_experiment(
      source_of(analysis::reality_files(conditions, setup, trials, {.title = "laboratory"}).files, "laboratory"));
}

Diagnosis diagnosed(const Experiment& experiment, const std::string& what, const LessonsRequest& request) {
  const auto model = analysis::transition_model(experiment);
  Progress progress(what, study_units);
  analysis::DiagnosisOptions options;
  options.seed = request.seed;
  options.threads = request.threads;
  options.progress = study_progress(progress);
  return analysis::diagnose(*model, options);
}

Cell steps_cell(double steps) { return steps > 0 ? Cell(steps) : Cell(""); }

// One diagnosis a row.
Table answers(const std::string& id, const std::string& title, const std::string& what) {
  return {
      .id = id,
      .title = title,
      .notes = {"Nats: held-out log score a collision that the model falls short of the best flexible one. CRPS: of "
                "the next speed. Steps: expected before failure; observed with its 90 % interval."},
      .columns = {{what},
                  {"verdict"},
                  {"95 % set, or the nearest"},
                  {"p"},
                  {"gap, nats"},
                  {"recalibrated"},
                  {"with effect"},
                  {"closed (90 %)"},
                  {"CRPS, rad/s"},
                  {"with effect"},
                  {"steps observed"},
                  {"as given"},
                  {"with effect"}}};
}

void add_answer(Table& table, const std::string& what, const Diagnosis& d) {
  std::string causes;
  for (const std::string& name : d.cause_set) causes += (causes.empty() ? "" : ", ") + name;
  if (causes.empty() && d.verdict == analysis::Verdict::unexplained && !d.causes.empty())
    causes = fmt::format("(nearest: {})", d.causes.front().name());
  std::vector<Cell> row{what, analysis::verdict_name(d.verdict), causes, d.p_as_given};
  if (d.shrinkage.size() >= 2) {
    const analysis::Shrinkage &nats = d.shrinkage[0], &crps = d.shrinkage[1];
    row.insert(row.end(), {nats.baseline, nats.recalibrated, nats.with_effect,
                           nats.closed ? Cell(fmt::format("{:.0f} % ({:.0f} to {:.0f})", 100 * *nats.closed,
                                                          100 * *nats.closed_lower, 100 * *nats.closed_upper))
                                       : Cell("not to be said"),
                           crps.baseline, crps.with_effect});
  } else {
    row.insert(row.end(), {"", "", "", "", "", ""});
  }
  const analysis::StepsBeforeFailure& s = d.steps;
  row.push_back(s.observed > 0 && std::isfinite(s.observed)
                    ? Cell(Estimate{s.observed, s.observed_lower, s.observed_upper})
                    : steps_cell(s.observed));
  row.push_back(steps_cell(s.baseline));
  row.push_back(steps_cell(s.with_effect));
  table.rows.push_back(std::move(row));
}

Table said(const std::string& id, const std::string& title, const Diagnosis& d) {
  Table table{.id = id, .title = title, .columns = {{"the diagnosis says"}}};
  for (const std::string& sentence : d.sentences) table.rows.push_back({sentence});
  return table;
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
  for (const double slope : {7.02, 9.59}) {
    Setting setting;
    setting.wheel.leg_length.assign(8, 0.1519);
    setting.slope_deg = slope;
    setting.initial_speed = *analysis::paper_launch(slope);
    const analysis::StudyOptions options{
        .tolerance = 0.05, .seed = request.seed, .threads = request.threads, .brief = true};
    const auto cell = [&](const analysis::Problem& problem) -> Cell {
      const analysis::Estimate e = analysis::study(problem, options).from_start;
      if (!std::isfinite(e.value)) return Infinite{};
      return Estimate{e.value, e.lower, e.upper};
    };
    analysis::Problem without = setting.problem();
    const analysis::UnchargedSticking uncharged(setting.map());
    without.map = markov::AnyReturnMap(uncharged);
    Setting coulomb = setting;
    coulomb.law = dynamics::Law::coulomb;
    const double critical = uncharged.sticking_friction(0);
    const double share = 1 - dynamics::TruncatedNormal(setting.friction.mean, setting.friction.sd, 0).cdf(critical);
    table.rows.push_back({slope, critical, share, cell(setting.problem()), cell(without), cell(coulomb.problem())});
  }
  return table;
}

// --- The paper's hypotheses as effects -----------------------------------------------------------------------------

Experiment halved(Experiment e, int hypothesis) {
  if (hypothesis == 1)
    for (analysis::Condition& c : e.conditions) c.initial_speed->sd /= 2;
  if (hypothesis == 2) {
    const double mean = e.wheel.mean_leg_length();
    for (double& length : e.wheel.leg_length) length = mean + (length - mean) / 2;
  }
  if (hypothesis == 3) {
    e.contact.restitution.sd /= 2;
    e.contact.friction.sd /= 2;
  }
  return e;
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
    const double half = 1.96 * s.sd / std::sqrt(static_cast<double>(s.steps));
    figure.series[0].lower.push_back(s.mean - half);
    figure.series[0].upper.push_back(s.mean + half);
  }
  return figure;
}

}  // namespace

void run_lessons(const LessonsRequest& request) {
  std::vector<Experiment> measured;
  for (const std::string& folder : request.data) measured.push_back(analysis::read_experiment(folder));
  PageFolder pages(request.out);
  const Provenance provenance{request.command, "the stand-in's wheel and contact unless said otherwise", request.seed,
                              version()};
  Page& page = pages.page();
  page.title = "Worked examples: what the diagnosis says";
  page.provenance = provenance;
  const auto section = [&](const std::string& id, const std::string& heading, const std::string& reading,
                           std::vector<Figure> figures, std::vector<Table> tables) {
    for (Figure& figure : figures) {
      if (figure.id.rfind(id, 0) != 0) figure.id = id + "-" + figure.id;
      figure.provenance = provenance;
    }
    for (Table& table : tables) table.provenance = provenance;
    pages.section(id, heading, reading, figures, std::move(tables));
  };

  {
    const Diagnosis d = diagnosed(laboratory_experiment({{"slip_reversal", {}}}, request), "coulomb wheel", request);
    Table table = answers("coulomb-wheel", "Nominal law `published`, the wheel obeys `coulomb`", "wheel");
    add_answer(table, "laboratory, coulomb, three conditions", d);
    section("coulomb-wheel", "A wheel that obeys coulomb, under the published law",
            "A laboratory wheel of the stand-in's conditions that sticks above mu_c, diagnosed with the published law.",
            map_figures(d), {table, said("coulomb-wheel-said", "In words", d)});
  }
  section("charge", "The charge on sticking collisions",
          "The published law charges friction where a foot would stick; without that charge rest is rarer.", {},
          {charge_table(request)});
  {
    Table table = answers("hypotheses", "The paper's hypotheses as effects: each source believed half as wide as it is",
                          "believed half as wide");
    const auto stand_in = laboratory_experiment({}, request);
    const char* names[] = {"nothing", "launch speeds (H1)", "differences of the legs (H2)",
                           "restitution and friction (H3)"};
    for (int h = 0; h < 4; ++h) add_answer(table, names[h], diagnosed(halved(stand_in, h), names[h], request));
    table.notes.push_back(
        "A source that dominates moves the steps before failure when it is believed wrongly, not only the likelihood.");
    section("hypotheses", "H1, H2 and H3 as effects",
            "Simulated trials of the stand-in; the nominal model believes each source half as wide in turn.", {},
            {table});
  }
  for (std::size_t i = 0; i < measured.size(); ++i) {
    const std::string name = std::filesystem::path(request.data[i]).lexically_normal().filename().string();
    const std::string id = fmt::format("data-{}", i + 1);
    Table table = answers(id + "-answers", measured[i].title, "nominal law");
    std::vector<Table> tables;
    std::vector<Figure> figures;
    for (const dynamics::Law law : {dynamics::Law::published, dynamics::Law::coulomb})
      for (const bool after : {true, false}) {
        Experiment e = measured[i];
        e.contact.law = law;
        if (!after) {
          if (e.columns.omega_plus == analysis::Presence::none) continue;
          e.columns.omega_plus = analysis::Presence::none;
          for (analysis::MeasuredTrial& trial : e.trials)
            for (analysis::MeasuredCollision& c : trial.collisions) c.omega_plus.reset();
        }
        const std::string what =
            fmt::format("{}{}", dynamics::law_name(law), after ? "" : ", whole steps (omega_plus left out)");
        const Diagnosis d = diagnosed(e, what, request);
        add_answer(table, what, d);
        tables.push_back(said(fmt::format("{}-{}{}", id, dynamics::law_name(law), after ? "" : "-steps"), what, d));
      }
    tables.insert(tables.begin(), table);
    if (measured[i].system == analysis::System::rimless_wheel && measured[i].columns.leg == analysis::Presence::all) {
      const analysis::StepBalances balances = analysis::step_balances(measured[i]);
      tables.push_back(balance_table(id + "-balance", name, balances));
      if (!balances.slides.empty()) figures.push_back(balance_figure(id + "-slides", balances));
    }
    section(id, measured[i].title.empty() ? name : measured[i].title,
            "Where no law of the catalogue fits, the balance of whole steps says what one would have to do.", figures,
            std::move(tables));
  }
  pages.write_index();
  fmt::print("{}\n", (std::filesystem::path(request.out) / "index.html").string());
}

}  // namespace metastable::reports
