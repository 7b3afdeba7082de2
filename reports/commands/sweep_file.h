#pragma once
// A sweep's file of rows, which grows point by point and is taken up again, and its figure.

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "reports/output/table.h"

namespace metastable::reports {

struct SweepFileAxis {
  std::string label, unit;  ///< "" for no unit
  std::vector<double> values;
};

struct SweepFile {
  std::string out;                  ///< the figure goes beside it, with the ending .svg
  std::string head;                 ///< everything the numbers depend on; a file with another head is another sweep's
  std::vector<SweepFileAxis> axes;  ///< the first varies slowest
  Provenance provenance;            ///< of the figure
  std::string json = {};            ///< file, "-" for standard output, "" for none
};

/// Computes the points from number `had` on and hands each row over, with its line end: one column an axis, then
/// expected steps and the ends of their interval ("infinite", empty where a solver failed), then anything.
using SweepRows = std::function<void(std::size_t had, const std::function<void(const std::string& row)>& add)>;

/// Writes rows to `out`.partial as they come, renames it, draws the figure and prints one line.
/// @throws OutputError for a file of another sweep; Interrupted, saying how many points were kept
void run_sweep_file(const SweepFile& sweep, const SweepRows& compute);

}  // namespace metastable::reports
