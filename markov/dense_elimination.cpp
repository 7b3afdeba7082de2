#include "markov/dense_elimination.h"

#include <algorithm>
#include <vector>

#ifdef METASTABLE_AVX2
#define METASTABLE_WIDE __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define METASTABLE_WIDE
#endif

namespace metastable::markov::dense {
namespace {

constexpr std::size_t tile_rows = 4, tile_columns = 8;

// Tiles of the product below one another, each in registers over all pivots. Both factors are packed: tile_columns
// numbers of `onward` a pivot; of `visits`, tile after tile, tile_rows a pivot.
METASTABLE_WIDE void add_tile_column(double* target, std::size_t target_stride, const double* visits,
                                     const double* onward, std::size_t rows, std::size_t pivots) {
  // Four numbers wherever a double may lie.
  using Four = double __attribute__((vector_size(32), aligned(8), may_alias));
  const auto four = [](const double* at) { return reinterpret_cast<const Four*>(at); };
  for (std::size_t i = 0; i + tile_rows <= rows; i += tile_rows) {
    const double* v = visits + i * pivots;
    double *const t0 = target + i * target_stride, *const t1 = t0 + target_stride, *const t2 = t1 + target_stride,
                  *const t3 = t2 + target_stride;
    Four a0 = four(t0)[0], b0 = four(t0)[1], a1 = four(t1)[0], b1 = four(t1)[1];
    Four a2 = four(t2)[0], b2 = four(t2)[1], a3 = four(t3)[0], b3 = four(t3)[1];
    for (std::size_t n = 0; n < pivots; ++n, v += tile_rows) {
      const Four a = four(onward + n * tile_columns)[0], b = four(onward + n * tile_columns)[1];
      a0 += v[0] * a, b0 += v[0] * b;
      a1 += v[1] * a, b1 += v[1] * b;
      a2 += v[2] * a, b2 += v[2] * b;
      a3 += v[3] * a, b3 += v[3] * b;
    }
    const auto store = [](double* at, const Four& a, const Four& b) {
      reinterpret_cast<Four*>(at)[0] = a;
      reinterpret_cast<Four*>(at)[1] = b;
    };
    store(t0, a0, b0), store(t1, a1, b1), store(t2, a2, b2), store(t3, a3, b3);
  }
}

void add_plain(double* target, std::size_t target_stride, const double* visits, std::size_t visits_stride,
               const double* onward, std::size_t onward_stride, std::size_t rows, std::size_t pivots,
               std::size_t columns) {
  for (std::size_t i = 0; i < rows; ++i)
    for (std::size_t n = 0; n < pivots; ++n) {
      const double visit = visits[i * visits_stride + n];
      for (std::size_t j = 0; j < columns; ++j) target[i * target_stride + j] += visit * onward[n * onward_stride + j];
    }
}

}  // namespace

METASTABLE_WIDE void eliminate_columns(double* rows, std::size_t stride, const double* factor,
                                       std::size_t factor_stride, std::size_t pivots, std::size_t count) {
  for (std::size_t n = pivots; n-- > 1;) {
    const double* const from = rows + n * stride;
    for (std::size_t i = 0; i < n; ++i) {
      double* const to = rows + i * stride;
      const double visit = factor[i * factor_stride + n];
      for (std::size_t j = 0; j < count; ++j) to[j] += visit * from[j];
    }
  }
}

METASTABLE_WIDE void visit_panel(double* visits, std::size_t stride, std::size_t count, const double* square,
                                 std::size_t square_stride, const double* exit, std::size_t pivots) {
  // Four rows side by side, transposed: the recursion runs down the pivots of each.
  constexpr std::size_t lanes = 4;
  double lane[panel][lanes];
  for (std::size_t first = 0; first < count; first += lanes) {
    const std::size_t used = std::min(lanes, count - first);
    for (std::size_t n = 0; n < pivots; ++n)
      for (std::size_t r = 0; r < lanes; ++r) lane[n][r] = r < used ? visits[(first + r) * stride + n] : 0.0;
    for (std::size_t n = pivots; n-- > 0;) {
      for (std::size_t r = 0; r < lanes; ++r) lane[n][r] /= exit[n];
      for (std::size_t j = 0; j < n; ++j)
        for (std::size_t r = 0; r < lanes; ++r) lane[j][r] += lane[n][r] * square[n * square_stride + j];
    }
    for (std::size_t n = 0; n < pivots; ++n)
      for (std::size_t r = 0; r < used; ++r) visits[(first + r) * stride + n] = lane[n][r];
  }
}

void add_product(double* target, std::size_t target_stride, const double* visits, std::size_t visits_stride,
                 const double* onward, std::size_t onward_stride, std::size_t rows, std::size_t pivots,
                 std::size_t columns) {
  const std::size_t tiled = rows / tile_rows * tile_rows, even = columns / tile_columns * tile_columns;
  std::vector<double> packed(pivots * tile_columns), packed_visits;
  packed_visits.reserve(tiled * pivots);
  for (std::size_t i = 0; i < tiled; i += tile_rows)
    for (std::size_t n = 0; n < pivots; ++n)
      for (std::size_t r = 0; r < tile_rows; ++r) packed_visits.push_back(visits[(i + r) * visits_stride + n]);
  for (std::size_t j = 0; j < even; j += tile_columns) {
    for (std::size_t n = 0; n < pivots; ++n)
      std::copy_n(onward + n * onward_stride + j, tile_columns, packed.data() + n * tile_columns);
    add_tile_column(target + j, target_stride, packed_visits.data(), packed.data(), tiled, pivots);
  }
  add_plain(target + even, target_stride, visits, visits_stride, onward + even, onward_stride, tiled, pivots,
            columns - even);
  add_plain(target + tiled * target_stride, target_stride, visits + tiled * visits_stride, visits_stride, onward,
            onward_stride, rows - tiled, pivots, columns);
}

}  // namespace metastable::markov::dense
