#pragma once
// What is summed in each cell of a gap map, event by event, before anything is standardised.

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "analysis/fitting/model_fit.h"
#include "analysis/gap/gap_cell.h"
#include "analysis/gap/map_cells.h"

namespace metastable::analysis {

/// Holds what an event adds to the sums of a cell: functions of its normal score, or their means given that the wheel
/// rested (a score below that of the chance of rest) or did not. All have mean zero if the model is right.
struct EventResidual {
  double mean = 0, spread = 0, tail = 0;
};

/// Returns what each event adds.
std::vector<EventResidual> residuals(const TransitionModel& model, const Evaluation& evaluation);

/// Says what a column of the map looks for: how its size follows from its sum.
enum class Measure { shift, spread, tail, correlation, rests };

/// Holds the contributions of events to the statistic of one cell and aspect: their sum has mean zero without a gap.
struct MapColumn {
  Measure measure;
  std::vector<std::pair<std::size_t, double>> terms;  // by event
  double variance;                                    // of the sum under the model
  std::vector<double> weights;                        // of a cell that is a contrast; empty: 1
};

/// Holds the cells of a map and their columns, in the same order.
struct MapColumns {
  std::vector<GapCell> cells;
  std::vector<MapColumn> columns;

  void add(const MapCell& cell, const char* aspect, const std::string& unit, double size, MapColumn column) {
    GapCell out;
    out.facet = cell.facet;
    out.aspect = aspect;
    out.at = cell.at;
    out.unit = unit;
    out.size = size;
    out.events = cell.events.size();
    out.stance = cell.stance;
    out.swing = cell.swing;
    cells.push_back(std::move(out));
    columns.push_back(std::move(column));
  }
};

/// Returns the columns of all cells of the map, under this fit.
MapColumns map_columns(const TransitionModel& model, const Fit& fit);

/// Holds columns by event, of which the part that the fitted parameters' scores explain is taken off.
struct EfficientColumns {
  Eigen::MatrixXd dense;          // [events x columns]
  Eigen::RowVectorXd sums;        // of the columns
  Eigen::RowVectorXd whole_norm;  // squared, before anything was taken off
  Eigen::MatrixXd by_prior;       // [fitted parameters x columns] as EffectScan::by_prior, of the sums
};

/// @param fit  that refitted the nuisances, or has no derivatives
EfficientColumns project(const std::vector<MapColumn>& columns, const TransitionModel& model, const Fit& fit);

}  // namespace metastable::analysis
