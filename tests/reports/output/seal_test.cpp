#include "reports/output/seal.h"

#include <gtest/gtest.h>

#include <string>

#include "tests/message_of.h"

namespace metastable::reports::test {
namespace {

// These are FIPS 180-4's examples.
TEST(Seal, Sha256OfKnownTexts) {
  EXPECT_EQ(sha256(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(sha256("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

std::string message(const std::string& text) {
  return message_of([&text] { read_record("record.csv", text); });
}

const std::string accepted = "nothing was thrown";

TEST(Seal, RecordShowsEveryChange) {
  const RecordedAnswer a = record_answer("", 7, "2026-01-01T00:00:00Z", "first");
  const RecordedAnswer b = record_answer(a.chain, 3, "2026-01-01T00:00:05Z", "second");
  const std::string text = record_line(a) + record_line(b);
  const auto record = read_record("record.csv", text);
  ASSERT_EQ(record.size(), 2U);
  EXPECT_EQ(record[1].number, 3);
  EXPECT_EQ(record[1].digest, sha256("second"));
  EXPECT_EQ(message(""), accepted);
  // Entries are left out, swapped, renumbered, dated back, answered twice.
  EXPECT_EQ(message(record_line(b)), "record.csv:1: the record was changed: its chain of digests is broken here");
  EXPECT_NE(message(record_line(b) + record_line(a)), accepted);
  std::string renumbered = text;
  renumbered[0] = '8';
  EXPECT_NE(message(renumbered), accepted);
  const RecordedAnswer early = record_answer(a.chain, 3, "2025-01-01T00:00:00Z", "second");
  EXPECT_EQ(message(record_line(a) + record_line(early)), "record.csv:2: the record's times fall here");
  const RecordedAnswer again = record_answer(a.chain, 7, "2026-01-01T00:00:05Z", "second");
  EXPECT_EQ(message(record_line(a) + record_line(again)), "record.csv:2: case 7 was answered before");
  EXPECT_EQ(message("nonsense\n"), "record.csv:1: this is no entry of the record");
}

}  // namespace
}  // namespace metastable::reports::test
