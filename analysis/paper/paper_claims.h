#pragma once
// Holds the paper's statements about its simulations and experiments against a study.

#include <string>
#include <vector>

#include "analysis/paper/paper_study.h"

namespace metastable::analysis {

enum class ClaimVerdict { reproduced, partly, not_reproduced, not_applicable };
/// Returns "reproduced", "partly", "not reproduced", "says nothing".
std::string verdict_text(ClaimVerdict verdict);

struct Finding {
  ClaimVerdict verdict = ClaimVerdict::not_applicable;
  std::string ours;  ///< the numbers behind it
};

struct Claim {
  std::string where;  ///< figure or section
  std::string claim;
  std::string paper;              ///< its figure
  std::string reading;            ///< what counts as reproduced
  std::vector<Finding> findings;  ///< one a variant, in order
  Finding experiment;             ///< the measured trials or their stand-in, where the claim is about them
  std::string brief = {};         ///< the claim in some thirty letters, with its figure, for a picture
};

/// @param studies  of paper_variants(), in order
std::vector<Claim> paper_claims(const std::vector<VariantStudy>& studies, const PaperExperiments& experiments);

struct Hypothesis {
  std::string name;  ///< "H1", ...
  std::string text;
  std::vector<Finding> findings;    ///< one a variant; reproduced: the hypothesis holds
  std::vector<double> shares = {};  ///< one a variant: the largest total index of the steady speed
};
/// Judges H1 to H3 by variance shares of the steady speed and of the steps (total indices over mean friction 0.3 to
/// 0.55), with the tests of Figs. 6 and 7. A source matters where its total index exceeds 0.1.
std::vector<Hypothesis> paper_hypotheses(const std::vector<VariantStudy>& studies);

}  // namespace metastable::analysis
