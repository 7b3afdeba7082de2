#pragma once
// Grades blind answers against their truths.

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "analysis/blind/blind_cases.h"
#include "analysis/diagnosis/diagnosis.h"

namespace metastable::analysis {

/// Holds a fitted parameter of an answer's leading cause.
struct AnsweredParameter {
  std::string effect, name;
  double value = 0;
  std::optional<double> lower, upper;  ///< 90 %
};

/// Holds what a diagnosis said, as far as it is graded.
struct BlindAnswer {
  Verdict verdict = Verdict::no_gap;
  std::vector<std::pair<std::string, double>> causes;  ///< by falling probability
  std::vector<std::string> cause_set;
  std::vector<std::string> alike = {};        ///< of the set: that no data like these could tell from its first
  std::vector<AnsweredParameter> parameters;  ///< of the first cause
  struct ClaimedPlace {
    std::string facet, aspect;
    double p_adjusted = 1;
  };
  std::vector<ClaimedPlace> where;
  std::optional<double> closed_lower, closed_upper;  ///< share of the gap that was closed, 90 %
  struct SaidAtWork {
    std::vector<std::string> effects;  ///< one, or a group that the data cannot tell apart
    double probability = 0;
    /// Shares of the held-out gap as given that are closed alone and beside the others, 90 %.
    std::optional<std::pair<double, double>> alone = {}, beside = {};
  };
  std::vector<SaidAtWork> at_work = {};
  double p_unnamed = 0;
  /// 90 % intervals of the machine's expected steps: as answered, and as the rests alone count them. The upper end may
  /// be infinite.
  std::optional<std::pair<double, double>> steps = {}, steps_counted = {};
  /// Lists by criterion (AICc, BIC) the effects that stepwise selection over the same models names, and for walks those
  /// that least squares of one-step predictions does (Gauss-Newton AICc, Gauss-Newton BIC).
  std::map<std::string, std::vector<std::string>> stepwise = {};
};

struct Proportion {
  int right = 0, of = 0;
  void count(bool is_right) { right += is_right, ++of; }
};
/// Gives Wilson's 95 % interval of a proportion; that of nothing is {0, 1}.
std::pair<double, double> wilson(const Proportion& proportion);

/// One line of the table of measures.
struct Grade {
  std::string measure;
  Proportion proportion;
  double aim_low = 0, aim_high = 1;  ///< the share asked for
  double most_upper = 1;             ///< the most that the upper end of its interval may be
};

/// Counts of how often one way of answering named what: the diagnosis by the first of its set, or a criterion by its
/// effects.
struct WayGrade {
  std::string way;
  Proportion alarms;               ///< named something where there is no gap
  Proportion exact, in, wrong;     ///< one effect, power left: named it alone; named it; named something else (too)
  Proportion both, third;          ///< two effects: named both; named something that neither is
  Proportion outside;              ///< named something for what no catalogue holds
  Proportion three, two_of_three;  ///< three effects: named all of them; at least two
  Proportion mixed, mixed_wrong;   ///< beside what no catalogue holds: named all that are there; named another one
};

struct CalibrationBin {
  double from = 0, to = 0;
  int count = 0;
  double mean_probability = 0;
  Proportion right;
};

struct BlindGrades {
  std::vector<Grade> grades;
  double mean_set_size_1x = 0, mean_set_size_2x = 0;  ///< of explained effect cases; 0: none
  /// Names of the set beside its first and what is alike to that, of explained effect cases at 2x: mean and most.
  double mean_beyond_alike_2x = 0, most_beyond_alike_2x = 0;
  std::vector<WayGrade> ways;               ///< the diagnosis first; criteria where answers have them
  std::vector<CalibrationBin> calibration;  ///< probability of the first cause against how often it is right
  /// Counts what was answered (first cause, or the verdict) by the truth (an effect, or none, outside, ...).
  std::map<std::string, std::map<std::string, int>> confusion;
  std::map<std::string, std::vector<std::string>> alike;  ///< ambiguity groups: what shares the cause sets of an effect
};

/// @param truths   whole: complete_truth() when the case was made, complete_each() for several effects. An effect whose
/// `left` is
///                 below 9 counts as absorbed by recalibration, a pair without left_by_effect as not findable
/// @param answers  one a truth; nothing: not answered, counted as a failure of every measure it belongs to
/// @throws std::invalid_argument if they are not as many as the truths
BlindGrades grade(const std::vector<BlindTruth>& truths, const std::vector<std::optional<BlindAnswer>>& answers);

}  // namespace metastable::analysis
