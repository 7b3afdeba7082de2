#pragma once
// Says which version of the toolkit made a result.

#include <string>

namespace metastable::reports {

/// Returns "0.2.0", or "0.2.0+g1a2b3c4d5e" ("-dirty": with changes since that commit) if it was built from a git clone.
std::string version();

/// Returns what `metastable --version` prints: version(), the compiler, and the libraries with their versions.
std::string version_text();

}  // namespace metastable::reports
