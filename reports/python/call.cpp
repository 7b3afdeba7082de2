#include "reports/python/call.h"

#include <chrono>
#include <cstdlib>  // It defines __GLIBC__ where that is the library.
#include <thread>

#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace metastable::reports::python {
namespace {

constexpr auto glance = std::chrono::milliseconds(50);         // between two looks at Ctrl-C
constexpr auto stands_still = std::chrono::milliseconds(500);  // before the same is shown again

// A step written with NumPy makes and drops arrays of megabytes, one an operation. With its first thresholds glibc
// gives each back to the system, which makes new pages for the next one: up to half of the time of such a step. These
// are the largest thresholds, which glibc comes to by itself where a block of 32 MB has been freed (mallopt(3)).
void keep_dropped_memory() {
#ifdef __GLIBC__
  static const bool kept = mallopt(M_MMAP_THRESHOLD, 32 << 20) == 1 && mallopt(M_TRIM_THRESHOLD, 64 << 20) == 1;
  (void)kept;
#endif
}

}  // namespace

void Call::run(const std::function<void()>& work) {
  keep_dropped_memory();
  std::exception_ptr failure;
  std::thread thread([&] {
    try {
      work();
    } catch (...) {
      failure = std::current_exception();
    }
    const std::lock_guard lock(mutex_);
    ended_ = true;
    for_caller_.notify_one();
  });
  for (bool over = false; !over;) {
    Asked* asked = nullptr;
    {
      const py::gil_scoped_release released;
      std::unique_lock lock(mutex_);
      for_caller_.wait_for(lock, glance, [&] { return ended_ || !asked_.empty(); });
      over = ended_;
      if (!asked_.empty()) {
        asked = asked_.front();
        asked_.pop_front();
      }
    }
    serve(asked);
    if (asked == nullptr) continue;
    {
      const std::lock_guard lock(mutex_);
      asked->done = true;
    }
    for_work_.notify_all();  // The lock is free, so that nobody wakes to wait for it.
  }
  thread.join();
  if (raised_) std::rethrow_exception(raised_);
  if (failure) std::rethrow_exception(failure);
}

// Runs in the caller's thread, holding the lock.
void Call::serve(const Asked* asked) {
  if (stopped_) return;
  try {
    if (asked != nullptr) (*asked->python)();
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    double share = 0;
    std::string doing;
    {
      const std::lock_guard lock(mutex_);
      share = share_;
      doing = doing_;
    }
    if (progress_.is_none()) return;
    const auto now = std::chrono::steady_clock::now();
    if (share == shown_ && doing == shown_doing_) {
      if (now - shown_at_ < stands_still || !py::hasattr(progress_, "again")) return;
      shown_at_ = now;
      progress_.attr("again")();
      return;
    }
    shown_ = share;
    shown_doing_ = doing;
    shown_at_ = now;
    progress_(share, doing);
  } catch (...) {
    raised_ = std::current_exception();
    stopped_ = true;
  }
}

void Call::tell(double share, const std::string& doing) {
  if (stopped_) throw Stopped();
  const std::lock_guard lock(mutex_);
  share_ = share;
  doing_ = doing;
}

void Call::ask(const std::function<void()>& python) {
  Asked asked{&python};
  std::unique_lock lock(mutex_);
  if (stopped_) throw Stopped();
  asked_.push_back(&asked);
  lock.unlock();
  for_caller_.notify_one();
  lock.lock();
  for_work_.wait(lock, [&] { return asked.done; });
  if (stopped_) throw Stopped();
}

}  // namespace metastable::reports::python
