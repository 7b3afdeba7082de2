#pragma once
// Says what is wrong with files that were read: it lists every defect with its place, several at once.

#include <cstddef>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace metastable::analysis {

/// Lists everything found wrong with an input, one line each: "FILE:LINE:COLUMN: what". A user error: exit code 2.
class InputError : public std::invalid_argument {
 public:
  /// @param lines not empty; what() is the lines joined by line feeds
  explicit InputError(std::vector<std::string> lines);
  const std::vector<std::string>& lines() const { return lines_; }

 private:
  std::vector<std::string> lines_;
};

/// Names a place in a text file. Both count from 1; 0 is not known or the file as a whole.
struct TextPosition {
  std::size_t line = 0;
  std::size_t column = 0;  ///< in bytes
};

/// Collects defects so that one run of a program shows them all.
class Defects {
 public:
  static constexpr std::size_t most_shown = 20;

  /// Adds a defect. The same words about the same file again are counted in the line of the first.
  void add(std::string_view file, TextPosition place, std::string_view what) { add(file, place, what, file); }
  /// Adds the defect of a row whose `file` names the row too. The same words about another row are likewise counted.
  void add_row(std::string_view file, std::string_view what) { add(file, {}, what, ""); }
  std::size_t count() const { return count_; }
  bool empty() const { return count_ == 0; }
  /// Returns the first `most_shown` different ones in the order they were added; what was left out is counted in a last
  /// line.
  std::vector<std::string> lines() const;
  /// @throws InputError if there is any
  void check() const;

 private:
  struct Defect {
    std::string group, line, what;
    std::size_t rows = 1;
  };
  void add(std::string_view file, TextPosition place, std::string_view what, std::string_view group);

  std::vector<Defect> shown_;
  std::size_t count_ = 0, left_out_ = 0;
};

/// Shows text from a file in a message: in single quotes, at most 40 bytes, everything but printable ASCII as \xNN.
std::string shown_text(std::string_view text);

}  // namespace metastable::analysis
