#include "reports/output/known_cell.h"

#include <cmath>

namespace metastable::reports {

Cell known_cell(double value) { return std::isnan(value) ? Cell("") : Cell(value); }

Cell known_cell(const std::optional<double>& value) { return value ? known_cell(*value) : Cell(""); }

Cell positive_cell(double value) { return value > 0 ? Cell(value) : Cell(""); }

Cell estimate_cell(const Estimate& estimate, int digits) {
  if (std::isnan(estimate.value)) return "";
  if (!std::isinf(estimate.value)) return estimate;
  if (std::isfinite(estimate.lower)) return "> " + format_number(estimate.lower, NumberFormat::general, digits);
  return Infinite{};
}

}  // namespace metastable::reports
