#pragma once
// Options of the walkers on two legs.

#include <string>

#include "reports/command_line/options.h"
#include "reports/commands/walker_command.h"

namespace metastable::reports {

void add_walker(Options& options);
/// Whether --walker is given. @throws std::invalid_argument for options that have a meaning with it only
bool asks_for_walker(const Options& options);
/// @throws std::invalid_argument for values out of range and for options of the wheel
WalkerStepsRequest walker_steps_request(const Options& options, const std::string& command_line);

}  // namespace metastable::reports
