#include "reports/output/answer.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "reports/output/text_table.h"

namespace metastable::reports {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t most_rows = 1000;  // of a table on the terminal

Json number_json(double value) {
  if (std::isinf(value)) return value > 0 ? "infinite" : "-infinite";
  return value;
}

Json estimate_json(const Estimate& e) {
  return {{"value", number_json(e.value)}, {"interval", {number_json(e.lower), number_json(e.upper)}}};
}

struct CellJson {
  Json operator()(const std::string& text) const { return text.empty() ? Json(nullptr) : Json(text); }
  Json operator()(std::int64_t whole) const { return whole; }
  Json operator()(double number) const { return number_json(number); }
  Json operator()(const Estimate& estimate) const { return estimate_json(estimate); }
  Json operator()(Infinite) const { return "infinite"; }
  Json operator()(const NotShown& hidden) const {
    Json json = estimate_json(hidden.number);
    json["said"] = hidden.said;
    return json;
  }
};

Json cell_json(const Cell& cell) { return std::visit(CellJson(), cell.value()); }

Json table_json(const Table& table) {
  Json json = {{"id", table.id}, {"title", table.title}, {"columns", Json::array()}, {"rows", Json::array()}};
  for (const Column& column : table.columns) json["columns"].push_back({{"name", column.name}, {"unit", column.unit}});
  for (const std::vector<Cell>& row : table.rows) {
    Json& cells = json["rows"].emplace_back(Json::array());
    for (const Cell& cell : row) cells.push_back(cell_json(cell));
  }
  if (!table.notes.empty()) json["notes"] = table.notes;
  return json;
}

}  // namespace

Answer::Answer(const std::string& json) : printed_(json != "-") {
  if (!json.empty()) json_.emplace(json);
}

void Answer::line(const std::string& text) {
  if (printed_) fmt::print("{}\n", text);
  said_.push_back(text);
}

void Answer::show(const Table& one) {
  if (printed_) fmt::print("{}\n", to_text(one, most_rows, terminal_width()));
  table(one);
}

void Answer::finish(const Provenance& provenance) {
  if (!json_) return;
  Json json = Json::object();
  for (const auto& [name, value] : facts_) json["facts"][name] = cell_json(value);
  for (const Table& table : tables_) json["tables"].push_back(table_json(table));
  if (!files_.empty()) json["files"] = files_;
  if (!said_.empty()) json["said"] = said_;
  json["provenance"] = provenance_lines(provenance);
  json_->stream() << json.dump(2) << '\n';
  json_->commit();
}

}  // namespace metastable::reports
