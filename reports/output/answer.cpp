#include "reports/output/answer.h"

#include <nlohmann/json.hpp>

#include "reports/output/standard_output.h"
#include "reports/output/table_json.h"
#include "reports/output/text_table.h"

namespace metastable::reports {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t most_rows = 1000;  // of a table on the terminal

}  // namespace

Answer::Answer(const std::string& json) : printed_(json != "-") {
  if (!json.empty()) json_.emplace(json);
}

void Answer::line(const std::string& text) {
  if (printed_) say_text(text + '\n');
  said_.push_back(text);
}

void Answer::show(const Table& one) {
  if (printed_) say_text(to_text(one, most_rows, terminal_width()) + '\n');
  table(one);
}

void Answer::finish(const Provenance& provenance) {
  if (!json_) return;
  std::vector<Table> tables = tables_;
  Table& facts = tables.emplace_back(Table{.id = "facts", .title = "", .columns = {}});
  facts.rows.resize(1);
  for (const auto& [name, value] : facts_) {
    facts.columns.push_back({name});
    facts.rows[0].push_back(value);
  }
  Json told = Json::parse(tables_json(tables, provenance));
  Json json = Json::object();
  for (std::size_t i = 0; i < facts_.size(); ++i)
    json["facts"][facts_[i].first] = told["tables"]["facts"]["rows"][0][i];
  told["tables"].erase("facts");
  if (!tables_.empty()) json["tables"] = told["tables"];
  if (!files_.empty()) json["files"] = files_;
  if (!said_.empty()) json["said"] = said_;
  json["provenance"] = told["provenance"];
  json_->stream() << json.dump(2) << '\n';
  json_->commit();
}

}  // namespace metastable::reports
