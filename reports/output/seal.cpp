#include "reports/output/seal.h"

#include <fmt/format.h>
#include <openssl/evp.h>

#include <array>
#include <charconv>
#include <set>
#include <sstream>
#include <stdexcept>

namespace metastable::reports {

std::string sha256(std::string_view text) {
  std::array<unsigned char, 32> digest{};
  std::size_t size = digest.size();
  if (EVP_Q_digest(nullptr, "SHA256", nullptr, text.data(), text.size(), digest.data(), &size) != 1)
    throw std::runtime_error("SHA-256: libcrypto failed");
  std::string hex;
  for (const unsigned char byte : digest) hex += fmt::format("{:02x}", byte);
  return hex;
}

RecordedAnswer record_answer(const std::string& previous, int number, const std::string& time,
                             std::string_view answer) {
  RecordedAnswer entry{number, time, sha256(answer), {}};
  entry.chain = sha256(fmt::format("{},{},{},{}", previous, number, time, entry.digest));
  return entry;
}

std::string record_line(const RecordedAnswer& entry) {
  return fmt::format("{},{},{},{}\n", entry.number, entry.time, entry.digest, entry.chain);
}

std::vector<RecordedAnswer> read_record(const std::string& file, std::string_view text) {
  std::vector<RecordedAnswer> record;
  std::set<int> answered;
  std::istringstream lines{std::string(text)};
  int number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    const auto refuse = [&](const std::string& what) {
      throw std::invalid_argument(fmt::format("{}:{}: {}", file, number, what));
    };
    RecordedAnswer entry;
    std::istringstream fields(line);
    std::string first;
    std::getline(fields, first, ',');
    std::getline(fields, entry.time, ',');
    std::getline(fields, entry.digest, ',');
    std::getline(fields, entry.chain);
    const auto [end, error] = std::from_chars(first.data(), first.data() + first.size(), entry.number);
    if (error != std::errc{} || end != first.data() + first.size() || entry.chain.size() != 64)
      refuse("this is no entry of the record");
    const std::string previous = record.empty() ? "" : record.back().chain;
    if (entry.chain != sha256(fmt::format("{},{},{},{}", previous, entry.number, entry.time, entry.digest)))
      refuse("the record was changed: its chain of digests is broken here");
    if (!record.empty() && entry.time < record.back().time) refuse("the record's times fall here");
    if (!answered.insert(entry.number).second) refuse(fmt::format("case {} was answered before", entry.number));
    record.push_back(entry);
  }
  return record;
}

}  // namespace metastable::reports
