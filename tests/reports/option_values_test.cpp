#include "reports/option_values.h"

#include <gtest/gtest.h>

#include <string>

#include "dynamics/effect_catalogue.h"

namespace metastable::reports {
namespace {

// Longer than a file's name may be: asking the file system about it once ended the program.
TEST(OptionValues, ACatalogueOfAllEffectsIsAList) {
  std::string all;
  for (const dynamics::EffectInfo& info : dynamics::effect_catalogue()) all += (all.empty() ? "" : ",") + info.id;
  EXPECT_GT(all.size(), 255u);
  EXPECT_EQ(catalogue_value("catalogue", all).size(), dynamics::effect_catalogue().size());
}

}  // namespace
}  // namespace metastable::reports
