#pragma once
// Makes rows of the variables of a MAT file (MATLAB): structs, cells, matrices or vectors.

#include <string>
#include <string_view>
#include <vector>

#include "reports/import/column_map.h"
#include "reports/import/imported_rows.h"

namespace metastable::reports {

/// Says which way a matrix lies.
enum class TrialsIn { not_told, columns, rows };

struct MatRows {
  std::vector<ImportedRow> rows;
  std::vector<MappedColumn> map;
  std::vector<std::string> names;  ///< all variables, and fields as "trials.omega"
  std::vector<std::string> found;  ///< of how a matrix lies, a sentence
};

/// Fields are named behind points, also those of structs in structs ("lab.trials.omega"). Each trial may be an element
/// of a struct array (trials.omega), a cell of a cell array, or a column (row) of a matrix padded with NaN at its end;
/// or all collisions stand in vectors, with one that tells their trials. What is told once a trial (trial, condition,
/// outcome) is a vector or cell array of as many; a vector as long as a trial of a matrix is of all trials. Programs
/// other than MATLAB write the dimensions of HDF5 as they come: where the padding shows that the trials lie the other
/// way than told, they are taken so, and it is said.
/// @param text  all of the file
/// @throws std::invalid_argument as mat_variables(), and for a variable that is not there or of another shape, naming
///         it; analysis::InputError
MatRows mat_rows(const std::string& file, std::string_view text, const std::vector<RequestedColumn>& requests,
                 TrialsIn orientation, int first_collision, Subject subject);

}  // namespace metastable::reports
