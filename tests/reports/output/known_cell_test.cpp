#include "reports/output/known_cell.h"

#include <gtest/gtest.h>

#include <optional>

#include "tests/reports/cells.h"

namespace metastable::reports::test {
namespace {

using analysis::infinite;
using analysis::undefined;

TEST(KnownCell, IsEmptyWhereThereIsNoNumber) {
  expect_cell(known_cell(2.5), 2.5);
  expect_cell(known_cell(undefined), "");
  expect_cell(known_cell(std::optional<double>{}), "");
  expect_cell(known_cell(std::optional<double>{undefined}), "");
  expect_cell(positive_cell(0), "");
  expect_cell(positive_cell(0.5), 0.5);
}

TEST(KnownCell, OfAnInfiniteNumberSaysWhatItIsMoreThan) {
  expect_cell(estimate_cell({6, 5, 7}), Estimate{6, 5, 7});
  expect_cell(estimate_cell({undefined, 5, 7}), "");
  expect_cell(estimate_cell({infinite, 1234.5, infinite}), "> 1230");
  expect_cell(estimate_cell({infinite, 12.345, infinite}, 4), "> 12.35");
  expect_cell(estimate_cell({infinite, infinite, infinite}), Infinite{});
}

}  // namespace
}  // namespace metastable::reports::test
