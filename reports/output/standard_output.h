#pragma once
// Writes standard output: sentences that fit the terminal, and whether all was written.

#include <fmt/format.h>

#include <string_view>
#include <utility>

namespace metastable::reports {

/// Prints text; on a terminal as fitted() (text_table.h) to its width, else as it is.
void say_text(std::string_view text);

/// Does the same for a formatted text. A line has to be said as a whole.
template <typename... T>
void say(fmt::format_string<T...> format, T&&... values) {
  say_text(fmt::format(format, std::forward<T>(values)...));
}

/// Sees to it that all that was printed has been written. @throws OutputError
void flush_standard_output();

}  // namespace metastable::reports
