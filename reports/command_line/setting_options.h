#pragma once
// Reads options that several commands share: wheel, contact, course, study.

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "analysis/sensitivity/propagation.h"
#include "analysis/study/metastability.h"
#include "analysis/study/setting.h"
#include "dynamics/wheel/contact_noise.h"
#include "reports/command_line/options.h"

namespace metastable::reports {

void add_slope(Options& options);
/// Adds --initial-speed. @param whose  what it is, or of which
void add_launch(Options& options, const std::string& whose);
/// Adds what experiment.toml can state of a wheel and its contact, and the rest.
void add_stated_wheel(Options& options);
void add_stated_contact(Options& options);
void add_wheel(Options& options);
void add_contact(Options& options);
void add_course(Options& options);
/// @param walkers  whether --method chooses among those of walkers, too
void add_study(Options& options, bool walkers = false);
void add_standard_errors(Options& options);

/// Contacts in the place of those in the file of --contact-list, which only has to be given then.
using Pairs = std::optional<std::vector<dynamics::Contact>>;

/// Reads what the options above say, as far as the command has them: all but slope and launch speed.
analysis::Setting common_setting(const Options& options, const Pairs& pairs = {});
/// Reads `text` as the launch of a setting; without one it is the paper's at its slope, and steady where the paper has
/// none. @throws std::invalid_argument for a text that is neither "steady" nor mean and sd
void set_launch(analysis::Setting& setting, const std::optional<std::string>& text);
/// Reads --slope and --initial-speed too, and checks them. @param slope_option  that a message on the slope names
analysis::Setting one_setting(const Options& options, const Pairs& pairs = {}, const char* slope_option = "slope");
/// Makes one setting a value of --slopes, at least `least` of them, with --initial-speed once a slope; checked.
std::vector<analysis::Setting> several_settings(const Options& options, std::size_t least);
/// Adds what several settings are told apart by: the slopes, and means and sds of eta and mu; lets the options of
/// wheel, contact and course, added before, hold several values.
void add_compared(Options& options);
/// Makes all combinations of the values that were given, two settings at least, the first of all in front; checked. Of
/// several slopes --initial-speed is given once a slope. Where laws differ, an option counts for those that know it.
/// @throws std::invalid_argument as one_setting(), and for more than 100
std::vector<analysis::Setting> compared_settings(const Options& options);
analysis::StudyOptions study_options(const Options& options);
/// Reads the standard errors above 0 that were given, checked against the setting. @throws std::invalid_argument
std::vector<analysis::StandardError> standard_errors(const Options& options, const analysis::Setting& setting);

}  // namespace metastable::reports
