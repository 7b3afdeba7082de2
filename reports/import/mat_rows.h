#pragma once
// Reads rows of a MAT file (MATLAB): structs, cells, matrices or vectors. libmatio stays inside the .cpp.

#include <string>
#include <string_view>
#include <vector>

#include "reports/import/column_map.h"
#include "reports/import/imported_rows.h"

namespace metastable::reports {

/// Says which way a matrix lies.
enum class TrialsIn { not_told, columns, rows };

/// Says what this build can do with MAT files: the library and its version, or "" where it was built without.
std::string mat_library();

/// Is this how a MAT file begins?
bool is_mat_file(std::string_view text);

struct MatRows {
  std::vector<ImportedRow> rows;
  std::vector<MappedColumn> map;
  std::vector<std::string> names;  ///< all variables, and fields as "trials.omega"
};

/// Each trial may be an element of a struct array (trials.omega), a cell of a cell array, or a column (row) of a matrix
/// padded with NaN at its end; or all collisions stand in vectors, with one that tells their trials. What is told once
/// a trial (trial, condition, outcome) is a vector or cell array of as many; a vector as long as a trial of a matrix is
/// of all trials.
/// @throws std::invalid_argument where this build is without the library, for a file that cannot be read, a variable
///         that is not there or of another shape, naming it; analysis::InputError
MatRows mat_rows(const std::string& file, const std::vector<RequestedColumn>& requests, TrialsIn orientation,
                 int first_collision);

}  // namespace metastable::reports
