#pragma once
// Finds how a CSV of somebody else's is laid out: separator, decimal comma, lines before the header, a row of units.

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/experiment/csv_reader.h"

namespace metastable::reports {

/// Holds what a user says of the layout; the rest is found.
struct AskedForm {
  std::optional<char> separator = {};  ///< ',', ';' or tab
  std::optional<char> decimal = {};    ///< '.' or ','
  std::optional<std::size_t> skip_rows = {};
  bool units_row = false;
};

struct FoundForm {
  analysis::CsvForm form;
  std::vector<std::string> found;  ///< what was not said, a sentence each
};

/// The header is the first line, of 40, whose names can be used; a row of units holds one and no number; numbers have
/// decimal commas where some have one and none has a point. What the user says is not asked of the file.
/// @param usable  says whether names are those of a header
FoundForm csv_form(std::string_view text, const AskedForm& asked,
                   const std::function<bool(const std::vector<std::string>&)>& usable);

}  // namespace metastable::reports
