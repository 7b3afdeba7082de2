// Random settings within range go under every law and method: each gets an answer that holds together, and every
// fiftieth is judged by direct simulation. The suite takes the first 40; METASTABLE_SETTINGS=10000
// METASTABLE_FIRST_SETTING=0 is the long run. One in twenty may be refused by a solver with its sentence; a
// contradiction or a wrong number may not be.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <iterator>
#include <random>
#include <stdexcept>
#include <string>

#include "analysis/study/consistency.h"
#include "analysis/study/metastability.h"
#include "dynamics/return_map/trials.h"
#include "tests/environment.h"

namespace metastable::analysis {
namespace {

constexpr std::uint64_t usual_count = 40;
constexpr int trials = 4000;

struct Drawn {
  Setting setting;
  StudyOptions options;
};

// Every fiftieth is judged, and those under `settled`: few, as their landings are followed one by one for half a minute
// a setting.
constexpr std::uint64_t settled_every = 200;
bool settled(std::uint64_t index) { return index % settled_every == settled_every - 1; }
bool judged(std::uint64_t index) { return index % 50 == 0 || settled(index); }

Drawn draw(std::uint64_t index) {
  std::mt19937_64 bits(index);
  const auto uniform = [&](double from, double to) {
    return from + (to - from) * (static_cast<double>(bits() >> 11) + 0.5) * 0x1p-53;
  };
  const auto spread = [&](double lower, double upper, double widest) {
    const double mean = uniform(lower, upper), sd = uniform(0, widest);
    return Spread{mean, uniform(0, 1) < 0.15 ? 0 : sd};
  };
  Drawn drawn;
  Setting& setting = drawn.setting;
  constexpr dynamics::Law laws[] = {dynamics::Law::published, dynamics::Law::coulomb, dynamics::Law::plastic};
  setting.law = laws[index % std::size(laws)];
  if (settled(index)) setting.law = dynamics::Law::settled;
  setting.slope_deg = uniform(0.1, 20);
  setting.restitution = spread(0.05, 0.95, 0.3);
  setting.friction = spread(0, 1, 0.3);
  setting.initial_speed = uniform(0, 1) < 0.5 ? spread(0, 100, 3) : spread(0, 10, 1);
  if (uniform(0, 1) < 0.9) setting.wheel.leg_length.assign(8, uniform(0.05, 1));
  drawn.options.method = uniform(0, 1) < 0.5 ? Method::sampled : Method::integrated;
  // Rows by quadrature over two random quantities take half a minute a setting, and eight different legs minutes.
  const bool costly = setting.law == dynamics::Law::coulomb && setting.restitution.sd > 0 && setting.friction.sd > 0;
  if (costly && (index % 32 != 0 || !setting.wheel.equal_legs())) drawn.options.method = Method::sampled;
  if (settled(index)) {  // one leg and speeds that a table holds
    setting.wheel.leg_length.assign(8, setting.wheel.leg_length[0]);
    setting.initial_speed.mean /= 10;
  }
  drawn.options.tolerance = 0.05;
  drawn.options.brief = true;
  drawn.options.threads = 1;
  // It is as coarse as an answer allows where what is asked is whether it holds together.
  if (judged(index)) {
    drawn.options.largest_cells = 512;
    drawn.options.largest_samples = 1u << 14;
  } else if (drawn.options.method == Method::sampled) {
    drawn.options.cells = 128;
    drawn.options.samples = 2048;
    drawn.options.replicates = 4;
  } else {
    drawn.options.largest_cells = 128;
  }
  return drawn;
}

std::string name(std::uint64_t index, const Drawn& drawn) {
  return fmt::format("{}: {}, {}", index, drawn.setting.describe(), method_name(drawn.options.method));
}

// Follows wheel `i` of direct simulation for `most` steps.
using Follow = std::function<std::uint64_t(std::uint64_t i, std::uint64_t most)>;

Follow simulation(const Setting& setting) {
  constexpr std::uint64_t seed = 2024;
  const int leg = setting.first_landing_leg;
  if (setting.law == dynamics::Law::settled)
    return [=, motion = setting.motion(), noise = setting.noise(), launch = setting.launch()](auto i, auto most) {
      return dynamics::steps_to_rest(motion, noise, launch, leg, seed, i, most);
    };
  return [=, map = setting.map(), launch = setting.launch()](auto i, auto most) {
    return dynamics::steps_to_rest(map, launch, leg, seed, i, most);
  };
}

// Compares steps, no more than are shown of survival: a number that every law has, rolling for ever or not. The chain's
// may be off by what the study says of landings read from a table, and of what its states leave out.
void judge(const Setting& setting, const Metastability& study, double tolerance) {
  const Follow follow = simulation(setting);
  const std::size_t most = std::min<std::size_t>(study.steps.survival.size(), 64);
  double expected = 0, sum = 0, square = 0;
  for (std::size_t n = 0; n < most; ++n) expected += study.steps.survival[n];
  for (std::uint64_t i = 0; i < trials; ++i) {
    const auto steps = static_cast<double>(follow(i, most));
    sum += steps;
    square += steps * steps;
  }
  const double mean = sum / trials, error = std::sqrt(std::max(0.0, square / trials - mean * mean) / trials);
  const double slack = 5 * error + tolerance * mean;
  const double table = study.steps.landing_error;
  const Estimate& memory = study.steps.memory;
  EXPECT_LE(expected * std::exp(std::min(0.0, memory.lower) - table), mean + slack)
      << "of " << most << " steps at most";
  EXPECT_GE(expected * std::exp(std::max(0.0, memory.upper) + table), mean - slack)
      << "of " << most << " steps at most";
}

TEST(RandomSettings, AreAllAnsweredAndAgreeWithSimulation) {
  const std::uint64_t first = from_environment("METASTABLE_FIRST_SETTING", 0),
                      count = from_environment("METASTABLE_SETTINGS", usual_count);
  std::uint64_t refused = 0;  // with a sentence and exit code 3, instead of a number
  for (std::uint64_t index = first; index < first + count; ++index) {
    const Drawn drawn = draw(index);
    SCOPED_TRACE(name(index, drawn));
    try {
      const Metastability result = study(drawn.setting.problem(), drawn.options);
      EXPECT_GE(result.steps.from_start.value, 1 - 1e-9);
      if (judged(index) && result.status != Status::rest_unresolved)
        judge(drawn.setting, result, 2 * drawn.options.tolerance);
    } catch (const Contradiction& contradiction) {
      ADD_FAILURE() << contradiction.what();
    } catch (const markov::ConvergenceError& error) {
      ++refused;
      fmt::print("refused: {}: {}\n", name(index, drawn), error.what());
    } catch (const std::exception& error) {
      ADD_FAILURE() << error.what();
    }
  }
  EXPECT_LE(refused, count / 20);
}

}  // namespace
}  // namespace metastable::analysis
