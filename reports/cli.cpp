#include "reports/cli.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <deque>
#include <functional>
#include <map>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "analysis/input_error.h"
#include "dynamics/contact_law.h"
#include "markov/chain.h"
#include "reports/collisions_command.h"
#include "reports/compare_command.h"
#include "reports/config_file.h"
#include "reports/interrupt.h"
#include "reports/option_values.h"
#include "reports/report_command.h"
#include "reports/request.h"
#include "reports/simulate_command.h"
#include "reports/steps_command.h"
#include "reports/sweep_command.h"
#include "reports/verify_command.h"
#include "reports/version.h"

namespace metastable::reports {
namespace {

// The options of one command, as texts; given on the command line, in a --config file, or left at their default.
class Options {
 public:
  Options(CLI::App& command) : command_(command) {}

  void add(const std::string& name, const std::string& value, const std::string& fallback, const std::string& help) {
    std::vector<std::string>& texts = texts_[name];
    CLI::Option* option = command_.add_option("--" + name, texts, help);
    option->expected(1)->allow_extra_args(false)->type_name(value)->multi_option_policy(
        CLI::MultiOptionPolicy::TakeAll);
    if (!fallback.empty()) {
      option->default_str(fallback);
      fallback_[name] = fallback;
    }
  }

  // An option without a value; `true` or `false` in a file.
  void add_flag(const std::string& name, const std::string& help) {
    std::vector<std::string>& texts = texts_[name];
    command_.add_flag_callback(
        "--" + name, [&texts] { texts = {"true"}; }, help);
    fallback_[name] = "false";
  }
  bool flag(const std::string& name) const {
    const std::string value = text(name);
    if (value != "true" && value != "false")
      throw std::invalid_argument(fmt::format("--{}: '{}' is neither true nor false", name, value));
    return value == "true";
  }

  // What the command is about, given by its place on the command line; required.
  void add_place(const std::string& name, const std::string& help) {
    command_.add_option(name, texts_[name], help)->required()->expected(1)->type_name("");
  }

  // Keys of the file that the command line did not give.
  void read(const std::string& file) {
    for (const ConfigEntry& entry : read_config(file)) {
      if (entry.key == "config" || !texts_.contains(entry.key))
        throw std::invalid_argument(
            fmt::format("{}:{}: unknown key '{}' (keys are the long options of 'metastable {}')", file, entry.line,
                        entry.key, command_.get_name()));
      std::vector<std::string>& texts = texts_[entry.key];
      if (texts.empty()) texts = entry.values;
    }
  }

  bool given(const std::string& name) const { return !texts_.at(name).empty(); }
  const std::vector<std::string>& all(const std::string& name) const { return texts_.at(name); }
  // The one value of an option: given once, or its default ("" if it has none).
  std::string text(const std::string& name) const {
    const std::vector<std::string>& texts = texts_.at(name);
    if (texts.size() > 1) throw std::invalid_argument(fmt::format("--{}: given {} times", name, texts.size()));
    if (!texts.empty()) return texts.front();
    const auto fallback = fallback_.find(name);
    return fallback == fallback_.end() ? "" : fallback->second;
  }
  double number(const std::string& name) const { return number_value(name, text(name)); }
  std::uint64_t whole(const std::string& name, std::uint64_t least, std::uint64_t most) const {
    return whole_value(name, text(name), least, most);
  }
  analysis::Spread spread(const std::string& name) const { return spread_value(name, text(name)); }

 private:
  CLI::App& command_;
  std::map<std::string, std::vector<std::string>> texts_;
  std::map<std::string, std::string> fallback_;
};

// ---- options that several commands share -------------------------------------------------------------------------

void add_wheel(Options& options) {
  options.add("legs", "paper|L|L1,L2,...", "paper",
              "Leg lengths [m]: the paper's, one for all, or a list in landing order");
  options.add("leg-count", "N", "8", "Number of legs when --legs is one length (3 or more)");
  options.add("mass", "KG", "1.39", "Hub mass M [kg]");
  options.add("inertia", "KGM2", "",
              "About the stance foot [kg m^2] (default: M (mean L)^2; under coulomb and plastic plus M r_g^2)");
  options.add("radius-of-gyration", "M", "", "About the hub [m] (default: 0.05 under coulomb, 0 under plastic)");
  options.add("ramp-stiffness", "N/M", "9000", "K_r [N/m]");
  options.add("contact-mass", "KG", "", "Mass in the Kelvin-Voigt contact (25) [kg] (default: the hub mass)");
  options.add("gravity", "M/S2", "9.81", "g [m/s^2]");
}

void add_contact(Options& options) {
  options.add("law", "published|coulomb|plastic", "published", "Contact law");
  options.add("rebound-lost", "SHARE", "0", "Share of the rebound's energy lost in hops, 0..1 (coulomb)");
  options.add("restitution", "MEAN,SD", "0.4,0.1", "eta, normal truncated to [0, 1]; SD 0 or MEAN alone: constant");
  options.add("friction", "MEAN,SD", "0.4,0.1", "mu, normal truncated to [0, inf)");
  options.add("correlation", "RHO", "0", "Of the normal scores of eta and mu, (-1, 1)");
  options.add("contact-list", "FILE", "", "CSV 'restitution,friction': draw pairs from a list instead");
}

void add_course(Options& options) {
  options.add("ramp-length", "M", "3.66", "Ramp length [m]");
  options.add("first-leg", "I", "0", "Leg that lands at collision 1");
}

void add_study(Options& options) {
  options.add("method", "sampled|integrated", "sampled",
              "How rows are made: by sampling eta and mu per cell, or by quadrature of the landing's density");
  options.add("cells", "N", "", "Cells per landing leg, 8..4096 (default: refined until the tolerance is met)");
  options.add("samples", "S", "", "Draws per cell and replicate (default: raised until the tolerance is met)");
  options.add("tolerance", "REL", "0.01", "Half-width of the 95 % interval of the expected steps, relative");
  options.add("sequence", "sobol|random", "sobol", "Where the draws come from");
  options.add("draws", "weighted|plain", "weighted", "Weighted draws cover the tails; plain ones see what is frequent");
  options.add("tail", "P", "1e-30", "Tail probability the weighted draws reach");
  options.add("replicates", "R", "8", "Independent randomisations behind the interval, 2..64");
  options.add("mixing-distance", "D", "0.05", "Total variation distance that counts as mixed");
  options.add("eigenvalues", "K", "6", "How many eigenvalue moduli to report");
  options.add("seed", "SEED", "1", "Seed of the random numbers");
  options.add("threads", "T", "0", "Threads; 0: all cores. Results do not depend on it");
}

dynamics::Wheel wheel(const Options& options) {
  dynamics::Wheel wheel;
  wheel.leg_length = legs_value("legs", options.text("legs"), static_cast<int>(options.whole("leg-count", 3, 1000)));
  wheel.hub_mass = options.number("mass");
  if (options.given("inertia")) wheel.inertia = options.number("inertia");
  if (options.given("radius-of-gyration")) wheel.radius_of_gyration = options.number("radius-of-gyration");
  wheel.ramp_stiffness = options.number("ramp-stiffness");
  if (options.given("contact-mass")) wheel.contact_mass = options.number("contact-mass");
  wheel.gravity = options.number("gravity");
  wheel.validate();
  return wheel;
}

// All but slope and launch speed.
analysis::Setting common_setting(const Options& options) {
  analysis::Setting setting;
  setting.wheel = wheel(options);
  setting.law = dynamics::law_from_name(options.text("law"));
  setting.rebound_lost = options.number("rebound-lost");
  if (options.given("rebound-lost") && setting.law != dynamics::Law::coulomb)
    throw std::invalid_argument("--rebound-lost: has a meaning under --law coulomb only");
  setting.restitution = options.spread("restitution");
  setting.friction = options.spread("friction");
  setting.correlation = options.number("correlation");
  if (options.given("contact-list")) {
    if (options.given("restitution") || options.given("friction") || options.given("correlation"))
      throw std::invalid_argument("--contact-list: excludes --restitution, --friction and --correlation");
    setting.pairs = contact_list("contact-list", options.text("contact-list"));
  }
  setting.ramp_length = options.number("ramp-length");
  setting.first_landing_leg =
      static_cast<int>(options.whole("first-leg", 0, static_cast<std::uint64_t>(setting.wheel.legs() - 1)));
  return setting;
}

analysis::Spread launch_for(double slope_deg, const std::optional<std::string>& text) {
  if (text) return spread_value("initial-speed", *text);
  const std::optional<analysis::Spread> paper = analysis::paper_launch(slope_deg);
  if (!paper)
    throw std::invalid_argument(fmt::format(
        "--initial-speed: must be given at {} deg (the paper's launches are known at 7.02 and 9.59 deg only)",
        slope_deg));
  return *paper;
}

// Before the launch is asked for: a slope that no launch can save is named as such.
void check_slope(const analysis::Setting& setting) {
  const double steepest = dynamics::steepest_slope(setting.wheel.legs()) * 180 / std::numbers::pi;
  if (!(setting.slope_deg > 0 && setting.slope_deg < steepest))
    throw std::invalid_argument(fmt::format(
        "slope: {:.6g} deg is outside (0, {:.6g}) deg (half the angle between legs)", setting.slope_deg, steepest));
}

// Checks what can be checked before any work: ranges live with the quantities they belong to.
analysis::Setting checked(analysis::Setting setting) {
  setting.problem();
  return setting;
}

analysis::Setting one_setting(const Options& options) {
  analysis::Setting setting = common_setting(options);
  setting.slope_deg = options.number("slope");
  check_slope(setting);
  std::optional<std::string> launch;
  if (options.given("initial-speed")) launch = options.text("initial-speed");
  setting.initial_speed = launch_for(setting.slope_deg, launch);
  return checked(std::move(setting));
}

std::vector<analysis::Setting> several_settings(const Options& options, std::size_t least) {
  const std::vector<double> slopes = list_value("slopes", options.text("slopes"));
  if (slopes.size() < least)
    throw std::invalid_argument(fmt::format("--slopes: {} given where at least {} are needed", slopes.size(), least));
  const std::vector<std::string>& launches = options.all("initial-speed");
  if (!launches.empty() && launches.size() != slopes.size())
    throw std::invalid_argument(fmt::format("--initial-speed: {} values for {} slopes (give it once a slope, in order)",
                                            launches.size(), slopes.size()));
  std::vector<analysis::Setting> settings;
  for (std::size_t i = 0; i < slopes.size(); ++i) {
    analysis::Setting setting = common_setting(options);
    setting.slope_deg = slopes[i];
    check_slope(setting);
    setting.initial_speed = launch_for(slopes[i], launches.empty() ? std::nullopt : std::optional(launches[i]));
    settings.push_back(checked(std::move(setting)));
  }
  return settings;
}

analysis::StudyOptions study_options(const Options& options) {
  analysis::StudyOptions study;
  if (options.text("method") != "sampled" && options.text("method") != "integrated")
    throw std::invalid_argument(
        fmt::format("--method: '{}' is neither 'sampled' nor 'integrated'", options.text("method")));
  study.method = analysis::method_from_name(options.text("method"));
  if (options.given("cells")) study.cells = options.whole("cells", 8, 4096);
  if (options.given("samples")) study.samples = options.whole("samples", 16, 1u << 24);
  study.tolerance = options.number("tolerance");
  const std::string sequence = options.text("sequence"), draws = options.text("draws");
  if (sequence != "sobol" && sequence != "random")
    throw std::invalid_argument(fmt::format("--sequence: '{}' is neither 'sobol' nor 'random'", sequence));
  if (draws != "weighted" && draws != "plain")
    throw std::invalid_argument(fmt::format("--draws: '{}' is neither 'weighted' nor 'plain'", draws));
  study.sequence = sequence == "sobol" ? markov::Sequence::sobol : markov::Sequence::random;
  study.weighting = draws == "weighted" ? markov::Weighting::weighted : markov::Weighting::plain;
  study.tail = options.number("tail");
  study.replicates = static_cast<int>(options.whole("replicates", 2, 64));
  study.mixing_distance = options.number("mixing-distance");
  study.eigenvalues = static_cast<int>(options.whole("eigenvalues", 1, 64));
  study.seed = options.whole("seed", 0, UINT64_MAX);
  study.threads = static_cast<int>(options.whole("threads", 0, 1024));
  study.validate();
  return study;
}

// ---- one command each: its options, and its request from them -------------------------------------------------------

struct Command {
  std::string name, summary;
  std::function<void(Options&)> declare;
  std::function<void(const Options&, const std::string& command_line)> run;
};

std::vector<Command> commands() {
  return {
      {"steps", "Expected steps before failure of one setting, with their interval",
       [](Options& o) {
         o.add("slope", "DEG", "7.02", "Ramp slope [deg], above 0 and below half the angle between legs");
         o.add("initial-speed", "MEAN,SD", "",
               "Just before collision 1 [rad/s] (default: the paper's at 7.02 and 9.59)");
         add_wheel(o), add_contact(o), add_course(o), add_study(o);
         o.add_flag("certify", "Guaranteed bounds as well, refined to the width --tolerance (law published)");
         o.add("json", "FILE|-", "", "Write the results as JSON");
       },
       [](const Options& o, const std::string& line) {
         run_steps({one_setting(o), study_options(o), o.text("json"), line, o.flag("certify")});
       }},
      {"compare", "Expected steps of two or more slopes on common random numbers",
       [](Options& o) {
         o.add("slopes", "DEG,DEG,...", "7.02,9.59", "Ramp slopes [deg]; later ones are compared with the first");
         o.add("initial-speed", "MEAN,SD", "", "Once per slope, in order (default: the paper's at 7.02 and 9.59)");
         add_wheel(o), add_contact(o), add_course(o), add_study(o);
         o.add("collisions", "N", "16", "Collisions of a measured trial, 1..63");
         o.add("json", "FILE|-", "", "Write the results as JSON");
       },
       [](const Options& o, const std::string& line) {
         run_compare({several_settings(o, 2), study_options(o), static_cast<int>(o.whole("collisions", 1, 63)),
                      o.text("json"), line});
       }},
      {"sweep", "Expected steps over ranges of slope, means and spreads; CSV and figure, resumable",
       [](Options& o) {
         o.add("slope", "RANGE", "7.02", "[deg] first:last:step, a comma list or one value; likewise the other axes");
         o.add("restitution-mean", "RANGE", "", "Mean of eta");
         o.add("restitution-sd", "RANGE", "", "Sd of eta");
         o.add("friction-mean", "RANGE", "", "Mean of mu");
         o.add("friction-sd", "RANGE", "", "Sd of mu");
         o.add("initial-speed", "MEAN,SD", "", "Of all points (default: the paper's if the one slope is 7.02 or 9.59)");
         add_wheel(o), add_contact(o), add_course(o), add_study(o);
         o.add("out", "FILE", "sweep.csv",
               "CSV; the figure goes beside it as .svg. A sweep cut short is taken up again");
       },
       [](const Options& o, const std::string& line) {
         SweepRequest request;
         request.setting = common_setting(o);
         for (const char* name : {"slope", "restitution-mean", "restitution-sd", "friction-mean", "friction-sd"}) {
           if (o.text(name).empty()) continue;
           analysis::Axis axis{analysis::parameter_from_name(name), range_value(name, o.text(name))};
           if (axis.parameter == analysis::Parameter::slope && axis.values.size() == 1)
             request.setting.slope_deg = axis.values.front();
           else
             request.axes.push_back(std::move(axis));
         }
         if (request.axes.empty())
           throw std::invalid_argument(
               "sweep: no range given (--slope, --restitution-mean, --restitution-sd, "
               "--friction-mean or --friction-sd as first:last:step)");
         for (const analysis::Axis& axis : request.axes)
           if (!request.setting.pairs.empty() && axis.parameter != analysis::Parameter::slope)
             throw std::invalid_argument(
                 fmt::format("--{}: cannot vary with --contact-list", analysis::parameter_name(axis.parameter)));
         const bool one_slope = request.axes.front().parameter != analysis::Parameter::slope;
         std::optional<std::string> launch;
         if (o.given("initial-speed")) launch = o.text("initial-speed");
         if (!launch && !one_slope) throw std::invalid_argument("--initial-speed: must be given when the slope varies");
         request.setting.initial_speed = launch_for(request.setting.slope_deg, launch);
         request.study = study_options(o);
         request.out = o.text("out");
         request.command = line;
         run_sweep(request);
       }},
      {"simulate", "Trials as an experiment folder (experiment.toml, collisions.csv, trials.csv)",
       [](Options& o) {
         o.add("slope", "DEG", "7.02", "Ramp slope [deg]");
         o.add("initial-speed", "MEAN,SD", "",
               "Just before collision 1 [rad/s] (default: the paper's at 7.02 and 9.59)");
         add_wheel(o), add_contact(o), add_course(o);
         o.add("trials", "N", "50", "Trials");
         o.add("collisions", "N", "16", "Most collisions of a trial");
         o.add("angle-rate", "HZ", "",
               "Write angle.csv too, as a camera of this rate sees the trials, 10..100000 (120)");
         o.add("angle-noise", "RAD", "", "White noise of the angle (default 0.0002; needs --angle-rate)");
         o.add("seed", "SEED", "1", "Seed of the random numbers");
         o.add("threads", "T", "0", "Threads; 0: all cores. Results do not depend on it");
         o.add("out", "DIR", "", "Folder to create (must not hold an experiment yet)");
       },
       [](const Options& o, const std::string& line) {
         if (o.text("out").empty()) throw std::invalid_argument("--out: a folder must be given");
         SimulateRequest request{one_setting(o),
                                 static_cast<int>(o.whole("trials", 1, 1000000)),
                                 static_cast<int>(o.whole("collisions", 1, 100000)),
                                 o.whole("seed", 0, UINT64_MAX),
                                 static_cast<int>(o.whole("threads", 0, 1024)),
                                 o.text("out"),
                                 line};
         if (o.given("angle-noise") && !o.given("angle-rate"))
           throw std::invalid_argument("--angle-noise: needs --angle-rate");
         if (o.given("angle-rate")) {
           analysis::CameraOptions& camera = request.camera.emplace();
           camera.rate = o.number("angle-rate");
           if (o.given("angle-noise")) camera.noise_sd = o.number("angle-noise");
           camera.seed = request.seed;
           camera.threads = request.threads;
           camera.validate();
         }
         run_simulate(request);
       }},
      {"collisions", "Collisions from the wheel's angle over time: angle.csv of an experiment folder to collisions.csv",
       [](Options& o) {
         o.add_place("DIR", "Experiment folder with experiment.toml and angle.csv");
         o.add("window", "N", "",
               "Savitzky-Golay window [samples], odd, 5..10001 (default: 50 ms, at least 5 samples)");
         o.add("collisions", "N", "16", "Most collisions of a trial");
         o.add("rise", "RAD/S", "0.4", "Least rise of a peak of the speed above both sides");
         o.add("omega-minus", "fit|peak", "fit",
               "Stance motion extrapolated to the collision, or the smoothed speed's peak");
         o.add("fit-span", "S", "0.08", "Stance motion is fitted to this much time on either side of a collision");
         o.add("threads", "T", "0", "Threads; 0: all cores. Results do not depend on it");
         o.add("out", "FILE|-", "", "Default: DIR/collisions.csv, or DIR/collisions-from-angle.csv if that is there");
       },
       [](const Options& o, const std::string&) {
         CollisionsRequest request;
         request.folder = o.text("DIR");
         if (o.given("window")) request.finder.window = static_cast<int>(o.whole("window", 5, 10001));
         request.finder.collisions = static_cast<int>(o.whole("collisions", 1, 100000));
         request.finder.rise = o.number("rise");
         request.finder.fit_span = o.number("fit-span");
         request.finder.validate();
         const std::string speed = o.text("omega-minus");
         if (speed != "fit" && speed != "peak")
           throw std::invalid_argument(fmt::format("--omega-minus: '{}' is neither 'fit' nor 'peak'", speed));
         request.peak = speed == "peak";
         request.threads = static_cast<int>(o.whole("threads", 0, 1024));
         request.out = o.text("out");
         run_collisions(request);
       }},
      {"report", "The ramps side by side: tables (CSV, Markdown, LaTeX), figures (SVG) and a page that shows them",
       [](Options& o) {
         o.add("slopes", "DEG,DEG,...", "7.02,9.59", "Ramp slopes [deg]");
         o.add("initial-speed", "MEAN,SD", "", "Once per slope, in order (default: the paper's at 7.02 and 9.59)");
         add_wheel(o), add_contact(o), add_course(o), add_study(o);
         o.add("energy-trials", "N", "1000", "Trials behind the energy-loss table, 2..1000000");
         o.add("out", "DIR", "report", "Folder for the files");
       },
       [](const Options& o, const std::string& line) {
         run_report({several_settings(o, 1), study_options(o), static_cast<int>(o.whole("energy-trials", 2, 1000000)),
                     o.text("out"), line});
       }},
      {"verify", "How accurate the program is: known values, doubling of nodes, three solvers side by side",
       [](Options& o) {
         o.add("seeds", "N", "0", "Sampled studies a benchmark, to count how often their interval is right; 0: none");
         o.add("nodes", "N", "512", "Nodes a landing leg at which doubling stops, 128..4096");
         o.add("threads", "T", "0", "Threads; 0: all cores. Results do not depend on it");
         o.add("out", "DIR", "", "Folder for the tables (CSV, Markdown, LaTeX)");
         o.add("export", "DIR", "", "Folder for the default wheel's chain (PRISM .tra, .lab, .srew; MatrixMarket)");
       },
       [](const Options& o, const std::string& line) {
         run_verify({static_cast<int>(o.whole("seeds", 0, 1000)), o.whole("nodes", 128, 4096),
                     static_cast<int>(o.whole("threads", 0, 1024)), o.text("out"), o.text("export"), line});
       }},
  };
}

// For provenance: without the options that leave the results as they are, so that equal results are equal bytes.
std::string command_line(int argc, const char* const* argv) {
  std::string line = "metastable";
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const auto is = [&](const std::string& name) { return word == name || word.starts_with(name + "="); };
    if (is("--out") || is("--json") || is("--threads")) {
      if (word.find('=') == std::string::npos) ++i;
      continue;
    }
    const bool plain = !word.empty() && word.find_first_of(" \t\n'\"\\$&|;<>()*?#~`!") == std::string::npos;
    line += ' ';
    if (plain) {
      line += word;
      continue;
    }
    line += '\'';
    for (const char c : word) line += c == '\'' ? std::string("'\\''") : std::string(1, c);
    line += '\'';
  }
  return line;
}

int parse_and_run(int argc, const char* const* argv) {
  CLI::App app("Metastability of walking machines: the rimless wheel on a ramp", "metastable");
  app.require_subcommand(1);
  app.set_version_flag("--version", "metastable " + version());
  app.footer("Exit codes: 0 done, 2 wrong option or file, 3 a solver failed, 130 interrupted.");
  const std::vector<Command> all = commands();
  std::deque<Options> options;
  std::vector<CLI::App*> subcommands;
  std::deque<std::string> config_files;
  for (const Command& command : all) {
    CLI::App* sub = app.add_subcommand(command.name, command.summary);
    options.emplace_back(*sub);
    command.declare(options.back());
    sub->add_option("--config", config_files.emplace_back(), "TOML file with any of these options as keys")
        ->type_name("FILE");
    subcommands.push_back(sub);
  }
  if (argc < 2 || (argv[1][0] != '-' &&
                   std::none_of(all.begin(), all.end(), [&](const Command& c) { return c.name == argv[1]; }))) {
    std::string names;
    for (const Command& command : all) names += (names.empty() ? "" : ", ") + command.name;
    throw std::invalid_argument(argc < 2 ? fmt::format("a subcommand is needed: {}", names)
                                         : fmt::format("'{}' is none of the subcommands {}", argv[1], names));
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& success) {  // --help, --version
    return app.exit(success);
  } catch (const CLI::ParseError& error) {
    throw std::invalid_argument(error.what());
  }
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (!subcommands[i]->parsed()) continue;
    if (!config_files[i].empty()) options[i].read(config_files[i]);
    all[i].run(options[i], command_line(argc, argv));
  }
  return 0;
}

}  // namespace

int run(int argc, const char* const* argv) {
  const auto fail = [](const std::string& what, int code) {
    fmt::print(stderr, "metastable: {}\n", what);
    return code;
  };
  try {
    catch_interrupts();
    return parse_and_run(argc, argv);
  } catch (const Interrupted& interrupted) {
    return fail(interrupted.what(), interrupted.exit_code());
  } catch (const analysis::InputError& error) {  // all that is wrong with an input, a line each
    for (const std::string& line : error.lines()) fail(line, 2);
    return 2;
  } catch (const std::invalid_argument& error) {
    return fail(error.what(), 2);
  } catch (const markov::ConvergenceError& error) {
    return fail(error.what(), 3);
  } catch (const std::exception& error) {
    return fail(error.what(), 1);
  }
}

}  // namespace metastable::reports
