#include "reports/output/table_json.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <variant>

namespace metastable::reports {
namespace {

using TableJson = nlohmann::ordered_json;

TableJson number_json(double value) {
  if (std::isinf(value)) return value > 0 ? "infinite" : "-infinite";
  return value;
}

struct CellJson {
  TableJson operator()(const std::string& text) const { return text.empty() ? TableJson(nullptr) : TableJson(text); }
  TableJson operator()(std::int64_t whole) const { return whole; }
  TableJson operator()(double number) const { return number_json(number); }
  TableJson operator()(const Estimate& e) const {
    return {{"value", number_json(e.value)}, {"low", number_json(e.lower)}, {"high", number_json(e.upper)}};
  }
  TableJson operator()(Infinite) const { return "infinite"; }
  TableJson operator()(const NotShown& not_shown) const { return {{"not_shown", not_shown.said}}; }
};

}  // namespace

std::string tables_json(const std::vector<Table>& tables, const Provenance& provenance) {
  TableJson all = TableJson::object();
  for (const Table& table : tables) {
    TableJson columns = TableJson::array(), rows = TableJson::array();
    for (const Column& column : table.columns) columns.push_back({{"name", column.name}, {"unit", column.unit}});
    for (const std::vector<Cell>& row : table.rows) {
      TableJson cells = TableJson::array();
      for (const Cell& cell : row) cells.push_back(std::visit(CellJson{}, cell.value()));
      rows.push_back(std::move(cells));
    }
    all[table.id] = {{"title", table.title}, {"notes", table.notes}, {"columns", columns}, {"rows", rows}};
  }
  return TableJson{{"schema", 1},
                   {"tables", all},
                   {"provenance",
                    {{"command", provenance.command},
                     {"settings", provenance.settings},
                     {"seed", provenance.seed},
                     {"version", provenance.version}}}}
             .dump(2) +
         "\n";
}

}  // namespace metastable::reports
