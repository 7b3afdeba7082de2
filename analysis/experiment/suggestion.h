#pragma once
// Finds the word that was meant.

#include <string>
#include <string_view>
#include <vector>

namespace metastable::analysis {

/// Returns the name that fewest typing errors (a letter more, less, other, or two exchanged) lead from `word` to; ""
/// where more than a third of the word's letters would be wrong, or two names are as near.
std::string nearest(std::string_view word, const std::vector<std::string>& names);

/// Returns "; did you mean 'NAME'?" for the nearest name, or "".
std::string did_you_mean(std::string_view word, const std::vector<std::string>& names);

/// Refuses a word that is none of the known ones. @param called  what it was given for, "--law"
/// @throws std::invalid_argument "--law: 'plastik' is none of published, ..., settled; did you mean 'plastic'?"
void require_word(std::string_view called, std::string_view word, const std::vector<std::string>& known);

/// Does the same for effects, alone or in pairs "trial_drift+bounce".
void require_effects(const std::vector<std::string>& catalogue, const std::vector<std::string>& known);

}  // namespace metastable::analysis
