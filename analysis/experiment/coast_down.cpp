#include "analysis/experiment/coast_down.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>
#include <stdexcept>

#include "analysis/experiment/csv_field.h"
#include "analysis/experiment/input_error.h"
#include "analysis/statistics/median.h"
#include "dynamics/wheel/ranges.h"
#include "markov/dense_matrix.h"

namespace metastable::analysis {
namespace {

constexpr int least_block = 10;                          // revolutions
constexpr std::size_t around = 5;                        // periods on either side that a period is compared with
constexpr double missed_from = 1.5, double_below = 0.6;  // of the median period
constexpr double most_left_out = 0.1;                    // of a run's revolutions
// No drum of a test stand turns at a tenth of this speed [rad/s], 29,000 revolutions a minute. A log in milliseconds,
// taken for microseconds, seems a thousand times as fast as it was.
constexpr double fastest_drum = 3000;
constexpr double whole_turn = 2 * std::numbers::pi;
constexpr double huber = 1.345;  // 95 % efficiency under normal noise
constexpr std::array<const char*, 5> columns{"time_us", "drum_speed_km_h", "drum_revolutions", "wheel_speed_km_h",
                                             "wheel_revolutions"};

std::vector<double> running_median(const std::vector<double>& values, std::size_t reach) {
  std::vector<double> medians;
  for (std::size_t k = 0; k < values.size(); ++k) {
    const std::size_t from = k < reach ? 0 : k - reach, to = std::min(values.size(), k + reach + 1);
    medians.push_back(
        median({values.begin() + static_cast<std::ptrdiff_t>(from), values.begin() + static_cast<std::ptrdiff_t>(to)}));
  }
  return medians;
}

// Returns by how much a period is off the line between its neighbours, relative; 0 beside split and joint periods.
std::vector<double> bends(const std::vector<double>& periods, const std::vector<double>& medians) {
  const auto whole = [&](std::size_t k) {
    return periods[k] < missed_from * medians[k] && periods[k] >= double_below * medians[k];
  };
  std::vector<double> off(periods.size(), 0.0);
  for (std::size_t k = 1; k + 1 < periods.size(); ++k)
    if (whole(k - 1) && whole(k) && whole(k + 1))
      off[k] = std::abs(1 - (periods[k - 1] + periods[k + 1]) / (2 * periods[k]));
  return off;
}

// One row of a log: its five columns, and three of them by name.
struct CounterRow {
  std::array<double, 5> values{};
  double time = 0, drum = 0, wheel = 0;  // [s], revolutions
};

// Says what is wrong with the text of a column; nothing if it is a number in range, of a counter a whole one.
std::optional<std::string> field_defect(std::string_view field, std::size_t column, double& value) {
  const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
  if (error != std::errc{} || end != field.data() + field.size() || !std::isfinite(value))
    return fmt::format("{}: {} is not a number", columns[column], shown_text(field));
  if (!dynamics::range::log.holds(value))
    return fmt::format("{}: {} is outside {}", columns[column], value, dynamics::range::log.text());
  const bool counter = column == 2 || column == 4;
  if (counter && value != std::floor(value)) return fmt::format("{}: {} is no whole number", columns[column], value);
  return std::nullopt;
}

// Reads a row; nothing, and a defect, if it is not five numbers.
std::optional<CounterRow> counter_row(const std::string& file, std::size_t number, std::string_view line,
                                      Defects& defects) {
  CounterRow row;
  std::size_t from = 0;  // of a field
  for (std::size_t read = 0; read < row.values.size(); ++read) {
    const auto comma = line.find(',', from);
    if (const auto defect = field_defect(line.substr(from, comma - from), read, row.values[read])) {
      defects.add(file, {number, from + 1}, *defect);
      return std::nullopt;
    }
    const bool last = read + 1 == row.values.size();
    if (comma == std::string_view::npos && !last) {
      defects.add(file, {number, 1}, fmt::format("{} fields where five are expected", read + 1));
      return std::nullopt;
    }
    from = comma + 1;
    if (comma != std::string_view::npos && last) {
      defects.add(file, {number, from + 1}, "more than five fields");
      return std::nullopt;
    }
  }
  row.time = row.values[0] * 1e-6;
  row.drum = row.values[2];
  row.wheel = row.values[4];
  return row;
}

// Cuts the revolutions first..end into blocks without a defect, and counts the defects.
// @param periods, medians  of the revolutions [s]
void fill_blocks(const CounterLog& log, const std::vector<double>& periods, const std::vector<double>& medians,
                 std::size_t first, std::size_t end, int longest, CoastDownRun& run) {
  const std::vector<double> off = bends(periods, medians);
  const std::vector<double> usual = running_median(off, 25);
  bool displaced_before = false;
  std::vector<Revolution> block;
  std::size_t kept = 0;
  const auto close = [&] {
    if (block.size() >= least_block) {
      kept += block.size();
      run.blocks.push_back(block);
    }
    block.clear();
  };
  for (std::size_t k = first; k < end; ++k) {
    const double ratio = periods[k] / medians[k];
    const bool displaced = off[k] > std::max(2e-4, 8 * median_deviation_to_sd * usual[k]);
    bool defect = true;
    if (log.skipped[k + 1] > 0) {
      run.missed += static_cast<std::size_t>(log.skipped[k + 1]);
    } else if (ratio >= missed_from) {
      run.missed += static_cast<std::size_t>(std::lround(ratio)) - 1;
    } else if (ratio < double_below) {
      ++run.doubled;
      if (k + 1 < end && ratio + periods[k + 1] / medians[k + 1] < 1.4) ++k;  // the revolution's other part
    } else if (displaced) {
      if (!displaced_before) ++run.displaced;  // one tick bends the periods around it
    } else {
      defect = false;
    }
    displaced_before = displaced;
    if (defect) {
      close();
      continue;
    }
    block.push_back({log.time[k + 1], whole_turn / periods[k]});
    if (static_cast<int>(block.size()) == longest) close();
  }
  close();
  run.left_out = run.revolutions - kept;
}

}  // namespace

void CoastDownOptions::validate() const {
  if (!(stop > 0) || !std::isfinite(stop))
    throw std::invalid_argument(fmt::format("stop: {} rad/s is outside (0, inf)", stop));
  if (block < least_block || block > 100000)
    throw std::invalid_argument(fmt::format("block: {} is outside {}..100000", block, least_block));
}

CounterLog parse_counter_log(const std::string& file, std::string_view text) {
  Defects defects;
  CounterLog log;
  std::optional<CounterRow> last;
  for (std::size_t number = 1; !text.empty(); ++number) {
    const auto feed = text.find('\n');
    std::string_view line = text.substr(0, feed);
    text = feed == std::string_view::npos ? std::string_view{} : text.substr(feed + 1);
    if (line.ends_with('\r')) line.remove_suffix(1);
    if (line.empty() && text.find_first_not_of("\r\n") == std::string_view::npos) break;  // after the last row
    const std::optional<CounterRow> row = counter_row(file, number, line, defects);
    if (!row) continue;
    if (last && (row->time < last->time || row->drum < last->drum || row->wheel < last->wheel)) {
      const std::size_t which = row->time < last->time ? 0 : row->drum < last->drum ? 2 : 4;
      defects.add(file, {number, 1}, fmt::format("{}: falls to {}", columns[which], row->values[which]));
      continue;
    }
    if (last && row->drum > last->drum) {
      if (!log.time.empty() && row->time <= log.time.back()) {
        defects.add(file, {number, 1}, "time_us: two drum revolutions end at the same time");
        continue;
      }
      log.time.push_back(row->time);
      log.skipped.push_back(static_cast<int>(std::min(row->drum - last->drum, 1e9)) - 1);
    }
    last = row;
  }
  defects.check();
  if (log.time.size() < 20)
    throw InputError({fmt::format("{}: {} drum revolutions are too few, 20 are needed", file, log.time.size())});
  return log;
}

CoastDownRun coast_down(const CounterLog& log, const CoastDownOptions& options) {
  options.validate();
  if (log.time.size() < least_block)
    throw std::invalid_argument(
        fmt::format("{}: {} ticks are too few, {} are needed", log.name, log.time.size(), least_block));
  if (log.skipped.size() != log.time.size())
    throw std::invalid_argument(
        fmt::format("{}: skipped has {} entries for {} ticks", log.name, log.skipped.size(), log.time.size()));
  std::vector<double> periods;
  for (std::size_t k = 1; k < log.time.size(); ++k) periods.push_back(log.time[k] - log.time[k - 1]);
  const std::vector<double> medians = running_median(periods, around);

  CoastDownRun run;
  run.name = log.name;
  const double shortest = *std::min_element(medians.begin(), medians.end());
  run.top = whole_turn / shortest;
  run.stop = options.stop;
  if (!(run.top > options.stop))
    throw std::invalid_argument(fmt::format("{}: the top speed, {:.3g} rad/s, is not above the stop, {:.3g} rad/s",
                                            log.name, run.top, options.stop));
  std::size_t first = 0;
  for (std::size_t k = 0; k < medians.size(); ++k)
    if (medians[k] <= shortest * 1.005) first = k + 1;
  std::size_t end = first;
  while (end < medians.size() && whole_turn / medians[end] >= options.stop) ++end;
  run.revolutions = end - first;
  fill_blocks(log, periods, medians, first, end, options.block, run);
  if (run.blocks.empty())
    throw std::invalid_argument(fmt::format("{}: no {} revolutions without a defect", log.name, least_block));
  return run;
}

LossFit fit_loss(const std::vector<CoastDownRun>& runs, bool linear) {
  std::vector<double> omega, lost;
  for (const CoastDownRun& run : runs)
    for (const auto& block : run.blocks)
      for (std::size_t k = 1; k < block.size(); ++k) {
        omega.push_back(block[k - 1].omega);
        lost.push_back(block[k - 1].omega * block[k - 1].omega - block[k].omega * block[k].omega);
      }
  LossFit fit;
  fit.transitions = omega.size();
  if (omega.size() < 20)
    throw std::invalid_argument(fmt::format("loss: {} transitions are too few, 20 are needed", omega.size()));
  const auto rows = static_cast<Eigen::Index>(omega.size());
  const Eigen::Map<const Eigen::VectorXd> w(omega.data(), rows), y(lost.data(), rows);
  Eigen::MatrixXd terms(rows, linear ? 3 : 2);
  terms.col(0).setOnes();
  terms.col(1) = w.array().square();
  if (linear) terms.col(2) = w;
  Eigen::VectorXd weight = Eigen::VectorXd::Ones(rows), value, residual;
  Eigen::MatrixXd normal;
  double scale = 0;
  for (int i = 0; i < 200; ++i) {
    normal = terms.transpose() * weight.asDiagonal() * terms;
    const Eigen::VectorXd next = markov::solve_symmetric(normal, terms.transpose() * weight.cwiseProduct(y));
    residual = y - terms * next;
    std::vector<double> sizes(omega.size());
    for (std::size_t k = 0; k < sizes.size(); ++k) sizes[k] = std::abs(residual[static_cast<Eigen::Index>(k)]);
    scale = median_deviation_to_sd * median(sizes);
    const bool settled = i > 0 && (next - value).norm() <= 1e-12 * next.norm();
    value = next;
    if (settled || scale == 0) break;
    for (Eigen::Index k = 0; k < rows; ++k) weight[k] = std::min(1.0, huber * scale / std::abs(residual[k]));
  }
  fit.loss = {value[0], linear ? value[2] : 0, value[1], scale};
  const Eigen::MatrixXd covariance = scale * scale / 0.95 * markov::inverse_of(terms.transpose() * terms);
  fit.constant_error = std::sqrt(covariance(0, 0));
  fit.quadratic_error = std::sqrt(covariance(1, 1));
  if (linear) fit.linear_error = std::sqrt(covariance(2, 2));
  fit.outliers = static_cast<std::size_t>((residual.array().abs() > 5 * scale).count());
  return fit;
}

std::string objection(const CoastDownRun& run, const RevolutionLoss& nominal) {
  if (static_cast<double>(run.left_out) > most_left_out * static_cast<double>(run.revolutions))
    return fmt::format(
        "{}: {} of {} revolutions left out for ticks that were missed, double or displaced, more than a "
        "tenth",
        run.name, run.left_out, run.revolutions);
  if (run.top > fastest_drum)
    return fmt::format(
        "{}: a top speed of {:.3g} rad/s, where a drum turns at {:g} at most: is time_us in microseconds?", run.name,
        run.top, fastest_drum);
  // A parabola is least at an end or at its vertex.
  double least = std::min(nominal.at(run.stop), nominal.at(run.top));
  const double vertex = nominal.quadratic > 0 ? -nominal.linear / (2 * nominal.quadratic) : 0;
  if (vertex > run.stop && vertex < run.top) least = std::min(least, nominal.at(vertex));
  if (least > 0) return "";
  return fmt::format(
      "{}: the nominal loss falls to {:.3g} rad^2/s^2 a revolution between {:.3g} and {:.3g} rad/s, and a "
      "drum that coasts down loses more than nothing",
      run.name, least, run.stop, run.top);
}

double run_to_run_of(const std::vector<CoastDownRun>& runs, bool linear) {
  constexpr double most = dynamics::range::run_to_run.high;
  double slow = 0, fast = std::numeric_limits<double>::infinity();
  std::vector<RevolutionLoss> losses;
  for (const CoastDownRun& run : runs) {
    losses.push_back(fit_loss({run}, linear).loss);
    slow = std::max(slow, run.stop);
    fast = std::min(fast, run.top);
  }
  const auto count = static_cast<double>(runs.size());
  const std::array speeds{slow, std::sqrt(slow * fast), fast};
  double squares = 0;  // of the differences, as shares of the mean loss, mean of the speeds
  for (const double omega : speeds) {
    double mean = 0;
    for (const RevolutionLoss& loss : losses) mean += loss.at(omega) / count;
    for (const RevolutionLoss& loss : losses)
      squares += std::pow(loss.at(omega) / mean - 1, 2) / static_cast<double>(speeds.size());
  }
  const double share = std::sqrt((squares + usual_run_to_run * usual_run_to_run) / count);
  if (share <= most) return share;
  const auto by_loss = [&](const RevolutionLoss& a, const RevolutionLoss& b) {
    return a.at(speeds[1]) < b.at(speeds[1]);
  };
  const auto [least, largest] = std::minmax_element(losses.begin(), losses.end(), by_loss);
  const auto name = [&](auto one) { return runs[static_cast<std::size_t>(one - losses.begin())].name; };
  throw std::invalid_argument(fmt::format(
      "loss: from run to run it differs by {:.0f} % of its mean, more than {:.0f} %: at {:.3g} rad/s {} loses {:.3g} "
      "rad^2/s^2 a revolution and {} {:.3g}; give runs of one loss, or state a nominal one (--nominal)",
      100 * share, 100 * most, speeds[1], name(least), least->at(speeds[1]), name(largest), largest->at(speeds[1])));
}

ExperimentFiles coast_down_files(const std::vector<CoastDownRun>& runs, const RevolutionLoss& nominal,
                                 std::optional<double> rotor_inertia, const std::string& title,
                                 const std::vector<std::string>& comment) {
  ExperimentFiles files;
  std::string& toml = files.experiment_toml;
  for (const std::string& line : comment) toml += "# " + line + "\n";
  toml += fmt::format("title = {}\nsystem = \"coast_down\"\n", toml_text(title));
  if (rotor_inertia) toml += fmt::format("\n[rotor]\ninertia_kg_m2 = {}\n", *rotor_inertia);
  toml += fmt::format("\n[loss]\nconstant = {}\nlinear = {}\nquadratic = {}\nnoise_sd = {}\n", nominal.constant,
                      nominal.linear, nominal.quadratic, nominal.noise_sd);
  if (nominal.run_to_run) toml += fmt::format("run_to_run = {}\n", *nominal.run_to_run);
  if (!nominal.accepted_defects.empty())
    toml += fmt::format("accepted_defects = {}\n", toml_text(nominal.accepted_defects));
  files.collisions_csv = "condition,trial,collision,time_s,omega_minus_rad_s\n";
  std::size_t trial = 0;
  for (const CoastDownRun& run : runs) {
    toml += fmt::format("\n[[condition]]\nid = {}\n", toml_text(run.name));
    for (const auto& block : run.blocks) {
      ++trial;
      for (std::size_t k = 0; k < block.size(); ++k)
        fmt::format_to(std::back_inserter(files.collisions_csv), "{},{},{},{:.6f},{:.9g}\n", csv_field(run.name), trial,
                       k + 1, block[k].time, block[k].omega);
    }
  }
  return files;
}

}  // namespace metastable::analysis
