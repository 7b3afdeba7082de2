#pragma once
// Finds expected steps of any return map with an interval, and what two independent ways say of it.

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "markov/mesh/batch_map.h"
#include "markov/mesh/blind_spots.h"
#include "markov/mesh/failure_count.h"
#include "markov/mesh/mesh.h"
#include "markov/mesh/noise_frame.h"
#include "markov/mesh/other_gaits.h"
#include "markov/size_extrapolation.h"

namespace metastable::markov {

struct MeshStudyOptions {
  double spacing = 0;  ///< of the coarsest mesh, in stationary sds; the others' fall by sqrt 2 each. 0: by dimension
  int sizes = 0;       ///< 3 or 4; 0: 3, in four dimensions 4
  int shifts = 6;      ///< of each size, >= 6, at most: fewer, three at least, where they agree
  double margin = 0;   ///< MeshOptions::margin; 0: 12, of several scores 16
  std::uint64_t seed = 1;
  int threads = 0;                    ///< 0: all cores; the bits do not depend on it
  std::size_t guided_samples = 4000;  ///< 0: none
  /// Direct simulation takes about so many steps, in 10^7 trials to failure at most; 0: none at all.
  std::uint64_t simulated_steps = 2000000;
  std::size_t most_bytes = std::size_t{3} << 30;  ///< of all meshes held at once
  /// It is called with the share of the time that all takes, 0 until that can be foretold (from the coarsest mesh on),
  /// from any thread but one at a time, and may throw to stop. The share falls back where more work turns up.
  std::function<void(double)> progress = {};
};

struct MeshSize {
  double spacing = 0;
  std::size_t nodes = 0, entries = 0;  ///< of the first shift
  std::vector<double> steps;           ///< of each shift
};

struct MeshStudy {
  MeshEstimate steps;         ///< expected steps before failure from the start
  MeshEstimate failure_rate;  ///< a step, from the quasi-stationary distribution
  double mixing_steps = 0;
  /// Holds the shares that walk on after 1, 2, ... steps, until they fall by `later_rate` a step (survival_after()):
  /// the failure rate, unless other gaits outlast that of the start.
  std::vector<MeshEstimate> survival;
  MeshEstimate later_rate;
  double cheapest_failure = 0;
  NoiseFreeOrbit orbit;  ///< of a gait that comes back after several revolutions, over all of them
  int period = 1;        ///< revolutions after which the gait comes back; 0: there is none, `orbit` has no eigenvalues
  /// The orbit without noise comes back after so many revolutions, more than a mesh holds (longest_period); 0: it does
  /// not, or a mesh holds the gait.
  int longer_period = 0;
  std::uint64_t fails_without_noise = 0;  ///< where there is no gait, the steps after which that is; 0: never
  std::vector<NoiseFrame> frames;         ///< of the meshes, phase by phase
  OtherGaits gaits;
  /// Hold shares of the expected steps, and of the failures by the gait that they come from (failures_by_gait),
  /// by gait, the start's own first; empty: there is no other.
  std::vector<double> gait_share, gait_failures;
  /// Holds the relative parts of the interval of `steps`: the shifts' t-interval, what is left of the discretization,
  /// and what leaves the mesh.
  double shift_error = 0, discretization_error = 0, bracket = 0;
  BlindSpots blind_spots;  ///< of the coarsest mesh
  int row_states = 1;      ///< MeshOptions::row_states of all meshes: above 1 where the chance of failing jumps
  std::vector<MeshSize> sizes;
  double expected_bytes = 0;                             ///< of all meshes held at once, as foreseen from the coarsest
                                                         ///< (of a dear map it does not depend on the threads)
  std::optional<MeshEstimate> guided, simulated;         ///< expected steps in the two other ways, where they reach
  std::size_t guided_samples = 0, simulated_trials = 0;  ///< 0: not asked
  /// Say, where there is no such estimate, why: a clause.
  std::string no_guided, no_simulated;
  /// Holds what was simulated where too few walks fail for an estimate: it may refute the mesh and confirms little.
  std::optional<FailureCount> walks;
  /// Empty, or a clause that says why `steps` must not be used: which ways disagree, or that meshes do not converge.
  std::string disagreement;
};

/// Returns the expected steps of survivors who have forgotten the start: one over the failure rate.
inline MeshEstimate steps_from_quasi_stationary(const MeshStudy& study) {
  const MeshEstimate& rate = study.failure_rate;
  return {1 / rate.value, 1 / rate.upper, 1 / rate.lower};
}

/// Returns the share that walks on after so many steps.
inline MeshEstimate survival_after(const MeshStudy& study, std::uint64_t steps) {
  const std::size_t turn = study.period > 0 ? study.orbit.frames.size() : study.frames.size();
  return survival_after(study.survival, study.later_rate, steps, std::max<std::size_t>(1, turn));
}

/// Returns the spacing of the scores that a study's meshes take.
double study_score_spacing(const BatchMap& map);

/// Says that ways that share little contradict each other: there is no number to give.
class Disagreement : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Says that other ways contradict a mesh, or that it does not converge: a way without a mesh may have a number.
class RefutedMesh : public Disagreement {
 public:
  /// @param what  was studied @param why  a clause, as MeshStudy::disagreement @param instead  what could be done
  RefutedMesh(const std::string& what, std::string why, const std::string& instead = "")
      : Disagreement(what + ": " + why + ": no number is given" + instead), why_(std::move(why)) {}
  const std::string& why() const { return why_; }  ///< a clause

 private:
  std::string why_;
};

/// Meshes lie around the start's noise-free orbit. An unstable one leads without noise to another gait, which may come
/// back after several revolutions (periodic_gait): meshes lie around that one then, and steps are counted from the
/// start all the same. An orbit of several revolutions is held by one mesh with a common frame, on which the noise
/// shifts it against itself as it may; survivors are then watched over as many revolutions. Only where nodes do not
/// reach so far each revolution has a mesh of its own, and no shift is seen. A start that leads to no such orbit
/// (noise_free_walk) is asked for its first passage alone: other gaits are not looked for.
///
/// Solves `sizes` meshes of each shift, extrapolates ln T to spacing 0 (h^2 and h^4, with four sizes h^6) for each
/// shift by itself. There are three shifts, and one more at a time, `shifts` at most, until their t-interval is no
/// wider than the other two parts of the interval together, and in an interval that is not narrow (1 %) half as wide.
/// The interval joins, as a root of squares, the t-interval over the shifts and the discretization error; Walkers
/// that leave the mesh count as survivors, and at the lower end of the interval as failed; what blind spots may hold is
/// added on its side. The discretization error is the difference from the extrapolation without the coarsest
/// size; with four sizes, at least that between the two triples'. Shares that walk on are extrapolated like the steps,
/// by the logarithm of the hazard -ln S. Meshes coarser than the default count it by the square of the ratio of their
/// spacings: the sizes show less and less of it.
///
/// Beside it stand importance sampling guided by the second coarsest mesh, where T is above 100 steps and above three
/// windows of it and fewer than 4000 trials fit into `simulated_steps`, and direct simulation: trials to failure where
/// 100 or more fit into `simulated_steps`, else 512 walks of half so many steps together, whose failures are counted
/// (FailureCount). Windows are as long as the mesh foretells (reaching_window) and lengthened until the samples'
/// weights are even; where they stay uneven, the interval is widened in proportion, and beyond a factor of about two
/// not given. Two ways disagree when they lie further apart than 1.7 times (99.9 %) the joint 95 % half-width of the
/// sides that face each other, and a count of failures when the mesh foretells one so far off with a chance below
/// refutation_level. Where the noise leads to other gaits (OtherGaits), meshes grow from those too and are solved by
/// coupled_passage(); failures are then counted only, and no samples are guided: both would start in one gait and know
/// nothing of the others. No number is given either where a gait is a trap, where blind spots may hold more than a
/// tenth of the failures, or where the interval is wider than a factor of four. Rows are read off states around their
/// nodes where the chance of failing jumps from one state to the next (failing_jumps). A dear map's meshes grow side by
/// side, as many as half the memory holds, in joined steps. The coarsest mesh comes first: what the finest will take,
/// nodes by the spacing's power and entries with them, is foreseen from it.
/// @param start  a state at phase 0
/// @throws Disagreement where a gait is a trap, or meshes find no failure and simulation does; std::length_error before
/// the other meshes are made if they would take more than most_bytes; as Mesh, noise_frames and mesh_passage do, with
/// what simulation says where there is no orbit to centre a mesh on
MeshStudy mesh_study(const BatchMap& map, std::span<const double> start, const MeshStudyOptions& options = {});

/// Names two ways that lie further apart than 1.7 times their joint half-width, or returns nothing.
std::string disagreement(const char* one, const MeshEstimate& a, const char* other, const MeshEstimate& b);

/// @param what  was studied, for the message
/// @throws RefutedMesh with MeshStudy::disagreement as its why(), unless that is empty
void require_agreement(const MeshStudy& study, const std::string& what);

}  // namespace metastable::markov
