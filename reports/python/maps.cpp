// Binds walkers of the library, and any simulator that takes its noise as normal scores, on meshes.

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <stdexcept>

#include "analysis/walkers/split_falls.h"
#include "analysis/walkers/walker_falls.h"
#include "analysis/walkers/walker_study.h"
#include "analysis/walkers/walker_trials.h"
#include "markov/mesh/batch_simulation.h"
#include "markov/parallel.h"
#include "reports/command_line/requests.h"
#include "reports/command_line/walker_options.h"
#include "reports/commands/walker_command.h"
#include "reports/output/text_table.h"
#include "reports/output/version.h"
#include "reports/python/answer.h"
#include "reports/python/arguments.h"
#include "reports/python/step_arrays.h"
#include "reports/study/walker_text.h"

namespace metastable::reports::python {
namespace {

// Says how long something walks: shares that walk on, and the ends of their intervals, NaN where unknown.
void tell_survival(const std::vector<markov::MeshEstimate>& survival, py::dict& arrays) {
  std::vector<double> shares{1}, ends{1, 1};
  for (const markov::MeshEstimate& one : survival)
    shares.push_back(one.value), ends.push_back(one.lower), ends.push_back(one.upper);
  arrays["survival"] = array_of(std::move(shares));
  arrays["survival_interval_95"] =
      array_of(std::move(ends)).reshape(std::vector<py::ssize_t>{static_cast<py::ssize_t>(survival.size()) + 1, 2});
}

struct Asked {
  markov::MeshStudyOptions mesh;
  markov::SplittingOptions splitting;
  WalkerMethod method = WalkerMethod::mesh;
  WalkerLevel level = WalkerLevel::learnt;
};

// Reads what a walker of the library or of one's own is asked, as `steps` and `compare` do.
Asked asked_of(const Arguments& given, bool several = false) {
  if (given.given("standard_errors")) throw std::invalid_argument("--standard-errors: has no meaning with --walker");
  LooseOptions options(several ? declare_compare : declare_steps);
  given.give(*options);
  options->check_given();
  Asked asked;
  if (several) {
    asked.mesh = mesh_options(*options, {});
  } else {
    asked.mesh = mesh_options(*options, {"how-it-fails", "time-limit", "method", "tolerance", "level"});
    asked.method = walker_method(*options);
    asked.level = walker_level(*options, asked.method);
    asked.splitting = splitting_options(*options);
    if (asked.method == WalkerMethod::splitting && given.given("guided_samples"))
      throw std::invalid_argument("guided_samples: has no meaning with method \"splitting\"");
  }
  read_guided_samples(given, asked.mesh);
  return asked;
}

double time_limit_of(const Arguments& given) {
  const double limit = given.given("time_limit") ? given.number("time_limit") : usual_time_limit;
  if (!(limit > 0)) throw std::invalid_argument(fmt::format("time_limit: {:g} s, more than 0 expected", limit));
  return limit;
}

WalkerRequest walker_request_of(const py::list& settings, const Arguments& given, const std::string& command) {
  WalkerRequest request;
  for (const py::handle& fields : settings)
    request.settings.push_back(walker_setting_of(Arguments(fields.cast<py::dict>())));
  const Asked asked = asked_of(given, settings.size() > 1);
  request.study = asked.mesh;
  request.method = asked.method;
  request.level = asked.level;
  request.splitting = asked.splitting;
  request.command = command;
  request.how_it_fails = given.flag("how_it_fails");
  request.time_limit = time_limit_of(given);
  return request;
}

// Does `steps --walker` for one setting, `compare --walker` for several.
py::dict study_walkers(const py::list& settings, const py::dict& options, const std::string& command,
                       const py::object& progress) {
  const WalkerRequest request = walker_request_of(settings, Arguments(options), command);
  WalkerAnswer found;
  Call call(progress);
  call.run([&] {
    found = request.settings.size() > 1 ? answer_walker_compare(request, parts_of(call))
                                        : answer_walker_steps(request, parts_of(call));
  });
  std::vector<Table> tables;
  for (std::size_t i = 0; i < found.studies.size(); ++i)
    tables.push_back(mesh_table(request.settings[i].describe(), found.studies[i].passage,
                                {command, {}, request.study.seed, version()}));
  if (found.splitting && found.studies.empty())
    tables.push_back(splitting_table(*found.splitting, {command, {}, request.study.seed, version()}));
  py::dict arrays;
  if (request.settings.size() == 1 && found.studies.empty())
    tell_survival(found.splitting->passage.survival, arrays);
  else if (request.settings.size() == 1)
    tell_survival(found.studies.front().passage.survival, arrays);
  return answer(walker_answer_json(request, found), walker_answer_text(request, found, line_width), tables_html(tables),
                arrays);
}

/// A simulator written in Python.
struct PythonMap {
  py::object step;
  std::string name;
  int dimension = 1, scores = 1, phases = 1;
  std::vector<std::string> names, noise_names;
  std::vector<double> start;
  std::vector<int> angles;  // places in the state
};

PythonMap map_of(const py::dict& fields) {
  const Arguments given(fields);
  PythonMap map;
  map.step = fields["step"];
  map.name = given.text("name");
  map.dimension = static_cast<int>(given.whole("dimension", 1, markov::most_dimensions));
  map.scores = static_cast<int>(given.whole("noise", 1, 16));
  map.phases = static_cast<int>(given.whole("phases", 1, 64));
  map.names = given.texts("names");
  map.noise_names = given.texts("noise_names");
  if (map.noise_names.empty())
    for (int k = 0; k < map.scores; ++k) map.noise_names.push_back(fmt::format("noise {} [sd]", k + 1));
  if (map.noise_names.size() != static_cast<std::size_t>(map.scores))
    throw std::invalid_argument(fmt::format("noise_names: {} given, one for each of the {} numbers expected",
                                            map.noise_names.size(), map.scores));
  map.start = given.numbers("start");
  map.angles = fields["angles"].cast<std::vector<int>>();
  return map;
}

// Returns the map as the library takes it: Python is asked through `call`.
markov::BatchMap batch_of(const PythonMap& python, Call& call) {
  markov::BatchMap map;
  map.dimension = python.dimension;
  map.scores = python.scores;
  map.phases = python.phases;
  map.names = python.names;
  map.dear = true;
  map.step = [&python, &call](int phase, auto states, auto scores, auto next, auto failed) {
    call.ask([&] {
      const std::size_t rows = failed.size();
      const py::object state = rows_of(states, rows), noise = rows_of(scores, rows);
      take_step(
          call_step([&] { return python.phases > 1 ? python.step(state, noise, phase) : python.step(state, noise); }),
          rows, next, failed);
    });
  };
  markov::require_start(map, python.start);
  return markov::with_angles(std::move(map), python.angles, python.start);
}

// Returns a level of the user's as splitting takes it; none: it is learnt.
markov::LevelFunction level_of(const py::object& level, const PythonMap& python, Call& call) {
  if (level.is_none()) return {};
  return [&level, &python, &call](int phase, std::span<const double> states, std::span<double> levels) {
    call.ask([&] {
      const py::object state = rows_of(states, levels.size());
      take_levels(call_step([&] { return python.phases > 1 ? level(state, phase) : level(state); }, "level"), levels);
    });
  };
}

py::dict study_map(const py::dict& fields, const py::dict& options, const std::string& command,
                   const py::object& progress, const py::object& level) {
  const PythonMap python = map_of(fields);
  const Arguments given(options);
  Asked asked = asked_of(given);
  const bool how_it_fails = given.flag("how_it_fails");
  const double time_limit = time_limit_of(given);
  MapStudy found{python.name, python.names, {}};
  for (int k = static_cast<int>(found.names.size()); k < python.dimension; ++k)
    found.names.push_back(fmt::format("x{}", k + 1));
  std::optional<analysis::LastMoments> moments;
  std::optional<SplittingAnswer> splitting;
  bool on_mesh = false;
  Call call(progress);
  const markov::BatchMap map = batch_of(python, call);
  if (!level.is_none() && asked.method == WalkerMethod::mesh)
    throw std::invalid_argument("level: has no meaning with method \"mesh\"");
  asked.splitting.level = level_of(level, python, call);
  call.run([&] {
    const BeginPart begin = within(time_limit, parts_of(call));
    splitting = ask_both_ways(
        asked.method, python.name,
        [&] {
          const Tell tell = begin("steps");
          asked.mesh.progress = [&](double share) { tell(share, "steps"); };
          found.passage = markov::mesh_study(map, python.start, asked.mesh);
          markov::require_agreement(found.passage, python.name);
          on_mesh = true;
          return &found.passage;
        },
        [&] {
          asked.splitting.last_steps = how_it_fails ? analysis::steps_of_a_fall : 0;
          const markov::SplittingOptions splitting = with_level(asked.splitting, asked.level);
          return agreed_splitting(python.name, splitting, begin("splitting"), [&](const auto& options) {
            return markov::splitting_study(map, python.start, options);
          });
        });
    if (!how_it_fails) return;
    call.tell(0, "how it fails");
    std::vector<analysis::NamedNoise> noises;
    for (const std::string& name : python.noise_names) noises.push_back({name});
    moments = on_mesh ? analysis::how_it_falls(map, python.start, noises, found.passage, asked.mesh).moments
                      : analysis::how_it_falls(map, noises, splitting->passage);
  });
  const Provenance provenance{command, python.name, asked.mesh.seed, version()};
  py::dict arrays;
  tell_survival(on_mesh ? found.passage.survival : splitting->passage.survival, arrays);
  if (!on_mesh)
    return answer(splitting_json(*splitting, moments, provenance), splitting_text(*splitting, moments, line_width),
                  to_html(splitting_table(*splitting, provenance)), arrays);
  std::string json = map_json(found, moments, provenance), text = map_text(found, moments, line_width);
  if (splitting) {
    json = with_splitting_json(json, *splitting);
    text = with_splitting_text(text, *splitting);
  }
  return answer(json, text, to_html(mesh_table(python.name, found.passage, provenance)), arrays);
}

py::dict simulate_map(const py::dict& fields, const py::dict& options, const py::object& progress) {
  const PythonMap python = map_of(fields);
  const Arguments given(options);
  LooseOptions asked(declare_simulate);
  give_simulation(given.without({"trials"}), *asked);
  const markov::MeshStudyOptions study = mesh_options(*asked, {});
  const markov::SimulationOptions simulation{
      .trials = given.whole("trials", 2, 100000000),
      .seed = study.seed,
      .threads = study.threads,
      .most_steps = given.given("most_steps") ? given.whole("most_steps", 1, 1ULL << 62) : 1ULL << 62};
  std::optional<markov::SimulatedSteps> found;
  Call call(progress);
  const markov::BatchMap map = batch_of(python, call);
  call.run([&] { found = markov::simulate_steps(map, python.start, simulation); });
  if (!found)
    throw std::runtime_error(fmt::format("{}: {} steps do not suffice for {} trials to fail", python.name,
                                         simulation.most_steps, simulation.trials));
  py::dict told;
  told["mean"] = found->mean;
  told["standard_error"] = found->standard_error;
  told["steps"] = array_of(std::vector<std::int64_t>(found->steps.begin(), found->steps.end()));
  return told;
}

py::dict simulate_walks(const py::dict& fields, const py::dict& options, const py::object& progress) {
  const Arguments given(options);
  LooseOptions asked(declare_simulate);
  Arguments(fields).give(*asked);
  give_simulation(given, *asked);
  asked->check_given();
  const WalkerRequest request = walker_simulate_request(*asked, "");
  const analysis::WalkerSetting& setting = request.settings.front();
  analysis::WalkOptions walking = request.walks;
  if (given.given("most_steps")) walking.longest = given.whole("most_steps", 1, 1000000);
  std::vector<analysis::Walk> walks;
  Call call(progress);
  walking.progress = [&](double share) { call.tell(share, "simulate"); };
  call.run([&] { walks = analysis::simulate_walks(setting, walking); });
  std::vector<std::int64_t> trial, step, steps;
  std::vector<double> slope;
  std::vector<bool> fell;
  const std::vector<std::string> names = analysis::batch_map(setting).names;
  std::vector<std::vector<double>> states(names.size());
  for (std::size_t t = 0; t < walks.size(); ++t) {
    steps.push_back(static_cast<std::int64_t>(walks[t].steps.size()));
    fell.push_back(walks[t].fell);
    for (std::size_t n = 0; n < walks[t].steps.size(); ++n) {
      trial.push_back(static_cast<std::int64_t>(t + 1));
      step.push_back(static_cast<std::int64_t>(n + 1));
      slope.push_back(walks[t].steps[n].slope_deg);
      for (std::size_t k = 0; k < names.size(); ++k) states[k].push_back(walks[t].steps[n].state[k]);
    }
  }
  py::dict columns, told;
  columns["trial"] = array_of(std::move(trial));
  columns["step"] = array_of(std::move(step));
  for (std::size_t k = 0; k < names.size(); ++k) columns[names[k].c_str()] = array_of(std::move(states[k]));
  columns["slope met [deg]"] = array_of(std::move(slope));
  told["walks"] = columns;
  told["steps"] = array_of(std::move(steps));
  told["fell"] = py::array(py::cast(fell));
  return told;
}

// Takes one step of walkers of the library, each on a slope of its own; states outside the section have fallen.
py::tuple step_walkers(const py::dict& fields,
                       const py::array_t<double, py::array::c_style | py::array::forcecast>& states,
                       const py::array_t<double, py::array::c_style | py::array::forcecast>& slopes_deg) {
  const analysis::WalkerSetting setting = walker_setting_of(Arguments(fields));
  const dynamics::WalkerMap map = setting.map();
  const auto rows = static_cast<std::size_t>(slopes_deg.size()), d = static_cast<std::size_t>(map.walker().dimension());
  std::vector<double> from, next(rows * d, 0.0);
  std::vector<dynamics::Ground> grounds;
  std::vector<std::size_t> who;
  std::vector<std::uint8_t> failed(rows, 1);
  for (std::size_t i = 0; i < rows; ++i) {
    const double* state = states.data() + i * d;
    const double slope = slopes_deg.data()[i] * analysis::degree;
    if (!std::all_of(state, state + d, [](double x) { return std::isfinite(x); }) || !std::isfinite(slope) ||
        !(state[0] > 0 && state[0] < 0.5 * std::numbers::pi))
      continue;
    from.insert(from.end(), state, state + d);
    grounds.push_back({slope, slope});
    who.push_back(i);
  }
  std::vector<double> to(from.size());
  std::vector<std::uint8_t> fell(who.size());
  constexpr std::size_t block = 64;  // walkers
  markov::parallel_for((who.size() + block - 1) / block, 0, [&](std::size_t b) {
    const std::size_t first = b * block, count = std::min(block, who.size() - first);
    map.walker().step(std::span<const double>(from).subspan(first * d, count * d),
                      std::span<const dynamics::Ground>(grounds).subspan(first, count),
                      std::span(to).subspan(first * d, count * d), std::span(fell).subspan(first, count));
  });
  for (std::size_t k = 0; k < who.size(); ++k) {
    failed[who[k]] = fell[k];
    std::copy_n(to.data() + k * d, d, next.data() + who[k] * d);
  }
  py::array_t<double> stepped({rows, d});
  std::copy(next.begin(), next.end(), stepped.mutable_data());
  py::array_t<bool> lost(static_cast<py::ssize_t>(rows));
  std::transform(failed.begin(), failed.end(), lost.mutable_data(), [](std::uint8_t one) { return one != 0; });
  return py::make_tuple(stepped, lost);
}

}  // namespace

void add_maps(py::module_& module) {
  module.def("describe_walker", [](const py::dict& fields) { return walker_setting_of(Arguments(fields)).describe(); });
  module.def("study_walkers", study_walkers);
  module.def("step_walkers", step_walkers);
  module.def("check_map", [](const py::dict& fields) {
    Call call{py::none()};
    batch_of(map_of(fields), call);
  });
  module.def("study_map", study_map);
  module.def("simulate_map", simulate_map);
  module.def("simulate_walks", simulate_walks);
}

}  // namespace metastable::reports::python
