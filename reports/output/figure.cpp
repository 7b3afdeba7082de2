#include "reports/output/figure.h"

#include <fmt/format.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <thread>

#include "reports/output/interrupt.h"
#include "reports/output/text_table.h"

namespace metastable::reports {
namespace {

// Okabe and Ito's palette without its yellow, which is too light for lines.
constexpr std::array<std::string_view, 7> palette{"#0072B2", "#D55E00", "#009E73", "#CC79A7",
                                                  "#E69F00", "#56B4E9", "#000000"};
constexpr std::array<int, 7> point_types{7, 5, 9, 11, 13, 6, 4};
constexpr std::string_view font_family = "Helvetica,Arial,sans-serif";

/// Makes a gnuplot string that nothing in it can end or expand. Single quotes expand nothing but cannot begin or end
/// with a quote of the text; double ones hold it, and all that they would expand, as octal numbers.
/// @param lines  ends of lines are kept
std::string quote(std::string_view text, bool lines = false) {
  const bool plain = text.find('\'') == std::string_view::npos && !(lines && text.find('\n') != std::string_view::npos);
  const char mark = plain ? '\'' : '"';
  std::string quoted(1, mark);
  for (const char c : text) {
    if (c == '\n')
      quoted += lines ? "\\n" : " ";
    else if (mark == '"' && std::string_view("'\"\\`").find(c) != std::string_view::npos)
      quoted += fmt::format("\\{:03o}", static_cast<unsigned>(c));
    else
      quoted += c;
  }
  return quoted + mark;
}

/// Returns the text as the label of a tick, where gnuplot looks for a number format.
std::string tick(std::string_view text) {
  std::string doubled;
  for (const char c : text) doubled += c == '%' ? std::string("%%") : std::string(1, c);
  return quote(doubled, true);
}

std::string axis_label(const FigureAxis& axis) {
  return axis.unit.empty() ? axis.label : axis.label + " [" + axis.unit + "]";
}

std::string number(double value) { return std::isfinite(value) ? fmt::format("{}", value) : "NaN"; }

std::string legend_position(Legend legend) {
  switch (legend) {
    case Legend::top_right:
      return "inside right top";
    case Legend::top_left:
      return "inside left top";
    case Legend::bottom_right:
      return "inside right bottom";
    case Legend::bottom_left:
      return "inside left bottom";
    case Legend::below:
      return "below center horizontal height 0.8";
    case Legend::none:
      break;
  }
  return "off";
}

void check_lengths(const Figure& figure, const Series& series, std::size_t index) {
  const std::size_t n = series.x.size();
  const bool band = series.style == Style::band;
  const bool bars = series.style == Style::points && !(series.lower.empty() && series.upper.empty());
  const bool good = (series.y.size() == n || (band && series.y.empty())) &&
                    (!(band || bars) || (series.lower.size() == n && series.upper.size() == n));
  if (good) return;
  throw std::invalid_argument(
      fmt::format("figure '{}', series {} ('{}'): x, y, lower and upper have {}, {}, {} and {} values", figure.id,
                  index + 1, series.label, n, series.y.size(), series.lower.size(), series.upper.size()));
}

void append_data(std::string& script, std::size_t index, const Series& series) {
  const bool interval = !series.lower.empty();
  script += fmt::format("$data{} << END\n", index);
  for (std::size_t i = 0; i < series.x.size(); ++i) {
    script += number(series.x[i]);
    if (!series.y.empty()) script += ' ' + number(series.y[i]);
    if (interval) script += ' ' + number(series.lower[i]) + ' ' + number(series.upper[i]);
    script += '\n';
  }
  script += "END\n";
}

std::string plot_element(const Series& series, std::size_t index) {
  const std::size_t shade = static_cast<std::size_t>(std::max(series.colour.value_or(static_cast<int>(index)), 0));
  const std::string_view colour = palette[shade % palette.size()];
  const int point = point_types[shade % point_types.size()];
  const std::string title = series.label.empty() ? "notitle" : "title " + quote(series.label) + " noenhanced";
  const int interval_column = series.y.empty() ? 2 : 3;
  std::string style;
  switch (series.style) {
    case Style::line:
      style = fmt::format("using 1:2 with lines lw 2 lc rgb '{}'", colour);
      break;
    case Style::dashed:
      style = fmt::format("using 1:2 with lines lw 2 dt (8,5) lc rgb '{}'", colour);
      break;
    case Style::points:
      style = series.lower.empty()
                  ? fmt::format("using 1:2 with points pt {} ps 0.7 lc rgb '{}'", point, colour)
                  : fmt::format("using 1:2:3:4 with yerrorbars pt {} ps 0.7 lw 1.5 lc rgb '{}'", point, colour);
      break;
    case Style::dots: {
      // A sample of the cloud's own size could not be seen in the legend.
      const std::string sample =
          series.label.empty()
              ? ""
              : fmt::format(", \\\n     keyentry with points pt 7 ps 0.6 lc rgb '{}' {}", colour, title);
      return fmt::format("$data{} using 1:2 with points pt 7 ps 0.35 lc rgb '#70{}' notitle{}", index, colour.substr(1),
                         sample);
    }
    case Style::steps:
      style = fmt::format("using 1:2 with steps lw 2 lc rgb '{}'", colour);
      break;
    case Style::dashed_steps:
      style = fmt::format("using 1:2 with steps lw 2 dt (8,5) lc rgb '{}'", colour);
      break;
    case Style::impulses:
      style = fmt::format("using 1:2 with impulses lw 3 lc rgb '{}'", colour);
      break;
    case Style::area:
      style = fmt::format("using 1:2 with filledcurves x1 fs transparent solid 0.3 noborder lc rgb '{}'", colour);
      break;
    case Style::band:
      style = fmt::format("using 1:{}:{} with filledcurves fs transparent solid 0.22 noborder lc rgb '{}'",
                          interval_column, interval_column + 1, colour);
      break;
  }
  return fmt::format("$data{} {} {}", index, style, title);
}

std::string tics(const std::vector<std::string>& names) {
  std::string list;
  for (std::size_t i = 0; i < names.size(); ++i) list += fmt::format("{}{} {}", i == 0 ? "" : ", ", tick(names[i]), i);
  return list;
}

std::string tics(const std::vector<double>& values, const std::vector<std::string>& names) {
  if (!names.empty()) return tics(names);
  std::vector<std::string> texts;
  for (const double value : values) texts.push_back(format_number(value, NumberFormat::general, 6));
  return tics(texts);
}

void check_heat_map(const Figure& figure, const HeatMap& map) {
  const auto fail = [&](const std::string& reason) {
    throw std::invalid_argument(fmt::format("figure '{}', heat map: {}", figure.id, reason));
  };
  if (map.x.empty() || map.y.empty()) fail("no cells");
  if (!map.x_names.empty() && map.x_names.size() != map.x.size()) fail("x and x_names differ in length");
  if (!map.y_names.empty() && map.y_names.size() != map.y.size()) fail("y and y_names differ in length");
  if (!map.at_least.empty() && map.at_least.size() != map.y.size()) fail("at_least and y differ in length");
  if (map.value.size() != map.y.size()) fail(fmt::format("{} rows for {} values of y", map.value.size(), map.y.size()));
  for (const auto& row : map.value) {
    if (row.size() != map.x.size()) fail(fmt::format("{} cells in a row for {} values of x", row.size(), map.x.size()));
    for (const double value : row) {
      if (map.logarithmic && value <= 0) fail(fmt::format("{} has no logarithm", value));
    }
  }
}

std::string number_label(double value, NumberFormat format, int digits) {
  return std::isinf(value) ? "∞" : format_number(value, format, digits);
}

std::string cell_label(const HeatMap& map, std::size_t i, std::size_t j, int digits) {
  const std::string number = number_label(map.value[j][i], map.format, digits);
  return map.at_least.empty() || !map.at_least[j][i] ? number : "≥ " + number;
}

struct LabelFit {
  int font = 0;  ///< [px]; 0: no labels, the cells are too small
  int digits = 0;
};

/// The margins around the cells of a heat map [px].
struct Margins {
  double left, right, top, bottom;
};

Margins margins(const HeatMap& map, const Figure& figure) {
  constexpr double letter = 7.4;  // mean width of a letter of names, in type of 15 px
  std::size_t longest_y = 4, longest_x = 0;
  for (const std::string& name : map.y_names) longest_y = std::max(longest_y, length(name));
  for (const std::string& name : map.x_names) longest_x = std::max(longest_x, length(name));
  std::size_t longest_on_scale = 0;
  for (const auto& [at, name] : map.scale_names) longest_on_scale = std::max(longest_on_scale, length(name));
  const bool y_label = !figure.y.label.empty(), x_label = !figure.x.label.empty();
  // Names of columns are turned by 25 deg: 0.42 of their length downwards.
  return {22 + letter * static_cast<double>(longest_y) + (y_label ? 26 : 0),
          std::max(104.0, 50 + letter * static_cast<double>(longest_on_scale)), figure.title.empty() ? 16.0 : 44.0,
          30 + 0.42 * letter * static_cast<double>(longest_x) + (x_label ? 24 : 0)};
}

/// Finds the most digits, at most map.digits, with which every label fits its cell in a font one can read.
/// @param width, height of all cells together [px]
LabelFit fit_labels(const HeatMap& map, double width, double height) {
  constexpr double glyph_width = 0.6;  // of a digit, by the font's size
  const double cell_width = width / static_cast<double>(map.x.size());
  const double cell_height = height / static_cast<double>(map.y.size());
  for (int digits = map.digits; digits >= 1; --digits) {
    std::size_t longest = 1;
    for (std::size_t j = 0; j < map.y.size(); ++j)
      for (std::size_t i = 0; i < map.x.size(); ++i)
        if (!std::isnan(map.value[j][i])) longest = std::max(longest, length(cell_label(map, i, j, digits)));
    const double font =
        std::min({14.0, cell_height - 4, (cell_width - 4) / (glyph_width * static_cast<double>(longest))});
    const double smallest = digits > 1 ? 9 : 7;
    if (font >= smallest) return {static_cast<int>(font), digits};
  }
  return {};
}

/// Sets the margins: gnuplot takes long names for much longer than they are drawn, and leaves too little to the cells.
void append_margins(std::string& script, const HeatMap& map, const Figure& figure) {
  const Margins m = margins(map, figure);
  script += fmt::format(
      "set lmargin at screen {:.4f}\nset rmargin at screen {:.4f}\nset bmargin at screen {:.4f}\nset tmargin at screen "
      "{:.4f}\n",
      m.left / figure.width, 1 - m.right / figure.width, m.bottom / figure.height, 1 - m.top / figure.height);
}

// Holds the scale of colours of a map.
struct ColourScale {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  bool logarithmic = false;
  double limit = 0;
  explicit ColourScale(const HeatMap& map) : logarithmic(map.logarithmic), limit(map.limit) {
    for (const auto& row : map.value)
      for (const double value : row)
        if (std::isfinite(value)) low = std::min(low, value), high = std::max(high, value);
    if (low > high) low = high = 1;  // no finite cell
    low = map.low.value_or(low), high = map.high.value_or(high);
  }
  // A light label belongs on a dark cell: the lower part of the one scale, both ends of the other.
  bool is_dark(double value) const {
    if (limit > 0) return std::abs(value) > 0.7 * limit;
    const auto scale = [&](double v) { return logarithmic ? std::log(v) : v; };
    return (high > low ? (scale(value) - scale(low)) / (scale(high) - scale(low)) : 0.5) < 0.55;
  }
};

// Appends the cells as data, with their labels; returns whether some are infinite.
bool append_cells(std::string& script, const HeatMap& map, const ColourScale& scale, int digits) {
  std::string finite = "$finite << END\n";
  std::string infinite_cells;
  std::string dark = "$dark << END\n";
  std::string light = "$light << END\n";
  for (std::size_t j = 0; j < map.y.size(); ++j) {
    for (std::size_t i = 0; i < map.x.size(); ++i) {
      const double value = map.value[j][i];
      if (std::isnan(value)) continue;
      const std::string label = fmt::format("{} {} \"{}\"\n", i, j, cell_label(map, i, j, digits));
      if (std::isinf(value)) {
        infinite_cells += fmt::format("{} {}\n", i, j);
        dark += label;
      } else {
        finite += fmt::format("{} {} {}\n", i, j, value);
        (scale.is_dark(value) ? light : dark) += label;
      }
    }
  }
  script += finite + "END\n" + dark + "END\n" + light + "END\n";
  if (!infinite_cells.empty()) script += "$infinite << END\n" + infinite_cells + "END\n";
  return !infinite_cells.empty();
}

void append_colours(std::string& script, const HeatMap& map, const ColourScale& scale) {
  double low = scale.low, high = scale.high;
  if (high == low) high = low == 0 ? 1 : low + std::abs(low) * 1e-6;
  script += map.limit > 0
                ? "set palette defined (0 '#2166ac', 0.25 '#92c5de', 0.5 '#f7f7f7', 0.75 '#f4a582', 1 '#b2182b')\n"
                : "set palette defined (0 '#440154', 0.25 '#3b528b', 0.5 '#21918c', 0.75 '#5ec962', 1 '#fde725')\n";
  if (map.limit > 0) low = -map.limit, high = map.limit;
  script += fmt::format("set cblabel {} noenhanced textcolor rgb '#222222'\nset cbrange [{}:{}]\n", quote(map.label),
                        low, high);
  if (!map.scale_names.empty()) {
    std::vector<std::string> names;
    for (const auto& [at, name] : map.scale_names) names.push_back(fmt::format("{} {}", quote(name), at));
    script += fmt::format("set cbtics ({}) noenhanced\n", fmt::join(names, ", "));
  }
  if (!map.logarithmic) return;
  script += "set logscale cb\n";
  if (high / low >= 100) {
    script += "set format cb '10^{%T}'\n";
    return;
  }
  constexpr int ticks = 5;  // evenly on the logarithmic scale, its ends included: too few powers of ten to read it by
  script += "set cbtics (";
  for (int t = 0; t < ticks; ++t) {
    const double at = low * std::pow(high / low, static_cast<double>(t) / (ticks - 1));
    script += fmt::format("{}\"{}\" {}", t == 0 ? "" : ", ", number_label(at, NumberFormat::significant, 2), at);
  }
  script += ")\n";
}

void append_heat_map(std::string& script, const HeatMap& map, const Figure& figure) {
  const Margins m = margins(map, figure);
  const LabelFit fit = fit_labels(map, figure.width - m.left - m.right, figure.height - m.top - m.bottom);
  append_margins(script, map, figure);
  const ColourScale scale(map);
  const bool infinite = append_cells(script, map, scale, std::max(fit.digits, 1));
  script += fmt::format("set xrange [-0.5:{}]\nset yrange [-0.5:{}]\n", static_cast<double>(map.x.size()) - 0.5,
                        static_cast<double>(map.y.size()) - 0.5);
  script +=
      fmt::format("set xtics ({}) nomirror scale 0 noenhanced{}\nset ytics ({}) nomirror scale 0 noenhanced\n",
                  tics(map.x, map.x_names), map.x_names.empty() ? "" : " rotate by 25 right", tics(map.y, map.y_names));
  script += "unset grid\nset key off\nset style fill solid 1 border rgb '#fefefe'\n";
  append_colours(script, map, scale);
  script += "plot ";
  if (infinite) {
    script +=
        "$infinite using 1:2:(0.5):(0.5) with boxxyerror fs solid 1 border rgb '#fefefe' lc rgb '#d0d0d0', \\\n     ";
  }
  script += "$finite using 1:2:(0.5):(0.5):3 with boxxyerror lc palette";
  if (fit.font > 0) {
    script += fmt::format(
        ", \\\n     $dark using 1:2:3 with labels noenhanced font ',{0}' textcolor rgb '#101010'"
        ", \\\n     $light using 1:2:3 with labels noenhanced font ',{0}' textcolor rgb '#ffffff'",
        fit.font);
  }
  script += '\n';
}

void check_bars(const Figure& figure, const BarChart& bars) {
  const std::size_t n = bars.name.size();
  const auto fits = [n](std::size_t size) { return size == 0 || size == n; };
  if (n > 0 && bars.value.size() == n && fits(bars.lower.size()) && fits(bars.upper.size()) && fits(bars.colour.size()))
    return;
  throw std::invalid_argument(
      fmt::format("figure '{}', bars: {} names, {} values, {} and {} ends of intervals, {} colours", figure.id, n,
                  bars.value.size(), bars.lower.size(), bars.upper.size(), bars.colour.size()));
}

/// Returns 1, 2 or 5 times a power of ten: five steps at most over the range, so that their numbers stand apart.
double tick_step(double range) {
  if (!(range > 0) || !std::isfinite(range)) return 1;
  const double power = std::pow(10, std::floor(std::log10(range / 5)));
  for (const double times : {1.0, 2.0, 5.0})
    if (range / (times * power) <= 5) return times * power;
  return 10 * power;
}

void append_bars(std::string& script, const BarChart& bars, const FigureAxis& x, const std::string& ends) {
  const std::size_t n = bars.name.size();
  std::string boxes = "$bars << END\n", labels = "$labels << END\n", whiskers;
  double least = 0, most = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const double value = bars.value[i];
    if (!std::isfinite(value)) continue;
    const std::string_view colour =
        palette[bars.colour.empty() ? 0 : static_cast<std::size_t>(bars.colour[i]) % palette.size()];
    boxes += fmt::format("{} {} {} {} 0x{}\n", std::min(value, 0.0), i, std::max(value, 0.0), i, colour.substr(1));
    double from = value, to = value;
    if (!bars.lower.empty() && std::isfinite(bars.lower[i]) && std::isfinite(bars.upper[i])) {
      from = std::min(from, bars.lower[i]), to = std::max(to, bars.upper[i]);
      whiskers += fmt::format("{} {} {} {}\n", value, i, bars.lower[i], bars.upper[i]);
    }
    least = std::min(least, from), most = std::max(most, to);
    labels += fmt::format("{} {} \"{}\"\n", std::max(to, 0.0), i, format_number(value, bars.format, bars.digits));
  }
  script += boxes + "END\n" + labels + "END\n";
  if (!whiskers.empty()) script += "$whiskers << END\n" + whiskers + "END\n";
  // This leaves room for the number behind the longest bar.
  const double room = 0.15 * (most > least ? most - least : 1);
  script += x.low || x.high ? fmt::format("set xrange {}\n", ends)
                            : fmt::format("set xrange [{}:{}]\n", least < 0 ? least - 0.3 * room : 0, most + room);
  script += fmt::format("set xtics {}\n", tick_step(x.high.value_or(most + room) - x.low.value_or(least)));
  script += fmt::format("set yrange [{}:-0.6]\nset ytics ({}) nomirror scale 0 noenhanced\n",
                        static_cast<double>(n) - 0.4, tics(bars.name));
  script +=
      "unset grid\nset grid xtics lt 1 lc rgb '#e4e4e4' lw 0.7\nset key off\nset style fill solid 0.85 noborder\n";
  script += "plot $bars using (0.5*($1+$3)):2:1:3:($2-0.32):($2+0.32):5 with boxxyerror lc rgb variable";
  if (!whiskers.empty()) script += ", \\\n     $whiskers using 1:2:3:4 with xerrorbars pt 0 lw 1.5 lc rgb '#222222'";
  script +=
      ", \\\n     $labels using 1:2:3 with labels noenhanced left offset character 0.6,0 textcolor rgb '#222222'\n";
}

std::string range(const FigureAxis& axis) {
  const auto end = [](const std::optional<double>& value) { return value ? number(*value) : std::string("*"); };
  return "[" + end(axis.low) + ":" + end(axis.high) + "]";
}

struct FileCloser {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using TemporaryFile = std::unique_ptr<std::FILE, FileCloser>;

TemporaryFile temporary_file() {
  TemporaryFile file(std::tmpfile());
  if (!file) throw std::runtime_error(fmt::format("cannot create a temporary file: {}", std::strerror(errno)));
  return file;
}

std::string contents(std::FILE* file) {
  std::string text;
  std::array<char, 65536> buffer{};
  std::rewind(file);
  while (const std::size_t n = std::fread(buffer.data(), 1, buffer.size(), file)) text.append(buffer.data(), n);
  return text;
}

/// Waits for a program that leads a process group of its own. At the limit, or once a signal has come, the whole group
/// is ended. @returns its status; nothing at the limit. @throws Interrupted
std::optional<int> wait_for(pid_t child, std::chrono::milliseconds limit) {
  constexpr auto glance = std::chrono::milliseconds(5);
  const auto until = std::chrono::steady_clock::now() + limit;
  const auto end = [child] {
    kill(-child, SIGKILL);
    while (waitpid(child, nullptr, 0) < 0 && errno == EINTR) {
    }
  };
  for (;;) {
    int status = 0;
    const pid_t ended = waitpid(child, &status, WNOHANG);
    if (ended == child) return status;
    if (ended < 0 && errno != EINTR)
      throw std::runtime_error(fmt::format("waiting for gnuplot: {}", std::strerror(errno)));
    try {
      check_interrupt();
    } catch (const Interrupted&) {
      end();
      throw;
    }
    if (std::chrono::steady_clock::now() >= until) {
      end();
      return std::nullopt;
    }
    std::this_thread::sleep_for(glance);
  }
}

std::string run_gnuplot(const std::string& script, const std::string& id, std::chrono::milliseconds limit) {
  const TemporaryFile input = temporary_file();
  const TemporaryFile output = temporary_file();
  const TemporaryFile errors = temporary_file();
  if (std::fwrite(script.data(), 1, script.size(), input.get()) != script.size() || std::fflush(input.get()) != 0) {
    throw std::runtime_error(fmt::format("cannot write a temporary file: {}", std::strerror(errno)));
  }
  std::rewind(input.get());

  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, fileno(input.get()), STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, fileno(output.get()), STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, fileno(errors.get()), STDERR_FILENO);
  // With -d no start-up file of the user's changes the figure.
  std::string program = "gnuplot", option = "-d", standard_input = "-";
  char* const arguments[] = {program.data(), option.data(), standard_input.data(), nullptr};
  posix_spawnattr_t attributes;  // a group of its own: with gnuplot end the programs it has started
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  posix_spawnattr_setpgroup(&attributes, 0);
  pid_t child = 0;
  const int failure = posix_spawnp(&child, "gnuplot", &actions, &attributes, arguments, environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  if (failure == ENOENT) {
    throw std::runtime_error("gnuplot, which draws the figures, was not found: install the package gnuplot-nox");
  }
  if (failure != 0) throw std::runtime_error(fmt::format("gnuplot cannot be started: {}", std::strerror(failure)));
  const std::optional<int> status = wait_for(child, limit);
  check_interrupt();
  if (!status)
    throw std::runtime_error(fmt::format("figure '{}' was not drawn: gnuplot did not end within {:.3g} s and was ended",
                                         id, std::chrono::duration<double>(limit).count()));
  const std::string message = contents(errors.get());
  if (!WIFEXITED(*status) || WEXITSTATUS(*status) != 0) throw std::runtime_error("gnuplot failed: " + message);
  return contents(output.get());
}

void replace_once(std::string& text, std::string_view begin, std::string_view end, const std::string& replacement) {
  const std::size_t from = text.find(begin);
  if (from == std::string::npos) return;
  const std::size_t to = text.find(end, from);
  if (to != std::string::npos) text.replace(from, to + end.size() - from, replacement);
}

}  // namespace

std::string gnuplot_script(const Figure& figure) {
  std::string script = fmt::format(
      "set terminal svg size {},{} dynamic enhanced font '{},15' linewidth 1 background 'white'\n"
      "set encoding utf8\nset output\n"
      "set border 3 lc rgb '#444444' lw 1\n"
      "set grid lt 1 lc rgb '#e4e4e4' lw 0.7\n"
      "set tics nomirror out scale 0.6 textcolor rgb '#222222'\n"
      "set key {} samplen 2.2 spacing 1.2 textcolor rgb '#222222'\n"
      "set xlabel {} noenhanced textcolor rgb '#222222'\nset ylabel {} noenhanced textcolor rgb '#222222'\n",
      figure.width, figure.height, font_family, legend_position(figure.legend), quote(axis_label(figure.x)),
      quote(axis_label(figure.y)));
  if (!figure.title.empty())
    script += fmt::format("set title {} noenhanced textcolor rgb '#222222'\n", quote(figure.title));

  if (figure.heat_map) {
    check_heat_map(figure, *figure.heat_map);
    append_heat_map(script, *figure.heat_map, figure);
    return script;
  }

  if (figure.series.empty() && !figure.bars)
    throw std::invalid_argument(fmt::format("figure '{}' has no series", figure.id));
  if (!figure.bars) script += fmt::format("set xrange {}\nset yrange {}\n", range(figure.x), range(figure.y));
  if (figure.x.logarithmic) script += "set logscale x\nset format x '10^{%T}'\n";
  if (figure.y.logarithmic) script += "set logscale y\nset format y '10^{%T}'\n";
  // Labels of vertical lines stand above the frame, where no legend or curve is.
  const bool labels_above = std::ranges::any_of(
      figure.reference_lines, [](const ReferenceLine& line) { return line.vertical && !line.label.empty(); });
  if (labels_above)
    script += figure.title.empty() ? "set tmargin 2\n" : "set tmargin 4\nset title offset character 0, 0.8\n";
  for (const ReferenceLine& line : figure.reference_lines) {
    const std::string at = number(line.at);
    const std::string_view look = "nohead front lc rgb '#777777' lw 1 dt (4,3)";
    script += line.vertical ? fmt::format("set arrow from {0}, graph 0 to {0}, graph 1 {1}\n", at, look)
                            : fmt::format("set arrow from graph 0, first {0} to graph 1, first {0} {1}\n", at, look);
    if (line.label.empty()) continue;
    script += fmt::format("set label {} noenhanced front textcolor rgb '#555555' font ',12' ", quote(line.label));
    script += line.vertical ? fmt::format("at {}, graph 1 center offset character 0, 0.7\n", at)
                            : fmt::format("at graph 0.99, first {} right offset character 0, 0.6\n", at);
  }
  if (figure.bars) {
    check_bars(figure, *figure.bars);
    append_bars(script, *figure.bars, figure.x, range(figure.x));
    return script;
  }
  for (std::size_t i = 0; i < figure.series.size(); ++i) {
    check_lengths(figure, figure.series[i], i);
    append_data(script, i, figure.series[i]);
  }
  script += "plot ";
  for (std::size_t i = 0; i < figure.series.size(); ++i) {
    script += (i == 0 ? "" : ", \\\n     ") + plot_element(figure.series[i], i);
  }
  if (figure.diagonal == Diagonal::yes) script += ", \\\n     x with lines lw 1 dt (4,3) lc rgb '#777777' notitle";
  return script + "\n";
}

std::string render_svg(const Figure& figure, std::chrono::milliseconds limit) {
  std::string svg = run_gnuplot(gnuplot_script(figure), figure.id, limit);
  if (svg.find("</svg>") == std::string::npos) {
    throw std::runtime_error(fmt::format("gnuplot drew nothing for figure '{}'", figure.id));
  }
  std::string description;
  for (const std::string& line : provenance_lines(figure.provenance)) description += escape_html(line) + "\n";
  replace_once(svg, "<title>", "</title>",
               "<title>" + escape_html(figure.title.empty() ? figure.id : figure.title) + "</title>");
  replace_once(svg, "<desc>", "</desc>", "<desc>" + description + "</desc>");
  return svg;
}

}  // namespace metastable::reports
