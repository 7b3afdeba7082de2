#pragma once
// metastable doctor

#include <string>

namespace metastable::reports {

/// Prints what this program is built of, what it finds on this machine, and what a missing piece would add.
/// @param json  file, "-" for standard output, "" for none
void run_doctor(const std::string& json);

}  // namespace metastable::reports
