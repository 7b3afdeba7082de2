#include "analysis/fitting/far_sizes.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>

#include "analysis/fitting/cause_ranking.h"
#include "analysis/fitting/model_fit.h"
#include "analysis/fitting/rules.h"
#include "analysis/fitting/transition_model.h"

namespace metastable::analysis {
namespace {

// These numbers save time.
constexpr double far_shares[]{1.0 / 32, 1.0 / 8, 1.0 / 2};  // of the way from none to a bound: sizes that are tried
// The likelihood of an effect may be flat at none: a limit of an actuator changes nothing beyond all recorded inputs.
// These sizes are then tried, each with the recalibrated parameters refitted, since those may have imitated the effect.
constexpr double flat_shares[]{1.0 / 8, 1.0 / 4, 1.0 / 2, 3.0 / 4, 15.0 / 16};
constexpr std::size_t most_far = 2;            // effects that are refined: the likeliest at these sizes
constexpr int far_passes = 2, far_rounds = 4;  // Rounds about the best size are each three times as fine as the last.

// A likelihood is a staircase if its third difference near the top exceeds so many nats, where smooth ones have none.
constexpr double rough_stairs = 0.5;
// Sizes are then compared within this share of the size, so many to a side; those within so many nats are as likely.
constexpr double stairs_reach = 0.15, stairs_fall = 3;
constexpr int stairs_to_a_side = 40;

class FarSearch {
 public:
  FarSearch(const TransitionModel& model, const Candidate& candidate, int threads,
            const std::function<void()>& heartbeat)
      : model_(model), candidate_(candidate), threads_(threads), heartbeat_(heartbeat) {}

  // Returns the log likelihood of the data with each of these sizes, which rise. Of those beyond a bound the bound
  // itself is left.
  std::vector<double> likely_with(const std::vector<double>& nuisance, std::vector<double>& sizes) const {
    if (heartbeat_) heartbeat_();
    const FreeParameter& p = candidate_.parameters[0];
    for (double& size : sizes) size = std::clamp(size, p.lower, p.upper);
    sizes.erase(std::unique(sizes.begin(), sizes.end()), sizes.end());
    std::vector<double> likely(sizes.size());
    model_.side_by_side(sizes.size(), threads_, [&](std::size_t i) {
      const EffectTerm term{&candidate_, candidate_.variants.front(), {sizes[i]}};
      likely[i] = model_.evaluate(nuisance, {&term, 1}).total();
    });
    return likely;
  }

  // Returns the likeliest of a few sizes far from none, and the log likelihood with it.
  std::pair<double, double> likeliest(const std::vector<double>& nuisance) const {
    const FreeParameter& p = candidate_.parameters[0];
    std::vector<double> sizes;
    for (const double share : far_shares)
      for (const double end : {p.lower, p.upper})
        if (end != p.neutral) sizes.push_back(p.neutral + share * (end - p.neutral));
    std::ranges::sort(sizes);
    const std::vector<double> likely = likely_with(nuisance, sizes);
    const auto best = std::ranges::max_element(likely);
    return {sizes[static_cast<std::size_t>(best - likely.begin())], *best};
  }

  // Returns the same of other sizes, with the recalibrated parameters as they are beside each.
  std::pair<double, double> likeliest_refitted(const std::vector<double>& nuisance) const {
    const FreeParameter& p = candidate_.parameters[0];
    std::pair<double, double> best{p.neutral, -std::numeric_limits<double>::infinity()};
    for (const double share : flat_shares)
      for (const double end : {p.lower, p.upper}) {
        if (end == p.neutral) continue;
        if (heartbeat_) heartbeat_();
        const double size = p.neutral + share * (end - p.neutral);
        const EffectTerm term{&candidate_, candidate_.variants.front(), {size}};
        const double likely = fit(model_, nuisance, {term}, {.count = {}, .refit_effects = false}).log_likelihood;
        if (likely > best.second) best = {size, likely};
      }
    return best;
  }

  // Sets the likely size, which it seeks in ever finer steps about a size that is likelier than none, and returns the
  // log likelihood with it. An effect that moves a threshold makes the likelihood a staircase: its sizes that are about
  // as likely set the blur.
  double refine(FreeParameter& p, double best, std::vector<double> nuisance) const {
    double most = 0;
    const auto about = [&](double reach, int to_a_side) {
      std::vector<double> sizes;
      for (int k = -to_a_side; k <= to_a_side; ++k) sizes.push_back(best + reach * k / to_a_side);
      std::vector<double> likely = likely_with(nuisance, sizes);
      const auto top = std::ranges::max_element(likely);
      best = sizes[static_cast<std::size_t>(top - likely.begin())];
      most = *top;
      return std::pair(std::move(sizes), std::move(likely));
    };
    double roughness = 0;  // It is the largest third difference of the log likelihood.
    for (int pass = 0; pass < far_passes; ++pass) {
      const EffectTerm term{&candidate_, candidate_.variants.front(), {best}};
      nuisance = fit(model_, nuisance, {term}, {.count = {}, .refit_effects = false}).nuisance;
      double reach = std::abs(best - p.neutral);
      for (int round = 0; round < far_rounds; ++round, reach /= 3) {
        const std::vector<double> likely = about(reach, 4).second;
        roughness = 0;
        for (std::size_t i = 3; i < likely.size(); ++i)
          roughness = std::max(roughness, std::abs(likely[i] - 3 * likely[i - 1] + 3 * likely[i - 2] - likely[i - 3]));
      }
    }
    const auto set_likely = [&] { p.likely = best != 0 ? best : p.step; };  // 0 says that there is none.
    set_likely();
    if (roughness < rough_stairs) return most;
    const auto [sizes, likely] = about(stairs_reach * std::abs(best - p.neutral), stairs_to_a_side);
    set_likely();
    for (std::size_t i = 0; i < sizes.size(); ++i)
      if (likely[i] > most - stairs_fall) p.blur = std::max(p.blur, std::abs(sizes[i] - best));
    if (sizes.size() > 1) p.blur += sizes[1] - sizes[0];
    return most;
  }

 private:
  const TransitionModel& model_;
  const Candidate& candidate_;
  int threads_;
  const std::function<void()>& heartbeat_;
};

bool is_flat(const Candidate& candidate, const RankedCause& single) {
  return candidate.seek_far && candidate.undecidable.empty() && !single.not_decided.empty();
}

}  // namespace

bool any_flat(const std::vector<const Candidate*>& candidates, const std::vector<RankedCause>& singles) {
  for (std::size_t i = 0; i < candidates.size(); ++i)
    if (is_flat(*candidates[i], singles[i])) return true;
  return false;
}

std::vector<Candidate> with_far_sizes(const TransitionModel& model, const Fit& recalibrated,
                                      const std::vector<const Candidate*>& candidates,
                                      const std::vector<RankedCause>& singles, const Rules& rules, int threads,
                                      const std::function<void()>& heartbeat) {
  const double told_apart = rules.told_apart / 2;  // in log likelihood
  struct FarSize {
    std::size_t candidate;
    double size, likely;
  };
  std::vector<FarSize> far;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if (!candidates[i]->seek_far) continue;
    const FarSearch search(model, *candidates[i], threads, heartbeat);
    const auto [size, likely] = is_flat(*candidates[i], singles[i]) ? search.likeliest_refitted(recalibrated.nuisance)
                                                                    : search.likeliest(recalibrated.nuisance);
    if (likely > recalibrated.log_likelihood + told_apart) far.push_back({i, size, likely});
  }
  std::ranges::stable_sort(far, std::ranges::greater{}, &FarSize::likely);
  far.resize(std::min(far.size(), most_far));
  std::vector<Candidate> all;
  for (const auto& [i, size, likely] : far) {
    FreeParameter p = candidates[i]->parameters[0];
    const double refined = FarSearch(model, *candidates[i], threads, heartbeat).refine(p, size, recalibrated.nuisance);
    const double reached = singles[i].fitted() ? singles[i].fit.log_likelihood : recalibrated.log_likelihood;
    if (refined < std::max(reached, recalibrated.log_likelihood) + told_apart) continue;
    if (all.empty())
      for (const Candidate* candidate : candidates) all.push_back(*candidate);
    all[i].parameters[0] = p;
  }
  return all;
}

}  // namespace metastable::analysis
