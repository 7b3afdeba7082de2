// metastable-mpi runs what of `metastable` goes on several machines, under mpirun.

#include <fmt/format.h>

#include <cstdio>
#include <stdexcept>

#include "reports/command_line/cli.h"
#include "reports/command_line/walker_options.h"
#include "reports/commands/sweep_file.h"
#include "reports/output/interrupt.h"
#include "reports/ranks/mesh_command.h"

namespace metastable::reports {
namespace {

constexpr dynamics::Range spacings{.low = 0, .high = 2, .low_open = true};
constexpr dynamics::Range gigabytes{.low = 0.001, .high = 1e6};
constexpr dynamics::Range margins{.low = 1, .high = 40};

/// Failures that all ranks meet alike are theirs to report; any other ends them all.
template <class F>
void or_abort(markov::Ranks& ranks, bool alike, F work) {
  const auto end = [&](const char* what, int code) {
    std::fputs(fmt::format("metastable-mpi: rank {}: {}\n", ranks.rank(), what).c_str(), stderr);
    ranks.abort(code);
  };
  try {
    work();
  } catch (const Interrupted& interrupted) {
    end(interrupted.what(), interrupted.exit_code());
  } catch (const std::invalid_argument&) {  // options, and files of the first rank, which told the others
    throw;
  } catch (const std::bad_alloc&) {
    end("there is not enough memory for this", 3);
  } catch (const std::exception& error) {
    if (alike) throw;
    end(error.what(), 3);
  }
}

Command mesh_command(markov::Ranks& ranks) {
  return {"mesh", "Expected steps of a walker on one mesh, whose rows the ranks share",
          [](Options& o) {
            o.add("slope", "DEG", "", "Mean slope [deg] (default: 0.009 rad of the simplest walker, 3 deg)");
            add_walker(o, "DEG", false);
            o.add("spacing", "SD", "", "Of the mesh's nodes, in stationary sds of the noise; needed", spacings);
            o.add("shift", "N", "0", "Which random shift of the mesh, 0..1000");
            o.add("margin", "ACTION", "12", "How far beyond the cheapest failure the mesh reaches", margins);
            o.add("memory", "GB", "3", "Most memory of a rank for its rows while they are landed", gigabytes);
            o.add_seed();
            o.add_json();
          },
          [&ranks](const Options& o, const std::string& line) {
            if (!asks_for_walker(o)) throw std::invalid_argument("--walker: is needed");
            if (!o.given("spacing")) throw std::invalid_argument("--spacing: is needed");
            const WalkerRequest walker = walker_request(o, line, {"shift", "margin"});
            SharedMeshRequest request{walker.settings.front(), {}, walker.json, line};
            request.setting.map();  // wrong settings before any work
            request.mesh.spacing = o.number("spacing");
            request.mesh.seed = o.seed();
            request.mesh.shift = static_cast<std::uint32_t>(o.count("shift", 0, 1000));
            request.mesh.margin = o.number("margin");
            request.mesh.most_bytes = static_cast<std::size_t>(o.number("memory") * 0x1p30);
            or_abort(ranks, true, [&] { run_shared_mesh(request, ranks); });
          }};
}

int run_on(markov::Ranks& ranks, int argc, const char* const* argv) {
  const Sharing sharing{ranks.rank(), ranks.ranks(),
                        [&](std::size_t own) {
                          return static_cast<std::size_t>(ranks.sum(ranks.rank() == 0 ? static_cast<double>(own) : 0));
                        },
                        [&](const std::string& row) { ranks.send(row); },
                        [&](int rank) { return ranks.receive(rank, check_interrupt); }};
  Command sweep = sweep_command(&sharing);
  sweep.summary += "; points shared by the ranks";
  const auto run_sweep = sweep.run;
  sweep.run = [&](const Options& o, const std::string& line) {
    if (o.threads() > 1) throw std::invalid_argument("--threads: a rank has one; start more ranks");
    // The first writes files, and only it can fail in that.
    or_abort(ranks, ranks.rank() == 0, [&] { run_sweep(o, line); });
  };
  return run({"metastable-mpi",
              "Meshes and sweeps across the ranks of mpirun",
              {mesh_command(ranks), sweep},
              ranks.rank() != 0},
             argc, argv);
}

}  // namespace
}  // namespace metastable::reports

int main(int argc, char** argv) {
  metastable::markov::Ranks ranks;
  if (ranks.rank() != 0 && std::freopen("/dev/null", "w", stdout) == nullptr) return 3;  // one of them speaks
  return metastable::reports::run_on(ranks, argc, argv);
}
