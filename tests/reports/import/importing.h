#pragma once
// Holds what the tests of `metastable import` share: an experiment that is known, and whether another one is the same.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "analysis/experiment/experiment.h"
#include "tests/analysis/same_trials.h"
#include "tests/reports/program.h"
#include "tests/reports/support.h"

namespace metastable::reports::test {

using analysis::Experiment;
using analysis::MeasuredCollision;
using analysis::MeasuredTrial;
using Words = std::vector<std::string>;

/// It has two conditions, one trial whose foot turned back, and speeds that are not known.
inline constexpr const char* known_toml = R"(title = "Known"
[wheel]
hub_mass_kg = 1.39
leg_lengths_m = [0.15, 0.15, 0.15, 0.15, 0.15, 0.15, 0.15, 0.15]
[contact]
law = "coulomb"
restitution = { mean = 0.4, sd = 0.1 }
friction = { mean = 0.4, sd = 0.05 }
[[condition]]
id = "fast"
slope_deg = 9.59
ramp_length_m = 3.66
[[condition]]
id = "slow, again"
slope_deg = 9.59
ramp_length_m = 3.66
)";
inline constexpr const char* known_collisions =
    "condition,trial,collision,leg,time_s,position_m,omega_minus_rad_s,omega_plus_rad_s\n"
    "fast,1,1,0,0,0,5.81237,4.7311\n"
    "fast,1,2,1,0.1912,0.1161,5.7001,4.61\n"
    "fast,1,3,2,0.3825,0.2326,5.6,4.5001\n"
    "\"slow, again\",2,1,3,0,0,4.43,\n"
    "fast,4,1,0,0,0,5.91,4.8\n"
    "fast,4,2,1,0.2,0.1162,3.2,-0.25\n";
inline constexpr const char* known_trials =
    "condition,trial,outcome\nfast,1,max_collisions\n\"slow, again\",2,rest\nfast,4,rest\n";

class Import : public InFolder {
 protected:
  void SetUp() override {
    InFolder::SetUp();
    std::filesystem::create_directory(folder_ / "known");
    file("known/experiment.toml", known_toml);
    file("known/collisions.csv", known_collisions);
    file("known/trials.csv", known_trials);
    known_ = analysis::read_experiment(folder_ / "known");
  }

  Ran import(Words more) const {
    std::filesystem::remove_all(folder_ / "out");
    Words words{"import"};
    words.insert(words.end(), more.begin(), more.end());
    words.insert(words.end(), {"--out", path("out")});
    if (std::ranges::find(words, "--slope") == words.end() && std::ranges::find(words, "--legs") == words.end())
      words.insert(words.end(), {"--description", path("known/experiment.toml")});
    return metastable(words);
  }

  // The experiment that was imported is the known one, numbers to a relative `close`.
  void expect_same(const Ran& ran, double close = 0) const {
    ASSERT_EQ(ran.code, 0) << ran.err;
    const Experiment read = analysis::read_experiment(folder_ / "out");
    metastable::test::expect_same_trials(read, known_, close);
  }

  void expect_refused(const Ran& ran, const std::string& said) const {
    EXPECT_EQ(ran.code, 2) << said;
    EXPECT_EQ(ran.out, "");
    EXPECT_EQ(ran.err, "metastable: " + said + "\n");
    EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));
  }

  // Writes degrees, from leg 1, with other names, an outcome by number, rows of the trials mixed, and a column of
  // no use.
  std::string long_csv() const {
    std::string rows[3];
    for (const MeasuredTrial& trial : known_.trials)
      for (const MeasuredCollision& c : trial.collisions)
        rows[c.number - 1] +=
            fmt::format("{};\"{}\";{};{};{};{};{};ok\n", trial.number, known_.conditions[trial.condition].id,
                        c.number - 1, *c.leg + 1, c.omega_minus * 180 / std::numbers::pi,
                        c.omega_plus ? fmt::format("{}", *c.omega_plus * 180 / std::numbers::pi) : "NaN",
                        trial.outcome == dynamics::Outcome::rest ? 1 : 0);
    std::string text = "run;start;k;foot;w before [deg/s];w_after;stopped;remark\n";
    return file("long.csv", text + rows[0] + rows[1] + rows[2]);
  }

  // Leaves it as `known`, but for times and positions.
  void forget_course() {
    for (MeasuredTrial& trial : known_.trials)
      for (MeasuredCollision& c : trial.collisions) c.time = c.position = std::nullopt;
  }

  Experiment known_;
};

}  // namespace metastable::reports::test
