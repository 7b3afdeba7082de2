#include "reports/experiment_commands/describe_command.h"

#include <fmt/format.h>

#include <filesystem>
#include <optional>
#include <utility>
#include <vector>

#include "reports/description/describe_figures.h"
#include "reports/description/describe_tables.h"
#include "reports/output/page_folder.h"
#include "reports/output/progress.h"
#include "reports/output/version.h"

namespace metastable::reports {

namespace {

void conditions_section(PageFolder& pages, const analysis::Description& description, const Table& conditions,
                        const Provenance& provenance) {
  std::vector<Fold> folds{{"Every condition in full", {}, {}, {conditions}},
                          {"The speeds collision by collision", {}, {}, {profiles_table(description, provenance)}}};
  if (!description.comparisons.empty())
    folds.push_back(
        {"Do they end in one steady state? The tests",
         {"A large P says that two conditions cannot be told apart; the interval of the difference says how "
          "far apart they may still be."},
         {},
         {tests_table(description, provenance)}});
  pages.section("conditions", "How fast they roll",
                "Mean speeds collision by collision; they meet where a steady state is reached.",
                {profiles_figure(description, provenance)}, {short_table(description, provenance)}, std::move(folds));
}

// Adds what single steps, legs and trials show, as far as the data say it.
void measured_sections(PageFolder& pages, const analysis::Description& description, const Provenance& provenance) {
  std::vector<Figure> maps;
  for (const analysis::ConditionDescription& c : description.conditions)
    if (auto figure = measured_map_figure(c, provenance)) maps.push_back(std::move(*figure));
  if (!maps.empty())
    pages.section("return-maps", "Return maps", "Each dot is one step; a steady state is a cloud on the diagonal.",
                  maps, {});
  if (const auto figure = legs_figure(description, provenance))
    pages.section("legs", "Leg by leg", "Legs of one length and one contact would give one level.", {*figure}, {},
                  {{"The speeds of the legs in numbers", {}, {}, {legs_table(description, provenance)}}});
  if (const auto figure = survival_curves_figure(description, provenance))
    pages.section("survival", "How long trials last",
                  "The curve falls where trials rest; bands are 95 % intervals, one collision at a time.", {*figure},
                  {}, {{"The curve in numbers", {}, {}, {survival_table(description, provenance)}}});
}

void contact_section(PageFolder& pages, const Table& fits) {
  pages.section("contact", "Restitution and friction",
                "What the trials say about both distributions under the nominal law, and which of their numbers they "
                "cannot tell apart.",
                {}, {fits});
}

void laws_section(PageFolder& pages, const analysis::LawComparison& laws, const Provenance& provenance) {
  std::vector<Table> beside{laws_table(laws, provenance)};
  if (!laws.legs.empty()) beside.push_back(landings_table(laws.legs, provenance));
  pages.section("laws", "The contact laws beside it",
                "A law that describes this wheel gives its speed, its spread and its share of rests at once.", {},
                std::move(beside));
}

}  // namespace

DescribeAnswer answer_describe(const analysis::Experiment& experiment, const DescribeRequest& request,
                               const Provenance& provenance) {
  DescribeAnswer answer{analysis::describe(experiment, request.options), {}, {}};
  if (!request.against.empty())
    answer.laws = analysis::compare_laws(experiment, request.against, request.trials, request.options.seed,
                                         request.options.threads, request.options.progress);
  answer.tables.push_back(conditions_table(answer.description, provenance));
  if (!answer.description.comparisons.empty()) answer.tables.push_back(tests_table(answer.description, provenance));
  if (!answer.description.fits.empty())
    answer.tables.push_back(fits_table(answer.description, experiment.contact.law, provenance));
  if (answer.laws) answer.tables.push_back(laws_table(*answer.laws, provenance));
  if (answer.laws && !answer.laws->legs.empty()) answer.tables.push_back(landings_table(answer.laws->legs, provenance));
  return answer;
}

void run_describe(const DescribeRequest& request) {
  const analysis::Experiment experiment = analysis::read_experiment(request.folder);
  std::optional<PageFolder> pages;
  if (!request.out.empty()) pages.emplace(request.out);
  const Provenance provenance{request.command, "experiment: " + experiment.title, request.options.seed, version()};
  Answer answer(request.json);

  const auto [description, laws, tables] = [&] {
    // A fit takes some 500 to 1000 evaluations of its likelihood.
    Progress progress("describe", 1000 * (experiment.conditions.size() + 1 + request.against.size()));
    DescribeRequest told = request;
    told.options.progress = [&] { progress.advance(); };
    return answer_describe(experiment, told, provenance);
  }();
  if (!pages) {
    for (const Table& table : tables) answer.show(table);
    return answer.finish(provenance);
  }

  Page& page = pages->page();
  page.title = experiment.title;
  page.lead = description_sentences(description);
  page.provenance = provenance;
  conditions_section(*pages, description, tables.front(), provenance);
  measured_sections(*pages, description, provenance);
  if (!description.fits.empty()) contact_section(*pages, fits_table(description, experiment.contact.law, provenance));
  if (laws) laws_section(*pages, *laws, provenance);
  pages->write_index();
  pages->finish(answer);
}

}  // namespace metastable::reports
