#pragma once
// Finds which column or variable of a foreign file tells what, and in which unit.

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "reports/import/imported_rows.h"

namespace metastable::reports {

/// Says what a column tells, as the files of an experiment folder do; from `step` on only those of walks.
enum class Role {
  condition,
  trial,
  collision,
  leg,
  time,
  position,
  omega_minus,
  omega_plus,
  outcome,
  angle,
  step,
  phase,
  half_angle,
  stance_rate,
  swing_rate
};
inline constexpr std::size_t role_count = 15;

/// Says of what a file tells.
enum class Subject { wheel, walks };

std::string_view role_name(Role role);

/// Returns what may come of a trial, as the folder has it.
std::vector<std::string> outcome_names(Subject subject);

/// Returns the name of its column in an experiment folder.
std::string_view column_in_folder(Role role);

/// Returns where a row holds the number that the role tells; nullptr: it tells a text.
std::optional<double> ImportedRow::*value_member(Role role);

/// Holds one entry of the map that a user gives: ROLE=NAME or ROLE=NAME[UNIT].
struct RequestedColumn {
  Role role;
  std::string text;  ///< behind the equals sign
};

/// Reads entries with commas between them. @throws std::invalid_argument naming the entry and what is expected
std::vector<RequestedColumn> column_requests(const std::string& text, Subject subject);

/// Holds where a role is told.
struct MappedColumn {
  Role role;
  std::string name;  ///< as in the file, or as requested with a * for the collision's number
  std::string unit;  ///< "" of what has none
  double scale = 1;  ///< to SI
  /// Holds the indices of the names; of a pattern with * one a collision, in their order.
  std::vector<std::size_t> columns = {};
  bool numbered = false;  ///< by a *
};

/// Finds what was requested among the names of a file, and beside it what bears the names of an experiment folder
/// (trial, omega_minus_rad_s, ...). A unit stands in the request, or ends the name: omega_deg_s, "omega [deg/s]", which
/// may be requested without it. Times may be in frames: frame[1/120 s].
/// @param first_collision  number that * stands for at first, 0 or 1
/// @throws std::invalid_argument for a name that is not there, a unit that is not told or of another kind, a role or a
///         column asked for twice, numbers behind * that skip or repeat
std::vector<MappedColumn> map_columns(const std::vector<RequestedColumn>& requests, std::span<const std::string> names,
                                      const std::string& file, int first_collision, Subject subject);

/// Says whether every requested name is there, whatever its unit.
bool names_all(const std::vector<RequestedColumn>& requests, std::span<const std::string> names, int first_collision);

/// Says whether a text is one of the units, as it is or in brackets ("deg/s", "[m]").
bool is_unit(std::string_view text);

/// Returns what tells the role, or nullptr.
const MappedColumn* column_of(const std::vector<MappedColumn>& map, Role role);

/// Returns what every row has: omega_minus or, instead, angle; of walks half_angle. nullptr: nothing of these is told.
const MappedColumn* main_column(const std::vector<MappedColumn>& map);

/// Returns the name of what every row has, for messages: "omega_minus (or angle)".
std::string_view main_name(Subject subject);

}  // namespace metastable::reports
