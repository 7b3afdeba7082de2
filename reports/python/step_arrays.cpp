#include "reports/python/step_arrays.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <stdexcept>
#include <string>

#include "reports/python/arguments.h"

namespace metastable::reports::python {
namespace {

std::string shape_of(const py::array& array) { return py::str(array.attr("shape")).cast<std::string>(); }

[[noreturn]] void refuse(const std::string& what) { throw WrongKind("step: " + what); }

// Copies what `step` returned for the next states.
void take_next(const py::object& returned, std::size_t rows, std::span<double> next) {
  const py::array array = py::array::ensure(returned);
  if (!array || std::strchr("fiu", array.dtype().kind()) == nullptr)
    refuse(fmt::format("the next states are no array of real numbers, but {}",
                       array ? "of dtype " + py::str(array.dtype()).cast<std::string>()
                             : std::string(py::str(py::type::of(returned).attr("__name__")))));
  if (array.dtype().kind() != 'f')
    refuse(
        fmt::format("the next states are whole numbers (dtype {}), which cut off what follows the point: floats are "
                    "expected",
                    py::str(array.dtype()).cast<std::string>()));
  const std::size_t dimension = next.size() / rows;
  const bool flat = dimension == 1 && array.ndim() == 1 && static_cast<std::size_t>(array.shape(0)) == rows;
  const bool full = array.ndim() == 2 && static_cast<std::size_t>(array.shape(0)) == rows &&
                    static_cast<std::size_t>(array.shape(1)) == dimension;
  if (!flat && !full)
    throw std::invalid_argument(
        fmt::format("step: next states of shape {}, ({}, {}) expected", shape_of(array), rows, dimension));
  const py::array_t<double, py::array::c_style | py::array::forcecast> numbers(array);
  std::memcpy(next.data(), numbers.data(), next.size_bytes());
}

void take_failed(const py::object& returned, std::span<std::uint8_t> failed) {
  const py::array array = py::array::ensure(returned);
  if (!array || array.dtype().kind() != 'b')
    refuse(fmt::format("whether each state failed is no array of booleans, but {}",
                       array ? "of dtype " + py::str(array.dtype()).cast<std::string>()
                             : std::string(py::str(py::type::of(returned).attr("__name__")))));
  if (array.ndim() != 1 || static_cast<std::size_t>(array.shape(0)) != failed.size())
    throw std::invalid_argument(
        fmt::format("step: failed of shape {}, ({},) expected", shape_of(array), failed.size()));
  const py::array_t<bool, py::array::c_style | py::array::forcecast> flags(array);
  for (std::size_t i = 0; i < failed.size(); ++i) failed[i] = flags.data()[i] ? 1 : 0;
}

}  // namespace

py::array_t<double> rows_of(std::span<const double> values, std::size_t rows) {
  py::array_t<double> array({rows, values.size() / rows});
  std::memcpy(array.mutable_data(), values.data(), values.size_bytes());
  array.attr("setflags")(py::arg("write") = false);
  return array;
}

void raise_instead(py::error_already_set& error, const char* kind, const std::string& sentence) {
  const py::object type = py::module_::import("metastable._errors").attr(kind);
  py::raise_from(error, type.ptr(), sentence.c_str());
  throw py::error_already_set();
}

py::object call_step(const std::function<py::object()>& step, const std::string& called) {
  try {
    return step();
  } catch (py::error_already_set& error) {
    const std::string said = py::str(error.value());
    constexpr const char* arrays = "but states, noise and parameters are arrays of one number a row, so that";
    if (error.matches(PyExc_ValueError) && said.find("read-only") != std::string::npos)
      raise_instead(error, "InputError",
                    fmt::format("{}: it writes into a read-only array, as its arguments are ({})", called, said));
    if (error.matches(PyExc_ValueError) && said.starts_with("The truth value of an array"))
      raise_instead(error, "InputError",
                    fmt::format("{}: it asks whether an array is true, {} numpy.where has to take the place of if ({})",
                                called, arrays, said));
    // NumPy says size-1, length-1 or 0-dimensional, by its version.
    if (error.matches(PyExc_TypeError) && said.starts_with("only ") && said.find("Python scalar") != std::string::npos)
      raise_instead(
          error, "InputTypeError",
          fmt::format("{}: it makes one number of an array, {} numpy.sin has to take the place of math.sin, and "
                      "float() none ({})",
                      called, arrays, said));
    throw;
  }
}

void take_step(const py::object& returned, std::size_t rows, std::span<double> next, std::span<std::uint8_t> failed) {
  if (!py::isinstance<py::tuple>(returned) || py::len(returned) != 2)
    refuse(fmt::format("(next states, failed) is to be returned, not {}",
                       std::string(py::str(py::type::of(returned).attr("__name__")))));
  const auto both = returned.cast<py::tuple>();
  take_next(both[0], rows, next);
  take_failed(both[1], failed);
}

void take_levels(const py::object& returned, std::span<double> levels) {
  const auto array = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(returned);
  if (!array) {
    PyErr_Clear();
    throw WrongKind(fmt::format("level: numbers are to be returned, not {}",
                                std::string(py::str(py::type::of(returned).attr("__name__")))));
  }
  if (array.ndim() != 1 || array.size() != static_cast<py::ssize_t>(levels.size()))
    throw std::invalid_argument(fmt::format("level: {} numbers, one for each state, expected, and shape {} returned",
                                            levels.size(), std::string(py::str(array.attr("shape")))));
  std::copy_n(array.data(), levels.size(), levels.begin());
}

}  // namespace metastable::reports::python
