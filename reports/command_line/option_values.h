#pragma once
// Turns option texts into values, with messages that name the option and what it takes.

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/study/setting.h"
#include "dynamics/wheel/contact_noise.h"
#include "dynamics/wheel/ranges.h"

namespace metastable::reports {

/// @throws std::invalid_argument "CALLED: NUMBER is outside RANGE"; of a spread it says whether mean or sd
void check_in_range(std::string_view called, double value, const dynamics::Range& range);
void check_in_range(std::string_view called, const analysis::Spread& value, const dynamics::Range& range);
/// Likewise refuses any but 3 to 1000 legs whose lengths [m] are in their range.
void check_legs(std::string_view called, const std::vector<double>& lengths);

/// All throw std::invalid_argument: "--NAME: 'TEXT' is not ..." of what is no such thing at all, and "--NAME: NUMBER is
/// outside RANGE" of what is one.
double number_value(std::string_view name, std::string_view text, const dynamics::Range& range = {});
/// Reads a whole number in [least, most].
std::uint64_t whole_value(std::string_view name, std::string_view text, std::uint64_t least, std::uint64_t most);
/// Reads "a,b,c" as numbers, at least one; they may be infinite.
std::vector<double> list_value(std::string_view name, std::string_view text);
/// Reads "mean,sd", or "mean" alone for a constant; sd >= 0. "0,4" for a coefficient, which is hardly ever meant so, is
/// refused with a word on decimal points.
analysis::Spread spread_value(std::string_view name, std::string_view text, const dynamics::Range& range = {});
/// Reads "first:last:step", a list "a,b,c", or one number: ascending values.
std::vector<double> range_value(std::string_view name, std::string_view text, const dynamics::Range& range = {});
/// Reads "paper", one length (then `count` legs of it), or a comma list of 3 to 1000 [m].
std::vector<double> legs_value(std::string_view name, std::string_view text, int count);
/// Says whether it is one length, of which a number of legs can be had.
bool is_one_length(std::string_view text);
/// Reads pairs from a CSV file with the header "restitution,friction"; errors name file, line and column.
std::vector<dynamics::Contact> contact_list(const std::string& file);

/// Returns the ids of the catalogue.
std::vector<std::string> effect_ids();
/// Reads ids of effects from a comma list, or from a file with one a line (# starts a comment); each once, in that
/// order. Errors name the id and the known ones, in a file the line too.
std::vector<std::string> catalogue_value(std::string_view name, const std::string& text,
                                         const std::vector<std::string>& known = effect_ids());

}  // namespace metastable::reports
