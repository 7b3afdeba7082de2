#pragma once
// Says what the law of rigid bodies, `settled`, gives for a question that another law has answered.

#include <cstdint>
#include <functional>
#include <span>
#include <string>

#include "analysis/statistics/estimate.h"
#include "analysis/study/metastability.h"
#include "analysis/study/setting.h"

namespace metastable::analysis {

/// Says how many wheels are rolled. They are counted, not timed: the same seed gives the same bits on any machine.
struct RigidBodyOptions {
  std::uint64_t collisions = 65536;  ///< after which no more wheels are begun, >= 1
  std::uint64_t rests = 1000;        ///< likewise, >= 1: the interval is then 6 to 10 % to either side
  std::uint64_t seed = 1;
  int threads = 0;                            ///< 0: all cores; the bits do not depend on it
  std::function<void(double)> progress = {};  ///< share done, from one thread at a time; may throw to stop
};

/// Holds the expected steps of a setting under `settled`, by direct simulation.
struct RigidBodyCheck {
  std::string reason;  ///< why there is no answer, empty otherwise: `settled` has no such wheel, or
                       ///< wheels of so many legs would have to be rolled too far
  Estimate steps;      ///< from the launch, with the 95 % interval
  /// Nothing bounds it above, for too few rests or because some wheel hops away for ever: `steps` has the lower 95 %
  /// bound as value and lower end.
  bool at_least = false;
  std::uint64_t wheels = 0, collisions = 0, rests = 0;  ///< rolled
};

/// Rolls wheels of the setting with `settled` in the place of its law and the same launch, each over 512 collisions at
/// most. The expected steps are the mean of what comes within the first 32 collisions (up to 256 of many legs), and for
/// the share that rolls on the collisions over rests from there, when the launch is forgotten. Wheels of so many legs
/// that it is not forgotten by then have no answer. A wheel without any noise is followed once, and one that rolls on
/// then never rests. Cost: 15 to 60 us a collision.
RigidBodyCheck rigid_body_check(const Setting& setting, const RigidBodyOptions& options);

/// Says whether two answers are within a factor of two of each other, for all that their intervals leave.
enum class RigidBodyVerdict { within_twice, differs, open };

/// One answer beside that of rigid bodies.
struct BesideRigidBodies {
  std::string name;  ///< of the setting among several, "9.59 deg"; not read where it is alone
  Estimate steps;    ///< of the law that answered, as answered_steps()
  RigidBodyCheck check;
  /// @pre check.reason is empty
  RigidBodyVerdict verdict() const;
};

/// Returns the expected steps of a study from the launch, infinite where rest is unreachable or beyond all draws.
Estimate answered_steps(const Metastability& study);

/// Rolls wheels beside a study: of its setting, with the options' seed, threads and progress.
BesideRigidBodies beside_rigid_bodies(const Metastability& study, std::string name, const StudyOptions& options);

/// Returns "within_twice", "differs", "open".
std::string verdict_text(RigidBodyVerdict verdict);
/// Returns "800 (95 % interval 700 to 900)", "at least 10000 (95 %)", or why there is none.
std::string rigid_body_steps_text(const RigidBodyCheck& check);

/// Says in one line which law answered, what rigid bodies give, and, where the two differ by more than twice, or of
/// several settings in which takes more steps, which to trust for what. @param all  none where `settled` knows no such
/// wheel
std::string rigid_body_sentence(std::span<const BesideRigidBodies> all, dynamics::Law law);

}  // namespace metastable::analysis
