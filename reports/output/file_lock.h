#pragma once
// Locks a file that one process at a time may write.

#include <filesystem>

namespace metastable::reports {

/// Holds a file's lock (flock) from construction to the end of the object or of the process, however that ends.
class FileLock {
 public:
  enum class Missing { create, leave };

  FileLock() = default;  ///< holds nothing
  /// Locks the file of this name at once or not at all; a missing one is created or left. Where the file system knows
  /// no locks everybody gets them. @throws OutputError if the file cannot be opened
  FileLock(const std::filesystem::path& path, Missing missing);
  FileLock(FileLock&& other) noexcept;
  FileLock& operator=(FileLock&& other) noexcept;
  ~FileLock();

  bool held() const { return descriptor_ >= 0; }

 private:
  int descriptor_ = -1;
};

}  // namespace metastable::reports
