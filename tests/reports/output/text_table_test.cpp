// Checks tables for the terminal: widths, wrapping, what is not shown.

#include "reports/output/text_table.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <string>

namespace metastable::reports {
namespace {

TEST(TextTable, AlignsColumnsAndLeavesOutEmptyOnes) {
  const Table table{.id = "t",
                    .title = "Title",
                    .columns = {{"name"}, {"nothing"}, {"η", "rad/s"}},
                    .rows = {{"a", "", 1.5}, {"long", "", Infinite{}}, {"c", "", 2.0}}};
  EXPECT_EQ(to_text(table, 2),
            "Title\n"
            "  name  η [rad/s]\n"
            "  a          1.50\n"
            "  long   infinite\n"
            "  and 1 more\n");
  Table bad = table;
  bad.rows[1][2] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(to_text(bad), std::invalid_argument);
}

TEST(TextTable, WrapsAtSpaces) { EXPECT_EQ(wrapped("one two three", "  ", 9), "  one two\n  three\n"); }

TEST(TextTable, TextWrapsInItsCellAndNothingIsCut) {
  const Table table{.id = "t",
                    .title = "Claims",
                    .columns = {{"where"}, {"claim"}, {"of the whole number", "J"}},
                    .rows = {{"Fig. 4", "fast and slow start meet by the 12th collision", 1.5},
                             {"Sec. IV", "losses come out when nothing rests", 22.25}}};
  EXPECT_EQ(to_text(table, 10, 42),
            "Claims\n"
            "                              of the whole\n"
            "  where    claim                number [J]\n"
            "\n"
            "  Fig. 4   fast and slow              1.50\n"
            "           start meet by the\n"
            "           12th collision\n"
            "\n"
            "  Sec. IV  losses come out            22.2\n"
            "           when nothing\n"
            "           rests\n");
  EXPECT_EQ(to_text(table, 10, 200),
            "Claims\n"
            "  where    claim                                           of the whole number [J]\n"
            "  Fig. 4   fast and slow start meet by the 12th collision                     1.50\n"
            "  Sec. IV  losses come out when nothing rests                                 22.2\n");
}

std::size_t widest(const std::string& text) {
  std::size_t most = 0;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);)
    most =
        std::max<std::size_t>(most, std::count_if(line.begin(), line.end(), [](char c) { return (c & 0xC0) != 0x80; }));
  return most;
}

std::string without_space(std::string text) {
  std::erase_if(text, [](char c) { return c == ' ' || c == '\n'; });
  std::sort(text.begin(), text.end());
  return text;
}

// At every width down to one where single words are the limit no line is longer, and all characters are there.
TEST(TextTable, NoLineIsLongerThanTheWindow) {
  const Table table{.id = "t",
                    .title = "Which effect explains the gap that is left after recalibration",
                    .notes = {"A note that is longer than a narrow window would hold."},
                    .columns = {{"cause"}, {"steady speed", "rad/s"}, {"closed (90 %)"}, {"parameters"}},
                    .rows = {{"speed_dependent_restitution+leg_contact", Estimate{5.654, 5.645, 5.663},
                              NotShown{{1.37, -1.41, 1.42}, "not known: wider than the gap"}, "leg 3, ratio 1.13"},
                             {"none of these", Estimate{4.8, 4.77, 4.81}, 0.97, ""}}};
  const std::string all = without_space(to_text(table, 10, 1000));
  for (std::size_t width = 48; width < 140; ++width) {
    const std::string text = to_text(table, 10, width);
    EXPECT_LE(widest(text), width) << text;
    EXPECT_EQ(without_space(text), all) << text;
  }
}

// Of twelve columns in sixty characters the ones that find no room stand below, beside the names again.
TEST(TextTable, MoreColumnsThanTheWindowHoldsGoOnBelow) {
  Table table{.id = "t", .title = "T", .columns = {{"conditions"}}, .rows = {{"fast-9.59, slow-9.59"}, {"all"}}};
  for (int i = 0; i < 11; ++i) {
    table.columns.push_back({"P Kolmogorov-Smirnov " + std::to_string(i)});
    for (std::vector<Cell>& row : table.rows) row.emplace_back(static_cast<std::int64_t>(1000 + i));
  }
  const std::string text = to_text(table, 10, 60);
  EXPECT_LE(widest(text), 60U) << text;
  EXPECT_NE(text.find("conditions"), text.rfind("conditions")) << text;
  EXPECT_NE(text.find("\n\n"), std::string::npos) << text;
  for (int i = 0; i < 11; ++i) EXPECT_NE(text.find(std::to_string(1000 + i)), std::string::npos) << text;
  EXPECT_EQ(to_text(table, 10, 400).find("\n\n"), std::string::npos);
}

TEST(TextTable, LinesAreFittedUnderWhatTheySay) {
  const std::string line = "  label          one two three four five six\n", plain = "  no label, but as many words\n";
  EXPECT_EQ(fitted(line, 44), line);
  EXPECT_EQ(fitted(line, 36), "  label          one two three four\n                 five six\n");
  EXPECT_EQ(fitted("a\n" + line + "\nb", 36), "a\n" + fitted(line, 36) + "\nb");
  EXPECT_EQ(fitted(plain, 20), "  no label, but as\n    many words\n");
  // A label wider than half a line stands above.
  EXPECT_EQ(fitted(line, 28), "  label\n      one two three four\n      five six\n");
}

TEST(TextTable, ANumberThatSaysNothingIsSaidSo) {
  const Table table{.id = "t",
                    .title = "T",
                    .columns = {{"closed"}},
                    .rows = {{NotShown{{1.37, -1.41, 1.42}, "not known: wider than the gap"}}}};
  EXPECT_NE(to_text(table).find("not known: wider than the gap"), std::string::npos);
  EXPECT_EQ(to_text(table).find("1.37"), std::string::npos);
}

}  // namespace
}  // namespace metastable::reports
