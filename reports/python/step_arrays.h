#pragma once
// Gives a simulator written in Python its arrays, and takes what it returns.

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <cstdint>
#include <functional>
#include <span>
#include <string>

namespace metastable::reports::python {

namespace py = pybind11;

/// Returns numbers of one kind in rows; Python may keep them, and may not write into them.
py::array_t<double> rows_of(std::span<const double> values, std::size_t rows);

/// Returns what a step, or another function of the user's, returns. @param called  its name in messages
/// @throws what it throws; InputError saying so where it writes into its arguments, asks whether an array is true, or
/// makes one number of an array
py::object call_step(const std::function<py::object()>& step, const std::string& called = "step");

/// Raises an error of this package, as InputError, in the place of one that was raised in a function of the user's.
[[noreturn]] void raise_instead(py::error_already_set& error, const char* kind, const std::string& sentence);

/// Copies what a step returned: (next states [rows x dimension], failed [rows]).
/// @throws WrongKind or std::invalid_argument saying what it returned instead
void take_step(const py::object& returned, std::size_t rows, std::span<double> next, std::span<std::uint8_t> failed);

/// Copies what a level function returned: a number for each state.
/// @throws WrongKind or std::invalid_argument saying what it returned instead
void take_levels(const py::object& returned, std::span<double> levels);

}  // namespace metastable::reports::python
