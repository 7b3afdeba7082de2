#include "analysis/diagnosis/visibility.h"

#include <algorithm>
#include <cmath>

#include "markov/dense_matrix.h"
#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

// Returns the information that an effect's parameters, `count` columns of the scan, take up of what crosses with them.
double taken_up(const EffectScan& scan, Eigen::Index first, Eigen::Index count, const Eigen::VectorXd& cross) {
  const Eigen::MatrixXd root = markov::resolved_root(scan.information.block(first, first, count, count),
                                                     scan.whole.segment(first, count), resolved_share);
  return (root.transpose() * cross).squaredNorm();
}

}  // namespace

std::vector<Visibility> visibility(const EffectScan& scan, const std::vector<const Candidate*>& candidates,
                                   const Rules& rules) {
  std::vector<Visibility> all;
  for (const Candidate* candidate : candidates) {
    Visibility v;
    v.effect = candidate->id;
    v.undecidable = candidate->undecidable;
    const auto found = std::find_if(scan.effects.begin(), scan.effects.end(),
                                    [&](const ScannedEffect& e) { return e.candidate == candidate; });
    if (found == scan.effects.end()) {
      if (v.undecidable.empty() && !candidate->parameters.empty()) v.undecidable = "not scanned";
      all.push_back(std::move(v));
      continue;
    }
    const auto count = static_cast<Eigen::Index>(candidate->parameters.size());
    const Eigen::Index first = found->first[found->best];
    const Eigen::MatrixXd own = scan.information.block(first, first, count, count);
    const double least = resolved_share * scan.whole[first];
    if (!(own(0, 0) > least)) {
      v.undecidable = "these data hold no information on it";
      all.push_back(std::move(v));
      continue;
    }
    // This is the first parameter's size, the others free to follow.
    double information = own(0, 0);
    if (count > 1) {
      const Eigen::VectorXd cross = own.block(1, 0, count - 1, 1);
      const Eigen::MatrixXd rest = markov::resolved_root(own.block(1, 1, count - 1, count - 1),
                                                         scan.whole.segment(first + 1, count - 1), resolved_share);
      information -= (rest.transpose() * cross).squaredNorm();
    }
    const FreeParameter& p = candidate->parameters[0];
    const double size = std::sqrt(rules.seen_gain / std::max(information, least));
    std::vector<double> values;
    for (const FreeParameter& one : candidate->parameters) values.push_back(one.neutral);
    const auto neutral = candidate->report(candidate->variants[found->best], values);
    values[0] = std::clamp(p.neutral + size, p.lower, p.upper);
    const auto seen = candidate->report(candidate->variants[found->best], values);
    for (std::size_t k = 0; k < seen.size(); ++k)
      if (seen[k].second != neutral[k].second) {
        v.parameter = seen[k].first;
        v.smallest = std::abs(seen[k].second - neutral[k].second);
        break;
      }
    v.times_more = std::pow(size / (p.upper - p.neutral), 2);
    if (p.neutral + size > p.upper) v.undecidable = "it would have to pass its range to be seen";

    // This asks along the direction in which it was found (or its first parameter) what others explain of it.
    Eigen::VectorXd direction = found->start[found->best];
    if (count == 1 || !(direction.norm() > 0)) direction = Eigen::VectorXd::Unit(count, 0);
    const double strength = direction.dot(own * direction);
    for (const ScannedEffect& other : scan.effects) {
      if (other.candidate == candidate) continue;
      double share = 0;
      const auto size_of = static_cast<Eigen::Index>(other.candidate->parameters.size());
      for (const Eigen::Index at : other.first) {
        const Eigen::VectorXd cross = scan.information.block(at, first, size_of, count) * direction;
        share = std::max(share, taken_up(scan, at, size_of, cross) / strength);
      }
      if (share > 0.5) v.alike.emplace_back(other.candidate->id, std::min(1.0, share));
    }
    std::sort(v.alike.begin(), v.alike.end(), [](const auto& a, const auto& b) { return a.second > b.second; });
    all.push_back(std::move(v));
  }
  return all;
}

std::vector<NextExperiment> next_experiments(const TransitionModel& model, const Fit& cause,
                                             const std::vector<EffectTerm>& rival, int threads, std::uint64_t seed) {
  std::vector<NextExperiment> all;
  if (cause.terms.size() != 1 || rival.size() != 1 || cause.terms[0].values.empty() || rival[0].values.empty())
    return all;
  auto alternatives = model.alternatives(cause.nuisance, seed);
  all.resize(alternatives.size());
  markov::parallel_for(alternatives.size(), threads, [&](std::size_t i) {
    const TransitionModel& changed = *alternatives[i].second;
    all[i].change = alternatives[i].first;
    const Fit plain = fit(changed, cause.nuisance, {});
    // The same effects stand in the changed experiment, with the one variant that was fitted.
    Candidate first = *cause.terms[0].candidate, second = *rival[0].candidate;
    first.variants = {cause.terms[0].variant};
    second.variants = {rival[0].variant};
    const EffectScan scan = scan_effects(changed, plain, {&first, &second}, 1);
    if (scan.effects.size() != 2) return;
    const auto n = static_cast<Eigen::Index>(first.parameters.size());
    const auto m = static_cast<Eigen::Index>(second.parameters.size());
    Eigen::VectorXd size(n);
    for (Eigen::Index p = 0; p < n; ++p)
      size[p] =
          cause.terms[0].values[static_cast<std::size_t>(p)] - first.parameters[static_cast<std::size_t>(p)].neutral;
    const Eigen::VectorXd cross = scan.information.block(n, 0, m, n) * size;
    all[i].separation =
        std::max(0.0, size.dot(scan.information.block(0, 0, n, n) * size) - taken_up(scan, n, m, cross));
  });
  std::sort(all.begin(), all.end(),
            [](const NextExperiment& a, const NextExperiment& b) { return a.separation > b.separation; });
  return all;
}

}  // namespace metastable::analysis
