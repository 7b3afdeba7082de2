#include "markov/passage/first_passage.h"

#include <algorithm>
#include <boost/math/special_functions/gamma.hpp>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <string>

namespace metastable::markov {
namespace {

constexpr double rounded_stay = 1e-12;  // probabilities of staying below this are the rounding of a row sum
constexpr double sum_tolerance = 1e-9;
constexpr double mean_tolerance = 1e-6;
constexpr double constant_hazard = 1e-12;        // relative change of the log survival over a period
constexpr double normal_reach = 9;               // standard deviations beyond which a normal has no mass
constexpr double interpolated_rounding = 1e-14;  // of a probability that is a sum of both signs
constexpr double same_as_spectrum = 1e-8;        // agreement wanted with the failure rate of the chain

double dot(std::span<const double> a, std::span<const double> b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

double total(std::span<const double> v) { return std::accumulate(v.begin(), v.end(), 0.0); }

/// Returns the log of the probability of surviving a step; whichever of the two is small keeps its digits.
double log_survival(double surviving, double failing) {
  return failing < 0.5 ? std::log1p(-failing) : std::log(surviving);
}

void check_size(const ChainSolver& solver, std::span<const double> vector, const char* what) {
  if (vector.size() != solver.chain().size()) {
    throw std::invalid_argument(std::string(what) + ": " + std::to_string(vector.size()) + " entries for " +
                                std::to_string(solver.chain().size()) + " states");
  }
}

void check_launch(const Launch& launch, std::size_t states) {
  if (launch.after.size() != states) {
    throw std::invalid_argument("launch: " + std::to_string(launch.after.size()) + " entries for " +
                                std::to_string(states) + " states");
  }
  double sum = launch.rest;
  bool negative = !(launch.rest >= 0);
  for (const double probability : launch.after) {
    negative = negative || !(launch.interpolated || probability >= 0);
    sum += probability;
  }
  if (negative || !(std::abs(sum - 1) <= sum_tolerance)) {
    throw std::invalid_argument("launch: probabilities must be >= 0 and sum to 1, got " + std::to_string(sum));
  }
}

void check_reward(const ChainSolver& solver, std::span<const double> reward) {
  check_size(solver, reward, "reward");
  for (std::size_t i = 0; i < reward.size(); ++i) {
    if (!(reward[i] >= 0) || std::isinf(reward[i])) {
      throw std::invalid_argument("reward: entry " + std::to_string(i) + " is " + std::to_string(reward[i]) +
                                  ", not a finite number >= 0");
    }
  }
}

Moments moments(double mean, double square) { return {mean, std::sqrt(std::max(0.0, square - mean * mean))}; }

}  // namespace

std::vector<double> mean_first_passage(const ChainSolver& solver) {
  std::vector<double> mean = solver.solve(std::vector<double>(solver.chain().size(), 1.0));
  for (double& steps : mean) {
    if (!(steps >= 1 - mean_tolerance))
      throw ConvergenceError("first passage", steps,
                             "expected steps below one: the nodes are too few for interpolation");
    steps = std::max(1.0, steps);  // rounding of a row sum may take it an ulp below
  }
  return mean;
}

std::vector<double> second_moment(const ChainSolver& solver, std::span<const double> mean) {
  check_size(solver, mean, "mean first passage");
  return solver.solve(mean);
}

std::vector<double> first_passage_sd(const ChainSolver& solver, std::span<const double> mean) {
  check_size(solver, mean, "mean first passage");
  const Chain& chain = solver.chain();
  // In units of the largest mean, whose square may be too large for doubles.
  const double unit = *std::max_element(mean.begin(), mean.end());
  std::vector<double> sd;
  for (std::size_t i = 0; i < chain.size(); ++i) {
    const auto square = [&](double after) { return std::pow((after - (mean[i] - 1)) / unit, 2); };
    double variance = chain.kill(i) * square(0) + chain.stay(i) * square(mean[i]);
    for (std::size_t e = 0; e < chain.columns(i).size(); ++e)
      variance += chain.values(i)[e] * square(mean[chain.columns(i)[e]]);
    sd.push_back(variance);
  }
  sd = solver.solve(sd);
  for (double& one : sd) one = unit * std::sqrt(one);
  return sd;
}

Moments steps_from_launch(const Launch& launch, std::span<const double> mean, std::span<const double> second) {
  check_launch(launch, mean.size());
  if (second.size() != mean.size()) throw std::invalid_argument("launch: moments of different size");
  // T is 1 + S with S = 0 at rest, and E[S^2] is 2 E[S (S + 1) / 2] - E[S].
  const double after_mean = dot(launch.after, mean);
  const double after_square = 2 * dot(launch.after, second) - after_mean;
  return {1 + after_mean, moments(after_mean, after_square).sd};
}

Moments reward_from_launch(const ChainSolver& solver, const Launch& launch, std::span<const double> reward) {
  check_launch(launch, solver.chain().size());
  check_reward(solver, reward);
  // g is the expected reward still to come, h its expected square, both from a state whose own reward has been paid.
  const std::vector<double> g = solver.solve(markov::apply(solver.chain(), reward));
  std::vector<double> square(reward.size());
  for (std::size_t i = 0; i < square.size(); ++i) square[i] = reward[i] * (reward[i] + 2 * g[i]);
  const std::vector<double> h = solver.solve(markov::apply(solver.chain(), square));
  return moments(dot(launch.after, reward) + dot(launch.after, g), dot(launch.after, square) + dot(launch.after, h));
}

constexpr double log_nobody = -690.0;  // 1e-300

Survival::Survival(const ChainSolver& solver, const QuasiStationary& quasi, const Launch& launch, int limit)
    : log_factor_(std::log1p(-quasi.revolution_failure_rate)), period_(solver.period().period) {
  const Chain& chain = solver.chain();
  check_launch(launch, chain.size());
  const auto period = static_cast<std::size_t>(period_);
  std::vector<double> survivors = launch.after;
  double surviving = total(survivors);
  double failing = launch.rest;
  log_head_ = {0.0};
  std::vector<double> log_step;  // not the differences of log_head_: a hazard of 1e-12 would lose its digits there
  double difference = std::numeric_limits<double>::infinity();
  for (int step = 0; step < limit; ++step) {
    if (surviving <= (std::isinf(log_factor_) ? rounded_stay : 0)) surviving = 0;
    log_step.push_back(log_survival(surviving, failing));
    log_head_.push_back(log_head_.back() + log_step.back());
    if (log_head_.back() < log_nobody) {  // nobody is left to settle, and nobody comes back
      log_factor_ = -std::numeric_limits<double>::infinity();
      return;
    }
    if (log_step.size() > 2 * period) {
      const double* end = log_step.data() + log_step.size();
      const double now = std::accumulate(end - period, end, 0.0);
      const double before = std::accumulate(end - 2 * period, end - period, 0.0);
      difference = std::abs(now / log_factor_ - 1);
      const double rounding = chain.interpolated() ? interpolated_rounding : 0;
      if (std::abs(now - before) <= constant_hazard * std::abs(now) + rounding &&
          difference <= same_as_spectrum + rounding / std::abs(log_factor_))
        return;
    }
    for (double& entry : survivors) entry /= surviving;
    failing = dot(survivors, chain.kill());
    survivors = apply_left(chain, survivors);
    surviving = total(survivors);
  }
  throw ConvergenceError(
      "survival iteration", difference,
      "after " + std::to_string(limit) + " steps the hazard of the survivors is not yet the failure rate of the chain");
}

double Survival::log_at(double n) const {
  const auto last = static_cast<double>(log_head_.size() - 1);
  if (n <= last) return log_head_[static_cast<std::size_t>(n)];
  const double periods = std::ceil((n - last) / period_);
  const double index = std::clamp(n - periods * period_, last - period_ + 1, last);  // rounding beyond 2^53
  return log_head_[static_cast<std::size_t>(std::max(0.0, index))] + periods * log_factor_;
}

double Survival::at(double n) const {
  if (!(n >= 0)) throw std::invalid_argument("survival: the number of steps must be >= 0");
  return std::isinf(n) ? 0.0 : std::exp(log_at(std::floor(n)));
}

double Survival::mean() const {
  double sum = 0;
  for (const double log_p : log_head_) sum += std::exp(log_p);
  if (std::isinf(log_factor_)) return sum;
  double period = 0;
  for (auto log_p = log_head_.end() - period_; log_p != log_head_.end(); ++log_p) period += std::exp(*log_p);
  return sum + period * std::exp(log_factor_) / -std::expm1(log_factor_);
}

double Survival::quantile(double p) const {
  if (!(p > 0 && p < 1)) throw std::invalid_argument("quantile: a probability between 0 and 1 is needed");
  const double wanted = std::log1p(-p);
  const auto reached =
      std::partition_point(log_head_.begin(), log_head_.end(), [wanted](double log_p) { return log_p > wanted; });
  if (reached != log_head_.end()) return static_cast<double>(reached - log_head_.begin());
  // In the tail the last period of the head sinks below `wanted` after about this many periods.
  const auto last = static_cast<double>(log_head_.size() - 1);
  const double periods = std::floor((wanted - log_head_.back()) / log_factor_);
  double n = last + std::max(0.0, periods - 1) * period_;
  constexpr double whole_numbers = 9e15;  // above, neighbouring steps are not told apart
  if (n > whole_numbers) return last + (wanted - log_head_.back()) / log_factor_ * period_;
  while (log_at(n) > wanted) n += 1;
  return n;
}

namespace {

/// Holds what is known of the reward of the trials that come to rest at one step: a shifted gamma with their mean,
/// variance and third cumulant. For a block of steps its mean is spread evenly over `width`.
struct Component {
  double weight = 0;
  double mean = 0;
  double variance = 0;
  double third = 0;
  double width = 0;

  double distribution(double t) const;
};

double normal_distribution(double z) { return 0.5 * std::erfc(-z / std::numbers::sqrt2); }

/// Returns the distribution function of the shifted gamma of mean 0, sd 1 and the given skewness (Pearson's type III);
/// without skewness it is the normal's.
double skewed_distribution(double z, double skewness) {
  constexpr double symmetric = 1e-6, slight_share = 0.2;
  constexpr double steepest = 20;  // beyond, a variance of rounding alone speaks
  skewness = std::clamp(skewness, -steepest, steepest);
  if (std::abs(skewness) < symmetric) return normal_distribution(z);
  const double above_edge = 1 + 0.5 * skewness * z;  // over the mean: the gamma begins at 0
  if (above_edge <= 0) return skewness > 0 ? 0 : 1;
  // Wilson and Hilferty 1931: the cube root is normal, to 1e-5 where the skewness is slight.
  if (std::abs(skewness) < slight_share)
    return normal_distribution(6 / skewness * (std::cbrt(above_edge) - 1) + skewness / 6);
  const double shape = 4 / (skewness * skewness);
  return skewness > 0 ? boost::math::gamma_p(shape, shape * above_edge)
                      : boost::math::gamma_q(shape, shape * above_edge);
}

/// Integrates the normal distribution function with the given sd from -infinity to x.
double normal_ramp(double x, double sd) {
  if (std::abs(x) >= normal_reach * sd) return std::max(0.0, x);
  const double z = x / sd;
  return sd *
         (z * 0.5 * std::erfc(-z / std::numbers::sqrt2) + std::exp(-0.5 * z * z) / std::sqrt(2 * std::numbers::pi));
}

double Component::distribution(double t) const {
  const double distance = t - mean;
  const bool spread = width * width > variance;
  const double sd = std::sqrt(spread ? variance : variance + width * width / 12);
  if (sd == 0 && width == 0) return distance >= 0 ? 1 : 0;
  if (!spread) return skewed_distribution(distance / sd, third / (sd * sd * sd));
  if (std::abs(distance) >= normal_reach * sd + 0.5 * width) return distance >= 0 ? 1 : 0;
  return (normal_ramp(distance + 0.5 * width, sd) - normal_ramp(distance - 0.5 * width, sd)) / width;
}

/// Holds the accumulated reward's law as a mixture of shifted gammas, one for every step at which rest may come; steps
/// far out in the geometric tail are put together in blocks whose length is a small fraction of the steps before them.
/// Trials that rest one step after the launch are taken as they are, state by state.
class RewardMixture {
 public:
  RewardMixture(const ChainSolver& solver, const QuasiStationary& quasi, const Launch& launch,
                std::span<const double> reward);
  double quantile(double p) const;

 private:
  using Row = std::vector<double>;
  void enter(const Row& mass, const Row& first, const Row& second, const Row& third);
  void advance();
  Component absorb() const;
  bool settled() const;
  void add_head();
  void add_tail();
  double distribution(double total_reward) const;

  const Chain& chain_;
  std::span<const double> reward_;
  std::size_t period_;
  double rest_at_launch_;
  double log_factor_;  ///< log survival over one period, in the tail
  double drift_ = 0;   ///< mean reward of a step; moments are kept relative to it, so that they stay small
  double largest_reward_;
  double log_surviving_ = 0;
  /// Of the survivors, by state: probability, and moments of reward - drift_ per step.
  Row mass_, first_, second_, third_;
  std::vector<Component> atoms_;    ///< rests at the first step after the launch, a state each, absolute
  std::vector<Component> head_;     ///< one a step, means relative to the drift
  std::vector<Component> mixture_;  ///< absolute
};

constexpr double log_negligible = -39.0;    // survivors fewer than about 1e-17 are let go
constexpr double settled_increment = 1e-9;  // of mean and variance over a period, relative to the largest reward
constexpr double block_share = 2e-3;        // length of a tail block over the periods before it
constexpr double negligible_share = 1e-12;  // of a period's failures: far below what a settled period may still change
constexpr std::size_t reward_steps = 20000;

/// Returns mean and variance of a whole number from 0 to length - 1 with weights exp(log_factor * k).
struct Block {
  double mean, variance;
};

/// Takes the cumulants of the even law and their first corrections, for length * |log_factor| << 1.
Block tilted_block(double length, double log_factor) {
  const double square = length * length;
  const double second = (square - 1) / 12;
  const double fourth = -(square * square - 1) / 120;
  const double tilt = log_factor * log_factor;
  return {(length - 1) / 2 + log_factor * (second + tilt * fourth / 6), second + tilt * fourth / 2};
}

RewardMixture::RewardMixture(const ChainSolver& solver, const QuasiStationary& quasi, const Launch& launch,
                             std::span<const double> reward)
    : chain_(solver.chain()),
      reward_(reward),
      period_(static_cast<std::size_t>(solver.period().period)),
      rest_at_launch_(launch.rest),
      log_factor_(std::log1p(-quasi.revolution_failure_rate)),
      largest_reward_(*std::max_element(reward.begin(), reward.end())) {
  const Row in_classes = shares_in_classes(solver.period(), quasi.distribution);  // a step in each class a revolution
  drift_ = dot(in_classes, reward) / total(in_classes);
  const Row nothing(chain_.size(), 0.0);
  log_surviving_ = log_survival(total(launch.after), launch.rest);
  enter(launch.after, nothing, nothing, nothing);
  // Weights of either sign have no law by state: there the cumulants speak for the first step too.
  for (std::size_t i = 0; i < chain_.size() && !chain_.interpolated() && !launch.interpolated; ++i) {
    const double weight = launch.after[i] * chain_.kill()[i];
    if (weight > 0) atoms_.push_back({weight, reward[i], 0, 0, 0});
  }
  while (log_surviving_ > log_negligible) {
    head_.push_back(absorb());
    if (settled()) {
      add_tail();
      break;
    }
    if (head_.size() > reward_steps) {
      throw ConvergenceError("reward iteration", head_.back().weight,
                             "the reward of a step has not settled after " + std::to_string(reward_steps) +
                                 " steps; a looser tolerance or other rows may do (--method)");
    }
    advance();
  }
  add_head();
}

void RewardMixture::add_head() {
  mixture_.insert(mixture_.end(), atoms_.begin(), atoms_.end());
  for (std::size_t n = atoms_.empty() ? 0 : 1; n < head_.size(); ++n) {
    mixture_.push_back(head_[n]);
    mixture_.back().mean += drift_ * static_cast<double>(n + 1);
  }
}

/// Survivors arrive in their states, are made to sum to one, and each is paid the reward of its state.
void RewardMixture::enter(const Row& mass, const Row& first, const Row& second, const Row& third) {
  const double sum = total(mass);
  mass_.resize(mass.size());
  first_.resize(mass.size());
  second_.resize(mass.size());
  third_.resize(mass.size());
  for (std::size_t i = 0; i < mass.size(); ++i) {
    const double paid = reward_[i] - drift_;
    const double scale = sum > 0 ? 1 / sum : 0;
    mass_[i] = mass[i] * scale;
    first_[i] = first[i] * scale;
    second_[i] = second[i] * scale;
    third_[i] = third[i] * scale + paid * (3 * second_[i] + paid * (3 * first_[i] + paid * mass_[i]));
    second_[i] += paid * (2 * first_[i] + paid * mass_[i]);
    first_[i] += paid * mass_[i];
  }
}

void RewardMixture::advance() {
  const double failing = dot(mass_, chain_.kill());
  const Row mass = apply_left(chain_, mass_);
  log_surviving_ += log_survival(total(mass), failing);
  enter(mass, apply_left(chain_, first_), apply_left(chain_, second_), apply_left(chain_, third_));
}

/// Returns the trials that come to rest at the next step.
Component RewardMixture::absorb() const {
  const double failing = dot(mass_, chain_.kill());
  if (failing == 0) return {};
  const double mean = dot(first_, chain_.kill()) / failing;
  const double square = dot(second_, chain_.kill()) / failing;
  const double third = dot(third_, chain_.kill()) / failing - mean * (3 * square - 2 * mean * mean);
  return {failing * std::exp(log_surviving_), mean, std::max(0.0, square - mean * mean), third, 0};
}

/// Over the last three periods, weights fall by the failure rate, and means and variances grow evenly; and what the
/// last one took from its survivors is the failure rate itself.
bool RewardMixture::settled() const {
  if (head_.size() < 3 * period_) return false;
  double absorbed = 0;
  for (std::size_t i = head_.size() - period_; i < head_.size(); ++i) absorbed += head_[i].weight;
  const double survivors = std::exp(log_surviving_) + (absorbed - head_.back().weight);
  const double expected = -std::expm1(log_factor_) * survivors;
  const double rounding = chain_.interpolated() ? std::min(1e-6, interpolated_rounding / -std::expm1(log_factor_)) : 0;
  if (!(std::abs(absorbed - expected) <= (same_as_spectrum + rounding) * expected)) return false;
  const double increment = settled_increment + rounding;
  const double scale = largest_reward_ * static_cast<double>(period_);
  const double factor = std::exp(log_factor_);
  for (std::size_t i = head_.size() - period_; i < head_.size(); ++i) {
    const Component& now = head_[i];
    const Component& before = head_[i - period_];
    const Component& earlier = head_[i - 2 * period_];
    // A phase that hardly ever fails may take for ever to settle.
    if (now.weight < negligible_share * absorbed) continue;
    const double mean_change = now.mean - 2 * before.mean + earlier.mean;
    const double variance_change = now.variance - 2 * before.variance + earlier.variance;
    if (std::abs(now.weight - factor * before.weight) > increment * now.weight ||
        std::abs(mean_change) > increment * scale || std::abs(variance_change) > increment * scale * scale) {
      return false;
    }
  }
  return true;
}

void RewardMixture::add_tail() {
  const std::size_t first = head_.size() - period_;
  const auto periods_before = static_cast<double>(head_.size() / period_);
  double length = 1;
  for (double period = 1; period * log_factor_ > log_negligible; period += length) {
    length = std::max(1.0, std::floor(block_share * (period + periods_before)));
    const Block block = tilted_block(length, log_factor_);
    const double share = std::exp(period * log_factor_) * std::expm1(length * log_factor_) / std::expm1(log_factor_);
    for (std::size_t i = first; i < head_.size(); ++i) {
      const Component& last = head_[i];
      if (last.weight == 0) continue;
      const double mean_growth = last.mean - head_[i - period_].mean + drift_ * static_cast<double>(period_);
      const double variance_growth = std::max(0.0, last.variance - head_[i - period_].variance);
      const double third_growth = last.third - head_[i - period_].third;
      const double periods = period + block.mean;
      mixture_.push_back({last.weight * share, last.mean + drift_ * static_cast<double>(i + 1) + mean_growth * periods,
                          last.variance + variance_growth * periods, last.third + third_growth * periods,
                          mean_growth * std::sqrt(12 * block.variance)});
    }
  }
}

/// Returns P(total reward <= t), t >= 0, up to the mass let go.
double RewardMixture::distribution(double t) const {
  double below = rest_at_launch_;
  double all = rest_at_launch_;
  for (const Component& component : mixture_) {
    all += component.weight;
    below += component.weight * component.distribution(t);
  }
  return below / all;
}

double RewardMixture::quantile(double p) const {
  double low = 0;
  if (rest_at_launch_ >= p || distribution(low) >= p) return low;
  double high = 0;
  for (const Component& component : mixture_) {
    high = std::max(high, component.mean + normal_reach * std::sqrt(component.variance) + component.width);
  }
  constexpr double relative_tolerance = 1e-13;
  while (high - low > relative_tolerance * high) {
    const double middle = 0.5 * (low + high);
    (distribution(middle) >= p ? high : low) = middle;
  }
  return high;
}

}  // namespace

std::vector<double> reward_quantiles(const ChainSolver& solver, const QuasiStationary& quasi, const Launch& launch,
                                     std::span<const double> reward, std::span<const double> probabilities) {
  check_launch(launch, solver.chain().size());
  check_reward(solver, reward);
  for (const double p : probabilities) {
    if (!(p > 0 && p < 1)) throw std::invalid_argument("reward quantile: a probability between 0 and 1 is needed");
  }
  const RewardMixture mixture(solver, quasi, launch, reward);
  std::vector<double> quantiles;
  for (const double p : probabilities) quantiles.push_back(mixture.quantile(p));
  return quantiles;
}

}  // namespace metastable::markov
