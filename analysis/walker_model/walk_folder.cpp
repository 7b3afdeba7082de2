#include "analysis/walker_model/walk_folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <stdexcept>

#include "analysis/experiment/csv_reader.h"
#include "analysis/experiment/experiment_folder.h"
#include "analysis/experiment/experiment_toml.h"
#include "analysis/experiment/suggestion.h"
#include "analysis/machine_model/machine_transitions.h"
#include "analysis/machine_model/score_lattice.h"
#include "analysis/statistics/random.h"
#include "analysis/walker_model/leg_turns.h"
#include "analysis/walker_model/step_least_squares.h"
#include "analysis/walker_model/steps_reader.h"
#include "analysis/walkers/walker_study.h"
#include "dynamics/catalogue/walker_effects.h"
#include "dynamics/numerics/truncated_normal.h"
#include "dynamics/walkers/gait.h"
#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

constexpr double angle_error = 0.0005, compass_rate_error = 0.005, simplest_rate_error = 0.001;
constexpr double unknown_launch = 0.3;  // sd of a first value that is not stated, in those of the gait
constexpr std::string_view offset_of_launch = "launch_", spread_of_launch = "launch_spread_";  // a state follows
constexpr double least_half_angle = 0.01;  // [rad] of a launch that scatters

std::string file_in(const ExperimentSource& source, const char* name) {
  return (std::filesystem::path(source.folder) / name).string();
}

// Refuses a folder that states no walker, or an unknown one, by that line alone. The walker says which states are
// measured, so that its other defects may only seem to be some.
void require_walker(const WalkDescription& told, const std::string& folder) {
  if (told.walker == own_machine)
    throw InputError(
        {fmt::format("{}: read it from Python, metastable.diagnose(metastable.runs(machine, \"{}\"), machine)",
                     told.no_walker, folder)});
  if (!told.no_walker.empty())
    throw InputError({told.no_walker +
                      "; write model = \"compass\" or model = \"simplest\" below [machine], and bring walks of a "
                      "simulator of your own from Python, as metastable.machine() and metastable.runs()"});
}

// Returns the state just after a strike in the gait of the stated walker.
std::vector<double> gait_of(const WalkerSetting& setting) {
  return gait_state(setting, dynamics::find_gait(setting.map().walker(), setting.slope_deg * degree));
}

// Builds the model of the walks by `make`. Where the stated walker fails from most rows, it says what to check of the
// columns: score_plan() knows the machine, but not what its columns mean.
std::unique_ptr<TransitionModel> transitions_of(const Walks& walks, decltype(machine_transitions)& make) {
  try {
    return make(walks.machine, walks.runs);
  } catch (const FailsFromMostRows& error) {
    const Machine& machine = *walks.machine;
    const std::vector<double> gait = gait_of({walker_from_name(machine.name), machine.parameters[0].nominal,
                                              machine.parameters[1].nominal, dynamics::Terrain::fresh});
    std::string there;
    for (std::size_t s = 0; s < gait.size(); ++s)
      there += fmt::format("{}{} is {:.3g}", s == 0 ? "" : ", ", machine.states[s], gait[s]);
    throw std::invalid_argument(
        fmt::format("{}: in the gait of this model {}; check that angles are in radians, that half_angle_rad is half "
                    "the angle between the legs, and the signs of the rates",
                    error.what(), there));
  }
}

// Says of walks what OwnDrawsDiffer says of a step that its user wrote.
std::string own_draws_differ(const Walks& walks, const OwnDrawsDiffer& error) {
  std::size_t fell = 0, steps = 0;
  for (const MachineTrial& trial : walks.runs.trials) {
    fell += trial.outcome == MachineOutcome::failed;
    steps += steps_of(trial);
  }
  const std::string often =
      fell > 0 ? fmt::format(" ({} of {} walks fell, one fall in {:.0f} steps)", fell, walks.runs.trials.size(),
                             static_cast<double>(steps) / static_cast<double>(fell))
               : "";
  return fmt::format(
      "these walks cannot be diagnosed: on ground whose slope has an sd of {:.3g} deg{} the steps that the model "
      "walker takes are not spread as the likelihood takes them (distribution functions differ by {:.2g}, {:.2g} is "
      "allowed). Effects would be named that are not there: bring walks on more even ground",
      walks.machine->parameters[1].nominal, often, error.apart, error.allowed);
}

// How walks that are drawn begin beside the gait, by state.
struct DrawnLaunch {
  std::vector<double> offset, scatter;
};

// Draws one walk: its rows behind the trial's number.
class WalkDrawer {
 public:
  WalkDrawer(const Machine& machine, std::vector<double> values, DrawnLaunch launch, const WalkOptions& options,
             double rate_error)
      : machine_(machine),
        values_(std::move(values)),
        launch_(std::move(launch)),
        options_(options),
        rate_error_(rate_error) {}

  // Returns whether it fell. @param state  where walks begin without an effect of the launch
  bool draw(std::size_t trial, std::vector<double> state, std::string& rows) const {
    std::vector<double> next(state.size()), values = values_;
    for (std::size_t s = 0; s < state.size(); ++s)
      state[s] += launch_.offset[s] + launch_.scatter[s] * normal(trial, before_all, s);
    state[0] = std::max(least_half_angle, state[0]);
    std::uint64_t leg = trial % 2;
    for (std::uint64_t step = 0;; ++step, leg = 1 - leg) {
      rows += fmt::format("{},{},{}", trial + 1, step + 1, leg + 1);
      for (std::size_t s = 0; s < state.size(); ++s)
        rows += fmt::format(",{:.9g}", state[s] + (s == 0 ? angle_error : rate_error_) * normal(trial, step, s + 1));
      rows += "\n";
      if (step + 1 >= options_.longest) return false;
      if (!machine_.inputs.empty()) values.back() = static_cast<double>(leg + 1);
      const double score = normal(trial, step, 0);
      std::uint8_t fell = 0;
      std::vector<std::span<const double>> spans;
      for (const double& value : values) spans.emplace_back(&value, 1);
      machine_.step({1, state, {&score, 1}, spans, next, {&fell, 1}});
      if (fell) return true;
      state.swap(next);
    }
  }

 private:
  static constexpr std::uint64_t before_all = std::uint64_t{1} << 40;  // a step that no walk takes

  double normal(std::size_t trial, std::uint64_t step, std::size_t purpose) const {
    return dynamics::normal_quantile(
        uniform_at(options_.seed, trial, 4 * step + purpose, static_cast<std::uint64_t>(DrawStream::machine)));
  }

  const Machine& machine_;
  std::vector<double> values_;
  DrawnLaunch launch_;
  const WalkOptions& options_;
  double rate_error_;
};

// Returns the walker that is drawn.
WalkerStatement drawn_walker(const WalkerSetting& setting) {
  WalkerStatement statement;
  statement.setting = setting;
  statement.legs = setting.walker == Walker::compass;
  return statement;
}

// Returns what the catalogue tells of an effect, with this walker's bounds and units.
dynamics::EffectInfo info_of(Walker walker, const MachineEffect& effect) {
  dynamics::EffectInfo info = dynamics::walker_effect_info(effect.id);
  for (std::size_t p = 0; p < effect.parameters.size(); ++p) {
    info.parameters[p].lower = effect.parameters[p].lower;
    info.parameters[p].upper = effect.parameters[p].upper;
    if (walker == Walker::simplest) info.parameters[p].unit.clear();  // it has units of its own
  }
  return info;
}

// Lists the effects of the launch that a machine's walks may have.
std::vector<dynamics::EffectInfo> launch_effects(const Machine& machine) {
  std::vector<dynamics::EffectInfo> all;
  for (const std::string_view what : {offset_of_launch, spread_of_launch})
    for (const std::string& state : machine.states)
      all.push_back(dynamics::walker_effect_info(std::string(what) + state));
  return all;
}

// Takes what changes the launch out of the effects, and returns it.
DrawnLaunch take_launch(const Machine& machine, std::vector<std::pair<std::string, double>>& effects) {
  const std::size_t states = machine.states.size();
  DrawnLaunch launch{std::vector<double>(states), std::vector<double>(states)};
  std::vector<std::pair<std::string, double>> others;
  const std::vector<dynamics::EffectInfo> infos = launch_effects(machine);
  for (const auto& [name, value] : effects) {
    const auto info = std::ranges::find_if(
        infos, [&](const dynamics::EffectInfo& one) { return name == one.id + "." + one.parameters.front().name; });
    if (info == infos.end()) {
      others.emplace_back(name, value);
      continue;
    }
    const dynamics::EffectParameter& of = info->parameters.front();
    if (!(value >= of.lower && value <= of.upper))
      throw std::invalid_argument(fmt::format("--effect: {}: {} is outside [{}, {}]", name, value, of.lower, of.upper));
    const auto at = static_cast<std::size_t>(info - infos.begin());
    (at < states ? launch.offset : launch.scatter)[at % states] = value;
  }
  effects = std::move(others);
  return launch;
}

// Returns the machine's values with those of the effects.
std::vector<double> values_with(const Machine& machine, const std::vector<std::pair<std::string, double>>& effects) {
  std::vector<double> values;
  std::vector<std::string> known;
  for (const MachineParameter& parameter : machine.parameters) values.push_back(parameter.nominal);
  const std::size_t first = values.size();
  std::vector<const SuspectedParameter*> of;
  for (const MachineEffect& effect : machine.effects)
    for (const SuspectedParameter& parameter : effect.parameters) {
      values.push_back(parameter.neutral);
      known.push_back(effect.id + "." + parameter.name);
      of.push_back(&parameter);
    }
  for (const auto& [name, value] : effects) {
    require_word("--effect", name, known);
    const auto at = static_cast<std::size_t>(std::ranges::find(known, name) - known.begin());
    if (values[first + at] != of[at]->neutral)
      throw std::invalid_argument(fmt::format("--effect: {} is given twice", name));
    if (!(value >= of[at]->lower && value <= of[at]->upper))
      throw std::invalid_argument(
          fmt::format("--effect: {}: {} is outside [{}, {}]", name, value, of[at]->lower, of[at]->upper));
    values[first + at] = value;
  }
  values.resize(values.size() + machine.inputs.size());
  return values;
}

}  // namespace

bool states_walks(const std::string& experiment_toml) {
  Defects defects;
  return parse_walk_toml("", experiment_toml, defects).has_value();
}

bool holds_walks(const std::filesystem::path& folder) {
  try {
    return states_walks(read_source(folder).experiment_toml);
  } catch (const InputError&) {
    return false;
  }
}

std::optional<Walks> read_walks(const std::filesystem::path& folder) { return parse_walks(read_source(folder)); }

std::optional<Walks> parse_walks(const ExperimentSource& source) {
  Defects defects;
  const auto told = parse_walk_toml(file_in(source, "experiment.toml"), source.experiment_toml, defects);
  if (!told && !(source.steps_csv && !source.collisions_csv)) return std::nullopt;
  if (told && source.collisions_csv)
    throw InputError({file_in(source, "collisions.csv") +
                      ": collisions are a wheel's, but experiment.toml states walks, whose rows are in steps.csv: give "
                      "each machine a folder of its own"});
  if (told) require_walker(*told, source.folder);
  defects.check();
  if (!told) return std::nullopt;
  WalkerStatement statement;
  statement.setting = {walker_from_name(told->walker), told->slope_deg.mean, told->slope_sd_deg.mean,
                       dynamics::Terrain::fresh};
  statement.slope_known_deg = told->slope_deg.sd;
  statement.roughness_known_deg = told->slope_sd_deg.sd;
  const std::vector<std::string> names =
      source.steps_csv ? CsvReader::names(*source.steps_csv, {}) : std::vector<std::string>{};
  statement.legs = std::ranges::find(names, "phase") != names.end();
  auto machine = std::make_shared<Machine>(walker_machine(statement));
  for (const WalkDescription::Column& column : told->columns)
    machine->observe.push_back({column.state, column.sd, column.correlation});
  // Without a launch that is stated, a value that a trial's first row lacks is around the gait's.
  const std::vector<double> gait = gait_of(statement.setting);
  for (std::size_t s = 0; s < machine->states.size(); ++s) {
    const auto stated = std::ranges::find(told->launches, machine->states[s], &std::pair<std::string, Spread>::first);
    if (stated != told->launches.end())
      machine->launches.push_back({machine->states[s], stated->second.mean, stated->second.sd, false});
    else
      machine->launches.push_back({machine->states[s], gait[s], unknown_launch * std::abs(gait[s]), true});
  }
  Walks walks{told->title, {}, {}};
  StepColumns columns;
  for (const MachineSensor& sensor : machine->observe)
    columns.states.emplace_back(sensor.state, walk_column_range(sensor.state));
  columns.labels = told->labels;
  columns.legs = true;
  columns.leg_is_input = !machine->inputs.empty();
  read_steps(source, columns, walks.runs, defects);
  defects.check();
  walks.machine = std::move(machine);
  return walks;
}

std::vector<std::string> notes_on_walks(const Walks& walks) {
  std::vector<std::string> notes;
  try {
    notes = transitions_of(walks, machine_as_stated)->notes();
  } catch (const std::invalid_argument& error) {
    notes.push_back(fmt::format("`diagnose` will refuse these walks: {}", error.what()));
  }
  for (std::string& question : questions_on_leg_turns(*walks.machine, walks.runs)) notes.push_back(std::move(question));
  return notes;
}

Diagnosis diagnose_walks(const Walks& walks, const DiagnosisOptions& options) {
  if (!options.elsewhere.empty()) throw std::invalid_argument("--at-slope, --at-speed: have no meaning with walks");
  std::shared_ptr<const TransitionModel> model = transitions_of(walks, machine_transitions);
  require_effects(options.catalogue, model->effect_ids());
  Diagnosis answer = [&] {
    try {
      return diagnose(std::move(model), options);
    } catch (const OwnDrawsDiffer& error) {
      throw std::runtime_error(own_draws_differ(walks, error));
    }
  }();
  for (StepwiseChoice& choice : least_squares_selection(*walks.machine, walks.runs, options.catalogue))
    answer.causes.stepwise.push_back(std::move(choice));
  for (const std::string& question : questions_on_leg_turns(*walks.machine, walks.runs)) ask_first(answer, question);
  return answer;
}

ExperimentSource source_of(const WalkFiles& files, const std::string& name) {
  ExperimentSource source{name, files.experiment_toml, {}, {}, {}};
  source.steps_csv = files.steps_csv;
  if (!files.trials_csv.empty()) source.trials_csv = files.trials_csv;
  return source;
}

std::string walk_toml(const WalkStatement& statement) {
  const WalkerSetting& setting = statement.walker.setting;
  std::string text;
  for (const std::string& line : statement.comment) text += "# " + line + "\n";
  text += fmt::format(
      "title = {}\nsystem = \"machine\"\n\n[machine]\nmodel = \"{}\"\n\n[machine.parameters]   # nominal value, and "
      "the "
      "sd with which it is known\nslope_deg = {{ mean = {}, sd = {} }}\nslope_sd_deg = {{ mean = {}, sd = {} }}\n\n"
      "[columns]              # sd of the error of a measured value\n",
      toml_text(statement.title), walker_name(setting.walker), setting.slope_deg, statement.walker.slope_known_deg,
      setting.slope_sd_deg, statement.walker.roughness_known_deg.value_or(setting.slope_sd_deg));
  for (const auto& [state, sd] : statement.columns)
    text += sd ? fmt::format("{} = {{ sd = {} }}\n", state, *sd) : fmt::format("{} = {{}}\n", state);
  if (statement.launches.empty()) return text;
  text += "\n[launch]               # where trials begin, and the sd by which they scatter there\n";
  for (const auto& [state, launch] : statement.launches)
    text += fmt::format("{} = {{ mean = {:.9g}, sd = {:.6g} }}\n", state, launch.mean, launch.sd);
  return text;
}

std::vector<dynamics::EffectInfo> effects_known_to(Walker walker) {
  WalkerSetting setting;
  setting.walker = walker;
  setting.slope_deg = walker_slope_deg(walker);
  const Machine machine = walker_machine(drawn_walker(setting)),
                compass = walker_machine(drawn_walker(WalkerSetting()));
  const auto has = [](const Machine& one, const std::string& id) {
    return std::ranges::find(one.effects, id, &MachineEffect::id) != one.effects.end();
  };
  const auto of_another_state = [&](const std::string& id) {
    return std::ranges::any_of(compass.states, [&](const std::string& state) {
      return id.ends_with(state) && std::ranges::find(machine.states, state) == machine.states.end();
    });
  };
  std::vector<dynamics::EffectInfo> all;
  for (const dynamics::EffectInfo& info : dynamics::walker_effects()) {
    if (of_another_state(info.id)) continue;
    if (has(machine, info.id))
      all.push_back(info_of(setting.walker, *std::ranges::find(machine.effects, info.id, &MachineEffect::id)));
    else if (!has(compass, info.id))
      all.push_back(info);  // any machine may have it
  }
  return all;
}

std::vector<std::pair<std::string, double>> effects_of_walks(WalkerSetting setting,
                                                             const std::vector<std::string>& texts) {
  setting.terrain = dynamics::Terrain::fresh;
  const Machine machine = walker_machine(drawn_walker(setting));
  std::vector<dynamics::EffectInfo> infos;
  for (const MachineEffect& effect : machine.effects) infos.push_back(info_of(setting.walker, effect));
  for (dynamics::EffectInfo& info : launch_effects(machine)) infos.push_back(std::move(info));
  std::vector<std::string> known;
  for (const dynamics::EffectInfo& info : infos) known.push_back(info.id);
  std::vector<std::pair<std::string, double>> values;
  for (const std::string& text : texts) {
    const std::string id = text.substr(0, text.find(':'));
    require_word("--effect", id, known);
    const dynamics::EffectInfo& info = *std::ranges::find(infos, id, &dynamics::EffectInfo::id);
    const dynamics::Effect read = dynamics::effect_from_text(text, {}, info);
    for (std::size_t p = 0; p < info.parameters.size(); ++p)
      values.emplace_back(id + "." + info.parameters[p].name, read.values[p]);
  }
  return values;
}

WalkFiles draw_walks(const WalkerSetting& setting, std::vector<std::pair<std::string, double>> effects,
                     const WalkOptions& options, const std::string& title) {
  const WalkerStatement statement = drawn_walker(setting);
  const Machine machine = walker_machine(statement);
  const double rate_error = statement.legs ? compass_rate_error : simplest_rate_error;
  const std::vector<double> start = gait_of(setting);
  WalkStatement told{title, statement, {}};
  WalkFiles files;
  files.steps_csv = "trial,step,phase";
  for (const std::string& state : machine.states) {
    files.steps_csv += "," + state;
    told.columns.emplace_back(state, state == "half_angle_rad" ? angle_error : rate_error);
    told.launches.emplace_back(state, Spread{start[told.launches.size()], 0});
  }
  files.experiment_toml = walk_toml(told);
  files.steps_csv += "\n";
  files.trials_csv = "trial,outcome\n";
  DrawnLaunch launch = take_launch(machine, effects);
  const WalkDrawer drawer(machine, values_with(machine, effects), std::move(launch), options, rate_error);
  std::vector<std::string> rows(options.trials);
  std::vector<std::uint8_t> fell(options.trials);
  markov::parallel_for(
      options.trials, options.threads, [&](std::size_t trial) { fell[trial] = drawer.draw(trial, start, rows[trial]); },
      options.progress);
  for (std::size_t trial = 0; trial < options.trials; ++trial) {
    files.steps_csv += rows[trial];
    files.fallen += fell[trial];
    files.trials_csv += fmt::format("{},{}\n", trial + 1, fell[trial] ? "failed" : "stopped");
  }
  return files;
}

}  // namespace metastable::analysis
