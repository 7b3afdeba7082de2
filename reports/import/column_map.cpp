#include "reports/import/column_map.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <sstream>
#include <stdexcept>

#include "analysis/experiment/input_error.h"
#include "analysis/experiment/suggestion.h"

namespace metastable::reports {
namespace {

constexpr double degree = std::numbers::pi / 180, turn = 2 * std::numbers::pi;

struct Unit {
  std::string_view name;    // in brackets
  std::string_view ending;  // of a name, behind _
  double scale;
};
constexpr Unit speeds[] = {
    {"rad/s", "rad_s", 1}, {"deg/s", "deg_s", degree}, {"rpm", "rpm", turn / 60}, {"rev/s", "rev_s", turn}};
constexpr Unit times[] = {{"s", "s", 1}, {"ms", "ms", 1e-3}, {"us", "us", 1e-6}, {"min", "min", 60}};
constexpr Unit lengths[] = {{"m", "m", 1}, {"cm", "cm", 1e-2}, {"mm", "mm", 1e-3}};
constexpr Unit angles[] = {{"rad", "rad", 1}, {"deg", "deg", degree}, {"rev", "rev", turn}};

struct RoleInfo {
  Role role;
  std::string_view name;
  std::string_view in_folder;                  // its column in an experiment folder
  std::span<const Unit> units;                 // empty: none
  std::optional<double> ImportedRow::*member;  // nullptr: it is a text
};
const RoleInfo roles[] = {{Role::condition, "condition", "condition", {}, nullptr},
                          {Role::trial, "trial", "trial", {}, nullptr},
                          {Role::collision, "collision", "collision", {}, &ImportedRow::collision},
                          {Role::leg, "leg", "leg", {}, &ImportedRow::leg},
                          {Role::time, "time", "time_s", times, &ImportedRow::time},
                          {Role::position, "position", "position_m", lengths, &ImportedRow::position},
                          {Role::omega_minus, "omega_minus", "omega_minus_rad_s", speeds, &ImportedRow::omega_minus},
                          {Role::omega_plus, "omega_plus", "omega_plus_rad_s", speeds, &ImportedRow::omega_plus},
                          {Role::outcome, "outcome", "outcome", {}, nullptr},
                          {Role::angle, "angle", "angle_rad", angles, &ImportedRow::angle},
                          {Role::step, "step", "step", {}, &ImportedRow::collision},
                          {Role::phase, "phase", "phase", {}, &ImportedRow::leg},
                          {Role::half_angle, "half_angle", "half_angle_rad", angles, &ImportedRow::half_angle},
                          {Role::stance_rate, "stance_rate", "stance_rate_rad_s", speeds, &ImportedRow::stance_rate},
                          {Role::swing_rate, "swing_rate", "swing_rate_rad_s", speeds, &ImportedRow::swing_rate}};
static_assert(std::size(roles) == role_count);

const RoleInfo& info(Role role) { return roles[static_cast<std::size_t>(role)]; }

bool is_of(Role role, Subject subject) {
  if (role == Role::condition || role == Role::trial || role == Role::time || role == Role::position ||
      role == Role::outcome)
    return true;
  return (role >= Role::step) == (subject == Subject::walks);
}

std::string known(std::span<const std::string> names) {
  constexpr std::size_t most = 30;
  return fmt::format("{}{}", fmt::join(names.first(std::min(names.size(), most)), ", "),
                     names.size() > most ? ", ..." : "");
}

// Writes "deg" for a degree sign.
std::string with_deg(std::string_view text) {
  std::string spelled(text);
  for (std::size_t at; (at = spelled.find("\xC2\xB0")) != std::string::npos;) spelled.replace(at, 2, "deg");
  return spelled;
}

// Returns the unit that a name ends with.
const Unit* unit_of(std::string_view name, std::span<const Unit> units) {
  if (const std::size_t star = name.rfind('*'); star != std::string_view::npos && star + 1 == name.size()) {
    name.remove_suffix(1);
    if (name.ends_with('_')) name.remove_suffix(1);
  }
  const std::string spelled = with_deg(name);
  const std::string_view all = spelled;
  name = all;
  const auto ends = [&](const Unit& unit) {
    return name.ends_with(fmt::format("[{}]", unit.name)) || name.ends_with(fmt::format("({})", unit.name)) ||
           name.ends_with(fmt::format("_{}", unit.ending));
  };
  // "omega_rad_s" ends with the second too, hence the longest.
  const Unit* longest = nullptr;
  for (const Unit& unit : units)
    if (ends(unit) && (longest == nullptr || unit.ending.size() > longest->ending.size())) longest = &unit;
  return longest;
}

struct Split {
  std::string_view name, unit;
};

// Reads "w [deg/s]" as name and unit; the unit is empty where there are no brackets at the end.
Split split_unit(std::string_view text) {
  const std::size_t open = text.rfind('[');
  if (open == std::string_view::npos || !text.ends_with(']')) return {text, {}};
  std::string_view name = text.substr(0, open);
  while (name.ends_with(' ')) name.remove_suffix(1);
  return {name, text.substr(open + 1, text.size() - open - 2)};
}

// Returns the columns whose names are the pattern with a whole number for its *, in the order of the numbers.
std::vector<std::size_t> numbered_columns(std::string_view pattern, std::span<const std::string> names,
                                          int first_collision) {
  const std::size_t star = pattern.find('*');
  const std::string_view before = pattern.substr(0, star), after = pattern.substr(star + 1);
  std::map<int, std::size_t> found;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::string_view name = names[i];
    if (name.size() <= before.size() + after.size() || !name.starts_with(before) || !name.ends_with(after)) continue;
    const std::string_view digits = name.substr(before.size(), name.size() - before.size() - after.size());
    int number = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
    if (error != std::errc() || end != digits.data() + digits.size() || number < 0) continue;
    if (!found.emplace(number, i).second)
      throw std::invalid_argument(fmt::format("--columns: '{}' and '{}' are both number {} of {}", names[found[number]],
                                              name, number, pattern));
  }
  std::vector<std::size_t> columns;
  for (const auto& [number, index] : found) {
    if (const int due = first_collision + static_cast<int>(columns.size()); number != due)
      throw std::invalid_argument(fmt::format("--columns: {}: number {} is not there, but {} is{}", pattern, due,
                                              number, number == 0 ? " (--collisions-from 0)" : ""));
    columns.push_back(index);
  }
  return columns;
}

// Reads "1/120 s", the time of a frame, as 120; 0: it is none.
double frame_rate(std::string_view unit) {
  double rate = 0;
  if (!unit.starts_with("1/") || !unit.ends_with(" s")) return 0;
  const auto [end, error] = std::from_chars(unit.data() + 2, unit.data() + unit.size() - 2, rate);
  return error == std::errc() && end == unit.data() + unit.size() - 2 && rate > 0 && std::isfinite(rate) ? rate : 0;
}

// Returns the column of that name, or those that it numbers.
std::vector<std::size_t> columns_called(const std::string& name, std::span<const std::string> names,
                                        int first_collision) {
  if (name.find('*') != std::string::npos) return numbered_columns(name, names, first_collision);
  const auto at = std::ranges::find(names, name);
  if (at == names.end()) return {};
  return {static_cast<std::size_t>(at - names.begin())};
}

MappedColumn found_column(const RequestedColumn& request, std::span<const std::string> names, const std::string& file,
                          int first_collision) {
  const RoleInfo& role = info(request.role);
  MappedColumn column{.role = request.role, .name = request.text, .unit = {}};
  std::string_view unit;
  for (int without_unit = 0; without_unit < 2 && column.columns.empty(); ++without_unit) {
    if (without_unit == 1) {
      const Split parts = split_unit(request.text);
      if (parts.unit.empty()) break;
      column.name = parts.name;
      unit = parts.unit;
    }
    column.numbered = column.name.find('*') != std::string::npos;
    column.columns = columns_called(column.name, names, first_collision);
  }
  std::string in_file = column.columns.empty() || column.numbered ? column.name : names[column.columns.front()];
  if (column.columns.empty()) {
    // Names may have their unit behind them, which the request leaves out or tells apart.
    std::vector<std::string> bare;
    for (const std::string& name : names) bare.emplace_back(split_unit(name).name);
    column.columns = columns_called(column.name, bare, first_collision);
    if (!column.columns.empty()) in_file = names[column.columns.front()];
    for (const std::size_t i : column.columns)
      if (split_unit(names[i]).unit != split_unit(in_file).unit)
        throw std::invalid_argument(
            fmt::format("--columns: {}: '{}' and '{}' have two units", role.name, in_file, names[i]));
  }
  if (column.columns.empty())
    throw std::invalid_argument(
        fmt::format("--columns: {} has no '{}' for {} (it has {})", file, column.name, role.name, known(names)));
  std::vector<std::string_view> of_role;
  for (const Unit& one : role.units) of_role.push_back(one.name);
  if (role.units.empty()) {
    if (!unit.empty()) throw std::invalid_argument(fmt::format("--columns: {}: has no unit", role.name));
    return column;
  }
  const Unit* chosen = unit_of(in_file, role.units);
  if (const double rate = frame_rate(unit); rate > 0 && role.role == Role::time) {
    column.unit = unit;
    column.scale = 1 / rate;
    return column;
  }
  if (!unit.empty()) {
    const auto named = std::ranges::find(role.units, unit, &Unit::name);
    if (named == role.units.end())
      throw std::invalid_argument(
          fmt::format("--columns: {}: '{}' is none of the units {}", role.name, unit, fmt::join(of_role, ", ")));
    if (chosen != nullptr && chosen != &*named)
      throw std::invalid_argument(
          fmt::format("--columns: {}: the name '{}' says {}, not {}", role.name, in_file, chosen->name, unit));
    chosen = &*named;
  }
  if (chosen == nullptr)
    throw std::invalid_argument(fmt::format("--columns: {0}: the unit of '{1}' is not told; write {0}={1}[{2}]",
                                            role.name, column.name, fmt::join(of_role, "] or [")));
  column.unit = chosen->name;
  column.scale = chosen->scale;
  return column;
}

}  // namespace

std::string_view role_name(Role role) { return info(role).name; }

std::vector<std::string> outcome_names(Subject subject) {
  if (subject == Subject::walks) return {"failed", "stopped", "lost"};
  return {"rest", "end_of_ramp", "max_collisions"};
}

std::string_view column_in_folder(Role role) { return info(role).in_folder; }

std::optional<double> ImportedRow::*value_member(Role role) { return info(role).member; }

std::vector<RequestedColumn> column_requests(const std::string& text, Subject subject) {
  std::vector<RequestedColumn> requests;
  std::istringstream stream(text);
  for (std::string entry; std::getline(stream, entry, ',');) {
    const std::size_t equals = entry.find('=');
    const std::string what = entry.substr(0, equals);
    std::vector<std::string> names;
    for (const RoleInfo& role : roles)
      if (is_of(role.role, subject)) names.emplace_back(role.name);
    const bool known = std::ranges::find(names, what) != names.end();
    if (equals == std::string::npos || equals + 1 == entry.size() || !known)
      throw std::invalid_argument(
          fmt::format("--columns: {} is not WHAT=NAME or WHAT=NAME[UNIT], where WHAT is one of {}{}",
                      analysis::shown_text(entry), fmt::join(names, ", "), analysis::did_you_mean(what, names)));
    requests.push_back({std::ranges::find(roles, what, &RoleInfo::name)->role, entry.substr(equals + 1)});
  }
  return requests;
}

std::vector<MappedColumn> map_columns(const std::vector<RequestedColumn>& requests, std::span<const std::string> names,
                                      const std::string& file, int first_collision, Subject subject) {
  std::vector<MappedColumn> map;
  std::vector<bool> used(names.size());
  const auto take = [&](MappedColumn column) {
    if (column_of(map, column.role) != nullptr)
      throw std::invalid_argument(fmt::format("--columns: {} is given twice", role_name(column.role)));
    for (const std::size_t i : column.columns) {
      if (used[i]) throw std::invalid_argument(fmt::format("--columns: '{}' is taken twice", names[i]));
      used[i] = true;
    }
    map.push_back(std::move(column));
  };
  for (const RequestedColumn& request : requests) take(found_column(request, names, file, first_collision));
  for (const RoleInfo& role : roles) {
    const auto at = std::ranges::find(names, role.in_folder);
    if (!is_of(role.role, subject) || at == names.end() || column_of(map, role.role) != nullptr ||
        used[static_cast<std::size_t>(at - names.begin())])
      continue;
    take(found_column({role.role, *at}, names, file, first_collision));
  }
  return map;
}

bool names_all(const std::vector<RequestedColumn>& requests, std::span<const std::string> names, int first_collision) {
  std::vector<std::string> bare;
  for (const std::string& name : names) bare.emplace_back(split_unit(name).name);
  return std::ranges::all_of(requests, [&](const RequestedColumn& request) {
    const std::string without(split_unit(request.text).name);
    return !columns_called(request.text, names, first_collision).empty() ||
           !columns_called(without, names, first_collision).empty() ||
           !columns_called(without, bare, first_collision).empty();
  });
}

bool is_unit(std::string_view text) {
  while (text.starts_with(' ') || text.starts_with('[') || text.starts_with('(')) text.remove_prefix(1);
  while (text.ends_with(' ') || text.ends_with(']') || text.ends_with(')')) text.remove_suffix(1);
  const std::string spelled = with_deg(text);
  return std::ranges::any_of(roles, [&](const RoleInfo& role) {
    return std::ranges::find(role.units, std::string_view(spelled), &Unit::name) != role.units.end();
  });
}

const MappedColumn* column_of(const std::vector<MappedColumn>& map, Role role) {
  const auto at = std::ranges::find(map, role, &MappedColumn::role);
  return at == map.end() ? nullptr : &*at;
}

const MappedColumn* main_column(const std::vector<MappedColumn>& map) {
  for (const Role role : {Role::omega_minus, Role::half_angle, Role::angle})
    if (const MappedColumn* column = column_of(map, role)) return column;
  return nullptr;
}

std::string_view main_name(Subject subject) {
  return subject == Subject::walks ? "half_angle" : "omega_minus (or angle)";
}

}  // namespace metastable::reports
