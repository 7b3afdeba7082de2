#pragma once
// Says where a gap lies: scores of the fitted model, cut along the facets of the experiment.

#include <cstdint>

#include "analysis/fitting/model_fit.h"
#include "analysis/gap/gap_cell.h"

namespace metastable::analysis {

/// Scores the events of `fit` in every cell: mean, spread, tail share, correlation with the previous one, and of
/// all: the trend over the trials, cosines and sines of the time since the previous collision. What the fitted
/// parameters could take up is projected out. Chance levels come from `draws` multiplier-bootstrap draws: over trials,
/// or over transitions where trials are fewer than Rules::enough_trials.
/// @param draws  >= 0; 0: adjusted p-values by their bounds alone
GapMap gap_map(const TransitionModel& model, const Fit& fit, int draws, std::uint64_t seed);

/// Returns the map's columns that shift means, cell by cell [events x cells], for a flexible model of what is left.
Eigen::MatrixXd mean_columns(const TransitionModel& model);

}  // namespace metastable::analysis
