#include <fmt/format.h>
#include <fmt/ranges.h>

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
  Separator, decimal commas, lines before the header and a row of units are found where they are plain, and said.
  Wide: a * stands for the collision's number: omega_minus=w_*[deg/s]. A trial ends at the row's last value.
  MAT: struct arrays (omega_minus=trials.w[deg/s], or lab.trials.w of a struct in a struct), cell arrays, matrices padded with NaN (with --trials-in), or vectors with one that tells the trials.
  What data cannot tell: --description with an experiment.toml, or --slope (or --conditions), --legs, --mass, --ramp-length, --law and, unless the law is plastic, --restitution and --friction.)";

constexpr const char* examples[] = {R"(printf '%s\n' run,omega_deg_s 1,333 1,327 1,321 2,339 2,283 > runs.csv)",
                                    R"(metastable import runs.csv --columns trial=run,omega_minus=omega_deg_s \
    --slope 9.59 --legs paper --mass 1.39 --ramp-length 3.66 \
    --law settled --restitution 0.4,0.1 --friction 0.4,0.1 --out runs)",
                                    R"(metastable import wide.csv --columns 'omega_minus=w_*[rad/s]' --slope 9.59 \
    --legs paper --mass 1.39 --ramp-length 3.66 --law coulomb \
    --restitution 0.5,0.05 --friction 0.4,0.05 --out wheel)",
                                    R"(metastable import lab.mat --columns 'omega_minus=trials.w[deg/s]' \
    --description wheel.toml --out wheel)"};

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
  o.add("collisions-from", "0|1", "1", "What the file calls the first collision");
  o.add("legs-from", "0|1", "0", "What the file calls the first leg");
  o.add("outcomes", "rest=WORD,...", "",
        "The file's words for rest, end_of_ramp and max_collisions; a word may be a number");
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
  for (const char* name :
       {"slope", "conditions", "legs", "leg-count", "mass", "inertia", "radius-of-gyration", "tip-radius", "law",
        "restitution", "friction", "ramp-length", "first-leg", "sensor-noise", "title"})
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

void import_as_asked(const Options& o, const std::string& line) {
  ImportRequest request;
  request.file = o.text("FILE");
  request.out = o.text("out");
  if (request.out.empty()) throw std::invalid_argument("--out: a folder must be given");
  request.json = o.text("json");
  request.command = line;
  request.columns = column_requests(o.text("columns"));
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
  request.legs_from = o.count("legs-from", 0, 1);
  for (const auto& [outcome, word] : pairs_value("outcomes", o.text("outcomes"))) {
    analysis::require_word("--outcomes", outcome, {"rest", "end_of_ramp", "max_collisions"});
    if (!request.outcomes.emplace(word, outcome).second)
      throw std::invalid_argument(fmt::format("--outcomes: '{}' stands for two outcomes", word));
  }
  request.description = o.text("description");
  if (request.description.empty())
    read_statement(o, request);
  else
    check_description_alone(o);
  run_import(request);
}

}  // namespace

Command import_command() {
  return {"import",       "A CSV (long or wide) or MAT file of trials to an experiment folder",
          declare_import, import_as_asked,
          details,        {std::begin(examples), std::end(examples)}};
}

}  // namespace metastable::reports
