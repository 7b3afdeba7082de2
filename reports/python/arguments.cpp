#include "reports/python/arguments.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <stdexcept>

#include "reports/command_line/option_values.h"
#include "reports/command_line/requests.h"
#include "reports/command_line/walker_options.h"

namespace metastable::reports::python {
namespace {

[[noreturn]] void wrong_kind(const char* name, const char* wanted, const py::handle& value) {
  throw WrongKind(
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

// Writes a number as a command line would be given it.
std::string number_text(const char* name, const char* wanted, const py::object& value) {
  if (py::isinstance<py::str>(value) || py::isinstance<py::bool_>(value)) wrong_kind(name, wanted, value);
  if (PyIndex_Check(value.ptr()) == 0) return fmt::format("{}", cast_as<double>(name, wanted, value));
  const auto whole = py::reinterpret_steal<py::object>(PyNumber_Index(value.ptr()));
  if (!whole) throw py::error_already_set();
  return py::str(whole).cast<std::string>();
}

// Writes one number, or several with commas between.
std::string list_text(const char* name, const char* wanted, const py::object& value) {
  if (py::isinstance<py::str>(value)) wrong_kind(name, wanted, value);
  if (!py::isinstance<py::sequence>(value)) return number_text(name, wanted, value);
  const Numbers numbers = converted(name, wanted, value, 1);
  return fmt::format("{}", fmt::join(numbers.data(), numbers.data() + numbers.size(), ","));
}

bool is_words(const std::string& value) {
  return value.find_first_not_of("abcdefghijklmnopqrstuvwxyz|") == std::string::npos;
}

// Names what Python calls otherwise: with its unit, without a negation, in the plural.
constexpr std::pair<const char*, const char*> other_names[] = {
    {"slope", "slope_deg"},  {"slopes", "slope_deg"}, {"slope-sd", "slope_sd_deg"},
    {"memory", "memory_gb"}, {"from", "start"},       {"to", "stop"},
    {"no-flight", "flight"}, {"shuffle", "shuffled"}, {"effect", "effects"}};

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
  return whole_value(name, number_text(name, "a whole number", value), low, high);
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

Arguments Arguments::without(std::initializer_list<const char*> names) const {
  py::dict others = values_.attr("copy")();
  for (const char* name : names) others.attr("pop")(name, py::none());
  return Arguments(others);
}

void Arguments::give(Options& options) const {
  for (const auto& [key, value] : values_) {
    const std::string name = py::str(key).cast<std::string>(), option = option_of(name);
    if (value.is_none() || !options.has(option)) continue;
    const auto object = py::reinterpret_borrow<py::object>(value);
    const std::string wanted = options.value(option);
    if (wanted.empty()) {
      if (flag(name.c_str())) options.give(option, {"true"});
    } else if (is_words(wanted)) {
      options.give(option, {text(name.c_str())});
    } else if (wanted.ends_with("|steady") && py::isinstance<py::str>(value)) {
      options.give(option, {text(name.c_str())});
    } else if (wanted.find(',') != std::string::npos) {
      options.give(option, {list_text(name.c_str(),
                                      wanted.starts_with("MEAN,SD") ? "(mean, sd) or a number" : "numbers", object)});
    } else {
      options.give(option, {number_text(name.c_str(), "a number", object)});
    }
  }
}

std::string option_of(const std::string& argument) {
  for (const auto& [option, name] : other_names)
    if (argument == name) return option;
  std::string name = argument;
  std::ranges::replace(name, '_', '-');
  return name;
}

std::string argument_of(const std::string& option) {
  for (const auto& [known, name] : other_names)
    if (option == known) return name;
  std::string name = option;
  std::ranges::replace(name, '-', '_');
  return name;
}

Pairs give_setting(const Arguments& fields, Options& options) {
  if (fields.given("legs")) check_legs("--legs", fields.numbers("legs"));  // of which one would stand for eight
  fields.without({"contact_list"}).give(options);
  if (!fields.given("contact_list")) return {};
  Pairs pairs{std::in_place};
  for (const auto& [restitution, friction] : fields.pairs("contact_list")) pairs->push_back({restitution, friction});
  if (pairs->empty()) throw std::invalid_argument("--contact-list: holds no pair");
  options.give("contact-list", {"given"});
  return pairs;
}

void give_simulation(const Arguments& given, Options& options) {
  given.without({"effects", "outside", "drop"}).give(options);
  options.give("effect", given.texts("effects"));
  std::vector<std::string> outside;
  const Arguments sizes = given.part("outside");
  for (const auto& [key, size] : sizes.all()) {
    const auto name = py::str(key).cast<std::string>();
    outside.push_back(fmt::format("{}:{}", name, sizes.number(name.c_str())));
  }
  options.give("outside", outside);
  const std::vector<std::string> dropped = given.texts("drop");
  if (!dropped.empty()) options.give("drop", {fmt::format("{}", fmt::join(dropped, ","))});
}

analysis::Setting setting_of(const Arguments& fields) {
  LooseOptions options(declare_steps);
  const Pairs pairs = give_setting(fields, *options);
  options->check_given();
  return one_setting(*options, pairs);
}

analysis::WalkerSetting walker_setting_of(const Arguments& fields) {
  LooseOptions options(declare_steps);
  fields.give(*options);
  options->check_given();
  return walker_request(*options, "").settings.front();
}

void read_guided_samples(const Arguments& options, markov::MeshStudyOptions& study) {
  if (!options.given("guided_samples")) return;
  study.guided_samples = options.whole("guided_samples", 0, 100000000);
  if (study.guided_samples > 0 && study.guided_samples < 16)
    throw std::invalid_argument(fmt::format("guided_samples: {}, 0 or 16 and more expected", study.guided_samples));
}

std::vector<analysis::StandardError> standard_errors_of(const Arguments& options, const analysis::Setting& setting) {
  std::vector<analysis::StandardError> errors;
  const Arguments given = options.part("standard_errors");
  for (const auto& [key, value] : given.all()) {
    const auto name = py::str(key).cast<std::string>();
    const double error = given.number(name.c_str());
    if (error != 0) errors.push_back({analysis::parameter_from_name(option_of(name)), error});
  }
  analysis::check_standard_errors(setting, errors);
  return errors;
}

}  // namespace metastable::reports::python
