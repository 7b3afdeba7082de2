#pragma once
// Reads one CSV file in long form (a row a collision) or wide form (a row a trial, columns numbered by collision).

#include <string>
#include <string_view>
#include <vector>

#include "analysis/experiment/csv_reader.h"
#include "analysis/experiment/input_error.h"
#include "reports/import/column_map.h"
#include "reports/import/imported_rows.h"

namespace metastable::reports {

/// Reads strictly, as the reader of experiment folders does; what is not understood goes to `defects` with line and
/// column. Empty, NaN and NA say that a value is not known. In wide form a trial ends where its row does, and a value
/// that is missing before is a defect; rows may be short of fields then.
/// @param map  of the header's names; wide where a * numbers omega_minus or half_angle
/// @param first_collision  number that * stands for at first
std::vector<ImportedRow> csv_rows(const std::string& file, std::string_view text, const analysis::CsvForm& form,
                                  const std::vector<MappedColumn>& map, int first_collision,
                                  analysis::Defects& defects);

}  // namespace metastable::reports
