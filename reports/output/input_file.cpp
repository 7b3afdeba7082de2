#include "reports/output/input_file.h"

#include <fstream>
#include <iterator>
#include <stdexcept>

namespace metastable::reports {

std::string read_file(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  // A folder can be opened but not read.
  if (!file || std::filesystem::is_directory(path)) throw std::invalid_argument(path.string() + ": cannot be read");
  return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace metastable::reports
