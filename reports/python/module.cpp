// Makes the Python module metastable._metastable: private; what people import is the package around it.

#include <pybind11/pybind11.h>

#include <filesystem>
#include <new>
#include <regex>
#include <stdexcept>
#include <string>
#include <vector>

#include "analysis/experiment/input_error.h"
#include "analysis/study/consistency.h"
#include "markov/mesh/mesh_study.h"
#include "reports/command_line/cli.h"
#include "reports/output/interrupt.h"
#include "reports/output/version.h"
#include "reports/python/answer.h"
#include "reports/python/arguments.h"

namespace metastable::reports::python {
namespace {

// Sentences name options as the command line spells them, --first-leg, or begin with the name of a parameter,
// friction-mean; Python's arguments are first_leg and friction_mean, slope_deg for --slope.
std::string in_python(const std::string& sentence) {
  static const std::regex option("--([a-z]+(?:-[a-z]+)*)|^([a-z]+(?:-[a-z]+)*)(?=:)");
  std::string text;
  auto from = sentence.begin();
  for (std::sregex_iterator at(sentence.begin(), sentence.end(), option), end; at != end; ++at) {
    text.append(from, (*at)[0].first);
    text += argument_of((*at)[1].matched ? (*at)[1].str() : (*at)[2].str());
    from = (*at)[0].second;
  }
  return text.append(from, sentence.end());
}

void raise(const char* kind, const std::string& what) {
  const py::object type = py::module_::import("metastable._errors").attr(kind);
  PyErr_SetString(type.ptr(), in_python(what).c_str());
}

// Exit code 2 of the command line is a ValueError here, code 3 a ComputationError.
void translate(std::exception_ptr thrown) {
  try {
    if (thrown) std::rethrow_exception(thrown);
  } catch (const py::error_already_set&) {
    throw;
  } catch (const py::builtin_exception&) {
    throw;
  } catch (const WrongKind& error) {
    raise("InputTypeError", error.what());
  } catch (const analysis::InputError& error) {
    raise("InputError", error.what());
  } catch (const std::invalid_argument& error) {
    raise("InputError", error.what());
  } catch (const std::filesystem::filesystem_error& error) {
    raise("InputError", error.what());
  } catch (const markov::Disagreement& error) {
    raise("Contradiction", error.what());
  } catch (const analysis::Contradiction& error) {
    raise("Contradiction", error.what());
  } catch (const markov::MapError& error) {
    raise("MapError", error.what());
  } catch (const Interrupted&) {
    PyErr_SetNone(PyExc_KeyboardInterrupt);
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& error) {
    raise("ComputationError", error.what());
  }
}

int run_command_line(const std::vector<std::string>& words) {
  std::vector<const char*> argv;
  for (const std::string& word : words) argv.push_back(word.c_str());
  return reports::run(static_cast<int>(argv.size()), argv.data());
}

}  // namespace
}  // namespace metastable::reports::python

PYBIND11_MODULE(_metastable, module) {
  using namespace metastable::reports;
  namespace py = pybind11;
  py::options options;
  options.disable_function_signatures();
  py::register_exception_translator(python::translate);
  module.attr("version") = version();
  module.def("version_text", version_text);
  module.def("run_command_line", python::run_command_line, py::call_guard<py::gil_scoped_release>());
  python::add_blind(module);
  python::add_studies(module);
  python::add_experiments(module);
  python::add_machines(module);
  python::add_maps(module);
  python::add_chains(module);
}
