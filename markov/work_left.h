#pragma once
// Foretells how much of a computation is left, stage by stage.

#include <chrono>
#include <cstddef>
#include <functional>
#include <vector>

namespace metastable::markov {

/// Holds the stages of a computation, how much work each is and how fast it goes. Until stages are planned the share
/// done is 0: nothing is known then. A stage's speed is the one it was planned with until a twentieth of it is done,
/// and afterwards its own.
class WorkLeft {
 public:
  /// @param seconds  a clock that starts at 0; empty: the time since this was made
  explicit WorkLeft(std::function<double()> seconds = {});

  /// Adds a stage, which begins when all before it are finished. @param units  >= 0  @param seconds_per_unit  >= 0
  void plan(double units, double seconds_per_unit);
  /// Foresees other work of a stage.
  void replan(std::size_t stage, double units);
  void add(std::size_t stage, double units) { replan(stage, stages_[stage].units + units); }
  /// So much more of the stage at hand is done; before any was planned it counts for no stage.
  void advance(double units);
  /// The stages up to this one are over, however much was foreseen.
  void finish(std::size_t stage);

  double done() const { return done_; }  ///< units, in all
  double seconds() const { return clock_(); }
  /// Returns the time passed over the time that all takes, [0, 1]: 0 before anything was planned.
  double share() const;

 private:
  struct Stage {
    double units, seconds_per_unit, done = 0;
  };
  std::function<double()> clock_;
  std::vector<Stage> stages_;
  std::size_t current_ = 0;
  double done_ = 0, began_ = 0;
};

}  // namespace metastable::markov
