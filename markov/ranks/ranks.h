#pragma once
// Runs the processes of one run under mpirun. MPI, PETSc and SLEPc stay in the .cpp files of this room.

#include <span>
#include <string>
#include <vector>

#include "markov/mesh/mesh_growth.h"

namespace metastable::markov {

/// Starts MPI, PETSc and SLEPc, and ends them; one a program. All ranks call the same functions in the same order,
/// except send() and receive().
class Ranks : public Exchange {
 public:
  Ranks();
  ~Ranks() override;
  Ranks(const Ranks&) = delete;
  Ranks& operator=(const Ranks&) = delete;

  int rank() const override { return rank_; }
  int ranks() const override { return ranks_; }
  double sum(double own) override;
  double largest(double own) override;
  std::vector<std::vector<Note>> swap(const std::vector<std::vector<Note>>& to) override;
  std::string first_text(const std::string& own) override;

  void add_up(std::span<double> values);
  /// Returns the sum of what the ranks before this one say.
  double sum_before(double own);
  /// Returns one number of every rank, in their order.
  std::vector<double> gather(double own);

  /// Hands a text to rank 0 without waiting for it.
  void send(const std::string& text);
  /// Returns, on rank 0, the next text of a rank, in the order it was sent. Waits for it, calling `waiting` meanwhile.
  std::string receive(int from, void (*waiting)());
  /// Ends all ranks at once with this exit code, for a failure that the others do not see.
  [[noreturn]] void abort(int exit_code);

 private:
  struct Sent;
  int rank_ = 0, ranks_ = 1;
  std::vector<Sent> sent_;
};

/// Returns the most memory that this process has held so far [bytes].
double peak_memory();

}  // namespace metastable::markov
