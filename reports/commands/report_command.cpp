#include "reports/commands/report_command.h"

#include <fmt/format.h>

#include <array>
#include <filesystem>
#include <utility>

#include "analysis/paper/energy_losses.h"
#include "analysis/sensitivity/sweep.h"
#include "analysis/study/how_it_fails.h"
#include "dynamics/wheel/contact_law.h"
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

// Writes the report as it grows: files in the folder, sections of the page.
class Report {
 public:
  explicit Report(const ReportRequest& request)
      : request_(request),
        pages_(request.out),
        progress_("report", work()),
        provenance_{request.command, {}, request.study.seed, version()} {
    Page& page = pages_.page();
    page.title = "Metastability of the rimless wheel";
    page.intro = {
        "Expected steps before a rimless wheel on a ramp comes to rest, from a Markov chain sampled from its "
        "stochastic return map. Model: Nanayakkara, Byl, Liu, Song, Villabona, “Dominant Sources of "
        "Variability in Passive Walking” (ICRA 2012)."};
    for (const analysis::Setting& setting : request.settings) page.intro.push_back(setting.describe() + ".");
    page.provenance = provenance_for(request.settings);
  }

  void write(Answer& answer) {
    ramps();
    for (const analysis::Setting& setting : request_.settings) spreads(setting);
    for (const analysis::Setting& setting : request_.settings) means(setting);
    energies();
    pages_.write_index();
    pages_.finish(answer);
  }

 private:
  std::size_t work() const {
    const std::size_t ramps = request_.settings.size();
    return study_units * (3 * ramps + ramps * (16 + 12) + energy_spreads.size());
  }

  Provenance provenance_for(const std::vector<analysis::Setting>& settings) const {
    Provenance provenance = provenance_;
    for (const analysis::Setting& setting : settings)
      provenance.settings += (provenance.settings.empty() ? "" : "\n") + setting.describe();
    return provenance;
  }

  void ramps() {
    std::vector<Studied> studied;
    std::vector<analysis::Setting> settings;
    for (const dynamics::Law law : {dynamics::Law::published, dynamics::Law::coulomb, dynamics::Law::settled}) {
      for (analysis::Setting setting : request_.settings) {
        setting.law = law;
        try {
          analysis::check_setting(setting, request_.study.method);
        } catch (const std::invalid_argument&) {
          if (law == request_.settings.front().law) throw;
          progress_.advance(study_units);
          continue;  // there is no such wheel under this law
        }
        analysis::StudyOptions options = request_.study;
        options.progress = study_progress(progress_);
        Studied one{analysis::study(setting, options), {}};
        options.progress(1, "");
        one.thresholds = analysis::rest_thresholds(one.study);
        settings.push_back(setting);
        studied.push_back(std::move(one));
      }
    }
    const Provenance provenance = provenance_for(settings);
    section(
        "ramps", "The ramps side by side",
        "Read down a column for one ramp under one contact law; “infinite” means that launches this fast never come "
        "to rest, whatever the contacts do. " +
            laws_text(studied),
        {}, {ramps_table(studied, provenance)});
    section(
        "regime", "What survivors look like",
        "Left: speeds just before a collision once the start is forgotten; right: how fast the chance of still rolling "
        "falls, straight on this scale as soon as the regime is metastable.",
        {density_figure(studied, provenance), survival_figure(studied, provenance)}, {});
    for (const analysis::Setting& setting : request_.settings) last_steps(setting, studied);
    std::vector<Figure> maps;
    for (const analysis::Setting& setting : request_.settings)
      maps.push_back(return_map_figure(setting, provenance_for({setting})));
    section("return-map", "The return map and its cloud",
            "Each dot is one simulated step; where the mean crosses the diagonal the wheel would roll steadily, and "
            "dots to "
            "the lower left are on their way to rest.",
            std::move(maps), {});
  }

  // Shows them of the law that real wheels obey, or of the next one before it under which this ramp's wheel fails.
  void last_steps(const analysis::Setting& setting, const std::vector<Studied>& studied) {
    for (auto one = studied.rbegin(); one != studied.rend(); ++one) {
      const analysis::Setting& of = *one->study.setting;
      if (of.slope_deg != setting.slope_deg) continue;
      analysis::StudyOptions options = request_.study;
      options.progress = {};
      const analysis::LastMoments moments = analysis::how_it_fails(of, one->study, options);
      if (!moments.reason.empty()) continue;
      const std::string id = slope_id("last-steps", of);
      section(id, fmt::format("How it fails at {} deg under the law {}", of.slope_deg, dynamics::law_name(of.law)),
              "Backwards from the collision that brings it to rest: speeds and contacts of the last collisions beside "
              "those of all others.",
              last_moments_figures(moments, id, provenance_for({of})),
              {last_moments_table(moments, id + "-table", provenance_for({of}))});
      return;
    }
  }

  // Shows one table and one map of expected steps over two axes.
  void grid(const std::string& id, const std::string& heading, const std::string& title, const std::string& reading,
            const analysis::Setting& base, const analysis::SweepAxis& down, const analysis::SweepAxis& across) {
    std::vector<analysis::Metastability> studies;
    analysis::sweep(base, {down, across}, 0, request_.study, [&](std::size_t, const analysis::SweepPoint& point) {
      if (point.failure) std::rethrow_exception(point.failure);
      studies.push_back(point.study);
      progress_.advance(study_units);
    });
    Provenance provenance = provenance_for({base});
    provenance.settings += fmt::format("; varied here: {} and {}", analysis::parameter_label(down.parameter),
                                       analysis::parameter_label(across.parameter));
    section(id, heading, reading, {grid_figure(id, title, down, across, studies, provenance)},
            {grid_table(id, title, down, across, studies, provenance)});
  }

  static std::string slope_id(const std::string& stem, const analysis::Setting& setting) {
    std::string id = fmt::format("{}-{}", stem, setting.slope_deg);
    for (char& c : id)
      if (c == '.') c = '-';
    return id;
  }

  void spreads(const analysis::Setting& setting) {
    const std::vector<double> values = analysis::axis_values(0.05, 0.2, 0.05);
    grid(slope_id("spreads", setting), fmt::format("Spreads of restitution and friction at {} deg", setting.slope_deg),
         fmt::format("Expected steps over the spreads of η and μ, {} deg", setting.slope_deg),
         "Going right friction scatters more, going up restitution does; the direction in which the number changes "
         "faster holds "
         "the source that matters.",
         setting, {analysis::Parameter::restitution_sd, values}, {analysis::Parameter::friction_sd, values});
  }

  void means(analysis::Setting setting) {
    setting.restitution.sd = setting.friction.sd = 0.15;  // Fig. 9
    grid(slope_id("means", setting), fmt::format("Means of restitution and friction at {} deg", setting.slope_deg),
         fmt::format("Expected steps over the means of η and μ (sd 0.15, the grid of Fig. 9), {} deg",
                     setting.slope_deg),
         "Each cell is one floor: mean friction grows to the right, mean restitution upward, both with the paper's "
         "spread of 0.15.",
         setting, {analysis::Parameter::restitution_mean, {0.3, 0.5, 0.7}},
         {analysis::Parameter::friction_mean, analysis::axis_values(0.2, 0.5, 0.1)});
  }

  // Shows the energies of single impacts: a landing under settled is many, with slides between.
  void energies() {
    if (request_.settings.front().law == dynamics::Law::settled)
      return progress_.advance(study_units * energy_spreads.size());
    std::vector<analysis::EnergyLosses> losses;
    std::vector<analysis::Setting> settings;
    for (std::size_t k = 0; k < energy_spreads.size(); ++k) {
      analysis::Setting setting = request_.settings.front();
      setting.restitution.sd = setting.friction.sd = energy_spreads[k];
      losses.push_back(analysis::energy_losses(setting, {.trials = request_.energy_trials,
                                                         .collisions = energy_collisions,
                                                         .seed = request_.study.seed,
                                                         .threads = request_.study.threads}));
      settings.push_back(setting);
      progress_.advance(study_units);
    }
    section("energy", "Energy losses of a collision",
            "Ours beside the paper's printed figures: means with 95 % intervals, and the spread from collision to "
            "collision.",
            {}, {energy_table(losses, provenance_for(settings))});
  }

  void section(const std::string& id, const std::string& heading, const std::string& reading,
               const std::vector<Figure>& figures, std::vector<Table> tables) {
    pages_.section(id, heading, reading, figures, std::move(tables));
  }

  const ReportRequest& request_;
  PageFolder pages_;
  Progress progress_;
  Provenance provenance_;
};

}  // namespace

void run_report(const ReportRequest& request) {
  Report report(request);
  Answer answer(request.json);
  report.write(answer);
}

}  // namespace metastable::reports
