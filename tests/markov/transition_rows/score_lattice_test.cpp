#include "markov/transition_rows/score_lattice.h"

#include <gtest/gtest.h>

#include <stdexcept>
#include <string>
#include <vector>

#include "tests/message_of.h"

namespace metastable::markov {
namespace {

TEST(ScoreLattice, HasTheMomentsOfNormals) {
  const ScoreLattice lattice(2, 0.6, 8.5);
  std::vector<double> score(2 * lattice.size()), weight(lattice.size());
  lattice.place(std::vector{0.3, 0.8}, score, weight);
  double mass = 0, square = 0, fourth = 0;
  for (std::size_t i = 0; i < lattice.size(); ++i) {
    const double z = score[2 * i], other = score[2 * i + 1];
    mass += weight[i];
    square += weight[i] * z * z;
    fourth += weight[i] * z * z * other * other;
  }
  EXPECT_NEAR(mass, 1, 1e-9);
  EXPECT_NEAR(square, 1, 1e-9);
  EXPECT_NEAR(fourth, 1, 1e-9);
}

// Fifteen noises would take 7e16 points: it is said at once.
TEST(ScoreLattice, RefusesMorePointsThanAStateCanHave) {
  const std::string message = message_of<std::length_error>([] { ScoreLattice(15, 0.6, 8.5); });
  EXPECT_TRUE(message.starts_with("a lattice over 15 of the noises would hold about ")) << message;
  EXPECT_NE(message.find("takes any number of noises"), std::string::npos) << message;
}

}  // namespace
}  // namespace metastable::markov
