#pragma once
// A figure is data, drawn by gnuplot into SVG.

#include <chrono>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "reports/output/table.h"

namespace metastable::reports {

struct FigureAxis {
  std::string label;
  std::string unit = {};           ///< "" for none; shown as "label [unit]"
  bool logarithmic = false;        ///< values <= 0 are then left out
  std::optional<double> low = {};  ///< ends of the axis; not given: from the data
  std::optional<double> high = {};
};

enum class Style {
  line,          ///< x, y
  dashed,        ///< x, y
  points,        ///< x, y; vertical 95 % bars if lower and upper are given
  dots,          ///< x, y: a cloud of many small points
  steps,         ///< x, y: y[i] holds from x[i] to x[i+1]
  dashed_steps,  ///< x, y: likewise
  impulses,      ///< x, y: a stem from zero
  area,          ///< x, y: filled down to zero (to the bottom of a logarithmic axis)
  band,          ///< x, lower, upper: filled between
};

struct Series {
  std::string label = {};  ///< "" keeps it out of the legend
  Style style = Style::line;
  std::vector<double> x;
  std::vector<double> y = {};  ///< a point that is not finite leaves a gap
  std::vector<double> lower = {};
  std::vector<double> upper = {};
  /// The number, 0, 1, 2, ..., of a colour of the palette (Okabe and Ito: told apart by the colour-blind too). Not
  /// given, it is the series' position. Give a band and its line the same.
  std::optional<int> colour = {};
};

/// A thin line across the whole figure, at a fixed x (vertical) or y.
struct ReferenceLine {
  bool vertical = true;
  double at = 0;
  std::string label = {};
};
/// The diagonal y = x over the range of the x axis, e.g. for a return map.
enum class Diagonal { no, yes };

/// Holds numbers on a grid as coloured, labelled cells: one row of `value` for each y, one column for each x. Cells
/// keep one size whatever the spacing of x and y. Infinite cells are grey and say so; NaN cells are empty.
struct HeatMap {
  std::vector<double> x;
  std::vector<double> y;
  std::vector<std::vector<double>> value;
  std::string label;         ///< of the colour scale, unit included
  bool logarithmic = false;  ///< colour by the logarithm; values must then be > 0
  int digits = 3;            ///< significant digits of the labels at most: fewer, or no labels, where cells are small
  NumberFormat format = NumberFormat::significant;  ///< of the labels; fixed: `digits` decimals
  std::vector<std::string> x_names = {};            ///< shown instead of x, one a column; empty: the numbers
  std::vector<std::string> y_names = {};            ///< likewise, one a row
  /// If not 0, colours go from blue over white to red, white at 0, full at -limit, +limit and beyond.
  double limit = 0;
  /// Ends of the colour scale, e.g. of maps side by side; not given: the least and the largest value.
  std::optional<double> low = {}, high = {};
  std::vector<std::pair<double, std::string>> scale_names = {};  ///< words in the place of the scale's numbers
  std::vector<std::vector<bool>> at_least = {};                  ///< cells whose value is a lower bound; empty: none
};

/// Holds named horizontal bars from zero, the first on top, each with its value at the end.
struct BarChart {
  std::vector<std::string> name;  ///< each may have several lines
  std::vector<double> value;
  std::vector<double> lower = {}, upper = {};  ///< intervals as whiskers; empty: none. NaN: none at this bar
  std::vector<int> colour = {};                ///< of the palette, one a bar; empty: all alike
  int digits = 2;                              ///< significant digits of the values shown
  NumberFormat format = NumberFormat::significant;
};

enum class Legend { top_right, top_left, bottom_right, bottom_left, below, none };

struct Figure {
  std::string id;     ///< short name of letters, digits and '-': file name and HTML anchor
  std::string title;  ///< shown above the figure and the SVG's <title>; "" for none
  FigureAxis x;
  FigureAxis y;
  std::vector<Series> series = {};
  std::vector<ReferenceLine> reference_lines = {};
  Diagonal diagonal = Diagonal::no;
  std::optional<HeatMap> heat_map = {};  ///< instead of series
  std::optional<BarChart> bars = {};     ///< instead of series; vertical reference lines are drawn
  Legend legend = Legend::top_right;     ///< drawn only if a series has a label
  int width = 520;                       ///< [px]; letters of 15 px are then read on a phone too
  int height = 380;                      ///< [px]
  Provenance provenance = {};            ///< the SVG's <desc>
};

/// Returns the gnuplot script that draws the figure to standard output.
/// @throws std::invalid_argument naming figure and series when the vectors' lengths do not match
std::string gnuplot_script(const Figure& figure);

/// Returns the figure as a standalone SVG: the same bytes for the same figure (and version of gnuplot) on any machine.
/// Takes about 30 ms. @param limit  to gnuplot's time; when it is over, gnuplot is ended
/// @throws std::runtime_error if gnuplot is missing, fails or does not end in time; Interrupted once a signal has come,
/// with gnuplot ended; std::invalid_argument as above
std::string render_svg(const Figure& figure, std::chrono::milliseconds limit = std::chrono::seconds(30));

}  // namespace metastable::reports
