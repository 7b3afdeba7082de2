#include "reports/experiment_commands/diagnose_command.h"

#include <fmt/format.h>

#include <filesystem>
#include <optional>

#include "analysis/diagnosis/diagnosis_sentences.h"
#include "analysis/experiment_model/diagnose.h"
#include "analysis/walker_model/walk_folder.h"
#include "dynamics/wheel/contact_law.h"
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

// Adds provenance and the law, and leaves out what has nothing to show.
class Sections {
 public:
  // @param law  that the models obey; "" of a machine without one
  Sections(PageFolder& pages, const Provenance& provenance, std::string law)
      : pages_(pages), provenance_(provenance), law_(law.empty() ? "" : fmt::format(" (law {})", law)) {}
  void add(const std::string& id, const std::string& heading, const std::string& reading, std::vector<Figure> figures,
           std::vector<Table> tables, std::vector<Fold> folded = {}) {
    complete(figures, tables);
    for (Fold& fold : folded) complete(fold.figures, fold.tables);
    std::erase_if(folded, [](const Fold& fold) { return fold.figures.empty() && fold.tables.empty(); });
    if (figures.empty() && tables.empty() && folded.empty()) return;
    pages_.section(id, heading, reading, figures, std::move(tables), std::move(folded));
  }

 private:
  void complete(std::vector<Figure>& figures, std::vector<Table>& tables) const {
    std::erase_if(tables, [](const Table& table) { return table.rows.empty(); });
    for (Figure& figure : figures) {
      figure.provenance = provenance_;
      if (!figure.title.empty()) figure.title += law_;
    }
    for (Table& table : tables) {
      table.provenance = provenance_;
      table.title += law_;
    }
  }

  PageFolder& pages_;
  const Provenance& provenance_;
  std::string law_;
};

void set_head(Page& page, const analysis::Diagnosis& d, const std::string& title) {
  page.title = fmt::format("{}Verdict: {}", title.empty() ? "" : title + ". ", analysis::verdict_name(d.verdict));
  if (!d.sentences.empty()) {
    page.lead = {d.sentences.front()};
    page.intro.assign(d.sentences.begin() + 1, d.sentences.end());
  }
  page.intro.push_back("Next: " + analysis::next_step(d));
}

}  // namespace

void write_diagnosis(const analysis::Diagnosis& d, const std::string& title, const std::string& law,
                     const Provenance& provenance, const std::string& folder) {
  PageFolder pages(folder);
  Page& page = pages.page();
  set_head(page, d, title);
  page.provenance = provenance;
  Sections sections(pages, provenance, law);
  std::vector<Figure> answer = ranking_figures(d), shrinking = shrinkage_figures(d);
  if (!shrinking.empty()) {  // of the likelihood, which all effects show in
    answer.push_back(std::move(shrinking.front()));
    shrinking.erase(shrinking.begin());
  }
  for (Figure& figure : closes_figures(d)) answer.push_back(std::move(figure));
  const bool speeds = of_speeds(d);
  const std::string values = speeds ? "speeds" : "values";
  sections.add(
      "which", "Which effect, and how much of the gap it closes",
      "How probable each cause is, given these data, and what is left of the gap on trials that the fit did not "
      "see, under each model: the line is the floor, what remains where the model is right.",
      std::move(answer), {at_work_table(d)},
      {{"All causes and their parameters",
        {"The 95 % set is what these data leave open."},
        {},
        {causes_table(d), parameters_table(d), undecided_table(d)}},
       {"Every measure of the gap", {}, std::move(shrinking), {shrinkage_table(d)}}});
  sections.add("where", "Where the gap lies",
               fmt::format("The places where the models are furthest from the measured {0}. Red, the measured {0} are "
                           "higher or more spread than the model’s; blue, lower or less. The score is standard normal "
                           "without a gap: the largest of so many places is about 3 by chance, and beyond 4 it is "
                           "rarely chance.",
                           values),
               furthest_figures(d), {},
               {{"Cells beyond chance, after recalibration", {}, {}, {where_table(d)}},
                {"The whole map, in colours and in numbers", {}, map_figures(d), {map_table(d)}}});
  sections.add("how-far", "Steps before failure", "What the models say of the steps that were observed.", {},
               {steps_table(d)});
  sections.add("return-maps", "The return map, measured and simulated",
               "Each dot is a step: a value, and the one a step later.", return_map_figures(d), {});
  sections.add("profiles", speeds ? "Speeds, measured and simulated" : "Step by step, measured and simulated",
               "Bars are 95 % intervals of the measured means; the band holds the mean of as many simulated trials.",
               profile_figures(d), {}, {{speeds ? "The speeds in numbers" : "In numbers", {}, {}, {profile_table(d)}}});
  sections.add("next", "The next experiment", "Changes of the experiment that tell the remaining causes apart best.",
               {}, {next_table(d)});
  sections.add("details", "Details", "What stands behind the verdict, and what these data could not see.", {}, {},
               {{"Is there a gap? The tests, and the recalibrated parameters",
                 {"A small p says that chance does not make such a gap; recalibrated means that restitution, friction "
                  "and the launch were fitted again."},
                 {},
                 {gap_table(d), contact_table(d)}},
                {"What these data could not see",
                 {"An effect smaller than its smallest size would have gone unnoticed; an effect with one alike may "
                  "have been named in its place."},
                 {},
                 {visibility_table(d), missing_table(d), not_possible_table(d)}},
                {"The data", {}, {}, {data_table(d)}}});
  pages.write_index();
}

void run_diagnose(const DiagnoseRequest& request) {
  const std::optional<analysis::Walks> walks = analysis::read_walks(request.folder);
  std::optional<analysis::Experiment> experiment;
  if (!walks) experiment = analysis::read_experiment(request.folder);
  const std::string title = walks ? walks->title : experiment->title;
  std::optional<FolderIfFilled> folder;
  if (!request.out.empty()) folder.emplace(request.out);
  std::optional<OutputFile> json;
  if (!request.json.empty()) json.emplace(request.json);
  const analysis::Diagnosis diagnosis = [&] {
    Progress progress("diagnose", study_units);
    analysis::DiagnosisOptions options = request.options;
    options.progress = study_progress(progress);
    return walks ? analysis::diagnose_walks(*walks, options) : analysis::diagnose(*experiment, options);
  }();
  const Provenance provenance{request.command, "experiment: " + title, request.options.seed, version()};
  if (!request.out.empty()) {
    const bool wheel = experiment && experiment->system == analysis::System::rimless_wheel;
    write_diagnosis(diagnosis, title, wheel ? std::string(dynamics::law_name(experiment->contact.law)) : std::string(),
                    provenance, request.out);
  }
  if (json) {
    json->stream() << diagnosis_json(diagnosis, provenance);
    json->commit();
  }
  if (request.json == "-") return;
  say("{}", diagnosis_text(diagnosis, terminal_width()));
  if (!request.out.empty()) say("\n{}\n", (std::filesystem::path(request.out) / "index.html").string());
}

}  // namespace metastable::reports
