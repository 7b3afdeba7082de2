#pragma once
// Holds what tests of tables of settled landings share.

#include <cstddef>
#include <functional>
#include <thread>

namespace metastable::dynamics::test {

/// An executor (SettledMapOptions) on two threads.
inline void two_threads(std::size_t count, const std::function<void(std::size_t)>& work) {
  const auto every_second = [&](std::size_t first) {
    for (std::size_t i = first; i < count; i += 2) work(i);
  };
  std::thread other([&] { every_second(1); });
  every_second(0);
  other.join();
}

}  // namespace metastable::dynamics::test
