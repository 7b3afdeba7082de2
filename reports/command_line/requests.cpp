#include "reports/command_line/requests.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "reports/command_line/option_values.h"
#include "reports/command_line/walker_options.h"

namespace metastable::reports {
namespace {

constexpr dynamics::Range wanted_shares{.low = 0, .high = 1, .low_open = true, .high_open = true};
constexpr dynamics::Range time_limits{.low = 0, .high = 1e9, .low_open = true};  // [s]

}  // namespace

void declare_steps(Options& o) {
  add_slope(o);
  add_launch(o, "Just before collision 1 [rad/s]");
  add_wheel(o), add_contact(o), add_course(o), add_study(o, true);
  o.add_flag("direct", "Follow every landing instead of reading a table, hundreds of times slower (settled)");
  o.add_flag("certify", "Guaranteed bounds as well, refined to the width --tolerance (law published)");
  o.group("Question");
  o.add_flag("how-it-fails", "The last steps before failure: which leg, which noise, from where");
  o.add_flag("sensitivities", "How ln(expected steps) responds to each parameter, ranked");
  o.add_flag("explain", "What stands behind the words of the answer");
  add_standard_errors(o);
  o.add_json();
  o.group("Method and accuracy");
  o.add("time-limit", "S", fmt::format("{}", usual_time_limit),
        "Wall clock after which there is a sentence instead of a number (exit code 3), or instead of the check of "
        "rigid bodies where the number is there. Results do not depend on it",
        time_limits);
  add_walker(o, "DEG");
  add_level(o);
}

StepsRequest steps_request(const Options& o, const analysis::Setting& setting, const std::string& line) {
  StepsRequest request{setting, study_options(o), o.text("json"), line, o.flag("certify")};
  request.sensitivities = o.flag("sensitivities");
  request.explain = o.flag("explain");
  request.how_it_fails = o.flag("how-it-fails");
  request.study.direct = o.flag("direct");
  if (request.study.direct && request.setting.law != dynamics::Law::settled)
    throw std::invalid_argument("--direct: has a meaning under --law settled only");
  request.standard_errors = standard_errors(o, request.setting);
  request.rigid_bodies = !o.given("law");
  request.time_limit = o.number("time-limit");
  return request;
}

void declare_compare(Options& o) {
  o.group("Question");
  o.add("slopes", "DEG,DEG,...", "7.02,9.59",
        "Ramp slopes [deg], each from 0.001 to below half the angle between legs; later ones are compared "
        "with the first; 7.02 alone where something else is compared");
  add_slope(o);
  add_launch(o, "Once per slope, in order");
  add_wheel(o), add_contact(o), add_course(o), add_study(o);
  o.add_flag("direct", "Follow every landing instead of reading a table, hundreds of times slower (settled)");
  add_compared(o);
  o.group("Question");
  o.add("collisions", "N", "16", "Collisions of a measured trial, 1..63");
  add_standard_errors(o);
  o.add_json();
  add_walker(o, "DEG,DEG,...");
}

CompareRequest compare_request(const Options& o, const std::vector<analysis::Setting>& settings,
                               const std::string& line) {
  CompareRequest request{settings, study_options(o), o.count("collisions", 1, 63), o.text("json"), line};
  const auto follows = [](const analysis::Setting& one) { return one.law == dynamics::Law::settled; };
  request.study.direct = o.flag("direct");
  if (request.study.direct && std::none_of(settings.begin(), settings.end(), follows))
    throw std::invalid_argument("--direct: has a meaning under --law settled only");
  for (const analysis::Setting& one : settings) request.standard_errors = standard_errors(o, one);
  request.rigid_bodies = !o.given("law");
  return request;
}

void declare_sweep(Options& o) {
  o.group("Question");
  o.add("slope", "RANGE", "7.02",
        "[deg] first:last:step, a comma list or one value, each from 0.001 to below half the angle between legs; "
        "likewise the other axes");
  o.add("restitution-mean", "RANGE", "", "Mean of eta", dynamics::range::restitution);
  o.add("restitution-sd", "RANGE", "", "Sd of eta", dynamics::range::restitution);
  o.add("friction-mean", "RANGE", "", "Mean of mu", dynamics::range::friction);
  o.add("friction-sd", "RANGE", "", "Sd of mu", dynamics::range::friction);
  add_launch(o, "Of all points");
  add_wheel(o), add_contact(o), add_course(o), add_study(o);
  o.group("Files and help");
  o.add("out", "FILE", "sweep.csv", "CSV; the figure goes beside it as .svg. A sweep cut short is taken up again");
  o.add_json();
  add_walker(o, "RANGE");
}

void declare_solve(Options& o) {
  o.add_place("PARAMETER", "What is solved for (of a walker, slope or slope-sd)",
              "slope|restitution-mean|restitution-sd|friction-mean|friction-sd|leg-length|inertia|ramp-stiffness|"
              "radius-of-gyration|contact-mass|tip-radius|slope-sd");
  o.group("Question");
  o.add("steps", "N", "", "Wanted: so many expected steps before failure, above 1");
  o.add("survive", "N:P", "", "Wanted: a share P of all, above 0 and below 1, that takes more than N steps");
  o.add("reach", "P", "", "Wanted: a share P of all that reaches the end of the ramp", wanted_shares);
  o.add("from", "VALUE", "", "Least value of the parameter that is looked at (default: by parameter)");
  o.add("to", "VALUE", "", "Largest (default: by parameter)");
  o.add("points", "N", "", "Values looked at first, 3..1000 (default: 17, of a walker 9)");
  add_slope(o);
  add_launch(o, "Just before collision 1 [rad/s]");
  add_wheel(o), add_contact(o), add_course(o), add_study(o);
  o.add_json();
  add_walker(o, "DEG");
}

namespace {

// Reads what both kinds have.
SolveRequest asked_to_solve(const Options& o, std::size_t points, const std::string& line) {
  SolveRequest request;
  analysis::Target& target = request.target;
  int wanted = 0;
  for (const char* name : {"steps", "survive", "reach"}) wanted += o.given(name);
  if (wanted != 1) throw std::invalid_argument("solve: one of --steps, --survive and --reach is needed, and no other");
  if (o.given("steps")) {
    target = {analysis::Target::Of::steps, number_value("steps", o.text("steps"), {.low = 1, .low_open = true}), 0};
  } else if (o.given("survive")) {
    const std::string text = o.text("survive");
    const std::size_t colon = text.find(':');
    if (colon == std::string::npos)
      throw std::invalid_argument(fmt::format("--survive: '{}' is not of the form STEPS:SHARE, as 1000:0.9", text));
    target = {analysis::Target::Of::survival, number_value("survive", text.substr(colon + 1), wanted_shares),
              static_cast<int>(whole_value("survive", text.substr(0, colon), 1, 1000000000))};
  } else {
    target = {analysis::Target::Of::ramp_end, o.number("reach"), 0};
  }
  if (o.given("from")) request.solve.from = o.number("from");
  if (o.given("to")) request.solve.to = o.number("to");
  request.solve.points = o.given("points") ? o.whole("points", 3, 1000) : points;
  request.json = o.text("json");
  request.command = line;
  return request;
}

}  // namespace

SolveRequest solve_request(const Options& o, const analysis::Setting& setting, const std::string& line) {
  SolveRequest request = asked_to_solve(o, 17, line);
  const std::string name = o.text("PARAMETER");
  if (name == "slope-sd") throw std::invalid_argument("PARAMETER: slope-sd has a meaning with --walker only");
  request.parameter = analysis::parameter_from_name(name);
  request.setting = setting;
  request.study = study_options(o);
  request.solve.threads = request.study.threads;
  request.rigid_bodies = !o.given("law");
  return request;
}

SolveRequest walker_solve_request(const Options& o, const analysis::WalkerSetting& setting, const std::string& line) {
  const std::string name = o.text("PARAMETER");
  require_walker_parameter(name);
  SolveRequest request = asked_to_solve(o, 9, line);
  request.meshes = mesh_options(o, {"PARAMETER", "steps", "survive", "from", "to", "points"});
  request.solve.threads = request.meshes.threads;
  request.walker = setting;
  request.of_slope_sd = name == "slope-sd";
  return request;
}

analysis::SweepAxis sweep_axis(const Options& o, const char* name, const analysis::Setting& setting) {
  const analysis::Parameter parameter = analysis::parameter_from_name(name);
  const bool slope = parameter == analysis::Parameter::slope;
  const dynamics::Range allowed = slope ? dynamics::slope_range(setting.wheel.legs()) : o.range(name);
  analysis::SweepAxis axis{parameter, range_value(name, o.text(name), allowed)};
  if (!setting.pairs.empty() && !slope)
    throw std::invalid_argument(fmt::format("--{}: cannot vary with --contact-list", name));
  if (setting.law == dynamics::Law::plastic && !slope)
    throw std::invalid_argument(fmt::format("--{}: has no meaning under --law plastic", name));
  return axis;
}

}  // namespace metastable::reports
