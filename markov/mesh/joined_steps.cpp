#include "markov/mesh/joined_steps.h"

#include <algorithm>
#include <condition_variable>
#include <exception>
#include <map>
#include <mutex>
#include <thread>
#include <vector>

#include "markov/parallel.h"

namespace metastable::markov {
namespace {

/// Ends work that waits when other work has thrown.
struct Abandoned {};

class Joining {
 public:
  Joining(const BatchMap& map, std::size_t count, std::size_t together, int threads,
          const std::function<void(std::size_t, const BatchMap&)>& work)
      : map_(map), count_(count), side_by_side_(std::min(together, count)), most_(thread_count(threads)), work_(work) {}

  void run() {
    active_ = side_by_side_;
    next_ = side_by_side_;
    {
      std::vector<std::jthread> threads;
      for (std::size_t slot = 0; slot < side_by_side_; ++slot) threads.emplace_back([this, slot] { serve(slot); });
    }
    if (!errors_.empty()) std::rethrow_exception(errors_.begin()->second);
  }

 private:
  struct Request {
    int phase;
    std::span<const double> states, scores;
    std::span<double> next;
    std::span<std::uint8_t> failed;
    bool answered = false;
    std::exception_ptr error = {};
  };

  void serve(std::size_t i) {
    begin_computing();
    while (i < count_) {
      try {
        BatchMap joined = map_;
        joined.step = [this, i](int phase, auto states, auto scores, auto next, auto failed) {
          ask(i, {phase, states, scores, next, failed});
        };
        work_(i, joined);
      } catch (const Abandoned&) {
      } catch (...) {
        const std::lock_guard lock(mutex_);
        errors_.emplace(i, std::current_exception());
      }
      const std::lock_guard lock(mutex_);
      i = errors_.empty() ? next_++ : count_;
    }
    const std::lock_guard lock(mutex_);
    --computing_;
    --active_;
    step_if_all_wait();
    changed_.notify_all();
  }

  void begin_computing() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return computing_ < most_; });
    ++computing_;
  }

  void ask(std::size_t i, Request request) {
    std::unique_lock lock(mutex_);
    waiting_[i] = &request;
    --computing_;
    step_if_all_wait();
    changed_.notify_all();
    changed_.wait(lock, [&] { return request.answered && computing_ < most_; });
    ++computing_;
    if (request.error) std::rethrow_exception(request.error);
  }

  /// Makes the joined call once all wait. The caller holds the lock, which those that wait need only when answered.
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
    for (const auto& [i, request] : waiting_) request->answered = true;
    waiting_.clear();
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
  int most_;  ///< that compute at the same time
  const std::function<void(std::size_t, const BatchMap&)>& work_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::map<std::size_t, Request*> waiting_;
  std::map<std::size_t, std::exception_ptr> errors_;
  std::size_t active_ = 0, next_ = 0;
  int computing_ = 0;
};

}  // namespace

void joined_for(const BatchMap& map, std::size_t count, std::size_t together, int threads,
                const std::function<void(std::size_t, const BatchMap&)>& work) {
  if (count > 0) Joining(map, count, std::max<std::size_t>(1, together), threads, work).run();
}

}  // namespace metastable::markov
