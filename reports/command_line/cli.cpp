#include "reports/command_line/cli.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <deque>
#include <filesystem>
#include <new>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

#include "analysis/experiment/input_error.h"
#include "analysis/experiment/suggestion.h"
#include "reports/command_line/command.h"
#include "reports/command_line/help.h"
#include "reports/command_line/manual.h"
#include "reports/command_line/requests.h"
#include "reports/command_line/setting_options.h"
#include "reports/command_line/walker_options.h"
#include "reports/command_line/written_paths.h"
#include "reports/commands/compare_command.h"
#include "reports/commands/doctor_command.h"
#include "reports/commands/report_command.h"
#include "reports/commands/request.h"
#include "reports/commands/steps_command.h"
#include "reports/commands/sweep_command.h"
#include "reports/commands/sweep_file.h"
#include "reports/commands/verify_command.h"
#include "reports/output/answer.h"
#include "reports/output/interrupt.h"
#include "reports/output/standard_output.h"
#include "reports/output/version.h"

namespace metastable::reports {
namespace {

Command steps() {
  return {"steps",
          "Expected steps before failure of one setting, with their interval",
          declare_steps,
          [](const Options& o, const std::string& line) {
            if (asks_for_walker(o)) {
              WalkerRequest walker =
                  walker_request(o, line, {"how-it-fails", "time-limit", "method", "tolerance", "level"});
              walker.method = walker_method(o);
              walker.level = walker_level(o, walker.method);
              walker.splitting = splitting_options(o);
              walker.time_limit = o.number("time-limit");
              walker.how_it_fails = o.flag("how-it-fails");
              return run_walker_steps(walker);
            }
            run_steps(steps_request(o, one_setting(o), line));
          },
          "",
          {"metastable steps --slope 9.59 --friction 0.3,0.05",
           "metastable steps --law settled --slope 9.59 --legs 0.1519 --how-it-fails",
           "metastable steps --slope 9.59 --method integrated --sensitivities"}};
}

Command compare() {
  return {"compare",
          "Expected steps of two or more settings on common random numbers",
          declare_compare,
          [](const Options& o, const std::string& line) {
            if (asks_for_walker(o)) {
              const WalkerRequest walker = walker_request(o, line);
              if (walker.settings.size() < 2)
                throw std::invalid_argument("--slopes, --slope-sd: two slopes or two sds at least");
              return run_walker_compare(walker);
            }
            run_compare(compare_request(o, compared_settings(o), line));
          },
          "Every option of wheel, contact, course and launch takes several values: with commas between them (--law "
          "published,settled, --mass 1,2), or, where commas have a meaning of their own, given again (--legs 0.15 "
          "--legs 0.16; likewise --restitution, --friction, --contact-list, --initial-speed). All combinations are "
          "studied; the first values together are the setting that every other one is compared with.",
          {"metastable compare --slopes 7.02,9.59", "metastable compare --slope 9.59 --friction-mean 0.3,0.4,0.5",
           "metastable compare --slope 9.59 --law published,coulomb"}};
}

}  // namespace

Command sweep_command(const Sharing* sharing) {
  return {
      "sweep",
      "Expected steps over ranges of slope, means and spreads; CSV and figure, resumable",
      declare_sweep,
      [sharing](const Options& o, const std::string& line) {
        if (asks_for_walker(o)) {
          WalkerRequest walker = walker_sweep_request(o, line);
          walker.sharing = sharing;
          if (sharing) walker.study.threads = 1;
          return run_walker_sweep(walker);
        }
        SweepRequest request;
        request.sharing = sharing;
        request.setting = common_setting(o);
        for (const char* name : {"slope", "restitution-mean", "restitution-sd", "friction-mean", "friction-sd"}) {
          if (o.text(name).empty()) continue;
          analysis::SweepAxis axis = sweep_axis(o, name, request.setting);
          if (axis.parameter == analysis::Parameter::slope && axis.values.size() == 1)
            request.setting.slope_deg = axis.values.front();
          else
            request.axes.push_back(std::move(axis));
        }
        if (request.axes.empty())
          throw std::invalid_argument(
              "sweep: no range given (--slope, --restitution-mean, --restitution-sd, "
              "--friction-mean or --friction-sd as first:last:step)");
        const bool one_slope = request.axes.front().parameter != analysis::Parameter::slope;
        std::optional<std::string> launch;
        if (o.given("initial-speed")) launch = o.text("initial-speed");
        if (!launch && !one_slope) launch = "steady";  // one rule for all slopes
        set_launch(request.setting, launch);
        request.rigid_bodies = !o.given("law");
        request.study = study_options(o);
        request.out = o.text("out");
        request.json = o.text("json");
        request.command = line;
        run_sweep(request);
      },
      "",
      {"metastable sweep --slope 7:10:1.5", "metastable sweep --slope 9.59 --friction-mean 0.3:0.4:0.05 --out mu.csv",
       "metastable sweep --slope 8:10:2 --friction-sd 0.05,0.1 --out map.csv"}};
}

namespace {

Command solve() {
  return {"solve",
          "Which value of a parameter gives the steps, or the survival, that are asked for",
          declare_solve,
          [](const Options& o, const std::string& line) {
            const std::string solved = o.text("PARAMETER");
            if (asks_for_walker(o)) return run_solve(walker_solve_request(o, walker_solved_setting(o, solved), line));
            if (solved == "slope" && o.given("slope")) throw std::invalid_argument("--slope: is what is solved for");
            analysis::Setting setting = one_setting(o);
            // One rule for all slopes: the paper's launch is that of one of them.
            if (solved == "slope" && !o.given("initial-speed")) setting.steady_launch = true;
            run_solve(solve_request(o, setting, line));
          },
          "",
          {"metastable solve friction-mean --slope 9.59 --steps 100 --method integrated",
           "metastable solve slope --survive 1000:0.9 --friction 0.3,0.05 --legs 0.1519 --method integrated",
           "metastable solve friction-sd --slope 9.59 --friction 0.3 --survive 1000:0.9 --method integrated"}};
}

Command report() {
  return {
      "report",
      "The ramps side by side: tables (CSV, Markdown, LaTeX), figures (SVG) and a page that shows them",
      [](Options& o) {
        o.group("Question");
        o.add("slopes", "DEG,DEG,...", "7.02,9.59",
              "Ramp slopes [deg], each from 0.001 to below half the angle between legs");
        add_launch(o, "Once per slope, in order");
        add_wheel(o), add_contact(o), add_course(o), add_study(o);
        o.add("energy-trials", "N", "1000", "Trials behind the energy-loss table, 2..1000000");
        o.add("landings", "N", "40000",
              "Landings rolled under settled for each cell of a map, 1000..1000000000: their cost and their intervals");
        o.group("Files and help");
        o.add("out", "DIR", "report", "Folder for the files");
        o.add_json();
        add_walker(o, "DEG,DEG,...");
      },
      [](const Options& o, const std::string& line) {
        if (asks_for_walker(o)) return run_walker_report(walker_request(o, line));
        run_report({several_settings(o, 1), study_options(o), o.count("energy-trials", 2, 1000000),
                    o.count("landings", 1000, 1000000000), o.text("out"), line, o.text("json")});
      },
      "",
      {"metastable report", "metastable report --slopes 6,8,10 --friction 0.3,0.05 --out steeper",
       "metastable report --walker compass --slope-sd 0.458 --out compass"}};
}

Command verify() {
  return {"verify",
          "How accurate the program is: known values, doubling of nodes, three solvers side by side",
          [](Options& o) {
            o.add("seeds", "N", "0",
                  "Sampled studies a benchmark, 0..1000, to count how often their interval is right; 0: none");
            o.add("nodes", "N", "512", "Nodes a landing leg at which doubling stops, 128..4096");
            o.add_threads();
            o.add("out", "DIR", "", "Folder for the tables (CSV, Markdown, LaTeX)");
            o.add("export", "DIR", "", "Folder for the default wheel's chain (PRISM .tra, .lab, .srew; MatrixMarket)");
            o.add_json();
          },
          [](const Options& o, const std::string& line) {
            run_verify({o.count("seeds", 0, 1000), o.whole("nodes", 128, 4096), o.threads(), o.text("out"),
                        o.text("export"), o.text("json"), line});
          },
          "",
          {"metastable verify", "metastable verify --out evidence --export chain"}};
}

// Returns what CLI11 knows of the commands' options, for help, manual pages and completion.
// @param subcommands  as many as commands, in that order
std::vector<ManualCommand> manual_of(const std::vector<Command>& commands, const std::vector<CLI::App*>& subcommands) {
  std::vector<ManualCommand> manual;
  for (std::size_t i = 0; i < commands.size(); ++i) {
    const Command& of = commands[i];
    ManualCommand& command = manual.emplace_back(ManualCommand{of.name, of.summary, {}, of.details, of.examples});
    for (const CLI::Option* option : subcommands[i]->get_options()) {
      const bool place = option->get_positional();
      command.options.push_back({place ? option->get_single_name() : "--" + option->get_lnames().front(),
                                 option->get_expected_max() == 0 ? "" : option->get_type_name(),
                                 option->get_default_str(), option->get_description(), place, option->get_group()});
    }
  }
  return manual;
}

// Returns the options of one command, or of all, as a table.
Table options_table(const std::vector<ManualCommand>& manual, const Options& o) {
  Table table{
      .id = "options", .title = "Options", .columns = {{"command"}, {"option"}, {"value"}, {"default"}, {"help"}}};
  for (const ManualCommand& command : manual)
    if (!o.given("COMMAND") || command.name == o.text("COMMAND"))
      for (const ManualOption& option : command.options)
        table.rows.push_back({command.name, option.name, option.value, option.fallback, option.help});
  return table;
}

// @param manual  of all commands, known once they are declared
std::vector<Command> help_commands(const std::vector<ManualCommand>& manual) {
  return {{"man",
           "The manual page of the program or of a command, for `man -l -`",
           [](Options& o) {
             o.add_optional_place("COMMAND", "One of the commands");
             o.add_json();
           },
           [&manual](const Options& o, const std::string& line) {
             const std::string page = manual_page(manual, o.text("COMMAND"), version());
             Answer answer(o.text("json"));
             if (o.text("json") != "-") fmt::print("{}", page);
             answer.table(options_table(manual, o));
             answer.finish({line, {}, 0, version()});
           },
           "",
           {"metastable man steps | man -l -"}},
          {"completion",
           "A script that completes commands and options: source <(metastable completion bash)",
           [](Options& o) {
             o.add_place("SHELL", "Whose completion it is", "bash|zsh|fish");
             o.add_json();
           },
           [&manual](const Options& o, const std::string& line) {
             const std::string script = completion_script(manual, o.text("SHELL"));
             Answer answer(o.text("json"));
             if (o.text("json") != "-") fmt::print("{}", script);
             answer.fact("shell", o.text("SHELL"));
             answer.fact("script", script);
             answer.finish({line, {}, 0, version()});
           },
           "",
           {"source <(metastable completion bash)", "metastable completion fish | source"}},
          {"doctor", "What is installed, and what each missing piece would add", [](Options& o) { o.add_json(); },
           [](const Options& o, const std::string&) { run_doctor(o.text("json")); }}};
}

std::vector<Command> commands(const std::vector<ManualCommand>& manual) {
  std::vector<Command> all{steps(), compare(), sweep_command(), solve()};
  for (const std::vector<Command>& more :
       {experiment_commands(), std::vector<Command>{report(), verify()}, blind_commands(), help_commands(manual)})
    all.insert(all.end(), more.begin(), more.end());
  return all;
}

// The provenance leaves out the options that leave the results as they are, so that equal results are equal bytes.
std::string command_line(int argc, const char* const* argv) {
  std::string line = "metastable";
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const auto is = [&](const std::string& name) { return word == name || word.starts_with(name + "="); };
    if (is("--out") || is("--json") || is("--threads") || is("--time-limit")) {
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

// Declares the commands of a program; holds what is given to each.
class Declared {
 public:
  // @param manual  of all commands; it is filled, and read when help is asked for
  Declared(CLI::App& app, const Program& program, std::vector<ManualCommand>& manual) : program_(program) {
    for (const Command& command : program.commands) {
      const std::size_t index = subcommands_.size();
      CLI::App* sub = subcommands_.emplace_back(app.add_subcommand(command.name, command.summary));
      sub->formatter_fn([&manual, &program, index](const CLI::App*, const std::string&, CLI::AppFormatMode) {
        return command_help(manual[index], program.name, help_width());
      });
      sub->set_help_flag("-h,--help", "Prints this text")->group("Files and help");
      command.declare(options_.emplace_back(*sub));
      add_config(*sub, config_files_.emplace_back());
    }
    manual = manual_of(program.commands, subcommands_);
  }

  // Names the first option that a command does not have: before what may be missing because of it.
  // @throws std::invalid_argument
  void refuse_unknown_options(const std::vector<ManualCommand>& manual) const {
    for (std::size_t i = 0; i < subcommands_.size(); ++i)
      for (const std::string& word : subcommands_[i]->remaining())
        if (word.starts_with("-")) {
          std::vector<std::string> names;
          for (const ManualOption& option : manual[i].options)
            if (!option.place) names.push_back(option.name);
          throw std::invalid_argument(fmt::format("{}: is no option of '{}'{}", word, manual[i].name,
                                                  analysis::did_you_mean(word.substr(0, word.find('=')), names)));
        }
  }

  void run_parsed(const std::string& line) {
    for (std::size_t i = 0; i < subcommands_.size(); ++i)
      if (subcommands_[i]->parsed()) run(program_.commands[i], options_[i], config_files_[i], line);
  }

 private:
  static void add_config(CLI::App& sub, std::string& file) {
    sub.add_option("--config", file, "TOML file with any of these options as keys")
        ->type_name("FILE")
        ->group("Files and help")
        ->check(
            [](const std::string& given) {
              return given.empty() ? std::string("what is given is empty") : value_objection(given, "FILE");
            },
            "");
  }

  static void run(const Command& command, Options& options, const std::string& config, const std::string& line) {
    if (!config.empty()) options.read(config);
    try {
      options.check_given();
      check_written_paths(options, config);
      command.run(options, line);
    } catch (const analysis::InputError&) {
      throw;
    } catch (const std::invalid_argument& error) {
      throw std::invalid_argument(options.placed(error.what()));
    }
  }

  const Program& program_;
  std::deque<Options> options_;
  std::vector<CLI::App*> subcommands_;
  std::deque<std::string> config_files_;
};

// @throws std::invalid_argument with the nearest name if the first word names none
void check_command_named(const std::vector<Command>& all, int argc, const char* const* argv) {
  std::vector<std::string> names;
  for (const Command& command : all) names.push_back(command.name);
  if (argc < 2) throw std::invalid_argument(fmt::format("a subcommand is needed: {}", fmt::join(names, ", ")));
  if (argv[1][0] != '-' && std::ranges::find(names, argv[1]) == names.end())
    throw std::invalid_argument(fmt::format("'{}' is none of the subcommands {}{}", argv[1], fmt::join(names, ", "),
                                            analysis::did_you_mean(argv[1], names)));
}

// @param manual  is filled with all commands
int parse_and_run(const Program& program, std::vector<ManualCommand>& manual, int argc, const char* const* argv) {
  CLI::App app(program.summary, program.name);
  app.require_subcommand(1);
  app.set_version_flag("--version", version_text());
  app.formatter_fn([&manual, &program](const CLI::App*, const std::string&, CLI::AppFormatMode) {
    return program_help(manual, program.name, program.summary, help_width());
  });
  Declared declared(app, program, manual);
  check_command_named(program.commands, argc, argv);
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& success) {  // --help, --version
    std::ostringstream text;
    const int code = app.exit(success, text, text);
    say("{}", text.view());
    return code;
  } catch (const CLI::ParseError& error) {
    declared.refuse_unknown_options(manual);
    if (argv[1][0] == '-')
      throw std::invalid_argument(
          fmt::format("{}: is no option before a subcommand; --help and --version are", argv[1]));
    throw std::invalid_argument(fmt::format("{}; see '{} {} --help'", error.what(), program.name, argv[1]));
  }
  declared.run_parsed(command_line(argc, argv));
  return 0;
}

int run_program(const Program& program, std::vector<ManualCommand>& manual, int argc, const char* const* argv) {
  const auto fail = [&](const std::string& what, int code) {
    if (!program.silent)
      std::fputs((program.name + ": " + what + "\n").c_str(),
                 stderr);  // where even this cannot be written, the code is left
    return code;
  };
  try {
    catch_interrupts();
    const int code = parse_and_run(program, manual, argc, argv);
    flush_standard_output();
    return code;
  } catch (const Interrupted& interrupted) {
    return fail(interrupted.what(), interrupted.exit_code());
  } catch (const analysis::InputError& error) {  // all that is wrong with an input, a line each
    for (const std::string& line : error.lines()) fail(line, 2);
    return 2;
  } catch (const std::invalid_argument& error) {
    return fail(error.what(), 2);
  } catch (const std::filesystem::filesystem_error& error) {
    return fail(error.what(), 2);
  } catch (const std::system_error& error) {
    if (std::ferror(stdout)) return fail(fmt::format("cannot write standard output: {}", error.code().message()), 2);
    return fail(error.what(), 3);
  } catch (const std::bad_alloc&) {
    return fail("there is not enough memory for this", 3);
  } catch (const std::exception& error) {
    return fail(error.what(), 3);
  } catch (...) {
    return fail("a failure without a name", 3);
  }
}

}  // namespace

int run(int argc, const char* const* argv) {
  std::vector<ManualCommand> manual;
  const Program program{"metastable", "Metastability of walking machines: the rimless wheel on a ramp",
                        commands(manual)};
  return run_program(program, manual, argc, argv);
}

int run(const Program& program, int argc, const char* const* argv) {
  std::vector<ManualCommand> manual;
  return run_program(program, manual, argc, argv);
}

}  // namespace metastable::reports
