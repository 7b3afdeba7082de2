#include "reports/import/child_process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <exception>
#include <stdexcept>
#include <system_error>

#include "reports/output/interrupt.h"

namespace metastable::reports {
namespace {

constexpr rlim_t most_seconds = 120;
#ifndef __SANITIZE_ADDRESS__  // which keeps addresses for itself
constexpr rlim_t more_memory = rlim_t{4} << 30;

rlim_t memory_now() {
  unsigned long pages = 0;
  if (std::FILE* const statm = std::fopen("/proc/self/statm", "r")) {
    if (std::fscanf(statm, "%lu", &pages) != 1) pages = 0;
    std::fclose(statm);
  }
  return static_cast<rlim_t>(pages) * static_cast<rlim_t>(::sysconf(_SC_PAGESIZE));
}
#endif

void write_all(int to, const char* text, std::size_t size) {
  while (size > 0) {
    const ssize_t written = ::write(to, text, size);
    if (written < 0 && errno != EINTR) return;
    if (written > 0) text += written, size -= static_cast<std::size_t>(written);
  }
}

[[noreturn]] void run_child(const std::function<std::string()>& work, int answer) {
  for (const int signal : {SIGINT, SIGTERM, SIGPIPE}) ::signal(signal, SIG_DFL);
  const rlimit no_core{0, 0}, seconds{most_seconds, most_seconds};
  ::setrlimit(RLIMIT_CORE, &no_core);
  ::setrlimit(RLIMIT_CPU, &seconds);
#ifndef __SANITIZE_ADDRESS__
  const rlim_t most = memory_now() + more_memory;
  const rlimit memory{most, most};
  ::setrlimit(RLIMIT_AS, &memory);
#endif
  if (const int nowhere = ::open("/dev/null", O_WRONLY); nowhere >= 0) ::dup2(nowhere, 1), ::dup2(nowhere, 2);
  std::string said;
  try {
    said = 'R' + work();
  } catch (const std::exception& error) {
    said = std::string("E") + error.what();
  }
  write_all(answer, said.data(), said.size());
  ::_exit(0);
}

// Reads all that the child says, and waits for its end.
std::string read_child(int from, pid_t child, int& status) {
  std::string said;
  std::array<char, 1 << 16> buffer;
  for (;;) {
    const ssize_t count = ::read(from, buffer.data(), buffer.size());
    if (count > 0) said.append(buffer.data(), static_cast<std::size_t>(count));
    if (count == 0) break;
    if (count > 0 || errno == EINTR) {
      try {
        check_interrupt();
      } catch (...) {
        ::kill(child, SIGKILL);
        ::waitpid(child, &status, 0);
        ::close(from);
        throw;
      }
    } else {
      break;
    }
  }
  ::close(from);
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return said;
}

}  // namespace

std::string in_child_process(const std::function<std::string()>& work, const std::string& died) {
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) throw std::system_error(errno, std::generic_category(), "pipe");
  std::fflush(nullptr);
  const pid_t child = ::fork();
  if (child < 0) {
    ::close(ends[0]), ::close(ends[1]);
    throw std::system_error(errno, std::generic_category(), "fork");
  }
  if (child == 0) {
    ::close(ends[0]);
    run_child(work, ends[1]);
  }
  ::close(ends[1]);
  int status = 0;
  const std::string said = read_child(ends[0], child, status);
  if (WIFSIGNALED(status)) throw std::invalid_argument(fmt::format("{} ({})", died, ::strsignal(WTERMSIG(status))));
  if (WEXITSTATUS(status) != 0 || said.empty())
    throw std::invalid_argument(fmt::format("{} (code {})", died, WEXITSTATUS(status)));
  if (said.front() == 'E') throw std::invalid_argument(said.substr(1));
  return said.substr(1);
}

}  // namespace metastable::reports
