#pragma once
// Says a diagnosis in plain words.

#include <string>
#include <vector>

#include "analysis/diagnosis/diagnosis.h"

namespace metastable::analysis {

/// Says the verdict, where the gap shows most, how much of it closes, and what the data could not say.
/// @param d  complete but for its sentences
std::vector<std::string> sentences(const Diagnosis& d);

/// Says what the verdict asks for, one or two sentences.
std::string next_step(const Diagnosis& d);

/// Says whether the share of the gap that closes says anything: its 90 % interval is no wider than the gap itself.
bool closed_is_known(const Shrinkage& shrinkage);

/// Says "not known: 90 % interval −141 to 142 %, wider than the gap" of a share that is not.
std::string closed_unknown(const Shrinkage& shrinkage);

/// Lists the effects that the name of a cause stands for: of "a+b+c" a, b and c.
std::vector<std::string> effects_of_cause(const std::string& name);

/// Names what effects that act alike have in common, where the field has a word for it.
std::string common_name(const std::vector<EffectGroup>& groups, const std::vector<std::string>& alike);

}  // namespace metastable::analysis
