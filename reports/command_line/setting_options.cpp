#include "reports/command_line/setting_options.h"

#include <fmt/format.h>

#include <limits>
#include <ranges>
#include <stdexcept>
#include <utility>

#include "dynamics/wheel/contact_law.h"
#include "dynamics/wheel/law_quantities.h"
#include "dynamics/wheel/ranges.h"
#include "reports/command_line/option_values.h"

namespace metastable::reports {
namespace range = dynamics::range;
namespace {

dynamics::Wheel wheel(const Options& options) {
  dynamics::Wheel wheel;
  wheel.leg_length = legs_value("legs", options.text("legs"), options.count("leg-count", 3, 1000));
  if (options.given("leg-count") && !is_one_length(options.text("legs")))
    throw std::invalid_argument(
        fmt::format("--leg-count: has a meaning where --legs is one length; it is '{}'", options.text("legs")));
  wheel.hub_mass = options.number("mass");
  if (options.given("inertia")) wheel.inertia = options.number("inertia");
  if (options.given("radius-of-gyration")) wheel.radius_of_gyration = options.number("radius-of-gyration");
  wheel.tip_radius = options.number("tip-radius");
  if (options.has("gravity")) {
    wheel.ramp_stiffness = options.number("ramp-stiffness");
    if (options.given("contact-mass")) wheel.contact_mass = options.number("contact-mass");
    wheel.gravity = options.number("gravity");
  }
  wheel.validate();
  const dynamics::Law law =
      options.has("law") ? dynamics::law_from_name(options.text("law")) : dynamics::Law::published;
  for (const auto& [name, objection] : {std::pair("inertia", dynamics::inertia_objection(wheel)),
                                        std::pair("radius-of-gyration", dynamics::gyration_objection(wheel, law))})
    if (!objection.empty()) throw std::invalid_argument(fmt::format("--{}: {}", name, objection));
  return wheel;
}

// Lists what some laws only know. --contact-list stands for eta and mu together.
constexpr std::pair<const char*, dynamics::LawQuantity> of_some_laws[] = {
    {"restitution", dynamics::LawQuantity::restitution},
    {"friction", dynamics::LawQuantity::friction},
    {"correlation", dynamics::LawQuantity::friction},
    {"contact-list", dynamics::LawQuantity::friction},
    {"restitution-mean", dynamics::LawQuantity::restitution},
    {"restitution-sd", dynamics::LawQuantity::restitution},
    {"friction-mean", dynamics::LawQuantity::friction},
    {"friction-sd", dynamics::LawQuantity::friction},
    {"rebound-lost", dynamics::LawQuantity::rebound_lost},
    {"radius-of-gyration", dynamics::LawQuantity::radius_of_gyration},
    {"tip-radius", dynamics::LawQuantity::tip_radius},
    {"ramp-stiffness", dynamics::LawQuantity::ramp_stiffness},
    {"contact-mass", dynamics::LawQuantity::contact_mass}};

void check_law(const Options& options, dynamics::Law law) {
  for (const auto& [name, quantity] : of_some_laws) {
    if (!options.has(name) || !options.given(name) || dynamics::uses(law, quantity)) continue;
    if (options.value(name) == "RANGE") continue;  // an axis of a sweep is refused where it is read
    // A folder states the wheel's r_g under any law: the effect slip_reversal takes it.
    if (quantity == dynamics::LawQuantity::radius_of_gyration && options.has("reality")) continue;
    throw std::invalid_argument(
        fmt::format("--{}: has a meaning under --law {} only", name,
                    fmt::join(dynamics::laws_with(quantity) | std::views::transform(dynamics::law_name), ", ")));
  }
}

// Checks before the launch is asked for: a slope that no launch can save is named so.
void check_slope(const char* option, const analysis::Setting& setting) {
  const dynamics::Range range = dynamics::slope_range(setting.wheel.legs());
  if (!range.holds(setting.slope_deg))
    throw std::invalid_argument(fmt::format("--{}: {:.6g} deg is outside {} deg (below half the angle between legs)",
                                            option, setting.slope_deg, range.text()));
}

constexpr dynamics::Range between_zero_and_one{.low = 0, .high = 1, .low_open = true, .high_open = true};
constexpr dynamics::Range shares{.low = 0, .high = 1};
constexpr dynamics::Range correlations{.low = -1, .high = 1, .low_open = true, .high_open = true};
constexpr dynamics::Range not_negative{.low = 0};
constexpr dynamics::Range tails{.low = 1e-300, .high = 1e-3};

// Checks what can be checked before any work: ranges live with the quantities they belong to.
analysis::Setting checked(analysis::Setting setting) {
  setting.validate();
  return setting;
}

}  // namespace

void add_slope(Options& options) {
  options.group("Ramp and launch");
  options.add("slope", "DEG", "7.02", "Ramp slope [deg], from 0.001 to below half the angle between legs");
}

void add_launch(Options& options, const std::string& whose) {
  options.group("Ramp and launch");
  options.add("initial-speed", "MEAN,SD|steady", "",
              whose +
                  "; steady: of wheels that still roll long after any launch (default: the paper's at 7.02 and 9.59, "
                  "elsewhere steady)",
              range::speed);
}

void add_stated_wheel(Options& options) {
  options.group("Wheel");
  options.add("legs", "paper|L|L1,L2,...", "paper",
              "Leg lengths [m]: the paper's, one for all, or a list in landing order", range::leg_length);
  options.add("leg-count", "N", "8", "Number of legs when --legs is one length, 3..1000");
  options.add("mass", "KG", "1.39", "Hub mass M [kg]", range::mass);
  options.add("inertia", "KGM2", "",
              "About the stance foot [kg m^2], from M (mean L)^2 to ten times that (default: M (mean L)^2; under "
              "the other laws plus M r_g^2)");
  options.add(
      "radius-of-gyration", "M", "",
      "About the hub [m], at most three mean legs, above 0 under settled (coulomb, plastic, settled; default: 0.05, "
      "0 under plastic)",
      range::radius_of_gyration);
  options.add("tip-radius", "M", "0", "Of the legs' round tips [m], at most a twentieth of the shortest leg (settled)",
              range::tip_radius);
}

void add_wheel(Options& options) {
  add_stated_wheel(options);
  options.add("ramp-stiffness", "N/M", "9000", "Stiffness of the ramp K_r [N/m] (published)", range::ramp_stiffness);
  options.add(
      "contact-mass", "KG", "",
      "Mass in the spring and damper of a contact, equation 25 of the paper [kg] (published; default: the hub mass)",
      range::mass);
  options.add("gravity", "M/S2", "9.81", "Gravity g [m/s^2]", range::gravity);
}

void add_stated_contact(Options& options) {
  options.group("Contacts and their law");
  options.add("law", "published|coulomb|plastic|settled", "published", "Contact law");
  options.add("restitution", "MEAN,SD", "0.4,0.1",
              "eta, normal truncated to [0, 1] ([0, 0.95] under settled); SD 0 or MEAN alone: constant",
              range::restitution);
  options.add("friction", "MEAN,SD", "0.4,0.1", "mu, normal truncated to [0, inf)", range::friction);
}

void add_contact(Options& options) {
  add_stated_contact(options);
  options.add("rebound-lost", "SHARE", "0", "Share of the rebound's energy lost in hops (coulomb)", shares);
  options.add("correlation", "RHO", "0", "Correlation of eta and mu (of the normals that they are drawn by)",
              correlations);
  options.add("contact-list", "FILE", "", "CSV 'restitution,friction': draw pairs from a list instead");
}

void add_course(Options& options) {
  options.group("Ramp and launch");
  options.add("ramp-length", "M", "3.66", "Ramp length [m], inf: without end", range::ramp_length);
  options.add("first-leg", "I", "0", "Leg that lands at collision 1, from 0 to the number of legs less one");
}

void add_study(Options& options, bool walkers) {
  options.group("Method and accuracy");
  options.add("method", walkers ? "sampled|integrated|mesh|splitting|auto" : "sampled|integrated", "sampled",
              std::string("How rows are made: by sampling eta and mu per cell, or by quadrature over them (independent "
                          "eta, mu)") +
                  (walkers ? ". With --walker: on meshes (default), by splitting, which takes any dimension, or auto: "
                             "by both, held against each other"
                           : ""));
  options.add("cells", "N", "", "Cells per landing leg, 8..4096 (default: refined until the tolerance is met)");
  options.add("samples", "S", "",
              "Draws per cell and replicate, 16..16777216 (default: raised until the tolerance is met)");
  options.add("tolerance", "REL", "0.01", "Half-width of the 95 % interval of the expected steps, relative",
              between_zero_and_one);
  options.add("sequence", "sobol|random", "sobol", "Where the draws come from");
  options.add("draws", "weighted|plain", "weighted", "Weighted draws cover the tails; plain ones see what is frequent");
  options.add("tail", "P", "1e-30", "Tail probability the weighted draws reach", tails);
  options.add("replicates", "R", "8", "Independent randomisations behind the interval, 2..64");
  options.add("mixing-distance", "D", "0.05", "Total variation distance that counts as mixed", between_zero_and_one);
  options.add("eigenvalues", "K", "6", "How many eigenvalue moduli to report, 1..64");
  options.add_seed();
  options.add_threads();
}

// Reads all but slope and launch speed.
analysis::Setting common_setting(const Options& options, const Pairs& pairs) {
  analysis::Setting setting;
  setting.wheel = wheel(options);
  setting.law = dynamics::law_from_name(options.text("law"));
  check_law(options, setting.law);
  for (const auto& [name, member] :
       {std::pair("restitution", &analysis::Setting::restitution), std::pair("friction", &analysis::Setting::friction)})
    setting.*member = options.text(name).empty() ? analysis::Spread{} : options.spread(name);
  if (options.has("correlation")) {
    setting.rebound_lost = options.number("rebound-lost");
    setting.correlation = options.number("correlation");
  }
  if (options.has("contact-list") && options.given("contact-list")) {
    if (options.given("restitution") || options.given("friction") || options.given("correlation"))
      throw std::invalid_argument("--contact-list: excludes --restitution, --friction and --correlation");
    setting.pairs = pairs ? *pairs : contact_list(options.text("contact-list"));
  }
  setting.ramp_length =
      options.text("ramp-length") == "inf" ? std::numeric_limits<double>::infinity() : options.number("ramp-length");
  setting.first_landing_leg = options.count("first-leg", 0, setting.wheel.legs() - 1);
  return setting;
}

void set_launch(analysis::Setting& setting, const std::optional<std::string>& text) {
  const std::optional<analysis::Spread> paper = analysis::paper_launch(setting.slope_deg);
  setting.steady_launch = text ? *text == "steady" : !paper;
  if (setting.steady_launch) return;
  setting.initial_speed = text ? spread_value("initial-speed", *text, range::speed) : *paper;
}

analysis::Setting one_setting(const Options& options, const Pairs& pairs, const char* slope_option) {
  analysis::Setting setting = common_setting(options, pairs);
  setting.slope_deg = options.number("slope");
  check_slope(slope_option, setting);
  std::optional<std::string> launch;
  if (options.given("initial-speed")) launch = options.text("initial-speed");
  set_launch(setting, launch);
  if (setting.correlation != 0 && (setting.restitution.sd == 0 || setting.friction.sd == 0))
    throw std::invalid_argument("--correlation: has a meaning where --restitution and --friction both have an sd");
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
    check_slope("slopes", setting);
    set_launch(setting, launches.empty() ? std::nullopt : std::optional(launches[i]));
    settings.push_back(checked(std::move(setting)));
  }
  return settings;
}

namespace {

constexpr std::size_t most_compared = 100;  // settings

// The options of which several values make several settings, the first varying slowest; the others of the wheel
// are given once more for a further value.
const std::vector<std::string> compared_by_commas{
    "slope",       "law",       "leg-count",        "mass",           "inertia",       "radius-of-gyration",
    "tip-radius",  "gravity",   "ramp-stiffness",   "contact-mass",   "rebound-lost",  "correlation",
    "ramp-length", "first-leg", "restitution-mean", "restitution-sd", "friction-mean", "friction-sd"};
const std::vector<std::string> compared_by_repetition{"legs", "restitution", "friction", "contact-list",
                                                      "initial-speed"};

// Holds the values of one option.
struct Varied {
  std::string name;
  std::vector<std::string> values;
};

// Puts a mean or an sd into the spread that it belongs to.
void put_moment(const std::string& name, Options& one) {
  if (!one.given(name)) return;
  const std::string spread = name.substr(0, name.find('-'));
  if (one.given("contact-list"))
    throw std::invalid_argument(fmt::format("--{}: cannot vary with --contact-list", name));
  const double value = one.number(name);
  analysis::Spread both = one.spread(spread);
  (name.ends_with("-mean") ? both.mean : both.sd) = value;
  one.give(spread, {fmt::format("{},{}", both.mean, both.sd)});
}

// Takes off what this law does not know where another of the laws does. @returns whether that leaves a setting that no
// other combination stands for
bool drop_unknown(const std::vector<Varied>& varied, const std::vector<std::size_t>& at, Options& one) {
  const dynamics::Law law = dynamics::law_from_name(one.text("law"));
  for (const auto& [name, quantity] : of_some_laws) {
    if (dynamics::uses(law, quantity)) continue;
    one.give(name, {});
    for (std::size_t v = 0; v < varied.size(); ++v)
      if (varied[v].name == name && at[v] > 0) return false;
  }
  return true;
}

std::vector<Varied> varied_options(const Options& options) {
  std::vector<Varied> varied;
  const auto add = [&](const std::string& name, std::vector<std::string> values) {
    if (values.size() > 1) varied.push_back({name, std::move(values)});
  };
  for (const std::string& name : compared_by_commas)
    if (name != "slope") add(name, options.values(name));
  for (const std::string& name : compared_by_repetition)
    if (name != "initial-speed") add(name, options.values(name));
  return varied;
}

// Returns the slopes that are compared; the two of the paper where nothing else is.
std::vector<std::string> compared_slopes(const Options& options, bool alone) {
  if (options.given("slope") && options.given("slopes"))
    throw std::invalid_argument("--slope: is one of --slopes; give one of the two");
  if (options.given("slope")) return options.values("slope");
  if (!options.given("slopes") && !alone) return {options.text("slope")};
  std::vector<std::string> slopes;
  for (const double slope : list_value("slopes", options.text("slopes"))) slopes.push_back(fmt::format("{}", slope));
  return slopes;
}

}  // namespace

void add_compared(Options& options) {
  options.group("Contacts and their law");
  options.add("restitution-mean", "MEAN", "", "Mean of eta, in the place of that of --restitution", range::restitution);
  options.add("restitution-sd", "SD", "", "Sd of eta, likewise", range::restitution);
  options.add("friction-mean", "MEAN", "", "Mean of mu, in the place of that of --friction", range::friction);
  options.add("friction-sd", "SD", "", "Sd of mu, likewise", range::friction);
  options.take_several(compared_by_commas);
}

std::vector<analysis::Setting> compared_settings(const Options& options) {
  std::vector<Varied> varied = varied_options(options);
  const std::vector<std::string>& launches = options.all("initial-speed");
  const std::vector<std::string> slopes = compared_slopes(options, varied.empty() && launches.size() < 2);
  if (slopes.size() < 2 && varied.empty() && launches.size() < 2)
    throw std::invalid_argument(
        fmt::format("--{}: {} given where at least 2 are needed, or several values of another option",
                    options.given("slope") ? "slope" : "slopes", slopes.size()));
  if (slopes.size() > 1 && !launches.empty() && launches.size() != slopes.size())
    throw std::invalid_argument(fmt::format("--initial-speed: {} values for {} slopes (give it once a slope, in order)",
                                            launches.size(), slopes.size()));
  varied.insert(varied.begin(), {"slope", slopes});
  if (slopes.size() == 1 && launches.size() > 1) varied.push_back({"initial-speed", launches});
  std::size_t size = 1;
  for (const Varied& one : varied)
    if ((size *= one.values.size()) > most_compared)
      throw std::invalid_argument(fmt::format("compare: more than {} combinations of values", most_compared));
  const bool laws = options.values("law").size() > 1;
  std::vector<analysis::Setting> settings;
  for (std::size_t index = 0; index < size; ++index) {
    Options one = options;
    std::vector<std::size_t> at(varied.size());
    for (std::size_t v = varied.size(), left = index; v-- > 0; left /= varied[v].values.size())
      one.give(varied[v].name, {varied[v].values[at[v] = left % varied[v].values.size()]});
    if (slopes.size() > 1 && !launches.empty()) one.give("initial-speed", {launches[at.front()]});
    if (laws && !drop_unknown(varied, at, one)) continue;
    check_law(one, dynamics::law_from_name(one.text("law")));
    for (const char* name : {"restitution-mean", "restitution-sd", "friction-mean", "friction-sd"})
      put_moment(name, one);
    settings.push_back(one_setting(one, {}, options.given("slope") ? "slope" : "slopes"));
  }
  return settings;
}

analysis::StudyOptions study_options(const Options& options) {
  analysis::StudyOptions study;
  study.method = analysis::method_from_name(options.text("method"));
  for (const char* name : {"samples", "sequence", "draws", "tail", "replicates"})
    if (options.given(name) && study.method != analysis::Method::sampled)
      throw std::invalid_argument(fmt::format("--{}: has a meaning under --method sampled only", name));
  if (options.given("cells")) study.cells = options.whole("cells", 8, 4096);
  if (options.given("samples")) study.samples = options.whole("samples", 16, 1u << 24);
  study.tolerance = options.number("tolerance");
  study.sequence = options.text("sequence") == "sobol" ? markov::Sequence::sobol : markov::Sequence::random;
  study.weighting = options.text("draws") == "weighted" ? markov::Weighting::weighted : markov::Weighting::plain;
  if (study.weighting == markov::Weighting::plain && options.given("tail"))
    throw std::invalid_argument("--tail: plain draws have none; --draws weighted reaches it");
  study.tail = options.number("tail");
  study.replicates = options.count("replicates", 2, 64);
  study.mixing_distance = options.number("mixing-distance");
  study.eigenvalues = options.count("eigenvalues", 1, 64);
  study.seed = options.seed();
  study.threads = options.threads();
  study.validate();
  return study;
}

void add_standard_errors(Options& options) {
  options.group("Standard errors of what was measured");
  options.add("slope-se", "DEG", "", "Standard error of each slope: an interval from it is given apart; likewise below",
              not_negative);
  options.add("restitution-se", "MEAN,SD", "", "Of the mean of eta, and of its sd", not_negative);
  options.add("friction-se", "MEAN,SD", "", "Of the mean of mu, and of its sd", not_negative);
  options.add("legs-se", "M", "", "Of the leg length, common to all legs [m]", not_negative);
  options.add("inertia-se", "KGM2", "", "Of the inertia about the stance foot [kg m^2]", not_negative);
  options.add("radius-of-gyration-se", "M", "", "Of the radius of gyration [m] (coulomb, plastic, settled)",
              not_negative);
  options.add("ramp-stiffness-se", "N/M", "", "Of the ramp's stiffness [N/m] (published)", not_negative);
  options.add("contact-mass-se", "KG", "", "Of the contact mass [kg] (published)", not_negative);
}

std::vector<analysis::StandardError> standard_errors(const Options& options, const analysis::Setting& setting) {
  using analysis::Parameter;
  std::vector<analysis::StandardError> errors;
  const auto add = [&](Parameter parameter, double value) {
    if (value != 0) errors.push_back({parameter, value});
  };
  const auto one = [&](const char* name, Parameter parameter) {
    if (options.given(name)) add(parameter, options.number(name));
  };
  const auto both = [&](const char* name, Parameter mean, Parameter sd) {
    if (!options.given(name)) return;
    const analysis::Spread given = options.spread(name);
    add(mean, given.mean);
    add(sd, given.sd);
  };
  one("slope-se", Parameter::slope);
  both("restitution-se", Parameter::restitution_mean, Parameter::restitution_sd);
  both("friction-se", Parameter::friction_mean, Parameter::friction_sd);
  one("legs-se", Parameter::leg_length);
  one("inertia-se", Parameter::inertia);
  one("radius-of-gyration-se", Parameter::radius_of_gyration);
  one("ramp-stiffness-se", Parameter::ramp_stiffness);
  one("contact-mass-se", Parameter::contact_mass);
  analysis::check_standard_errors(setting, errors);
  return errors;
}

}  // namespace metastable::reports
