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

// Returns nothing if no point has a finite number of steps.
std::optional<Figure> figure_of(const SweepFile& sweep, const Table& table) {
  const std::vector<SweepFileAxis>& axes = sweep.axes;
  Figure figure;
  figure.id = "sweep";
  figure.title = "Expected steps before failure" + by_law(sweep);
  figure.provenance = sweep.provenance;
  // These two axes are shown; further ones stay at their first value.
  const SweepFileAxis& across = axes.front();
  const std::size_t second = axes.size() > 1 ? 1 : 0;
  std::size_t stride = 1, stride_second = 1;
  for (std::size_t a = 1; a < axes.size(); ++a) stride *= axes[a].values.size();
  for (std::size_t a = 2; a < axes.size(); ++a) stride_second *= axes[a].values.size();
  const std::size_t lines = second == 1 ? axes[1].values.size() : 1;
  // Behind the coordinates: 0 expected steps, 1 and 2 their interval.
  const auto number_at = [&](std::size_t i, std::size_t k, std::size_t column) {
    return value_of(table.rows[i * stride + (second == 1 ? k * stride_second : 0)][axes.size() + column]);
  };
  figure.x = {across.label, across.unit};
  const bool mapped = second == 1 && lines > 4 && lines <= most_map_rows && across.values.size() <= most_map_columns;
  if (mapped) {
    figure.y = {axes[1].label, axes[1].unit};
    HeatMap map{across.values, axes[1].values, {}, "expected steps", true};
    for (std::size_t k = 0; k < lines; ++k) {
      map.value.emplace_back();
      for (std::size_t i = 0; i < across.values.size(); ++i) map.value.back().push_back(number_at(i, k, 0));
    }
    const auto finite = [](const std::vector<double>& row) {
      return std::any_of(row.begin(), row.end(), [](double value) { return std::isfinite(value); });
    };
    if (std::none_of(map.value.begin(), map.value.end(), finite)) return std::nullopt;
    figure.heat_map = std::move(map);
    figure.width = 960;
    return figure;
  }
  figure.y = {"expected steps", "", true};
  const std::size_t shown = std::min(lines, most_lines);
  bool rolled = false;  // has its place in the legend
  for (std::size_t j = 0; j < shown; ++j) {
    const std::size_t k = shown > 1 ? j * (lines - 1) / (shown - 1) : 0;
    Series band{"", Style::band, across.values, {}, {}, {}, static_cast<int>(j)};
    Series line{"", Style::line, across.values, {}, {}, {}, static_cast<int>(j)};
    if (sweep.remark && second != 1) line.label = "law " + sweep.law;
    if (second == 1) line.label = fmt::format("{} {}", axes[1].label, axes[1].values[k]);
    for (std::size_t i = 0; i < across.values.size(); ++i) {
      line.y.push_back(number_at(i, k, 0));
      band.lower.push_back(number_at(i, k, 1));
      band.upper.push_back(number_at(i, k, 2));
    }
    if (std::none_of(line.y.begin(), line.y.end(), [](double value) { return std::isfinite(value); })) continue;
    figure.series.push_back(std::move(band));
    figure.series.push_back(std::move(line));
    if (auto points = rigid_bodies_of(table, across.values, static_cast<int>(shown == 1 ? 1 : j), [&](std::size_t i) {
          return i * stride + (second == 1 ? k * stride_second : 0);
        })) {
      if (rolled) points->label.clear();
      rolled = true;
      figure.series.push_back(std::move(*points));
    }
  }
  if (figure.series.empty()) return std::nullopt;
  figure.legend = Legend::below;
  return figure;
}

std::size_t size_of(const SweepFile& sweep) {
  std::size_t size = 1;
  for (const SweepFileAxis& axis : sweep.axes) size *= axis.values.size();
  return size;
}

}  // namespace

void run_sweep_file(const SweepFile& sweep, const SweepRows& compute) {
  if (sweep.out == "-")
    throw std::invalid_argument("--out: a sweep keeps its points in a file as they come; --json - prints them");
  // Of a link, what it leads to is written and locked.
  const std::filesystem::path out = std::filesystem::is_symlink(sweep.out)
                                        ? std::filesystem::weakly_canonical(sweep.out)
                                        : std::filesystem::path(sweep.out);
  const std::filesystem::path partial = out.string() + ".partial";
  const std::size_t size = size_of(sweep);
  std::filesystem::path picture = out;
  picture.replace_extension(".svg");
  if (picture == out)
    throw OutputError(out, "the figure beside the numbers has that name; give the numbers another ending, .csv");
  for (const std::filesystem::path& own : {picture, partial})
    if (same_file(sweep.json, own))
      throw std::invalid_argument(fmt::format("--json: {} is what --out {} writes too", sweep.json, sweep.out));
  Answer answer(sweep.json);
  std::vector<std::string> rows = rows_of(out, sweep.head, "holds another sweep");
  std::size_t had = rows.size();
  if (had < size) {
    const FileLock lock(partial, FileLock::Missing::create);
    if (!lock.held()) throw OutputError(partial, "another sweep is writing it");
    // They are read again: the other one may have ended in between.
    rows = rows_of(out, sweep.head, "holds another sweep");
    if (rows.empty()) rows = rows_of(partial, sweep.head, "belongs to another sweep");
    had = rows.size();
    std::string so_far = sweep.head;
    for (const std::string& one : rows) so_far += one;
    const bool kept = read_file(partial).starts_with(so_far);
    std::filesystem::resize_file(partial, kept ? so_far.size() : 0);
    std::ofstream journal(partial, std::ios::binary | std::ios::app);
    const auto append = [&](const std::string& text) {
      errno = 0;
      if (!(journal << text << std::flush))
        throw OutputError(partial, errno != 0 ? std::strerror(errno) : "write error");
    };
    if (!kept) append(so_far);
    try {
      compute(had, [&](const std::string& row) {
        rows.push_back(row);
        append(row);
      });
    } catch (const Interrupted& interrupted) {
      throw Interrupted(interrupted, fmt::format("{} of {} points kept; the same command goes on", rows.size(), size));
    }
    journal.close();
    std::error_code error;
    std::filesystem::rename(partial, out, error);
    if (error) throw OutputError(out, error.message());
  }
  Table table = table_of(sweep, rows);
  const bool none = std::all_of(rows.begin(), rows.end(),
                                [&](const std::string& row) { return fields_of(row)[sweep.axes.size()].empty(); });
  const std::optional<Figure> drawn = figure_of(sweep, table);
  if (drawn) write_file(picture, render_svg(*drawn));
  answer.say("{}: {} points ({} taken over); {}", out.string(), size, had,
             drawn ? picture.string() : "no figure: no point has a finite number of steps");
  if (sweep.remark) answer.say("{}", sweep.remark(table));
  answer.table(std::move(table));
  answer.file(out.string());
  if (drawn) answer.file(picture.string());
  answer.finish(sweep.provenance);
  if (none) throw std::runtime_error(fmt::format("no point has a number; {} says why, point by point", out.string()));
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
