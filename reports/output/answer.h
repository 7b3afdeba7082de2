#pragma once
// Gives what a command says: lines on standard output and, where --json asks for it, facts, tables and files as JSON.

#include <fmt/format.h>

#include <cstdio>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "reports/output/output_file.h"
#include "reports/output/table.h"

namespace metastable::reports {

/// The JSON holds "facts" (by name), "tables" (as of table_json.h), "files" (paths), "said" (the lines that would have
/// been printed) and "provenance"; what is empty is left out.
class Answer {
 public:
  /// @param json  file, "-" for standard output, where nothing else is printed then, "" for none
  /// @throws OutputError if the file cannot be written: at once
  explicit Answer(const std::string& json);

  /// Prints a line, which needs no line end.
  template <typename... T>
  void say(fmt::format_string<T...> format, T&&... values) {
    line(fmt::format(format, std::forward<T>(values)...));
  }
  /// Prints a table, as wide as the terminal.
  void show(const Table& table);
  void fact(const std::string& name, Cell value) { facts_.emplace_back(name, std::move(value)); }
  void table(Table table) { tables_.push_back(std::move(table)); }
  void file(const std::string& path) { files_.push_back(path); }
  /// Writes the JSON that was asked for. Call once, last.
  void finish(const Provenance& provenance);

 private:
  void line(const std::string& text);

  std::optional<OutputFile> json_;
  bool printed_ = true;
  std::vector<std::pair<std::string, Cell>> facts_;
  std::vector<Table> tables_;
  std::vector<std::string> files_, said_;
};

}  // namespace metastable::reports
