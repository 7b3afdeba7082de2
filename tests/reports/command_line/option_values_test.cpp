#include "reports/command_line/option_values.h"

#include <gtest/gtest.h>

#include <string>

#include "dynamics/catalogue/effect_catalogue.h"

namespace metastable::reports {
namespace {

// It is longer than a file's name may be: asking the file system about it once ended the program.
TEST(OptionValues, ACatalogueOfAllEffectsIsAList) {
  std::string all;
  for (const dynamics::EffectInfo& info : dynamics::effect_catalogue()) all += (all.empty() ? "" : ",") + info.id;
  EXPECT_GT(all.size(), 255u);
  EXPECT_EQ(catalogue_value("catalogue", all).size(), dynamics::effect_catalogue().size());
}

TEST(OptionValues, ACatalogueTakesPairsAndTellsAMissingFileFromAnUnknownEffect) {
  EXPECT_EQ(catalogue_value("catalogue", "bounce, trial_drift+bounce"),
            (std::vector<std::string>{"bounce", "trial_drift+bounce"}));
  const auto message = [](const std::string& text) -> std::string {
    try {
      catalogue_value("catalogue", text);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(message("list.txt"), "--catalogue: list.txt: no such file, nor a list of effects");
  EXPECT_EQ(message("bounce+air_drag+inertia"), "--catalogue: \"bounce+air_drag+inertia\" has more than two effects");
  EXPECT_NE(message("bounce+wind").find("'wind' is none of"), std::string::npos);
}

}  // namespace
}  // namespace metastable::reports
