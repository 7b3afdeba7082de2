#pragma once
// Makes the tables of `metastable study`.

#include <string>
#include <vector>

#include "analysis/paper/paper_claims.h"
#include "reports/output/table.h"

namespace metastable::reports {

using Studies = std::vector<analysis::VariantStudy>;

/// Says how many claims come out under the paper's own law and under that of rigid bodies.
std::vector<std::string> claims_sentences(const std::vector<analysis::Claim>& claims, const Studies& studies);
/// Counts the claims by verdict, a row a variant.
Table claims_count_table(const std::vector<analysis::Claim>& claims, const Studies& studies,
                         const Provenance& provenance);
Table claims_table(const std::vector<analysis::Claim>& claims, const Studies& studies,
                   const analysis::PaperExperiments& experiments, const Provenance& provenance);
/// Lists the main numbers, and the claims whose verdict differs between the variants (of paper_variants(), in order).
Table changes_table(const std::vector<analysis::Claim>& claims, const Studies& studies,
                    const analysis::PaperExperiments& experiments, const Provenance& provenance);
Table readings_table(const std::vector<analysis::Claim>& claims, const Provenance& provenance);
Table hypotheses_table(const std::vector<analysis::Hypothesis>& hypotheses, const Studies& studies,
                       const Provenance& provenance);
/// Lists first-order and total indices over mean friction.
Table variance_table(const Studies& studies, const Provenance& provenance);
Table fig4_table(const Studies& studies, const analysis::PaperExperiments& experiments, const Provenance& provenance);
Table fig6_table(const Studies& studies, const Provenance& provenance);
Table equal_legs_table(const Studies& studies, const Provenance& provenance);
Table fig7_table(const Studies& studies, const analysis::PaperExperiments& experiments, const Provenance& provenance);
Table fig8_table(const Studies& studies, const Provenance& provenance);
Table fig9_table(const Studies& studies, const Provenance& provenance);

}  // namespace metastable::reports
