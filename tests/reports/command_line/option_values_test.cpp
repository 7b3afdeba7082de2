#include "reports/command_line/option_values.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <functional>
#include <stdexcept>
#include <string>

#include "dynamics/catalogue/effect_catalogue.h"
#include "tests/message_of.h"

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
    return message_of([&] { catalogue_value("catalogue", text); });
  };
  EXPECT_EQ(message("list.txt"), "--catalogue: list.txt: no such file, nor a list of effects");
  EXPECT_EQ(message("bounce+air_drag+inertia"), "--catalogue: \"bounce+air_drag+inertia\" has more than two effects");
  EXPECT_NE(message("bounce+wind").find("'wind' is none of"), std::string::npos);
}

TEST(OptionValues, ANumberOutOfRangeIsToldTheRangeAndATextThatItIsNone) {
  const auto whole = [](const std::string& text) {
    return message_of([&] { whole_value("samples", text, 16, 1u << 24); });
  };
  for (const std::string text : {"16", "+16", " 99 ", "16777216", "1e6", "100.0"})
    EXPECT_EQ(whole(text), "nothing was thrown") << text;
  EXPECT_EQ(whole_value("samples", "1e6", 16, 1u << 24), 1000000u);
  for (const std::string text : {"3", "-3", "0", "15", "16777217", "1e300", "99999999999999999999", "inf"})
    EXPECT_EQ(whole(text), "--samples: " + text + " is outside 16..16777216");
  for (const std::string text : {"x", "", "2.5", "3,5", "nan", "0x10", "16 17", "--json"})
    EXPECT_EQ(whole(text), "--samples: '" + text + "' is not a whole number in 16..16777216");
  EXPECT_EQ(whole_value("seed", "18446744073709551615", 0, UINT64_MAX), UINT64_MAX);
  EXPECT_EQ(message_of([] { whole_value("seed", "18446744073709551616", 0, UINT64_MAX); }),
            "--seed: 18446744073709551616 is outside 0..18446744073709551615");

  const auto number = [](const std::string& text) {
    return message_of([&] { number_value("mass", text, {.low = 1, .high = 2}); });
  };
  EXPECT_EQ(number("1e999"), "--mass: inf is outside [1, 2]");
  EXPECT_EQ(number("-1e999"), "--mass: -inf is outside [1, 2]");
  EXPECT_EQ(number("1e-999"), "--mass: 0 is outside [1, 2]");
  EXPECT_EQ(number("2.5"), "--mass: 2.5 is outside [1, 2]");
  EXPECT_EQ(number("nan"), "--mass: 'nan' is not a number");
  EXPECT_EQ(number("1.5 kg"), "--mass: '1.5 kg' is not a number");
  EXPECT_EQ(message_of([] { spread_value("friction", "0.4,1e999", {.low = 0, .high = 10}); }),
            "--friction: sd inf is outside [0, 10]");
}

}  // namespace
}  // namespace metastable::reports
