#pragma once
// Shows a progress line for long work.

#include <chrono>
#include <cstddef>
#include <iosfwd>
#include <mutex>
#include <string>

namespace metastable::reports {

/// Returns true if standard error is a terminal.
bool stderr_is_terminal();

/// Shows "label  37 % (37 of 100), about 12 s left" on one line of a terminal, redrawn at most ten times a second and
/// wiped at the end. Of the time left it says nothing while the work has stood still for a tenth of the time: what
/// takes longer than was foreseen takes no one knows how long. Writes nothing where there is no terminal. advance() may
/// be called from any thread.
class Progress {
 public:
  /// Writes on standard error. @param total units of work, >= 1
  Progress(std::string label, std::size_t total);
  /// Writes on any stream. @param visible false: write nothing
  Progress(std::string label, std::size_t total, std::ostream& out, bool visible);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// `units` more are done; 0 draws the line anew. @throws Interrupted (see interrupt.h)
  void advance(std::size_t units = 1);
  /// `units` were done before this work began: they count as done, but not for how long the rest takes. Draws the line
  /// at once. @throws Interrupted
  void skip(std::size_t units);

 private:
  using Clock = std::chrono::steady_clock;
  void draw(Clock::time_point now);

  std::mutex mutex_;
  std::string label_;
  std::size_t total_;
  std::size_t done_ = 0;
  std::size_t skipped_ = 0;
  std::ostream& out_;
  bool visible_;
  Clock::time_point start_ = Clock::now();
  Clock::time_point last_draw_{};
  Clock::time_point moved_ = start_;
};

}  // namespace metastable::reports
