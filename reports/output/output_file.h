#pragma once
// Writes output files that are either whole or not there.

#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string_view>
#include <vector>

namespace metastable::reports {

/// Says that an output cannot be written; the message names the path and the reason. It is a user error: exit code 2.
class OutputError : public std::invalid_argument {
 public:
  OutputError(const std::filesystem::path& path, const std::string& reason);
};

/// A file is written under a temporary name beside its target and renamed on commit(). Without commit() the target is
/// left as it was and the temporary is removed. "-" is standard output, written on commit(). A target that is no
/// regular file (a pipe, /dev/null) is written directly; a symbolic link is followed.
class OutputFile {
 public:
  /// @throws OutputError if the folder does not exist or cannot be written to: at once, before any long computation.
  explicit OutputFile(const std::filesystem::path& path);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  /// Returns where to write. Formatting is independent of the locale.
  std::ostream& stream();
  /// @throws OutputError if anything could not be written. Call once; the stream is closed afterwards.
  void commit();

 private:
  std::filesystem::path path_;
  std::filesystem::path target_;     // path_ with symbolic links resolved; empty: standard output
  std::filesystem::path temporary_;  // empty: nothing to rename or remove
  std::ofstream file_;
  std::ostringstream buffer_;  // until commit
};

/// A folder is filled under a temporary name beside its target and takes its place on commit(); without commit()
/// nothing is left. What killed writers left of the same target is removed.
class OutputFolder {
 public:
  /// @throws OutputError if nothing can be written there: at once, before any long computation.
  explicit OutputFolder(const std::filesystem::path& target);
  ~OutputFolder();
  OutputFolder(const OutputFolder&) = delete;
  OutputFolder& operator=(const OutputFolder&) = delete;

  const std::filesystem::path& path() const { return temporary_; }  ///< where to write
  /// A target that holds files keeps them and gets these, also those in folders, beside them, each whole, `last` as the
  /// last one.
  /// @throws OutputError if it cannot. Call once.
  void commit(const std::filesystem::path& last);

 private:
  std::filesystem::path target_, temporary_;
};

/// A folder made before the work, with its parents, so that a place that cannot be written to is refused at once;
/// what was made of them is gone again where the work puts nothing into it.
class FolderIfFilled {
 public:
  /// @throws OutputError
  explicit FolderIfFilled(const std::filesystem::path& folder);
  ~FolderIfFilled();
  FolderIfFilled(const FolderIfFilled&) = delete;
  FolderIfFilled& operator=(const FolderIfFilled&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
  std::vector<std::filesystem::path> made_;  // the innermost first
};

/// Writes the whole of `content` into `path` ("-": standard output), or nothing. @throws OutputError
void write_file(const std::filesystem::path& path, std::string_view content);

/// Returns whether both name one file, which need not be there yet.
bool same_file(const std::filesystem::path& a, const std::filesystem::path& b);
/// Returns whether a file, there or not, lies below a folder.
bool lies_in(const std::filesystem::path& file, const std::filesystem::path& folder);

/// Creates a folder and its parents where they are missing. @throws OutputError
void make_folder(const std::filesystem::path& path);

}  // namespace metastable::reports
