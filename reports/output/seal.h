#pragma once
// Makes seals of blind cases and digests of their answers: SHA-256 by OpenSSL's libcrypto, which stays in the .cpp.

#include <string>
#include <string_view>
#include <vector>

namespace metastable::reports {

/// Returns the SHA-256 of the text as 64 hexadecimal digits. @throws std::runtime_error if the library fails
std::string sha256(std::string_view text);

/// One answer in the record: which case, when, the digest of its file, and a digest of all of it with the record
/// before.
struct RecordedAnswer {
  int number = 0;
  std::string time;    ///< UTC, 2026-01-31T12:00:00Z
  std::string digest;  ///< of the answer's text
  std::string chain;
};

/// Makes the entry that follows `previous` (the chain of the one before; "" for the first).
RecordedAnswer record_answer(const std::string& previous, int number, const std::string& time, std::string_view answer);

/// Write one line of the record, and read it from its lines. @throws std::invalid_argument naming `file` and
/// the line for text that is no entry, times that fall, a case that was answered before, and an entry that its chain
/// does not fit
std::string record_line(const RecordedAnswer& entry);
std::vector<RecordedAnswer> read_record(const std::string& file, std::string_view text);

}  // namespace metastable::reports
