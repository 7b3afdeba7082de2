#include "reports/command_line/walker_options.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "reports/command_line/option_values.h"

namespace metastable::reports {
namespace {

constexpr dynamics::Range walker_slopes{.low = 0, .high = 45, .low_open = true, .high_open = true};
constexpr dynamics::Range spacings{.low = 0.05, .high = 2};
constexpr dynamics::Range gigabytes{.low = 0.001, .high = 1e6};

std::size_t most_bytes(const Options& o) { return static_cast<std::size_t>(o.number("memory") * 0x1p30); }

bool asks_for_level_of_mesh(const Options& o) { return o.given("level") && o.text("level") == "mesh"; }

void refuse_what_walkers_lack(const Options& o, const std::vector<std::string>& own) {
  static const std::vector<std::string> all{"walker",          "slope",   "slopes", "slope-sd", "terrain", "memory",
                                            "simulated-steps", "spacing", "seed",   "threads",  "json",    "out"};
  for (const std::string& name : o.names())
    if (o.given(name) && std::ranges::find(all, name) == all.end() && std::ranges::find(own, name) == own.end())
      throw std::invalid_argument(fmt::format("--{}: has no meaning with --walker", name));
}

// @param solved  is not given
analysis::WalkerSetting base_setting(const Options& o, const std::string& solved = {}) {
  if (!o.given("slope-sd") && solved != "slope-sd") throw std::invalid_argument("--slope-sd: is needed with --walker");
  analysis::WalkerSetting setting;
  setting.walker = analysis::walker_from_name(o.text("walker"));
  setting.slope_deg = analysis::walker_slope_deg(setting.walker);
  if (o.given("terrain")) setting.terrain = analysis::terrain_from_name(o.text("terrain"));
  return setting;
}

WalkerRequest base_request(const Options& o, const std::string& command_line, const std::vector<std::string>& own) {
  WalkerRequest request;
  request.study = mesh_options(o, own);
  request.walks.seed = request.study.seed;
  request.walks.threads = request.study.threads;
  if (o.has("json")) request.json = o.text("json");
  if (o.has("out")) request.out = o.text("out");
  request.command = command_line;
  return request;
}

std::vector<double> slopes_in(const Options& o, const std::string& name) {
  std::vector<double> values = list_value(name, o.text(name));
  for (const double value : values)
    if (!walker_slopes.holds(value))
      throw std::invalid_argument(fmt::format("--{}: {} is outside {}", name, value, walker_slopes.text()));
  return values;
}

}  // namespace

void add_walker(Options& o, const std::string& sd, bool meshes) {
  o.group("Walkers on two legs (--walker)");
  o.add("walker", "simplest|compass|biped", "",
        "A walker on two legs instead of the wheel (simplest: lengths in legs, times in sqrt(l/g); biped: five links, "
        "in `steps --method splitting` and `simulate` alone); slopes then default to 0.009 rad, 3 and 1 deg, in " +
            walker_slopes.text());
  o.add("slope-sd", sd, "", "With --walker: sd of the slope from step to step [deg], in " + walker_slopes.text());
  o.add(
      "terrain", "fresh|facets", "",
      "With --walker: a plane that tilts anew at every step (default), or facets, on the last of which the feet still "
      "stand when a step begins");
  if (!meshes) return;
  o.add("spacing", "SD", "",
        "With --walker: of the coarsest mesh's nodes, in stationary sds of the noise (default: by dimension, 0.5, 0.7, "
        "1.0); the two or three finer ones follow by sqrt 2",
        spacings);
  o.add("simulated-steps", "N", "",
        "With --walker: about how many steps direct simulation takes beside, however rare failures are, 0..10^12, in "
        "10^7 walks to failure at most (default: 2000000; 0: none)");
  o.add("memory", "GB", "", "With --walker: most memory of its meshes (default: 3); what they would take is foreseen",
        gigabytes);
}

bool asks_for_walker(const Options& o) {
  if (o.given("walker")) return true;
  for (const char* name : {"slope-sd", "terrain", "spacing", "simulated-steps", "memory", "level"})
    if (o.has(name) && o.given(name))
      throw std::invalid_argument(fmt::format("--{}: has a meaning with --walker only", name));
  return false;
}

markov::MeshStudyOptions mesh_options(const Options& o, const std::vector<std::string>& own) {
  refuse_what_walkers_lack(o, own);
  markov::MeshStudyOptions study;
  study.seed = o.seed();
  if (o.has("threads")) study.threads = o.threads();
  if (o.has("memory") && o.given("memory")) study.most_bytes = most_bytes(o);
  if (o.has("spacing") && o.given("spacing")) study.spacing = o.number("spacing");
  if (o.has("simulated-steps") && o.given("simulated-steps"))
    study.simulated_steps = o.whole("simulated-steps", 0, 1000000000000);
  return study;
}

WalkerMethod walker_method(const Options& o) {
  if (!o.given("method")) {
    if (o.given("tolerance")) throw std::invalid_argument("--tolerance: has a meaning under --method splitting only");
    return WalkerMethod::mesh;
  }
  const std::string name = o.text("method");
  for (const auto& [known, method] :
       {std::pair("mesh", WalkerMethod::mesh), std::pair("splitting", WalkerMethod::splitting),
        std::pair("auto", WalkerMethod::both)}) {
    if (name != known) continue;
    const bool meshes = method != WalkerMethod::splitting;
    if (o.given("tolerance") && method == WalkerMethod::mesh)
      throw std::invalid_argument("--tolerance: has no meaning under --method mesh");
    if (!meshes && o.given("memory") && !asks_for_level_of_mesh(o))
      throw std::invalid_argument("--memory: has no meaning under --method splitting without --level mesh");
    for (const char* own : {"spacing", "simulated-steps"})
      if (!meshes && o.given(own))
        throw std::invalid_argument(fmt::format("--{}: has no meaning under --method splitting", own));
    return method;
  }
  throw std::invalid_argument(fmt::format("--method: '{}' is none of mesh, splitting, auto, which walkers have", name));
}

markov::SplittingOptions splitting_options(const Options& o) {
  markov::SplittingOptions splitting;
  splitting.seed = o.seed();
  splitting.threads = o.threads();
  if (o.given("tolerance")) splitting.tolerance = o.number("tolerance");
  if (o.given("memory")) splitting.level_bytes = most_bytes(o);
  return splitting;
}

void add_level(Options& o) {
  o.add(
      "level", "learnt|mesh", "learnt",
      "With --walker: what splitting splits by, the chance of failing as it learns it, in any dimension, or as a mesh "
      "has it, in up to four");
}

WalkerLevel walker_level(const Options& o, WalkerMethod method) {
  if (!o.given("level")) return WalkerLevel::learnt;
  if (method == WalkerMethod::mesh)
    throw std::invalid_argument("--level: has a meaning under --method splitting and auto only");
  return asks_for_level_of_mesh(o) ? WalkerLevel::mesh : WalkerLevel::learnt;
}

WalkerRequest walker_request(const Options& o, const std::string& command_line, std::vector<std::string> own) {
  WalkerRequest request = base_request(o, command_line, own);
  const analysis::WalkerSetting base = base_setting(o);
  const bool several = o.has("slopes");
  const std::string slope = several && !(o.has("slope") && o.given("slope")) ? "slopes" : "slope";
  std::vector<double> slopes = o.given(slope) ? slopes_in(o, slope) : std::vector<double>{base.slope_deg};
  std::vector<double> sds = slopes_in(o, "slope-sd");
  const std::size_t settings = std::max(slopes.size(), sds.size());
  for (auto* list : {&slopes, &sds})
    if (list->size() == 1) list->assign(settings, list->front());
  if (slopes.size() != sds.size())
    throw std::invalid_argument(fmt::format("--slope-sd: {} values for {} slopes", sds.size(), slopes.size()));
  if (!several && settings > 1) throw std::invalid_argument("--slope, --slope-sd: one number each expected");
  for (std::size_t i = 0; i < settings; ++i) {
    request.settings.push_back(base);
    request.settings.back().slope_deg = slopes[i];
    request.settings.back().slope_sd_deg = sds[i];
  }
  return request;
}

void require_walker_parameter(const std::string& name) {
  if (name != "slope" && name != "slope-sd")
    throw std::invalid_argument(fmt::format("PARAMETER: '{}' is none of slope, slope-sd, which a walker has", name));
}

analysis::WalkerSetting walker_solved_setting(const Options& o, const std::string& solved) {
  require_walker_parameter(solved);
  if (o.given(solved)) throw std::invalid_argument(fmt::format("--{}: is what is solved for", solved));
  analysis::WalkerSetting setting = base_setting(o, solved);
  for (const auto& [name, value] :
       {std::pair("slope", &setting.slope_deg), std::pair("slope-sd", &setting.slope_sd_deg)}) {
    if (!o.given(name)) continue;
    const std::vector<double> values = slopes_in(o, name);
    if (values.size() > 1) throw std::invalid_argument(fmt::format("--{}: one number expected", name));
    *value = values.front();
  }
  return setting;
}

WalkerRequest walker_sweep_request(const Options& o, const std::string& command_line) {
  WalkerRequest request = base_request(o, command_line, {});
  const analysis::WalkerSetting base = base_setting(o);
  request.slopes =
      o.given("slope") ? range_value("slope", o.text("slope"), walker_slopes) : std::vector<double>{base.slope_deg};
  request.slope_sds = range_value("slope-sd", o.text("slope-sd"), walker_slopes);
  for (const double slope : request.slopes)
    for (const double sd : request.slope_sds) {
      request.settings.push_back(base);
      request.settings.back().slope_deg = slope;
      request.settings.back().slope_sd_deg = sd;
    }
  return request;
}

}  // namespace metastable::reports
