#include "analysis/walkers/walker_falls.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "markov/mesh/mesh.h"
#include "markov/mesh/mesh_passage.h"
#include "markov/mesh/noise_frame.h"
#include "markov/mesh/score_lattice.h"
#include "markov/parallel.h"
#include "markov/passage/last_steps.h"

namespace metastable::analysis {
namespace {

constexpr int steps_of_a_fall = 6;
constexpr double node_of_no_weight = 1e-6;  // share of a step's falls
constexpr double slope_spacing = 0.2, slope_reach = 8.5;
constexpr std::uint64_t offsets_of_slopes = 0x6000;

/// Slopes tried from a node, where they lead, and what they are worth as the slope of step k before the fall.
struct Tried {
  std::vector<double> score, next;
  std::vector<std::uint8_t> falls;
  std::vector<std::vector<double>> weight;  ///< [k][score]
};

class Falls {
 public:
  Falls(const WalkerSetting& setting, const markov::MeshOptions& options, int threads)
      : setting_(setting),
        batch_(batch_map(setting.map())),
        threads_(threads),
        lattice_(1, slope_spacing, slope_reach) {
    const std::vector<double> start =
        gait_state(setting, dynamics::find_gait(setting.map().walker(), setting.slope_deg * degree));
    const auto frames = markov::noise_frames(batch_, start);
    frame_ = frames.front();
    mesh_.emplace(batch_, frames, start, options);
    passage_ = markov::mesh_passage(*mesh_, start);
    for (std::size_t i = 0; i < mesh_->size(); ++i) state_.push_back(mesh_->state(i));
    const markov::Chain chain = mesh_->chain();
    last_ = markov::last_steps(chain, passage_.visits, steps_of_a_fall);
    std::vector<std::uint8_t> near_gait;
    for (std::size_t i = 0; i < mesh_->size(); ++i) {
      double square = 0;
      for (const double u : place(state_[i])) square += u * u;
      near_gait.push_back(square <= 1);
    }
    bound_ = markov::passage_to(chain, near_gait).fail;
  }

  WalkerFalls tell() {
    WalkerFalls falls;
    falls.moments.state_names = setting_.map().names();
    falls.moments.noise_names = {"slope [deg]"};
    falls.moments.by_phase = {1};
    tried_.resize(mesh_->size());
    markov::parallel_for(mesh_->size(), threads_, [&](std::size_t i) {
      if (matters(i)) tried_[i] = slopes_from(i);
    });
    for (std::size_t k = 0; k < last_.share.size(); ++k) falls.moments.last.push_back(profile(last_.share[k], k));
    falls.moments.regime = profile(passage_.distribution, {});
    for (std::size_t k = last_.likeliest.size(); k-- > 0;) falls.moments.likeliest.push_back(path_step(k));
    for (std::size_t i = 0; i < mesh_->size(); ++i)
      falls.section.push_back({state_[i], place(state_[i]), passage_.distribution[i], last_.share[0][i], bound_[i]});
    return falls;
  }

 private:
  std::vector<double> place(std::span<const double> state) const {
    const std::size_t d = state.size();
    std::vector<double> u(d, 0.0);
    for (std::size_t k = 0; k < d; ++k)
      for (std::size_t i = 0; i < d; ++i) u[k] += frame_.inverse[k * d + i] * (state[i] - frame_.centre[i]);
    return u;
  }

  bool matters(std::size_t i) const {
    return std::find(last_.likeliest.begin(), last_.likeliest.end(), i) != last_.likeliest.end() ||
           std::any_of(last_.share.begin(), last_.share.end(),
                       [&](const auto& share) { return share[i] > node_of_no_weight; });
  }

  Tried slopes_from(std::size_t i) const {
    const std::size_t m = lattice_.size(), d = state_[i].size();
    Tried tried{std::vector<double>(m), std::vector<double>(m * d), std::vector<std::uint8_t>(m, 0), {}};
    std::vector<double> weight(m), states;
    const std::array<double, 1> offset{markov::uniforms(1, offsets_of_slopes, i, 0)[0]};
    lattice_.place(offset, tried.score, weight);
    for (std::size_t n = 0; n < m; ++n) states.insert(states.end(), state_[i].begin(), state_[i].end());
    if (batch_.inside(0, state_[i]))
      markov::checked_step(batch_, 0, states, tried.score, tried.next, tried.falls);
    else
      std::fill(tried.falls.begin(), tried.falls.end(), 1);
    tried.weight.assign(last_.share.size(), std::vector<double>(m, 0.0));
    for (std::size_t n = 0; n < m; ++n) {
      const double met = passage_.visits[i] * weight[n];
      if (tried.falls[n]) {
        tried.weight[0][n] = met;
        continue;
      }
      const auto corners = mesh_->corners(0, std::span(tried.next).subspan(n * d, d));
      for (std::size_t c = 0; c < static_cast<std::size_t>(corners.count); ++c)
        for (std::size_t k = 1; k < last_.share.size(); ++k)
          tried.weight[k][n] += met * corners.weight[c] * last_.fails_in[k - 1][corners.node[c]];
    }
    return tried;
  }

  double slope(double score) const { return setting_.slope_deg + setting_.slope_sd_deg * score; }

  /// Of step k before the fall, or of all steps.
  StepProfile profile(const std::vector<double>& share, std::optional<std::size_t> k) const {
    StepProfile told;
    double all = 0;
    for (std::size_t i = 0; i < share.size(); ++i) {
      told.bound_to_fail += share[i] * bound_[i];
      all += share[i];
    }
    told.bound_to_fail /= all;
    for (std::size_t number = 0; number < state_.front().size(); ++number) {
      std::vector<double> values;
      for (const std::vector<double>& state : state_) values.push_back(state[number]);
      told.state.push_back(middle_90(values, share));
    }
    std::vector<double> slopes, weights;
    for (std::size_t i = 0; k && i < tried_.size(); ++i)
      for (std::size_t n = 0; n < tried_[i].score.size(); ++n) {
        if (!(tried_[i].weight[*k][n] > 0)) continue;
        slopes.push_back(slope(tried_[i].score[n]));
        weights.push_back(tried_[i].weight[*k][n]);
      }
    constexpr double normal_90 = 1.6448536269514722;
    told.noise.push_back(k ? middle_90(slopes, weights) : Estimate{slope(0), slope(-normal_90), slope(normal_90)});
    return told;
  }

  PathStep path_step(std::size_t k) const {
    const std::size_t i = last_.likeliest[k], d = state_[i].size();
    PathStep step{0, state_[i], {}};
    const Tried& tried = tried_[i];
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t n = 0; n < tried.score.size(); ++n) {
      if ((tried.falls[n] != 0) != (k == 0)) continue;
      double far = std::abs(tried.score[n]);
      if (k > 0) {
        far = 0;
        const auto at = place(std::span(tried.next).subspan(n * d, d)), to = place(state_[last_.likeliest[k - 1]]);
        for (std::size_t axis = 0; axis < d; ++axis) far += (at[axis] - to[axis]) * (at[axis] - to[axis]);
      }
      if (far >= least) continue;
      least = far;
      step.noise = {slope(tried.score[n])};
    }
    return step;
  }

  WalkerSetting setting_;
  markov::BatchMap batch_;
  int threads_;
  markov::ScoreLattice lattice_;
  markov::NoiseFrame frame_;
  std::optional<markov::Mesh> mesh_;
  markov::MeshPassage passage_;
  std::vector<std::vector<double>> state_;
  std::vector<double> bound_;
  markov::LastSteps last_;
  std::vector<Tried> tried_;
};

}  // namespace

WalkerFalls how_it_falls(const WalkerSetting& setting, const WalkerStudy& study,
                         const markov::MeshStudyOptions& options) {
  const double spacing = study.passage.sizes.at(1).spacing;
  WalkerFalls falls =
      Falls(setting, {.spacing = spacing, .seed = options.seed, .most_bytes = options.most_bytes}, options.threads)
          .tell();
  falls.spacing = spacing;
  return falls;
}

}  // namespace metastable::analysis
