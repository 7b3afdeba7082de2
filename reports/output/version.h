#pragma once
// Says which version of the toolkit made a result.

#include <string>

namespace metastable::reports {

/// "0.1.0", or "0.1.0+g1a2b3c4d5e" ("-dirty": with changes since that commit) if it was built from a git clone.
std::string version();

}  // namespace metastable::reports
