#pragma once
// A piece of work that pauses in between: several take turns in one thread without a switch of threads, which costs
// more than many a step of a map.

#include <cstddef>
#include <functional>
#include <memory>

namespace metastable::markov {

/// A piece of work with a stack of its own (8 MB, of which only what it touches is taken).
class Fiber {
 public:
  /// @param work  must not throw
  explicit Fiber(std::function<void()> work);
  /// It has to be over, or never begun.
  ~Fiber();
  Fiber(const Fiber&) = delete;
  Fiber& operator=(const Fiber&) = delete;

  /// Runs the work until it pauses or is over; always from the same thread.
  void resume();
  bool over() const;
  /// Pauses the work that runs in this thread, which must be a fiber's. Locks that it holds stay held.
  static void pause();
  /// Returns a pointer that each fiber has of its own, and each thread outside of them; nullptr at first.
  static const void*& local();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace metastable::markov
