#pragma once
// Makes requests of options: for the command line, and for whoever else fills options.

#include <functional>
#include <string>

#include "analysis/sensitivity/sweep.h"
#include "reports/command_line/options.h"
#include "reports/command_line/setting_options.h"
#include "reports/commands/request.h"
#include "reports/commands/solve_command.h"
#include "reports/commands/walker_command.h"

namespace metastable::reports {

/// Add the options of these commands.
void declare_steps(Options& options);
void declare_compare(Options& options);
void declare_sweep(Options& options);
void declare_solve(Options& options);
void declare_simulate(Options& options);
void declare_describe(Options& options);
void declare_diagnose(Options& options);
void declare_blind(Options& options);

/// All read what was given into a request, checked. @param line  the command, for provenance
/// @throws std::invalid_argument naming the option, what is wrong, and the range
StepsRequest steps_request(const Options& options, const analysis::Setting& setting, const std::string& line);
/// @param settings  two or more
CompareRequest compare_request(const Options& options, const std::vector<analysis::Setting>& settings,
                               const std::string& line);
/// Reads the axis of that name for a sweep of the setting. @throws std::invalid_argument if the setting has no use for
/// it
analysis::SweepAxis sweep_axis(const Options& options, const char* name, const analysis::Setting& setting);
/// Reads what to solve for, of a wheel. @param setting  with any value of the parameter
SolveRequest solve_request(const Options& options, const analysis::Setting& setting, const std::string& line);
/// Reads it of a walker; where its setting is not that of the options it is @param setting
SolveRequest walker_solve_request(const Options& options, const analysis::WalkerSetting& setting,
                                  const std::string& line);
/// @param pairs  as of one_setting()
SimulateRequest simulate_request(const Options& options, const std::string& line, const Pairs& pairs = {});
/// Reads the trials of a walker, of which the options tell.
WalkerRequest walker_simulate_request(const Options& options, const std::string& line);
/// Reads what --reality adds.
LaboratoryRequest laboratory_request(const Options& options, const SimulateRequest& plain);
DescribeRequest describe_request(const Options& options, const std::string& line);
DiagnoseRequest diagnose_request(const Options& options, const std::string& line);
BlindRequest blind_request(const Options& options, const std::string& line);

}  // namespace metastable::reports
