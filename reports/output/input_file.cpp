#include "reports/output/input_file.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <stdexcept>
#include <system_error>

#include "reports/output/interrupt.h"

namespace metastable::reports {
namespace {

struct Descriptor {
  int number;
  ~Descriptor() {
    if (number >= 0) ::close(number);
  }
};

}  // namespace

std::string read_file(const std::filesystem::path& path) {
  const auto refuse = [&](const std::string& why) {
    throw std::invalid_argument(path.string() + ": cannot be read" + why);
  };
  // It is opened without blocking: while nobody writes into a pipe, Ctrl-C ends the program.
  const Descriptor file{::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC)};
  struct stat status {};
  if (file.number < 0 || ::fstat(file.number, &status) != 0) refuse(": " + std::system_category().message(errno));
  if (S_ISDIR(status.st_mode)) refuse(": it is a folder");
  if (!S_ISREG(status.st_mode) && !S_ISFIFO(status.st_mode)) refuse(": it is neither a file nor a pipe");
  std::string text;
  char buffer[65536];
  for (;;) {
    pollfd waiting{file.number, POLLIN, 0};
    const int ready = ::poll(&waiting, 1, 50);
    if (ready <= 0 || S_ISFIFO(status.st_mode)) check_interrupt();
    if (ready <= 0) continue;
    const ssize_t count = ::read(file.number, buffer, sizeof buffer);
    if (count > 0) text.append(buffer, static_cast<std::size_t>(count));
    if (count == 0) return text;
    if (count < 0 && errno != EAGAIN && errno != EINTR) refuse(": " + std::system_category().message(errno));
  }
}

}  // namespace metastable::reports
