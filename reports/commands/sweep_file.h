#pragma once
// Writes a sweep's file of rows, which grows point by point and is taken up again, and its figure.

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
  std::string law = {};             ///< named in titles; "" for what has none
  /// Says a last line about the table of all points.
  std::function<std::string(const Table& points)> remark = {};
};

/// Computes the points from number `had` on and hands each row over, with its line end: one column an axis, then
/// expected steps and the ends of their interval ("infinite", empty where a solver failed), then anything. Columns
/// "rigid_bodies_steps", and with "_low95" and "_high95" behind, are drawn too.
using SweepRows = std::function<void(std::size_t had, const std::function<void(const std::string& row)>& add)>;

/// Holds processes that share the points of a sweep. The first of them writes all files.
struct Sharing {
  int rank = 0, ranks = 1;
  std::function<std::size_t(std::size_t)> first_says;  ///< on all: the number that the first one has
  std::function<void(const std::string& row)> send;    ///< to the first
  std::function<std::string(int rank)> receive;        ///< on the first: the next one sent by a process
};

/// Writes rows to `out`.partial as they come, renames it, draws the figure and prints one line.
/// @throws OutputError for a file of another sweep; Interrupted, saying how many points were kept
void run_sweep_file(const SweepFile& sweep, const SweepRows& compute);

/// Does the same, points taken in turns by the processes; the bytes are those of one.
/// @param row_of  computes a point's row
void share_sweep_file(const SweepFile& sweep, const Sharing& sharing,
                      const std::function<std::string(std::size_t point)>& row_of);

}  // namespace metastable::reports
