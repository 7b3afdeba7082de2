#include "reports/diagnosis/diagnosis_text.h"

#include <fmt/format.h>

#include <cmath>
#include <string>
#include <variant>
#include <vector>

#include "analysis/diagnosis/diagnosis_sentences.h"
#include "reports/diagnosis/diagnosis_tables.h"
#include "reports/output/text_table.h"

namespace metastable::reports {
namespace {

constexpr std::size_t most_cells = 10, most_causes = 8;

// Lists one effect a line, with the one that is most like it.
Table visibility_lines(const analysis::Diagnosis& d) {
  Table table{.id = "visibility",
              .title = "What these data could have seen (the size most experiments like this one find)",
              .columns = {{"effect"}, {"parameter"}, {"smallest"}, {"unit"}, {"remark"}}};
  for (const analysis::Detectability& v : d.limits.visible) {
    std::string remark = v.undecidable;
    if (remark.empty() && !v.alike.empty()) {
      remark = fmt::format("{} imitates {:.0f} % of it", v.alike.front().first, 100 * v.alike.front().second);
      if (v.alike.size() > 1)
        remark += fmt::format("; {} other effect{} more than half", v.alike.size() - 1,
                              v.alike.size() > 2 ? "s do" : " does");
    }
    const bool seen = v.undecidable.empty() && std::isfinite(v.smallest) && v.smallest > 0;
    table.rows.push_back(
        {v.effect, v.parameter, seen ? Cell(v.smallest) : Cell(""), unit_of(d, v.effect, v.parameter), remark});
  }
  return table;
}

Table shrinkage_lines(const analysis::Diagnosis& d) {
  Table table{
      .id = "shrinkage",
      .title = "How far it shrinks",
      .notes = {fmt::format(
          "Nats: natural logarithms of the likelihood. A model better by 0.1 nats a {0} makes each {0} "
          "exp(0.1) = 1.1 times as probable, a hundred of them 22,000 times.",
          d.data.step_name)},
      .columns = {
          {"measure"}, {"unit"}, {"as given"}, {"recalibrated"}, {"with effect"}, {"floor"}, {"closed (90 %)"}}};
  const auto known = [](double value) { return std::isnan(value) ? Cell("") : Cell(value); };
  for (const analysis::Shrinkage& s : d.shrinkage.measures) {
    std::string closed = analysis::closed_unknown(s);
    if (analysis::closed_is_known(s)) {
      const DecimalEstimate e =
          to_decimal({100 * *s.closed, 100 * *s.closed_lower, 100 * *s.closed_upper}, NumberFormat::general, 3);
      closed = fmt::format("{} % ({} to {})", plain_text(e.value), plain_text(e.lower), plain_text(e.upper));
    }
    table.rows.push_back(
        {s.measure, s.unit, known(s.baseline), known(s.recalibrated), known(s.with_effect), known(s.floor), closed});
  }
  return table;
}

}  // namespace

std::string diagnosis_text(const analysis::Diagnosis& d, std::size_t width) {
  const auto part = [&](const Table& table, std::size_t most = 1000) {
    return table.rows.empty() ? "" : "\n" + to_text(table, most, width);
  };
  std::string text = fmt::format("verdict: {}\n", analysis::verdict_name(d.verdict));
  for (const std::string& sentence : d.sentences) text += wrapped(sentence, "", width);
  text += wrapped("Next: " + analysis::next_step(d), "", width);
  text += part(gap_table(d));
  text += part(contact_table(d));

  const Table where = where_table(d);
  text +=
      where.rows.empty() ? "\nWhere it lies, after recalibration: no cell is beyond chance\n" : part(where, most_cells);

  text += part(at_work_table(d));
  Table causes = causes_table(d);
  const std::string nearest = d.causes.ranked.empty() ? "" : d.causes.ranked.front().name();
  std::erase_if(causes.rows, [&](const std::vector<Cell>& row) {
    return std::get<double>(row[1].value()) < worded_probability && std::get<std::string>(row[0].value()) != nearest;
  });
  text += part(causes, most_causes);

  text += part(shrinkage_lines(d));
  text += part(steps_table(d));
  text += part(visibility_lines(d));
  text += part(missing_table(d));
  text += part(undecided_table(d));
  text += part(not_possible_table(d));
  text += part(next_table(d));
  return text + part(data_table(d));
}

}  // namespace metastable::reports
