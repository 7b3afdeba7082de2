#include "markov/ranks/shared_mesh.h"

#include <petscmat.h>

#include <climits>
#include <stdexcept>
#include <utility>

#include "markov/ranks/petsc_call.h"

namespace metastable::markov {

SharedMesh::SharedMesh(const BatchMap& map, std::vector<NoiseFrame> frames, std::span<const double> start,
                       const MeshOptions& options, Ranks& ranks)
    : ranks_(ranks) {
  require_start(map, start);
  lattice_ = mesh_lattice(map, std::move(frames), options);
  {
    MeshGrowth growth(map, lattice_, options, &ranks);
    growth.grow_from(start);
    cheapest_failure_ = growth.cheapest_failure();
    take_start(growth, start);
    take_rows(growth);
  }
  const auto own = static_cast<PetscInt>(size());
  petsc(MatCreateMPIAIJWithSplitArrays(
      PETSC_COMM_WORLD, own, own, PETSC_DETERMINE, PETSC_DETERMINE, diagonal_.row_start.data(), diagonal_.column.data(),
      diagonal_.value.data(), others_.row_start.data(), others_.column.data(), others_.value.data(), &matrix_));
}

SharedMesh::~SharedMesh() { MatDestroy(&matrix_); }

void SharedMesh::take_start(const MeshGrowth& growth, std::span<const double> start) {
  start_.assign(growth.rows(), 0.0);
  NodeLattice::Point point{};
  NodeSimplex simplex;
  if (!lattice_.locate(0, start.data(), point)) return;
  lattice_.find_simplex(0, point, 0, simplex);
  for (std::size_t i = 0; i <= start.size(); ++i) {
    const std::uint32_t node = growth.node(simplex.key[i]);
    if (node == NodeTable::none || growth.row(node) == MeshGrowth::no_row) continue;
    start_[growth.row(node)] += simplex.weight[i];
  }
}

/// Asks the owners for the numbers of nodes that rows lead to; -1 for those that nobody landed.
std::vector<double> SharedMesh::numbers_of_others(const MeshGrowth& growth, double first) {
  const auto n = static_cast<std::size_t>(ranks_.ranks());
  std::vector<std::vector<Exchange::Note>> asked(n), answers;
  std::vector<std::vector<std::uint32_t>> about(n);
  for (std::uint32_t node = 0; node < growth.nodes(); ++node) {
    if (growth.own(node)) continue;
    const auto owner = static_cast<std::size_t>(growth.owner(growth.key(node)));
    asked[owner].push_back({growth.key(node), 0});
    about[owner].push_back(node);
  }
  answers = ranks_.swap(asked);
  for (auto& notes : answers)
    for (Exchange::Note& note : notes) {
      const std::uint32_t node = growth.node(note.key);
      const bool landed = node != NodeTable::none && growth.row(node) != MeshGrowth::no_row;
      note.value = landed ? first + growth.row(node) : -1;
    }
  answers = ranks_.swap(answers);
  std::vector<double> number(growth.nodes(), -1);
  for (std::size_t r = 0; r < n; ++r)
    for (std::size_t i = 0; i < about[r].size(); ++i) number[about[r][i]] = answers[r][i].value;
  return number;
}

/// Own columns are counted from the first own row, the others' from the first row of all. Gives back the entries of
/// the grown mesh as it goes, so that no two copies of all are ever held.
void SharedMesh::take_rows(MeshGrowth& growth) {
  const std::size_t rows = growth.rows();
  const double first = ranks_.sum_before(static_cast<double>(rows));
  nodes_ = static_cast<std::uint64_t>(ranks_.sum(static_cast<double>(rows)));
  const std::vector<double> number = numbers_of_others(growth, first);
  std::size_t own = 0, others = 0;
  const auto kind = [&](std::uint32_t to) {  // of an entry: 0 own, 1 another rank's, 2 leads out of the mesh
    if (growth.own(to)) return growth.row(to) == MeshGrowth::no_row ? 2 : 0;
    return number[to] < 0 ? 2 : 1;
  };
  for (std::size_t row = 0; row < rows; ++row)
    for (const std::uint32_t to : growth.columns(row)) {
      own += kind(to) == 0;
      others += kind(to) == 1;
    }
  if (ranks_.largest(static_cast<double>(std::max(own, others))) > INT_MAX || nodes_ > INT_MAX)
    throw std::length_error("mesh: more than 2^31 entries on a rank, or nodes in all; take more ranks");
  for (auto [entries, count] : {std::pair(&diagonal_, own), std::pair(&others_, others)}) {
    entries->column.reserve(count);
    entries->value.reserve(count);
    entries->row_start.reserve(rows + 1);
  }
  for (std::size_t row = 0; row < rows; ++row) {
    double leave = growth.leave(row);
    for (std::size_t e = 0; e < growth.columns(row).size(); ++e) {
      const std::uint32_t to = growth.columns(row)[e];
      const double value = growth.values(row)[e];
      const int k = kind(to);
      if (k == 2) {
        leave += value;
        continue;
      }
      Entries& entries = k == 0 ? diagonal_ : others_;
      entries.column.push_back(static_cast<int>(k == 0 ? growth.row(to) : number[to]));
      entries.value.push_back(value);
    }
    for (Entries* entries : {&diagonal_, &others_})
      entries->row_start.push_back(static_cast<int>(entries->column.size()));
    key_.push_back(growth.key(growth.node_of_row(row)));
    kill_.push_back(growth.kill(row));
    leave_.push_back(leave);
    growth.forget_entries_before(row);
  }
  entries_ = static_cast<std::uint64_t>(ranks_.sum(static_cast<double>(own_entries())));
}

namespace {

/// Takes spans as vectors of PETSc, for one product.
void multiply(PetscErrorCode product(Mat, Vec, Vec), Mat matrix, std::span<const double> x, std::span<double> y) {
  Vec from = nullptr, to = nullptr;
  const auto n = static_cast<PetscInt>(x.size());
  petsc(VecCreateMPIWithArray(PETSC_COMM_WORLD, 1, n, PETSC_DETERMINE, x.data(), &from));
  petsc(VecCreateMPIWithArray(PETSC_COMM_WORLD, 1, n, PETSC_DETERMINE, y.data(), &to));
  petsc(product(matrix, from, to));
  VecDestroy(&from);
  VecDestroy(&to);
}

}  // namespace

void SharedMesh::apply_left(std::span<const double> x, std::span<double> y) const {
  multiply(MatMultTranspose, matrix_, x, y);
}

void SharedMesh::apply(std::span<const double> x, std::span<double> y) const { multiply(MatMult, matrix_, x, y); }

MassRows SharedMesh::rows() const {
  return {phases(), kill_, leave_, [this](auto x, auto y) { apply_left(x, y); },
          [this](std::span<double> values) { ranks_.add_up(values); }};
}

}  // namespace metastable::markov
