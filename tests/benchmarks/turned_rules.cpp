// Not timed: turns each rule of the diagnosis by a quarter up and down on sealed cases, and prints what changes.
//
//   metastable blind make RUN --seed 2050 --law both --per-effect 1 --none 10 --pairs 10 --outside 10 --left-out 0
//   turned_rules RUN [LAW]
//
// LAW (published, settled) takes the cases of one law alone. Truths are read, so that the run is spent.

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "analysis/diagnosis/diagnosis.h"
#include "analysis/experiment/experiment_folder.h"
#include "analysis/experiment_model/experiment_model.h"

namespace {

using namespace metastable::analysis;
namespace fs = std::filesystem;

struct Truth {
  std::string kind, law;
  std::vector<std::string> effects;
};

Truth read_truth(const fs::path& file) {
  const nlohmann::json json = nlohmann::json::parse(std::ifstream(file));
  Truth truth{json.at("kind"), json.value("law", "published"), {}};
  for (const auto& effect : json.at("effects")) truth.effects.push_back(effect.at("id"));
  return truth;
}

// The grade of an answer beside the truth.
struct Amounts {
  bool alarm = false;     // a gap is claimed where there is none
  bool misnamed = false;  // an effect is said to be at work, and neither it nor one of its group is
  bool named = false;     // every effect of the catalogue that is there is said to be at work, alone or in a group
  bool operator==(const Amounts&) const = default;
};

Amounts amounts(const Diagnosis& d, const Truth& truth) {
  Amounts a;
  a.alarm = truth.kind == "none" && is_gap(d.verdict);
  if (d.verdict != Verdict::explained && d.verdict != Verdict::partly_explained) return a;
  std::vector<std::string> said;
  for (const AtWork& one : d.causes.at_work) {
    if (one.probability < d.rules.least_at_work) continue;
    const bool there = std::ranges::any_of(one.effects, [&](const std::string& id) {
      return std::ranges::find(truth.effects, id) != truth.effects.end();
    });
    a.misnamed = a.misnamed || !there;
    said.insert(said.end(), one.effects.begin(), one.effects.end());
  }
  a.named = !truth.effects.empty() && std::ranges::all_of(truth.effects, [&](const std::string& id) {
    return std::ranges::find(said, id) != said.end();
  });
  return a;
}

struct Turned {
  const char* name;
  double factor;
  Rules rules;
};

std::vector<Turned> turned_rules() {
  std::vector<Turned> all{{"as they are", 1, {}}};
  for (const auto& [name, field] : named_rules)
    for (const double factor : {0.75, 1.25}) {
      Rules rules;
      rules.*field *= factor;
      all.push_back({name, factor, rules});
    }
  return all;
}

}  // namespace

int main(int count, char** arguments) {
  if (count < 2) {
    std::fputs("usage: turned_rules RUN [LAW]\n", stderr);
    return 2;
  }
  const fs::path run = arguments[1];
  const std::string law = count > 2 ? arguments[2] : "";
  const std::vector<Turned> turned = turned_rules();
  std::vector<Rules> rules;
  for (const Turned& one : turned) rules.push_back(one.rules);
  struct Count {
    int alarms = 0, misnamed = 0, named = 0, verdicts = 0, amounts = 0;
  };
  std::vector<Count> counts(turned.size());
  int cases = 0;
  std::vector<fs::path> folders;
  for (const auto& entry : fs::directory_iterator(run / "cases"))
    if (fs::exists(entry.path() / "seal.txt")) folders.push_back(entry.path());
  std::ranges::sort(folders);
  for (const fs::path& folder : folders) {
    const Truth truth = read_truth(run.string() + "-sealed/" + folder.filename().string() + ".json");
    if (!law.empty() && truth.law != law) continue;
    ++cases;
    const auto model = transition_model(read_experiment(folder));
    const std::vector<Diagnosis> answers = diagnose_each(*model, {}, rules);
    const Amounts usual = amounts(answers[0], truth);
    for (std::size_t k = 0; k < turned.size(); ++k) {
      const Amounts now = amounts(answers[k], truth);
      counts[k].alarms += now.alarm;
      counts[k].misnamed += now.misnamed;
      counts[k].named += now.named;
      counts[k].verdicts += answers[k].verdict != answers[0].verdict;
      counts[k].amounts += now != usual;
    }
    fmt::print(stderr, "{} ({}): {}\n", folder.filename().string(), truth.kind, verdict_name(answers[0].verdict));
  }
  fmt::print("rule,factor,cases,false alarms,misnamed,named,other verdict,other grade\n");
  for (std::size_t k = 0; k < turned.size(); ++k)
    fmt::print("{},{},{},{},{},{},{},{}\n", turned[k].name, turned[k].factor, cases, counts[k].alarms,
               counts[k].misnamed, counts[k].named, counts[k].verdicts, counts[k].amounts);
}
