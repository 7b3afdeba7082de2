#include "reports/output/text_table.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <sstream>
#include <stdexcept>
#include <string_view>
#include <variant>
#include <vector>

namespace metastable::reports {
namespace {

constexpr std::size_t least_width = 40;
constexpr std::size_t gap = 2;  // spaces before a column

using Lines = std::vector<std::string>;

std::string cell_text(const Cell& cell, const Column& column) {
  struct Visitor {
    const Column& column;
    std::string operator()(const std::string& text) const { return text; }
    std::string operator()(std::int64_t whole) const { return fmt::format("{}", whole); }
    std::string operator()(double number) const { return format_number(number, column.format, column.digits); }
    std::string operator()(const Estimate& e) const { return format_estimate(e, column.format, column.digits); }
    std::string operator()(Infinite) const { return "infinite"; }
    std::string operator()(const NotShown& hidden) const { return hidden.said; }
  };
  return std::visit(Visitor{column}, cell.value());
}

// Returns `text` cut behind each character of `marks`, spaces dropped.
Lines pieces(const std::string& text, std::string_view marks) {
  Lines all(1);
  for (const char c : text) {
    const bool space = c == ' ' || c == '\n';
    if (!space) all.back() += c;
    if (space || marks.find(c) != std::string_view::npos) all.emplace_back();
  }
  std::erase(all, "");
  return all;
}

std::size_t longest(const Lines& texts) {
  std::size_t most = 0;
  for (const std::string& text : texts) most = std::max(most, length(text));
  return most;
}

constexpr std::string_view in_names = "_+-";  // a long name may break behind these

// Returns lines of at most `width` characters as far as words allow. A name that is longer breaks too.
Lines broken(const std::string& text, std::size_t width) {
  Lines lines;
  for (const std::string& word : pieces(text, "")) {
    std::string_view space = " ";
    for (const std::string& part : length(word) <= width ? Lines{word} : pieces(word, in_names)) {
      if (!lines.empty() && length(lines.back()) + space.size() + length(part) <= width)
        lines.back().append(space).append(part);
      else
        lines.push_back(part);
      space = "";
    }
  }
  if (lines.empty()) lines.emplace_back();
  return lines;
}

struct Shown {
  Lines cells;                         // the heading first
  std::vector<bool> text;              // by cell: may be broken in any case
  std::array<std::size_t, 4> least{};  // widths: names broken, words whole, numbers whole, everything on one line
  std::size_t body = 0;                // width of the longest cell, the heading in two lines
  std::size_t width = 0;
  bool flush_left = true;

  void measure() {
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const std::size_t whole = length(cells[i]), words = longest(pieces(cells[i], ""));
      const std::array<std::size_t, 4> of{longest(pieces(cells[i], in_names)), words, text[i] ? words : whole, whole};
      body = std::max(body, i > 0 ? whole : whole / 2 + 1);
      for (std::size_t k = 0; k < of.size(); ++k) least[k] = std::max(least[k], of[k]);
    }
  }
};

// Breaks as little as `width` allows: words wrap first, then numbers leave their interval, then names break; within
// one of these the widest columns give way, and what is left over goes to the headings.
void fit(std::vector<Shown>& columns, std::size_t width) {
  const auto total = [&] {
    std::size_t sum = 0;
    for (const Shown& column : columns) sum += gap + column.width;
    return sum;
  };
  for (std::size_t k = 4; k-- > 0;) {
    for (Shown& column : columns) column.width = column.least[k];
    if (total() <= width) break;
  }
  for (const bool headings : {false, true})
    for (std::size_t cap = 1; cap <= width; ++cap)
      for (Shown& column : columns) {
        const std::size_t wanted = std::min(cap, headings ? column.least.back() : column.body);
        if (wanted > column.width && total() + wanted - column.width <= width) column.width = wanted;
      }
}

// More columns than `width` holds come one part below the other; those of text that stand first are in each.
std::vector<std::vector<Shown>> parts(const std::vector<Shown>& columns, std::size_t width) {
  const auto first_number = std::ranges::find_if(columns, [](const Shown& column) { return !column.flush_left; });
  const std::vector<Shown> names(columns.begin(), first_number);
  std::vector<std::vector<Shown>> all{names};
  const auto used = [](const std::vector<Shown>& part) {
    std::size_t sum = 0;
    for (const Shown& column : part) sum += gap + column.least.front();
    return sum;
  };
  for (auto column = first_number; column != columns.end(); ++column) {
    if (all.back().size() > names.size() && used(all.back()) + gap + column->least.front() > width)
      all.push_back(names);
    all.back().push_back(*column);
  }
  return all;
}

// Writes the columns in lines, all rows of them.
std::string side_by_side(std::vector<Shown> columns, std::size_t rows, std::size_t width) {
  fit(columns, width);

  std::vector<std::string> blocks;
  std::size_t tall = 0;
  for (std::size_t i = 0; i <= rows; ++i) {
    std::vector<Lines> cells;
    std::size_t height = 0;
    for (const Shown& column : columns) {
      cells.push_back(broken(column.cells[i], column.width));
      height = std::max(height, cells.back().size());
    }
    std::string& block = blocks.emplace_back();
    for (std::size_t k = 0; k < height; ++k) {
      std::string line;
      for (std::size_t j = 0; j < columns.size(); ++j) {
        // A heading of two lines stands on the numbers below it.
        const std::size_t above = i == 0 ? height - cells[j].size() : 0;
        const std::string text = k >= above && k - above < cells[j].size() ? cells[j][k - above] : "";
        const std::string space(columns[j].width - std::min(columns[j].width, length(text)), ' ');
        line += std::string(gap, ' ') + (columns[j].flush_left ? text + space : space + text);
      }
      line.erase(line.find_last_not_of(' ') + 1);
      block += line + "\n";
    }
    tall += i > 0 && height > 1;
  }
  std::string out;
  for (std::size_t i = 0; i < blocks.size(); ++i) out += (2 * tall > rows && i > 0 ? "\n" : "") + blocks[i];
  return out;
}

}  // namespace

std::size_t length(std::string_view text) {
  return static_cast<std::size_t>(std::ranges::count_if(text, [](char c) { return (c & 0xC0) != 0x80; }));
}

std::size_t terminal_width() {
  if (::isatty(STDOUT_FILENO) != 1) return line_width;
  winsize window{};
  std::size_t columns = 0;
  if (::ioctl(STDOUT_FILENO, TIOCGWINSZ, &window) == 0) columns = window.ws_col;
  const char* told = columns == 0 ? std::getenv("COLUMNS") : nullptr;
  if (told) columns = std::strtoul(told, nullptr, 10);
  return columns == 0 ? line_width : std::max(columns, least_width);
}

std::string wrapped(const std::string& text, const std::string& indent, std::size_t width) {
  std::string out, line = indent;
  std::istringstream words(text);
  for (std::string word; words >> word;) {
    if (line != indent && length(line) + 1 + length(word) > width) {
      out += line + "\n";
      line = indent;
    }
    line += (line == indent ? "" : " ") + word;
  }
  return out + line + "\n";
}

namespace {

// Returns a line broken at spaces, its text from byte `said` on below itself, `column` characters in.
std::string hanging(std::string_view line, std::size_t said, std::size_t column, std::size_t width) {
  const std::string rest = wrapped(std::string(line.substr(said)), std::string(column, ' '), width);
  return std::string(line.substr(0, said)) + rest.substr(column, rest.size() - column - 1);
}

}  // namespace

std::string fitted(std::string_view text, std::size_t width) {
  std::string out;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size() - 1) + 1;
    std::string_view line = text.substr(0, end);
    text.remove_prefix(end);
    const bool ended = line.back() == '\n';
    if (ended) line.remove_suffix(1);
    const std::size_t start = std::min(line.find_first_not_of(' '), line.size());
    const std::size_t said = line.find_first_not_of(' ', std::min(line.find("  ", start), line.size()));
    if (length(line) <= width) {
      out += line;
    } else if (said == std::string_view::npos) {
      out += hanging(line, start, start + 2, width);
    } else if (const std::size_t column = length(line.substr(0, said)); 2 * column <= width) {
      out += hanging(line, said, column, width);
    } else {  // beside such a label the text would be squeezed: it stands below
      const std::string indent(start + 4, ' '), label(line.substr(0, line.find("  ", start)));
      out += hanging(label, start, start + 2, width) + "\n" +
             hanging(indent + std::string(line.substr(said)), start + 4, start + 4, width);
    }
    if (ended) out += '\n';
  }
  return out;
}

std::string to_text(const Table& table, std::size_t most, std::size_t width) {
  const std::size_t rows = std::min(most, table.rows.size());
  std::vector<Shown> columns;
  for (std::size_t j = 0; j < table.columns.size(); ++j) {
    const Column& column = table.columns[j];
    Shown shown;
    bool empty = true;
    shown.cells.push_back(column.unit.empty() ? column.name : column.name + " [" + column.unit + "]");
    shown.text.push_back(true);
    for (std::size_t i = 0; i < rows; ++i) {
      const Cell& cell = table.rows[i].at(j);
      try {
        shown.cells.push_back(cell_text(cell, column));
      } catch (const std::invalid_argument& error) {
        throw std::invalid_argument(
            fmt::format("table '{}', row {}, column '{}': {}", table.id, i + 1, column.name, error.what()));
      }
      const bool text = std::holds_alternative<std::string>(cell.value());
      empty = empty && shown.cells.back().empty();
      shown.flush_left = shown.flush_left && text;
      shown.text.push_back(text || std::holds_alternative<NotShown>(cell.value()));
    }
    if (empty && rows > 0) continue;
    shown.measure();
    columns.push_back(std::move(shown));
  }
  std::string out = wrapped(table.title, "", width);
  std::string_view between;
  for (const std::vector<Shown>& part : parts(columns, width)) {
    out.append(between).append(side_by_side(part, rows, width));
    between = "\n";
  }
  if (table.rows.size() > rows) out += fmt::format("  and {} more\n", table.rows.size() - rows);
  for (const std::string& note : table.notes) out += wrapped(note, "  ", width);
  return out;
}

}  // namespace metastable::reports
