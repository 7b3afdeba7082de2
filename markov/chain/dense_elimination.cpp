#include "markov/chain/dense_elimination.h"

#include <algorithm>
#include <memory>
#include <numeric>

#ifdef METASTABLE_AVX2
#define METASTABLE_WIDEST __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define METASTABLE_WIDEST
#endif

namespace metastable::markov::dense {
namespace {

/// So few pivots are no longer halved.
constexpr std::size_t few_pivots = 16;

/// Returns where `pivots` are halved: at a multiple of few_pivots.
std::size_t half(std::size_t pivots) { return (pivots / 2 + few_pivots - 1) / few_pivots * few_pivots; }

constexpr std::size_t tile_rows = 6;
std::size_t tiles(std::size_t count, std::size_t size) { return (count + size - 1) / size; }

using Two = double __attribute__((vector_size(16)));
using Four = double __attribute__((vector_size(32)));
/// May lie wherever a double may.
template <class Vector>
struct __attribute__((packed, may_alias)) Loose {
  Vector vector;
};

// Takes tiles of the product below one another, each in registers over all pivots, two vectors of a row at a time.
// Visits are packed tile after tile, tile_rows a pivot.
template <class Vector>
[[gnu::always_inline]] inline void add_tiles_by(Part target, const double* visits, const TileRow* onward,
                                                std::size_t count, std::size_t pivots) {
  constexpr std::size_t width = sizeof(Vector) / sizeof(double);
  for (std::size_t tile = 0; tile < count; ++tile, visits += tile_rows * pivots) {
    const Part top = target.from(tile * tile_rows, 0);
    if (tile + 1 < count) {
      for (std::size_t r = tile_rows; r < 2 * tile_rows; ++r) {
        __builtin_prefetch(top.row(r), 1);
        __builtin_prefetch(top.row(r) + tile_columns - 1, 1);
      }
    }
    for (std::size_t j = 0; j < tile_columns; j += 2 * width) {
      const auto at = [=](std::size_t r, std::size_t second) -> Loose<Vector>& {
        return reinterpret_cast<Loose<Vector>*>(top.row(r) + j)[second];
      };
      Vector a0 = at(0, 0).vector, a1 = at(1, 0).vector, a2 = at(2, 0).vector;
      Vector a3 = at(3, 0).vector, a4 = at(4, 0).vector, a5 = at(5, 0).vector;
      Vector b0 = at(0, 1).vector, b1 = at(1, 1).vector, b2 = at(2, 1).vector;
      Vector b3 = at(3, 1).vector, b4 = at(4, 1).vector, b5 = at(5, 1).vector;
      const double* visit = visits;
      for (std::size_t n = 0; n < pivots; ++n, visit += tile_rows) {
        const auto* const entry = reinterpret_cast<const Loose<Vector>*>(onward[n].entry + j);
        const Vector a = entry[0].vector, b = entry[1].vector;
        a0 += visit[0] * a, b0 += visit[0] * b;
        a1 += visit[1] * a, b1 += visit[1] * b;
        a2 += visit[2] * a, b2 += visit[2] * b;
        a3 += visit[3] * a, b3 += visit[3] * b;
        a4 += visit[4] * a, b4 += visit[4] * b;
        a5 += visit[5] * a, b5 += visit[5] * b;
      }
      at(0, 0) = {a0}, at(1, 0) = {a1}, at(2, 0) = {a2}, at(3, 0) = {a3}, at(4, 0) = {a4}, at(5, 0) = {a5};
      at(0, 1) = {b0}, at(1, 1) = {b1}, at(2, 1) = {b2}, at(3, 1) = {b3}, at(4, 1) = {b4}, at(5, 1) = {b5};
    }
  }
}

#ifdef METASTABLE_AVX2
__attribute__((target("avx2"))) void add_wide_tiles(Part target, const double* visits, const TileRow* onward,
                                                    std::size_t count, std::size_t pivots) {
  add_tiles_by<Four>(target, visits, onward, count, pivots);
}
#endif

void add_tiles(Part target, const double* visits, const TileRow* onward, std::size_t count, std::size_t pivots) {
#ifdef METASTABLE_AVX2
  if (__builtin_cpu_supports("avx2")) return add_wide_tiles(target, visits, onward, count, pivots);
#endif
  add_tiles_by<Two>(target, visits, onward, count, pivots);
}

void copy(Part from, Part to, std::size_t rows, std::size_t columns) {
  for (std::size_t i = 0; i < rows; ++i) std::copy_n(from.row(i), columns, to.row(i));
}

void multiply(Part target, Part visits, Part onward, std::size_t rows, std::size_t pivots, std::size_t columns) {
  const auto packed = std::make_unique_for_overwrite<TileRow[]>(tiles(columns, tile_columns) * pivots);
  pack(onward, pivots, columns, packed.get());
  add_product(target, visits, packed.get(), rows, pivots, columns);
}

METASTABLE_WIDEST void eliminate_few_columns(Part rows, Part factor, std::size_t pivots, std::size_t count) {
  for (std::size_t n = pivots; n-- > 1;) {
    const double* const from = rows.row(n);
    for (std::size_t i = 0; i < n; ++i) {
      double* const to = rows.row(i);
      const double visit = factor.row(i)[n];
      for (std::size_t j = 0; j < count; ++j) to[j] += visit * from[j];
    }
  }
}

METASTABLE_WIDEST void visit_few_pivots(Part visits, std::size_t count, Part square, const double* exit,
                                        std::size_t pivots) {
  // It takes rows side by side, transposed: the recursion runs down the pivots of each.
  constexpr std::size_t lanes = 8;
  double lane[few_pivots][lanes] = {};
  for (std::size_t first = 0; first < count; first += lanes) {
    const std::size_t used = std::min(lanes, count - first);
    for (std::size_t r = 0; r < used; ++r)
      for (std::size_t n = 0; n < pivots; ++n) lane[n][r] = visits.row(first + r)[n];
    for (std::size_t n = pivots; n-- > 0;) {
      for (std::size_t r = 0; r < lanes; ++r) lane[n][r] /= exit[n];
      for (std::size_t j = 0; j < n; ++j)
        for (std::size_t r = 0; r < lanes; ++r) lane[j][r] += lane[n][r] * square.row(n)[j];
    }
    for (std::size_t r = 0; r < used; ++r)
      for (std::size_t n = 0; n < pivots; ++n) visits.row(first + r)[n] = lane[n][r];
  }
}

// Does what eliminate_square does, with `left` columns before the pivots' own.
void eliminate_pivots(Part rows, std::size_t left, double* exit, std::size_t pivots) {
  const Part own = rows.from(0, left);
  if (pivots > few_pivots) {
    const std::size_t upper = half(pivots), lower = pivots - upper;
    const Part last = rows.from(upper, 0);
    eliminate_pivots(last, left + upper, exit + upper, lower);
    visit_pivots(own.from(0, upper), upper, own.from(upper, upper), exit + upper, lower);
    multiply(rows, own.from(0, upper), last, upper, lower, left + upper);
    eliminate_pivots(rows, left, exit, upper);
    return;
  }
  double beyond[few_pivots];
  for (std::size_t i = 0; i < pivots; ++i) beyond[i] = std::accumulate(rows.row(i), rows.row(i) + left, 0.0);
  for (std::size_t n = pivots; n-- > 0;) {
    exit[n] = std::accumulate(own.row(n), own.row(n) + n, beyond[n]);
    for (std::size_t i = 0; i < n; ++i) {
      double* const to = own.row(i);
      to[n] /= exit[n];
      for (std::size_t j = 0; j < n; ++j) to[j] += to[n] * own.row(n)[j];
      beyond[i] += to[n] * beyond[n];
    }
  }
  eliminate_columns(rows, own, pivots, left);
}

}  // namespace

void eliminate_square(Part square, double* exit, std::size_t pivots) { eliminate_pivots(square, 1, exit, pivots); }

void eliminate_columns(Part rows, Part factor, std::size_t pivots, std::size_t count) {
  if (pivots <= few_pivots) return eliminate_few_columns(rows, factor, pivots, count);
  const std::size_t upper = half(pivots), lower = pivots - upper;
  const Part last = rows.from(upper, 0);
  eliminate_columns(last, factor.from(upper, upper), lower, count);
  multiply(rows, factor.from(0, upper), last, upper, lower, count);
  eliminate_columns(rows, factor, upper, count);
}

void visit_pivots(Part visits, std::size_t count, Part square, const double* exit, std::size_t pivots) {
  if (pivots <= few_pivots) return visit_few_pivots(visits, count, square, exit, pivots);
  const std::size_t upper = half(pivots), lower = pivots - upper;
  const Part last = visits.from(0, upper);
  visit_pivots(last, count, square.from(upper, upper), exit + upper, lower);
  multiply(visits, last, square.from(upper, 0), count, lower, upper);
  visit_pivots(visits, count, square, exit, upper);
}

void pack(Part onward, std::size_t pivots, std::size_t columns, TileRow* packed) {
  for (std::size_t j = 0; j < columns; j += tile_columns) {
    const std::size_t width = std::min(tile_columns, columns - j);
    for (std::size_t n = 0; n < pivots; ++n, ++packed) {
      if (width < tile_columns) *packed = {};
      std::copy_n(onward.row(n) + j, width, packed->entry);
    }
  }
}

void add_product(Part target, Part visits, const TileRow* onward, std::size_t rows, std::size_t pivots,
                 std::size_t columns) {
  const std::size_t whole = rows / tile_rows, all = tiles(rows, tile_rows);
  const auto packed = std::make_unique_for_overwrite<double[]>(all * tile_rows * pivots);
  double* to = packed.get();
  for (std::size_t i = 0; i < all * tile_rows; i += tile_rows)
    for (std::size_t n = 0; n < pivots; ++n)
      for (std::size_t r = i; r < i + tile_rows; ++r) *to++ = r < rows ? visits.row(r)[n] : 0.0;
  // At the edges a tile reaches beyond the target.
  double tile[tile_rows * tile_columns] = {};
  const Part edge{tile, tile_columns};
  const auto add_at_edge = [&](std::size_t i, std::size_t j) {
    const Part from = target.from(i, j);
    const std::size_t height = std::min(tile_rows, rows - i), width = std::min(tile_columns, columns - j);
    copy(from, edge, height, width);
    add_tiles(edge, packed.get() + i * pivots, onward, 1, pivots);
    copy(edge, from, height, width);
  };
  for (std::size_t j = 0; j < columns; j += tile_columns, onward += pivots) {
    const std::size_t inside = j + tile_columns <= columns ? whole : 0;
    add_tiles(target.from(0, j), packed.get(), onward, inside, pivots);
    for (std::size_t i = inside; i < all; ++i) add_at_edge(i * tile_rows, j);
  }
}

}  // namespace metastable::markov::dense
