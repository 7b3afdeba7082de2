#include "markov/ranks/ranks.h"

#include <slepcsys.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <climits>
#include <cstdlib>
#include <memory>
#include <stdexcept>
#include <thread>

#include "markov/chain/chain.h"
#include "markov/ranks/petsc_call.h"

namespace metastable::markov {
namespace {

constexpr int text_tag = 1;

void require_mpi(int code, const char* what) {
  if (code != MPI_SUCCESS) throw std::runtime_error(std::string("MPI: ") + what + " failed");
}

int as_count(std::size_t n) {
  if (n > INT_MAX) throw std::length_error("MPI: a message of more than 2^31 bytes; take more ranks");
  return static_cast<int>(n);
}

}  // namespace

void petsc(int code) {
  if (code == 0) return;
  const char* text = nullptr;
  PetscErrorMessage(code, &text, nullptr);
  throw ConvergenceError("PETSc", 0, text != nullptr ? text : "an error without a name");
}

struct Ranks::Sent {
  std::unique_ptr<std::string> text;
  MPI_Request request;
};

Ranks::Ranks() {
  PetscOptionsSetValue(nullptr, "-no_signal_handler", "true");
  if (SlepcInitializeNoArguments() != 0) throw std::runtime_error("SLEPc cannot be started");
  PetscPushErrorHandler(PetscReturnErrorHandler, nullptr);  // callers throw
  MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
  MPI_Comm_size(MPI_COMM_WORLD, &ranks_);
}

Ranks::~Ranks() {
  for (Sent& sent : sent_) MPI_Wait(&sent.request, MPI_STATUS_IGNORE);
  SlepcFinalize();
}

double Ranks::sum(double own) {
  double all = 0;
  require_mpi(MPI_Allreduce(&own, &all, 1, MPI_DOUBLE, MPI_SUM, MPI_COMM_WORLD), "a sum");
  return all;
}

double Ranks::largest(double own) {
  double all = 0;
  require_mpi(MPI_Allreduce(&own, &all, 1, MPI_DOUBLE, MPI_MAX, MPI_COMM_WORLD), "a maximum");
  return all;
}

void Ranks::add_up(std::span<double> values) {
  require_mpi(MPI_Allreduce(MPI_IN_PLACE, values.data(), as_count(values.size()), MPI_DOUBLE, MPI_SUM, MPI_COMM_WORLD),
              "a sum");
}

double Ranks::sum_before(double own) {
  double before = 0;
  require_mpi(MPI_Exscan(&own, &before, 1, MPI_DOUBLE, MPI_SUM, MPI_COMM_WORLD), "a sum");
  return rank_ == 0 ? 0 : before;
}

std::vector<double> Ranks::gather(double own) {
  std::vector<double> all(static_cast<std::size_t>(ranks_));
  require_mpi(MPI_Allgather(&own, 1, MPI_DOUBLE, all.data(), 1, MPI_DOUBLE, MPI_COMM_WORLD), "a gathering");
  return all;
}

std::vector<std::vector<Exchange::Note>> Ranks::swap(const std::vector<std::vector<Note>>& to) {
  const auto n = static_cast<std::size_t>(ranks_);
  std::vector<double> counts(n);
  std::vector<MPI_Request> requests;
  std::vector<std::vector<Note>> from(n);
  for (std::size_t r = 0; r < n; ++r) counts[r] = static_cast<double>(to[r].size());
  std::vector<double> coming(n);
  require_mpi(MPI_Alltoall(counts.data(), 1, MPI_DOUBLE, coming.data(), 1, MPI_DOUBLE, MPI_COMM_WORLD), "an exchange");
  for (std::size_t r = 0; r < n; ++r) {
    from[r].resize(static_cast<std::size_t>(coming[r]));
    if (!from[r].empty())
      MPI_Irecv(from[r].data(), as_count(from[r].size() * sizeof(Note)), MPI_BYTE, static_cast<int>(r), 0,
                MPI_COMM_WORLD, &requests.emplace_back());
  }
  for (std::size_t r = 0; r < n; ++r)
    if (!to[r].empty())
      MPI_Isend(to[r].data(), as_count(to[r].size() * sizeof(Note)), MPI_BYTE, static_cast<int>(r), 0, MPI_COMM_WORLD,
                &requests.emplace_back());
  require_mpi(MPI_Waitall(as_count(requests.size()), requests.data(), MPI_STATUSES_IGNORE), "an exchange");
  return from;
}

std::string Ranks::first_text(const std::string& own) {
  const double first = -largest(own.empty() ? -static_cast<double>(ranks_) : -static_cast<double>(rank_));
  const int from = static_cast<int>(first);
  if (from == ranks_) return {};
  int length = as_count(own.size());
  MPI_Bcast(&length, 1, MPI_INT, from, MPI_COMM_WORLD);
  std::string text = rank_ == from ? own : std::string(static_cast<std::size_t>(length), ' ');
  MPI_Bcast(text.data(), length, MPI_CHAR, from, MPI_COMM_WORLD);
  return text;
}

void Ranks::send(const std::string& text) {
  Sent& sent = sent_.emplace_back(Sent{std::make_unique<std::string>(text), MPI_REQUEST_NULL});
  require_mpi(MPI_Isend(sent.text->data(), as_count(text.size()), MPI_CHAR, 0, text_tag, MPI_COMM_WORLD, &sent.request),
              "a message");
}

std::string Ranks::receive(int from, void (*waiting)()) {
  MPI_Status status;
  for (int here = 0; here == 0;) {
    require_mpi(MPI_Iprobe(from, text_tag, MPI_COMM_WORLD, &here, &status), "a message");
    if (here != 0) break;
    waiting();
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  int length = 0;
  MPI_Get_count(&status, MPI_CHAR, &length);
  std::string text(static_cast<std::size_t>(length), ' ');
  require_mpi(MPI_Recv(text.data(), length, MPI_CHAR, from, text_tag, MPI_COMM_WORLD, MPI_STATUS_IGNORE), "a message");
  return text;
}

void Ranks::abort(int exit_code) {
  MPI_Abort(MPI_COMM_WORLD, exit_code);
  std::abort();
}

double peak_memory() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return 1024.0 * static_cast<double>(usage.ru_maxrss);
}

}  // namespace metastable::markov
