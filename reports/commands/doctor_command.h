#pragma once
// metastable doctor

#include <string>

namespace metastable::reports {

/// Prints what this program is built of, what it finds on this machine, and what a missing piece would add.
/// @param json  file, "-" for standard output, "" for none
/// @param seconds  after which a program that it asks for its version is ended, and said to have been
void run_doctor(const std::string& json, double seconds = 10);

}  // namespace metastable::reports
