#pragma once
// Shows a study's progress callback on a progress line.

#include <functional>
#include <optional>
#include <stdexcept>
#include <string>

#include "reports/output/progress.h"

namespace metastable::reports {

/// Counts the units to give Progress for one study.
inline constexpr std::size_t study_units = 1000;

/// Returns a callback for analysis::StudyOptions::progress that moves `progress` by up to study_units over the study.
/// The callback refers to `progress` and may be called from any thread; it throws Interrupted after Ctrl-C.
std::function<void(double, const std::string&)> study_progress(Progress& progress);

/// A listener that is told the share of the work done and what is being done; it may throw to stop. As
/// analysis::StudyOptions::progress.
using Tell = std::function<void(double, const std::string&)>;
/// Begins to show a part of the work under this name, and ends with the part before it.
using BeginPart = std::function<Tell(const std::string& name)>;

/// The exception of work that takes longer than it may.
class TimeLimitReached : public std::runtime_error {
 public:
  TimeLimitReached(double seconds, double share, const std::string& what);
  double seconds() const { return seconds_; }  ///< the limit

 private:
  double seconds_;
};

constexpr double usual_time_limit = 900;  ///< of one question [s]: as long as someone waits at a terminal

/// Lets parts begin that end once this much wall clock has passed from now on, whichever of them runs then. The limit
/// ends work and changes no number. @param seconds > 0
/// @throws TimeLimitReached from the listeners of the parts, saying how far the work was
BeginPart within(double seconds, const BeginPart& begin);

/// Shows the parts of a command on one progress line after another, of study_units each.
class ProgressParts {
 public:
  BeginPart begin();

 private:
  std::optional<Progress> line_;
};

}  // namespace metastable::reports
