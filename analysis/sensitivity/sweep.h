#pragma once
// Finds expected steps over a grid of settings.

#include <cstddef>
#include <exception>
#include <functional>
#include <optional>
#include <vector>

#include "analysis/sensitivity/parameter.h"
#include "analysis/sensitivity/rigid_body_check.h"
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
  std::vector<double> at;  ///< one value per axis
  Metastability study;     ///< with its setting
  /// Set when a solver did not converge here, or there is no regime to launch from (study.status tells which).
  std::exception_ptr failure = {};
  std::optional<RigidBodyCheck> rigid_bodies = {};  ///< where wheels were rolled
};

/// Says whether wheels are rolled under `settled` beside a sweep.
enum class RigidBodies { left_out, asked };

/// Returns the number of points of the product of the axes. @throws std::invalid_argument if they are more than 1000000
std::size_t sweep_size(const std::vector<SweepAxis>& axes);

/// Returns the setting of point `index` (last axis fastest) and its coordinates.
/// Sweeps keep the launch of `base`: initial_speed, or that every point is launched from its own regime.
Setting sweep_setting(const Setting& base, const std::vector<SweepAxis>& axes, std::size_t index,
                      std::vector<double>* at = nullptr);

/// Returns Setting::describe() with the word "varies" in place of what the axes vary.
std::string sweep_description(const Setting& base, const std::vector<SweepAxis>& axes);

/// Says at which points of a sweep wheels are rolled: the ends of every axis and what lies evenly between, 16 points in
/// all of up to four axes.
bool rolled_at(const std::vector<SweepAxis>& axes, std::size_t index);

/// Studies one point in brief (StudyOptions::brief), single-threaded. A solver that does not converge is no error here.
/// Rolled wheels share 65536 collisions with the other points, at least 1024 each.
SweepPoint sweep_point(const Setting& base, const std::vector<SweepAxis>& axes, std::size_t index,
                       const StudyOptions& options, RigidBodies rigid_bodies = RigidBodies::left_out);

/// Studies points begin .. end-1 in brief (StudyOptions::brief), calling done(index, point) for each in this order, one
/// call at a time (from whichever thread finished it); done may throw to stop. A point whose solver does not converge
/// has the status solver_failed and its message, and no numbers. Points run side by side on the options' threads, each
/// single-threaded: the numbers do not depend on that. Under `settled`
/// options.progress is told how far the first table of landings is, which all threads build together; then it is called
/// within the points, always with 0. It may throw to stop.
void sweep(const Setting& base, const std::vector<SweepAxis>& axes, std::size_t begin, const StudyOptions& options,
           const std::function<void(std::size_t, const SweepPoint&)>& done,
           RigidBodies rigid_bodies = RigidBodies::left_out);

}  // namespace metastable::analysis
