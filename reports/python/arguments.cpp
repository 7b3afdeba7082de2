#include "reports/python/arguments.h"

#include <fmt/format.h>
#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "dynamics/wheel/contact_law.h"
#include "reports/command_line/option_values.h"
#include "reports/command_line/setting_options.h"

namespace metastable::reports::python {
namespace {

[[noreturn]] void wrong_kind(const char* name, const char* wanted, const py::handle& value) {
  throw py::type_error(
      fmt::format("{}: {} expected, not {}", name, wanted, std::string(py::str(py::type::of(value).attr("__name__")))));
}

template <typename T>
T cast_as(const char* name, const char* wanted, const py::object& value) {
  try {
    return value.cast<T>();
  } catch (const py::cast_error&) {
    wrong_kind(name, wanted, value);
  }
}

using Numbers = py::array_t<double, py::array::c_style | py::array::forcecast>;

// Makes an array of `dimensions`; what cannot be one is of the wrong kind.
Numbers converted(const char* name, const char* wanted, const py::object& value, py::ssize_t dimensions) {
  Numbers array;
  try {
    array = Numbers(value);
  } catch (const py::error_already_set&) {
    wrong_kind(name, wanted, value);
  }
  if (array.ndim() != dimensions) wrong_kind(name, wanted, value);
  return array;
}

}  // namespace

py::object Arguments::at(const char* name) const {
  if (!given(name)) throw std::invalid_argument(fmt::format("{}: must be given", name));
  return values_[name];
}

bool Arguments::given(const char* name) const { return values_.contains(name) && !values_[name].is_none(); }

double Arguments::number(const char* name) const {
  const py::object value = at(name);
  if (py::isinstance<py::str>(value)) wrong_kind(name, "a number", value);
  return cast_as<double>(name, "a number", value);
}

std::string Arguments::text(const char* name) const {
  const py::object value = at(name);
  if (!py::isinstance<py::str>(value)) wrong_kind(name, "a text", value);
  return value.cast<std::string>();
}

bool Arguments::flag(const char* name) const {
  if (!given(name)) return false;
  const py::object value = at(name);
  if (!py::isinstance<py::bool_>(value)) wrong_kind(name, "True or False", value);
  return value.cast<bool>();
}

std::uint64_t Arguments::whole(const char* name, std::uint64_t low, std::uint64_t high) const {
  const py::object value = at(name);
  if (PyIndex_Check(value.ptr()) == 0) wrong_kind(name, "a whole number", value);
  const auto index = py::reinterpret_steal<py::int_>(PyNumber_Index(value.ptr()));
  const std::uint64_t number = PyLong_AsUnsignedLongLong(index.ptr());
  const bool outside = PyErr_Occurred() != nullptr;
  if (outside) PyErr_Clear();
  if (outside || number < low || number > high)
    throw std::invalid_argument(fmt::format("{}: {} is outside {}..{}", name, std::string(py::str(value)), low, high));
  return number;
}

analysis::Spread Arguments::spread(const char* name) const {
  const py::object value = at(name);
  constexpr const char* wanted = "(mean, sd) or a number";
  if (py::isinstance<py::str>(value)) wrong_kind(name, wanted, value);
  if (!py::isinstance<py::sequence>(value)) return {cast_as<double>(name, wanted, value), 0};
  const auto both = cast_as<std::vector<double>>(name, wanted, value);
  if (both.size() != 2)
    throw std::invalid_argument(fmt::format("{}: (mean, sd) expected, {} numbers given", name, both.size()));
  return {both[0], both[1]};
}

std::vector<double> Arguments::numbers(const char* name) const {
  const Numbers array = converted(name, "a sequence of numbers", at(name), 1);
  return {array.data(), array.data() + array.size()};
}

std::vector<std::string> Arguments::texts(const char* name) const {
  if (!given(name)) return {};
  const py::object value = at(name);
  if (py::isinstance<py::str>(value)) return {value.cast<std::string>()};
  return cast_as<std::vector<std::string>>(name, "a list of texts", value);
}

std::vector<std::pair<double, double>> Arguments::pairs(const char* name) const {
  constexpr const char* wanted = "an array of n rows and two columns";
  const Numbers array = converted(name, wanted, at(name), 2);
  if (array.shape(1) != 2) wrong_kind(name, wanted, array);
  std::vector<std::pair<double, double>> all;
  for (py::ssize_t i = 0; i < array.shape(0); ++i) all.emplace_back(array.at(i, 0), array.at(i, 1));
  return all;
}

Arguments Arguments::part(const char* name) const {
  if (!given(name)) return Arguments(py::dict());
  const py::object value = at(name);
  if (!py::isinstance<py::dict>(value)) wrong_kind(name, "a dict", value);
  return Arguments(value.cast<py::dict>());
}

analysis::Setting setting_of(const Arguments& fields) {
  analysis::Setting s;
  namespace range = dynamics::range;
  const auto number = [&](const char* name, auto& into, const dynamics::Range& allowed = {}) {
    if (!fields.given(name)) return;
    const double value = fields.number(name);
    check_in_range(name, value, allowed);
    into = value;
  };
  const auto spread = [&](const char* name, analysis::Spread& into, const dynamics::Range& allowed) {
    if (!fields.given(name)) return;
    into = fields.spread(name);
    check_in_range(name, into, allowed);
  };
  number("slope_deg", s.slope_deg);
  if (fields.given("ramp_length") && std::isinf(fields.number("ramp_length")))
    s.ramp_length = fields.number("ramp_length");  // a ramp without end
  else
    number("ramp_length", s.ramp_length, range::ramp_length);
  if (fields.given("legs")) check_legs("legs", s.wheel.leg_length = fields.numbers("legs"));
  number("mass", s.wheel.hub_mass, range::mass);
  number("inertia", s.wheel.inertia);
  number("radius_of_gyration", s.wheel.radius_of_gyration, range::radius_of_gyration);
  number("tip_radius", s.wheel.tip_radius, range::tip_radius);
  number("contact_mass", s.wheel.contact_mass, range::mass);
  number("ramp_stiffness", s.wheel.ramp_stiffness, range::ramp_stiffness);
  number("gravity", s.wheel.gravity, range::gravity);
  if (fields.given("law")) s.law = dynamics::law_from_name(fields.text("law"));
  number("rebound_lost", s.rebound_lost);
  spread("restitution", s.restitution, range::restitution);
  spread("friction", s.friction, range::friction);
  number("correlation", s.correlation);
  refuse_what_law_lacks(s.law, [&](const std::string& option) {
    std::string name = option;
    std::replace(name.begin(), name.end(), '-', '_');
    return fields.given(name.c_str());
  });
  if (fields.given("contact_list")) {
    if (fields.given("restitution") || fields.given("friction") || fields.given("correlation"))
      throw std::invalid_argument("contact_list: excludes restitution, friction and correlation");
    for (const auto& [restitution, friction] : fields.pairs("contact_list")) s.pairs.push_back({restitution, friction});
    if (s.pairs.empty()) throw std::invalid_argument("contact_list: holds no pair");
  }
  if (fields.given("first_leg"))
    s.first_landing_leg =
        static_cast<int>(fields.whole("first_leg", 0, static_cast<std::uint64_t>(s.wheel.legs()) - 1));
  check_slope(s);
  if (fields.given("initial_speed"))
    spread("initial_speed", s.initial_speed, range::speed);
  else
    s.initial_speed = launch_for(s.slope_deg, std::nullopt);
  s.validate();
  return s;
}

analysis::WalkerSetting walker_setting_of(const Arguments& fields) {
  analysis::WalkerSetting s;
  s.walker = analysis::walker_from_name(fields.text("walker"));
  s.slope_deg = fields.given("slope_deg") ? fields.number("slope_deg") : analysis::walker_slope_deg(s.walker);
  s.slope_sd_deg = fields.number("slope_sd_deg");
  if (fields.given("terrain")) s.terrain = analysis::terrain_from_name(fields.text("terrain"));
  s.map();
  return s;
}

analysis::StudyOptions study_options_of(const Arguments& options) {
  analysis::StudyOptions study;
  if (options.given("method")) study.method = analysis::method_from_name(options.text("method"));
  for (const char* name : {"samples", "sequence", "draws", "tail", "replicates"})
    if (options.given(name) && study.method != analysis::Method::sampled)
      throw std::invalid_argument(fmt::format("{}: has a meaning under method sampled only", name));
  const auto one_of = [&](const char* name, const std::string& first, const std::string& second) {
    if (!options.given(name)) return false;
    const std::string text = options.text(name);
    if (text != first && text != second)
      throw std::invalid_argument(fmt::format("{}: '{}' is neither '{}' nor '{}'", name, text, first, second));
    return text == second;
  };
  if (options.given("cells")) study.cells = options.whole("cells", 8, 4096);
  if (options.given("samples")) study.samples = options.whole("samples", 16, 1U << 24);
  if (options.given("tolerance")) study.tolerance = options.number("tolerance");
  study.sequence = one_of("sequence", "sobol", "random") ? markov::Sequence::random : markov::Sequence::sobol;
  study.weighting = one_of("draws", "weighted", "plain") ? markov::Weighting::plain : markov::Weighting::weighted;
  if (options.given("tail")) study.tail = options.number("tail");
  if (options.given("replicates")) study.replicates = static_cast<int>(options.whole("replicates", 2, 64));
  if (options.given("mixing_distance")) study.mixing_distance = options.number("mixing_distance");
  if (options.given("eigenvalues")) study.eigenvalues = static_cast<int>(options.whole("eigenvalues", 1, 64));
  study.seed = options.seed();
  study.threads = options.threads();
  study.validate();
  return study;
}

markov::MeshStudyOptions mesh_options_of(const Arguments& options) {
  markov::MeshStudyOptions study;
  study.seed = options.seed();
  study.threads = options.threads();
  if (options.given("spacing")) study.spacing = options.number("spacing");
  if (options.given("simulated_steps")) study.simulated_steps = options.whole("simulated_steps", 0, 1000000000000);
  if (options.given("guided_samples")) {
    study.guided_samples = options.whole("guided_samples", 0, 100000000);
    if (study.guided_samples > 0 && study.guided_samples < 16)
      throw std::invalid_argument(fmt::format("guided_samples: {}, 0 or 16 and more expected", study.guided_samples));
  }
  if (options.given("memory_gb")) {
    const double gigabytes = options.number("memory_gb");
    if (!(gigabytes >= 0.001 && gigabytes <= 1e6))
      throw std::invalid_argument(fmt::format("memory_gb: {} is outside [0.001, 1e+06]", gigabytes));
    study.most_bytes = static_cast<std::size_t>(gigabytes * 0x1p30);
  }
  return study;
}

std::string parameter_of(const std::string& argument) {
  std::string name = argument == "slope_deg" ? "slope" : argument;
  std::replace(name.begin(), name.end(), '_', '-');
  return name;
}

std::vector<analysis::StandardError> standard_errors_of(const Arguments& options, const analysis::Setting& setting) {
  std::vector<analysis::StandardError> errors;
  const Arguments given = options.part("standard_errors");
  for (const auto& [key, value] : given.all()) {
    const auto name = py::str(key).cast<std::string>();
    const double error = given.number(name.c_str());
    if (error != 0) errors.push_back({analysis::parameter_from_name(parameter_of(name)), error});
  }
  analysis::check_standard_errors(setting, errors);
  return errors;
}

}  // namespace metastable::reports::python
