#include "reports/output/file_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "reports/output/output_file.h"

namespace metastable::reports {

FileLock::FileLock(const std::filesystem::path& path, Missing missing) {
  for (;;) {
    const int file = ::open(path.c_str(), O_RDWR | O_CLOEXEC | (missing == Missing::create ? O_CREAT : 0), 0666);
    if (file < 0) {
      if (missing == Missing::leave && errno == ENOENT) return;
      throw OutputError(path, std::strerror(errno));
    }
    struct stat locked {
    }, named{};
    if (::flock(file, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
      ::close(file);
      return;
    }
    // Whoever held it before may have renamed or removed it.
    if (::fstat(file, &locked) == 0 && ::stat(path.c_str(), &named) == 0 && locked.st_ino == named.st_ino &&
        locked.st_dev == named.st_dev) {
      descriptor_ = file;
      return;
    }
    ::close(file);
  }
}

FileLock::FileLock(FileLock&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}

FileLock& FileLock::operator=(FileLock&& other) noexcept {
  std::swap(descriptor_, other.descriptor_);
  return *this;
}

FileLock::~FileLock() {
  if (held()) ::close(descriptor_);
}

}  // namespace metastable::reports
