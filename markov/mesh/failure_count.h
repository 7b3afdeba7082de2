#pragma once
// Holds walks that were simulated against the failures that a mesh foretells of them.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "markov/size_extrapolation.h"

namespace metastable::markov {

/// The chance of calling a mesh refuted that is right: 1e-3, of either side half. It is the level at which two
/// estimates disagree as well: 1.7 half-widths of 95 % are 3.33 sds, beyond which a normal number lies with 0.9e-3.
inline constexpr double refutation_level = 1e-3;

/// Holds what is foretold of walks from the start: the cumulative hazard H(n), so that exp(-H(n)) walk on after n
/// steps.
struct ForetoldHazard {
  std::vector<double> survival;  ///< [k]: share that walks on after k + 1 steps; beyond the last at `rate` a step
  double rate = 0;               ///< chance of failing in a step, once settled
  double fewer = 0, more = 0;    ///< logarithms: how many times fewer and more steps their 95 % interval allows

  double at(std::uint64_t steps) const;
};

/// Brings what meshes of several sizes and shifts foretell to the spacing zero, step by step: by ln H, as `extrapolate`
/// does it with [shift][size]. Where a mesh sees no failure yet, or nobody walks on, it is what the finest one says,
/// and the interval spans what all say. It ends where the first mesh does.
/// @param hazards  [shift][size], at least two shifts
/// @param leaving  the logarithm by which what leaves the meshes may raise H
std::vector<MeshEstimate> extrapolated_survival(
    const std::vector<std::vector<ForetoldHazard>>& hazards, double leaving,
    const std::function<Extrapolated(const std::vector<std::vector<double>>&)>& extrapolate);

/// Does the same with the rates beyond.
MeshEstimate extrapolated_rate(const std::vector<std::vector<ForetoldHazard>>& hazards, double leaving,
                               const std::function<Extrapolated(const std::vector<std::vector<double>>&)>& extrapolate);

/// Returns the share that walks on after so many steps.
/// @param survival  after 1, 2, ... steps, until each revolution fails alike
/// @param rate  chance of failing in a step beyond, in the mean over a revolution
/// @param phases  steps of a revolution, >= 1
MeshEstimate survival_after(std::span<const MeshEstimate> survival, const MeshEstimate& rate, std::uint64_t steps,
                            std::size_t phases);

/// Holds walks of which each failed within so many steps or walked on. Whatever happens in a walk, walks are
/// independent: their number of failures is binomial, also where failures come in clusters or very late.
struct FailureCount {
  std::size_t walks = 0, failed = 0;
  std::uint64_t longest = 0;  ///< steps of a walk that did not fail
  double foretold = 0;        ///< failures

  /// Returns whether the count contradicts the hazard at refutation_level, wherever in its 95 % interval it lies.
  bool refutes(const ForetoldHazard& hazard) const;
};

/// Counts walks; a walk's entry is the step in which it failed, 0 if it walked on.
FailureCount count_failures(const std::vector<std::uint64_t>& walks, std::uint64_t longest,
                            const ForetoldHazard& hazard);

/// Returns "3 of 512 simulated walks failed within 3906 steps, where the mesh foretells 2.7".
std::string count_text(const FailureCount& count);

}  // namespace metastable::markov
