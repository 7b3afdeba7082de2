#pragma once
// Shows in cells what may not be known.

#include <optional>

#include "reports/output/table.h"

namespace metastable::reports {

/// Shows a number; empty where there is none, or NaN.
Cell known_cell(double value);
Cell known_cell(const std::optional<double>& value);
/// Shows a number of which 0 says that there is none: empty then.
Cell positive_cell(double value);
/// Shows a number with its interval; empty where it is NaN. Of an infinite one with a finite lower end all that is
/// known is that it is more.
/// @param digits  of that lower end, 1..17
Cell estimate_cell(const Estimate& estimate, int digits = 3);

}  // namespace metastable::reports
