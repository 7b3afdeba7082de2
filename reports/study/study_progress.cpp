#include "reports/study/study_progress.h"

#include <algorithm>
#include <memory>

namespace metastable::reports {

std::function<void(double, const std::string&)> study_progress(Progress& progress) {
  auto done = std::make_shared<std::size_t>(0);
  return [&progress, done](double share, const std::string&) {
    const auto now = static_cast<std::size_t>(std::clamp(share, 0.0, 1.0) * static_cast<double>(study_units));
    progress.advance(now > *done ? now - *done : 0);
    *done = std::max(*done, now);
  };
}

BeginPart ProgressParts::begin() {
  return [this](const std::string& name) {
    line_.reset();
    return study_progress(line_.emplace(name, study_units));
  };
}

}  // namespace metastable::reports
