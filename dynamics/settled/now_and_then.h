#pragma once
// Thins calls out to a listener of long work.

#include <atomic>
#include <chrono>
#include <functional>
#include <mutex>
#include <utility>

namespace metastable::dynamics {

/// Passes a call on if the last one was passed on 20 ms ago or earlier, one at a time: it may be called at every
/// landing, from any thread. What the listener throws comes out of the call.
class NowAndThen {
 public:
  explicit NowAndThen(std::function<void()> listener) : listener_(std::move(listener)) {}
  void operator()() {
    using namespace std::chrono;
    constexpr milliseconds::rep apart = 20;
    const milliseconds::rep now = duration_cast<milliseconds>(steady_clock::now().time_since_epoch()).count();
    if (now - passed_at_.load(std::memory_order_relaxed) < apart) return;
    passed_at_.store(now, std::memory_order_relaxed);
    const std::lock_guard lock(mutex_);
    listener_();
  }

 private:
  std::function<void()> listener_;
  std::atomic<std::chrono::milliseconds::rep> passed_at_ = 0;
  std::mutex mutex_;
};

}  // namespace metastable::dynamics
