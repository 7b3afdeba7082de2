#pragma once
// Draws the figures of `metastable study`, as the paper draws them: mean profiles, standard errors as bands.

#include <vector>

#include "analysis/paper/paper_claims.h"
#include "analysis/paper/paper_study.h"
#include "reports/output/figure.h"

namespace metastable::reports {

/// Draws which of the claims come out under each variant, as a map of verdicts.
Figure claims_figure(const std::vector<analysis::Claim>& claims, const std::vector<analysis::VariantStudy>& studies,
                     const Provenance& provenance);
/// Draws how much of the steady speed's variance each hypothesis's source takes, under each variant.
Figure hypotheses_figure(const std::vector<analysis::Hypothesis>& hypotheses,
                         const std::vector<analysis::VariantStudy>& studies, const Provenance& provenance);
/// Draws one figure a panel of the paper's, for one variant.
std::vector<Figure> fig4_figures(const analysis::VariantStudy& study, const Provenance& provenance);
std::vector<Figure> fig6_figures(const analysis::VariantStudy& study, const analysis::PaperExperiments& experiments,
                                 const Provenance& provenance);
std::vector<Figure> fig7_figures(const analysis::VariantStudy& study, const analysis::PaperExperiments& experiments,
                                 const Provenance& provenance);
std::vector<Figure> fig8_figures(const analysis::VariantStudy& study, const Provenance& provenance);
std::vector<Figure> fig9_figures(const analysis::VariantStudy& study, const analysis::PaperExperiments& experiments,
                                 const Provenance& provenance);
Figure fig4_experiment_figure(const analysis::PaperExperiments& experiments, const Provenance& provenance);

}  // namespace metastable::reports
