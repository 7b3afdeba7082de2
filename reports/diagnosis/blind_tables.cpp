#include "reports/diagnosis/blind_tables.h"

#include <fmt/format.h>

#include <set>
#include <utility>

namespace metastable::reports {
namespace {

std::string mean_size(double size) { return size > 0 ? fmt::format("{:.2f}", size) : "no case"; }

Table measures(const analysis::BlindGrades& grades, const std::string& law, const Provenance& provenance) {
  Table table{
      .id = law.empty() ? "blind-measures" : "blind-measures-" + law,
      .title = "Blind check: what was asked for and what came out" + (law.empty() ? "" : ", law " + law),
      .notes = {"Shares with Wilson's 95 % interval. met: the share reaches the aim; "
                "open: it falls short, but its interval does not exclude the aim.",
                fmt::format("Mean size of the 95 % set: {} at 1x (aim at most 3), {} at 2x (at most 1.7).",
                            mean_size(grades.mean_set_size_1x), mean_size(grades.mean_set_size_2x)),
                fmt::format("Names in a set at 2x beside its first and what is provably alike to that: {:.2f} in "
                            "the mean, {:.0f} at most (aim at most 2).",
                            grades.mean_beyond_alike_2x, grades.most_beyond_alike_2x)},
      .columns = {{"measure"}, {"right"}, {"of"}, {"share"}, {"aim"}, {"verdict"}},
      .provenance = provenance};
  for (const analysis::Grade& grade : grades.grades) {
    const auto [low, high] = analysis::wilson(grade.proportion);
    std::string aim = grade.aim_low > 0 && grade.aim_high < 1
                          ? fmt::format("{:.0f} to {:.0f} %", 100 * grade.aim_low, 100 * grade.aim_high)
                      : grade.aim_low > 0 ? fmt::format("at least {:.0f} %", 100 * grade.aim_low)
                                          : fmt::format("at most {:.0f} %", 100 * grade.aim_high);
    if (grade.most_upper < 1) aim += fmt::format(", its interval at most {:.0f} %", 100 * grade.most_upper);
    if (grade.proportion.of == 0) {
      table.rows.push_back({grade.measure, 0, 0, "", aim, "no case"});
      continue;
    }
    const double share = static_cast<double>(grade.proportion.right) / grade.proportion.of;
    const bool met = share >= grade.aim_low && share <= grade.aim_high && high <= grade.most_upper;
    const bool possible = high >= grade.aim_low && low <= grade.aim_high;
    table.rows.push_back({grade.measure, grade.proportion.right, grade.proportion.of, Estimate{share, low, high}, aim,
                          met        ? "met"
                          : possible ? "open"
                                     : "not met"});
  }
  return table;
}

// Shows stepwise selection beside the diagnosis.
Table ways(const analysis::BlindGrades& grades, const Provenance& provenance) {
  Table table{.id = "blind-stepwise",
              .title = "The diagnosis beside stepwise selection",
              .notes = {"AICc and BIC select forward over the diagnosis' own fits, from the recalibrated model, each "
                        "chosen entry of a list (a leg, an interval) counted as a parameter. Of walkers Gauss-Newton "
                        "AICc and BIC do so over least squares of one-step predictions. Cases that were answered."},
              .columns = {{"way"}, {"what it names"}, {"cases"}, {"of"}, {"share"}},
              .provenance = provenance};
  for (const analysis::WayGrade& way : grades.ways)
    for (const auto& [what, count] :
         {std::pair<const char*, const analysis::Proportion&>{"something, where there is no gap", way.alarms},
          {"the effect and nothing else", way.exact},
          {"the effect", way.in},
          {"something else instead of the effect or beside it", way.wrong},
          {"both of two effects", way.both},
          {"a third beside or instead of two", way.third},
          {"something for what no catalogue holds", way.outside},
          {"all of three effects", way.three},
          {"two of them at least", way.two_of_three},
          {"all effects beside what no catalogue holds", way.mixed},
          {"another one beside them", way.mixed_wrong}}) {
      if (count.of == 0) continue;
      const auto [low, high] = analysis::wilson(count);
      table.rows.push_back(
          {way.way, what, count.right, count.of, Estimate{static_cast<double>(count.right) / count.of, low, high}});
    }
  return table;
}

std::string list(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

using Truths = std::vector<analysis::BlindTruth>;
using Answers = std::vector<std::optional<analysis::BlindAnswer>>;

// Returns the measures of the cases of each law, where there are several.
std::vector<Table> measures_by_law(const Truths& truths, const Answers& answers, const Provenance& provenance) {
  std::set<dynamics::Law> laws;
  for (const analysis::BlindTruth& truth : truths) laws.insert(truth.law);
  if (laws.size() < 2) return {};
  std::vector<Table> tables;
  for (const dynamics::Law law : laws) {
    Truths some;
    Answers theirs;
    for (std::size_t i = 0; i < truths.size(); ++i)
      if (truths[i].law == law) {
        some.push_back(truths[i]);
        theirs.push_back(answers[i]);
      }
    tables.push_back(measures(analysis::grade(some, theirs), std::string(dynamics::law_name(law)), provenance));
  }
  return tables;
}

Table confusion(const analysis::BlindGrades& grades, const Provenance& provenance) {
  Table table{.id = "blind-confusion",
              .title = "What was true and what was said",
              .notes = {"Counts. An explained gap is entered under the first name of its set."},
              .columns = {{"truth"}, {"said"}, {"cases"}},
              .provenance = provenance};
  for (const auto& [truth, row] : grades.confusion)
    for (const auto& [said, count] : row) table.rows.push_back({truth, said, count});
  return table;
}

Table calibration(const analysis::BlindGrades& grades, const Provenance& provenance) {
  Table table{.id = "blind-calibration",
              .title = "Probability of the first cause and how often it is right",
              .notes = {"Explained cases with one effect of the catalogue."},
              .columns = {{"from"}, {"to"}, {"cases"}, {"mean probability"}, {"share right"}},
              .provenance = provenance};
  for (const analysis::CalibrationBin& bin : grades.calibration) {
    if (bin.count == 0) continue;
    const auto [low, high] = analysis::wilson(bin.right);
    table.rows.push_back({bin.from, bin.to, bin.count, bin.mean_probability,
                          Estimate{static_cast<double>(bin.right.right) / bin.right.of, low, high}});
  }
  return table;
}

Table alike(const analysis::BlindGrades& grades, const Provenance& provenance) {
  Table table{.id = "blind-alike",
              .title = "Ambiguity groups: effects in a quarter or more of another one's 95 % sets",
              .columns = {{"effect"}, {"shares its sets with"}},
              .provenance = provenance};
  for (const auto& [effect, others] : grades.alike) table.rows.push_back({effect, list(others)});
  return table;
}

std::string truth_text(const analysis::BlindTruth& truth) {
  std::string text = truth.outside ? fmt::format("{}:{:.3g}", truth.outside->id, truth.outside->size) : "";
  for (const dynamics::Effect& effect : truth.effects)
    text += (text.empty() ? "" : " ") + dynamics::effect_text(effect);
  if (!text.empty()) return text;
  if (truth.slope_deg) return truth.nominal_is_true ? "nominal slope" : "other slope";
  return truth.nominal_is_true ? "nominal contact" : "other contact";
}

Table all_cases(const Truths& truths, const Answers& answers, const Provenance& provenance) {
  Table table{
      .id = "blind-cases",
      .title = "Every case",
      .notes = {"power: expected 2 Delta log likelihood with the true contact known; left: what recalibration "
                "leaves of it in the data."},
      .columns = {{"case"}, {"law"}, {"kind"}, {"truth"}, {"strength"}, {"power"}, {"left"}, {"verdict"}, {"set"}},
      .provenance = provenance};
  for (std::size_t i = 0; i < truths.size(); ++i) {
    const analysis::BlindTruth& t = truths[i];
    table.rows.push_back({t.number, t.slope_deg ? "compass" : std::string(dynamics::law_name(t.law)),
                          std::string(analysis::blind_kind_name(t.kind)), truth_text(t), t.strength, t.power, t.left,
                          answers[i] ? analysis::verdict_name(answers[i]->verdict) : "no answer",
                          answers[i] ? list(answers[i]->cause_set) : ""});
  }
  return table;
}

}  // namespace

std::vector<Table> blind_tables(const analysis::BlindGrades& grades, const std::vector<analysis::BlindTruth>& truths,
                                const std::vector<std::optional<analysis::BlindAnswer>>& answers,
                                const Provenance& provenance) {
  std::vector<Table> tables{measures(grades, "", provenance), ways(grades, provenance)};
  for (Table& table : measures_by_law(truths, answers, provenance)) tables.push_back(std::move(table));
  tables.push_back(confusion(grades, provenance));
  tables.push_back(calibration(grades, provenance));
  tables.push_back(alike(grades, provenance));
  tables.push_back(all_cases(truths, answers, provenance));
  return tables;
}

}  // namespace metastable::reports
