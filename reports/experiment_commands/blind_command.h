#pragma once
// metastable blind make | answer | open

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "reports/commands/request.h"
#include "reports/output/table.h"

namespace metastable::reports {

/// A listener that is told of cases as they are done, by functions that may throw to stop; `check` and `done` from any
/// thread.
struct CaseProgress {
  std::function<void(std::size_t all, std::size_t had)> begin;  ///< `had` of them were done before
  std::function<void()> check, done;
};

struct BlindMade {
  std::size_t cases = 0;
  std::string sealed;  ///< folder of the truths
};
/// Draws the cases, writes cases/NNNN (experiment folder, seal.txt, perhaps catalogue.txt) and seals each truth. Cases
/// that are there already are kept, so that a run cut short goes on.
BlindMade make_blind(const BlindRequest& request, const CaseProgress& progress);

struct BlindAnswered {
  std::size_t cases = 0, answered = 0, failed = 0;
  std::string answers;  ///< their folder; where a tool failed it holds its errors
};
/// Runs the diagnosis, as a program of its own, on the folders that have no answer yet; records digest and time. A tool
/// that Ctrl-C ended has not answered.
BlindAnswered answer_blind(const BlindRequest& request, const CaseProgress& progress);

/// Says what becomes of cases that have no answer when the truths are opened, which ends the run.
enum class Unanswered { refused, left_out };
struct BlindOpened {
  std::vector<Table> tables;
  Provenance provenance;
  std::string page;  ///< file
};
/// Checks seals and record, grades, writes tables and a page. @throws std::invalid_argument for a truth or an answer
/// that was changed, for answers written after the truths were first opened, for cases without an
/// answer unless these are to be left out, and (as answer_blind() does) for a
/// sealed folder whose name is not that of a case
BlindOpened open_blind(const BlindRequest& request, Unanswered unanswered = Unanswered::refused);

/// Do the same, telling on standard output what came of it.
void run_blind_make(const BlindRequest& request);
void run_blind_answer(const BlindRequest& request);
void run_blind_open(const BlindRequest& request, Unanswered unanswered = Unanswered::refused);

}  // namespace metastable::reports
