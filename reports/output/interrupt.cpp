#include "reports/output/interrupt.h"

#include <signal.h>

#include <atomic>

namespace metastable::reports {
namespace {

std::atomic<int> received_signal{0};
static_assert(std::atomic<int>::is_always_lock_free, "set from a signal handler");

extern "C" void remember_signal(int signal) { received_signal = signal; }

}  // namespace

Interrupted::Interrupted(int signal)
    : std::runtime_error(signal == SIGTERM ? "terminated" : "interrupted"), exit_code_(128 + signal) {}

Interrupted::Interrupted(const Interrupted& one, const std::string& more)
    : std::runtime_error(one.what() + (": " + more)), exit_code_(one.exit_code()) {}

void catch_interrupts() {
  struct sigaction action {};
  action.sa_handler = remember_signal;
  action.sa_flags = static_cast<int>(SA_RESETHAND | SA_RESTART);
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

void check_interrupt() {
  if (const int signal = received_signal) throw Interrupted(signal);
}

void clear_interrupt() { received_signal = 0; }

}  // namespace metastable::reports
