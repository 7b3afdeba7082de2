#include "markov/work_left.h"

#include <algorithm>
#include <utility>

namespace metastable::markov {
namespace {

constexpr double telling_share = 0.05;  // of a stage: so much of it tells how fast it goes
constexpr double unfinished = 0.02;     // of a stage: so much is left at least while it is not finished

}  // namespace

WorkLeft::WorkLeft(std::function<double()> seconds) : clock_(std::move(seconds)) {
  if (!clock_)
    clock_ = [start = std::chrono::steady_clock::now()] {
      return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    };
}

void WorkLeft::plan(double units, double seconds_per_unit) {
  if (current_ == stages_.size()) began_ = clock_();
  stages_.push_back({units, seconds_per_unit});
}

void WorkLeft::replan(std::size_t stage, double units) { stages_[stage].units = units; }

void WorkLeft::advance(double units) {
  done_ += units;
  if (current_ < stages_.size()) stages_[current_].done += units;
}

void WorkLeft::finish(std::size_t stage) {
  current_ = stage + 1;
  began_ = clock_();
}

double WorkLeft::share() const {
  if (stages_.empty()) return 0;
  const double passed = clock_();
  double left = 0;
  for (std::size_t i = current_; i < stages_.size(); ++i) {
    const Stage& stage = stages_[i];
    const bool telling = i == current_ && stage.done > 0 && stage.done >= telling_share * stage.units;
    const double each = telling ? (passed - began_) / stage.done : stage.seconds_per_unit;
    left += each * std::max(stage.units - stage.done, unfinished * stage.units);
  }
  return passed + left > 0 ? passed / (passed + left) : 0;
}

}  // namespace metastable::markov
