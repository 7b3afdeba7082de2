// These tests run under mpirun: every rank runs all of them, in step.

#include <gtest/gtest.h>

#include "tests/markov/ranks/ranks_of_tests.h"

namespace metastable::markov::testing {

Ranks& ranks() {
  static Ranks all;
  return all;
}

}  // namespace metastable::markov::testing

int main(int argc, char** argv) {
  metastable::markov::testing::ranks();
  ::testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
