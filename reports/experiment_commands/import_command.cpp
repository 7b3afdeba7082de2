#include "reports/experiment_commands/import_command.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>

#include "analysis/experiment/csv_reader.h"
#include "analysis/experiment/experiment_folder.h"
#include "reports/experiment_commands/experiment_output.h"
#include "reports/import/csv_rows.h"
#include "reports/import/imported_experiment.h"
#include "reports/import/mat_file.h"
#include "reports/output/input_file.h"
#include "reports/output/standard_output.h"
#include "reports/output/table.h"
#include "reports/output/version.h"

namespace metastable::reports {
namespace {

// Holds what one file tells, whatever its kind.
struct ForeignFile {
  std::vector<ImportedRow> rows;
  std::vector<MappedColumn> map;
  std::vector<std::string> names;
  std::vector<std::string> found = {};  // of its layout, a sentence each
};

std::vector<MappedColumn> mapped(const ImportRequest& request, const std::vector<std::string>& names) {
  return map_columns(request.columns, names, request.file, request.collisions_from, request.subject);
}

ForeignFile read_csv(const ImportRequest& request, const std::string& text) {
  if (request.orientation != TrialsIn::not_told)
    throw std::invalid_argument("--trials-in: has a meaning for matrices of a MAT file only");
  ForeignFile file;
  analysis::Defects defects;
  auto [form, found] = csv_form(text, request.form, [&](const std::vector<std::string>& names) {
    try {
      if (!request.columns.empty()) return names_all(request.columns, names, request.collisions_from);
      return main_column(mapped(request, names)) != nullptr;
    } catch (const std::invalid_argument&) {
      return false;
    }
  });
  file.found = std::move(found);
  file.names = analysis::CsvReader::names(text, form);
  if (request.form.separator && file.names.size() == 1)
    for (const auto& [separator, name] : {std::pair(';', "';'"), std::pair('\t', "tab"), std::pair(',', "','")})
      if (separator != *request.form.separator && file.names.front().find(separator) != std::string::npos)
        throw std::invalid_argument(
            fmt::format("{}:1: one column, which holds a {}; say --separator {}", request.file, name, name));
  if (!file.names.empty()) file.map = mapped(request, file.names);
  if (!file.names.empty() && main_column(file.map) == nullptr)
    throw std::invalid_argument(fmt::format("--columns: which column of {} is {}? It has {}", request.file,
                                            main_name(request.subject), fmt::join(file.names, ", ")));
  file.rows = csv_rows(request.file, text, form, file.map, request.collisions_from, defects);
  defects.check();
  return file;
}

ForeignFile read_foreign(const ImportRequest& request) {
  const std::string text = read_file(request.file);
  if (!is_mat_file(text)) return read_csv(request, text);
  if (request.form.separator || request.form.decimal || request.form.skip_rows || request.form.units_row)
    throw std::invalid_argument(fmt::format(
        "{}: is a MAT file; --separator, --decimal, --skip-rows and --units-row are for a CSV", request.file));
  MatRows read =
      mat_rows(request.file, text, request.columns, request.orientation, request.collisions_from, request.subject);
  return {std::move(read.rows), std::move(read.map), std::move(read.names), std::move(read.found)};
}

// What of the map tells of angles is not told of collisions, and the other way round.
void check_roles(const std::vector<MappedColumn>& map) {
  if (column_of(map, Role::angle) == nullptr) return;
  for (const Role role : {Role::omega_minus, Role::omega_plus, Role::collision, Role::leg, Role::position})
    if (column_of(map, role) != nullptr)
      throw std::invalid_argument(fmt::format(
          "--columns: angle and {}: one file tells either collisions or what a camera saw", role_name(role)));
  if (column_of(map, Role::time) == nullptr) throw std::invalid_argument("--columns: angle needs time");
}

// Returns the experiment.toml of the walker that the options state.
std::string walker_description(const ImportRequest& request, const std::vector<ImportedRow>& rows,
                               const std::vector<std::string>& comment) {
  analysis::WalkStatement told{request.title, {*request.walker}, {}, comment};
  for (const Role role : {Role::half_angle, Role::stance_rate, Role::swing_rate}) {
    const bool has = std::ranges::any_of(rows, [&](const auto& row) { return (row.*value_member(role)).has_value(); });
    const auto error = std::ranges::find(request.errors, role, &std::pair<Role, double>::first);
    if (!has && error != request.errors.end())
      throw std::invalid_argument(fmt::format("--errors: {}: {} holds no value of it", role_name(role), request.file));
    if (!has) continue;
    if (role == Role::swing_rate && request.walker->walker == analysis::Walker::simplest)
      throw std::invalid_argument(
          "--columns: swing_rate: the simplest walker is told by half_angle and stance_rate; leave it out");
    told.columns.emplace_back(std::string(column_in_folder(role)),
                              error == request.errors.end() ? std::nullopt : std::optional(error->second));
  }
  return analysis::walk_toml(told);
}

std::string description_of(const ImportRequest& request, const std::vector<ImportedRow>& rows,
                           const std::vector<std::string>& comment) {
  if (!request.description.empty()) {
    std::string text;
    for (const std::string& line : comment) text += "# " + line + "\n";
    return text + read_file(request.description);
  }
  if (request.walker) return walker_description(request, rows, comment);
  std::vector<std::pair<std::string, double>> slopes = request.slopes;
  if (slopes.empty()) {
    for (const ImportedRow& row : rows)
      if (row.condition &&
          std::ranges::find(slopes, *row.condition, &std::pair<std::string, double>::first) == slopes.end())
        slopes.emplace_back(*row.condition, request.setting.slope_deg);
    if (slopes.empty()) slopes.emplace_back(fmt::format("{}", request.setting.slope_deg), request.setting.slope_deg);
  }
  std::string toml = analysis::wheel_description(request.setting, request.setting.restitution, request.setting.friction,
                                                 request.title, comment);
  for (const auto& [id, slope] : slopes) {
    analysis::Setting setting = request.setting;
    setting.slope_deg = slope;
    toml += analysis::condition_description(id, setting, false, request.first_leg_stated);
  }
  if (request.sensor_noise) toml += fmt::format("\n[sensor]\nnoise_sd_rad_s = {}\n", *request.sensor_noise);
  return toml;
}

std::vector<std::string> unused(const ForeignFile& file) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < file.names.size(); ++i)
    if (std::ranges::none_of(file.map, [&](const MappedColumn& column) {
          return std::ranges::find(column.columns, i) != column.columns.end() ||
                 column.name.starts_with(file.names[i] + ".");
        }))
      names.push_back(file.names[i]);
  return names;
}

std::string import_json(const ImportRequest& request, const ForeignFile& file, const Imported& imported,
                        const Provenance& provenance) {
  nlohmann::ordered_json json = {{"folder", request.out}, {"trials", imported.trials}, {"rows", imported.rows}};
  const char* const rows = request.subject == Subject::walks ? "steps" : "collisions";
  for (const Imported::Counted& c : imported.conditions)
    json["conditions"].push_back({{"id", c.id}, {"trials", c.trials}, {rows, imported.source.angle_csv ? 0 : c.rows}});
  for (const MappedColumn& column : file.map)
    json["columns"][std::string(role_name(column.role))] = {{"name", column.name}, {"unit", column.unit}};
  json["unused"] = unused(file);
  json["found"] = file.found;
  json["assumed"] = imported.assumed;
  json["notes"] = imported.notes;
  json["provenance"] = provenance_lines(provenance);
  return json.dump(2) + "\n";
}

void print_import(const ImportRequest& request, const ForeignFile& file, const Imported& imported) {
  const bool angles = imported.source.angle_csv.has_value();
  const char* const what = request.subject == Subject::walks ? "steps" : angles ? "frames" : "collisions";
  say("{}: {} trials, {} {}\n", request.out, imported.trials, imported.rows, what);
  if (!angles && imported.conditions.size() > 1)
    for (const Imported::Counted& c : imported.conditions)
      say("  {}: {} trials, {} {}\n", c.id, c.trials, c.rows, what);
  for (const MappedColumn& column : file.map)
    say("  {:<12} {}{}\n", role_name(column.role), column.name,
        column.unit.empty() ? "" : fmt::format(" in {}", column.unit));
  for (const std::string& sentence : file.found) say("found: {}\n", sentence);
  for (const std::string& sentence : imported.assumed) say("assumed: {}\n", sentence);
  if (const std::vector<std::string> names = unused(file); !names.empty())
    say("not used: {}\n", fmt::join(names, ", "));
  for (const std::string& note : imported.notes) say("note: {}\n", note);
  say("next: metastable {} {}\n", angles ? "collisions" : "diagnose", request.out);
}

}  // namespace

void run_import(const ImportRequest& request) {
  ExperimentOutput folder(request.out);
  const ForeignFile file = read_foreign(request);
  check_roles(file.map);
  const Provenance provenance{request.command, "imported from " + request.file, 0, version()};
  ImportOptions options;
  options.subject = request.subject;
  options.description = description_of(request, file.rows, provenance_lines(provenance));
  options.description_file = !request.description.empty() ? request.description
                             : request.walker             ? "what is stated of the walker"
                                                          : "what is stated of wheel and ramp";
  options.number_trials = request.number_trials;
  options.first_collision = request.collisions_from;
  options.first_leg = request.legs_from;
  options.outcomes = request.outcomes;
  const Imported imported = imported_experiment(request.file, file.rows, options);
  std::optional<OutputFile> json;
  if (!request.json.empty()) json.emplace(request.json);
  folder.write(imported.source);
  if (json) {
    json->stream() << import_json(request, file, imported, provenance);
    json->commit();
  }
  if (request.json != "-") print_import(request, file, imported);
}

}  // namespace metastable::reports
