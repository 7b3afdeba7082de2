#pragma once
// Gives results as Python gets them, and their arrays.

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "analysis/diagnosis/diagnosis.h"
#include "reports/output/table.h"
#include "reports/python/call.h"
#include "reports/study/study_progress.h"

namespace metastable::reports::python {

/// Makes a read-only array of the values as they lie in memory, which `keep` owns.
/// @param stride  from one to the next [bytes]
template <typename T>
py::array array_view(const T* first, std::size_t count, std::shared_ptr<const void> keep,
                     std::size_t stride = sizeof(T)) {
  const py::capsule owner(new std::shared_ptr<const void>(std::move(keep)),
                          [](void* held) { delete static_cast<std::shared_ptr<const void>*>(held); });
  py::array_t<T> array({static_cast<py::ssize_t>(count)}, {static_cast<py::ssize_t>(stride)}, first, owner);
  array.attr("setflags")(py::arg("write") = false);
  return array;
}

/// A vector becomes an array without being copied.
template <typename T>
py::array array_of(std::vector<T> values) {
  const auto held = std::make_shared<const std::vector<T>>(std::move(values));
  return array_view(held->data(), held->size(), held);
}

/// Makes what metastable._results.Result is made from: the command line's JSON and text, tables as HTML, and arrays in
/// the place of the lists at these keys of the JSON ("a.b" for b within a).
inline py::dict answer(const std::string& json, const std::string& text, const std::string& html,
                       py::dict arrays = py::dict()) {
  py::dict all;
  all["json"] = json;
  all["text"] = text;
  all["html"] = html;
  all["arrays"] = std::move(arrays);
  return all;
}

inline std::string tables_html(const std::vector<Table>& tables) {
  std::string html;
  for (const Table& table : tables) html += to_html(table);
  return html;
}

/// Returns gnuplot's scripts of the figures that a notebook shows of a diagnosis. It simulates the diagnosed machine
/// once.
std::vector<std::string> notebook_figures(const analysis::Diagnosis& found);

/// Gives a diagnosis as `diagnose --json`, its text, and its figures.
py::dict diagnosis_answer(const analysis::Diagnosis& found, const Provenance& provenance,
                          const std::vector<std::string>& figures);

/// Tells a call of the parts of a command.
inline BeginPart parts_of(Call& call) {
  return [&call](const std::string& name) {
    return [&call, name](double share, const std::string&) { call.tell(share, name); };
  };
}

/// Adds what each file of this folder adds to the module.
void add_blind(py::module_& module);
void add_studies(py::module_& module);
void add_experiments(py::module_& module);
void add_machines(py::module_& module);
void add_maps(py::module_& module);
void add_chains(py::module_& module);

}  // namespace metastable::reports::python
