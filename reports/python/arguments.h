#pragma once
// Reads Python's keyword arguments: as the command line's options, so that what is wrong with them is said in the same
// words.

#include <pybind11/pybind11.h>

#include <cstdint>
#include <initializer_list>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "analysis/sensitivity/propagation.h"
#include "analysis/study/setting.h"
#include "analysis/walkers/walker_study.h"
#include "reports/command_line/options.h"
#include "reports/command_line/setting_options.h"

namespace metastable::reports::python {

namespace py = pybind11;

/// An argument, or what a function of the user's returned, is of the wrong kind: Python's InputTypeError.
class WrongKind : public std::invalid_argument {
  using std::invalid_argument::invalid_argument;
};

/// Holds arguments by name; None stands for one that is not given. Everything throws WrongKind naming the argument
/// where it is of the wrong kind, and std::invalid_argument where it is out of range.
class Arguments {
 public:
  explicit Arguments(py::dict values) : values_(std::move(values)) {}
  bool given(const char* name) const;
  double number(const char* name) const;
  std::string text(const char* name) const;
  bool flag(const char* name) const;
  std::uint64_t whole(const char* name, std::uint64_t low, std::uint64_t high) const;
  std::vector<double> numbers(const char* name) const;  ///< a sequence or an array
  std::vector<std::string> texts(const char* name) const;
  std::vector<std::pair<double, double>> pairs(const char* name) const;
  Arguments part(const char* name) const;  ///< a dict
  Arguments without(std::initializer_list<const char*> names) const;
  const py::dict& all() const { return values_; }
  /// Gives the options those that are named as options are, or as option_of() says: numbers, lists of them, words and
  /// flags. The others are left out.
  void give(Options& options) const;

 private:
  py::object at(const char* name) const;
  py::dict values_;
};

/// Returns the option that an argument stands for, "slope" for slope_deg, and the argument that stands for an option.
std::string option_of(const std::string& argument);
std::string argument_of(const std::string& option);

/// Gives the options the fields of metastable.Setting. @returns its contact_list, if it has one
Pairs give_setting(const Arguments& fields, Options& options);
/// Gives the options those of metastable.simulate().
void give_simulation(const Arguments& given, Options& options);
/// Reads the fields of metastable.Setting, checked, and refused where the law has no use for them.
analysis::Setting setting_of(const Arguments& fields);
/// Reads the fields of metastable.WalkerSetting, checked.
analysis::WalkerSetting walker_setting_of(const Arguments& fields);
/// Reads what only Python's studies of walkers know.
void read_guided_samples(const Arguments& options, markov::MeshStudyOptions& study);
/// Reads standard errors by name of the parameter, "friction_mean".
std::vector<analysis::StandardError> standard_errors_of(const Arguments& options, const analysis::Setting& setting);

}  // namespace metastable::reports::python
