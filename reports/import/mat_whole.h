#pragma once
// Tells whether a MAT file is whole. libmatio reads on beyond the end of a file that was cut short, and takes what does
// not decompress for zeros.

#include <string>
#include <string_view>

namespace metastable::reports {

/// Checks that the variables of a file of version 5 end where it ends, and that the compressed ones agree with their
/// checksums; a file of version 7.3 is HDF5, whose library checks it. Costs one decompression.
/// @param file  its name, for messages; @param text  all of it
/// @throws std::invalid_argument naming file and byte
void check_mat_whole(const std::string& file, std::string_view text);

}  // namespace metastable::reports
