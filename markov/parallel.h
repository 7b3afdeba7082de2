#pragma once
// Splits independent work over threads. Results must not depend on which thread does what.

#include <cstddef>
#include <functional>

namespace metastable::markov {

/// Returns how many threads to use; when `requested` is 0, the machine's hardware concurrency, at least 1.
int thread_count(int requested);

/// Calls work(i) once for every i in [0, count) on `threads` threads (0: as many as the machine has).
/// The first exception thrown by a call is rethrown here after all threads have stopped; calls not yet
/// started are then skipped.
void parallel_for(std::size_t count, int threads, const std::function<void(std::size_t)>& work);

/// A listener that is told the share of the work that is done, (0, 1], from any thread, one at a time; what it throws
/// ends the work.
using Share = std::function<void(double share)>;

/// Does the same, and `progress`, if there is one, is told a thousand times at most.
void parallel_for(std::size_t count, int threads, const std::function<void(std::size_t)>& work, const Share& progress);

/// Returns a listener that any thread may call at any time, and that calls `listener`, if there is one, one call at a
/// time. What it throws is passed on.
std::function<void()> one_at_a_time(std::function<void()> listener);

/// Returns parallel_for() as a function to hand on, for those who know no threads.
inline auto on_threads(int threads) {
  return [threads](std::size_t count, const std::function<void(std::size_t)>& work) {
    parallel_for(count, threads, work);
  };
}

}  // namespace metastable::markov
