#pragma once
// Makes the tables of a diagnosis.

#include <string>
#include <vector>

#include "analysis/diagnosis/diagnosis.h"
#include "reports/output/table.h"

namespace metastable::reports {

/// Causes less probable are in the files only, in no figure and on no terminal.
inline constexpr double worded_probability = 0.0005;

/// The adjusted p-value below which a cell of the map counts as beyond chance.
constexpr double where_level = 0.05;
/// Lists the cells beyond chance, by rising adjusted p-value, then by falling statistic.
std::vector<analysis::GapCell> beyond_chance(const analysis::GapMap& map);

/// Returns the unit of an effect's parameter, "" for a ratio and where the model is not known.
std::string unit_of(const analysis::Diagnosis& diagnosis, const std::string& effect, const std::string& parameter);

/// Says whether the answer is of speeds; else it is of the columns of a machine, whose model it then holds.
bool of_speeds(const analysis::Diagnosis& diagnosis);

/// All come without provenance. A table of nothing has no rows.
Table data_table(const analysis::Diagnosis& diagnosis);     ///< what was there; the notes below it
Table gap_table(const analysis::Diagnosis& diagnosis);      ///< p-values
Table contact_table(const analysis::Diagnosis& diagnosis);  ///< recalibrated parameters
Table where_table(const analysis::Diagnosis& diagnosis);    ///< beyond chance after recalibration
/// Lists every cell under the nominal, the refitted and the chosen model.
Table map_table(const analysis::Diagnosis& diagnosis);
Table at_work_table(const analysis::Diagnosis& diagnosis);     ///< effect by effect, and where something unnamed acts
Table causes_table(const analysis::Diagnosis& diagnosis);      ///< with "no gap", "recalibration", "none of these"
Table parameters_table(const analysis::Diagnosis& diagnosis);  ///< of every cause
Table shrinkage_table(const analysis::Diagnosis& diagnosis);
Table steps_table(const analysis::Diagnosis& diagnosis);
Table profile_table(const analysis::Diagnosis& diagnosis);
Table visibility_table(const analysis::Diagnosis& diagnosis);
Table missing_table(const analysis::Diagnosis& d);
Table not_possible_table(const analysis::Diagnosis& d);
Table undecided_table(const analysis::Diagnosis& diagnosis);
Table next_table(const analysis::Diagnosis& diagnosis);

}  // namespace metastable::reports
