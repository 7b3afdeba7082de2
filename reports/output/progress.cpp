#include "reports/output/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <iostream>

#include "reports/output/interrupt.h"

namespace metastable::reports {
namespace {

constexpr const char* wipe_line = "\r\033[K";

std::string remaining(double seconds) {
  if (seconds < 90) return fmt::format("{:.0f} s", seconds);
  if (seconds < 5400) return fmt::format("{:.0f} min", seconds / 60);
  return fmt::format("{:.1f} h", seconds / 3600);
}

}  // namespace

bool stderr_is_terminal() { return ::isatty(STDERR_FILENO) == 1; }

Progress::Progress(std::string label, std::size_t total)
    : Progress(std::move(label), total, std::cerr, stderr_is_terminal()) {}

Progress::Progress(std::string label, std::size_t total, std::ostream& out, bool visible)
    : label_(std::move(label)), total_(std::max<std::size_t>(total, 1)), out_(out), visible_(visible) {}

Progress::~Progress() {
  if (visible_) out_ << wipe_line << std::flush;
}

void Progress::advance(std::size_t units) {
  check_interrupt();
  if (!visible_) return;
  const std::lock_guard lock(mutex_);
  done_ = std::min(done_ + units, total_);
  const auto now = Clock::now();
  if (units > 0) moved_ = now;
  if (now - last_draw_ >= std::chrono::milliseconds(100)) draw(now);
}

void Progress::skip(std::size_t units) {
  check_interrupt();
  if (!visible_) return;
  const std::lock_guard lock(mutex_);
  done_ = std::min(done_ + units, total_);
  skipped_ = std::min(skipped_ + units, total_);
  draw(Clock::now());
}

void Progress::draw(Clock::time_point now) {
  last_draw_ = now;
  const double share = static_cast<double>(done_) / static_cast<double>(total_);
  const double elapsed = std::chrono::duration<double>(now - start_).count();
  out_ << wipe_line << fmt::format("{}  {:.0f} % ({} of {})", label_, 100 * share, done_, total_);
  const double still = std::chrono::duration<double>(now - moved_).count();
  if (elapsed > 2 && done_ > skipped_ && done_ < total_ && still <= std::max(2.0, elapsed / 10))
    out_ << ", about "
         << remaining(elapsed * static_cast<double>(total_ - done_) / static_cast<double>(done_ - skipped_)) << " left";
  out_ << std::flush;
}

}  // namespace metastable::reports
