#include <fmt/format.h>

#include <filesystem>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "analysis/experiment/experiment_folder.h"
#include "analysis/experiment/stand_in.h"
#include "analysis/experiment/suggestion.h"
#include "analysis/walker_model/walk_folder.h"
#include "analysis/wheel_model/wheel_transitions.h"
#include "dynamics/catalogue/walker_effects.h"
#include "dynamics/wheel/contact_law.h"
#include "reports/command_line/command.h"
#include "reports/command_line/option_values.h"
#include "reports/command_line/requests.h"
#include "reports/command_line/setting_options.h"
#include "reports/command_line/walker_options.h"
#include "reports/experiment_commands/coast_down_command.h"
#include "reports/experiment_commands/collisions_command.h"
#include "reports/experiment_commands/describe_command.h"
#include "reports/experiment_commands/diagnose_command.h"
#include "reports/experiment_commands/effects_command.h"
#include "reports/experiment_commands/lessons_command.h"
#include "reports/experiment_commands/simulate_command.h"
#include "reports/experiment_commands/study_command.h"

namespace metastable::reports {
namespace {

// Its conditions come with slope, launch and number of trials; the rest can be chosen.
analysis::Setting stand_in_base(const Options& o, const Pairs& pairs) {
  for (const char* name : {"slope", "initial-speed", "trials", "collisions"})
    if (o.given(name)) throw std::invalid_argument(fmt::format("--{}: is fixed by --stand-in", name));
  analysis::Setting setting = common_setting(o, pairs);
  const analysis::Setting chosen = analysis::stand_in_setting();
  if (!o.given("restitution")) setting.restitution = chosen.restitution;
  if (!o.given("friction")) setting.friction = chosen.friction;
  return setting;
}

void add_laboratory_options(Options& o) {
  o.group("The virtual laboratory (--reality)");
  o.add_flag("reality", "In the virtual laboratory: motion in continuous time, sharing no formula with the model");
  o.add(
      "effect", "ID:NAME=VALUE,...", "",
      "With --reality or --walker, repeatable: an effect the model lacks, e.g. leg_contact:leg=3,friction_ratio=1.4 or "
      "hip_damping:damping=0.3");
  o.add("outside", "ID:SIZE", "",
        "With --reality, repeatable: an effect outside the catalogue (sloshing_fluid, planks, frame_resonance, "
        "stored_energy, speed_spread, double_plate, warming_feet, two_crews, loose_feet, second_memory, crosswind, "
        "wet_day, daily_cycle, hysteresis, wearing_leg, rough_stretch, sticky_start, swaying_floor; with --walker "
        "round_feet, hip_spring, slow_motor, swinging_load, swaying_ramp, loose_knee)");
  o.add("skewness", "G", "0", "With --reality: skewness of restitution, (-2, 2)");
  o.add("sensor-noise", "SD", "0", "With --reality: white noise of every reported speed [rad/s]",
        dynamics::range::speed);
  o.add("smoothing", "S", "0", "With --reality: reported speeds are means over this time, 0..0.1 [s]");
  o.add("drop", "NAME,...", "",
        "With --reality: columns and statements left out (leg, time_s, position_m, omega_plus_rad_s, outcome, "
        "initial_speed_rad_s, noise; with --walker phase, time_s, position_m, outcome)");
  o.add_flag("no-flight", "With --reality: feet that should lift stay on the ramp");
  o.add_flag("shuffle", "With --reality: conditions take turns at random");
}

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, separator);) parts.push_back(part);
  return parts;
}

Command simulate() {
  return {
      "simulate",
      "Trials as an experiment folder (experiment.toml, collisions.csv, trials.csv)",
      declare_simulate,
      [](const Options& o, const std::string& line) {
        if (o.text("out").empty()) throw std::invalid_argument("--out: a folder must be given");
        if (asks_for_walker(o)) return run_walker_simulate(walker_simulate_request(o, line));
        const SimulateRequest request = simulate_request(o, line);
        if (o.flag("reality"))
          simulate_in_laboratory(laboratory_request(o, request));
        else
          run_simulate(request);
      },
      "",
      {"metastable simulate --slope 9.59 --law settled --trials 40 --out trials",
       "metastable simulate --stand-in --out stand-in",
       "metastable simulate --reality --slope 9.59 --out wheel \\\n    --effect leg_contact:leg=3,friction_ratio=1.4"}};
}

Command coast_down() {
  return {
      "coast-down", "Logs of a drum's revolution counter to an experiment folder (system = \"coast_down\")",
      [](Options& o) {
        o.add_places("LOG",
                     "Files without header: time [us], drum speed [km/h], drum revolutions, wheel speed, wheel "
                     "revolutions; each becomes a condition");
        o.add("stop", "RAD/S", "5", "Speed at which a run ends, above 0");
        o.add("block", "N", "50", "Revolutions of a block, which serves as a trial, 10..100000");
        o.add("blocks", "all|odd|even", "all", "Which blocks: one half to fit a nominal loss, the other to check it");
        o.add("nominal", "DIR", "", "Take the nominal loss of this experiment folder (default: fitted to the logs)");
        o.add_flag("linear", "Fit a loss proportional to omega even where it is within five standard errors of none");
        o.add("rotor-inertia", "KGM2", "", "Of the drum [kg m^2]: turns losses into torques",
              dynamics::range::rotor_inertia);
        o.add_flag("accept-defects",
                   "Take a log of which more than a tenth of the revolutions is left out, a loss that is not positive "
                   "over its speeds, or a top speed beyond 3000 rad/s: every verdict will repeat it");
        o.add("out", "DIR", "", "Folder to create (must not hold an experiment yet)");
        o.add_json();
      },
      [](const Options& o, const std::string& line) {
        CoastDownRequest request;
        request.json = o.text("json");
        request.accept_defects = o.flag("accept-defects");
        request.logs = o.all("LOG");
        request.options.stop = o.number("stop");
        request.options.block = o.count("block", 10, 100000);
        request.options.validate();
        request.blocks = o.text("blocks");
        request.nominal = o.text("nominal");
        request.linear = o.flag("linear");
        if (request.linear && !request.nominal.empty())
          throw std::invalid_argument("--linear: nothing is fitted with --nominal");
        if (o.given("rotor-inertia")) request.rotor_inertia = o.number("rotor-inertia");
        request.out = o.text("out");
        if (request.out.empty()) throw std::invalid_argument("--out: a folder must be given");
        request.command = line;
        run_coast_down(request);
      }};
}

Command collisions() {
  return {
      "collisions",
      "Collisions from the wheel's angle over time: angle.csv of an experiment folder to collisions.csv",
      [](Options& o) {
        o.add_place("DIR", "Experiment folder with experiment.toml and angle.csv");
        o.add("window", "N", "",
              "Savitzky-Golay window [samples], odd, 5..10001 (default: 50 ms, at least 5 samples, more where noise "
              "asks it)");
        o.add("collisions", "N", "16", "Most collisions of a trial, 1..100000");
        o.add("rise", "RAD/S", "0.4", "Least rise of a peak of the speed above both sides, > 0");
        o.add("omega-minus", "fit|peak", "fit",
              "Stance motion extrapolated to the collision, or the smoothed speed's peak");
        o.add("fit-span", "S", "0.08", "Stance motion is fitted to this much time on either side of a collision, > 0");
        o.add_threads();
        o.add("out", "FILE|-", "", "Default: DIR/collisions.csv, or DIR/collisions-from-angle.csv if that is there");
        o.add_json();
      },
      [](const Options& o, const std::string& line) {
        CollisionsRequest request;
        request.json = o.text("json");
        request.command = line;
        request.folder = o.text("DIR");
        if (o.given("window")) request.finder.window = o.count("window", 5, 10001);
        request.finder.collisions = o.count("collisions", 1, 100000);
        request.finder.rise = o.number("rise");
        request.finder.fit_span = o.number("fit-span");
        request.finder.validate();
        request.peak = o.text("omega-minus") == "peak";
        request.threads = o.threads();
        request.out = o.text("out");
        run_collisions(request);
      },
      "",
      {"metastable simulate --stand-in --out stand-in   # an experiment folder to try",
       "metastable collisions stand-in", "metastable collisions stand-in --omega-minus peak --out -"}};
}

Command describe() {
  return {"describe",
          "What the trials of an experiment folder show: speeds, tests, survival, restitution and friction",
          declare_describe,
          [](const Options& o, const std::string& line) { run_describe(describe_request(o, line)); },
          "",
          {"metastable simulate --stand-in --out stand-in   # an experiment folder to try",
           "metastable describe stand-in", "metastable describe stand-in --out described"}};
}

Command study() {
  return {"study",
          "The paper's study: its simulated figures, its claims one by one and its hypotheses, under each law",
          [](Options& o) {
            o.add("data", "DIR", "", "Experiment folder of its three experiments (default: a simulated stand-in)");
            o.add("trials", "N", "1000", "Trials of each simulated profile, 20..1000000");
            o.add("samples", "N", "8192", "Samples behind the variance shares, 32..1048576");
            o.add_seed();
            o.add_threads();
            o.add("out", "DIR", "study", "Folder for tables, figures and index.html");
            o.add_json();
          },
          [](const Options& o, const std::string& line) {
            StudyRequest request;
            request.json = o.text("json");
            request.data = o.text("data");
            request.out = o.text("out");
            request.options.trials = o.count("trials", 20, 1000000);
            request.options.samples = o.whole("samples", 32, 1048576);
            request.options.seed = o.seed();
            request.options.threads = o.threads();
            request.command = line;
            run_study(request);
          },
          "",
          {"metastable study", "metastable study --data stand-in --out measured"}};
}

// Runs the diagnosis, which knows options by their keys: what it refuses of a key is said of the option.
void diagnose_as_asked(const Options& o, const std::string& line) {
  try {
    run_diagnose(diagnose_request(o, line));
  } catch (const std::invalid_argument& error) {
    const std::string said = error.what();
    for (const char* key : {"catalogue", analysis::other_slope, analysis::other_launch})
      if (said.starts_with(fmt::format("{}: ", key))) throw std::invalid_argument("--" + said);
    throw;
  }
}

Command diagnose() {
  return {
      "diagnose",
      "The gap between an experiment and its nominal model: where it lies, which effect closes it, how far",
      declare_diagnose,
      diagnose_as_asked,
      "",
      {"metastable simulate --reality --slope 9.59 --out wheel \\\n    --effect leg_contact:leg=3,friction_ratio=1.4",
       "metastable diagnose wheel", "metastable diagnose wheel --out diagnosis"}};
}

Command lessons() {
  return {"lessons",
          "Worked examples of the diagnosis: the published law on a coulomb wheel, the paper's hypotheses, data",
          [](Options& o) {
            o.add("data", "DIR", "",
                  "Repeatable: an experiment folder, diagnosed under published, coulomb and its own law");
            o.add_seed();
            o.add_threads();
            o.add("out", "DIR", "lessons", "Folder for tables, figures and index.html");
            o.add_json();
          },
          [](const Options& o, const std::string& line) {
            LessonsRequest request;
            request.json = o.text("json");
            request.data = o.all("data");
            request.out = o.text("out");
            request.options.seed = o.seed();
            request.options.threads = o.threads();
            request.command = line;
            run_lessons(request);
          },
          "",
          {"metastable lessons", "metastable lessons --data stand-in"}};
}

Command effects() {
  return {"effects",
          "The catalogue of effects a model may lack: parameters, units, ranges, meaning",
          [](Options& o) {
            o.add("walker", "simplest|compass", "",
                  "Effects of walks of a walker on two legs, not of the wheel's trials");
            o.add_json();
          },
          [](const Options& o, const std::string&) {
            const EffectsRequest request{o.text("json")};
            if (!o.given("walker")) return run_effects(request);
            analysis::require_word("--walker", o.text("walker"), {"simplest", "compass"});
            run_walker_effects(request, analysis::walker_from_name(o.text("walker")));
          },
          "",
          {"metastable effects", "metastable effects --walker compass"}};
}

}  // namespace

void declare_simulate(Options& o) {
  add_slope(o);
  add_launch(o, "Just before collision 1 [rad/s]");
  add_wheel(o), add_contact(o), add_course(o);
  o.group("Trials");
  o.add_flag("stand-in",
             "The paper's three experiments instead of one setting: 51 fast and 48 slow trials at 9.59 deg, 50 "
             "at 7.02 deg, angle.csv at 120 Hz; eta ~ N(0.54, 0.045^2) and mu ~ N(0.352, 0.043^2) unless given");
  o.add("trials", "N", "50", "Trials, 1..1000000");
  o.add("collisions", "N", "16", "Most collisions of a trial, 1..100000 (walker: strikes, 2..1000000, default 1000)");
  o.add("angle-rate", "HZ", "", "Write angle.csv too, as a camera of this rate sees the trials, 10..100000 (120)");
  o.add("angle-noise", "RAD", "", "White noise of the angle, >= 0 (default 0.0002; needs --angle-rate)");
  add_laboratory_options(o);
  add_walker(o, "DEG", false);
  o.group("Trials");
  o.add_seed();
  o.add_threads();
  o.group("Files and help");
  o.add("out", "DIR", "", "Folder to create (must not hold an experiment yet)");
  o.add_json();
}

SimulateRequest simulate_request(const Options& o, const std::string& line, const Pairs& pairs) {
  const bool stand_in = o.flag("stand-in");
  SimulateRequest request{stand_in ? stand_in_base(o, pairs) : one_setting(o, pairs),
                          o.count("trials", 1, 1000000),
                          o.count("collisions", 1, 100000),
                          o.seed(),
                          o.threads(),
                          o.text("out"),
                          line};
  if (o.given("angle-noise") && !o.given("angle-rate") && !stand_in)
    throw std::invalid_argument("--angle-noise: needs --angle-rate");
  request.stand_in = stand_in;
  request.json = o.text("json");
  const bool reality = o.flag("reality");
  for (const char* name :
       {"effect", "outside", "skewness", "sensor-noise", "smoothing", "drop", "no-flight", "shuffle"})
    if (o.given(name) && !reality) throw std::invalid_argument(fmt::format("--{}: needs --reality", name));
  if (o.given("angle-rate") || (stand_in && !reality)) {
    analysis::CameraOptions& camera = request.camera.emplace();
    if (o.given("angle-rate")) camera.rate = o.number("angle-rate");
    if (stand_in) camera.decimals = 5;  // a twentieth of the noise; keeps the folder small
    if (o.given("angle-noise")) camera.noise_sd_rad = o.number("angle-noise");
    camera.seed = request.seed;
    camera.threads = request.threads;
    camera.validate();
  }
  return request;
}

namespace {

// @throws std::invalid_argument for text that is not of the form ID:SIZE
std::vector<dynamics::OutsideEffect> outside_effects_in(const Options& o) {
  std::vector<dynamics::OutsideEffect> all;
  for (const std::string& text : o.all("outside")) {
    const std::vector<std::string> parts = split(text, ':');
    if (parts.size() != 2) throw std::invalid_argument(fmt::format("--outside: '{}' is not of the form ID:SIZE", text));
    all.push_back({parts[0], number_value("outside", parts[1])});
  }
  return all;
}

analysis::WalkerReality walker_reality(const Options& o) {
  analysis::WalkerReality reality;
  std::vector<std::string> known;
  for (const dynamics::EffectInfo& info : dynamics::walker_effects()) known.push_back(info.id);
  for (const std::string& text : o.all("effect")) {
    analysis::require_word("--effect", text.substr(0, text.find(':')), known);
    reality.effects.push_back(dynamics::effect_from_text(text, {}, dynamics::walker_effect_info));
  }
  reality.outside = outside_effects_in(o);
  if (o.given("drop")) reality.left_out = split(o.text("drop"), ',');
  return reality;
}

}  // namespace

WalkerRequest walker_simulate_request(const Options& o, const std::string& line) {
  std::vector<std::string> own{"trials", "collisions", "effect", "reality"};
  if (o.flag("reality")) own.insert(own.end(), {"outside", "drop"});
  for (const char* name : {"outside", "drop"})
    if (o.given(name) && !o.flag("reality")) throw std::invalid_argument(fmt::format("--{}: needs --reality", name));
  WalkerRequest walker = walker_request(o, line, own);
  walker.walks.trials = o.whole("trials", 1, 1000000);
  if (o.given("collisions")) walker.walks.longest = o.whole("collisions", 2, 1000000);  // a step has two
  if (o.flag("reality")) {
    walker.reality = walker_reality(o);
    return walker;
  }
  if (walker.settings.front().walker == analysis::Walker::biped) {
    if (o.given("effect")) throw std::invalid_argument("--effect: has no meaning with --walker biped");
    return walker;
  }
  walker.effects = analysis::effects_of_walks(walker.settings.front(), o.all("effect"));
  return walker;
}

LaboratoryRequest laboratory_request(const Options& o, const SimulateRequest& plain) {
  LaboratoryRequest request;
  request.conditions = plain.stand_in ? analysis::stand_in_conditions(plain.setting)
                                      : std::vector<analysis::LaboratoryCondition>{
                                            {fmt::format("{}", plain.setting.slope_deg), plain.setting, plain.trials}};
  analysis::LaboratoryOptions& reality = request.reality;
  const analysis::Setting& s = plain.setting;
  const dynamics::NominalValues stated = analysis::stated_values(s.restitution, s.friction, s.wheel.leg_length);
  for (const std::string& text : o.all("effect")) {
    analysis::require_word("--effect", text.substr(0, text.find(':')), effect_ids());
    reality.effects.push_back(dynamics::effect_from_text(text, stated));
  }
  reality.outside = outside_effects_in(o);
  reality.restitution_skewness = o.number("skewness");
  reality.sensor_noise = o.number("sensor-noise");
  reality.smoothing = o.number("smoothing");
  reality.flight = !o.flag("no-flight");
  reality.shuffled = o.flag("shuffle");
  reality.collisions = plain.collisions;
  reality.seed = plain.seed;
  reality.threads = plain.threads;
  if (o.given("drop")) request.dropped = split(o.text("drop"), ',');
  request.camera = plain.camera;
  request.out = plain.out;
  request.json = plain.json;
  request.command = plain.command;
  return request;
}

void declare_describe(Options& o) {
  o.add_place("DIR", "Experiment folder");
  o.add("transition", "auto|collision|step", "auto",
        "Restitution and friction from omega_minus to omega_plus, or to the next omega_minus");
  o.add("against", "LAW,LAW,...", "", "Compare with simulated trials under published, coulomb, plastic, settled");
  o.add("trials", "N", "2000", "Simulated trials of that comparison, 2..1000000");
  o.add_seed();
  o.add_threads();
  o.add("out", "DIR", "", "Folder for tables, figures and index.html (default: tables on the terminal)");
  o.add_json();
}

DescribeRequest describe_request(const Options& o, const std::string& line) {
  DescribeRequest request;
  request.folder = o.text("DIR");
  request.out = o.text("out");
  request.json = o.text("json");
  const std::string transition = o.text("transition");
  if (transition != "auto")
    request.options.transition = transition == "step" ? analysis::Transition::step : analysis::Transition::collision;
  std::istringstream laws(o.text("against"));
  for (std::string law; std::getline(laws, law, ',');) {
    analysis::require_word("--against", law, dynamics::law_names());
    request.against.push_back(dynamics::law_from_name(law));
  }
  request.trials = o.count("trials", 2, 1000000);
  request.options.seed = o.seed();
  request.options.threads = o.threads();
  request.command = line;
  return request;
}

void declare_diagnose(Options& o) {
  o.add_place("DIR",
              "Experiment folder: of a wheel (its [contact] names the law published, coulomb, plastic or settled), a "
              "drum or walks");
  o.add("catalogue", "FILE|ID,ID,...", "",
        "Effects to consider, in a list or a file with one a line (default: all of 'metastable effects'); a pair, "
        "trial_drift+bounce, is tried in any case, and a list of pairs alone extends the whole catalogue");
  o.add(analysis::other_slope, "DEG", "",
        "Expected steps of this machine on another slope, too; from 0.001 to below half of the angle between legs");
  o.add(analysis::other_launch, "RAD_S", "",
        "Expected steps of this machine launched at another omega just before the first collision, too; in (0, 1000], "
        "and "
        "up to 15 under settled");
  o.add_seed();
  o.add_threads();
  o.add_json();
  o.add("out", "DIR", "", "Folder for index.html with figures and tables (CSV, Markdown, LaTeX)");
}

// Reads the effects to consider. Those of walks are their machine's, which is known once they are read. A folder that
// is broken seems to be a wheel's: what is wrong with it is said first.
std::vector<std::string> catalogue_for(const std::string& folder, const std::string& text) {
  const bool walks = !folder.empty() && analysis::holds_walks(folder);
  try {
    return catalogue_value("catalogue", text, walks ? std::vector<std::string>{} : effect_ids());
  } catch (const std::invalid_argument&) {
    if (std::filesystem::is_directory(folder) && !analysis::read_walks(folder))
      static_cast<void>(analysis::read_experiment(folder));
    throw;
  }
}

DiagnoseRequest diagnose_request(const Options& o, const std::string& line) {
  DiagnoseRequest request;
  request.folder = o.text("DIR");
  if (o.given("catalogue")) request.options.catalogue = catalogue_for(request.folder, o.text("catalogue"));
  for (const char* place : {analysis::other_slope, analysis::other_launch})
    if (o.given(place)) request.options.elsewhere.emplace_back(place, o.number(place));
  request.options.seed = o.seed();
  request.options.threads = o.threads();
  request.json = o.text("json");
  request.out = o.text("out");
  request.command = line;
  return request;
}

std::vector<Command> experiment_commands() {
  return {simulate(), import_command(), coast_down(), collisions(), describe(),
          study(),    diagnose(),       lessons(),    effects()};
}

}  // namespace metastable::reports
