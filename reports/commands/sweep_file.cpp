#include "reports/commands/sweep_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <optional>

#include "reports/output/answer.h"
#include "reports/output/figure.h"
#include "reports/output/file_lock.h"
#include "reports/output/input_file.h"
#include "reports/output/interrupt.h"
#include "reports/output/output_file.h"

namespace metastable::reports {
namespace {

constexpr std::size_t most_lines = 8;         // of a figure
constexpr std::size_t most_map_columns = 16;  // of a heat map with a number in every cell
constexpr std::size_t most_map_rows = 16;

// Returns the complete rows behind the head of a file, none if there is no such file; a last line without its end was
// cut short and is dropped, and so is a head. @throws OutputError if it is another sweep's
std::vector<std::string> rows_of(const std::filesystem::path& file, const std::string& head, const char* otherwise) {
  if (!std::filesystem::exists(file)) return {};
  if (std::filesystem::is_directory(file)) throw OutputError(file, "is a folder");
  if (!std::filesystem::is_regular_file(file))
    throw OutputError(file, "is no regular file, from which a sweep could be taken up again");
  const std::string text = read_file(file);
  if (head.starts_with(text)) return {};
  if (!text.starts_with(head)) throw OutputError(file, fmt::format("{}; choose another --out or remove it", otherwise));
  std::vector<std::string> rows;
  for (std::size_t at = head.size(); at < text.size();) {
    const std::size_t end = text.find('\n', at);
    if (end == std::string::npos) break;
    rows.push_back(text.substr(at, end + 1 - at));
    at = end + 1;
  }
  return rows;
}

// Returns a number of the table, which is text where it is none: "infinite", or empty for a point whose solver failed.
double value_of(const Cell& cell) {
  if (const double* number = std::get_if<double>(&cell.value())) return *number;
  return std::get<std::string>(cell.value()).empty() ? std::numeric_limits<double>::quiet_NaN()
                                                     : std::numeric_limits<double>::infinity();
}

std::vector<std::string> fields_of(std::string_view line) {
  std::vector<std::string> fields(1);
  bool quoted = false;
  for (const char c : line)
    if (c == '"')
      quoted = !quoted;
    else if (c == ',' && !quoted)
      fields.emplace_back();
    else if (c != '\n')
      fields.back() += c;
  return fields;
}

std::string by_law(const SweepFile& sweep) { return sweep.law.empty() ? "" : ", law " + sweep.law; }

// Returns the rows as a table, those taken over from the file as those just computed: all are what the file holds. The
// last line of the head names the columns.
Table table_of(const SweepFile& sweep, const std::vector<std::string>& rows) {
  Table table{.id = "sweep", .title = "Points of the sweep" + by_law(sweep), .columns = {}};
  const std::string_view head(sweep.head.data(), sweep.head.size() - 1);
  for (const std::string& name : fields_of(head.substr(head.rfind('\n') + 1))) table.columns.push_back({name});
  for (const std::string& row : rows) {
    std::vector<Cell>& cells = table.rows.emplace_back();
    for (const std::string& field : fields_of(row)) {
      double number = 0;
      const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), number);
      cells.push_back(error == std::errc() && end == field.data() + field.size() ? Cell(number) : Cell(field));
    }
  }
  return table;
}

// Returns what wheels rolled under `settled` show where the one line, or line k of several, has them.
std::optional<Series> rigid_bodies_of(const Table& table, const std::vector<double>& across, int colour,
                                      const std::function<std::size_t(std::size_t)>& row) {
  const auto first = std::ranges::find(table.columns, "rigid_bodies_steps", &Column::name);
  if (first == table.columns.end()) return std::nullopt;
  const auto column = static_cast<std::size_t>(first - table.columns.begin());
  Series points{"rigid bodies (law settled)", Style::points, {}, {}, {}, {}, colour};
  for (std::size_t i = 0; i < across.size(); ++i) {
    const std::vector<Cell>& cells = table.rows[row(i)];
    const double steps = value_of(cells[column]);
    if (!std::isfinite(steps)) continue;
    points.x.push_back(across[i]);
    points.y.push_back(steps);
    points.lower.push_back(value_of(cells[column + 1]));
    points.upper.push_back(value_of(cells[column + 2]));
  }
  if (points.x.empty()) return std::nullopt;
  return points;
}

bool any_finite(const std::vector<double>& values) {
  return std::ranges::any_of(values, [](double value) { return std::isfinite(value); });
}

// Holds the two axes that are shown, the second as lines or rows of a map; further ones stay at their first value.
class ShownPoints {
 public:
  ShownPoints(const std::vector<SweepFileAxis>& axes, const Table& table) : axes_(axes), table_(table) {
    for (std::size_t a = 1; a < axes.size(); ++a) stride_ *= axes[a].values.size();
    for (std::size_t a = 2; a < axes.size(); ++a) line_stride_ *= axes[a].values.size();
  }
  const SweepFileAxis& across() const { return axes_.front(); }
  // The second axis; nothing where there is one alone, whose points are a single line.
  const SweepFileAxis* down() const { return axes_.size() > 1 ? &axes_[1] : nullptr; }
  std::size_t lines() const { return down() ? down()->values.size() : 1; }
  // Returns the row of the table that holds point i of line k.
  std::size_t row(std::size_t i, std::size_t k) const { return i * stride_ + (down() ? k * line_stride_ : 0); }
  // Returns a column of line k behind the coordinates: 0 expected steps, 1 and 2 their interval.
  std::vector<double> line(std::size_t k, std::size_t column) const {
    std::vector<double> values;
    for (std::size_t i = 0; i < across().values.size(); ++i)
      values.push_back(value_of(table_.rows[row(i, k)][axes_.size() + column]));
    return values;
  }

 private:
  const std::vector<SweepFileAxis>& axes_;
  const Table& table_;
  std::size_t stride_ = 1, line_stride_ = 1;
};

// Draws a map with a number in every cell. Returns whether one of them is finite.
bool draw_map(Figure& figure, const ShownPoints& points) {
  const SweepFileAxis &across = points.across(), &down = *points.down();
  figure.y = {down.label, down.unit};
  figure.width = 960;
  HeatMap map{across.values, down.values, {}, "expected steps", true};
  for (std::size_t k = 0; k < points.lines(); ++k) map.value.push_back(points.line(k, 0));
  const bool finite = std::ranges::any_of(map.value, any_finite);
  figure.heat_map = std::move(map);
  return finite;
}

// Draws a line of steps for each value of the second axis, or some of them. Returns whether there is one.
bool draw_lines(Figure& figure, const ShownPoints& points, const SweepFile& sweep, const Table& table) {
  const SweepFileAxis& across = points.across();
  figure.y = {"expected steps", "", true};
  figure.legend = Legend::below;
  const std::size_t shown = std::min(points.lines(), most_lines);
  bool rolled = false;  // has its place in the legend
  for (std::size_t j = 0; j < shown; ++j) {
    const std::size_t k = shown > 1 ? j * (points.lines() - 1) / (shown - 1) : 0;
    const int colour = static_cast<int>(j);
    Series line{"", Style::line, across.values, points.line(k, 0), {}, {}, colour};
    if (!any_finite(line.y)) continue;
    if (points.down())
      line.label = fmt::format("{} {}", points.down()->label, points.down()->values[k]);
    else if (sweep.remark)
      line.label = "law " + sweep.law;
    figure.series.push_back({"", Style::band, across.values, {}, points.line(k, 1), points.line(k, 2), colour});
    figure.series.push_back(std::move(line));
    if (auto rigid = rigid_bodies_of(table, across.values, shown == 1 ? 1 : colour,
                                     [&points, k](std::size_t i) { return points.row(i, k); })) {
      if (rolled) rigid->label.clear();
      rolled = true;
      figure.series.push_back(std::move(*rigid));
    }
  }
  return !figure.series.empty();
}

// Returns nothing if no point has a finite number of steps.
std::optional<Figure> figure_of(const SweepFile& sweep, const Table& table) {
  const ShownPoints points(sweep.axes, table);
  Figure figure;
  figure.id = "sweep";
  figure.title = "Expected steps before failure" + by_law(sweep);
  figure.provenance = sweep.provenance;
  figure.x = {points.across().label, points.across().unit};
  const bool mapped = points.down() && points.lines() > 4 && points.lines() <= most_map_rows &&
                      points.across().values.size() <= most_map_columns;
  if (!(mapped ? draw_map(figure, points) : draw_lines(figure, points, sweep, table))) return std::nullopt;
  return figure;
}

std::size_t size_of(const SweepFile& sweep) {
  std::size_t size = 1;
  for (const SweepFileAxis& axis : sweep.axes) size *= axis.values.size();
  return size;
}

// Holds the files that a sweep writes beside its JSON.
struct SweepPaths {
  std::filesystem::path out, partial, picture;
};

// @throws std::invalid_argument, OutputError if one would be written over the other
SweepPaths paths_of(const SweepFile& sweep) {
  if (sweep.out == "-")
    throw std::invalid_argument("--out: a sweep keeps its points in a file as they come; --json - prints them");
  // Of a link, what it leads to is written and locked.
  const std::filesystem::path out = std::filesystem::is_symlink(sweep.out)
                                        ? std::filesystem::weakly_canonical(sweep.out)
                                        : std::filesystem::path(sweep.out);
  SweepPaths paths{out, out.string() + ".partial", out};
  paths.picture.replace_extension(".svg");
  if (paths.picture == out)
    throw OutputError(out, "the figure beside the numbers has that name; give the numbers another ending, .csv");
  for (const std::filesystem::path& own : {paths.picture, paths.partial})
    if (same_file(sweep.json, own))
      throw std::invalid_argument(fmt::format("--json: {} is what --out {} writes too", sweep.json, sweep.out));
  return paths;
}

// Holds the file that grows row by row until it takes its place.
class Journal {
 public:
  // Keeps of the file what is `so_far`, the rest of it is none of the sweep's.
  Journal(const std::filesystem::path& file, const std::string& so_far) : file_(file) {
    const bool kept = read_file(file).starts_with(so_far);
    std::filesystem::resize_file(file, kept ? so_far.size() : 0);
    stream_.open(file, std::ios::binary | std::ios::app);
    if (!kept) append(so_far);
  }
  void append(const std::string& text) {
    errno = 0;
    if (!(stream_ << text << std::flush)) throw OutputError(file_, errno != 0 ? std::strerror(errno) : "write error");
  }
  void rename(const std::filesystem::path& out) {
    stream_.close();
    std::error_code error;
    std::filesystem::rename(file_, out, error);
    if (error) throw OutputError(out, error.message());
  }

 private:
  std::filesystem::path file_;
  std::ofstream stream_;
};

struct SweepPoints {
  std::vector<std::string> rows;
  std::size_t had;  // taken over
};

// Takes over the points that are there and computes the others.
SweepPoints complete_points(const SweepFile& sweep, const SweepPaths& paths, const SweepRows& compute) {
  const std::size_t size = size_of(sweep);
  std::vector<std::string> rows = rows_of(paths.out, sweep.head, "holds another sweep");
  if (rows.size() >= size) return {rows, rows.size()};
  const FileLock lock(paths.partial, FileLock::Missing::create);
  if (!lock.held()) throw OutputError(paths.partial, "another sweep is writing it");
  // They are read again: the other one may have ended in between.
  rows = rows_of(paths.out, sweep.head, "holds another sweep");
  if (rows.empty()) rows = rows_of(paths.partial, sweep.head, "belongs to another sweep");
  const std::size_t had = rows.size();
  std::string so_far = sweep.head;
  for (const std::string& one : rows) so_far += one;
  Journal journal(paths.partial, so_far);
  try {
    compute(had, [&rows, &journal](const std::string& row) {
      rows.push_back(row);
      journal.append(row);
    });
  } catch (const Interrupted& interrupted) {
    throw Interrupted(interrupted, fmt::format("{} of {} points kept; the same command goes on", rows.size(), size));
  }
  journal.rename(paths.out);
  return {rows, had};
}

}  // namespace

void run_sweep_file(const SweepFile& sweep, const SweepRows& compute) {
  const SweepPaths paths = paths_of(sweep);
  Answer answer(sweep.json);
  const auto [rows, had] = complete_points(sweep, paths, compute);
  Table table = table_of(sweep, rows);
  const bool none =
      std::ranges::all_of(rows, [&sweep](const std::string& row) { return fields_of(row)[sweep.axes.size()].empty(); });
  const std::optional<Figure> drawn = figure_of(sweep, table);
  if (drawn) write_file(paths.picture, render_svg(*drawn));
  answer.say("{}: {} points ({} taken over); {}", paths.out.string(), size_of(sweep), had,
             drawn ? paths.picture.string() : "no figure: no point has a finite number of steps");
  if (sweep.remark) answer.say("{}", sweep.remark(table));
  answer.table(std::move(table));
  answer.file(paths.out.string());
  if (drawn) answer.file(paths.picture.string());
  answer.finish(sweep.provenance);
  if (none)
    throw std::runtime_error(fmt::format("no point has a number; {} says why, point by point", paths.out.string()));
}

void share_sweep_file(const SweepFile& sweep, const Sharing& sharing,
                      const std::function<std::string(std::size_t)>& row_of) {
  const std::size_t size = size_of(sweep);
  const auto turn = [&](std::size_t point, std::size_t had) {
    return static_cast<int>((point - had) % static_cast<std::size_t>(sharing.ranks));
  };
  if (sharing.rank > 0) {
    const std::size_t had = sharing.first_says(0);
    for (std::size_t point = had; point < size; ++point)
      if (turn(point, had) == sharing.rank) sharing.send(row_of(point));
    return;
  }
  bool said = false;  // to the others, where to begin
  try {
    run_sweep_file(sweep, [&](std::size_t had, const auto& add) {
      said = true;
      sharing.first_says(had);
      for (std::size_t point = had; point < size; ++point)
        add(turn(point, had) == 0 ? row_of(point) : sharing.receive(turn(point, had)));
    });
  } catch (...) {
    if (!said) sharing.first_says(size);
    throw;
  }
  if (!said) sharing.first_says(size);
}

}  // namespace metastable::reports
