#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <iterator>
#include <sstream>
#include <stdexcept>

#include "analysis/experiment/suggestion.h"
#include "dynamics/wheel/contact_law.h"
#include "dynamics/wheel/law_quantities.h"
#include "dynamics/wheel/ranges.h"
#include "reports/command_line/command.h"
#include "reports/command_line/option_values.h"
#include "reports/command_line/setting_options.h"
#include "reports/experiment_commands/import_command.h"
#include "reports/output/input_file.h"

namespace metastable::reports {
namespace {

constexpr const char* details = R"(What it needs
  FILE: a CSV with a header, long (a row a collision) or wide (a row a trial), or a MAT file (versions 4 to 7.3).
  --columns WHAT=NAME or WHAT=NAME[UNIT], with commas between. WHAT is one of
    trial        its number in the order the trials were run (or a name, with --number-trials)
    collision    its number within the trial (default: counted in the order of the rows)
    omega_minus  speed just before the collision, in rad/s, deg/s, rpm or rev/s; the one that is needed
    omega_plus   speed just after it
    leg          the leg that lands            time      in s, ms, us or min
    position     of the foot, in m, cm or mm   condition, outcome
    angle        instead of speeds: the wheel's angle over time, in rad, deg or rev ('metastable collisions' goes on)
  A unit may end the name (omega_deg_s, 'omega [deg/s]') or stand in a row of its own behind the header; where it is told nowhere the column is refused. A time may be counted in frames: time=frame[1/120 s].
  Columns named as in an experiment folder (trial, omega_minus_rad_s, ...) need no entry.
  Walks (--walker): trial, step, phase (the leg that stands, 1 or 2), half_angle (the one that is needed), stance_rate, swing_rate, time, position, condition, outcome.
  Separator, decimal commas, lines before the header and a row of units are found where they are plain, and said.
  Wide: a * stands for the number of the collision or step: omega_minus=w_*[deg/s]. A trial ends at the row's last value.
  MAT: struct arrays (omega_minus=trials.w[deg/s], or lab.trials.w of a struct in a struct), cell arrays, matrices padded with NaN (with --trials-in), or vectors with one that tells the trials.
  What data cannot tell: --description with an experiment.toml, or --slope (or --conditions), --legs, --mass, --ramp-length, --law and, unless the law is plastic, --restitution and --friction. Of walks: --walker and --slope-sd.)";

constexpr const char* examples[] = {R"(printf '%s\n' run,omega_deg_s 1,333 1,327 1,321 2,339 2,283 > runs.csv)",
                                    R"(metastable import runs.csv --columns trial=run,omega_minus=omega_deg_s \
    --slope 9.59 --legs paper --mass 1.39 --ramp-length 3.66 \
    --law settled --restitution 0.4,0.1 --friction 0.4,0.1 --out runs)",
                                    R"(metastable import wide.csv --columns 'omega_minus=w_*[rad/s]' --slope 9.59 \
    --legs paper --mass 1.39 --ramp-length 3.66 --law coulomb \
    --restitution 0.5,0.05 --friction 0.4,0.05 --out wheel)",
                                    R"(metastable import lab.mat --columns 'omega_minus=trials.w[deg/s]' \
    --description wheel.toml --out wheel)",
                                    R"(metastable import walks.csv --walker compass --slope-sd 0.3 \
    --columns 'trial=run,half_angle=theta[deg],stance_rate=rate[deg/s]' \
    --errors half_angle=0.0005 --out walks)"};

constexpr const char* wheel_only[] = {"conditions",         "legs",       "leg-count",   "mass",        "inertia",
                                      "radius-of-gyration", "tip-radius", "law",         "restitution", "friction",
                                      "ramp-length",        "first-leg",  "sensor-noise"};
constexpr const char* stated[] = {"legs", "mass", "ramp-length", "law", "restitution", "friction"};

void declare_import(Options& o) {
  o.add_place("FILE", "CSV or MAT file");
  o.group("The file");
  o.add("columns", "WHAT=NAME,...", "", "Which column or variable tells what, see below");
  o.add("separator", "','|';'|tab", "", "Between the fields of a CSV (default: found)");
  o.add("decimal", "point|comma", "", "Before the decimals of a CSV's numbers (default: found)");
  o.add("skip-rows", "N", "", "Lines of a CSV before its header, 0..1000000 (default: found)");
  o.add_flag("units-row", "A row of units follows the CSV's header (default: found)");
  o.add("trials-in", "columns|rows", "", "Of a matrix in a MAT file: each column, or each row, is a trial");
  o.add("collisions-from", "0|1", "1", "What the file calls the first collision or step");
  o.add("legs-from", "0|1", "0", "What the file calls the first leg (of walks: default 1)");
  o.add("outcomes", "rest=WORD,...", "",
        "The file's words for rest, end_of_ramp and max_collisions, of walks for failed, stopped and lost; a word may "
        "be a number");
  o.add_flag("number-trials", "Number the trials in the order of their first rows, whatever the file calls them");
  o.group("What the file does not tell");
  o.add("description", "FILE", "", "experiment.toml to take; otherwise all of the following state it");
  o.add("slope", "DEG", "", "Ramp slope [deg] of all trials, from 0.001 to below half the angle between legs");
  o.add("conditions", "ID=DEG,...", "", "Instead: the slope of each condition");
  add_stated_wheel(o), add_stated_contact(o), add_course(o);
  for (const char* name : stated) o.drop_default(name);
  o.group("What the file does not tell");
  o.add("sensor-noise", "SD", "", "Believed noise of the speeds [rad/s]", dynamics::range::speed);
  o.add("title", "TEXT", "", "Of the experiment (default: the file's name)");
  o.group("Walkers on two legs (--walker)");
  o.add("walker", "simplest|compass", "",
        "The file tells walks of this walker; slopes then default to 0.009 rad, 3 deg");
  o.add("slope-sd", "DEG", "", "With --walker: sd of the slope from step to step [deg], in (0, 45)");
  o.add("errors", "WHAT=SD,...", "",
        "With --walker: sd of the error of a measured value [rad, rad/s], in (0, 1000]; what is not stated is fitted");
  o.group("Files and help");
  o.add("out", "DIR", "", "Folder to create (must not hold an experiment yet)");
  o.add_json();
}

char separator_value(const std::string& text) {
  if (text == "tab" || text == "\t") return '\t';
  if (text == "," || text == ";") return text.front();
  throw std::invalid_argument(fmt::format("--separator: '{}' is none of ',', ';' and tab", text));
}

// Reads "a=b,c=d" as pairs.
std::vector<std::pair<std::string, std::string>> pairs_value(const char* name, const std::string& text) {
  std::vector<std::pair<std::string, std::string>> pairs;
  std::istringstream stream(text);
  for (std::string entry; std::getline(stream, entry, ',');) {
    const std::size_t equals = entry.find('=');
    if (equals == std::string::npos || equals == 0 || equals + 1 == entry.size())
      throw std::invalid_argument(fmt::format("--{}: '{}' is not of the form NAME=VALUE", name, entry));
    pairs.emplace_back(entry.substr(0, equals), entry.substr(equals + 1));
  }
  return pairs;
}

// Refuses every option that states what a description would.
void check_description_alone(const Options& o) {
  std::vector<std::string> told(std::begin(wheel_only), std::end(wheel_only));
  told.insert(told.end(), {"slope", "title", "walker", "slope-sd", "errors"});
  for (const std::string& name : told)
    if (o.given(name)) throw std::invalid_argument(fmt::format("--{}: is what --description says", name));
}

void read_statement(const Options& o, ImportRequest& request) {
  std::vector<std::string> missing;
  if (!o.given("slope") && !o.given("conditions")) missing.push_back("--slope (or --conditions)");
  for (const std::string name : stated) {
    const bool contact = name == "restitution" || name == "friction";
    if (o.given(name) || (contact && o.text("law") == dynamics::law_name(dynamics::Law::plastic))) continue;
    missing.push_back("--" + name);
  }
  if (!missing.empty())
    throw std::invalid_argument(
        fmt::format("import: data do not tell wheel, contact and ramp: --description FILE states them (an "
                    "experiment.toml), or these, of which {} missing: {}",
                    missing.size() == 1 ? "one is" : "some are", fmt::join(missing, ", ")));
  if (o.given("slope") && o.given("conditions"))
    throw std::invalid_argument("--slope: is what --conditions says of each condition");
  request.setting = common_setting(o);
  request.first_leg_stated = o.given("first-leg");
  const auto checked = [&](const char* name, const std::string& text) {
    const double slope = number_value(name, text, dynamics::slope_range(request.setting.wheel.legs()));
    return slope;
  };
  if (o.given("slope")) request.setting.slope_deg = checked("slope", o.text("slope"));
  for (const auto& [id, slope] : pairs_value("conditions", o.text("conditions")))
    request.slopes.emplace_back(id, checked("conditions", slope));
  if (o.given("sensor-noise")) request.sensor_noise = o.number("sensor-noise");
  request.title = o.given("title") ? o.text("title") : request.file;
}

// Reads what is stated of a walker. @throws std::invalid_argument for what walkers lack
void read_walker(const Options& o, ImportRequest& request) {
  constexpr dynamics::Range slopes{.low = 0, .high = 45, .low_open = true, .high_open = true};
  constexpr dynamics::Range sds{.low = 0, .high = 1000, .low_open = true};
  for (const char* name : wheel_only)
    if (o.given(name)) throw std::invalid_argument(fmt::format("--{}: has no meaning with --walker", name));
  if (!o.given("slope-sd")) throw std::invalid_argument("--slope-sd: is needed with --walker");
  analysis::WalkerSetting& walker = request.walker.emplace();
  walker.walker = analysis::walker_from_name(o.text("walker"));
  walker.slope_deg =
      o.given("slope") ? number_value("slope", o.text("slope"), slopes) : analysis::walker_slope_deg(walker.walker);
  walker.slope_sd_deg = number_value("slope-sd", o.text("slope-sd"), slopes);
  for (const auto& [name, sd] : pairs_value("errors", o.text("errors"))) {
    analysis::require_word("--errors", name, {"half_angle", "stance_rate", "swing_rate"});
    const Role role = column_requests(name + "=-", Subject::walks).front().role;
    if (std::ranges::find(request.errors, role, &std::pair<Role, double>::first) != request.errors.end())
      throw std::invalid_argument(fmt::format("--errors: {} is given twice", name));
    request.errors.emplace_back(role, number_value("errors", sd, sds));
  }
  request.title = o.given("title") ? o.text("title") : request.file;
}

void import_as_asked(const Options& o, const std::string& line) {
  ImportRequest request;
  request.file = o.text("FILE");
  request.out = o.text("out");
  if (request.out.empty()) throw std::invalid_argument("--out: a folder must be given");
  request.json = o.text("json");
  request.command = line;
  request.description = o.text("description");
  if (o.given("walker") || (!request.description.empty() && analysis::states_walks(read_file(request.description))))
    request.subject = Subject::walks;
  const bool walks = request.subject == Subject::walks;
  for (const char* name : {"slope-sd", "errors"})
    if (o.given(name) && !o.given("walker"))
      throw std::invalid_argument(fmt::format("--{}: has a meaning with --walker only", name));
  request.columns = column_requests(o.text("columns"), request.subject);
  if (o.given("separator")) request.form.separator = separator_value(o.text("separator"));
  if (o.given("decimal")) {
    analysis::require_word("--decimal", o.text("decimal"), {"point", "comma"});
    request.form.decimal = o.text("decimal") == "comma" ? ',' : '.';
  }
  if (o.given("skip-rows")) request.form.skip_rows = static_cast<std::size_t>(o.count("skip-rows", 0, 1000000));
  request.form.units_row = o.flag("units-row");
  const std::string lie = o.text("trials-in");
  request.orientation = lie.empty() ? TrialsIn::not_told : lie == "columns" ? TrialsIn::columns : TrialsIn::rows;
  request.number_trials = o.flag("number-trials");
  request.collisions_from = o.count("collisions-from", 0, 1);
  request.legs_from = walks && !o.given("legs-from") ? 1 : o.count("legs-from", 0, 1);
  for (const auto& [outcome, word] : pairs_value("outcomes", o.text("outcomes"))) {
    analysis::require_word("--outcomes", outcome, outcome_names(request.subject));
    if (!request.outcomes.emplace(word, outcome).second)
      throw std::invalid_argument(fmt::format("--outcomes: '{}' stands for two outcomes", word));
  }
  if (!request.description.empty())
    check_description_alone(o);
  else if (walks)
    read_walker(o, request);
  else
    read_statement(o, request);
  run_import(request);
}

}  // namespace

Command import_command() {
  return {"import",       "A CSV (long or wide) or MAT file of trials to an experiment folder",
          declare_import, import_as_asked,
          details,        {std::begin(examples), std::end(examples)}};
}

}  // namespace metastable::reports
