#include "reports/output/output_file.h"

#include <fcntl.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <iostream>
#include <locale>
#include <string>
#include <system_error>
#include <thread>

#include "reports/output/interrupt.h"

namespace metastable::reports {
namespace fs = std::filesystem;
namespace {

std::string last_reason() { return errno != 0 ? std::strerror(errno) : "write error"; }

fs::path temporary_name(const fs::path& target) {
  static std::atomic<unsigned> count{0};
  return target.parent_path() /
         ("." + target.filename().string() + "." + std::to_string(::getpid()) + "-" + std::to_string(count++) + ".tmp");
}

// Removes temporaries of the same target whose writer was killed.
void remove_left_behind(const fs::path& target) {
  const std::string begin = "." + target.filename().string() + ".";
  std::error_code error;
  const fs::path folder = target.has_parent_path() ? target.parent_path() : fs::path(".");
  for (fs::directory_iterator entry(folder, error), last; !error && entry != last; entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    int writer = 0, number = 0, end = 0;
    if (!name.starts_with(begin) ||
        std::sscanf(name.c_str() + begin.size(), "%d-%d.tmp%n", &writer, &number, &end) != 2 ||
        begin.size() + static_cast<std::size_t>(end) != name.size() || writer <= 0)
      continue;
    std::error_code ignored;
    if (::kill(writer, 0) != 0 && errno == ESRCH) fs::remove_all(entry->path(), ignored);
  }
}

// A pipe is opened only once somebody reads it; until then Ctrl-C ends the program.
void wait_for_reader(const fs::path& pipe) {
  for (;;) {
    const int reader = ::open(pipe.c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC);
    if (reader >= 0) ::close(reader);
    if (reader >= 0 || errno != ENXIO) return;
    check_interrupt();
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

// Returns a path with links followed as far as they exist, without a slash at the end; empty if even that cannot be
// looked up.
fs::path resolved(const fs::path& path) {
  std::error_code error;
  const fs::path whole = fs::weakly_canonical(fs::absolute(path, error), error);
  if (error) return {};
  return whole.has_filename() ? whole : whole.parent_path();
}

}  // namespace

bool same_file(const fs::path& a, const fs::path& b) {
  std::error_code error;
  if (fs::equivalent(a, b, error)) return true;
  const fs::path one = resolved(a);
  return !one.empty() && one == resolved(b);
}

bool lies_in(const fs::path& file, const fs::path& folder) {
  const fs::path one = resolved(file), other = resolved(folder);
  const auto [end, rest] = std::mismatch(other.begin(), other.end(), one.begin(), one.end());
  return !other.empty() && end == other.end() && rest != one.end();
}

OutputError::OutputError(const fs::path& path, const std::string& reason)
    : std::invalid_argument("cannot write " + (path.empty() ? std::string("''") : path.string()) + ": " + reason) {}

OutputFile::OutputFile(const fs::path& path) : path_(path) {
  buffer_.imbue(std::locale::classic());
  if (path == "-") return;
  if (path.empty()) throw OutputError(path, "the name is empty");
  std::error_code error;
  const bool present = fs::exists(path, error);
  target_ = present ? fs::canonical(path, error) : path;
  if (error) throw OutputError(path, error.message());
  if (fs::is_directory(target_, error)) throw OutputError(path, std::strerror(EISDIR));
  const bool in_place = present && !fs::is_regular_file(target_, error);
  if (in_place) {
    if (fs::is_fifo(target_, error)) wait_for_reader(target_);
  } else {
    remove_left_behind(target_);
    temporary_ = temporary_name(target_);
  }
  errno = 0;
  file_.open(in_place ? target_ : temporary_, std::ios::binary);
  if (!file_) throw OutputError(path, last_reason());
}

OutputFile::~OutputFile() {
  if (temporary_.empty()) return;
  file_.close();
  std::error_code ignored;
  fs::remove(temporary_, ignored);
}

std::ostream& OutputFile::stream() { return buffer_; }

void OutputFile::commit() {
  errno = 0;
  if (target_.empty()) {
    if (!(std::cout << buffer_.view() << std::flush)) throw OutputError("standard output", last_reason());
    return;
  }
  const std::string_view content = buffer_.view();
  file_.write(content.data(), static_cast<std::streamsize>(content.size())).flush();
  if (!file_) throw OutputError(path_, last_reason());
  file_.close();
  if (!file_) throw OutputError(path_, last_reason());
  if (temporary_.empty()) return;
  std::error_code error;
  fs::rename(temporary_, target_, error);
  if (error) throw OutputError(path_, error.message());
  temporary_.clear();
}

OutputFolder::OutputFolder(const fs::path& target) : target_(target) {
  if (target.empty()) throw OutputError(target, "the name is empty");
  if (!target_.has_filename()) target_ = target_.parent_path();  // a slash at the end
  std::error_code error;
  if (fs::exists(target_, error) && !fs::is_directory(target_, error))
    throw OutputError(target, std::strerror(ENOTDIR));
  if (fs::is_symlink(target_, error)) {
    target_ = fs::canonical(target_, error);
    if (error) throw OutputError(target, error.message());
  }
  if (target_.has_parent_path()) make_folder(target_.parent_path());
  remove_left_behind(target_);
  fs::path temporary = temporary_name(target_);
  if (!fs::create_directory(temporary, error) && fs::is_directory(target_)) {
    // Only the target itself may be writable (a mounted folder).
    remove_left_behind(target_ / target_.filename());
    temporary = target_ / temporary.filename();
    fs::create_directory(temporary, error);
  }
  if (error) throw OutputError(target, error.message());
  temporary_ = temporary;
}

OutputFolder::~OutputFolder() {
  std::error_code ignored;
  if (!temporary_.empty()) fs::remove_all(temporary_, ignored);
}

void OutputFolder::commit(const fs::path& last) {
  std::error_code error;
  fs::rename(temporary_, target_, error);  // no target, or an empty one
  if (!error) {
    temporary_.clear();
    return;
  }
  std::vector<fs::path> files;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(temporary_))
    if (!entry.is_directory()) files.push_back(fs::relative(entry.path(), temporary_));
  std::ranges::stable_partition(files, [&](const fs::path& file) { return file != last; });
  for (const fs::path& file : files) {
    make_folder((target_ / file).parent_path());
    fs::rename(temporary_ / file, target_ / file, error);
    if (error) throw OutputError(target_ / file, error.message());
  }
  fs::remove_all(temporary_, error);
  temporary_.clear();
}

FolderIfFilled::FolderIfFilled(const fs::path& folder) : path_(folder) {
  std::error_code error;
  for (fs::path one = folder; !one.empty() && !fs::exists(one, error); one = one.parent_path()) made_.push_back(one);
  make_folder(folder);
}

FolderIfFilled::~FolderIfFilled() {
  std::error_code error;
  for (const fs::path& one : made_)
    if (!fs::remove(one, error)) return;  // it holds something
}

void write_file(const fs::path& path, std::string_view content) {
  OutputFile file(path);
  file.stream().write(content.data(), static_cast<std::streamsize>(content.size()));
  file.commit();
}

void make_folder(const fs::path& path) {
  std::error_code error;
  fs::create_directories(path, error);
  if (!error && !fs::is_directory(path, error) && !error) error = std::make_error_code(std::errc::not_a_directory);
  if (error) throw OutputError(path, error.message());
}

}  // namespace metastable::reports
