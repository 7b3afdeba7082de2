#include "markov/parallel.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <memory>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

namespace metastable::markov {

int thread_count(int requested) {
  if (requested > 0) return requested;
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

void parallel_for(std::size_t count, int threads, const std::function<void(std::size_t)>& work) {
  std::atomic<std::size_t> next{0};
  std::atomic<bool> failed{false};
  std::exception_ptr error;
  std::mutex error_mutex;
  const auto run = [&] {
    for (std::size_t i = next++; i < count && !failed; i = next++) {
      try {
        work(i);
      } catch (...) {
        const std::scoped_lock lock(error_mutex);
        if (!failed.exchange(true)) error = std::current_exception();
      }
    }
  };
  const auto workers = std::min(static_cast<std::size_t>(thread_count(threads)), count);
  {
    std::vector<std::jthread> pool;
    for (std::size_t t = 1; t < workers; ++t) pool.emplace_back(run);
    run();
  }
  if (error) std::rethrow_exception(error);
}

void parallel_for(std::size_t count, int threads, const std::function<void(std::size_t)>& work, const Share& progress) {
  if (!progress) return parallel_for(count, threads, work);
  constexpr std::size_t parts = 1000;
  std::atomic<std::size_t> done{0};
  std::mutex telling;
  parallel_for(count, threads, [&](std::size_t i) {
    work(i);
    const std::size_t now = ++done;
    if (now * parts / count == (now - 1) * parts / count) return;
    const std::scoped_lock lock(telling);
    progress(static_cast<double>(now) / static_cast<double>(count));
  });
}

std::function<void()> one_at_a_time(std::function<void()> listener) {
  return [speaking = std::make_shared<std::mutex>(), listener = std::move(listener)] {
    const std::scoped_lock lock(*speaking);
    if (listener) listener();
  };
}

}  // namespace metastable::markov
