// Recordings of simulated trials are spoilt in the ways of trackers and exports, and mended or refused; what is mended
// gives the collisions of the trial.

#include "analysis/motion_capture/angle_mending.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include "analysis/experiment/experiment_folder.h"
#include "analysis/experiment/input_error.h"
#include "analysis/motion_capture/collision_comparison.h"
#include "analysis/motion_capture/collision_finder.h"
#include "analysis/statistics/random.h"
#include "tests/analysis/settings.h"

namespace metastable::analysis {
namespace {

using Spoil = std::function<void(AngleRecording&)>;

class AngleMending : public testing::Test {
 protected:
  AngleMending() {
    setting_.law = dynamics::Law::coulomb;
    setting_.restitution = {0.4, 0.03}, setting_.friction = {0.4, 0.03};
    trials_ = simulate_trials(setting_, {.trials = 4, .collisions = 10, .seed = 5});
    known_ = parse_experiment(source_of(experiment_files(setting_, trials_, "t", {}), ""));
  }

  std::vector<MeasuredAngle> filmed(double rate, const Spoil& spoil) const {
    std::vector<MeasuredAngle> angles;
    for (std::size_t t = 0; t < trials_.size(); ++t) {
      angles.push_back({static_cast<int>(t) + 1, 0,
                        record_angle(setting_.map(), trials_[t],
                                     {.rate = rate, .noise_sd_rad = 0.0002, .seed = 5, .threads = 1}, t)});
      spoil(angles.back().recording);
    }
    return angles;
  }

  // Expects every collision to be found after what is said, and no other, with speeds as good as unspoilt ones.
  void expect_mended(double rate, const Spoil& spoil, const std::string& sentence, double sd = 0.02) const {
    const MendedAngles mended = mend_angles(filmed(rate, spoil), known_, "angle.csv");
    // The moment of a release may be taken out as a frame off the motion around it: that is said, and does no harm.
    ASSERT_LE(mended.said.size(), 1u);
    ASSERT_TRUE(sentence.empty() || !mended.said.empty()) << sentence;
    EXPECT_TRUE(sentence.empty() || mended.said.front().find(sentence) != std::string::npos) << mended.said.front();
    std::vector<FoundTrial> found;
    for (const MeasuredAngle& angle : mended.angles)
      found.push_back(find_collisions(angle.recording, setting_.map(), 0, {.collisions = 10}));
    const CollisionComparison c = compare_collisions(known_, mended.angles, found, false, 10);
    EXPECT_EQ(c.found, c.due) << rate << sentence;
    EXPECT_EQ(c.others, 0u) << rate << sentence;
    EXPECT_LT(c.written.sd, sd) << rate << sentence;
  }

  std::string refusal(double rate, const Spoil& spoil) const {
    try {
      mend_angles(filmed(rate, spoil), known_, "angle.csv");
    } catch (const InputError& error) {
      return error.lines().front();
    }
    return "";
  }

  Setting setting_ = paper_setting(9.59, false);
  std::vector<dynamics::Trial> trials_;
  Experiment known_;
};

void scale(AngleRecording& r, double by) {
  for (double& angle : r.angle_rad) angle *= by;
}

// Says which frames are spoilt: a share of them, none beside another.
bool chosen(std::size_t i, double share) { return i > 5 && i % 11 == 4 && uniform_at(7, i, 0, 0) < 11 * share; }

TEST_F(AngleMending, LeavesWhatIsRight) {
  for (const double rate : {60.0, 120.0, 240.0, 1000.0}) {
    const std::vector<MeasuredAngle> angles = filmed(rate, [](AngleRecording&) {});
    const MendedAngles mended = mend_angles(angles, known_, "angle.csv");
    EXPECT_TRUE(mended.said.empty()) << rate << mended.said.front();
    for (std::size_t t = 0; t < angles.size(); ++t) {
      EXPECT_EQ(mended.angles[t].recording.angle_rad, angles[t].recording.angle_rad);
      EXPECT_EQ(mended.angles[t].recording.time, angles[t].recording.time);
    }
  }
}

TEST_F(AngleMending, UnwrapsAndTurns) {
  const auto wrap = [](double low, double period) {
    return [=](AngleRecording& r) {
      for (double& angle : r.angle_rad) angle -= period * std::floor((angle - low) / period);
    };
  };
  constexpr double pi = std::numbers::pi;
  for (const double rate : {60.0, 240.0}) {
    expect_mended(rate, wrap(-pi, 2 * pi), "is wrapped every 6.283 rad");
    expect_mended(rate, wrap(0, 2 * pi), "is wrapped every 6.283 rad");
    expect_mended(rate, wrap(0, pi), "is wrapped every 3.142 rad");
    expect_mended(rate, wrap(0, pi / 4), "is wrapped every 0.7854 rad");
    expect_mended(
        rate, [](AngleRecording& r) { scale(r, -1); }, "its sign was turned");
  }
}

TEST_F(AngleMending, SuspectsOtherUnits) {
  const auto in_degrees = [](AngleRecording& r) { scale(r, 180 / std::numbers::pi); };
  EXPECT_NE(refusal(120, in_degrees).find("degrees are suspected"), std::string::npos) << refusal(120, in_degrees);
  const auto wrapped = [&](AngleRecording& r) {
    in_degrees(r);
    for (double& angle : r.angle_rad) angle -= 360 * std::floor(angle / 360);
  };
  EXPECT_NE(refusal(120, wrapped).find("degrees are suspected"), std::string::npos) << refusal(120, wrapped);
  const auto in_turns = [](AngleRecording& r) { scale(r, 0.5 / std::numbers::pi); };
  EXPECT_NE(refusal(120, in_turns).find("revolutions are suspected"), std::string::npos) << refusal(120, in_turns);
}

TEST_F(AngleMending, MendsFrames) {
  for (const double rate : {60.0, 120.0, 240.0, 1000.0}) {
    expect_mended(
        rate,
        [](AngleRecording& r) {
          for (std::size_t i = 1; i + 1 < r.angle_rad.size(); ++i)
            if (chosen(i, 0.01)) r.angle_rad[i] = r.angle_rad[i - 1];
        },
        "repeat the one before", 0.05);
    expect_mended(
        rate,
        [](AngleRecording& r) {
          for (std::size_t i = 1; i + 1 < r.angle_rad.size(); ++i)
            if (chosen(i, 0.01)) r.angle_rad[i] += 0.5 * std::sin(static_cast<double>(i));
        },
        "lie off the motion of their neighbours", 0.05);
    expect_mended(
        rate,
        [](AngleRecording& r) {
          r.angle_rad.insert(r.angle_rad.begin() + 20, r.angle_rad[19]);
          r.time.push_back(r.time.back() + (r.time[1] - r.time[0]));
        },
        "pushed in", 0.05);
    expect_mended(
        rate,
        [](AngleRecording& r) {
          r.angle_rad.erase(r.angle_rad.begin() + 20);
          r.time.pop_back();
        },
        "are left out", rate < 100 ? 0.2 : 0.02);  // at 60 Hz a gap in the frames of a collision is not told from it
  }
}

// Noise made gaps: at 5 mrad frames were "left out" in most trials, and omega_minus moved by up to 1.5 rad/s.
TEST_F(AngleMending, TakesNoNoiseForAGap) {
  for (const double rate : {60.0, 120.0, 240.0, 1000.0})
    for (const double noise : {0.001, 0.003, 0.005}) {
      std::vector<MeasuredAngle> angles;
      for (std::size_t t = 0; t < trials_.size(); ++t)
        angles.push_back({static_cast<int>(t) + 1, 0,
                          record_angle(setting_.map(), trials_[t],
                                       {.rate = rate, .noise_sd_rad = noise, .seed = 6, .threads = 1}, t)});
      for (const std::string& sentence : mend_angles(angles, known_, "angle.csv").said)
        EXPECT_EQ(sentence.find("left out"), std::string::npos) << rate << " Hz, " << noise << ": " << sentence;
    }
}

// Smoothing rings where a wheel is let go at speed: the first peak was taken for a collision.
TEST_F(AngleMending, TakesNoReleaseForACollision) {
  for (const double rate : {60.0, 120.0, 1000.0})
    expect_mended(
        rate,
        [rate](AngleRecording& r) {
          const auto held = static_cast<std::size_t>(0.5 * rate);
          std::vector<double> time;
          for (std::size_t k = 0; k < held; ++k) time.push_back(r.time.front() - static_cast<double>(held - k) / rate);
          r.time.insert(r.time.begin(), time.begin(), time.end());
          r.angle_rad.insert(r.angle_rad.begin(), held, r.angle_rad.front());
        },
        "");
}

TEST_F(AngleMending, RefusesWhatNobodyCanMend) {
  const auto jump = [](AngleRecording& r) {
    for (std::size_t i = 40; i < r.angle_rad.size(); ++i) r.angle_rad[i] += 1.1;
  };
  EXPECT_NE(refusal(120, jump).find("angle.csv: trial 1: at "), std::string::npos) << refusal(120, jump);
  EXPECT_NE(refusal(120, jump).find("the angle jumps by 1.1"), std::string::npos) << refusal(120, jump);
  const auto stuck = [](AngleRecording& r) {
    for (std::size_t i = 41; i < 60; ++i) r.angle_rad[i] = r.angle_rad[40];
  };
  EXPECT_NE(refusal(120, stuck).find("the angle stays the same for 20 frames"), std::string::npos)
      << refusal(120, stuck);
}

TEST_F(AngleMending, TakesRoundedTimesForEvenOnes) {
  expect_mended(
      240,
      [](AngleRecording& r) {
        for (double& time : r.time) time = std::round(1000 * time) / 1000;
      },
      "rounded to their last digit");
}

}  // namespace
}  // namespace metastable::analysis
