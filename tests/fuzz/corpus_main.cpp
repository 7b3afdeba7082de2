// Runs every file of a folder through the fuzz target's function. Files named good-* must be experiments without
// defects, files named bad-* must have some; other names only have to be survived.

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "tests/fuzz/experiment_input.h"

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "fuzz_corpus: one folder is expected\n");
    return 2;
  }
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(argv[1]))
    if (entry.is_regular_file()) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  int wrong = 0;
  for (const std::filesystem::path& file : files) {
    std::ifstream in(file, std::ios::binary);
    const std::string text(std::istreambuf_iterator<char>(in), {});
    std::printf("%s\n", file.filename().c_str());
    std::fflush(stdout);
    const bool good =
        metastable::fuzz::read_experiment_input(reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
    const std::string name = file.filename().string();
    if ((name.starts_with("good-") && !good) || (name.starts_with("bad-") && good)) {
      std::printf("  was %s\n", good ? "read without a defect" : "refused");
      ++wrong;
    }
  }
  std::printf("%zu files, %d of them wrong\n", files.size(), wrong);
  return files.empty() || wrong > 0 ? 1 : 0;
}
