#include "analysis/transition_model.h"

#include <numeric>

namespace metastable::analysis {

double Evaluation::total() const { return std::accumulate(log_density.begin(), log_density.end(), 0.0); }

}  // namespace metastable::analysis
