#pragma once
// Reads the variables of a MAT file of version 7.3, which is HDF5, by whatever program it was written. The HDF5 library
// stays inside the .cpp.

#include <string>
#include <vector>

#include "reports/import/mat_value.h"

namespace metastable::reports {

/// Says what to do about what no one but MATLAB reads.
inline constexpr const char* object_remedy =
    "an object (a table, a timetable, a string): save its columns as arrays, e.g. omega = T.omega";

/// Datasets are arrays, their dimensions the other way round, as MATLAB has them; datasets of references are cells, or
/// with the others of their group the fields of a struct array; groups are structs. MATLAB's attributes are followed
/// where they are there, and not needed.
/// @throws std::invalid_argument for what the library cannot read, naming the file and the variable
std::vector<MatValue> hdf5_variables(const std::string& path);

}  // namespace metastable::reports
