// Holds masses and moments of the panels against 120 digits.

#include "dynamics/bounds/restitution_panels.h"

#include <gtest/gtest.h>

#include "tests/dynamics/normal_digits.h"

namespace metastable::dynamics {
namespace {

// Second moments of the narrowest panels are 1e-90, left over from terms of 1e-2.
using LongReal = boost::multiprecision::number<boost::multiprecision::cpp_bin_float<120>>;

bool encloses(const Interval& i, const LongReal& x) { return LongReal(i.lower) <= x && x <= LongReal(i.upper); }
LongReal below(const LongReal& z) { return test::normal_tail_digits(LongReal(-z)); }
LongReal bump(const LongReal& z) { return test::normal_density_digits(z); }

TEST(RestitutionPanels, EncloseMassesAndMoments) {
  for (const auto& [mean, sd] :
       {std::pair(0.4, 0.1), std::pair(0.4, 0.05), std::pair(0.1, 0.2), std::pair(0.95, 0.01)}) {
    const TruncatedNormal normal(mean, sd, 0, 1);
    const PanelCut cut = restitution_panels(normal, 1);
    const auto z = [m = LongReal(mean), s = LongReal(sd)](double x) { return LongReal((LongReal(x) - m) / s); };
    const LongReal mass = below(z(1)) - below(z(0));
    Interval total(0);
    for (const MomentPanel& p : cut.panels) {
      const LongReal a = z(p.lower), b = z(p.upper), off = LongReal(p.centre) - mean;
      const LongReal zeroth = (below(b) - below(a)) / mass, first = sd * (bump(a) - bump(b)) / mass;
      const LongReal second = LongReal(sd) * sd * (zeroth + (a * bump(a) - b * bump(b)) / mass);
      EXPECT_TRUE(encloses(p.weight, zeroth)) << p.lower;
      EXPECT_TRUE(encloses(p.first, first - off * zeroth)) << p.lower;
      EXPECT_TRUE(encloses(p.second, second - 2 * off * first + off * off * zeroth)) << p.lower;
      EXPECT_LE(p.weight.lower, p.weight.upper);
      if (zeroth > 1e-200) {
        EXPECT_LT((p.weight.upper - p.weight.lower) / p.weight.upper, p.upper - p.lower > 1e-2 * sd ? 1e-11 : 1e-3)
            << p.lower;
      }
      total += p.weight;
    }
    EXPECT_LE(total.lower, 1);
    EXPECT_GE((total + cut.outside).upper, 1);
    EXPECT_LT(cut.outside.upper, 1e-20);
  }
}

TEST(RestitutionPanels, CoverTheRangeWithoutGaps) {
  const PanelCut cut = restitution_panels(TruncatedNormal(0.4, 0.1, 0, 1), 0.1);
  for (std::size_t i = 1; i < cut.panels.size(); ++i) EXPECT_EQ(cut.panels[i].lower, cut.panels[i - 1].upper);
  EXPECT_EQ(cut.panels.front().lower, 1e-30);
  EXPECT_EQ(cut.panels.back().upper, 1);
}

TEST(RestitutionPanels, AConstantIsOnePanel) {
  const PanelCut cut = restitution_panels(TruncatedNormal(0.4, 0, 0, 1), 0.1);
  ASSERT_EQ(cut.panels.size(), 1U);
  EXPECT_EQ(cut.panels.front().weight.lower, 1);
  EXPECT_THROW(restitution_panels(TruncatedNormal(0, 0, 0, 1), 0.1), std::domain_error);
}

}  // namespace
}  // namespace metastable::dynamics
