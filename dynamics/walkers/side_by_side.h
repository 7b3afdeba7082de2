#pragma once
// Holds numbers of walkers side by side, in vectors as wide as the processor has them. The sources that include it are
// compiled by CMake's metastable_vectorize(); results have the same bits at any width.

namespace metastable::dynamics {

/// These hold a number of each of four or eight walkers.
using Four = double __attribute__((vector_size(4 * sizeof(double))));
using Eight = double __attribute__((vector_size(8 * sizeof(double))));

/// Marks what works on vectors of eight numbers, and may be called only where has_eight_lanes().
#ifdef METASTABLE_AVX2
#define METASTABLE_EIGHT_LANES __attribute__((target("avx512f")))
#else
#define METASTABLE_EIGHT_LANES
#endif

/// Says whether the processor works on eight numbers at once. Vectors of eight that are put together from smaller ones
/// are slower than those of four.
inline bool has_eight_lanes() {
#ifdef METASTABLE_AVX2
  static const bool has = __builtin_cpu_supports("avx512f");
  return has;
#else
  return false;
#endif
}

}  // namespace metastable::dynamics
