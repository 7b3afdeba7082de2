#include "analysis/diagnosis/detectability.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "analysis/statistics/falling_order.h"
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

// Returns the information on an effect's first parameter, the others free to follow.
double information_on_first(const EffectScan& scan, const Eigen::MatrixXd& own, Eigen::Index first) {
  const Eigen::Index others = own.rows() - 1;
  if (others == 0) return own(0, 0);
  const Eigen::VectorXd cross = own.block(1, 0, others, 1);
  const Eigen::MatrixXd rest =
      markov::resolved_root(own.block(1, 1, others, others), scan.whole.segment(first + 1, others), resolved_share);
  return own(0, 0) - (rest.transpose() * cross).squaredNorm();
}

// Says how large the effect is, in the number that it reports, at a size of its first parameter.
void set_smallest(Detectability& v, const ScannedEffect& scanned, double size) {
  const FreeParameter& p = scanned.candidate->parameters[0];
  std::vector<double> values;
  for (const FreeParameter& one : scanned.candidate->parameters) values.push_back(one.neutral);
  const std::vector<double>& variant = scanned.candidate->variants[scanned.best];
  const auto neutral = scanned.candidate->report(variant, values);
  values[0] = std::clamp(p.neutral + size, p.lower, p.upper);
  const auto seen = scanned.candidate->report(variant, values);
  for (std::size_t k = 0; k < seen.size(); ++k)
    if (seen[k].second != neutral[k].second) {
      v.parameter = seen[k].first;
      v.smallest = std::abs(seen[k].second - neutral[k].second);
      break;
    }
  v.times_more = std::pow(size / (p.upper - p.neutral), 2);
  if (p.neutral + size > p.upper) v.undecidable = "it would have to pass its range to be seen";
}

// Asks along the direction in which the effect was found (or its first parameter) what others explain of it.
std::vector<std::pair<std::string, double>> alike_to(const EffectScan& scan, const ScannedEffect& scanned,
                                                     const Eigen::MatrixXd& own) {
  const Eigen::Index count = own.rows();
  Eigen::VectorXd direction = scanned.start[scanned.best];
  if (count == 1 || !(direction.norm() > 0)) direction = Eigen::VectorXd::Unit(count, 0);
  const double strength = direction.dot(own * direction);
  std::vector<std::pair<std::string, double>> found;
  std::vector<double> shares;
  for (const ScannedEffect& other : scan.effects) {
    if (other.candidate == scanned.candidate) continue;
    double share = 0;
    const auto size_of = static_cast<Eigen::Index>(other.candidate->parameters.size());
    for (const Eigen::Index at : other.first) {
      const Eigen::VectorXd cross = scan.information.block(at, scanned.first[scanned.best], size_of, count) * direction;
      share = std::max(share, taken_up(scan, at, size_of, cross) / strength);
    }
    if (!(share > 0.5)) continue;
    found.emplace_back(other.candidate->id, std::min(1.0, share));
    shares.push_back(found.back().second);
  }
  std::vector<std::pair<std::string, double>> alike;
  for (const std::size_t k : falling_order(shares)) alike.push_back(std::move(found[k]));
  return alike;
}

}  // namespace

std::vector<Detectability> detectability(const EffectScan& scan, const std::vector<const Candidate*>& candidates,
                                         const Rules& rules) {
  std::vector<Detectability> all;
  for (const Candidate* candidate : candidates) {
    Detectability& v = all.emplace_back();
    v.effect = candidate->id;
    v.undecidable = candidate->undecidable;
    const ScannedEffect* found = scan.find(candidate);
    if (!found) {
      if (v.undecidable.empty() && !candidate->parameters.empty()) v.undecidable = "not scanned";
      continue;
    }
    const auto count = static_cast<Eigen::Index>(candidate->parameters.size());
    const Eigen::Index first = found->first[found->best];
    const Eigen::MatrixXd own = scan.information.block(first, first, count, count);
    const double least = resolved_share * scan.whole[first];
    if (!(own(0, 0) > least)) {
      v.undecidable = "these data hold no information on it";
      continue;
    }
    set_smallest(v, *found, std::sqrt(rules.seen_gain / std::max(information_on_first(scan, own, first), least)));
    v.alike = alike_to(scan, *found, own);
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
  std::vector<double> separations;
  for (const NextExperiment& one : all) separations.push_back(one.separation);
  std::vector<NextExperiment> ranked;
  for (const std::size_t k : falling_order(separations)) ranked.push_back(std::move(all[k]));
  return ranked;
}

}  // namespace metastable::analysis
