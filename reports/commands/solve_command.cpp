#include "reports/commands/solve_command.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "analysis/sensitivity/sweep.h"
#include "reports/output/interrupt.h"
#include "reports/output/output_file.h"
#include "reports/output/standard_output.h"
#include "reports/output/version.h"
#include "reports/study/walker_text.h"

namespace metastable::reports {
namespace {

using analysis::Answered;
using analysis::Solution;
using analysis::Target;
using SolveJson = nlohmann::ordered_json;

constexpr double looks_a_crossing = 12;  // about, for the progress line

// Tells of the table that the points share, and then of points looked at, from any thread.
class Looking {
 public:
  Looking(BeginPart begin, std::size_t points)
      : begin_(std::move(begin)), all_(static_cast<double>(points) + looks_a_crossing) {}
  void tabulating(double share) {
    const std::scoped_lock lock(mutex_);
    part("table of landings")(share, "");
  }
  void looked_at(std::size_t points) {
    const std::scoped_lock lock(mutex_);
    looked_at_ = static_cast<double>(points);
    part("solve")(std::min(0.99, looked_at_ / all_), "");
  }
  void still() {
    const std::scoped_lock lock(mutex_);
    part("solve")(std::min(0.99, looked_at_ / all_), "");
  }

 private:
  const Tell& part(const char* name) {
    if (name_ != name) tell_ = begin_(name_ = name);
    return tell_;
  }

  BeginPart begin_;
  std::string name_;
  Tell tell_;
  std::mutex mutex_;
  double all_, looked_at_ = 0;
};

Answered walker_answer(const SolveRequest& request, const analysis::WalkerSetting& setting, int threads,
                       Looking& looking) {
  markov::MeshStudyOptions meshes = request.meshes;
  meshes.threads = threads;
  try {
    const markov::MeshStudy passage =
        agreed_walker(setting, meshes, [&](double, const std::string&) { looking.still(); }).passage;
    const analysis::Estimate steps{passage.steps.value, passage.steps.lower, passage.steps.upper};
    if (request.target.of == Target::Of::steps) return {steps, ""};
    const markov::MeshEstimate share =
        markov::survival_after(passage, static_cast<std::uint64_t>(request.target.steps));
    return {{share.value, share.lower, share.upper}, ""};
  } catch (const Interrupted&) {
    throw;
  } catch (const std::runtime_error& error) {  // no gait that is stable, or ways that disagree
    return {{}, error.what()};
  } catch (const std::domain_error& error) {
    return {{}, error.what()};
  }
}

// A slope from where a walker hardly rolls to where its gait has gone; an sd from which it falls once in 1e10 steps
// or so to one with which it falls at once.
analysis::SolveRange walker_range(const SolveRequest& request) {
  const double slope = request.walker->slope_deg;
  return request.of_slope_sd ? analysis::SolveRange{0.05 * slope, 0.5 * slope, true}
                             : analysis::SolveRange{0.2 * slope, 1.6 * slope, false};
}

// Returns the walker with a value of what is solved for.
analysis::WalkerSetting walker_with(const SolveRequest& request, double value) {
  analysis::WalkerSetting setting = *request.walker;
  (request.of_slope_sd ? setting.slope_sd_deg : setting.slope_deg) = value;
  return setting;
}

Solution solve_walker(const SolveRequest& request, const analysis::SolveOptions& options, Looking& looking) {
  const auto with = [&](double value) { return walker_with(request, value); };
  const analysis::SolveRange range = walker_range(request);
  analysis::require_ends(range, options, [&](double end) { with(end).map(); });
  Solution solution =
      analysis::solve([&](double value, int threads) { return walker_answer(request, with(value), threads, looking); },
                      request.target, range, options);
  solution.parameter = request.of_slope_sd ? "slope-sd" : "slope";
  solution.unit = "deg";
  return solution;
}

// Returns the line that says what everything but the parameter is.
std::string described(const SolveRequest& request) {
  if (!request.walker) return analysis::sweep_description(request.setting, {{request.parameter, {0, 1}}});
  // The number that is solved for is none: it is described as "nan deg".
  constexpr std::string_view none = "nan deg";
  std::string text = walker_with(request, std::numeric_limits<double>::quiet_NaN()).describe();
  return text.replace(text.find(none), none.size(), "varies");
}

SolveJson solve_number(double value) {
  if (std::isinf(value)) return "infinite";
  return value;
}

SolveJson solve_interval(const analysis::Estimate& estimate) {
  return {solve_number(estimate.lower), solve_number(estimate.upper)};
}

SolveJson target_json(const Target& target) {
  switch (target.of) {
    case Target::Of::steps:
      return {{"expected_steps", target.value}};
    case Target::Of::survival:
      return {{"survival", target.value}, {"steps", target.steps}};
    case Target::Of::ramp_end:
      return {{"reach_ramp_end", target.value}};
  }
  throw std::logic_error("unknown target");
}

}  // namespace

SolveAnswer answer_solve(const SolveRequest& request, const BeginPart& begin) {
  SolveAnswer answer;
  {
    Looking looking(begin, request.solve.points);
    analysis::SolveOptions options = request.solve;
    options.tabulating = [&](double share) { looking.tabulating(share); };
    options.progress = [&](std::size_t points) { looking.looked_at(points); };
    analysis::StudyOptions study = request.study;
    study.progress = [&](double, const std::string&) { looking.still(); };
    answer.solution = request.walker
                          ? solve_walker(request, options, looking)
                          : analysis::solve(request.setting, request.parameter, request.target, options, study);
  }
  if (!request.rigid_bodies) return answer;
  for (std::size_t i = 0; i < answer.solution.studies.size(); ++i) {
    analysis::StudyOptions study = request.study;
    study.progress = begin("rigid bodies");
    answer.rigid_bodies.push_back(analysis::beside_rigid_bodies(
        answer.solution.studies[i],
        fmt::format("{} {:.6g}", answer.solution.parameter, answer.solution.found[i].at.value), study));
  }
  return answer;
}

std::string solve_answer_json(const SolveRequest& request, const SolveAnswer& answer) {
  const Solution& solution = answer.solution;
  SolveJson json = {{"schema", 1},
                    {"parameter", solution.parameter},
                    {"unit", solution.unit},
                    {"target", target_json(solution.target)},
                    {"range", {solution.from, solution.to}},
                    {"solutions", SolveJson::array()},
                    {"scanned", SolveJson::array()},
                    {"sentences", solution.sentences()}};
  for (std::size_t i = 0; i < solution.found.size(); ++i) {
    const analysis::Crossing& one = solution.found[i];
    SolveJson& entry = json["solutions"].emplace_back(SolveJson{{"value", one.at.value},
                                                                {"interval_95", solve_interval(one.at)},
                                                                {"more_above", one.rising},
                                                                {"open_below", one.open_below},
                                                                {"open_above", one.open_above}});
    if (!solution.studies.empty()) {
      const analysis::Metastability& study = solution.studies[i];
      entry["expected_steps"] = {{"from_start", solve_number(study.steps.from_start.value)},
                                 {"interval_95", solve_interval(study.steps.from_start)}};
    }
    if (answer.rigid_bodies.empty()) continue;
    const analysis::BesideRigidBodies& beside = answer.rigid_bodies[i];
    entry["rigid_bodies"] = beside.check.reason.empty()
                                ? SolveJson{{"expected_steps", {{"interval_95", solve_interval(beside.check.steps)}}},
                                            {"verdict", analysis::verdict_text(beside.verdict())}}
                                : SolveJson{{"reason", beside.check.reason}};
  }
  const char* quantity = solution.target.of == Target::Of::steps ? "expected_steps" : "probability";
  for (const analysis::LookedAt& one : solution.scanned)
    json["scanned"].push_back(one.answer.unknown.empty()
                                  ? SolveJson{{"at", one.at},
                                              {quantity, solve_number(one.answer.quantity.value)},
                                              {"interval_95", solve_interval(one.answer.quantity)}}
                                  : SolveJson{{"at", one.at}, {"unknown", one.answer.unknown}});
  if (!answer.rigid_bodies.empty())
    json["rigid_bodies"] = analysis::rigid_body_sentence(answer.rigid_bodies, request.setting.law);
  json["provenance"] = {{"command", request.command},
                        {"settings", described(request)},
                        {"seed", request.walker ? request.meshes.seed : request.study.seed},
                        {"version", version()}};
  return json.dump(2) + "\n";
}

std::string solve_answer_text(const SolveRequest& request, const SolveAnswer& answer) {
  const Solution& solution = answer.solution;
  std::string text = described(request) + "\n\n";
  const std::vector<std::string> sentences = solution.sentences();
  for (std::size_t i = 0; i < sentences.size(); ++i)
    text += fmt::format("  {:<24}{}\n", i < std::max<std::size_t>(1, solution.found.size()) ? solution.parameter : "",
                        sentences[i]);
  text += fmt::format("  {:<24}{}\n", "for", solution.target.text());
  text += fmt::format("  {:<24}{} values from {:.6g} to {:.6g}{}, and between them where they show a crossing\n",
                      "looked at", solution.scanned.size(), solution.from, solution.to,
                      solution.unit == "1" ? "" : " " + solution.unit);
  if (!answer.rigid_bodies.empty())
    text += "\n" + analysis::rigid_body_sentence(answer.rigid_bodies, request.setting.law) + "\n";
  return text;
}

void run_solve(const SolveRequest& request) {
  std::optional<OutputFile> json;
  if (!request.json.empty()) json.emplace(request.json);
  const SolveAnswer answer = [&] {
    ProgressParts progress;
    return answer_solve(request, progress.begin());
  }();
  if (json) {
    json->stream() << solve_answer_json(request, answer);
    json->commit();
  }
  if (request.json != "-") say("{}", solve_answer_text(request, answer));
}

}  // namespace metastable::reports
