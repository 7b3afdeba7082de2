#pragma once
// Writes tables as JSON, for programs.

#include <string>
#include <vector>

#include "reports/output/table.h"

namespace metastable::reports {

/// Writes {"schema": 1, "tables": {ID: {"title", "notes", "columns": [{"name", "unit"}], "rows": [[...]]}},
/// "provenance"}, with a final line end. A cell is a text, a number, {"value", "low", "high"} with the ends of its
/// interval, "infinite", or null where it is empty or what it says is {"not_shown": "..."}. Numbers have as many digits
/// as a double holds.
std::string tables_json(const std::vector<Table>& tables, const Provenance& provenance);

}  // namespace metastable::reports
