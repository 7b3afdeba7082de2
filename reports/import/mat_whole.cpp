#include "reports/import/mat_whole.h"

#include <fmt/format.h>
#include <zlib.h>

#include <array>
#include <cstdint>
#include <new>
#include <stdexcept>

namespace metastable::reports {
namespace {

// Layout of version 5: a header, then variables, each behind its kind and its size in bytes ("MAT-File Format", The
// MathWorks, ch. 1).
constexpr std::size_t header_size = 128, tag_size = 8, endian_at = 126;
constexpr std::uint32_t compressed = 15;

std::uint32_t word_at(std::string_view text, std::size_t at, bool big_endian) {
  std::uint32_t word = 0;
  for (std::size_t i = 0; i < 4; ++i)
    word |= static_cast<std::uint32_t>(static_cast<unsigned char>(text[at + i])) << 8 * (big_endian ? 3 - i : i);
  return word;
}

// Returns whether it decompresses to its end, where the checksum is.
bool decompresses(std::string_view text) {
  z_stream stream{};
  if (inflateInit(&stream) != Z_OK) throw std::bad_alloc();
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
  stream.avail_in = static_cast<uInt>(text.size());
  std::array<Bytef, 1 << 16> dropped;
  int state = Z_OK;
  while (state == Z_OK) {
    stream.next_out = dropped.data();
    stream.avail_out = dropped.size();
    state = inflate(&stream, Z_NO_FLUSH);
  }
  inflateEnd(&stream);
  return state == Z_STREAM_END;
}

}  // namespace

void check_mat_whole(const std::string& file, std::string_view text) {
  if (!text.starts_with("MATLAB 5.0 MAT-file")) return;
  const auto cut = [&](std::size_t at, std::size_t end) {
    throw std::invalid_argument(
        fmt::format("{}: is cut short: what begins at byte {} ends at byte {} at least, and the file at byte {}", file,
                    at, end, text.size()));
  };
  if (text.size() < header_size) cut(0, header_size);
  const bool big_endian = text.substr(endian_at, 2) == "MI";
  for (std::size_t at = header_size; at < text.size();) {
    const std::size_t body = at + tag_size;
    if (body > text.size()) cut(at, body);
    const std::size_t size = word_at(text, at + 4, big_endian);
    if (body + size > text.size()) cut(at, body + size);
    if (word_at(text, at, big_endian) == compressed && !decompresses(text.substr(body, size)))
      throw std::invalid_argument(fmt::format(
          "{}: is damaged: its variable at byte {} does not decompress to what its checksum says", file, at));
    at = body + size;
  }
}

}  // namespace metastable::reports
