#pragma once
// Makes the tables of `metastable describe`, from a finished description.

#include <string>
#include <vector>

#include "analysis/description/description.h"
#include "analysis/description/law_comparison.h"
#include "dynamics/wheel/contact_law.h"
#include "reports/output/table.h"

namespace metastable::reports {

/// Says in a few sentences how fast the wheel rolls in the end, which conditions cannot be told apart, and how many
/// trials rest.
std::vector<std::string> description_sentences(const analysis::Description& description);
/// Lists trials, steady speed, rests and expected steps of each condition.
Table short_table(const analysis::Description& description, const Provenance& provenance);
/// Lists trials, steady speed, return map and survival of each condition.
Table conditions_table(const analysis::Description& description, const Provenance& provenance);
/// Lists mean speed and standard error at each collision, all conditions side by side.
Table profiles_table(const analysis::Description& description, const Provenance& provenance);
/// Lists speed per landing leg.
Table legs_table(const analysis::Description& description, const Provenance& provenance);
/// Lists every test on every pair of conditions.
Table tests_table(const analysis::Description& description, const Provenance& provenance);
/// Lists survival step by step.
Table survival_table(const analysis::Description& description, const Provenance& provenance);
/// Lists restitution and friction by maximum likelihood. @param law  under which they were fitted
Table fits_table(const analysis::Description& description, dynamics::Law law, const Provenance& provenance);
/// Puts measured beside predicted: speeds, spread, share of trials that rest.
Table laws_table(const analysis::LawComparison& comparison, const Provenance& provenance);
/// Says what landings leave, leg by leg, beside `settled`.
Table landings_table(const std::vector<analysis::LegRow>& legs, const Provenance& provenance);

}  // namespace metastable::reports
