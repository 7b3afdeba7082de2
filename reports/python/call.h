#pragma once
// Runs a computation off the interpreter's lock: its progress, its interruption, and the Python it needs in between.

#include <pybind11/pybind11.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <exception>
#include <functional>
#include <mutex>
#include <string>

namespace metastable::reports::python {

namespace py = pybind11;

/// Runs one computation in a thread of its own, while the thread that called serves the interpreter: it shows progress,
/// notices Ctrl-C, and runs whatever Python the computation asks for. So all Python of a call runs in its caller's
/// thread, one piece at a time.
class Call {
 public:
  /// @param progress  None, or called as progress(share of the work done in [0, 1], what is being done) when these
  ///                  change; where it has a method `again`, that is called every now and then while they do not
  explicit Call(py::object progress) : progress_(std::move(progress)) {}
  Call(const Call&) = delete;
  Call& operator=(const Call&) = delete;

  /// Call it holding the lock. @throws what `work` throws; py::error_already_set for KeyboardInterrupt and for what
  /// Python raised in between (what `work` throws because of it is then forgotten)
  void run(const std::function<void()>& work);

  /// Says how far the work is; from any thread of it. @throws Stopped once the caller waits no longer
  void tell(double share, const std::string& doing);

  /// Runs `python` in the caller's thread, holding the lock; from any thread of the work. @throws Stopped as tell()
  void ask(const std::function<void()>& python);

  /// Ends the work from within; known to no library, so that no library takes it for a failure of its own.
  class Stopped : public std::exception {};

 private:
  struct Asked {
    const std::function<void()>* python;
    bool done = false;
  };
  void serve(const Asked* asked);

  py::object progress_;
  std::mutex mutex_;
  std::condition_variable for_caller_, for_work_;
  std::deque<Asked*> asked_;
  bool ended_ = false;
  std::atomic<bool> stopped_{false};
  double share_ = 0, shown_ = -1;
  std::string doing_, shown_doing_;
  std::chrono::steady_clock::time_point shown_at_{};
  std::exception_ptr raised_;  ///< by Python, in the caller's thread
};

}  // namespace metastable::reports::python
