#include "reports/experiment_commands/study_command.h"

#include <fmt/format.h>

#include <filesystem>
#include <iterator>
#include <vector>

#include "analysis/experiment/experiment.h"
#include "analysis/paper/paper_claims.h"
#include "analysis/paper/stopping.h"
#include "reports/description/paper_figures.h"
#include "reports/description/paper_tables.h"
#include "reports/description/stopping_pages.h"
#include "reports/output/page_folder.h"
#include "reports/output/progress.h"
#include "reports/output/version.h"

namespace metastable::reports {
namespace {

using analysis::PaperExperiments;

// Holds the panels of one figure of the paper: under the first variant, the paper's own, and under all others.
struct Panels {
  std::vector<Figure> papers, others;
};

template <typename Make>
Panels all_variants(const Studies& studies, const Make& make) {
  Panels all;
  for (const analysis::VariantStudy& study : studies) {
    std::vector<Figure> figures = make(study);
    std::vector<Figure>& to = &study == &studies.front() ? all.papers : all.others;
    to.insert(to.end(), std::make_move_iterator(figures.begin()), std::make_move_iterator(figures.end()));
  }
  return all;
}

// Shows the paper's own panels; other laws and all numbers are folded.
void figure_section(PageFolder& pages, const std::string& id, const std::string& heading, const std::string& reading,
                    Panels panels, Table table) {
  std::vector<Table> tables;
  tables.push_back(std::move(table));
  pages.section(id, heading, reading, panels.papers, {},
                {{"Under the other readings and laws", {}, std::move(panels.others), {}},
                 {"In numbers", {}, {}, std::move(tables)}});
}

Studies study_all(const std::vector<analysis::Variant>& variants, const PaperExperiments& experiments,
                  const analysis::PaperStudyOptions& options) {
  Studies studies;
  for (const analysis::Variant& variant : variants)
    studies.push_back(analysis::study_variant(variant, experiments, options));
  return studies;
}

// Holds what the page shows.
struct Studied {
  Studies studies;
  analysis::Stopping stopping;
  std::vector<analysis::DesignChange> designs;
};

Studied studied(const PaperExperiments& experiments, analysis::PaperStudyOptions options) {
  const std::vector<analysis::Variant> variants = analysis::paper_variants();
  Progress progress("study", variants.size() * analysis::paper_study_units() + analysis::design_change_count());
  options.progress = [&progress] { progress.advance(); };
  const analysis::Setting stops = analysis::stopping_setting();
  return {study_all(variants, experiments, options),
          analysis::stopping(stops, options.trials, options.seed, options.threads),
          analysis::design_changes(stops, options.trials, options.seed, options.threads, options.progress)};
}

void begin_page(Page& page, const PaperExperiments& experiments, const Provenance& provenance) {
  page.title = "Dominant sources of variability in passive walking: the paper's study, regenerated";
  page.intro = {
      "T. Nanayakkara, K. Byl, H. Liu, X. Song, T. Villabona, “Dominant Sources of Variability in Passive Walking” "
      "(ICRA "
      "2012): its simulated figures and its claims, under its own contact law in two readings, under a law that is "
      "consistent with Coulomb friction, and under the landings of a rigid body followed until they settle.",
      experiments.stand_in ? "Its measurements are not public: what is called stand-in here is a simulation too."
                           : "Measured trials: " + experiments.title + "."};
  page.provenance = provenance;
}

void claims_section(PageFolder& pages, const Studies& studies, const PaperExperiments& experiments,
                    const Provenance& provenance) {
  const std::vector<analysis::Claim> claims = analysis::paper_claims(studies, experiments);
  pages.page().lead = claims_sentences(claims, studies);
  pages.section(
      "claims", "Claim by claim",
      "Which of the paper’s claims come out under each law and reading. Empty: the simulation says nothing of it, "
      "mostly "
      "because hardly a trial gets so far.",
      {claims_figure(claims, studies, provenance)}, {},
      {{"How many, by verdict", {}, {}, {claims_count_table(claims, studies, provenance)}},
       {"Each claim, its verdicts and the numbers behind them",
        {"Each cell gives the verdict first and then the numbers behind it."},
        {},
        {claims_table(claims, studies, experiments, provenance)}},
       {"What the law and the reading change", {}, {}, {changes_table(claims, studies, experiments, provenance)}},
       {"What counts as reproduced", {}, {}, {readings_table(claims, provenance)}}});
}

void hypotheses_section(PageFolder& pages, const Studies& studies, const Provenance& provenance) {
  const std::vector<analysis::Hypothesis> hypotheses = analysis::paper_hypotheses(studies);
  pages.section(
      "hypotheses", "The three hypotheses",
      "A source that matters takes a large share of the variance with it: the total Sobol’ index of the "
      "steady speed, at the mean friction where it is largest.",
      {hypotheses_figure(hypotheses, studies, provenance)}, {},
      {{"The verdicts, with intervals and for the steps", {}, {}, {hypotheses_table(hypotheses, studies, provenance)}},
       {"All shares of the variance", {}, {}, {variance_table(studies, provenance)}}});
}

void stopping_section(PageFolder& pages, const analysis::Stopping& stopping,
                      const std::vector<analysis::DesignChange>& designs, const Provenance& provenance) {
  pages.section("stopping", "Why a wheel that rolls steadily stops: the law settled", stopping_story(stopping),
                {sticking_figure(stopping, provenance), resting_figure(stopping, provenance)},
                {design_table(designs, provenance)},
                {{"Leg by leg in numbers", {}, {}, {stopping_table(stopping, provenance)}}});
}

// Adds the launches: Fig. 4, Fig. 6 and the leg lengths.
void launch_sections(PageFolder& pages, const Studies& studies, const PaperExperiments& experiments,
                     const Provenance& provenance) {
  Panels fig4 = all_variants(studies, [&](const auto& s) { return fig4_figures(s, provenance); });
  fig4.papers.insert(fig4.papers.begin(), fig4_experiment_figure(experiments, provenance));
  figure_section(pages, "fig4", "Fig. 4: two starts, one steady state",
                 "Lines that meet forget their start; bands are standard errors.", std::move(fig4),
                 fig4_table(studies, experiments, provenance));
  figure_section(
      pages, "fig6", "Fig. 6: launch speed and friction",
      "Three launches at one friction each; a steady state that remembers its launch would keep the lines apart.",
      all_variants(studies, [&](const auto& s) { return fig6_figures(s, experiments, provenance); }),
      fig6_table(studies, provenance));
  pages.section("equal-legs", "Sec. IV-A: leg lengths",
                "The runs of Fig. 6 with the measured legs and with eight equal ones.", {}, {},
                {{"In numbers", {}, {}, {equal_legs_table(studies, provenance)}}});
}

// Adds the contact: Figs. 7 to 9.
void contact_sections(PageFolder& pages, const Studies& studies, const PaperExperiments& experiments,
                      const Provenance& provenance) {
  figure_section(pages, "fig7", "Fig. 7: spreads of restitution and friction",
                 "From panel to panel friction scatters more, from line to line restitution does.",
                 all_variants(studies, [&](const auto& s) { return fig7_figures(s, experiments, provenance); }),
                 fig7_table(studies, experiments, provenance));
  figure_section(pages, "fig8", "Fig. 8: energy losses", "Bars are standard deviations from collision to collision.",
                 all_variants(studies, [&](const auto& s) { return fig8_figures(s, provenance); }),
                 fig8_table(studies, provenance));
  figure_section(pages, "fig9", "Fig. 9: means of restitution and friction",
                 "From panel to panel friction grows, from line to line restitution does.",
                 all_variants(studies, [&](const auto& s) { return fig9_figures(s, experiments, provenance); }),
                 fig9_table(studies, provenance));
}

}  // namespace

void run_study(const StudyRequest& request) {
  const analysis::PaperStudyOptions& options = request.options;
  const PaperExperiments experiments = request.data.empty()
                                           ? analysis::simulated_experiments(options.seed, options.threads)
                                           : analysis::paper_experiments(analysis::read_experiment(request.data));
  PageFolder pages(request.out);
  Answer answer(request.json);
  const auto [studies, stopping, designs] = studied(experiments, options);
  const Provenance provenance{
      request.command,
      fmt::format(
          "the paper's wheel; {} trials of 16 collisions a profile; {} samples a variance share (settled: an eighth); "
          "experiment: {}",
          options.trials, options.samples, experiments.title),
      options.seed, version()};
  begin_page(pages.page(), experiments, provenance);
  claims_section(pages, studies, experiments, provenance);
  hypotheses_section(pages, studies, provenance);
  stopping_section(pages, stopping, designs, provenance);
  launch_sections(pages, studies, experiments, provenance);
  contact_sections(pages, studies, experiments, provenance);
  pages.write_index();
  pages.finish(answer);
}

}  // namespace metastable::reports
