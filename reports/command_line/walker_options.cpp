#include "reports/command_line/walker_options.h"

#include <fmt/format.h>

#include <stdexcept>

namespace metastable::reports {
namespace {

// What only the wheel and its chain know.
constexpr const char* of_the_wheel[] = {"initial-speed",
                                        "legs",
                                        "leg-count",
                                        "mass",
                                        "inertia",
                                        "radius-of-gyration",
                                        "tip-radius",
                                        "ramp-stiffness",
                                        "contact-mass",
                                        "gravity",
                                        "law",
                                        "rebound-lost",
                                        "restitution",
                                        "friction",
                                        "correlation",
                                        "contact-list",
                                        "ramp-length",
                                        "first-leg",
                                        "method",
                                        "cells",
                                        "samples",
                                        "tolerance",
                                        "sequence",
                                        "draws",
                                        "tail",
                                        "replicates",
                                        "mixing-distance",
                                        "eigenvalues",
                                        "slope-se",
                                        "restitution-se",
                                        "friction-se",
                                        "legs-se",
                                        "inertia-se",
                                        "radius-of-gyration-se",
                                        "ramp-stiffness-se",
                                        "contact-mass-se",
                                        "certify",
                                        "sensitivities",
                                        "explain"};

}  // namespace

void add_walker(Options& o) {
  o.add("walker", "simplest|compass", "",
        "A walker on two legs instead of the wheel (simplest: lengths in legs, times in sqrt(l/g))");
  o.add("slope-sd", "DEG", "", "With --walker: sd of the slope from step to step [deg], above 0");
  o.add(
      "terrain", "fresh|facets", "",
      "With --walker: a plane that tilts anew at every step (default), or facets, on the last of which the feet still "
      "stand when a step begins");
}

bool asks_for_walker(const Options& o) {
  if (o.given("walker")) return true;
  for (const char* name : {"slope-sd", "terrain"})
    if (o.given(name)) throw std::invalid_argument(fmt::format("--{}: has a meaning with --walker only", name));
  return false;
}

WalkerStepsRequest walker_steps_request(const Options& o, const std::string& command_line) {
  for (const char* name : of_the_wheel)
    if (o.has(name) && o.given(name))
      throw std::invalid_argument(fmt::format("--{}: has no meaning with --walker", name));
  WalkerStepsRequest request;
  request.setting.walker = analysis::walker_from_name(o.text("walker"));
  const bool simplest = request.setting.walker == analysis::Walker::simplest;
  request.setting.slope_deg = o.given("slope") ? o.number("slope") : simplest ? 0.5156620156 : 3;  // 0.009 rad
  if (!o.given("slope-sd")) throw std::invalid_argument("--slope-sd: is needed with --walker");
  request.setting.slope_sd_deg = o.number("slope-sd");
  if (o.given("terrain")) request.setting.terrain = analysis::terrain_from_name(o.text("terrain"));
  request.study.seed = o.seed();
  request.study.threads = o.threads();
  request.json = o.text("json");
  request.command = command_line;
  return request;
}

}  // namespace metastable::reports
