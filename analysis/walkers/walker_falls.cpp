#include "analysis/walkers/walker_falls.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <utility>

#include "analysis/statistics/interval_95.h"
#include "markov/mesh/batch_map.h"
#include "markov/mesh/coupled_passage.h"
#include "markov/mesh/mesh.h"
#include "markov/mesh/mesh_passage.h"
#include "markov/mesh/noise_frame.h"
#include "markov/parallel.h"
#include "markov/passage/last_steps.h"
#include "markov/transition_rows/score_lattice.h"

namespace metastable::analysis {
namespace {

constexpr double node_of_no_weight = 1e-6;  // share of a step's falls
constexpr double score_spacing = 0.2, score_spacing_of_several = 0.6, score_reach = 8.5;
constexpr std::uint64_t offsets_of_scores = 0x6000;

/// Holds scores tried from a node, where they lead, and what they are worth as the noise of step k before the fall.
struct Tried {
  std::vector<double> score, next;
  std::vector<std::uint8_t> falls;
  std::vector<std::vector<double>> weight;  ///< [k][row of score]
};

class Falls {
 public:
  Falls(const markov::BatchMap& map, std::span<const double> start, const std::vector<NamedNoise>& noises,
        const markov::MeshOptions& options, const markov::MeshStudy& study, int threads)
      : map_(map),
        noises_(noises),
        threads_(threads),
        spacing_(options.spacing),
        lattice_(map.scores, map.scores == 1 ? score_spacing : score_spacing_of_several, score_reach),
        frames_(study.frames),
        mesh_(map, frames_, start, markov::with_gaits(options, study.gaits)),
        passage_(markov::passage_with_gaits(mesh_, start, study.gaits.orbits, frames_).passage),
        turns_(map.phases) {
    const markov::Chain chain = mesh_.chain();
    last_ = markov::last_steps(chain, passage_.visits, steps_of_a_fall);
    const markov::GaitOrbit& orbit = study.gaits.orbits.front();
    for (std::size_t i = 0; i < mesh_.size(); ++i) {
      state_.push_back(mesh_.state(i));
      phase_.push_back(mesh_.phase(i));
    }
    turn_ = phase_;
    if (study.gaits.orbits.size() == 1 && orbit.size() > 1) {
      const markov::GaitClasses classes = markov::gait_classes(mesh_, study.gaits.orbits, frames_);
      for (std::size_t i = 0; i < mesh_.size(); ++i) turn_[i] += map_.phases * static_cast<int>(classes.of_node[i]);
      turns_ = map_.phases * static_cast<int>(orbit.size());
    }
    bound_ = markov::passage_to(chain, study.period > 0 ? near_gait(orbit) : often_met()).fail;
  }

  WalkerFalls tell() {
    WalkerFalls falls;
    falls.moments.state_names = map_.names;
    for (std::size_t k = falls.moments.state_names.size(); k < static_cast<std::size_t>(map_.dimension); ++k)
      falls.moments.state_names.push_back("x" + std::to_string(k + 1));
    for (const NamedNoise& noise : noises_) falls.moments.noise_names.push_back(noise.name);
    falls.moments.by_phase.assign(static_cast<std::size_t>(turns_), 0.0);
    tried_.resize(mesh_.size());
    const std::vector<std::vector<std::size_t>> shares = nodes_by_call();
    markov::parallel_for(shares.size(), threads_, [&](std::size_t share) { try_noise_from(shares[share]); });
    for (std::size_t k = 0; k < last_.share.size(); ++k) falls.moments.last.push_back(profile(last_.share[k], k));
    falls.moments.regime = profile(passage_.distribution, {});
    for (std::size_t k = last_.likeliest.size(); k-- > 0;) falls.moments.likeliest.push_back(path_step(k));
    for (std::size_t i = 0; i < mesh_.size(); ++i) {
      falls.moments.by_phase[static_cast<std::size_t>(turn_[i])] += last_.share[0][i];
      falls.section.push_back(
          {state_[i], place(phase_[i], state_[i]), passage_.distribution[i], last_.share[0][i], bound_[i]});
    }
    return falls;
  }

 private:
  /// Marks the nodes within one sd of where a gait comes through.
  std::vector<std::uint8_t> near_gait(const markov::GaitOrbit& orbit) const {
    std::vector<std::vector<double>> turns;
    for (const auto& state : orbit) turns.push_back(place(0, state));
    std::vector<std::uint8_t> near;
    for (std::size_t i = 0; i < state_.size(); ++i) {
      const std::vector<double> at = place(phase_[i], state_[i]);
      near.push_back(std::any_of(turns.begin(), turns.begin() + (phase_[i] == 0 ? turns.end() - turns.begin() : 1),
                                 [&](const std::vector<double>& turn) {
                                   double square = 0;
                                   for (std::size_t k = 0; k < at.size(); ++k)
                                     square += (at[k] - turn[k]) * (at[k] - turn[k]);
                                   return square <= 1;
                                 }));
    }
    return near;
  }

  /// Marks the nodes that are met most in the metastable regime, half of it.
  std::vector<std::uint8_t> often_met() const {
    const std::vector<double>& met = passage_.distribution;
    std::vector<std::size_t> order(met.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return met[a] > met[b]; });
    std::vector<std::uint8_t> often(met.size(), 0);
    double share = 0;
    for (std::size_t k = 0; k < order.size() && share < 0.5 * map_.phases; ++k) {
      often[order[k]] = 1;
      share += met[order[k]];
    }
    return often;
  }

  std::vector<double> place(int phase, std::span<const double> state) const {
    const markov::NoiseFrame& frame = frames_[static_cast<std::size_t>(phase)];
    const std::size_t d = state.size();
    std::vector<double> u(d, 0.0);
    for (std::size_t k = 0; k < d; ++k)
      for (std::size_t i = 0; i < d; ++i) u[k] += frame.inverse[k * d + i] * (state[i] - frame.centre[i]);
    return u;
  }

  /// Returns how far the nodes are apart along a number of the state: the side of an even distribution that has the
  /// variance of one over the cell around a node.
  double width(int phase, std::size_t number) const {
    const markov::NoiseFrame& frame = frames_[static_cast<std::size_t>(phase)];
    const std::size_t d = frame.centre.size();
    double square = 0;
    for (std::size_t k = 0; k < d; ++k) square += frame.axes[number * d + k] * frame.axes[number * d + k];
    return spacing_ * std::sqrt(square);
  }

  bool matters(std::size_t i) const {
    return std::find(last_.likeliest.begin(), last_.likeliest.end(), i) != last_.likeliest.end() ||
           std::any_of(last_.share.begin(), last_.share.end(),
                       [&](const auto& share) { return share[i] > node_of_no_weight; });
  }

  /// Returns the nodes that matter, those of one phase that are stepped in one call together.
  std::vector<std::vector<std::size_t>> nodes_by_call() const {
    const std::size_t most = map_.dear ? std::max<std::size_t>(1, markov::rows_of_a_dear_call / lattice_.size()) : 1;
    std::vector<std::vector<std::size_t>> calls;
    for (int phase = 0; phase < map_.phases; ++phase) {
      std::vector<std::size_t> nodes;
      for (std::size_t i = 0; i < mesh_.size(); ++i) {
        if (phase_[i] != phase || !matters(i)) continue;
        nodes.push_back(i);
        if (nodes.size() == most) calls.push_back(std::exchange(nodes, {}));
      }
      if (!nodes.empty()) calls.push_back(std::move(nodes));
    }
    return calls;
  }

  /// Steps the scores tried from nodes of one phase.
  void try_noise_from(const std::vector<std::size_t>& nodes) {
    const std::size_t m = lattice_.size(), d = state_.front().size(), s = noises_.size();
    std::vector<double> scores(nodes.size() * m * s), weight(nodes.size() * m), states;
    std::vector<std::size_t> stepped;  // those inside the section
    for (const std::size_t i : nodes)
      if (!map_.inside || map_.inside(phase_[i], state_[i])) stepped.push_back(i);
    for (std::size_t k = 0; k < nodes.size(); ++k)
      place_scores(nodes[k], std::span(scores).subspan(k * m * s, m * s), std::span(weight).subspan(k * m, m));
    std::vector<double> asked;
    for (std::size_t k = 0; k < nodes.size(); ++k) {
      if (!std::binary_search(stepped.begin(), stepped.end(), nodes[k])) continue;
      for (std::size_t n = 0; n < m; ++n) states.insert(states.end(), state_[nodes[k]].begin(), state_[nodes[k]].end());
      asked.insert(asked.end(), &scores[k * m * s], &scores[k * m * s] + m * s);
    }
    std::vector<double> next(stepped.size() * m * d);
    std::vector<std::uint8_t> falls(stepped.size() * m, 0);
    if (!stepped.empty()) markov::checked_step(map_, phase_[nodes.front()], states, asked, next, falls);
    for (std::size_t k = 0, at = 0; k < nodes.size(); ++k) {
      Tried tried{{&scores[k * m * s], &scores[k * m * s] + m * s},
                  std::vector<double>(m * d),
                  std::vector<std::uint8_t>(m, 1),
                  {}};
      if (std::binary_search(stepped.begin(), stepped.end(), nodes[k])) {
        tried.next.assign(&next[at * m * d], &next[at * m * d] + m * d);
        tried.falls.assign(&falls[at * m], &falls[at * m] + m);
        ++at;
      }
      weigh(nodes[k], std::span(weight).subspan(k * m, m), tried);
      tried_[nodes[k]] = std::move(tried);
    }
  }

  void place_scores(std::size_t i, std::span<double> scores, std::span<double> weight) const {
    std::vector<double> offset;
    for (std::size_t k = 0; k < noises_.size(); k += 4) {
      const auto u = markov::uniforms(1, offsets_of_scores + k / 4, i, 0);
      offset.insert(offset.end(), u.begin(),
                    u.begin() + static_cast<std::ptrdiff_t>(std::min<std::size_t>(4, noises_.size() - k)));
    }
    lattice_.place(offset, scores, weight);
  }

  /// Says what each score is worth as the noise of each of the last steps.
  void weigh(std::size_t i, std::span<const double> weight, Tried& tried) const {
    const std::size_t m = lattice_.size(), d = state_[i].size();
    tried.weight.assign(last_.share.size(), std::vector<double>(m, 0.0));
    const int landing_phase = (phase_[i] + 1) % map_.phases;
    for (std::size_t n = 0; n < m; ++n) {
      const double met = passage_.visits[i] * weight[n];
      if (tried.falls[n]) {
        tried.weight[0][n] = met;
        continue;
      }
      const auto corners = mesh_.corners(landing_phase, std::span(tried.next).subspan(n * d, d));
      for (std::size_t c = 0; c < static_cast<std::size_t>(corners.count); ++c)
        for (std::size_t k = 1; k < last_.share.size(); ++k)
          tried.weight[k][n] += met * corners.weight[c] * last_.fails_in[k - 1][corners.node[c]];
    }
  }

  double noise(std::size_t which, double score) const { return noises_[which].mean + noises_[which].sd * score; }

  /// Describes step k before the fall, or all steps.
  StepProfile profile(const std::vector<double>& share, std::optional<std::size_t> k) const {
    StepProfile told;
    double all = 0;
    for (std::size_t i = 0; i < share.size(); ++i) {
      told.bound_to_fail += share[i] * bound_[i];
      all += share[i];
    }
    told.bound_to_fail /= all;
    for (std::size_t number = 0; number < state_.front().size(); ++number) {
      std::vector<double> values, widths;
      for (std::size_t i = 0; i < state_.size(); ++i) {
        values.push_back(state_[i][number]);
        widths.push_back(width(phase_[i], number));
      }
      told.state.push_back(middle_90(values, share, widths));
    }
    for (std::size_t which = 0; which < noises_.size(); ++which) told.noise.push_back(noise_profile(which, k));
    return told;
  }

  Estimate noise_profile(std::size_t which, std::optional<std::size_t> k) const {
    if (!k) return {noise(which, 0), noise(which, -normal_90), noise(which, normal_90)};
    std::vector<double> values, weights;
    for (const Tried& tried : tried_)
      for (std::size_t n = 0; n < tried.falls.size(); ++n) {
        if (!(tried.weight[*k][n] > 0)) continue;
        values.push_back(noise(which, tried.score[n * noises_.size() + which]));
        weights.push_back(tried.weight[*k][n]);
      }
    return middle_90(values, weights);
  }

  PathStep path_step(std::size_t k) const {
    const std::size_t i = last_.likeliest[k], d = state_[i].size(), scores = noises_.size();
    PathStep step{turn_[i], state_[i], {}};
    const Tried& tried = tried_[i];
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t n = 0; n < tried.falls.size(); ++n) {
      if ((tried.falls[n] != 0) != (k == 0)) continue;
      const std::span<const double> score = std::span(tried.score).subspan(n * scores, scores);
      double far = 0;
      if (k == 0) {
        for (const double z : score) far += z * z;
      } else {
        const std::size_t next = last_.likeliest[k - 1];
        const auto at = place(phase_[next], std::span(tried.next).subspan(n * d, d)),
                   to = place(phase_[next], state_[next]);
        for (std::size_t axis = 0; axis < d; ++axis) far += (at[axis] - to[axis]) * (at[axis] - to[axis]);
      }
      if (far >= least) continue;
      least = far;
      step.noise.clear();
      for (std::size_t which = 0; which < scores; ++which) step.noise.push_back(noise(which, score[which]));
    }
    return step;
  }

  const markov::BatchMap& map_;
  const std::vector<NamedNoise>& noises_;
  int threads_;
  double spacing_;
  markov::ScoreLattice lattice_;
  std::vector<markov::NoiseFrame> frames_;
  markov::Mesh mesh_;
  markov::MeshPassage passage_;
  std::vector<std::vector<double>> state_;
  std::vector<int> phase_, turn_;  ///< of each node; turns go round a gait of several revolutions
  int turns_;
  std::vector<double> bound_;
  markov::LastSteps last_;
  std::vector<Tried> tried_;
};

}  // namespace

WalkerFalls how_it_falls(const markov::BatchMap& map, std::span<const double> start,
                         const std::vector<NamedNoise>& noises, const markov::MeshStudy& study,
                         const markov::MeshStudyOptions& options) {
  if (noises.size() != static_cast<std::size_t>(map.scores))
    throw std::invalid_argument("how it falls: one noise for each score expected");
  const double spacing = study.sizes.at(1).spacing;
  WalkerFalls falls =
      Falls(
          markov::over_revolutions(map, static_cast<int>(study.frames.size()) / map.phases), start, noises,
          {.spacing = spacing, .seed = options.seed, .most_bytes = options.most_bytes, .row_states = study.row_states},
          study, options.threads)
          .tell();
  falls.spacing = spacing;
  return falls;
}

std::vector<NamedNoise> noises_of(const WalkerSetting& setting) {
  return {{"slope [deg]", setting.slope_deg, setting.slope_sd_deg}};
}

WalkerFalls how_it_falls(const WalkerSetting& setting, const WalkerStudy& study,
                         const markov::MeshStudyOptions& options) {
  const dynamics::WalkerMap map = setting.map();
  const dynamics::Gait gait = dynamics::find_gait(map.walker(), setting.slope_deg * degree);
  return how_it_falls(batch_map(map), gait_state(setting, gait), noises_of(setting), study.passage, options);
}

}  // namespace metastable::analysis
