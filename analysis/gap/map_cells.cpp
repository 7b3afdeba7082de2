#include "analysis/gap/map_cells.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <utility>

namespace metastable::analysis {
namespace {

constexpr std::size_t least_launches = 10;  // for a cell of their own
constexpr double largest_frequency = 60;    // [Hz] of a swing with the time since the previous collision
constexpr double most_frequencies = 30;

// Cuts into `parts` of equal counts.
std::vector<double> quantile_cuts(std::vector<double> values, int parts) {
  std::sort(values.begin(), values.end());
  std::vector<double> cuts;
  for (int i = 1; i < parts; ++i)
    cuts.push_back(values[values.size() * static_cast<std::size_t>(i) / static_cast<std::size_t>(parts)]);
  cuts.erase(std::unique(cuts.begin(), cuts.end()), cuts.end());
  return cuts;
}

class Cutter {
 public:
  explicit Cutter(const TransitionModel& model) : model_(model) {}

  std::vector<MapCell> cells() {
    const auto& events = model_.events();
    two_phases_ = std::any_of(events.begin(), events.end(), [](const Event& e) { return is_stance(e.kind); });
    for (const EventPhase& phase : event_phases(model_)) cut_phase(phase);
    const std::vector<ObservedColumn> columns = model_.columns();
    for (std::size_t c = 0; c < columns.size(); ++c) {
      std::vector<std::size_t> launches;
      for (std::size_t i = 0; i < events.size(); ++i)
        if (events[i].kind == EventKind::launch && events[i].column == c) launches.push_back(i);
      if (launches.size() >= least_launches)
        cells_.push_back(
            {model_.step_name(), "launch" + (columns.size() > 1 ? ", " + columns[c].name : ""), launches, false});
    }
    return std::move(cells_);
  }

 private:
  void cut_phase(const EventPhase& phase) {
    const auto& [stance, column, members, where] = phase;
    if (members.size() < least_cell_events) return;
    const std::size_t first = cells_.size();
    const ObservedColumn observed = model_.columns()[column];
    const std::string step = model_.step_name();
    ranges(observed.name, members, where, 5, observed.unit,
           [](const Event& e) { return std::isfinite(e.speed) ? std::optional(e.speed) : std::nullopt; });
    groups(model_.leg_name(), members, where, [this](const Event& e) {
      return e.leg ? std::optional(std::pair{*e.leg, model_.leg_word(*e.leg)}) : std::nullopt;
    });
    ranges("position", members, where, 6, model_.position_unit(),
           [](const Event& e) { return std::optional(e.position); });
    groups(step, members, where, [&](const Event& e) { return numbers(step, e.number); });
    ranges("trial", members, where, 6, "",
           [](const Event& e) { return std::optional(static_cast<double>(e.trial + 1)); });
    if (model_.trials() > 2) trend(members, where);
    ranges("time", members, where, 5, "s since the previous " + step, [](const Event& e) { return e.since_previous; });
    if (!stance && model_.time_tells()) swings(members, where);
    if (model_.conditions() > 1)
      groups("condition", members, where, [this](const Event& e) {
        return std::optional(std::pair{static_cast<int>(e.condition), model_.condition_name(e.condition)});
      });
    if (two_phases_)
      cells_.push_back({"phase", stance ? "stance" : "collision", members, stance});
    else  // A machine's phases are what a wheel's legs are.
      cells_.push_back({facet_of_all, "step" + where, members, stance});
    for (std::size_t c = first; c < cells_.size(); ++c) cells_[c].stance = stance;
  }
  // Groups are collisions 1, 2, 3 to 4, ..., 13 to 16, and those from 17.
  static std::optional<std::pair<int, std::string>> numbers(const std::string& step, int number) {
    static constexpr std::array ends{1, 2, 4, 8, 12, 16};
    int from = 1;
    for (std::size_t i = 0; i < ends.size(); ++i) {
      if (number <= ends[i])
        return std::pair{static_cast<int>(i), from == ends[i] ? fmt::format("{} {}", step, from)
                                                              : fmt::format("{}s {} to {}", step, from, ends[i])};
      from = ends[i] + 1;
    }
    return std::pair{static_cast<int>(ends.size()), fmt::format("{}s from {}", step, from)};
  }

  template <class Key>
  void groups(const std::string& facet, const std::vector<std::size_t>& members, const std::string& where, Key key) {
    std::map<int, MapCell> found;
    for (const std::size_t i : members)
      if (const auto k = key(model_.events()[i])) {
        MapCell& cell = found[k->first];
        cell.facet = facet;
        cell.at = k->second + where;
        cell.events.push_back(i);
      }
    if (found.size() < 2) return;
    for (auto& [index, cell] : found)
      if (cell.events.size() >= least_cell_events) cells_.push_back(std::move(cell));
  }
  template <class Value>
  void ranges(const std::string& facet, const std::vector<std::size_t>& members, const std::string& where, int parts,
              const std::string& unit, Value value) {
    std::vector<double> all;
    for (const std::size_t i : members)
      if (const auto v = value(model_.events()[i])) all.push_back(*v);
    if (all.size() < 2 * least_cell_events) return;
    const auto [least, most] = std::minmax_element(all.begin(), all.end());
    const double low = *least, high = *most;
    if (!(low < high)) return;
    const std::vector<double> cuts = quantile_cuts(all, parts);
    groups(facet, members, where, [&](const Event& e) -> std::optional<std::pair<int, std::string>> {
      const auto v = value(e);
      if (!v) return std::nullopt;
      const auto at = std::upper_bound(cuts.begin(), cuts.end(), *v) - cuts.begin();
      const double from = at == 0 ? low : cuts[static_cast<std::size_t>(at) - 1];
      const double to = static_cast<std::size_t>(at) == cuts.size() ? high : cuts[static_cast<std::size_t>(at)];
      return std::pair{static_cast<int>(at),
                       fmt::format("{} {:.3g} to {:.3g}{}{}", facet, from, to, unit.empty() ? "" : " ", unit)};
    });
  }

  // Weights run from -1 at the first trial to 1 at the last one.
  void trend(const std::vector<std::size_t>& members, const std::string& where) {
    MapCell cell{"trial", "trend over the trials" + where, members, false};
    const double last = static_cast<double>(model_.trials() - 1);
    for (const std::size_t i : members)
      cell.weights.push_back(2 * static_cast<double>(model_.events()[i].trial) / last - 1);
    cells_.push_back(std::move(cell));
  }
  // Takes cosine and sine of the time since the previous collision at as many frequencies as its spread tells apart.
  void swings(const std::vector<std::size_t>& members, const std::string& where) {
    std::vector<double> times;
    MapCell cell{.facet = "time", .swing = true};
    for (const std::size_t i : members)
      if (const auto t = model_.events()[i].since_previous) {
        cell.events.push_back(i);
        times.push_back(*t);
      }
    if (times.size() < 2 * least_cell_events) return;
    std::vector<double> sorted = times;
    std::sort(sorted.begin(), sorted.end());
    const double middle = sorted[sorted.size() / 2],
                 spread = sorted[sorted.size() * 19 / 20] - sorted[sorted.size() / 20];
    if (!(spread > 0)) return;
    const double spacing = std::max(0.5 / spread, largest_frequency / most_frequencies);
    for (double f = 1 / spread; f <= largest_frequency; f += spacing)
      for (const double phase : {0.0, 0.5 * std::numbers::pi}) {
        cell.at = fmt::format("{} of {:.3g} Hz in the time since the previous collision{}",
                              phase == 0 ? "cosine" : "sine", f, where);
        cell.weights.clear();
        for (const double t : times) cell.weights.push_back(std::cos(2 * std::numbers::pi * f * (t - middle) - phase));
        cells_.push_back(cell);
      }
  }

  const TransitionModel& model_;
  bool two_phases_ = false;
  std::vector<MapCell> cells_;
};

}  // namespace

std::vector<EventPhase> event_phases(const TransitionModel& model) {
  const auto& events = model.events();
  const std::vector<ObservedColumn> columns = model.columns();
  const bool two = std::ranges::any_of(events, [](const Event& e) { return is_stance(e.kind); });
  std::vector<EventPhase> all;
  for (const bool stance : {false, true})
    for (std::size_t c = 0; c < columns.size(); ++c) {
      EventPhase phase{.stance = stance, .column = c};
      for (std::size_t i = 0; i < events.size(); ++i)
        if (events[i].column == c && (stance ? is_stance(events[i].kind) : is_contact(events[i].kind)))
          phase.members.push_back(i);
      if (two) phase.where = stance ? ", stance" : ", collision";
      if (columns.size() > 1) phase.where += ", " + columns[c].name;
      if (!phase.members.empty()) all.push_back(std::move(phase));
    }
  return all;
}

std::vector<MapCell> map_cells(const TransitionModel& model) { return Cutter(model).cells(); }

}  // namespace metastable::analysis
