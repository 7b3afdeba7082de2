#include "reports/commands/doctor_command.h"

#include <fmt/format.h>
#include <stdio.h>

#include <array>
#include <memory>
#include <string>
#include <thread>

#include "reports/import/mat_rows.h"
#include "reports/output/standard_output.h"
#include "reports/output/version.h"

namespace metastable::reports {
namespace {

// Returns the first line that a program prints, or "" where there is no such program.
std::string first_line(const char* command) {
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(::popen(command, "r"), ::pclose);
  if (!pipe) return "";
  std::array<char, 200> line{};
  if (std::fgets(line.data(), line.size(), pipe.get()) == nullptr) return "";
  const std::string text = line.data();
  return text.substr(0, text.find('\n'));
}

}  // namespace

void run_doctor() {
  say("{}\n", version_text());
  say("cores: {}; every answer is the same bits on any number of them\n", std::thread::hardware_concurrency());
#if defined(__x86_64__)
  say("vectors: {}\n", __builtin_cpu_supports("avx2")
                           ? "AVX2, which the sampled chain, walkers and densities use"
                           : "SSE2 (a machine with AVX2 takes some two thirds of the time, for the same bits)");
#endif
  const std::string gnuplot = first_line("gnuplot --version 2>/dev/null");
  if (gnuplot.empty())
    say("gnuplot: missing; figures (report, study, sweep, describe and diagnose --out) need it: install "
        "gnuplot-nox\n");
  else
    say("gnuplot: {}, which draws the figures\n", gnuplot);
  if (const std::string matio = mat_library(); matio.empty())
    say("libmatio: not built in; `import` reads CSV only: install libmatio-dev and build again for MAT files\n");
  else
    say("libmatio: {}, with which `import` reads MAT files\n", matio);
  const std::string module = first_line(
      "python3 -c 'import metastable, sys; print(metastable.__version__, \"for\", sys.executable)' 2>/dev/null");
  if (module.empty())
    say("Python module: python3 does not find it; with it settings, trials, chains and simulators of your own are "
        "asked from NumPy: ./run python (needs pybind11-dev, python3-dev and python3-numpy)\n");
  else
    say("Python module: {}\n", module);
}

}  // namespace metastable::reports
