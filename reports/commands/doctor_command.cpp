#include "reports/commands/doctor_command.h"

#include <fmt/format.h>
#include <signal.h>
#include <stdio.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <string>
#include <thread>

#include "reports/import/mat_file.h"
#include "reports/output/answer.h"
#include "reports/output/version.h"

namespace metastable::reports {
namespace {

struct Said {
  std::string line;   // the first that a program prints; "" where there is no such program
  bool late = false;  // it did not end in time, and was ended
};

// Asks a program, which timeout(1) ends with all that it has started.
Said first_line(const std::string& command, double seconds) {
  FILE* const pipe = ::popen(fmt::format("timeout -k 1 {} {} 2>/dev/null", seconds, command).c_str(), "r");
  if (pipe == nullptr) return {};
  std::array<char, 200> line{};
  std::string text = std::fgets(line.data(), line.size(), pipe) == nullptr ? "" : line.data();
  text.resize(std::min(text.find('\n'), text.size()));
  const int status = ::pclose(pipe);
  constexpr int ended = 124, killed = 128 + SIGKILL;  // as timeout(1) says it
  const int code = WIFEXITED(status) ? WEXITSTATUS(status) : 0;
  const bool late = code == ended || code == killed;
  return {late ? "" : text, late};
}

}  // namespace

void run_doctor(const std::string& json, double seconds) {
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
  const auto tell = [&](const char* name, const Said& found, const std::string& there, const char* missing) {
    if (found.late)
      answer.say("{}: did not answer within {} s and was ended", name, seconds);
    else
      answer.say("{}", found.line.empty() ? missing : there);
    answer.fact(name, found.line);
  };
  const Said gnuplot = first_line("gnuplot --version", seconds);
  tell("gnuplot", gnuplot, fmt::format("gnuplot: {}, which draws the figures", gnuplot.line),
       "gnuplot: missing; figures (report, study, sweep, describe and diagnose --out) need it: install gnuplot-nox");
  const std::string matio = mat_library();
  tell("libmatio", {matio}, fmt::format("libmatio: {}, with which `import` reads MAT files", matio),
       "libmatio: not built in; `import` reads CSV only: install libmatio-dev and build again for MAT files");
  const Said module = first_line(
      "python3 -c 'import metastable, sys; print(metastable.__version__, \"for\", sys.executable)'", seconds);
  tell("python_module", module, fmt::format("Python module: {}", module.line),
       "Python module: python3 does not find it; with it settings, trials, chains and simulators of your own are asked "
       "from NumPy: ./run python (needs pybind11-dev, python3-dev and python3-numpy)");
  const Said ranks = first_line("sh -c 'command -v metastable-mpi'", seconds);
  tell("metastable_mpi", ranks,
       fmt::format("metastable-mpi: {}, which shares meshes and sweeps between machines", ranks.line),
       "metastable-mpi: not on the PATH; it shares meshes and sweeps between machines: ./run test-mpi builds it (needs "
       "libpetsc-real-dev, libslepc-real-dev and openmpi-bin)");
  answer.finish({"metastable doctor", {}, 0, version()});
}

}  // namespace metastable::reports
