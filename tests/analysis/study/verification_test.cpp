#include "analysis/study/verification.h"

#include <gtest/gtest.h>

#include <cmath>

namespace metastable::analysis {
namespace {

TEST(Verification, RoughTerrainIsRightToElevenDigitsAndStableToTenOutTo1e40Steps) {
  double longest = 0;
  for (const Benchmark& benchmark : rough_terrain_benchmarks()) {
    const Verified verified = verify(benchmark, 1, 256);
    EXPECT_LT(verified.change, 1e-10) << benchmark.name;
    EXPECT_LT(verified.error.value_or(0), 1e-11) << benchmark.name;
    longest = std::max(longest, verified.from_start);
  }
  EXPECT_GT(longest, 1e40);
}

TEST(Verification, OtherSolversLoseTheirDigitsWhereRestIsRare) {
  const std::vector<Benchmark> all = rough_terrain_benchmarks();
  const Verified often = verify(all.front(), 1, 128), rare = verify(all.back(), 1, 128);
  EXPECT_NEAR(*often.lu_from_start / often.from_start, 1, 1e-9);
  EXPECT_NEAR(*often.arnoldi_from_quasi_stationary / often.from_quasi_stationary, 1, 1e-9);
  EXPECT_GT(std::abs(rare.lu_from_start.value_or(0) / rare.from_start - 1), 0.5);
  EXPECT_GT(std::abs(rare.arnoldi_from_quasi_stationary.value_or(0) / rare.from_quasi_stationary - 1), 0.5);
}

TEST(Verification, ThePapersWheelIsStableUnderDoubling) {
  const Benchmark rare = wheel_benchmarks()[4];  // 4.7e4 steps
  const Verified verified = verify(rare, 1, 128);
  EXPECT_LT(verified.change, 1e-8);
  ASSERT_TRUE(verified.error);
  EXPECT_GT(*verified.error, 0);
  EXPECT_LT(*verified.error, 1e-7);  // densities by their fast form
}

TEST(Verification, CoverageCountsSeeds) {
  const Benchmark benchmark = rough_terrain_benchmarks().front();
  const Coverage found = coverage(benchmark.problem, *benchmark.known_from_start, 6, 2);
  EXPECT_EQ(found.seeds, 6);
  EXPECT_GE(found.inside, 5);  // 95 % intervals
  EXPECT_EQ(coverage(benchmark.problem, 1.1 * *benchmark.known_from_start, 2, 2).inside, 0);
  EXPECT_LT(found.widest, 0.01);
}

}  // namespace
}  // namespace metastable::analysis
