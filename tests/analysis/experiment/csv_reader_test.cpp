#include "analysis/experiment/csv_reader.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "analysis/experiment/csv_field.h"

namespace metastable::analysis {
namespace {

using Strings = std::vector<std::string>;

constexpr CsvColumn columns[] = {{"name"}, {"count", true}, {"speed"}};

// Holds the rows' names and the defects of a text.
struct Reading {
  Strings names, defects;
};
Reading read(std::string_view text) {
  Defects defects;
  Reading reading;
  CsvReader csv("f.csv", text, columns, defects);
  while (csv.next()) {
    reading.names.emplace_back(csv.text(0));
    std::optional<std::int64_t> count;
    std::optional<double> speed;
    csv.read(1, 1, 99, count);
    csv.read(2, dynamics::Range{.low = 0, .high = 1000}, speed);
  }
  reading.defects = defects.lines();
  return reading;
}

TEST(CsvReader, ReadsQuotesLineEndsAndByteOrderMark) {
  EXPECT_EQ(read("name,count\na,1\nb,2\n").names, (Strings{"a", "b"}));
  EXPECT_EQ(read("name,count\na,1\nb,2").names, (Strings{"a", "b"}));
  EXPECT_EQ(read("\xEF\xBB\xBFname,count\r\na,1\r\nb,2\r\n").names, (Strings{"a", "b"}));
  const Reading quotes = read("count,\"name\"\n1,\"a,b\"\n2,\"say \"\"no\"\"\"\n3,\"two\nlines\"\n4,\"\"\n");
  EXPECT_EQ(quotes.names, (Strings{"a,b", "say \"no\"", "two\nlines", ""}));
  EXPECT_TRUE(quotes.defects.empty());
}

TEST(CsvReader, ReadsNumbers) {
  Defects defects;
  CsvReader csv("f.csv", "count,speed\n+7,1.25e1\n3.0,\n", columns, defects);
  std::optional<std::int64_t> count;
  std::optional<double> speed;
  ASSERT_TRUE(csv.next());
  EXPECT_TRUE(csv.read(1, 1, 99, count) && csv.read(2, dynamics::Range{.low = 0, .high = 1000}, speed));
  EXPECT_EQ(count, 7);
  EXPECT_EQ(speed, 12.5);
  ASSERT_TRUE(csv.next());
  EXPECT_TRUE(csv.read(1, 1, 99, count) && csv.read(2, dynamics::Range{.low = 0, .high = 1000}, speed));
  EXPECT_EQ(count, 3);
  EXPECT_EQ(speed, std::nullopt);
  EXPECT_FALSE(csv.next());
  EXPECT_TRUE(csv.complete());
  EXPECT_TRUE(defects.empty());
}

TEST(CsvReader, NamesPlaceAndReasonOfEachDefect) {
  EXPECT_EQ(read("").defects,
            (Strings{"f.csv:1:1: the file is empty; a header with the names of the columns is expected"}));
  EXPECT_EQ(read("name,speed\na,1\n").defects, (Strings{"f.csv:1:1: missing column 'count'"}));
  EXPECT_EQ(read("count,colour\n").defects,
            (Strings{"f.csv:1:7: unknown column 'colour' (known: name, count, speed)"}));
  EXPECT_EQ(read("count,count\n").defects, (Strings{"f.csv:1:7: column 'count' appears twice"}));
  EXPECT_EQ(read("count,name\n1\n1,b,c\n").defects,
            (Strings{"f.csv:2:1: 1 field where the header has 2", "f.csv:3:1: 3 fields where the header has 2"}));
  EXPECT_EQ(read("count,name\n\n1,b\n").defects, (Strings{"f.csv:2:1: empty line"}));
  EXPECT_EQ(read("count,name\n1,a\"b\n2,c\n").defects, (Strings{"f.csv:2:4: quote inside an unquoted field"}));
  EXPECT_EQ(read("count,name\n1,\"a\"b\n2,c\n").defects, (Strings{"f.csv:2:6: text after a closing quote"}));
  EXPECT_EQ(read("count,name\n1,b\n2,\"c\n3,d\n").defects, (Strings{"f.csv:3:3: quote that is never closed"}));
  EXPECT_EQ(read("count,name\n1,b\r2,c\n").defects, (Strings{"f.csv:2:4: carriage return without a line feed"}));
  EXPECT_EQ(read(std::string_view("count,name\n1,\0\n", 14)).defects,
            (Strings{"f.csv:2:3: control character '\\x00'"}));
  EXPECT_EQ(
      read("count,speed\n,1\nx,2\n0,nan\n1,-2\n1,1e999\n1,0x1\n").defects,
      (Strings{"f.csv:2:1: count: is empty; a whole number is expected",
               "f.csv:3:1: count: 'x' is not a whole number in 1..99", "f.csv:4:1: count: 0 is outside 1..99",
               "f.csv:4:3: speed: 'nan' is not a finite number", "f.csv:5:3: speed: -2 is outside [0, 1000]",
               "f.csv:6:3: speed: '1e999' is not a finite number", "f.csv:7:3: speed: '0x1' is not a finite number"}));
}

// A spreadsheet runs a cell that begins with = + - @ or a tab; what our own files hold comes back as it was.
TEST(CsvReader, GetsBackWhatCsvFieldWrote) {
  for (const std::string text : {"=1+1", "+cmd", "-2+3", "@SUM(A1)", "\tx", "'=1", "''=1", "'plain", "50%", "a,b",
                                 "say \"no\"", "two\nlines", "-3.5", "+3e4", "-", "#1", "=a,\"b\"", ""}) {
    const std::string field = csv_field(text);
    EXPECT_EQ(read("name,count\n" + field + ",1\n").names, Strings{text}) << field;
    const std::string shown = field.starts_with('"') ? field.substr(1) : field;  // as a spreadsheet takes it
    if (shown.empty() || text == "-" || text == "-3.5" || text == "+3e4") continue;
    EXPECT_EQ(std::string("=+-@\t").find(shown.front()), std::string::npos) << field;
  }
  EXPECT_EQ(csv_field("-3.5"), "-3.5");
  EXPECT_EQ(csv_field("=1"), "'=1");
}

TEST(CsvReader, GoesOnAfterADefect) {
  const Reading reading = read("count,name\n1,a\"\n2,\"x\"y\n3,ok\n\n4,\"multi\nline\"z,\nx,last\n");
  EXPECT_EQ(reading.names, (Strings{"ok", "last"}));
  EXPECT_EQ(reading.defects.back(), "f.csv:8:1: count: 'x' is not a whole number in 1..99");
  EXPECT_EQ(reading.defects[1], "f.csv:3:6: text after a closing quote (in 2 rows)");
}

TEST(CsvReader, ShowsTwentyDefectsAndCountsTheRest) {
  std::string text = "count\n";
  for (int i = 0; i < 30; ++i) text += "x" + std::to_string(i) + "\n";
  const Strings lines = read(text).defects;
  ASSERT_EQ(lines.size(), Defects::most_shown + 1);
  EXPECT_EQ(lines.back(), "... and 10 more");
}

TEST(CsvReader, CountsTheRowsOfOneDefect) {
  EXPECT_EQ(read("count\nx\n1\nx\n0\nx\n0\n").defects,
            (Strings{"f.csv:2:1: count: 'x' is not a whole number in 1..99 (in 3 rows)",
                     "f.csv:5:1: count: 0 is outside 1..99 (in 2 rows)"}));
}

}  // namespace
}  // namespace metastable::analysis
