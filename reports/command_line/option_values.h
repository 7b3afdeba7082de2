#pragma once
// Option texts to values, with messages that name the option and what it takes.

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/study/setting.h"
#include "dynamics/wheel/contact_noise.h"

namespace metastable::reports {

/// All throw std::invalid_argument: "--NAME: 'TEXT' is not ...".
double number_value(std::string_view name, std::string_view text);
/// Whole number in [least, most].
std::uint64_t whole_value(std::string_view name, std::string_view text, std::uint64_t least, std::uint64_t most);
/// "a,b,c" as numbers, at least one.
std::vector<double> list_value(std::string_view name, std::string_view text);
/// "mean,sd", or "mean" alone for a constant; sd >= 0.
analysis::Spread spread_value(std::string_view name, std::string_view text);
/// "first:last:step", a list "a,b,c", or one number: ascending values.
std::vector<double> range_value(std::string_view name, std::string_view text);
/// "paper", one length (then `count` legs of it), or a comma list of at least three [m].
std::vector<double> legs_value(std::string_view name, std::string_view text, int count);
/// Pairs from a CSV file with the header "restitution,friction"; errors name file, line and column.
std::vector<dynamics::Contact> contact_list(const std::string& file);

/// Ids of effects from a comma list, or from a file with one a line (# starts a comment); each once, in that order.
/// Errors name the id and the known ones, in a file the line too.
std::vector<std::string> catalogue_value(std::string_view name, const std::string& text);

}  // namespace metastable::reports
