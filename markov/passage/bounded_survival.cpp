#include "markov/passage/bounded_survival.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <string>

#include "markov/chain/period.h"
#include "markov/passage/slow_modes.h"
#include "markov/passage/survival_after.h"

namespace metastable::markov {
namespace {

constexpr double followed_anyhow = 1e9;    // entries times steps
constexpr double least_followed = 256;     // steps
constexpr double most_followed = 20000;    // steps of survivors that do not settle, where no more are followed anyhow
constexpr double settled_share = 1e-9;     // of every state, relative
constexpr double rounded_share = 1e-6;     // of survivors, below which rounding may keep them from settling
constexpr double settled_survival = 1e-8;  // what is not settled moves the survival by no more, relative

/// Survivors of a chain, step by step.
class Survivors {
 public:
  Survivors(const Chain& chain, std::span<const double> start) : chain_(chain), shares_(start.begin(), start.end()) {
    rescale();
  }
  void step() {
    double failing = 0;
    for (std::size_t i = 0; i < shares_.size(); ++i) failing += shares_[i] * chain_.kill(i);
    shares_ = apply_left(chain_, shares_);
    const double left = rescale();
    log_survival_ += failing < 0.5 ? std::log1p(-static_cast<long double>(failing)) : std::log(left);
  }
  bool any() const { return any_; }
  const std::vector<double>& shares() const { return shares_; }
  long double log_survival() const { return log_survival_; }
  double survival() const { return any_ ? static_cast<double>(std::exp(log_survival_)) : 0; }

 private:
  double rescale() {
    const double all = std::accumulate(shares_.begin(), shares_.end(), 0.0);
    any_ = all > 0;
    for (double& share : shares_) share /= any_ ? all : 1;
    return all;
  }
  const Chain& chain_;
  std::vector<double> shares_;
  long double log_survival_ = 0;
  bool any_ = true;
};

/// The settled distribution of survivors, cyclic class by cyclic class.
///
/// Without such classes survivors are p = a y + r, where a = p w / y w and r w = 0, and survive m more steps with
/// probability a (1 - rate)^m + r Q^m (1 - c w) for any c. |1 - c w| is at most d w, d = 1 / min w - c with c halfway
/// between 1 / max w and 1 / min w, so that what is not settled moves it by no more than d |r| w / a, relative, in all
/// times to come: little where failures are rare, long before the shares have settled.
class Settled {
 public:
  Settled(const Chain& chain, const QuasiStationary& quasi)
      : quasi_(quasi), period_(find_period(chain)), shares_(shares_in_classes(period_, quasi.distribution)) {
    of_class_ = in_classes(quasi.distribution);
    const auto [least, most] = std::minmax_element(quasi.survival_weight.begin(), quasi.survival_weight.end());
    if (period_.period == 1 && *least > 0) spread_ = (1 / *least - 1 / *most) / 2;
    weighted_ =
        std::inner_product(quasi.distribution.begin(), quasi.distribution.end(), quasi.survival_weight.begin(), 0.0);
  }
  /// Returns the share of survivors, weighted by w, that is not settled: |r| w / a.
  double unsettled(const std::vector<double>& survivors) const {
    const double settled = settled_part(survivors);
    double rest = 0;
    for (std::size_t i = 0; i < survivors.size(); ++i)
      rest += std::abs(survivors[i] - settled * quasi_.distribution[i]) * quasi_.survival_weight[i];
    return rest / settled;
  }
  const QuasiStationary& quasi() const { return quasi_; }
  /// Says whether survival_by_slow_modes() takes the chain.
  bool has_slow_modes(const Chain& chain) const {
    const std::vector<std::uint8_t> can_rest = classify(chain).can_rest;
    return period_.period == 1 && std::ranges::all_of(can_rest, [](std::uint8_t can) { return can != 0; });
  }
  /// Returns the unsettled share that moves the survival by no more than settled_survival; 0 where none is known.
  double harmless() const { return settled_survival / spread_; }
  /// Says whether survivors look so.
  bool reached(const std::vector<double>& survivors) const {
    if (std::isfinite(spread_) && unsettled(survivors) <= harmless()) return true;
    const std::vector<double> mass = in_classes(survivors);
    double elsewhere = 0;
    for (std::size_t i = 0; i < survivors.size(); ++i) {
      const double foretold = mass[class_of(i)] * shares_[i];
      // Rounding of row sums leaves a few in the class where they were.
      if (foretold == 0 || mass[class_of(i)] < settled_share)
        elsewhere += survivors[i];
      else if (std::abs(survivors[i] - foretold) > settled_share * foretold)
        return false;
    }
    return elsewhere <= settled_share;
  }
  /// Returns the log of the probability that such survivors survive `more` steps.
  double log_survival(const std::vector<double>& survivors, double more) const {
    if (std::isfinite(spread_)) return more * std::log1p(-quasi_.failure_rate) + std::log(settled_part(survivors));
    const std::vector<double> mass = in_classes(survivors);
    const auto turn = static_cast<std::size_t>(std::fmod(more, period_.period));
    double factor = 0;
    for (std::size_t c = 0; c < mass.size(); ++c)
      if (mass[c] > 0) factor += mass[c] * of_class_[(c + turn) % mass.size()] / of_class_[c];
    return more * std::log1p(-quasi_.failure_rate) + std::log(factor);
  }

 private:
  double settled_part(const std::vector<double>& survivors) const {
    return std::inner_product(survivors.begin(), survivors.end(), quasi_.survival_weight.begin(), 0.0) / weighted_;
  }
  std::size_t class_of(std::size_t i) const { return static_cast<std::size_t>(period_.state_class[i]); }
  std::vector<double> in_classes(const std::vector<double>& v) const {
    std::vector<double> mass(period_.classes.size(), 0.0);
    for (std::size_t i = 0; i < v.size(); ++i) mass[class_of(i)] += v[i];
    return mass;
  }
  const QuasiStationary& quasi_;
  Period period_;
  std::vector<double> shares_, of_class_;
  double spread_ = std::numeric_limits<double>::infinity(), weighted_ = 0;
};

/// Foresees after how many steps survivors have settled, from the unsettled share half-way and now. What is settled for
/// all but rounding is settled now.
double steps_foreseen(double now, double half_way, double share, double harmless) {
  if (!(share > rounded_share)) return now;
  const double fading = std::log(half_way / share) / (now / 2);
  return fading > 0 ? now + std::log(share / harmless) / fading : std::numeric_limits<double>::infinity();
}

/// Returns the probability of never coming to rest.
double never(const Chain& chain, std::span<const double> start, const Heard& heard) {
  const Reachability reach = classify(chain);
  double never = 0, undecided = 0;
  for (std::size_t i = 0; i < start.size(); ++i) {
    if (!reach.can_rest[i]) never += start[i];
    if (reach.can_rest[i] && !reach.must_rest[i]) undecided += start[i];
  }
  if (undecided == 0) return never;
  std::vector<std::uint8_t> safe(chain.size());
  for (std::size_t i = 0; i < safe.size(); ++i) safe[i] = !reach.can_rest[i];
  const BoundedPassage passage = bounded_passage_to(chain, safe, heard);
  never = 0;
  for (std::size_t i = 0; i < start.size(); ++i) never += start[i] * passage.passage.reach[i];
  return never;
}

/// Follows the survivors of a chain step by step, keeps the probability of surviving each number of steps so far, and
/// foretells that of surviving more.
class Followed {
 public:
  Followed(const Chain& chain, std::span<const double> start, const Settled* settled, const Heard& heard)
      : chain_(chain), settled_(settled), heard_(heard), survivors_(chain, start), at_{survivors_.survival()} {}
  double now() const { return static_cast<double>(at_.size() - 1); }
  /// Says whether the survivors need be followed no further: they have settled, or all have failed.
  bool ended() const { return !survivors_.any() || (settled_ && settled_->reached(survivors_.shares())); }
  double unsettled() const { return settled_->unsettled(survivors_.shares()); }
  void follow(double until) {
    while (now() < until && !ended()) {
      if (heard_) heard_();
      survivors_.step();
      at_.push_back(survivors_.survival());
    }
  }
  /// Returns P(no rest within n steps) for rising n. Steps that were not followed are foretold by the failure rate
  /// where survivors have settled, and by slow modes where not.
  std::vector<double> told(const std::vector<double>& steps) const {
    std::vector<double> told, more;
    for (const double n : steps)
      n <= now() ? told.push_back(at_[static_cast<std::size_t>(n)]) : more.push_back(n - now());
    if (more.empty()) return told;
    std::vector<double> beyond(more.size(), 0.0);
    if (survivors_.any() && !ended()) {
      if (!settled_->has_slow_modes(chain_))
        throw ConvergenceError("survival", std::numeric_limits<double>::quiet_NaN(),
                               fmt::format("survivors have not settled after {} steps", now()));
      beyond = survival_by_slow_modes(chain_, settled_->quasi(), survivors_.shares(), more, widest_bound, heard_);
    } else if (survivors_.any()) {
      for (std::size_t k = 0; k < more.size(); ++k)
        beyond[k] = std::exp(settled_->log_survival(survivors_.shares(), more[k]));
    }
    for (const double later : beyond) told.push_back(survivors_.survival() * later);
    return told;
  }

 private:
  const Chain& chain_;
  const Settled* settled_;
  const Heard& heard_;
  Survivors survivors_;
  std::vector<double> at_;
};

}  // namespace

std::vector<double> bounded_survival_after(const Chain& chain, std::span<const double> start,
                                           std::span<const double> steps,
                                           const std::function<const QuasiStationary&()>& quasi, const Heard& heard) {
  check_survival(chain, start, steps);
  const auto entries = static_cast<double>(chain.entries() + chain.size());
  const double anyhow = std::max(least_followed, std::floor(followed_anyhow / entries));
  const double most = std::max(most_followed, anyhow);
  std::vector<double> finite;
  for (const double n : steps)
    if (std::isfinite(n)) finite.push_back(n);
  std::ranges::sort(finite);
  const double last = finite.empty() ? 0 : finite.back();
  const std::unique_ptr<Settled> settled = last > anyhow ? std::make_unique<Settled>(chain, quasi()) : nullptr;
  Followed followed(chain, start, settled.get(), heard);
  followed.follow(std::min(last, std::floor(anyhow / 2)));
  const double half_way = settled ? followed.unsettled() : 0;
  followed.follow(std::min(last, anyhow));
  std::vector<double> told;
  if (followed.now() < last && !followed.ended()) {
    // Without a harmless share, survivors count as settled only when the share of every state has settled, and no
    // estimate says after how many steps that is. The slow modes are then tried first, and more products after them.
    const double harmless = settled->harmless();
    const double needed =
        harmless > 0 ? std::min(last, steps_foreseen(followed.now(), half_way, followed.unsettled(), harmless)) : last;
    try {
      if (needed > 2 * anyhow && settled->has_slow_modes(chain)) told = followed.told(finite);
    } catch (const ConvergenceError&) {
      if (harmless > 0 && needed > most) throw;
    }
    if (told.empty()) followed.follow(std::min(last, most));
  }
  if (told.empty()) told = followed.told(finite);
  std::vector<double> asked;
  for (const double n : steps)
    asked.push_back(std::isinf(n) ? never(chain, start, heard)
                                  : told[static_cast<std::size_t>(std::ranges::find(finite, n) - finite.begin())]);
  return asked;
}

}  // namespace metastable::markov
