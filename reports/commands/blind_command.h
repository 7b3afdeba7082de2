#pragma once
// metastable blind make | answer | open

#include "reports/commands/request.h"

namespace metastable::reports {

/// Draws the cases, writes cases/NNNN (experiment folder, seal.txt, perhaps catalogue.txt) and seals each truth. Cases
/// that are there already are kept, so that a run cut short goes on.
void run_blind_make(const BlindRequest& request);
/// Runs the diagnosis, as a program of its own, on the folders that have no answer yet; records digest and time.
void run_blind_answer(const BlindRequest& request);
/// What becomes of cases that have no answer when the truths are opened, which ends the run.
enum class Unanswered { refused, left_out };
/// Checks seals and record, grades, writes tables and a page. @throws std::invalid_argument for a truth or an answer
/// that was changed, for answers written after the truths were first opened, for cases without an
/// answer unless these are to be left out, and (as run_blind_answer() does) for a
/// sealed folder whose name is not that of a case
void run_blind_open(const BlindRequest& request, Unanswered unanswered = Unanswered::refused);

}  // namespace metastable::reports
