// Not timed: turns each rule of the diagnosis by a quarter up and down on sealed cases, and prints what changes.
//
//   options="--per-effect 1 --left-out 0 --none 12 --pairs 12 --outside 12 --mixed 8 --many 8"
//   metastable blind make RUN --seed 4242 $options
//   turned_rules RUN OF_EACH [RULE...]
//
// It takes the first OF_EACH cases of each kind, and turns all rules where none is named. Truths are read, so that the
// run is spent.

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "analysis/diagnosis/diagnosis.h"
#include "analysis/experiment/experiment_folder.h"
#include "analysis/experiment_model/experiment_model.h"

namespace {

using namespace metastable::analysis;
namespace fs = std::filesystem;

struct Truth {
  std::string kind;
  std::vector<std::string> effects;
};

Truth read_truth(const fs::path& file) {
  const nlohmann::json json = nlohmann::json::parse(std::ifstream(file));
  Truth truth{json.at("kind"), {}};
  for (const auto& effect : json.at("effects")) truth.effects.push_back(effect.at("id"));
  return truth;
}

// Returns the effects that the diagnosis of a case may use; none: all.
std::vector<std::string> catalogue_of(const fs::path& folder) {
  std::vector<std::string> ids;
  std::ifstream file(folder / "catalogue.txt");
  for (std::string id; std::getline(file >> std::ws, id, ',');) {
    while (!id.empty() && std::isspace(static_cast<unsigned char>(id.back()))) id.pop_back();
    ids.push_back(id);
  }
  return ids;
}

struct Case {
  fs::path folder;
  Truth truth;
};

// Returns the first cases of each kind of a run, the kinds in turn, so that a part of the list has some of each.
std::vector<Case> cases_of(const fs::path& run, std::size_t of_each) {
  std::vector<fs::path> folders;
  for (const auto& entry : fs::directory_iterator(run / "cases"))
    if (fs::exists(entry.path() / "seal.txt")) folders.push_back(entry.path());
  std::ranges::sort(folders);
  std::map<std::string, std::vector<Case>> by_kind;
  for (const fs::path& folder : folders) {
    Truth truth = read_truth(run.string() + "-sealed/" + folder.filename().string() + ".json");
    std::vector<Case>& those = by_kind[truth.kind];
    if (those.size() < of_each) those.push_back({folder, std::move(truth)});
  }
  std::vector<Case> cases;
  for (std::size_t k = 0; k < of_each; ++k)
    for (const auto& [kind, those] : by_kind)
      if (k < those.size()) cases.push_back(those[k]);
  return cases;
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

// The names that an answer says, whatever the grade.
std::string said(const Diagnosis& d) {
  std::string all = fmt::format("{}\n{}\n", fmt::join(d.causes.set, ","), fmt::join(d.causes.alike, ","));
  for (const AtWork& one : d.causes.at_work) all += one.name + "\n";
  for (const UnnamedFacet& one : d.causes.unnamed_facets) all += one.facet + one.aspect + "\n";
  return all;
}

struct Turned {
  const char* name;
  double factor;
  Rules rules;
};

std::vector<Turned> turned_rules(const std::vector<std::string>& names) {
  std::vector<Turned> all{{"as they are", 1, {}}};
  for (const auto& [name, field] : named_rules)
    for (const double factor : {0.75, 1.25}) {
      if (!names.empty() && std::ranges::find(names, name) == names.end()) continue;
      Rules rules;
      rules.*field *= factor;
      all.push_back({name, factor, rules});
    }
  return all;
}

// The counts over all cases under one set of rules.
struct Count {
  int alarms = 0, misnamed = 0, named = 0, verdicts = 0, amounts = 0, said = 0;
};

// Diagnoses a case under each set of rules, adds to the counts, and says which rules changed what.
void count_case(const Case& one, const std::vector<Turned>& turned, const std::vector<Rules>& rules,
                std::vector<Count>& counts) {
  const auto model = transition_model(read_experiment(one.folder));
  const std::vector<Diagnosis> answers =
      decide_each(*model, {.threads = 1, .catalogue = catalogue_of(one.folder)}, rules);
  const Amounts usual = amounts(answers[0], one.truth);
  fmt::print(stderr, "{} ({} {}): {}, alarm {}, misnamed {}, named {}\n", one.folder.filename().string(),
             one.truth.kind, fmt::join(one.truth.effects, "+"), verdict_name(answers[0].verdict), int(usual.alarm),
             int(usual.misnamed), int(usual.named));
  for (std::size_t k = 0; k < turned.size(); ++k) {
    const Amounts now = amounts(answers[k], one.truth);
    const bool other_verdict = answers[k].verdict != answers[0].verdict;
    counts[k].alarms += now.alarm;
    counts[k].misnamed += now.misnamed;
    counts[k].named += now.named;
    counts[k].verdicts += other_verdict;
    counts[k].amounts += now != usual;
    const bool other_names = said(answers[k]) != said(answers[0]);
    counts[k].said += other_names;
    if (other_verdict || other_names || now != usual)
      fmt::print(stderr, "  {} x {}: {}, alarm {}, misnamed {}, named {}\n", turned[k].name, turned[k].factor,
                 verdict_name(answers[k].verdict), int(now.alarm), int(now.misnamed), int(now.named));
  }
}

}  // namespace

int main(int count, char** arguments) {
  const int of_each = count >= 3 ? std::atoi(arguments[2]) : 0;
  if (of_each < 1) {
    std::fputs("usage: turned_rules RUN OF_EACH [RULE...]\n", stderr);
    return 2;
  }
  const std::vector<Turned> turned = turned_rules({arguments + 3, arguments + count});
  std::vector<Rules> rules;
  for (const Turned& one : turned) rules.push_back(one.rules);
  std::vector<Count> counts(turned.size());
  const std::vector<Case> cases = cases_of(arguments[1], static_cast<std::size_t>(of_each));
  for (const Case& one : cases) count_case(one, turned, rules, counts);
  fmt::print("rule,factor,cases,false alarms,misnamed,named,other verdict,other grade,other names\n");
  for (std::size_t k = 0; k < turned.size(); ++k)
    fmt::print("{},{},{},{},{},{},{},{},{}\n", turned[k].name, turned[k].factor, cases.size(), counts[k].alarms,
               counts[k].misnamed, counts[k].named, counts[k].verdicts, counts[k].amounts, counts[k].said);
}
