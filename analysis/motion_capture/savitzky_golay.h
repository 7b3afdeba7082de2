#pragma once
// Smooths and differentiates evenly sampled values by local polynomials.

#include <span>
#include <vector>

namespace metastable::analysis {

/// Evaluates the polynomial that fits a window of samples best (A. Savitzky, M. J. E. Golay, Anal. Chem. 36 (1964)) at
/// a sample. In the first and last half window the polynomial of the outermost whole window is evaluated off its
/// centre.
class SavitzkyGolay {
 public:
  /// @param window      samples, odd, > degree, at most 10001
  /// @param degree      of the polynomial, 0..6
  /// @param derivative  0: smoothed values, 1: first derivative, ...; at most `degree`
  /// Coefficients by least squares, O(window^2 degree). @throws std::invalid_argument naming the argument and its range
  SavitzkyGolay(int window, int degree, int derivative);

  int window() const { return window_; }
  /// Returns the weights of the window's samples for a value at sample `at` of the window (the centre: window / 2), per
  /// spacing to the power of `derivative`.
  std::span<const double> weights(int at) const;
  /// Returns the filtered values, as many as there are. O(values x window).
  /// @param spacing  of the samples, > 0. @throws std::invalid_argument for fewer values than the window
  std::vector<double> apply(std::span<const double> values, double spacing) const;

 private:
  int window_, derivative_;
  std::vector<double> weights_;  // row `at` holds its weights
};

}  // namespace metastable::analysis
