#pragma once
// Reads options of the walkers on two legs, in the commands that take them.

#include <string>
#include <vector>

#include "reports/command_line/options.h"
#include "reports/commands/walker_command.h"

namespace metastable::reports {

/// Adds --walker, --slope-sd, --terrain and, for those commands that hold meshes, --spacing and --memory.
/// @param sd  what --slope-sd takes: "DEG", "DEG,DEG,..." or "RANGE"
void add_walker(Options& options, const std::string& sd, bool meshes = true);

/// Says whether --walker is given. @throws std::invalid_argument for options that have a meaning with it only
bool asks_for_walker(const Options& options);

/// Reads the settings, study and files; slopes come from --slope or --slopes, and --slope-sd, each a number, a list
/// (one for each setting, or one for all) or, for sweeps, a range.
/// @param own  options that this command has beyond those of all walkers
/// @throws std::invalid_argument for values out of range, and for options of the wheel
WalkerRequest walker_request(const Options& options, const std::string& command_line,
                             std::vector<std::string> own = {});
/// Likewise what meshes are told, of walkers and of simulators of one's own; `own` as above.
markov::MeshStudyOptions mesh_options(const Options& options, const std::vector<std::string>& own);
/// Reads the method of `steps`, "mesh" where none is given, and what splitting is told.
/// @throws std::invalid_argument for a method that walkers lack, and for options that mean nothing under it
WalkerMethod walker_method(const Options& options);
markov::SplittingOptions splitting_options(const Options& options);
/// Adds --level, and reads it. @throws std::invalid_argument for methods that do not split
void add_level(Options& options);
WalkerLevel walker_level(const Options& options, WalkerMethod method);
/// @throws std::invalid_argument for a parameter to be solved for that is neither "slope" nor "slope-sd"
void require_walker_parameter(const std::string& name);
/// Reads the setting of a walker of which one of the two, "slope" or "slope-sd", is not given but solved for.
analysis::WalkerSetting walker_solved_setting(const Options& options, const std::string& solved);
WalkerRequest walker_sweep_request(const Options& options, const std::string& command_line);

}  // namespace metastable::reports
