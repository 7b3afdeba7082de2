#include "reports/commands/report_command.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <utility>

#include "analysis/paper/energy_losses.h"
#include "analysis/sensitivity/rigid_body_check.h"
#include "analysis/sensitivity/rolled_steps.h"
#include "analysis/sensitivity/sweep.h"
#include "analysis/study/consistency.h"
#include "analysis/study/how_it_fails.h"
#include "analysis/study/steady_launch.h"
#include "dynamics/wheel/contact_law.h"
#include "markov/parallel.h"
#include "reports/output/interrupt.h"
#include "reports/output/page_folder.h"
#include "reports/output/version.h"
#include "reports/study/last_moments_text.h"
#include "reports/study/report_figures.h"
#include "reports/study/report_tables.h"
#include "reports/study/study_progress.h"
#include "reports/study/study_text.h"

namespace metastable::reports {
namespace {

constexpr std::array<double, 4> energy_spreads = {0.05, 0.1, 0.15, 0.2};  // Fig. 8
constexpr int energy_collisions = 16;                                     // of a trial
// Landings to each side of a parameter under `settled`, in landings of a cell of a map: with the 40000 of the default a
// change by 1 % is known to 0.5 % of the steps where rests are frequent.
constexpr double sensitivity_share = 1.5;
constexpr std::uint64_t map_rests = 1000;            // of a cell under `settled`: its steps are then known to 6 %
constexpr std::uint64_t few_rests = 100;             // of a cell: of fewer a chain is asked
constexpr double rare_tolerance = 0.1;               // of cells that the chain has to answer, where nothing rests
constexpr std::size_t map_units = study_units / 20;  // a cell's share of a study's work
constexpr std::size_t map_cells = 16 + 12;           // of one ramp's two maps

std::string slope_id(const std::string& stem, const analysis::Setting& setting) {
  std::string id = fmt::format("{}-{}", stem, setting.slope_deg);
  for (char& c : id)
    if (c == '.') c = '-';
  return id;
}

// Says in a figure's or table's title what it is of.
std::string titled(const std::string& what, const analysis::Setting& setting) {
  return fmt::format("{}: {}", law_and_ramp(setting), what);
}

// Holds expected steps over two parameters under one law.
struct Map {
  analysis::Setting base;
  std::vector<Estimate> steps;
  bool rolled = false;
};

// Writes the report as it grows: files in the folder, sections of the page.
class Report {
 public:
  explicit Report(const ReportRequest& request)
      : request_(request),
        pages_(request.out),
        progress_("report", work()),
        provenance_{request.command, {}, request.study.seed, version()} {
    Page& page = pages_.page();
    page.title = "How long does a rimless wheel roll before it rests?";
    page.provenance = provenance_for(request.settings);
  }

  void write(Answer& answer) {
    study_all();
    answers();
    failures();
    hangs_on();
    spreads();
    means();
    details();
    pages_.write_index();
    pages_.finish(answer);
  }

 private:
  std::size_t work() const {
    const std::size_t ramps = request_.settings.size();
    return study_units * (laws().size() * ramps + 2 * ramps + energy_spreads.size()) +
           map_units * 2 * map_cells * ramps;
  }

  std::uint64_t landings(double share) const {
    return static_cast<std::uint64_t>(std::ceil(share * request_.landings));
  }
  dynamics::Law asked() const { return request_.settings.front().law; }
  // Returns the paper's and its alternatives, and whichever was asked for.
  std::vector<dynamics::Law> laws() const {
    std::vector<dynamics::Law> all{dynamics::Law::published, dynamics::Law::coulomb, dynamics::Law::settled};
    if (std::ranges::find(all, asked()) == all.end()) all.push_back(asked());
    return all;
  }
  // Returns the two that stand side by side: that of rigid bodies, and the one asked for or the paper's.
  std::array<dynamics::Law, 2> compared() const {
    return {dynamics::Law::settled, asked() == dynamics::Law::settled ? dynamics::Law::published : asked()};
  }

  // Returns nullptr where there is no such wheel under the law.
  const Studied* study_of(dynamics::Law law, double slope_deg) const {
    const auto found = std::ranges::find_if(studied_, [&](const Studied& one) {
      return one.study.setting->law == law && one.study.setting->slope_deg == slope_deg;
    });
    return found == studied_.end() ? nullptr : &*found;
  }
  std::vector<const Studied*> compared_on(double slope_deg) const {
    std::vector<const Studied*> found;
    for (const dynamics::Law law : compared())
      if (const Studied* one = study_of(law, slope_deg)) found.push_back(one);
    return found;
  }

  Provenance provenance_for(const std::vector<analysis::Setting>& settings) const {
    Provenance provenance = provenance_;
    for (const analysis::Setting& setting : settings)
      provenance.settings += (provenance.settings.empty() ? "" : "\n") + setting.describe();
    return provenance;
  }

  analysis::Setting launched(const analysis::Setting& setting) const {
    analysis::StudyOptions options = request_.study;
    options.progress = [](double, const std::string&) { check_interrupt(); };
    return analysis::steadily_launched(setting, options);
  }

  Provenance provenance_for_all() const {
    std::vector<analysis::Setting> settings;
    for (const Studied& one : studied_) settings.push_back(*one.study.setting);
    return provenance_for(settings);
  }

  void study_all() {
    for (const dynamics::Law law : laws()) {
      for (analysis::Setting setting : request_.settings) {
        setting.law = law;
        try {
          analysis::check_setting(setting, request_.study.method);
        } catch (const std::invalid_argument&) {
          if (law == asked()) throw;
          progress_.advance(study_units);
          continue;  // there is no such wheel under this law
        }
        analysis::StudyOptions options = request_.study;
        options.progress = study_progress(progress_);
        Studied one;
        try {
          one.study = analysis::study(setting, options);
        } catch (const analysis::NoRegime&) {
          if (law == request_.settings.front().law) throw;
          options.progress(1, "");
          continue;  // none rolls on under this law
        }
        options.progress(1, "");
        one.thresholds = analysis::rest_thresholds(one.study);
        studied_.push_back(std::move(one));
      }
    }
  }

  void answers() {
    std::vector<Studied> ordered;  // the two that the sentences name come first
    for (const bool first : {true, false})
      for (const dynamics::Law law : laws())
        for (const Studied& one : studied_)
          if (one.study.setting->law == law && first == (law == compared()[0])) ordered.push_back(one);
    for (const analysis::Setting& setting : request_.settings) {
      const std::vector<const Studied*> two = compared_on(setting.slope_deg);
      pages_.page().lead.push_back(answer_sentence(two.front()->study, two.size() > 1 ? &two.back()->study : nullptr));
    }
    pages_.section(
        "answer", "The chance of still rolling",
        "A step is one landing of the next leg. The law settled follows a rigid body through impacts, hops and slides "
        "until the landed foot stands: it is what rigid-body engines obey, and the one to take for a real wheel; "
        "published is the paper’s. On this scale a curve is straight as soon as the wheel has forgotten its launch. " +
            rests_text(ordered),
        {survival_figure(ordered, provenance_for_all())}, {answer_table(ordered, provenance_for_all())}, {},
        Arrangement::beside);
  }

  // Shows how the law that real wheels obey fails, or the next one before it under which this ramp's wheel fails.
  void failures() {
    std::string reading;
    std::vector<Figure> telling;
    std::vector<Fold> folds;
    for (const analysis::Setting& setting : request_.settings) {
      for (auto one = studied_.rbegin(); one != studied_.rend(); ++one) {
        const analysis::Setting& of = *one->study.setting;
        if (of.slope_deg != setting.slope_deg) continue;
        analysis::StudyOptions options = request_.study;
        options.progress = {};
        const analysis::LastMoments moments = analysis::how_it_fails(of, one->study, options);
        if (!moments.reason.empty()) continue;
        const std::string id = slope_id("last-steps", of), where = law_and_ramp(of);
        std::vector<Figure> figures = last_moments_figures(moments, id, where, provenance_for({of}));
        const auto most = figures.begin() + static_cast<std::ptrdiff_t>(telling_number(moments));
        reading += fmt::format("{}Under {} on {} deg {}.", reading.empty() ? "" : " ", dynamics::law_name(of.law),
                               of.slope_deg, last_moments_sentence(moments));
        telling.push_back(std::move(*most));
        figures.erase(most);
        folds.push_back({"The last steps in numbers, " + where,
                         {},
                         std::move(figures),
                         {last_moments_table(moments, id + "-table", where, provenance_for({of}))}});
        break;
      }
    }
    if (telling.empty()) return;
    pages_.section("how-it-fails", "How it fails",
                   reading + " The figures go back from the collision that brings it to rest.", telling, {},
                   std::move(folds));
  }

  Hanging hanging(const Studied& one) {
    const analysis::Setting& setting = *one.study.setting;
    const auto tell = study_progress(progress_);
    if (setting.law == dynamics::Law::settled)
      return {setting, analysis::rolled_sensitivities(setting, {.landings = landings(sensitivity_share),
                                                                .seed = request_.study.seed,
                                                                .threads = request_.study.threads,
                                                                .progress = [&](double share) { tell(share, ""); }})};
    Hanging found{setting, analysis::sensitivities(one.study, request_.study)};
    tell(1, "");
    return found;
  }

  void hangs_on() {
    std::string reading;
    std::vector<Figure> main, others;
    std::vector<Table> tables;
    for (const analysis::Setting& setting : request_.settings) {
      std::vector<Hanging> found;
      for (const Studied* one : compared_on(setting.slope_deg)) found.push_back(hanging(*one));
      bool first = true;
      for (const Hanging& one : found) {
        if (one.sensitivities.ranked.empty()) continue;
        if (const std::string says = first ? sensitivity_sentence(one) : ""; !says.empty())
          reading +=
              fmt::format("Under {} on {} deg {}. ", dynamics::law_name(one.setting.law), one.setting.slope_deg, says);
        const std::string id = slope_id(fmt::format("depends-on-{}", dynamics::law_name(one.setting.law)), one.setting);
        (first ? main : others).push_back(sensitivity_figure(id, one, provenance_for({one.setting})));
        first = false;
      }
      std::vector<analysis::Setting> settings;
      for (const Hanging& one : found) settings.push_back(one.setting);
      tables.push_back(sensitivity_table(slope_id("depends-on", setting), found, provenance_for(settings)));
    }
    std::erase_if(tables, [](const Table& table) { return table.rows.empty(); });
    if (main.empty()) return;
    pages_.section("depends-on", "What it depends on", reading + "Whiskers are numerical, 95 %.", main, {},
                   {{"All parameters in numbers, and the other law", {}, std::move(others), std::move(tables)}});
  }

  // Returns expected steps over two axes; under `settled` of wheels rolled, from the chain where they hardly rest.
  Map map(const analysis::Setting& base, const std::vector<analysis::SweepAxis>& axes) {
    Map map{base, {}, base.law == dynamics::Law::settled};
    if (!map.rolled) {
      analysis::sweep(base, axes, 0, request_.study, [&](std::size_t, const analysis::SweepPoint& point) {
        if (point.failure) std::rethrow_exception(point.failure);
        map.steps.push_back(point.study.steps.from_start);
        progress_.advance(map_units);
      });
      return map;
    }
    map.steps.resize(analysis::sweep_size(axes));
    const analysis::Setting from = launched(base);
    std::vector<char> rare(map.steps.size(), 0);
    markov::parallel_for(map.steps.size(), request_.study.threads, [&](std::size_t i) {
      const analysis::RigidBodyCheck rolled = analysis::rigid_body_check(
          analysis::sweep_setting(from, axes, i), {.collisions = static_cast<std::uint64_t>(request_.landings),
                                                   .rests = map_rests,
                                                   .seed = request_.study.seed,
                                                   .threads = 1,
                                                   .progress = [](double) { check_interrupt(); }});
      map.steps[i] = rolled.steps;
      // A bound is all there is where some wheels hop away for ever; where hardly any rests the chain tells more.
      rare[i] = !rolled.reason.empty() || (rolled.at_least && rolled.rests < few_rests);
      progress_.advance(map_units);
    });
    analysis::StudyOptions options = request_.study;
    options.tolerance = std::max(options.tolerance, rare_tolerance);
    options.progress = [](double, const std::string&) { check_interrupt(); };
    for (std::size_t i = 0; i < rare.size(); ++i) {
      if (!rare[i]) continue;
      const analysis::SweepPoint point = analysis::sweep_point(base, axes, i, options);
      if (!point.failure) {
        map.steps[i] = point.study.steps.from_start;
        continue;
      }
      try {
        std::rethrow_exception(point.failure);
      } catch (const analysis::StatesTooCoarse&) {  // the bound that wheels gave stays
      }
    }
    return map;
  }

  // Shows the maps of one ramp under both laws with one scale of colours.
  void maps(const std::string& stem, const std::string& what, const analysis::Setting& setting,
            const analysis::SweepAxis& down, const analysis::SweepAxis& across, std::vector<Figure>& figures,
            std::vector<Table>& tables) {
    std::vector<Map> both;
    double low = std::numeric_limits<double>::infinity(), high = 0;
    for (const dynamics::Law law : compared()) {
      analysis::Setting base = setting;
      base.law = law;
      if (!study_of(law, base.slope_deg) || !analysis::matters(base, down.parameter) ||
          !analysis::matters(base, across.parameter)) {  // there is no such wheel, or nothing that varies
        progress_.advance(map_units * down.values.size() * across.values.size());
        continue;
      }
      both.push_back(map(base, {down, across}));
      for (const Estimate& steps : both.back().steps)
        if (std::isfinite(steps.value)) low = std::min(low, steps.value), high = std::max(high, steps.value);
    }
    if (low > high) low = high = 1;
    for (const Map& one : both) {
      const bool plain = one.base.law == asked();
      const std::string id =
          slope_id(plain ? stem : fmt::format("{}-{}", stem, dynamics::law_name(one.base.law)), one.base);
      Provenance provenance = provenance_for({one.base});
      provenance.settings += fmt::format("; varied here: {} and {}", analysis::parameter_label(down.parameter),
                                         analysis::parameter_label(across.parameter));
      figures.push_back(grid_figure(id, law_and_ramp(one.base), down, across, one.steps, {low, high}, provenance));
      tables.push_back(
          grid_table(id, titled("expected steps over the " + what, one.base), down, across, one.steps, provenance));
      if (one.rolled)
        tables.back().notes.push_back(fmt::format(
            "From wheels that are rolled, {} landings or {} rests a cell; where hardly any rests, from the chain.",
            request_.landings, map_rests));
    }
  }

  void spreads() {
    const std::vector<double> values = analysis::axis_values(0.05, 0.2, 0.05);
    std::vector<Figure> figures;
    std::vector<Table> tables;
    for (const analysis::Setting& setting : request_.settings)
      maps("spreads", "spreads of η and μ", setting, {analysis::Parameter::restitution_sd, values},
           {analysis::Parameter::friction_sd, values}, figures, tables);
    map_section("spreads", "Over the spreads of restitution and friction",
                "Each cell holds expected steps. To the right friction scatters more, upward restitution does; the "
                "direction in which the number changes faster holds the source that matters.",
                figures, std::move(tables));
  }

  void means() {
    std::vector<Figure> figures;
    std::vector<Table> tables;
    for (analysis::Setting setting : request_.settings) {
      setting.restitution.sd = setting.friction.sd = 0.15;  // Fig. 9
      maps("means", "means of η and μ (sd 0.15, the grid of Fig. 9)", setting,
           {analysis::Parameter::restitution_mean, {0.3, 0.5, 0.7}},
           {analysis::Parameter::friction_mean, analysis::axis_values(0.2, 0.5, 0.1)}, figures, tables);
    }
    map_section(
        "means", "Over the means of restitution and friction",
        "Each cell is one floor, both with the spread of 0.15 of the paper’s Fig. 9: mean friction grows to the "
        "right, mean restitution upward.",
        figures, std::move(tables));
  }

  void map_section(const std::string& id, const std::string& heading, const std::string& reading,
                   const std::vector<Figure>& figures, std::vector<Table> tables) {
    if (figures.empty()) return;
    pages_.section(id, heading, reading, figures, {},
                   {{"The same numbers with their intervals", {}, {}, std::move(tables)}});
  }

  void details() {
    std::vector<Fold> folds;
    folds.push_back({"Every number, law by law",
                     {"Read down a column for one ramp under one contact law; “infinite” means that launches this fast "
                      "never come to rest, whatever the contacts do."},
                     {},
                     {ramps_table(studied_, provenance_for_all())}});
    folds.push_back({"Speeds of wheels that still roll, and the return map",
                     {"Speeds just before a collision once the launch is forgotten. In a return map each dot is one "
                      "simulated step; where the mean crosses the diagonal the wheel would roll steadily, and dots to "
                      "the lower left are on their way to rest."},
                     {density_figure(studied_, provenance_for_all())},
                     {}});
    for (const analysis::Setting& setting : request_.settings)
      folds.back().figures.push_back(return_map_figure(launched(setting), provenance_for({setting})));
    energies(folds);
    std::vector<std::string> settings;
    for (const analysis::Setting& setting : request_.settings) settings.push_back(setting.describe() + ".");
    settings.insert(
        settings.begin(),
        "The steps come from a Markov chain sampled from the stochastic return map of the wheel. Model: "
        "Nanayakkara, Byl, Liu, Song, Villabona, “Dominant Sources of Variability in Passive Walking” (ICRA "
        "2012).");
    folds.push_back(
        {"Assumptions and resolution", std::move(settings), {}, {resolution_table(studied_, provenance_for_all())}});
    pages_.section("details", "Details", "What stands behind the numbers above.", {}, {}, std::move(folds));
  }

  // Shows the energies of single impacts: a landing under settled is many, with slides between.
  void energies(std::vector<Fold>& folds) {
    if (asked() == dynamics::Law::settled) return progress_.advance(study_units * energy_spreads.size());
    std::vector<analysis::EnergyLosses> losses;
    std::vector<analysis::Setting> settings;
    for (std::size_t k = 0; k < energy_spreads.size(); ++k) {
      analysis::Setting setting = request_.settings.front();
      setting.restitution.sd = setting.friction.sd = energy_spreads[k];
      setting = launched(setting);
      losses.push_back(analysis::energy_losses(setting, {.trials = request_.energy_trials,
                                                         .collisions = energy_collisions,
                                                         .seed = request_.study.seed,
                                                         .threads = request_.study.threads}));
      settings.push_back(setting);
      progress_.advance(study_units);
    }
    folds.push_back({"Energy losses of a collision, beside the paper’s",
                     {"Means with 95 % intervals, and the spread from collision to collision."},
                     {},
                     {energy_table(losses, asked(), provenance_for(settings))}});
  }

  const ReportRequest& request_;
  PageFolder pages_;
  Progress progress_;
  Provenance provenance_;
  std::vector<Studied> studied_;
};

}  // namespace

void run_report(const ReportRequest& request) {
  Report report(request);
  Answer answer(request.json);
  report.write(answer);
}

}  // namespace metastable::reports
