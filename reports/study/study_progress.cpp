#include "reports/study/study_progress.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <memory>

namespace metastable::reports {

std::function<void(double, const std::string&)> study_progress(Progress& progress) {
  auto done = std::make_shared<std::atomic<std::size_t>>(0);
  return [&progress, done](double share, const std::string&) {
    const auto now = static_cast<std::size_t>(std::clamp(share, 0.0, 1.0) * static_cast<double>(study_units));
    std::size_t before = *done;
    while (before < now && !done->compare_exchange_weak(before, now)) {
    }
    progress.advance(now > before ? now - before : 0);
  };
}

TimeLimitReached::TimeLimitReached(double seconds, double share, const std::string& what)
    : std::runtime_error(
          fmt::format("the time limit of {:.6g} s is reached at {:.0f} % of '{}', and there is no number "
                      "yet: raise the limit, or ask for less (a larger tolerance)",
                      seconds, 100 * std::clamp(share, 0.0, 1.0), what)),
      seconds_(seconds) {}

BeginPart within(double seconds, const BeginPart& begin) {
  const auto began = std::chrono::steady_clock::now();
  return [=](const std::string& name) -> Tell {
    auto furthest = std::make_shared<std::atomic<double>>(0);
    return [=, tell = begin(name)](double share, const std::string& what) {
      if (tell) tell(share, what);
      double before = *furthest;
      while (before < share && !furthest->compare_exchange_weak(before, share)) {
      }
      if (std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count() > seconds)
        throw TimeLimitReached(seconds, *furthest, name);
    };
  };
}

BeginPart ProgressParts::begin() {
  return [this](const std::string& name) {
    line_.reset();
    return study_progress(line_.emplace(name, study_units));
  };
}

}  // namespace metastable::reports
