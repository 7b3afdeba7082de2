#include "analysis/missing_columns.h"

#include <algorithm>
#include <map>

#include "analysis/visibility.h"

namespace metastable::analysis {
namespace {

constexpr double much_harder = 1.5;                // smallest size over smallest size
constexpr double not_told = 0.9, well_told = 0.8;  // share of an effect's information that another imitates
constexpr double believed_noise = 0.005;           // of speeds after collisions, where none is stated [rad/s]
constexpr std::size_t most_variants = 6;

// Every effect's visibility in data drawn from the model, by its id.
std::map<std::string, Visibility> look(const TransitionModel& model, const std::vector<double>& nuisance,
                                       const std::vector<const Candidate*>& wanted, int threads) {
  std::vector<Candidate> few;
  for (const Candidate& candidate : model.candidates()) {
    if (std::none_of(wanted.begin(), wanted.end(), [&](const Candidate* w) { return w->id == candidate.id; })) continue;
    few.push_back(candidate);
    const std::size_t all = candidate.variants.size(), kept = std::min(most_variants, all);
    few.back().variants.clear();
    for (std::size_t v = 0; v < kept; ++v) few.back().variants.push_back(candidate.variants[v * all / kept]);
  }
  std::vector<const Candidate*> candidates;
  for (const Candidate& candidate : few) candidates.push_back(&candidate);
  std::map<std::string, Visibility> seen;
  for (Visibility& v : visibility(scan_effects(model, fit(model, nuisance, {}), candidates, threads), candidates))
    seen.emplace(v.effect, v);
  return seen;
}

double share_of(const Visibility& v, const std::string& other) {
  for (const auto& [effect, share] : v.alike)
    if (effect == other) return share;
  return 0;
}

}  // namespace

std::vector<std::pair<std::string, Experiment>> completed_experiments(const Experiment& experiment) {
  std::vector<std::pair<std::string, Experiment>> all;
  const auto add = [&](const char* column, auto fill) {
    Experiment e = experiment;
    for (MeasuredTrial& trial : e.trials)
      for (std::size_t k = 0; k < trial.collisions.size(); ++k) fill(e, trial, k);
    all.emplace_back(column, std::move(e));
  };
  if (experiment.columns.leg != Presence::all)
    add("leg", [](Experiment& e, MeasuredTrial& trial, std::size_t k) {
      e.columns.leg = Presence::all;
      trial.collisions[k].leg =
          static_cast<int>((static_cast<std::size_t>(e.conditions[trial.condition].first_landing_leg) + k) %
                           static_cast<std::size_t>(e.wheel.legs()));
    });
  if (experiment.columns.omega_plus != Presence::all)
    add("omega_plus_rad_s", [](Experiment& e, MeasuredTrial& trial, std::size_t k) {
      e.columns.omega_plus = Presence::all;
      if (!(e.sensor.noise_sd.value_or(0) > 0)) e.sensor.noise_sd = believed_noise;
      const bool rested = trial.outcome == dynamics::Outcome::rest && k + 1 == trial.collisions.size();
      if (!rested) trial.collisions[k].omega_plus = trial.collisions[k].omega_minus;  // to be drawn anew
    });
  return all;
}

std::vector<MissingColumn> missing_columns(const TransitionModel& model, const Fit& recalibrated,
                                           const std::vector<const Candidate*>& candidates, int threads,
                                           std::uint64_t seed) {
  std::vector<MissingColumn> all;
  const auto completed = model.completed(recalibrated.nuisance, seed);
  if (completed.empty()) return all;
  const auto now = look(*model.simulate(recalibrated.nuisance, {}, seed), recalibrated.nuisance, candidates, threads);
  for (const auto& [column, with_it] : completed) {
    MissingColumn missing;
    missing.column = column;
    const auto then = look(*with_it, recalibrated.nuisance, candidates, threads);
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
