#pragma once
// The work of eliminating a panel of pivots from a full matrix: everything but the pivots' own square.

#include <cstddef>

namespace metastable::markov::dense {

/// Pivots eliminated together: the first two steps below take `pivots` <= panel of them.
inline constexpr std::size_t panel = 64;

/// Columns [0, count) of the panel's rows, in the order of elimination: for n = pivots-1 .. 1 and i < n,
/// rows[i] += factor[i][n] * rows[n]. All matrices row-major.
/// @param rows  first of the panel's rows at the first of the columns; @param factor  the panel's square, eliminated
void eliminate_columns(double* rows, std::size_t stride, const double* factor, std::size_t factor_stride,
                       std::size_t pivots, std::size_t count);

/// Visits of `count` rows to the panel, from their entries there: for n = pivots-1 .. 0, v[n] /= exit[n] and
/// v[j] += v[n] * square[n][j] for j < n.
void visit_panel(double* visits, std::size_t stride, std::size_t count, const double* square, std::size_t square_stride,
                 const double* exit, std::size_t pivots);

/// target += visits * onward, for `rows` rows and `columns` columns; onward has `pivots` rows. Nothing is contracted
/// into fused operations: the same bits on every machine.
void add_product(double* target, std::size_t target_stride, const double* visits, std::size_t visits_stride,
                 const double* onward, std::size_t onward_stride, std::size_t rows, std::size_t pivots,
                 std::size_t columns);

}  // namespace metastable::markov::dense
