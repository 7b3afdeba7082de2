#include "markov/splitting/learnt_level.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numeric>
#include <utility>

#include "markov/dense_matrix.h"
#include "markov/splitting/stratified_scores.h"
#include "markov/transition_rows/score_lattice.h"

namespace metastable::markov {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double narrowest = 0.05;        // of the widest axis
constexpr std::size_t nearest_count = 8;  // anchors that a state is interpolated between
constexpr int landings = 24;              // of each anchor
constexpr int longest_window = 20;        // times the one asked for
constexpr double fall = 1.2;              // of ln weight from edge to edge
constexpr std::size_t visits_beyond = 20;
constexpr std::uint64_t landing_stream = 0x8000, anchor_stream = 0x9000;

/// Holds anchors of one phase by their coordinates, column by column.
class Anchors {
 public:
  Anchors() = default;
  Anchors(std::size_t dimension, std::size_t count) : d_(dimension), n_(count), place_(dimension * count) {}
  void put(std::size_t i, std::span<const float> coordinates) {
    for (std::size_t k = 0; k < d_; ++k) place_[k * n_ + i] = coordinates[k];
  }
  std::size_t size() const { return n_; }

  struct Neighbours {
    std::array<std::uint32_t, nearest_count> which;
    std::array<float, nearest_count> share;
    std::size_t count;
  };
  /// Finds the nearest anchors; their shares go with one over the squared distance.
  Neighbours nearest(std::span<const float> at, std::vector<float>& distance) const {
    distance.assign(n_, 0);
    for (std::size_t k = 0; k < d_; ++k) {
      const float* const column = &place_[k * n_];
      const float here = at[k];
      for (std::size_t i = 0; i < n_; ++i) distance[i] += (column[i] - here) * (column[i] - here);
    }
    Neighbours found;
    found.count = std::min(nearest_count, n_);
    std::array<float, nearest_count> best;
    std::size_t held = 0;
    for (std::size_t i = 0; i < n_; ++i) {
      if (held == found.count && !(distance[i] < best[held - 1])) continue;
      std::size_t at_place = held < found.count ? held++ : held - 1;
      for (; at_place > 0 && best[at_place - 1] > distance[i]; --at_place) {
        best[at_place] = best[at_place - 1];
        found.which[at_place] = found.which[at_place - 1];
      }
      best[at_place] = distance[i];
      found.which[at_place] = static_cast<std::uint32_t>(i);
    }
    float sum = 0;
    for (std::size_t k = 0; k < found.count; ++k) sum += found.share[k] = 1 / (best[k] + 1e-3F);
    for (std::size_t k = 0; k < found.count; ++k) found.share[k] /= sum;
    return found;
  }

 private:
  std::size_t d_ = 0, n_ = 0;
  std::vector<float> place_;
};

/// A logarithm of a chance, 0 at most, as a quadratic form of a state's coordinates; beyond twelve dimensions without
/// products of different ones.
class QuadraticForm {
 public:
  /// Fits values at places (rows of `dimension` numbers) by least squares, slightly damped.
  QuadraticForm(std::size_t dimension, std::span<const float> places, std::span<const float> values) : d_(dimension) {
    const auto n = static_cast<Index>(values.size());
    VectorXd row = terms(places.first(d_));
    MatrixXd gram = MatrixXd::Zero(row.size(), row.size());
    VectorXd right = VectorXd::Zero(row.size());
    for (Index i = 0; i < n; ++i) {
      row = terms(places.subspan(static_cast<std::size_t>(i) * d_, d_));
      gram.selfadjointView<Eigen::Lower>().rankUpdate(row);
      right += static_cast<double>(values[static_cast<std::size_t>(i)]) * row;
    }
    gram.diagonal().array() += 1e-3 * static_cast<double>(n);
    factors_ = solve_symmetric(gram, right);
  }
  double operator()(std::span<const float> at) const { return std::min(0.0, factors_.dot(terms(at))); }

 private:
  static constexpr std::size_t most_products = 12;
  VectorXd terms(std::span<const float> at) const {
    const bool all = d_ <= most_products;
    VectorXd row(static_cast<Index>(all ? 1 + d_ + d_ * (d_ + 1) / 2 : 1 + 2 * d_));
    Index k = 0;
    row[k++] = 1;
    for (std::size_t i = 0; i < d_; ++i) {
      row[k++] = static_cast<double>(at[i]);
      for (std::size_t j = i; j < (all ? d_ : i + 1); ++j)
        row[k++] = static_cast<double>(at[i]) * static_cast<double>(at[j]);
    }
    return row;
  }
  std::size_t d_;
  VectorXd factors_;
};

/// Holds what is learnt, for a level function to read.
struct Learnt {
  std::vector<VisitFrame> frames;
  std::vector<Anchors> anchors;             ///< phase by phase
  std::vector<std::vector<float>> chances;  ///< their logarithms
  std::vector<QuadraticForm> forms;         ///< phase by phase; none: what is between the nearest anchors counts

  double between(std::size_t phase, std::span<const float> here, std::vector<float>& far) const {
    const Anchors::Neighbours near = anchors[phase].nearest(here, far);
    double sum = 0;
    for (std::size_t b = 0; b < near.count; ++b)
      sum += static_cast<double>(near.share[b]) * static_cast<double>(chances[phase][near.which[b]]);
    return sum;
  }
};

}  // namespace

void Visits::add(const WeightedEnsemble& ensemble) {
  Phase& phase = phases[static_cast<std::size_t>(ensemble.phase())];
  phase.states.insert(phase.states.end(), ensemble.states().begin(), ensemble.states().end());
  phase.weights.insert(phase.weights.end(), ensemble.weights().begin(), ensemble.weights().end());
  phase.levels.insert(phase.levels.end(), ensemble.levels().begin(), ensemble.levels().end());
}

void Visits::clear() {
  for (Phase& phase : phases) phase = {};
}

VisitFrame::VisitFrame(const BatchMap& map, const Visits::Phase& visits) {
  const Index d = map.dimension, n = static_cast<Index>(visits.weights.size());
  const Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> states(
      visits.states.data(), n, d);
  const Eigen::Map<const VectorXd> weights(visits.weights.data(), n);
  const VectorXd mean = states.transpose() * weights / weights.sum();
  const MatrixXd centred = states.rowwise() - mean.transpose();
  const MatrixXd covariance = centred.transpose() * weights.asDiagonal() * centred / weights.sum();
  VectorXd sd = covariance.diagonal().cwiseSqrt();
  for (Index k = 0; k < d; ++k)
    if (!(sd[k] > 1e-12 * (std::abs(mean[k]) + 1e-300))) sd[k] = 1 + std::abs(mean[k]);  // nothing moves it
  const MatrixXd correlation = sd.cwiseInverse().asDiagonal() * covariance * sd.cwiseInverse().asDiagonal();
  const SymmetricEigen eigen = symmetric_eigen(correlation);
  const VectorXd widths = eigen.values.cwiseMax(0).cwiseSqrt();
  const VectorXd used = widths.cwiseMax(std::max(1e-12, narrowest * widths.maxCoeff()));
  const MatrixXd inverse =
      used.cwiseInverse().asDiagonal() * eigen.vectors.transpose() * MatrixXd(sd.cwiseInverse().asDiagonal());
  centre_.assign(mean.begin(), mean.end());
  for (Index i = 0; i < d; ++i)
    for (Index j = 0; j < d; ++j) inverse_.push_back(inverse(i, j));
}

void VisitFrame::place(std::span<const double> state, std::span<float> coordinates) const {
  const std::size_t d = centre_.size();
  for (std::size_t i = 0; i < d; ++i) {
    double sum = 0;
    for (std::size_t j = 0; j < d; ++j) sum += inverse_[i * d + j] * (state[j] - centre_[j]);
    coordinates[i] = static_cast<float>(std::clamp(sum, -1e6, 1e6));
  }
}

LevelFunction distance_level(std::vector<VisitFrame> frames, int dimension) {
  return [frames = std::move(frames), d = static_cast<std::size_t>(dimension)](int phase, auto states, auto levels) {
    std::vector<float> at(d);
    for (std::size_t i = 0; i < levels.size(); ++i) {
      frames[static_cast<std::size_t>(phase)].place(states.subspan(i * d, d), at);
      double squares = 0;
      for (const float x : at) squares += static_cast<double>(x) * static_cast<double>(x);
      levels[i] = std::sqrt(squares);
    }
  };
}

std::vector<std::vector<double>> quantile_edges(const Visits& visits) {
  std::vector<std::vector<double>> edges;
  for (const Visits::Phase& phase : visits.phases) {
    std::vector<std::size_t> order(phase.weights.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
      return phase.levels[a] > phase.levels[b] || (phase.levels[a] == phase.levels[b] && a < b);
    });
    double whole = 0, beyond = 0;
    for (const double weight : phase.weights) whole += weight;
    std::vector<double> falling;
    double reached = -INFINITY;  // ln of the share beyond the last edge
    for (std::size_t k = 0; k < order.size(); ++k) {
      beyond += phase.weights[order[k]];
      if (k + 1 < visits_beyond || k + 1 == order.size()) continue;
      const double here = std::log(beyond / whole);
      if (here > -fall) break;
      const double level = phase.levels[order[k]];
      if (here < reached + fall || level <= phase.levels[order[k + 1]] || (!falling.empty() && level >= falling.back()))
        continue;
      falling.push_back(level);
      reached = here;
    }
    edges.emplace_back(falling.rbegin(), falling.rend());
  }
  return edges;
}

namespace {

/// Chooses visits of one phase evenly over their bins; within a bin by chance.
std::vector<std::size_t> choose_anchors(const Visits::Phase& visits, const std::vector<double>& edges,
                                        std::size_t count, const LearningOptions& options, std::uint64_t phase) {
  std::vector<std::vector<std::pair<double, std::size_t>>> bins(edges.size() + 1);
  for (std::size_t i = 0; i < visits.weights.size(); ++i) {
    const auto bin = std::upper_bound(edges.begin(), edges.end(), visits.levels[i]) - edges.begin();
    bins[static_cast<std::size_t>(bin)].emplace_back(
        uniforms(options.seed, anchor_stream + (options.stream << 16), i, phase)[0], i);
  }
  std::vector<std::size_t> chosen;
  const std::size_t each = std::max<std::size_t>(1, count / bins.size());
  for (auto& bin : bins) {
    std::sort(bin.begin(), bin.end());
    for (std::size_t k = 0; k < std::min(each, bin.size()); ++k) chosen.push_back(bin[k].second);
  }
  return chosen;
}

/// Holds where the anchors of one phase lead, as rows of a chain.
struct Landings {
  std::vector<double> fail;  ///< chance in one step, anchor by anchor
  std::vector<double> weight;
  std::vector<std::uint32_t> from;
  std::vector<Anchors::Neighbours> to;
  std::vector<float> places;  ///< coordinates, row by row
};

class Learner {
 public:
  Learner(const BatchMap& map, const LearningOptions& options)
      : map_(map),
        options_(options),
        d_(static_cast<std::size_t>(map.dimension)),
        phases_(static_cast<std::size_t>(map.phases)),
        learnt_(std::make_shared<Learnt>()),
        states_(phases_),
        rows_(phases_),
        chance_(phases_) {}

  LearntLevel learn(const std::vector<VisitFrame>& frames, const Visits& visits,
                    const std::vector<std::vector<double>>& edges) {
    learnt_->frames = frames;
    for (std::size_t p = 0; p < phases_; ++p) choose(p, visits.phases[p], edges[p]);
    for (std::size_t p = 0; p < phases_; ++p) land(p);
    follow_chain();
    if (std::ranges::all_of(chance_, [](const auto& at_phase) { return std::ranges::max(at_phase) <= 0; }))
      return std::move(answer_);
    take_logarithms();
    if (map_.dimension > most_mesh_dimensions) fit();
    answer_.level = [learnt = learnt_, d = d_](int phase, auto from, auto levels) {
      const auto p = static_cast<std::size_t>(phase);
      std::vector<float> here(d), far;
      for (std::size_t i = 0; i < levels.size(); ++i) {
        learnt->frames[p].place(from.subspan(i * d, d), here);
        levels[i] = learnt->forms.empty() ? learnt->between(p, here, far) : learnt->forms[p](here);
      }
    };
    return std::move(answer_);
  }

 private:
  void choose(std::size_t p, const Visits::Phase& visits, const std::vector<double>& edges) {
    const auto chosen =
        choose_anchors(visits, edges, std::max<std::size_t>(options_.anchors / phases_, 60), options_, p);
    std::vector<float> at(d_);
    learnt_->anchors.emplace_back(d_, chosen.size());
    for (std::size_t i = 0; i < chosen.size(); ++i) {
      const auto state = std::span(visits.states).subspan(chosen[i] * d_, d_);
      states_[p].insert(states_[p].end(), state.begin(), state.end());
      learnt_->frames[p].place(state, at);
      learnt_->anchors[p].put(i, at);
      own_.resize(phases_);
      own_[p].insert(own_[p].end(), at.begin(), at.end());
    }
  }

  /// Lands the anchors of a phase.
  void land(std::size_t p) {
    const auto s = static_cast<std::size_t>(map_.scores);
    const std::size_t n = learnt_->anchors[p].size(), to = (p + 1) % phases_, m = n * landings;
    std::vector<double> from, scores(m * s), next(m * d_), weight(m, 1.0 / landings);
    std::vector<std::uint64_t> words(m);
    std::vector<std::uint8_t> failed(m, 0);
    const std::uint64_t stream = landing_stream + (options_.stream << 16);
    for (std::size_t i = 0; i < m; ++i) {
      from.insert(from.end(), &states_[p][i / landings * d_], &states_[p][i / landings * d_] + d_);
      words[i] = random_words(options_.seed, stream, i, p)[0];
    }
    for (std::size_t i = 0; s > 0 && i < m; i += landings) {
      const auto weights = std::span(weight).subspan(i, landings);
      stratified_scores(options_.seed, stream, i * phases_ + p, std::span(scores).subspan(i * s, landings * s),
                        weights);
      for (double& one : weights) one /= landings;
    }
    if (s > 0)
      checked_step(map_, static_cast<int>(p), from, scores, next, failed);
    else
      checked_draw(map_, static_cast<int>(p), from, words, next, failed);
    answer_.calls += m;
    Landings& rows = rows_[p];
    rows.fail.assign(n, 0);
    std::vector<float> at(d_), distance;
    for (std::size_t i = 0; i < m; ++i) {
      if (failed[i]) {
        rows.fail[i / landings] += weight[i];
        continue;
      }
      learnt_->frames[to].place(std::span(next).subspan(i * d_, d_), at);
      rows.from.push_back(static_cast<std::uint32_t>(i / landings));
      rows.weight.push_back(weight[i]);
      rows.to.push_back(learnt_->anchors[to].nearest(at, distance));
      rows.places.insert(rows.places.end(), at.begin(), at.end());
    }
  }

  /// Finds the chance within a window from the chain among the anchors.
  void follow_chain() {
    for (std::size_t p = 0; p < phases_; ++p) chance_[p].assign(learnt_->anchors[p].size(), 0);
    const int window = (options_.window + map_.phases - 1) / map_.phases;
    // Some anchors may never lead to failure, as they land at none but themselves. The window is therefore long enough
    // once one step more adds no anchor to those that lead there.
    std::ptrdiff_t reached = 0,
                   before = -1;  // anchors that lead to failure within the steps taken, and one step before
    int taken = 0;
    for (; taken < window || (reached > before && taken < longest_window * window); ++taken) {
      for (std::size_t p = phases_; p-- > 0;) {
        const std::vector<double>& after = chance_[(p + 1) % phases_];
        std::vector<double> now = rows_[p].fail;
        for (std::size_t j = 0; j < rows_[p].from.size(); ++j) {
          const Anchors::Neighbours& to = rows_[p].to[j];
          double sum = 0;
          for (std::size_t b = 0; b < to.count; ++b) sum += static_cast<double>(to.share[b]) * after[to.which[b]];
          now[rows_[p].from[j]] += rows_[p].weight[j] * sum;
        }
        for (double& one : now) one = std::min(one, 1.0);
        chance_[p] = std::move(now);
      }
      before = std::exchange(reached, 0);
      for (const std::vector<double>& at_phase : chance_)
        reached += std::ranges::count_if(at_phase, [](double one) { return one > 0; });
    }
    answer_.window = taken * map_.phases;
  }

  void take_logarithms() {
    for (const std::vector<double>& at_phase : chance_) {
      double least = 1;
      for (const double one : at_phase)
        if (one > 0) least = std::min(least, one);
      std::vector<float>& logs = learnt_->chances.emplace_back();
      for (const double one : at_phase) logs.push_back(static_cast<float>(std::log(one > 0 ? one : 0.1 * least)));
    }
  }

  /// Fits quadratic forms to the logarithms of the chances, and lets them take the place of the nearest anchors: the
  /// chance is followed over a window more, each time fitted to what the forms say of the landings.
  void fit() {
    for (std::size_t p = 0; p < phases_; ++p)
      learnt_->forms.emplace_back(d_, own_[p], std::span<const float>(learnt_->chances[p]));
    const int sweeps = answer_.window / map_.phases;
    for (int k = 0; k < sweeps; ++k)
      for (std::size_t p = phases_; p-- > 0;) {
        const Landings& rows = rows_[p];
        const QuadraticForm& after = learnt_->forms[(p + 1) % phases_];
        std::vector<double> now = rows.fail;
        for (std::size_t j = 0; j < rows.from.size(); ++j)
          now[rows.from[j]] += rows.weight[j] * std::exp(after(std::span(rows.places).subspan(j * d_, d_)));
        std::vector<float> logs;
        for (const double one : now) logs.push_back(static_cast<float>(std::log(std::clamp(one, 1e-30, 1.0))));
        learnt_->forms[p] = QuadraticForm(d_, own_[p], logs);
      }
  }

  const BatchMap& map_;
  const LearningOptions& options_;
  std::size_t d_, phases_;
  std::shared_ptr<Learnt> learnt_;
  std::vector<std::vector<double>> states_;  ///< of the anchors, phase by phase
  std::vector<std::vector<float>> own_;      ///< and their coordinates, row by row
  std::vector<Landings> rows_;
  std::vector<std::vector<double>> chance_;
  LearntLevel answer_;
};

}  // namespace

LearntLevel learn_level(const BatchMap& map, const std::vector<VisitFrame>& frames, const Visits& visits,
                        const std::vector<std::vector<double>>& edges, const LearningOptions& options) {
  return Learner(map, options).learn(frames, visits, edges);
}

}  // namespace metastable::markov
