#pragma once
// Makes Ctrl-C and SIGTERM an exception, so that temporaries are removed and nothing is left half-written.

#include <stdexcept>
#include <string>

namespace metastable::reports {

/// The exception of check_interrupt(). The command line turns it into exit code 130 (SIGINT) or 143 (SIGTERM).
class Interrupted : public std::runtime_error {
 public:
  explicit Interrupted(int signal);
  /// The same interruption, with what became of the work: "interrupted: ...".
  Interrupted(const Interrupted& one, const std::string& more);
  int exit_code() const { return exit_code_; }

 private:
  int exit_code_;
};

/// From here on the first SIGINT or SIGTERM only sets a flag; a second one ends the program at once.
void catch_interrupts();

/// Long work calls this often, from any thread. @throws Interrupted once a signal has come
void check_interrupt();

/// Forgets a signal that has come.
void clear_interrupt();

}  // namespace metastable::reports
