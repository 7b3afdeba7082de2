#include "reports/commands/diagnose_command.h"

#include <fmt/format.h>

#include <filesystem>
#include <optional>

#include "analysis/diagnosis/diagnosis_sentences.h"
#include "analysis/likelihood/diagnose.h"
#include "reports/diagnosis/diagnosis_figures.h"
#include "reports/diagnosis/diagnosis_json.h"
#include "reports/diagnosis/diagnosis_tables.h"
#include "reports/diagnosis/diagnosis_text.h"
#include "reports/output/output_file.h"
#include "reports/output/page_folder.h"
#include "reports/output/standard_output.h"
#include "reports/output/version.h"
#include "reports/study/study_progress.h"

namespace metastable::reports {
namespace {

// Adds provenance, and leaves out what has nothing to show.
class Sections {
 public:
  Sections(PageFolder& pages, const Provenance& provenance) : pages_(pages), provenance_(provenance) {}
  void add(const std::string& id, const std::string& heading, const std::string& reading, std::vector<Figure> figures,
           std::vector<Table> tables) {
    std::erase_if(tables, [](const Table& table) { return table.rows.empty(); });
    if (figures.empty() && tables.empty()) return;
    for (Figure& figure : figures) figure.provenance = provenance_;
    for (Table& table : tables) table.provenance = provenance_;
    pages_.section(id, heading, reading, figures, std::move(tables));
  }

 private:
  PageFolder& pages_;
  const Provenance& provenance_;
};

}  // namespace

void write_diagnosis(const analysis::Diagnosis& d, const std::string& title, const Provenance& provenance,
                     const std::string& folder) {
  PageFolder pages(folder);
  Page& page = pages.page();
  page.title = title.empty() ? "Diagnosis" : title;
  page.intro = d.sentences;
  page.intro.insert(page.intro.begin(), fmt::format("Verdict: {}.", analysis::verdict_name(d.verdict)));
  page.intro.push_back("Next: " + analysis::next_step(d));
  page.provenance = provenance;
  Sections sections(pages, provenance);
  sections.add("gap", "Is there a gap?",
               "A small p says that chance does not make such a gap; recalibrated means that restitution, friction and "
               "the launch were fitted again.",
               {}, {gap_table(d), contact_table(d)});
  sections.add("where", "Where it lies",
               "Each cell holds the score of some of the transitions under each model: red, the measured speeds are "
               "higher or more spread than the model's; blue, lower or less. Scores beyond 4 are rarely chance.",
               map_figures(d), {where_table(d)});
  sections.add("which", "Which effect",
               "Probabilities over the effects of the catalogue, pairs, and their alternatives; the 95 % set is what "
               "these data leave open.",
               ranking_figures(d), {causes_table(d), parameters_table(d), undecided_table(d)});
  sections.add("how-far", "How far it shrinks",
               "Measured on trials that the fit did not see; the line is the floor, what remains where the model is "
               "right.",
               shrinkage_figures(d), {shrinkage_table(d), steps_table(d)});
  sections.add("profiles", "Speeds, measured and simulated",
               "Bars are 95 % intervals of the measured means; the band holds the mean of as many simulated trials.",
               profile_figures(d), {profile_table(d)});
  sections.add("not-seen", "What these data could not see",
               "An effect smaller than its smallest size would have gone unnoticed; an effect with one alike may have "
               "been named in its place.",
               {}, {visibility_table(d), missing_table(d), not_possible_table(d)});
  sections.add("next", "The next experiment", "Changes of the experiment that tell the remaining causes apart best.",
               {}, {next_table(d)});
  sections.add("map", "The whole map", "Every cell, under every model.", {}, {map_table(d), data_table(d)});
  pages.write_index();
}

void run_diagnose(const DiagnoseRequest& request) {
  const analysis::Experiment experiment = analysis::read_experiment(request.folder);
  std::optional<FolderIfFilled> folder;
  if (!request.out.empty()) folder.emplace(request.out);
  std::optional<OutputFile> json;
  if (!request.json.empty()) json.emplace(request.json);
  const analysis::Diagnosis diagnosis = [&] {
    Progress progress("diagnose", study_units);
    analysis::DiagnosisOptions options = request.options;
    options.progress = study_progress(progress);
    return analysis::diagnose(experiment, options);
  }();
  const Provenance provenance{request.command, "experiment: " + experiment.title, request.options.seed, version()};
  if (!request.out.empty()) write_diagnosis(diagnosis, experiment.title, provenance, request.out);
  if (json) {
    json->stream() << diagnosis_json(diagnosis, provenance);
    json->commit();
  }
  if (request.json == "-") return;
  say("{}", diagnosis_text(diagnosis, terminal_width()));
  if (!request.out.empty()) say("\n{}\n", (std::filesystem::path(request.out) / "index.html").string());
}

}  // namespace metastable::reports
