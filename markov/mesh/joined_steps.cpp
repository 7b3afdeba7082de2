#include "markov/mesh/joined_steps.h"

#include <algorithm>
#include <condition_variable>
#include <exception>
#include <map>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "markov/fiber.h"
#include "markov/parallel.h"

namespace metastable::markov {
namespace {

/// Ends work that waits when other work has thrown.
struct Abandoned {};

class Joining {
 public:
  Joining(const BatchMap& map, std::size_t count, std::size_t together, int threads,
          const std::function<void(std::size_t, const BatchMap&)>& work)
      : map_(map),
        count_(count),
        side_by_side_(std::min(together, count)),
        carriers_(std::min(static_cast<std::size_t>(thread_count(threads)), side_by_side_)),
        work_(work) {}

  void run() {
    active_ = side_by_side_;
    next_ = side_by_side_;
    {
      std::vector<std::jthread> threads;
      for (std::size_t c = 1; c < carriers_; ++c) threads.emplace_back([this, c] { carry(c); });
      carry(0);
    }
    if (!errors_.empty()) std::rethrow_exception(errors_.begin()->second);
  }

 private:
  struct Request {
    int phase;
    std::span<const double> states, scores;
    std::span<double> next;
    std::span<std::uint8_t> failed;
    std::exception_ptr error = {};
  };

  /// Runs every carriers_-th of the works that are side by side, each as far as it goes, and then waits for the call.
  void carry(std::size_t first) {
    std::vector<std::unique_ptr<Fiber>> own;
    for (std::size_t i = first; i < side_by_side_; i += carriers_)
      own.push_back(std::make_unique<Fiber>([this, i] { serve(i); }));
    for (std::size_t seen = 0; !own.empty();) {
      for (const std::unique_ptr<Fiber>& one : own) one->resume();
      std::erase_if(own, [](const std::unique_ptr<Fiber>& one) { return one->over(); });
      std::unique_lock lock(mutex_);
      step_if_all_wait();
      if (rounds_ != seen) {
        seen = rounds_;
        lock.unlock();
        changed_.notify_all();  // The lock is free, so that nobody wakes to wait for it.
        continue;
      }
      if (!own.empty()) changed_.wait(lock, [&] { return rounds_ != seen; });
      seen = rounds_;
    }
  }

  void serve(std::size_t i) {
    while (i < count_) {
      try {
        BatchMap joined = map_;
        joined.step = [this, i](int phase, auto states, auto scores, auto next, auto failed) {
          ask(i, {phase, states, scores, next, failed});
        };
        Fiber::local() = &joined;
        work_(i, joined);
      } catch (const Abandoned&) {
      } catch (...) {
        const std::lock_guard lock(mutex_);
        errors_.emplace(i, std::current_exception());
      }
      Fiber::local() = nullptr;
      const std::lock_guard lock(mutex_);
      i = errors_.empty() ? next_++ : count_;
    }
    const std::lock_guard lock(mutex_);
    --active_;
  }

  void ask(std::size_t i, Request request) {
    {
      const std::lock_guard lock(mutex_);
      waiting_[i] = &request;
    }
    Fiber::pause();
    if (request.error) std::rethrow_exception(request.error);
  }

  /// Makes the joined call once all wait. The caller holds the lock.
  void step_if_all_wait() {
    if (waiting_.empty() || waiting_.size() < active_) return;
    try {
      if (!errors_.empty()) throw Abandoned();
      std::map<int, std::vector<Request*>> by_phase;
      for (const auto& [i, request] : waiting_) by_phase[request->phase].push_back(request);
      for (const auto& [phase, requests] : by_phase) step(phase, requests);
    } catch (...) {
      for (const auto& [i, request] : waiting_) request->error = std::current_exception();
    }
    waiting_.clear();
    ++rounds_;
  }

  void step(int phase, const std::vector<Request*>& requests) const {
    if (requests.size() == 1 && requests.front()->failed.size() <= rows_of_a_dear_call) {
      const Request& one = *requests.front();
      return map_.step(phase, one.states, one.scores, one.next, one.failed);
    }
    const auto d = static_cast<std::size_t>(map_.dimension), s = static_cast<std::size_t>(map_.scores);
    std::vector<double> states, scores;
    for (const Request* one : requests) {
      states.insert(states.end(), one->states.begin(), one->states.end());
      scores.insert(scores.end(), one->scores.begin(), one->scores.end());
    }
    const std::size_t rows = states.size() / d;
    std::vector<double> next(states.size());
    std::vector<std::uint8_t> failed(rows, 0);
    for (std::size_t first = 0; first < rows; first += rows_of_a_dear_call) {
      const std::size_t some = std::min(rows_of_a_dear_call, rows - first);
      map_.step(phase, std::span(states).subspan(first * d, some * d), std::span(scores).subspan(first * s, some * s),
                std::span(next).subspan(first * d, some * d), std::span(failed).subspan(first, some));
    }
    std::size_t first = 0;
    for (const Request* one : requests) {
      std::copy_n(next.data() + first * d, one->next.size(), one->next.data());
      std::copy_n(failed.data() + first, one->failed.size(), one->failed.data());
      first += one->failed.size();
    }
  }

  const BatchMap& map_;
  std::size_t count_, side_by_side_;
  std::size_t carriers_;  ///< threads that compute at the same time
  const std::function<void(std::size_t, const BatchMap&)>& work_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::map<std::size_t, Request*> waiting_;
  std::map<std::size_t, std::exception_ptr> errors_;
  std::size_t active_ = 0, next_ = 0, rounds_ = 0;
};

}  // namespace

void joined_for(const BatchMap& map, std::size_t count, std::size_t together, int threads,
                const std::function<void(std::size_t, const BatchMap&)>& work) {
  if (count > 0) Joining(map, count, std::max<std::size_t>(1, together), threads, work).run();
}

const BatchMap* joined_map() { return static_cast<const BatchMap*>(Fiber::local()); }

}  // namespace metastable::markov
