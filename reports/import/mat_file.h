#pragma once
// Reads the variables of a MAT file, in a process of its own. libmatio stays inside the .cpp.

#include <string>
#include <string_view>
#include <vector>

#include "reports/import/mat_value.h"

namespace metastable::reports {

/// Says what this build can do with MAT files: the library and its version, or "" where it was built without.
std::string mat_library();

/// Says whether a MAT file begins like this: of version 4, 5 to 7, or 7.3 (HDF5, with MATLAB's header or without).
bool is_mat_file(std::string_view text);

/// Says whether it is one of version 7.3, whose dimensions other programs write the other way round.
bool is_hdf5_file(std::string_view text);

/// @param text  all of the file
/// @throws std::invalid_argument where this build is without the library, and for a file that cannot be read, naming it
std::vector<MatValue> mat_variables(const std::string& file, std::string_view text);

}  // namespace metastable::reports
