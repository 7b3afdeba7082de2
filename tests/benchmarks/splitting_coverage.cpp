// Counts how often the intervals of splitting hold the known answer, and how many steps of the map they take beside
// direct simulation with the same interval.
//   splitting_coverage [seeds] [first setting] [settings] [first seed] [mesh]
// With the last word ensembles are split by a mesh's level, else by one that is learnt.

#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <ctime>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "analysis/study/setting.h"
#include "analysis/walkers/walker_study.h"
#include "markov/normal_95.h"
#include "markov/splitting/splitting_study.h"
#include "tests/benchmarks/coverage.h"
#include "tests/markov/mesh/maps.h"

namespace {

using namespace metastable;

struct Tried {
  std::string name;
  markov::BatchMap map;
  std::vector<double> start;
  double steps, relative_error = 0;  ///< known, and its standard error
};

Tried walker(const std::string& name, analysis::Walker kind, double sd_deg, dynamics::Terrain terrain, double steps,
             double error) {
  auto [map, start] = walker_in_gait(kind, sd_deg, terrain);
  return {name, std::move(map), std::move(start), steps, error};
}

/// Maps d numbers of unit variance, each x' = a x + z with an a of its own; it fails where one passes the threshold.
Tried many(int d, double threshold, double steps) {
  Tried tried{fmt::format("{} dimensions, threshold {}", d, threshold),
              {},
              std::vector<double>(static_cast<std::size_t>(d), 0.0),
              steps};
  tried.map.dimension = tried.map.scores = d;
  tried.map.step = [d, threshold](int, auto states, auto scores, auto next, auto failed) {
    for (std::size_t i = 0; i < failed.size(); ++i)
      for (int k = 0; k < d; ++k) {
        const std::size_t at = i * static_cast<std::size_t>(d) + static_cast<std::size_t>(k);
        next[at] = (0.3 + 0.5 * k / d) * states[at] + scores[at] * std::sqrt(1 - std::pow(0.3 + 0.5 * k / d, 2));
        if (next[at] > threshold) failed[i] = 1;
      }
  };
  return tried;
}

/// Takes the paper's wheel on 9.59 deg from 5.83 rad/s, by the law `published`; its state is omega^2, its phases legs.
Tried wheel(double friction_mean, double friction_sd, double steps, double error) {
  analysis::Setting setting;
  setting.slope_deg = 9.59;
  setting.friction = {friction_mean, friction_sd};
  const markov::AnyReturnMap wheel = setting.problem().map;
  Tried tried{fmt::format("wheel, friction {} +- {}", friction_mean, friction_sd), {}, {5.83 * 5.83}, steps, error};
  tried.map.scores = wheel.noise_dimension();
  tried.map.phases = wheel.phases();
  tried.map.step = [wheel](int phase, auto states, auto scores, auto next, auto failed) {
    const std::size_t s = scores.size() / failed.size();
    for (std::size_t i = 0; i < failed.size(); ++i) {
      const std::optional<double> landing = wheel.landing(states[i], phase, scores.subspan(i * s, s));
      failed[i] = !landing;
      if (landing) next[i] = *landing;
    }
  };
  return tried;
}

std::vector<Tried> settings() {
  using namespace markov::testing;
  using analysis::Walker;
  using dynamics::Terrain;
  std::vector<Tried> all;
  for (const double sd : {1.5, 0.8, 0.4, 0.28})
    all.push_back({fmt::format("linear, sd {}", sd), linear_batch(sd), {2}, linear_steps(sd, 2)});
  all.push_back({"two dimensions, sd 0.4", skew_batch(0.4), {2, -2.0 / 3}, linear_steps(0.4, 2)});
  all.push_back(walker("simplest, 28", Walker::simplest, 0.0015 / analysis::degree, Terrain::fresh, 28.16, 0.0004));
  all.push_back(walker("simplest, 8.3e7", Walker::simplest, 0.0225, Terrain::fresh, 8.324e7, 0.001));
  all.push_back(walker("compass, 9.6e5", Walker::compass, 0.00368 / analysis::degree, Terrain::fresh, 9.59e5, 0.003));
  all.push_back(walker("facets, 69.3", Walker::compass, 0.004 / analysis::degree, Terrain::facets, 68.87, 0.0044));
  all.push_back(walker("facets, 132.4", Walker::compass, 0.0035 / analysis::degree, Terrain::facets, 132.0, 0.0083));
  // The product of the survivals of eight lines, each by Nystrom's method on 400 Gauss-Legendre nodes.
  all.push_back(many(8, 4.5, 37557.2));
  // metastable steps --law published --slope 9.59 --friction 0.3,0.05 --method integrated, and with 0.32,0.03
  all.push_back(wheel(0.3, 0.05, 44850, 0.001));
  all.push_back(wheel(0.32, 0.03, 1.40564e9, 5e-5));
  return all;
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<Tried> all = settings();
  const auto [seeds, first_seed, first, last] = asked(argc, argv, 10, all.size());
  const bool by_mesh = argc > 5 && std::string(argv[5]) == "mesh";
  for (std::size_t i = first; i < last; ++i) {
    const Tried& tried = all[i];
    int held = 0, refused = 0;
    double width = 0, off = 0, calls = 0, pilots = 0, lines = 0, gain = 0, mixing = 0;
    const std::clock_t begin = std::clock();
    for (int seed = first_seed; seed < first_seed + seeds; ++seed) {
      try {
        const markov::SplittingStudy study = markov::splitting_study(
            tried.map, tried.start, {.level_of_mesh = by_mesh, .seed = static_cast<std::uint64_t>(seed), .threads = 1});
        const double deviation = std::log(study.steps.value / tried.steps),
                     half = 0.5 * std::log(study.steps.upper / study.steps.lower);
        held += study.disagreement.empty() &&
                std::abs(deviation) <= std::hypot(half, markov::normal_95 * tried.relative_error);
        refused += !study.disagreement.empty();
        if (!study.disagreement.empty()) fmt::print("  seed {}: {}\n", seed, study.disagreement);
        width += half / seeds, off += deviation / seeds;
        calls += static_cast<double>(study.calls) / seeds, pilots += static_cast<double>(study.pilot_calls) / seeds;
        lines += study.lines / seeds, mixing += study.mixing_steps / seeds;
        gain += std::pow(markov::normal_95 / half, 2) * tried.steps / static_cast<double>(study.calls) / seeds;
      } catch (const std::exception& error) {
        ++refused;
        fmt::print("  seed {}: {}\n", seed, error.what());
      }
    }
    const double seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC / seeds;
    fmt::print(
        "{:<26} {:>10.5g}: held by {} of {}, refused {}; half-width {:.2g} %, mean deviation {:.2g} %; {:.3g} "
        "calls ({:.3g} pilots), {:.3g} times fewer than directly; lines {:.3g}, mixing {:.3g}; {:.3g} s of processor "
        "time\n",
        tried.name, tried.steps, held, seeds, refused, 100 * width, 100 * off, calls, pilots, gain, lines, mixing,
        seconds);
    std::fflush(stdout);
  }
}
