#pragma once
// Finds expected steps over a grid of settings.

#include <cstddef>
#include <exception>
#include <functional>
#include <vector>

#include "analysis/sensitivity/parameter.h"
#include "analysis/study/metastability.h"
#include "analysis/study/setting.h"

namespace metastable::analysis {

struct SweepAxis {
  Parameter parameter = Parameter::slope;
  std::vector<double> values;  ///< ascending, not empty
};

/// A range takes the values first, first + step, ..., up to last (with a rounding allowance of a thousandth of a step).
/// @throws std::invalid_argument for step <= 0, last < first or more than 100000 values
std::vector<double> axis_values(double first, double last, double step);

/// Holds what a sweep says of one point.
struct SweepPoint {
  std::vector<double> at;           ///< one value per axis
  Metastability study;              ///< with its setting
  std::exception_ptr failure = {};  ///< set when a solver did not converge here (study.status is then solver_failed)
};

/// Returns the number of points of the product of the axes. @throws std::invalid_argument if they are more than 1000000
std::size_t sweep_size(const std::vector<SweepAxis>& axes);

/// Returns the setting of point `index` (last axis fastest) and its coordinates.
/// A launch that depends on the slope comes from `base`: sweeps keep base.initial_speed.
Setting sweep_setting(const Setting& base, const std::vector<SweepAxis>& axes, std::size_t index,
                      std::vector<double>* at = nullptr);

/// Returns Setting::describe() with the word "varies" in place of what the axes vary.
std::string sweep_description(const Setting& base, const std::vector<SweepAxis>& axes);

/// Studies one point in brief (StudyOptions::brief), single-threaded. A solver that does not converge is no error here.
SweepPoint sweep_point(const Setting& base, const std::vector<SweepAxis>& axes, std::size_t index,
                       const StudyOptions& options);

/// Studies points begin .. end-1 in brief (StudyOptions::brief), calling done(index, point) for each in this order, one
/// call at a time (from whichever thread finished it); done may throw to stop. A point whose solver does not converge
/// has the status solver_failed and its message, and no numbers. Points run side by side on the options' threads, each
/// single-threaded: the numbers do not depend on that. options.progress is called within the points, always with 0; it
/// may throw to stop.
void sweep(const Setting& base, const std::vector<SweepAxis>& axes, std::size_t begin, const StudyOptions& options,
           const std::function<void(std::size_t, const SweepPoint&)>& done);

}  // namespace metastable::analysis
