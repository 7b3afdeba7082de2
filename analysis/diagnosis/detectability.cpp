#include "analysis/diagnosis/detectability.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <iterator>
#include <map>
#include <memory>
#include <optional>
#include <string>
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
  const bool upwards = p.upper > p.neutral;  // An effect may have room below none only.
  const double room = upwards ? p.upper - p.neutral : p.neutral - p.lower;
  values[0] = p.neutral + (upwards ? 1 : -1) * std::min(size, room);
  const auto seen = scanned.candidate->report(variant, values);
  for (std::size_t k = 0; k < seen.size(); ++k)
    if (seen[k].second != neutral[k].second) {
      v.parameter = seen[k].first;
      v.smallest = std::abs(seen[k].second - neutral[k].second);
      break;
    }
  v.times_more = std::pow(size / room, 2);
  if (size > room) v.undecidable = "it would have to pass its range to be seen";
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

// This number saves the user trouble: a further change must tell so many times more.
constexpr double worth_a_change = 1.25;

// Two hypotheses that have effects in common and one each of their own.
struct Swap {
  std::vector<EffectTerm> common;
  EffectTerm own, other;
};

std::optional<Swap> swap_of(const std::vector<EffectTerm>& cause, const std::vector<EffectTerm>& rival) {
  if (cause.size() != rival.size()) return std::nullopt;
  const auto is_in = [](const std::vector<EffectTerm>& terms, const EffectTerm& one) {
    return std::ranges::find(terms, one.candidate, &EffectTerm::candidate) != terms.end();
  };
  Swap swap;
  for (const EffectTerm& term : cause) {
    if (is_in(rival, term))
      swap.common.push_back(term);
    else
      swap.own = term;
  }
  for (const EffectTerm& term : rival)
    if (!is_in(cause, term)) swap.other = term;
  const bool one_each =
      swap.common.size() + 1 == cause.size() && !swap.own.values.empty() && !swap.other.values.empty();
  return one_each ? std::optional(std::move(swap)) : std::nullopt;
}

// All that the hypotheses of some swaps have beside what they share.
struct AtIssue {
  std::vector<EffectTerm> shared;       // by all of them
  std::deque<Candidate> candidates;     // with the one variant that was fitted
  std::vector<const Candidate*> known;  // whose they are, in the same order
};

AtIssue at_issue(const Fit& cause, const std::vector<Swap>& swaps) {
  AtIssue all;
  const auto add = [&](const EffectTerm& term) {
    if (std::ranges::find(all.known, term.candidate) != all.known.end()) return;
    all.known.push_back(term.candidate);
    all.candidates.push_back(*term.candidate);
    all.candidates.back().variants = {term.variant};
  };
  for (const EffectTerm& term : cause.terms)
    if (std::ranges::any_of(swaps, [&](const Swap& swap) { return swap.own.candidate == term.candidate; }))
      add(term);
    else
      all.shared.push_back(term);
  for (const Swap& swap : swaps) add(swap.other);
  return all;
}

// Lists the columns of a scan that a term has.
std::vector<Eigen::Index> columns_of(const AtIssue& issue, const EffectScan& scan, const EffectTerm& term) {
  const auto at = std::ranges::find(issue.known, term.candidate) - issue.known.begin();
  std::vector<Eigen::Index> columns;
  if (const ScannedEffect* scanned = scan.find(&issue.candidates[static_cast<std::size_t>(at)]))
    for (std::size_t p = 0; p < term.values.size(); ++p)
      columns.push_back(scanned->first[0] + static_cast<Eigen::Index>(p));
  return columns;
}

// Returns 2 Delta log likelihood to be expected between the two of a swap, at the size of the first one's own.
double separation(const AtIssue& issue, const EffectScan& scan, const Swap& swap) {
  const std::vector<Eigen::Index> own = columns_of(issue, scan, swap.own);
  std::vector<Eigen::Index> others = columns_of(issue, scan, swap.other);
  if (own.empty() || others.empty()) return 0;
  for (const EffectTerm& term : swap.common)
    if (std::ranges::find(issue.known, term.candidate) != issue.known.end())
      for (const Eigen::Index column : columns_of(issue, scan, term)) others.push_back(column);
  Eigen::VectorXd size(static_cast<Eigen::Index>(own.size()));
  for (std::size_t p = 0; p < own.size(); ++p)
    size[static_cast<Eigen::Index>(p)] = swap.own.values[p] - swap.own.candidate->parameters[p].neutral;
  const Eigen::VectorXd cross = scan.information(others, own) * size, whole = scan.whole(others);
  const Eigen::MatrixXd root = markov::resolved_root(scan.information(others, others), whole, resolved_share);
  return std::max(0.0, size.dot(scan.information(own, own) * size) - (root.transpose() * cross).squaredNorm());
}

std::vector<std::size_t> by_separation(const std::vector<NextExperiment>& all) {
  std::vector<double> separations;
  for (const NextExperiment& one : all) separations.push_back(one.separation);
  return falling_order(separations);
}

// Returns what an experiment would tell on average between the cause and its rivals.
double mean_separation(const TransitionModel& experiment, const std::vector<double>& nuisance, const AtIssue& issue,
                       const std::vector<Swap>& swaps, const Rules& rules) {
  std::vector<const Candidate*> scanned;
  for (const Candidate& candidate : issue.candidates) scanned.push_back(&candidate);
  // The data were drawn at this fit's start: one step takes up what their noise moves.
  const Fit shared =
      fit(experiment, nuisance, issue.shared, {.count = {}, .refit_nuisances = true, .most_iterations = 1});
  const EffectScan scan = scan_effects(experiment, shared, scanned, 1);
  double sum = 0;
  for (const Swap& swap : swaps) sum += std::min(rules.seen_gain, separation(issue, scan, swap));
  return sum / static_cast<double>(swaps.size());
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
      v.undecidable = candidate->parameters[0].likely == 0 ? "these data hold no information on it"
                                                           : "these data hold information on it far from none alone";
      continue;
    }
    set_smallest(v, *found, std::sqrt(rules.seen_gain / std::max(information_on_first(scan, own, first), least)));
    v.alike = alike_to(scan, *found, own);
  }
  return all;
}

std::vector<NextExperiment> next_experiments(const TransitionModel& model, const Fit& cause,
                                             const std::vector<std::vector<EffectTerm>>& rivals, const Rules& rules,
                                             int threads, std::uint64_t seed) {
  std::vector<Swap> swaps;
  for (const std::vector<EffectTerm>& rival : rivals)
    if (std::optional<Swap> swap = swap_of(cause.terms, rival)) swaps.push_back(std::move(*swap));
  std::vector<NextExperiment> all;
  if (swaps.empty()) return all;
  const AtIssue issue = at_issue(cause, swaps);
  std::vector<ChangedExperiment> designs = model.alternatives(cause.nuisance, issue.shared, seed);
  std::map<std::string, double> alone;  // amount of each kind that is best by itself
  std::shared_ptr<const TransitionModel> changed;
  NextExperiment base;
  while (!designs.empty()) {
    std::vector<NextExperiment> weighed(designs.size());
    std::vector<std::shared_ptr<const TransitionModel>> made(designs.size());
    markov::parallel_for(designs.size(), threads, [&](std::size_t i) {
      NextExperiment& one = weighed[i];
      one = base;
      one.change += (base.change.empty() ? "" : " and ") + designs[i].words;
      if (!designs[i].kind.empty()) one.changes.emplace_back(designs[i].kind, designs[i].amount);
      made[i] = designs[i].make();
      one.separation = mean_separation(*made[i], cause.nuisance, issue, swaps, rules);
    });
    const std::vector<std::size_t> order = by_separation(weighed);
    if (base.changes.empty())
      for (const std::size_t k : order)
        if (!weighed[k].changes.empty()) alone.insert(weighed[k].changes[0]);
    const auto best = weighed.begin() + static_cast<std::ptrdiff_t>(order.front());
    const double to_beat = base.changes.empty() ? weighed.front().separation : base.separation;
    designs.clear();
    if (!best->changes.empty() && best->separation > worth_a_change * to_beat) {
      base = *best;
      changed = made[static_cast<std::size_t>(best - weighed.begin())];
      for (ChangedExperiment& one : changed->alternatives(cause.nuisance, issue.shared, seed)) {
        const bool has =
            std::ranges::find(base.changes, one.kind, &std::pair<std::string, double>::first) != base.changes.end();
        if (const auto own = alone.find(one.kind); !has && own != alone.end() && own->second == one.amount)
          designs.push_back(std::move(one));
      }
    }
    std::ranges::move(weighed, std::back_inserter(all));
  }
  std::vector<NextExperiment> ranked;
  for (const std::size_t k : by_separation(all)) ranked.push_back(std::move(all[k]));
  return ranked;
}

}  // namespace metastable::analysis
