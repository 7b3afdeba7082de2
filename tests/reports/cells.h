#pragma once
// Reads a table's cells by the names of its columns.

#include <gtest/gtest.h>

#include <cstdint>
#include <stdexcept>
#include <string>
#include <variant>

#include "reports/output/table.h"

namespace metastable::reports::test {

/// Returns the cell of a row in the column of that name, the `occurrence`th of that name. @throws std::out_of_range
inline const Cell& at(const Table& table, std::size_t row, const std::string& column, int occurrence = 1) {
  for (std::size_t c = 0; c < table.columns.size(); ++c)
    if (table.columns[c].name == column && --occurrence == 0) return table.rows.at(row).at(c);
  throw std::out_of_range(table.id + ": no column '" + column + "'");
}

/// Returns the row whose first cell is this text. @throws std::out_of_range
inline std::size_t row_of(const Table& table, const std::string& first) {
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    const auto* text = std::get_if<std::string>(&table.rows[row].front().value());
    if (text != nullptr && *text == first) return row;
  }
  throw std::out_of_range(table.id + ": no row '" + first + "'");
}

/// Fails unless the cell is this text.
inline void expect_cell(const Cell& cell, const char* text) {
  const auto* held = std::get_if<std::string>(&cell.value());
  ASSERT_NE(held, nullptr);
  EXPECT_EQ(*held, text);
}
inline void expect_cell(const Cell& cell, const std::string& text) { expect_cell(cell, text.c_str()); }
/// Fails unless the cell is this whole number.
inline void expect_cell(const Cell& cell, int whole) {
  const auto* held = std::get_if<std::int64_t>(&cell.value());
  ASSERT_NE(held, nullptr);
  EXPECT_EQ(*held, whole);
}
/// Fails unless the cell is this number.
inline void expect_cell(const Cell& cell, double number) {
  const auto* held = std::get_if<double>(&cell.value());
  ASSERT_NE(held, nullptr);
  EXPECT_DOUBLE_EQ(*held, number);
}
/// Fails unless the cell is this number with this interval.
inline void expect_cell(const Cell& cell, const Estimate& estimate) {
  const auto* held = std::get_if<Estimate>(&cell.value());
  ASSERT_NE(held, nullptr);
  EXPECT_NEAR(held->value, estimate.value, 1e-10);
  EXPECT_NEAR(held->lower, estimate.lower, 1e-10);
  EXPECT_NEAR(held->upper, estimate.upper, 1e-10);
}
/// Fails unless the cell is infinite.
inline void expect_cell(const Cell& cell, Infinite) { EXPECT_TRUE(std::holds_alternative<Infinite>(cell.value())); }

/// Fails unless all rows are as wide as the header, as every rendering wants them.
inline void expect_rectangular(const Table& table) {
  for (const auto& row : table.rows) EXPECT_EQ(row.size(), table.columns.size()) << table.id;
}

}  // namespace metastable::reports::test
