#pragma once
// Holds what several tests of reports/ share.

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "tests/own_folder.h"

namespace metastable::reports::test {

/// Returns the whole of a file; empty if it cannot be read.
inline std::string read(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

inline void write(const std::filesystem::path& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

/// Returns what f prints on standard output. What it throws is passed on.
template <class F>
std::string printed(F f) {
  testing::internal::CaptureStdout();
  try {
    f();
  } catch (...) {
    testing::internal::GetCapturedStdout();
    throw;
  }
  return testing::internal::GetCapturedStdout();
}

/// A test with an empty folder of its own, which goes with it.
class InFolder : public testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  /// Writes a file into the folder; returns its path.
  std::string file(const std::string& name, const std::string& text) const {
    write(folder_ / name, text);
    return path(name);
  }

  const std::filesystem::path folder_ = metastable::test::own_folder();
};

}  // namespace metastable::reports::test
