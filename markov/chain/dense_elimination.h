#pragma once
// Eliminates a block of pivots from a full matrix without subtraction, halved again and again until nearly all of it
// is matrix product. Nothing is contracted into fused operations: the same bits on every machine.

#include <cstddef>

namespace metastable::markov::dense {

/// Views a part of a row-major matrix.
struct Part {
  double* first;
  std::size_t stride;

  double* row(std::size_t i) const { return first + i * stride; }
  Part from(std::size_t i, std::size_t j) const { return {row(i) + j, stride}; }
};

/// Says how many columns are multiplied together, and holds these of one row.
inline constexpr std::size_t tile_columns = 8;
struct alignas(tile_columns * sizeof(double)) TileRow {
  double entry[tile_columns];
};

/// Eliminates the pivots n = pivots-1 .. 0 among themselves: exit[n] is the sum of columns 0 .. n of row n, and each
/// row i < n gets its visits to n, row(i)[n+1] / exit[n], in column n+1, and as many times row n in columns 0 .. n.
/// @param square  column 0 stands for all that lies left of the pivots and for rest
void eliminate_square(Part square, double* exit, std::size_t pivots);

/// Updates columns [0, count) of the pivots' rows in the order of elimination: for n = pivots-1 .. 1 and i < n,
/// rows[i] += factor[i][n] * rows[n].
/// @param factor  the pivots' square, eliminated
void eliminate_columns(Part rows, Part factor, std::size_t pivots, std::size_t count);

/// Turns the entries of `count` rows into visits to the pivots: for n = pivots-1 .. 0, v[n] /= exit[n] and
/// v[j] += v[n] * square[n][j] for j < n.
void visit_pivots(Part visits, std::size_t count, Part square, const double* exit, std::size_t pivots);

/// Packs columns [0, columns) of `pivots` rows tile after tile, as add_product reads them; zeros fill the last tile.
void pack(Part onward, std::size_t pivots, std::size_t columns, TileRow* packed);

/// Does target += visits * onward for `rows` rows and `columns` columns; onward has `pivots` rows and is packed.
void add_product(Part target, Part visits, const TileRow* onward, std::size_t rows, std::size_t pivots,
                 std::size_t columns);

}  // namespace metastable::markov::dense
