#pragma once
// Reads Python's keyword arguments as the library's options.

#include <pybind11/pybind11.h>

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "analysis/sensitivity/propagation.h"
#include "analysis/study/metastability.h"
#include "analysis/study/setting.h"
#include "analysis/walkers/walker_study.h"

namespace metastable::reports::python {

namespace py = pybind11;

/// Holds arguments by name; None stands for one that is not given. Everything throws py::type_error naming the argument
/// where it is of the wrong kind, and std::invalid_argument where it is out of range.
class Arguments {
 public:
  explicit Arguments(py::dict values) : values_(std::move(values)) {}
  bool given(const char* name) const;
  double number(const char* name) const;
  std::string text(const char* name) const;
  bool flag(const char* name) const;
  std::uint64_t whole(const char* name, std::uint64_t low, std::uint64_t high) const;
  analysis::Spread spread(const char* name) const;      ///< (mean, sd), or a constant
  std::vector<double> numbers(const char* name) const;  ///< a sequence or an array
  std::vector<std::string> texts(const char* name) const;
  std::vector<std::pair<double, double>> pairs(const char* name) const;
  Arguments part(const char* name) const;  ///< a dict
  const py::dict& all() const { return values_; }

  int threads() const { return static_cast<int>(whole("threads", 0, 4096)); }
  std::uint64_t seed() const { return whole("seed", 0, ~std::uint64_t{0}); }

 private:
  py::object at(const char* name) const;
  py::dict values_;
};

/// Reads the fields of metastable.Setting, checked, and refused where the law has no use for them.
analysis::Setting setting_of(const Arguments& fields);
/// Reads the fields of metastable.WalkerSetting, checked.
analysis::WalkerSetting walker_setting_of(const Arguments& fields);
/// Reads the options of metastable.study(), checked.
analysis::StudyOptions study_options_of(const Arguments& options);
/// Reads those of a walker's study.
markov::MeshStudyOptions mesh_options_of(const Arguments& options);
/// Reads standard errors by name of the parameter, "friction_mean".
std::vector<analysis::StandardError> standard_errors_of(const Arguments& options, const analysis::Setting& setting);
/// Returns "friction-mean" for friction_mean, "slope" for slope_deg.
std::string parameter_of(const std::string& argument);

}  // namespace metastable::reports::python
