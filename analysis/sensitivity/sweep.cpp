#include "analysis/sensitivity/sweep.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <map>
#include <mutex>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "analysis/study/steady_launch.h"
#include "markov/chain/chain.h"
#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

constexpr std::size_t most_points = 1000000;  // an axis has 100000 at most, so that their product fits
// These limits are of the wheels rolled under `settled`. A landing costs 15 to 60 us, so all together take 1 to 4 s of
// one processor.
constexpr double most_rolled = 16;
constexpr std::uint64_t all_collisions = 65536, fewest_collisions = 1024;

// Returns how many values of each axis have wheels rolled.
std::size_t rolled_values(const std::vector<SweepAxis>& axes) {
  const double each = std::pow(most_rolled, 1.0 / static_cast<double>(axes.size()));
  return std::max<std::size_t>(2, static_cast<std::size_t>(each + 1e-9));
}

// Says whether value `index` of `size` is one of `count` that lie evenly, ends included.
bool evenly(std::size_t index, std::size_t size, std::size_t count) {
  if (size <= count) return true;
  const std::size_t nearest = (index * (count - 1) + (size - 1) / 2) / (size - 1);
  return (nearest * (size - 1) + (count - 1) / 2) / (count - 1) == index;
}

// Rolls wheels of the point's setting, where it has a launch.
std::optional<RigidBodyCheck> rolled(const Metastability& study, const std::vector<SweepAxis>& axes,
                                     const StudyOptions& options) {
  const Setting& setting = *study.setting;
  if (setting.steady_launch && !setting.steady_speed) return std::nullopt;
  std::uint64_t points = 1;
  for (const SweepAxis& axis : axes) points *= std::min(rolled_values(axes), axis.values.size());
  return rigid_body_check(setting, {.collisions = std::max(fewest_collisions, all_collisions / points),
                                    .seed = options.seed,
                                    .threads = options.threads,
                                    .progress = [&](double) {
                                      if (options.progress) options.progress(0, "rigid bodies");
                                    }});
}

void fail(SweepPoint& point, const Setting& setting, Status status, const std::exception& error) {
  point.study.setting = setting;
  point.study.status = status;
  point.study.message = error.what();
  point.failure = std::current_exception();
}

}  // namespace

std::vector<double> axis_values(double first, double last, double step) {
  if (!(step > 0) || !(last >= first) || !std::isfinite(first) || !std::isfinite(last))
    throw std::invalid_argument(fmt::format("range {}:{}:{}: needs first <= last and step > 0", first, last, step));
  const double count = std::floor((last - first) / step + 1e-3);
  if (count >= 100000)
    throw std::invalid_argument(fmt::format("range {}:{}:{}: more than 100000 values", first, last, step));
  std::vector<double> values;
  // They are rounded to the decimals a reader typed, so that 5:12:0.25 gives 5.25 and not 5.2500000000000004.
  for (double i = 0; i <= count; ++i) values.push_back(std::stod(fmt::format("{:.12g}", first + i * step)));
  return values;
}

std::size_t sweep_size(const std::vector<SweepAxis>& axes) {
  std::size_t size = 1;
  for (const SweepAxis& axis : axes) {
    size *= axis.values.size();
    if (size > most_points)
      throw std::invalid_argument(fmt::format("sweep: more than {} points; take coarser steps", most_points));
  }
  return size;
}

Setting sweep_setting(const Setting& base, const std::vector<SweepAxis>& axes, std::size_t index,
                      std::vector<double>* at) {
  Setting setting = base;
  std::vector<double> place(axes.size());
  for (std::size_t a = axes.size(); a-- > 0;) {
    place[a] = axes[a].values[index % axes[a].values.size()];
    index /= axes[a].values.size();
    set_parameter(setting, axes[a].parameter, place[a]);
  }
  if (at != nullptr) *at = std::move(place);
  return setting;
}

std::string sweep_description(const Setting& base, const std::vector<SweepAxis>& axes) {
  // A number that varies is none: it is described as "nan".
  constexpr std::string_view none = "nan", slope = "nan deg";
  Setting setting = base;
  for (const SweepAxis& axis : axes)
    set_parameter(setting, axis.parameter,
                  axis.values.size() == 1 ? axis.values[0] : std::numeric_limits<double>::quiet_NaN());
  std::string text = setting.describe();
  if (text.starts_with(slope)) text.replace(0, slope.size(), "slope varies");
  for (std::size_t at = text.find(none); at != std::string::npos; at = text.find(none, at))
    text.replace(at, none.size(), "varies");
  return text;
}

bool rolled_at(const std::vector<SweepAxis>& axes, std::size_t index) {
  for (std::size_t a = axes.size(); a-- > 0;) {
    const std::size_t size = axes[a].values.size();
    if (!evenly(index % size, size, rolled_values(axes))) return false;
    index /= size;
  }
  return true;
}

SweepPoint sweep_point(const Setting& base, const std::vector<SweepAxis>& axes, std::size_t index,
                       const StudyOptions& options, RigidBodies rigid_bodies) {
  StudyOptions single = options;
  single.threads = 1;
  single.brief = true;
  if (options.progress) single.progress = [&](double, const std::string& what) { options.progress(0, what); };
  SweepPoint point;
  const Setting setting = sweep_setting(base, axes, index, &point.at);
  try {
    point.study = study(setting, single);
  } catch (const markov::ConvergenceError& error) {  // the other points are worth having
    fail(point, setting, Status::solver_failed, error);
  } catch (const NoRegime& error) {
    fail(point, setting, Status::no_regime, error);
  }
  if (rigid_bodies == RigidBodies::asked && rolled_at(axes, index))
    point.rigid_bodies = rolled(point.study, axes, single);
  return point;
}

void sweep(const Setting& base, const std::vector<SweepAxis>& axes, std::size_t begin, const StudyOptions& options,
           const std::function<void(std::size_t, const SweepPoint&)>& done, RigidBodies rigid_bodies) {
  const std::size_t size = sweep_size(axes);
  if (begin >= size) return;
  // The first table of landings is built by all threads together; on one slope it serves all points.
  tabulate_landings(sweep_setting(base, axes, begin), options);
  std::mutex mutex;
  std::map<std::size_t, SweepPoint> waiting;  // finished before an earlier point
  std::size_t next = begin;
  bool stopped = false;  // done() threw: later points are not reported
  markov::parallel_for(size - begin, options.threads, [&](std::size_t k) {
    SweepPoint point = sweep_point(base, axes, begin + k, options, rigid_bodies);
    const std::scoped_lock lock(mutex);
    waiting.emplace(begin + k, std::move(point));
    while (!stopped && !waiting.empty() && waiting.begin()->first == next) {
      stopped = true;
      done(next++, waiting.begin()->second);
      stopped = false;
      waiting.erase(waiting.begin());
    }
  });
}

}  // namespace metastable::analysis
