#include "reports/commands/doctor_command.h"

#include <stdio.h>

#include <array>
#include <memory>
#include <string>
#include <thread>

#include "reports/import/mat_file.h"
#include "reports/output/answer.h"
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

void run_doctor(const std::string& json) {
  Answer answer(json);
  const unsigned cores = std::thread::hardware_concurrency();
  answer.say("{}", version_text());
  answer.say("cores: {}; every answer is the same bits on any number of them", cores);
  answer.fact("version", version());
  answer.fact("cores", cores);
#if defined(__x86_64__)
  const bool avx2 = __builtin_cpu_supports("avx2");
  answer.say("vectors: {}", avx2 ? "AVX2, which the sampled chain, walkers and densities use"
                                 : "SSE2 (a machine with AVX2 takes some two thirds of the time, for the same bits)");
  answer.fact("vectors", avx2 ? "AVX2" : "SSE2");
#endif
  // A piece that may be missing: what is said where it is there, and where it is not.
  const auto tell = [&](const char* name, const std::string& found, const std::string& there, const char* missing) {
    answer.say("{}", found.empty() ? missing : there);
    answer.fact(name, found);
  };
  const std::string gnuplot = first_line("gnuplot --version 2>/dev/null");
  tell("gnuplot", gnuplot, fmt::format("gnuplot: {}, which draws the figures", gnuplot),
       "gnuplot: missing; figures (report, study, sweep, describe and diagnose --out) need it: install gnuplot-nox");
  const std::string matio = mat_library();
  tell("libmatio", matio, fmt::format("libmatio: {}, with which `import` reads MAT files", matio),
       "libmatio: not built in; `import` reads CSV only: install libmatio-dev and build again for MAT files");
  const std::string module = first_line(
      "python3 -c 'import metastable, sys; print(metastable.__version__, \"for\", sys.executable)' 2>/dev/null");
  tell("python_module", module, fmt::format("Python module: {}", module),
       "Python module: python3 does not find it; with it settings, trials, chains and simulators of your own are asked "
       "from NumPy: ./run python (needs pybind11-dev, python3-dev and python3-numpy)");
  const std::string ranks = first_line("command -v metastable-mpi 2>/dev/null");
  tell("metastable_mpi", ranks,
       fmt::format("metastable-mpi: {}, which shares meshes and sweeps between machines", ranks),
       "metastable-mpi: not on the PATH; it shares meshes and sweeps between machines: ./run test-mpi builds it (needs "
       "libpetsc-real-dev, libslepc-real-dev and openmpi-bin)");
  answer.finish({"metastable doctor", {}, 0, version()});
}

}  // namespace metastable::reports
