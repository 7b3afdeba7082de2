#include "analysis/diagnosis/wanted_effects.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <stdexcept>

namespace metastable::analysis {
namespace {

// Returns the one or two effects that an entry of the options names.
std::vector<std::string> effects_of(const std::string& entry) {
  const auto plus = entry.find('+');
  std::vector<std::string> ids{entry.substr(0, plus)};
  if (plus != std::string::npos) ids.push_back(entry.substr(plus + 1));
  if (ids.front() == ids.back() && ids.size() == 2)
    throw std::invalid_argument(fmt::format("effect: \"{}\" is not a pair of two effects", entry));
  return ids;
}

}  // namespace

void require_known_effects(const TransitionModel& model, const std::vector<std::string>& catalogue) {
  const std::vector<std::string> known = model.effect_ids();
  for (const std::string& entry : catalogue)
    for (const std::string& id : effects_of(entry))
      if (std::ranges::find(known, id) == known.end())
        throw std::invalid_argument(fmt::format("effect: \"{}\" is none of {}", id, fmt::join(known, ", ")));
}

std::vector<const Candidate*> wanted(const TransitionModel& model, const std::vector<std::string>& catalogue) {
  std::vector<std::string> ids;
  bool restricted = false;
  for (const std::string& entry : catalogue) {
    const std::vector<std::string> named = effects_of(entry);
    restricted = restricted || named.size() == 1;
    ids.insert(ids.end(), named.begin(), named.end());
  }
  std::vector<const Candidate*> candidates;
  for (const Candidate& candidate : model.candidates())
    if (!restricted || std::find(ids.begin(), ids.end(), candidate.id) != ids.end()) candidates.push_back(&candidate);
  // An effect without parameters, as another contact law, is compared as a whole: it has no score of which chance could
  // be drawn.
  const auto scanned = [](const Candidate* one) { return one->undecidable.empty() && !one->parameters.empty(); };
  if (std::ranges::none_of(candidates, scanned)) {
    std::string why;
    if (std::ranges::find(ids, model.recalibration_id()) != ids.end())
      why += fmt::format("; {}: the recalibration fits it in any case", model.recalibration_id());
    for (const Candidate* one : candidates)
      why += fmt::format(
          "; {}: {}", one->id,
          one->undecidable.empty() ? "it has no parameters: name another effect beside it" : one->undecidable);
    throw std::invalid_argument(fmt::format("catalogue: these data under this law can show none of {}{}",
                                            ids.empty() ? "its effects" : fmt::format("{}", fmt::join(ids, ", ")),
                                            why));
  }
  return candidates;
}

std::vector<std::pair<const Candidate*, const Candidate*>> wanted_pairs(const std::vector<const Candidate*>& candidates,
                                                                        const std::vector<std::string>& catalogue) {
  const auto find = [&](const std::string& id) {
    const auto found =
        std::find_if(candidates.begin(), candidates.end(), [&](const Candidate* c) { return c->id == id; });
    return found == candidates.end() ? nullptr : *found;
  };
  std::vector<std::pair<const Candidate*, const Candidate*>> pairs;
  for (const std::string& entry : catalogue) {
    const std::vector<std::string> named = effects_of(entry);
    const Candidate *one = find(named.front()), *other = find(named.back());
    if (one && other && one != other) pairs.emplace_back(one, other);
  }
  return pairs;
}

}  // namespace metastable::analysis
