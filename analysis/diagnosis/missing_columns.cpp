#include "analysis/diagnosis/missing_columns.h"

#include <algorithm>
#include <map>

#include "analysis/diagnosis/detectability.h"

namespace metastable::analysis {
namespace {

constexpr double much_harder = 1.5;                // smallest size over smallest size
constexpr double not_told = 0.9, well_told = 0.8;  // share of an effect's information that another imitates
constexpr std::size_t most_stand_ins = 6;          // of an effect, to stand for all of its own

// Returns every effect's visibility in data drawn from the model, by its id.
std::map<std::string, Detectability> look(const TransitionModel& model, const std::vector<double>& nuisance,
                                          const std::vector<const Candidate*>& wanted, const Rules& rules,
                                          int threads) {
  std::vector<Candidate> few;
  for (const Candidate& candidate : model.candidates()) {
    if (std::none_of(wanted.begin(), wanted.end(), [&](const Candidate* w) { return w->id == candidate.id; })) continue;
    few.push_back(candidate);
    const std::size_t all = candidate.variants.size(), kept = std::min(most_stand_ins, all);
    few.back().variants.clear();
    for (std::size_t v = 0; v < kept; ++v) few.back().variants.push_back(candidate.variants[v * all / kept]);
  }
  std::vector<const Candidate*> candidates;
  for (const Candidate& candidate : few) candidates.push_back(&candidate);
  std::map<std::string, Detectability> seen;
  for (Detectability& v :
       detectability(scan_effects(model, fit(model, nuisance, {}), candidates, threads), candidates, rules))
    seen.emplace(v.effect, v);
  return seen;
}

// Returns values for the nuisances of another model of the same machine: with other columns it may have fewer, or more.
std::vector<double> carried(const TransitionModel& from, const std::vector<double>& values, const TransitionModel& to) {
  std::vector<double> all = nominal_values(to);
  for (std::size_t i = 0; i < all.size(); ++i)
    for (std::size_t j = 0; j < values.size(); ++j)
      if (to.nuisances()[i].name == from.nuisances()[j].name) all[i] = values[j];
  return all;
}

double share_of(const Detectability& v, const std::string& other) {
  for (const auto& [effect, share] : v.alike)
    if (effect == other) return share;
  return 0;
}

}  // namespace

std::vector<MissingColumn> missing_columns(const TransitionModel& model, const Fit& recalibrated,
                                           const std::vector<const Candidate*>& candidates, const Rules& rules,
                                           int threads, std::uint64_t seed) {
  std::vector<MissingColumn> all;
  const auto completed = model.completed(recalibrated.nuisance, seed);
  if (completed.empty()) return all;
  const auto drawn = model.simulate(recalibrated.nuisance, {}, seed);
  const auto now = look(*drawn, carried(model, recalibrated.nuisance, *drawn), candidates, rules, threads);
  for (const auto& [column, with_it] : completed) {
    MissingColumn missing;
    missing.column = column;
    const auto then = look(*with_it, carried(model, recalibrated.nuisance, *with_it), candidates, rules, threads);
    for (const Candidate* candidate : candidates) {
      const auto before = now.find(candidate->id), after = then.find(candidate->id);
      if (before == now.end() || after == then.end() || !after->second.undecidable.empty() ||
          !(after->second.smallest > 0))
        continue;
      HiddenEffect effect{candidate->id, after->second.parameter, {}, after->second.smallest, {}};
      if (before->second.undecidable.empty()) effect.smallest = before->second.smallest;
      for (const auto& [other, share] : before->second.alike)
        if (share > not_told && share_of(after->second, other) < well_told) effect.not_told_from.push_back(other);
      if (!effect.smallest || *effect.smallest > much_harder * effect.smallest_with_it || !effect.not_told_from.empty())
        missing.effects.push_back(std::move(effect));
    }
    all.push_back(std::move(missing));
  }
  return all;
}

}  // namespace metastable::analysis
