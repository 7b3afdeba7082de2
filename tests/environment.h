#pragma once
// Reads whole numbers from the environment, by which long runs of a test are asked for.

#include <cstdint>
#include <cstdlib>

namespace metastable {

/// @return `otherwise` where there is no such variable
inline std::uint64_t from_environment(const char* name, std::uint64_t otherwise) {
  const char* text = std::getenv(name);
  return text == nullptr ? otherwise : std::strtoull(text, nullptr, 10);
}

}  // namespace metastable
