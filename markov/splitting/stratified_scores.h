#pragma once
// Draws normal scores for many replicas at once: each score evenly over its distribution, some of them into the tails.

#include <cstddef>
#include <cstdint>
#include <span>

namespace metastable::markov {

/// Writes a row of independent normal scores for each of weight.size() replicas and their weights: the mean of
/// weight * f(scores) estimates E f without a bias. In a quarter of the rows one score is drawn three times as wide, so
/// that a single noise of 6 sds comes up in a hundredth of the rows; weights are at most 4/3. Each score is spread
/// evenly over the rows (Latin hypercube sampling, McKay, Beckman and Conover 1979), the wide ones among themselves:
/// what is a sum of functions of single scores, as the weights nearly are, hardly scatters.
///
/// Random numbers come by counter (Philox: seed, stream, a, and those drawn so far).
/// @param scores  weight.size() rows of one number or more
void stratified_scores(std::uint64_t seed, std::uint64_t stream, std::uint64_t a, std::span<double> scores,
                       std::span<double> weight);

}  // namespace metastable::markov
