#include "reports/command_line/requests.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "reports/command_line/option_values.h"
#include "reports/command_line/walker_options.h"

namespace metastable::reports {

void declare_steps(Options& o) {
  add_slope(o);
  o.add("initial-speed", "MEAN,SD", "", "Just before collision 1 [rad/s] (default: the paper's at 7.02 and 9.59)",
        dynamics::range::speed);
  add_wheel(o), add_contact(o), add_course(o), add_study(o);
  o.add_flag("direct", "Follow every landing instead of reading a table, hundreds of times slower (settled)");
  o.add_flag("certify", "Guaranteed bounds as well, refined to the width --tolerance (law published)");
  o.add_flag("sensitivities", "How ln(expected steps) responds to each parameter, ranked");
  add_standard_errors(o);
  o.add_json();
  o.add_flag("explain", "What stands behind the words of the answer");
  o.add_flag("how-it-fails", "The last steps before failure: which leg, which noise, from where");
  add_walker(o, "DEG");
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
  return request;
}

void declare_compare(Options& o) {
  o.add("slopes", "DEG,DEG,...", "7.02,9.59",
        "Ramp slopes [deg], each from 0.001 to below half the angle between legs; later ones are compared "
        "with the first (default: 7.02 alone where something else is compared)");
  add_slope(o);
  o.add("initial-speed", "MEAN,SD", "", "Once per slope, in order (default: the paper's at 7.02 and 9.59)",
        dynamics::range::speed);
  add_wheel(o), add_contact(o), add_course(o), add_study(o);
  add_compared(o);
  o.add_flag("direct", "Follow every landing instead of reading a table, hundreds of times slower (settled)");
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
  return request;
}

void declare_sweep(Options& o) {
  o.add("slope", "RANGE", "7.02",
        "[deg] first:last:step, a comma list or one value, each from 0.001 to below half the angle between legs; "
        "likewise the other axes");
  o.add("restitution-mean", "RANGE", "", "Mean of eta", dynamics::range::restitution);
  o.add("restitution-sd", "RANGE", "", "Sd of eta", dynamics::range::restitution);
  o.add("friction-mean", "RANGE", "", "Mean of mu", dynamics::range::friction);
  o.add("friction-sd", "RANGE", "", "Sd of mu", dynamics::range::friction);
  o.add("initial-speed", "MEAN,SD", "", "Of all points (default: the paper's if the one slope is 7.02 or 9.59)",
        dynamics::range::speed);
  add_wheel(o), add_contact(o), add_course(o), add_study(o);
  o.add("out", "FILE", "sweep.csv", "CSV; the figure goes beside it as .svg. A sweep cut short is taken up again");
  o.add_json();
  add_walker(o, "RANGE");
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
