#pragma once
// Writes a diagnosis and the catalogue of effects as JSON.

#include <string>
#include <vector>

#include "analysis/diagnosis/diagnosis.h"
#include "dynamics/catalogue/effect_catalogue.h"
#include "reports/output/table.h"

namespace metastable::reports {

/// Writes the result of `diagnose`, indented, with a final line end. "infinite" is written as a string, what is not
/// known as null; numbers have as many digits as a double holds. Keys as in the README ("diagnose --json").
std::string diagnosis_json(const analysis::Diagnosis& diagnosis, const Provenance& provenance);

/// Writes `effects`' result: id, summary and parameters (name, unit, neutral, lower, upper, meaning) of each effect.
std::string effects_json();
/// Does the same for effects of a walker, which stands under the key "walker"; empty: the wheel's.
std::string effects_json(const std::vector<dynamics::EffectInfo>& all, const std::string& walker);

}  // namespace metastable::reports
