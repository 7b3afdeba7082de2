#include "reports/description/speed_cells.h"

#include <cmath>

#include "analysis/statistics/interval_95.h"

namespace metastable::reports {

Estimate mean_interval(const analysis::SpeedSummary& s) {
  const double half = analysis::t_half_width(s.standard_error, s.count);
  return {s.mean, s.mean - half, s.mean + half};
}

Cell mean_cell(const analysis::SpeedSummary& s) {
  if (s.count == 0) return "";
  if (s.count == 1) return s.mean;
  return mean_interval(s);
}

Cell sd_cell(const analysis::SpeedSummary& s) { return s.count > 1 ? Cell(s.sd) : Cell(""); }

Cell effect_cell(const analysis::EffectSize& effect) {
  if (!std::isfinite(effect.value)) return Infinite{};
  return Estimate{effect.value, effect.lower, effect.upper};
}

Cell meet_cell(const std::optional<int>& collision) { return collision ? Cell(*collision) : Cell("never"); }

}  // namespace metastable::reports
