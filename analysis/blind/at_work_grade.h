#pragma once
// Grades what is said to be at work, effect by effect.

#include <optional>
#include <vector>

#include "analysis/blind/blind_grade.h"

namespace metastable::analysis {

/// Says how often what is said to be at work (a probability of 0.8 and more) is, by kinds of case, and how often
/// probabilities come true. A group counts as right where it holds the effect. Cases without an answer fail.
/// @param truths, answers  as grade() takes them
std::vector<Grade> at_work_grades(const std::vector<BlindTruth>& truths,
                                  const std::vector<std::optional<BlindAnswer>>& answers);

/// Says how often the intervals of the shares that the effects at work close, alone and beside the others, hold what
/// they close in the mean over experiments: of cases without anything from outside whose truth gains 9 and more, by
/// truth.gap_as_given.
std::vector<Grade> share_grades(const std::vector<BlindTruth>& truths,
                                const std::vector<std::optional<BlindAnswer>>& answers);

/// Says how often the interval of the machine's expected steps holds what the laboratory counts, with the error of that
/// count, and how often it is as narrow as that of counting twice the trials. Cases without an interval, or with too
/// few rests counted, are left out.
std::vector<Grade> steps_grades(const std::vector<BlindTruth>& truths,
                                const std::vector<std::optional<BlindAnswer>>& answers);

}  // namespace metastable::analysis
