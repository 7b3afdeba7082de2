#include <stdexcept>

#include "analysis/experiment/suggestion.h"
#include "reports/command_line/command.h"
#include "reports/command_line/requests.h"
#include "reports/experiment_commands/blind_command.h"

namespace metastable::reports {

void declare_blind(Options& o) {
  o.add_place("ACTION", "make: draw cases and seal their truths; answer: diagnose the folders; open: grade",
              "make|answer|open");
  o.add_place("DIR", "Folder of the run");
  o.add("sealed", "DIR", "", "Folder of the truths (default: DIR-sealed, beside the run)");
  o.add("seed", "SEED", "", "make: of all cases (default: from the system's entropy)");
  o.add("per-effect", "N", "6",
        "make: cases of each effect at each of 1, 2 and 4 times the size that just shows, 0..1000");
  o.add("none", "N", "300", "make: cases without a gap, 0..5000");
  o.add("pairs", "N", "50", "make: cases with two effects, 0..5000");
  o.add("outside", "N", "50", "make: cases with an effect that no catalogue holds, 0..5000");
  o.add("left-out", "N", "3", "make: cases of each effect with a catalogue that lacks it, 0..1000");
  o.add("mixed", "N", "0", "make: cases with one or two effects and one that no catalogue holds, 0..5000");
  o.add("many", "N", "0", "make: cases with three effects, 0..5000");
  o.add("law", "published|settled|both", "published",
        "make: law of the cases: published (first laboratory), settled (second one, a rigid body), both in turn");
  o.add("walker", "compass", "", "make: cases of the compass gait, from the laboratory of walkers, not of the wheel");
  o.add("tool", "PROGRAM", "", "answer: run 'PROGRAM diagnose CASE --json FILE ...' (default: this program)");
  o.add_flag("partial", "open: although some cases are not answered");
  o.add_threads();
  o.add("out", "DIR", "", "open: folder of tables and page (default: report in the run's folder)");
  o.add_json();
}

BlindRequest blind_request(const Options& o, const std::string& line) {
  BlindRequest request;
  request.folder = o.text("DIR");
  while (request.folder.size() > 1 && request.folder.ends_with('/')) request.folder.pop_back();
  request.sealed = o.text("sealed");
  if (o.given("seed")) request.seed = o.seed();
  request.size.per_effect_and_strength = o.count("per-effect", 0, 1000);
  request.size.none = o.count("none", 0, 5000);
  request.size.pairs = o.count("pairs", 0, 5000);
  request.size.outside = o.count("outside", 0, 5000);
  request.size.left_out_per_effect = o.count("left-out", 0, 1000);
  request.size.mixed = o.count("mixed", 0, 5000);
  request.size.many = o.count("many", 0, 5000);
  request.size.walkers = o.given("walker");
  if (request.size.walkers) {
    analysis::require_word("--walker", o.text("walker"), {"compass"});
    if (o.text("law") != "published") throw std::invalid_argument("--law: has no meaning with --walker");
  }
  if (o.text("law") == "both")
    request.size.laws = {dynamics::Law::published, dynamics::Law::settled};
  else
    request.size.laws = {dynamics::law_from_name(o.text("law"))};
  if (!o.text("tool").empty()) request.tool = {o.text("tool")};
  request.threads = o.threads();
  request.out = o.text("out");
  request.command = line;
  request.json = o.text("json");
  return request;
}

std::vector<Command> blind_commands() {
  return {{"blind",
           "The diagnosis tested on cases whose truth is sealed until it has answered: make, answer, open",
           declare_blind,
           [](const Options& o, const std::string& line) {
             const BlindRequest request = blind_request(o, line);
             const std::string action = o.text("ACTION");
             if (action == "make")
               run_blind_make(request);
             else if (action == "answer")
               run_blind_answer(request);
             else
               run_blind_open(request, o.flag("partial") ? Unanswered::left_out : Unanswered::refused);
           },
           "",
           {"metastable blind make run --per-effect 1 --none 5 --pairs 2 --outside 2", "metastable blind answer run",
            "metastable blind open run"}}};
}

}  // namespace metastable::reports
