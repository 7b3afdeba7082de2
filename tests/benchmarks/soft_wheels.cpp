// Wheels in an engine of soft contact: writes experiment folders for `metastable diagnose` and, apart, what was in
// each.
//
//   soft_wheels make RUN SEED [FIRST [LAST]]   folders RUN/case-01 to case-36; truths in RUN-sealed/case-NN.json
//   soft_wheels none DIR SEED STIFFNESS        one folder without an effect, for the nominal numbers and visible sizes
//   soft_wheels steps SEED CASE TRIALS         collisions and rests of new trials of a case's machine
//
// A trial rolls until rest or the ramp's end. soft_wheels.py has the folders answered and grades the answers.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <fstream>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/benchmarks/soft_wheel.h"

namespace {

using namespace soft_wheels;

constexpr int trials_each = 20, cases = 36, most_collisions = 40;
constexpr double ramp_length = 3.66;
const Ramp ramps[] = {
    {"fast-9.59", 9.59, 7.05, 0.19}, {"slow-9.59", 9.59, 6.03, 0.28}, {"fast-7.02", 7.02, 7.90, 0.10}};

// Sizes that such an experiment sees with 2 Delta log likelihood 16, as `visibility` says in the answer to
// `soft_wheels none` with seed 9001 and 8e5 N/m.
namespace visible {
constexpr double leg_friction = 0.05, leg_length = 1e-3, slope_offset = 0.065, sag = 8e-4, torque = 0.0019,
                 viscous_drag = 5.6e-4, drift = 0.056, memory = 0.21;
}  // namespace visible

struct Case {
  Machine machine;
  std::string kind, truth;  // truth: members of a JSON array of effects
};

class Draws {
 public:
  explicit Draws(std::uint64_t seed) : random_(seed) {}
  double uniform(double from, double to) { return std::uniform_real_distribution<double>(from, to)(random_); }
  double sign() { return uniform(0, 1) < 0.5 ? -1 : 1; }
  int leg() { return std::uniform_int_distribution<int>(0, legs - 1)(random_); }

 private:
  std::mt19937_64 random_;
};

// Puts an effect of `times` the visible size into a case.
void add(Case& to, const std::string& effect, double times, Draws& draws) {
  Machine& m = to.machine;
  const int leg = draws.leg();
  const auto k = static_cast<std::size_t>(leg);
  // Large effects on friction raise it: nearly all trials would end at once with those that lower it.
  const double drawn = draws.sign(), signed_times = drawn * times, raising = times > 2 ? times : signed_times;
  std::string parameters;
  const auto said = [&](const char* name, double value) {
    char text[80];
    std::snprintf(text, sizeof text, "%s\"%s\": %.6g", parameters.empty() ? "" : ", ", name, value);
    parameters += text;
  };
  if (effect == "leg_contact" || effect == "leg_restitution") {
    said("leg", leg);
    if (effect == "leg_contact")
      said("friction_ratio", m.friction_ratio[k] = 1 + raising * visible::leg_friction);
    else
      said("restitution_ratio", m.restitution_ratio[k] = times);
  } else if (effect == "leg_lengths") {
    m.leg_length[k] += signed_times * visible::leg_length;
    said("leg", leg), said("added_m", signed_times * visible::leg_length);
  } else if (effect == "slope_offset")
    said("offset_deg", m.slope_offset = signed_times * visible::slope_offset);
  else if (effect == "slope_profile")
    said("sag_m", m.sag = signed_times * visible::sag);
  else if (effect == "rolling_resistance")
    said("torque_n_m", m.torque = times * visible::torque);
  else if (effect == "axle_drag_viscous")
    said("n_m_s", m.viscous_drag = times * visible::viscous_drag);
  else if (effect == "trial_drift")
    said("relative_change", m.drift = raising * visible::drift);
  else if (effect == "contact_memory")
    said("correlation", m.memory = std::min(0.8, times * visible::memory));
  else if (effect == "loose_weight")
    said("kg", m.loose_mass = 0.06);
  else if (effect == "yielding_ramp")
    said("m_n", m.ramp_compliance = 3e-6);
  else if (effect == "magnet")
    said("n", m.magnet = 3);
  else if (effect == "gust")
    said("n", m.gust = 0.3);
  else
    throw std::invalid_argument("effect " + effect + ": unknown");
  to.truth +=
      (to.truth.empty() ? "" : ", ") + ("{\"effect\": \"" + (effect == "leg_restitution" ? "leg_contact" : effect) +
                                        "\", \"parameters\": {" + parameters + "}}");
}

struct Planned {
  const char *kind, *first, *second;
  double times;
};
// leg_restitution: `times` is the ratio itself, far from 1.
constexpr Planned plan[cases] = {{"none", "", "", 0},
                                 {"none", "", "", 0},
                                 {"none", "", "", 0},
                                 {"none", "", "", 0},
                                 {"none", "", "", 0},
                                 {"none", "", "", 0},
                                 {"one", "leg_contact", "", 2},
                                 {"one", "leg_contact", "", 4},
                                 {"one", "leg_contact", "", 4},
                                 {"restitution", "leg_restitution", "", 0.35},
                                 {"restitution", "leg_restitution", "", 0.6},
                                 {"restitution", "leg_restitution", "", 1.6},
                                 {"restitution", "leg_restitution", "", 2},
                                 {"one", "slope_offset", "", 2},
                                 {"one", "slope_offset", "", 4},
                                 {"one", "rolling_resistance", "", 2},
                                 {"one", "rolling_resistance", "", 4},
                                 {"one", "leg_lengths", "", 2},
                                 {"one", "leg_lengths", "", 4},
                                 {"one", "slope_profile", "", 2},
                                 {"one", "slope_profile", "", 4},
                                 {"one", "axle_drag_viscous", "", 2},
                                 {"one", "axle_drag_viscous", "", 4},
                                 {"one", "trial_drift", "", 2},
                                 {"one", "trial_drift", "", 4},
                                 {"one", "contact_memory", "", 2},
                                 {"one", "contact_memory", "", 4},
                                 {"two", "leg_contact", "slope_offset", 4},
                                 {"two", "leg_lengths", "trial_drift", 4},
                                 {"two", "slope_profile", "leg_contact", 4},
                                 {"two", "rolling_resistance", "contact_memory", 4},
                                 {"two", "axle_drag_viscous", "trial_drift", 4},
                                 {"outside", "loose_weight", "", 1},
                                 {"outside", "yielding_ramp", "", 1},
                                 {"outside", "magnet", "", 1},
                                 {"outside", "gust", "", 1}};

Machine nominal() {
  Machine m;
  m.friction = 0.39, m.friction_sd = 0.035;
  return m;
}

std::uint64_t mixed(std::uint64_t seed, std::uint64_t stream) { return seed * 1000003ULL + stream * 7919ULL; }

Case planned(std::uint64_t seed, int number) {
  const Planned& p = plan[number - 1];
  Case c{nominal(), p.kind, ""};
  Draws draws(mixed(seed, static_cast<std::uint64_t>(number)));
  c.machine.stiffness = std::exp(draws.uniform(std::log(3e5), std::log(1e7)));
  for (const char* effect : {p.first, p.second})
    if (*effect != '\0') add(c, effect, p.times, draws);
  return c;
}

void write_toml(const std::filesystem::path& at) {
  const Machine m = nominal();
  std::ofstream out(at);
  out << "title = \"Rimless wheel on two ramps\"\n[wheel]\nhub_mass_kg = " << m.mass << "\nleg_lengths_m = [";
  for (int k = 0; k < legs; ++k) out << (k ? ", " : "") << m.leg_length[static_cast<std::size_t>(k)];
  out << "]\nradius_of_gyration_m = " << std::sqrt(m.hub_inertia / m.mass) << "\ntip_radius_m = " << m.tip_radius
      << "\n[contact]\nlaw = \"settled\"\nrestitution = { mean = " << m.restitution << ", sd = " << m.restitution_sd
      << " }\nfriction = { mean = " << m.friction << ", sd = " << m.friction_sd << " }\n";
  for (const Ramp& ramp : ramps)
    out << "[[condition]]\nid = \"" << ramp.id << "\"\nslope_deg = " << ramp.slope_deg
        << "\nramp_length_m = " << ramp_length << "\nfirst_landing_leg = 1\n";
}

void write_folder(const Machine& machine, const std::filesystem::path& folder, std::uint64_t seed) {
  std::filesystem::create_directories(folder);
  write_toml(folder / "experiment.toml");
  std::ofstream collisions(folder / "collisions.csv"), trials(folder / "trials.csv");
  collisions << "condition,trial,collision,leg,time_s,position_m,omega_minus_rad_s,omega_plus_rad_s\n";
  trials << "condition,trial,outcome\n";
  int number = 0;
  for (const Ramp& ramp : ramps)
    for (int i = 0; i < trials_each; ++i, ++number) {
      const Trial trial = roll(machine, ramp, number, static_cast<int>(std::size(ramps)) * trials_each, ramp_length,
                               most_collisions, seed + static_cast<std::uint64_t>(number));
      int collision = 0;
      for (const Landing& l : trial.landings) {
        char text[160], after[24] = "";
        if (!std::isnan(l.after)) std::snprintf(after, sizeof after, "%.6f", std::max(0.0, l.after));
        std::snprintf(text, sizeof text, "%s,%d,%d,%d,%.6f,%.6f,%.6f,%s\n", ramp.id.c_str(), number + 1, ++collision,
                      l.leg, l.time, l.position, std::max(0.0, l.before), after);
        collisions << text;
      }
      trials << ramp.id << ',' << number + 1 << ',' << trial.outcome << '\n' << std::flush;
    }
}

void make(const std::filesystem::path& run, std::uint64_t seed, int first, int last) {
  const std::filesystem::path sealed = run.string() + "-sealed";
  std::filesystem::create_directories(sealed);
  for (int number = first; number <= last; ++number) {
    char name[16];
    std::snprintf(name, sizeof name, "case-%02d", number);
    const Case c = planned(seed, number);
    std::ofstream(sealed / (std::string(name) + ".json"))
        << "{\"kind\": \"" << c.kind << "\", \"seed\": " << seed << ", \"times\": " << plan[number - 1].times
        << ", \"stiffness_n_m\": " << c.machine.stiffness << ", \"effects\": [" << c.truth << "]}\n";
    // Named when whole, so that answering may begin beside it.
    write_folder(c.machine, run / (std::string(name) + ".part"),
                 mixed(seed, 1000 + static_cast<std::uint64_t>(number)));
    std::filesystem::rename(run / (std::string(name) + ".part"), run / name);
    std::printf("%s\n", name);
    std::fflush(stdout);
  }
}

void steps(std::uint64_t seed, int number, int trials) {
  const Case c = planned(seed, number);
  long collisions = 0, rests = 0;
  for (int i = 0; i < trials; ++i) {
    const Trial trial = roll(c.machine, ramps[i % std::size(ramps)], i, trials, ramp_length, most_collisions,
                             mixed(seed, 5000 + static_cast<std::uint64_t>(number)) + static_cast<std::uint64_t>(i));
    collisions += static_cast<long>(trial.landings.size());
    rests += trial.outcome == "rest" ? 1 : 0;
  }
  std::printf("case-%02d,%ld,%ld\n", number, collisions, rests);
}

}  // namespace

int main(int count, char** word) {
  const auto number = [&](int i, double otherwise) { return i < count ? std::strtod(word[i], nullptr) : otherwise; };
  const std::string action = count > 1 ? word[1] : "";
  try {
    if (action == "make" && count >= 4)
      make(word[2], static_cast<std::uint64_t>(number(3, 1)), static_cast<int>(number(4, 1)),
           static_cast<int>(number(5, cases)));
    else if (action == "none" && count == 5) {
      Machine machine = nominal();
      machine.stiffness = number(4, 3e6);
      write_folder(machine, word[2], mixed(static_cast<std::uint64_t>(number(3, 1)), 0));
    } else if (action == "steps" && count == 5)
      steps(static_cast<std::uint64_t>(number(2, 1)), static_cast<int>(number(3, 1)), static_cast<int>(number(4, 1)));
    else {
      std::fprintf(stderr,
                   "soft_wheels make RUN SEED [FIRST [LAST]] | none DIR SEED STIFFNESS | steps SEED CASE TRIALS\n");
      return 2;
    }
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s\n", e.what());
    return 1;
  }
}
