#include "analysis/walker_model/walk_folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <span>
#include <stdexcept>

#include "analysis/experiment/csv_reader.h"
#include "analysis/experiment/experiment_folder.h"
#include "analysis/experiment/experiment_toml.h"
#include "analysis/experiment/suggestion.h"
#include "analysis/machine_model/machine_transitions.h"
#include "analysis/statistics/random.h"
#include "analysis/walkers/walker_study.h"
#include "dynamics/catalogue/walker_effects.h"
#include "dynamics/numerics/truncated_normal.h"
#include "dynamics/walkers/gait.h"
#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

constexpr double angle_error = 0.0005, compass_rate_error = 0.005, simplest_rate_error = 0.001;
constexpr double unknown_launch = 0.3;  // sd of a first value that is not measured, in those of the gait
constexpr std::int64_t most_steps = 1'000'000'000;
constexpr std::string_view phase_remedy = "write 1 where leg 1 stands and 2 where leg 2 does";
constexpr dynamics::Range angles{.low = 0, .high = 1.5707963267948966, .low_open = true, .high_open = true};
constexpr dynamics::Range rates{.low = -30, .high = 30};  // [rad/s]: ten times what gaits have; degrees are beyond

std::string file_in(const ExperimentSource& source, const char* name) {
  return (std::filesystem::path(source.folder) / name).string();
}

// Refuses a folder that states no walker, or an unknown one, by that line alone. The walker says which states are
// measured, so that its other defects may only seem to be some.
void require_walker(const WalkDescription& told) {
  if (!told.no_walker.empty())
    throw InputError({told.no_walker +
                      "; write model = \"compass\" or model = \"simplest\" below [machine], and bring walks of a "
                      "simulator of your own from Python, as metastable.machine() and metastable.runs()"});
}

// Reads steps.csv, and trials.csv, of walks.
class WalkReader {
 public:
  WalkReader(const ExperimentSource& source, const Machine& machine, MachineRuns& runs, Defects& defects)
      : source_(source), machine_(machine), runs_(runs), defects_(defects) {}

  void read() {
    runs_.conditions.clear();
    const std::string file = file_in(source_, "steps.csv");
    if (!source_.steps_csv) return defects_.add(file, {}, "there is no such file; walks need it");
    std::vector<CsvColumn> columns{{"condition"}, {"trial", true}, {"step", true}, {"phase", false, phase_remedy},
                                   {"time_s"},    {"position_m"}};
    for (const MachineSensor& sensor : machine_.observe) columns.push_back({sensor.state});
    CsvReader csv(file, *source_.steps_csv, columns, defects_);
    for (const MachineSensor& sensor : machine_.observe)
      if (!csv.has(state_ + static_cast<std::size_t>(&sensor - machine_.observe.data())))
        defects_.add(file, {1, 1}, fmt::format("there is no column {}, which experiment.toml states", sensor.state));
    if (csv.has(phase_)) runs_.phases = {"1", "2"};
    while (csv.next()) read_row(csv);
    if (runs_.trials.empty() && defects_.empty()) defects_.add(file, {}, "holds no step");
    if (source_.trials_csv) read_outcomes();
  }

 private:
  enum Columns : std::size_t { condition_, trial_, step_, phase_, time_, position_, state_ };
  using Key = std::pair<std::string, std::int64_t>;

  static std::string condition_of(const CsvReader& csv) {
    return csv.text(condition_).empty() ? "all" : std::string(csv.text(condition_));
  }

  void read_row(CsvReader& csv) {
    std::optional<std::int64_t> trial, step, phase;
    std::optional<double> time, position;
    const bool counted = csv.read(trial_, 1, most_steps, trial) && csv.read(step_, 1, most_steps, step);
    csv.read(phase_, 1, 2, phase);
    csv.read(time_, dynamics::range::time, time);
    csv.read(position_, dynamics::range::position, position);
    MachineRow row;
    for (std::size_t j = 0; j < machine_.observe.size(); ++j) {
      std::optional<double> value;
      csv.read(state_ + j, machine_.observe[j].state == "half_angle_rad" ? angles : rates, value);
      row.seen.push_back(value.value_or(std::nan("")));
    }
    if (!counted) return;
    row.time = time.value_or(std::nan(""));
    row.position = position.value_or(std::nan(""));
    row.phase = phase ? static_cast<int>(*phase) - 1 : -1;
    if (!machine_.inputs.empty()) {
      if (csv.text(phase_).empty())
        csv.refuse(phase_, "is missing: which leg stands, 1 or 2, is given in every row or in none");
      row.inputs = {static_cast<double>(phase.value_or(1))};
    }
    place(csv, {condition_of(csv), *trial}, *step, std::move(row));
  }

  void place(CsvReader& csv, Key key, std::int64_t step, MachineRow row) {
    if (runs_.trials.empty() || key != last_) {
      if (!trials_.emplace(key, runs_.trials.size()).second)
        return csv.refuse(trial_, fmt::format("the rows of trial {} do not stand together", key.second));
      auto at = std::ranges::find(runs_.conditions, key.first);
      if (at == runs_.conditions.end()) at = runs_.conditions.insert(at, key.first);
      runs_.trials.push_back(
          {static_cast<std::size_t>(at - runs_.conditions.begin()), {}, {}, fmt::format("{}", key.second)});
      last_ = key;
    }
    std::vector<MachineRow>& rows = runs_.trials.back().rows;
    if (step != static_cast<std::int64_t>(rows.size()) + 1)
      return csv.refuse(step_, fmt::format("{} is not due: step {} of trial {} is", step, rows.size() + 1, key.second));
    if (!rows.empty() && row.time <= rows.back().time)
      return csv.refuse(time_, fmt::format("{} does not come after {} of the step before", row.time, rows.back().time));
    rows.push_back(std::move(row));
  }

  void read_outcomes() {
    constexpr CsvColumn columns[] = {{"condition"}, {"trial", true}, {"outcome", true}};
    CsvReader csv(file_in(source_, "trials.csv"), *source_.trials_csv, columns, defects_);
    while (csv.next()) {
      std::optional<std::int64_t> trial;
      if (!csv.read(1, 1, most_steps, trial)) continue;
      const auto at = trials_.find({condition_of(csv), *trial});
      if (at == trials_.end()) {
        csv.refuse(1, fmt::format("steps.csv has no trial {}", *trial));
        continue;
      }
      const std::string_view told = csv.text(2);
      std::optional<MachineOutcome>& outcome = runs_.trials[at->second].outcome;
      if (outcome) {
        csv.refuse(1, fmt::format("trial {} was there before", *trial));
        continue;
      }
      if (told == "failed")
        outcome = MachineOutcome::failed;
      else if (told == "stopped")
        outcome = MachineOutcome::stopped;
      else if (told == "lost")
        outcome = MachineOutcome::lost;
      else
        csv.refuse(2, fmt::format("{} is none of failed, stopped, lost", shown_text(told)));
    }
  }

  const ExperimentSource& source_;
  const Machine& machine_;
  MachineRuns& runs_;
  Defects& defects_;
  std::map<Key, std::size_t> trials_;
  Key last_;
};

// Draws one walk: its rows behind the trial's number.
class WalkDrawer {
 public:
  WalkDrawer(const Machine& machine, std::vector<double> values, const WalkOptions& options, double rate_error)
      : machine_(machine), values_(std::move(values)), options_(options), rate_error_(rate_error) {}

  // Returns whether it fell.
  bool draw(std::size_t trial, std::vector<double> state, std::string& rows) const {
    std::vector<double> next(state.size()), values = values_;
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
  double normal(std::size_t trial, std::uint64_t step, std::size_t purpose) const {
    return dynamics::normal_quantile(
        uniform_at(options_.seed, trial, 4 * step + purpose, static_cast<std::uint64_t>(DrawStream::machine)));
  }

  const Machine& machine_;
  std::vector<double> values_;
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
  if (told) require_walker(*told);
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
  // A value that a trial's first row lacks is around the gait's.
  const dynamics::TwoLinkWalker walker = statement.setting.map().walker();
  const std::vector<double> gait =
      gait_state(statement.setting, dynamics::find_gait(walker, statement.setting.slope_deg * degree));
  for (std::size_t s = 0; s < machine->states.size(); ++s)
    machine->launches.push_back({machine->states[s], gait[s], unknown_launch * std::abs(gait[s]), true});
  Walks walks{told->title, {}, {}};
  WalkReader(source, *machine, walks.runs, defects).read();
  defects.check();
  walks.machine = std::move(machine);
  return walks;
}

Diagnosis diagnose_walks(const Walks& walks, const DiagnosisOptions& options) {
  if (!options.elsewhere.empty()) throw std::invalid_argument("--at-slope, --at-speed: have no meaning with walks");
  std::shared_ptr<const TransitionModel> model = machine_transitions(walks.machine, walks.runs);
  require_effects(options.catalogue, model->effect_ids());
  return diagnose(std::move(model), options);
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
  const std::vector<MachineEffect> effects = walker_machine(drawn_walker(setting)).effects;
  std::vector<std::string> known;
  for (const MachineEffect& effect : effects) known.push_back(effect.id);
  std::vector<std::pair<std::string, double>> values;
  for (const std::string& text : texts) {
    const std::string id = text.substr(0, text.find(':'));
    require_word("--effect", id, known);
    const MachineEffect& effect = *std::ranges::find(effects, id, &MachineEffect::id);
    const dynamics::Effect read = dynamics::effect_from_text(text, {}, info_of(setting.walker, effect));
    for (std::size_t p = 0; p < effect.parameters.size(); ++p)
      values.emplace_back(id + "." + effect.parameters[p].name, read.values[p]);
  }
  return values;
}

WalkFiles draw_walks(const WalkerSetting& setting, const std::vector<std::pair<std::string, double>>& effects,
                     const WalkOptions& options, const std::string& title) {
  const WalkerStatement statement = drawn_walker(setting);
  const Machine machine = walker_machine(statement);
  const double rate_error = statement.legs ? compass_rate_error : simplest_rate_error;
  const std::vector<double> start =
      gait_state(setting, dynamics::find_gait(setting.map().walker(), setting.slope_deg * degree));
  WalkStatement told{title, statement, {}};
  WalkFiles files;
  files.steps_csv = "trial,step,phase";
  for (const std::string& state : machine.states) {
    files.steps_csv += "," + state;
    told.columns.emplace_back(state, state == "half_angle_rad" ? angle_error : rate_error);
  }
  files.experiment_toml = walk_toml(told);
  files.steps_csv += "\n";
  files.trials_csv = "trial,outcome\n";
  const WalkDrawer drawer(machine, values_with(machine, effects), options, rate_error);
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
