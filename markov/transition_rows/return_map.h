#pragma once
// Defines the only thing markov/ knows of the world: a stochastic return map.
//
// Example:
//   #include <metastable/analysis/study/metastability.h>
//
//   #include <cmath>
//   #include <cstdio>
//
//   // The energy of a hopper just before it lands: part of it is lost, the leg adds 1, and the ground is uneven.
//   struct Hopper {
//     std::pair<double, double> state_interval(int) const { return {0, INFINITY}; }
//     int phases() const { return 1; }
//     int noise_dimension() const { return 1; }
//     std::optional<double> landing(double energy, int, std::span<const double> score) const {
//       const double next = 0.6 * energy + 1 + 0.8 * score[0];
//       return next > 0 ? std::optional(next) : std::nullopt;  // nothing: it falls
//     }
//   };
//
//   int main() {
//     const metastable::analysis::Problem from_rest{Hopper{}, {[](double) { return 1.0; }, 0}};
//     const auto study = metastable::analysis::study(from_rest);
//     std::printf("falls after %.1f hops on average\n", study.steps.from_start.value);
//   }
// prints
//   falls after 192.7 hops on average

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace metastable::markov {

/// This landing stands for "came to rest" wherever landings are written into arrays.
inline constexpr double rest_landing = -std::numeric_limits<double>::infinity();

/// A stochastic return map leads from the state just before one event to the state just before the next.
///
/// States are real numbers (for a wheel: omega^2 [rad^2/s^2] just before a collision).
/// Phases count 0 .. phases()-1; the event at phase p is followed by the event at phase (p + 1) % phases().
/// Noise is a vector of noise_dimension() independent standard normal scores. A score keeps both tails of
/// its probability exact: its quantile level is Phi(z) and the complement Phi(-z).
///
///   state_interval(phase)          {lowest, highest} state a survivor can have before the event at `phase`;
///                                  highest may be +infinity (then the grid finds its own upper edge)
///   landing(state, phase, noise)   the next state, or nothing when the system comes to rest
///
/// Members used when present (see AnyReturnMap for their meaning): rest_probability, landing_range,
/// landing_density, landing_points, landing_defect, memory_defect, states_of_extremes, tabulate, duration, advance,
/// assumptions, violates.
template <class M>
concept ReturnMap = requires(const M& map, double state, int phase, std::span<const double> noise) {
  { map.state_interval(phase) } -> std::convertible_to<std::pair<double, double>>;
  { map.phases() } -> std::convertible_to<int>;
  { map.noise_dimension() } -> std::convertible_to<int>;
  { map.landing(state, phase, noise) } -> std::convertible_to<std::optional<double>>;
};

/// Holds many draws of the noise at one phase, ready to be applied to any state.
class NoiseTable {
 public:
  virtual ~NoiseTable() = default;
  /// Sets next[k] to the landing of state origin + width * offset[k] under draw first + k, for k < next.size(), and to
  /// rest_landing where the system comes to rest. offset has the size of next.
  virtual void land(double origin, double width, std::span<const double> offset, std::size_t first,
                    std::span<double> next) const = 0;
  /// No state below this one survives draw k: where landings rise with the state, it is the state that just does.
  /// -infinity if unknown.
  virtual double lowest_survivor(std::size_t) const { return rest_landing; }
  /// Puts draw order[k] in place k; order is a permutation. Nothing happens where lowest_survivor() is unknown.
  virtual void reorder(std::span<const std::uint32_t>) {}
};

/// Wraps any return map by shared pointer: it is cheap to copy, immutable and safe to share between threads.
class AnyReturnMap {
 public:
  template <ReturnMap M>
  AnyReturnMap(M map) : self_(std::make_shared<Model<M>>(std::move(map))) {}  // NOLINT(google-explicit-constructor)

  std::pair<double, double> state_interval(int phase) const { return self_->state_interval(phase); }
  int phases() const { return self_->phases(); }
  int noise_dimension() const { return self_->noise_dimension(); }
  std::optional<double> landing(double state, int phase, std::span<const double> noise) const {
    return self_->landing(state, phase, noise);
  }
  /// Returns the exact probability of rest from `state` (relative accuracy, tails included), nothing if unknown.
  std::optional<double> rest_probability(double state, int phase) const {
    return self_->rest_probability(state, phase);
  }
  /// Returns {infimum, supremum} of the landing over the whole support of the noise; the infimum is rest_landing
  /// when rest is possible, the supremum is rest_landing when it is certain. Returns nothing if unknown.
  std::optional<std::pair<double, double>> landing_range(double state, int phase) const {
    return self_->landing_range(state, phase);
  }
  /// Gives the landing's density from `state` at each of the next states: density[k] belongs to next[k] (equal sizes),
  /// with relative accuracy, tails included; over all next states it integrates to 1 - rest probability, which is
  /// returned. Writes and returns nothing if the map does not tell. May throw std::invalid_argument where this map's
  /// noise has no density.
  std::optional<double> landing_density(double state, int phase, std::span<const double> next,
                                        std::span<double> density) const {
    return self_->landing_density(state, phase, next, density);
  }
  /// Gives points {next state, weight} whose sum of weight * f(next) is E[f(landing)] over the survivors, for f that
  /// is smooth between `breaks` (ascending); returns the probability of rest, nothing if the map does not tell. May
  /// throw std::invalid_argument where this map's noise has no such points.
  std::optional<double> landing_points(double state, int phase, std::span<const double> breaks,
                                       std::vector<std::pair<double, double>>& points) const {
    return self_->landing_points(state, phase, breaks, points);
  }
  /// Takes, where landing() reads an approximation of the true landing, one draw of E[f(true landing)] - E[f(landing)],
  /// f(rest) being 0; its mean over `noise` is that difference. Returns nothing if landing() is exact.
  std::optional<double> landing_defect(double state, int phase, std::span<const double> noise,
                                       const std::function<double(double next)>& f) const {
    return self_->landing_defect(state, phase, noise, f);
  }
  /// Takes, where the state does not tell all that the next event depends on, one draw of what the rest does to
  /// E[f(state two events on)], f(rest) being 0. `noise` holds the scores of both events. Returns nothing if the state
  /// tells all.
  std::optional<double> memory_defect(double state, int phase, std::span<const double> noise,
                                      const std::function<double(double after_next)>& f) const {
    return self_->memory_defect(state, phase, noise, f);
  }
  /// Lists states at `phase`, ascending, with an extreme landing among `next`: expectations of a function that is
  /// not smooth at `next` are not smooth there. The list is empty if the map does not tell.
  std::vector<double> states_of_extremes(int phase, std::span<const double> next) const {
    return self_->states_of_extremes(phase, next);
  }
  /// Prepares draws for repeated use; noise is row-major, one row of noise_dimension() scores a draw.
  std::unique_ptr<NoiseTable> tabulate(int phase, std::span<const double> noise) const {
    return self_->tabulate(phase, noise);
  }
  /// Returns the time [s] between the event at `phase` and the next one, given that one's state; nothing if unknown.
  std::optional<double> duration(double next_state, int phase) const { return self_->duration(next_state, phase); }
  /// Returns the distance [m] from the event at `phase` to the next one; nothing if unknown.
  std::optional<double> advance(int phase) const { return self_->advance(phase); }
  /// Names the modelling assumptions that single events may violate.
  std::vector<std::string> assumptions() const { return self_->assumptions(); }
  /// Says whether the event in which `state` meets `noise` at `phase` violates assumption number `which`.
  bool violates(int which, double state, int phase, std::span<const double> noise) const {
    return self_->violates(which, state, phase, noise);
  }

 private:
  struct Base {
    virtual ~Base() = default;
    virtual std::pair<double, double> state_interval(int phase) const = 0;
    virtual int phases() const = 0;
    virtual int noise_dimension() const = 0;
    virtual std::optional<double> landing(double, int, std::span<const double>) const = 0;
    virtual std::optional<double> rest_probability(double, int) const = 0;
    virtual std::optional<std::pair<double, double>> landing_range(double, int) const = 0;
    virtual std::optional<double> landing_density(double, int, std::span<const double>, std::span<double>) const = 0;
    virtual std::optional<double> landing_points(double, int, std::span<const double>,
                                                 std::vector<std::pair<double, double>>&) const = 0;
    virtual std::optional<double> landing_defect(double, int, std::span<const double>,
                                                 const std::function<double(double)>&) const = 0;
    virtual std::optional<double> memory_defect(double, int, std::span<const double>,
                                                const std::function<double(double)>&) const = 0;
    virtual std::vector<double> states_of_extremes(int, std::span<const double>) const = 0;
    virtual std::unique_ptr<NoiseTable> tabulate(int, std::span<const double>) const = 0;
    virtual std::optional<double> duration(double, int) const = 0;
    virtual std::optional<double> advance(int) const = 0;
    virtual std::vector<std::string> assumptions() const = 0;
    virtual bool violates(int, double, int, std::span<const double>) const = 0;
  };

  // Goes draw by draw through landing(): serves every map that has no faster way.
  template <class M>
  struct PlainTable final : NoiseTable {
    PlainTable(const M& m, int p, std::span<const double> n) : map(m), phase(p), noise(n.begin(), n.end()) {}
    void land(double origin, double width, std::span<const double> offset, std::size_t first,
              std::span<double> next) const override {
      const auto dimension = static_cast<std::size_t>(map.noise_dimension());
      for (std::size_t k = 0; k < next.size(); ++k) {
        const std::span<const double> row(noise.data() + (first + k) * dimension, dimension);
        const std::optional<double> landed = map.landing(origin + width * offset[k], phase, row);
        next[k] = landed.value_or(rest_landing);
      }
    }
    const M& map;
    int phase;
    std::vector<double> noise;
  };

  template <class Table>
  struct OwnTable final : NoiseTable {
    explicit OwnTable(Table t) : table(std::move(t)) {}
    void land(double origin, double width, std::span<const double> offset, std::size_t first,
              std::span<double> next) const override {
      table.land(origin, width, offset, first, next);
    }
    double lowest_survivor(std::size_t k) const override {
      if constexpr (requires { table.lowest_survivor(k); })
        return table.lowest_survivor(k);
      else
        return rest_landing;
    }
    void reorder(std::span<const std::uint32_t> order) override {
      if constexpr (requires { table.lowest_survivor(0); }) table.reorder(order);
    }
    Table table;
  };

  template <class M>
  struct Model final : Base {
    explicit Model(M m) : map(std::move(m)) {}
    std::pair<double, double> state_interval(int phase) const override { return map.state_interval(phase); }
    int phases() const override { return map.phases(); }
    int noise_dimension() const override { return map.noise_dimension(); }
    std::optional<double> landing(double state, int phase, std::span<const double> noise) const override {
      return map.landing(state, phase, noise);
    }
    std::optional<double> rest_probability(double state, int phase) const override {
      if constexpr (requires { map.rest_probability(state, phase); })
        return map.rest_probability(state, phase);
      else
        return std::nullopt;
    }
    std::optional<std::pair<double, double>> landing_range(double state, int phase) const override {
      if constexpr (requires { map.landing_range(state, phase); })
        return map.landing_range(state, phase);
      else
        return std::nullopt;
    }
    std::optional<double> landing_density(double state, int phase, std::span<const double> next,
                                          std::span<double> density) const override {
      if constexpr (requires { map.landing_density(state, phase, next, density); })
        return map.landing_density(state, phase, next, density);
      else
        return std::nullopt;
    }
    std::optional<double> landing_points(double state, int phase, std::span<const double> breaks,
                                         std::vector<std::pair<double, double>>& points) const override {
      if constexpr (requires { map.landing_points(state, phase, breaks, points); })
        return map.landing_points(state, phase, breaks, points);
      else
        return std::nullopt;
    }
    std::optional<double> landing_defect(double state, int phase, std::span<const double> noise,
                                         const std::function<double(double)>& f) const override {
      if constexpr (requires { map.landing_defect(state, phase, noise, f); })
        return map.landing_defect(state, phase, noise, f);
      else
        return std::nullopt;
    }
    std::optional<double> memory_defect(double state, int phase, std::span<const double> noise,
                                        const std::function<double(double)>& f) const override {
      if constexpr (requires { map.memory_defect(state, phase, noise, f); })
        return map.memory_defect(state, phase, noise, f);
      else
        return std::nullopt;
    }
    std::vector<double> states_of_extremes(int phase, std::span<const double> next) const override {
      if constexpr (requires { map.states_of_extremes(phase, next); })
        return map.states_of_extremes(phase, next);
      else
        return {};
    }
    std::unique_ptr<NoiseTable> tabulate(int phase, std::span<const double> noise) const override {
      if constexpr (requires { map.tabulate(phase, noise); })
        return std::make_unique<OwnTable<decltype(map.tabulate(phase, noise))>>(map.tabulate(phase, noise));
      else
        return std::make_unique<PlainTable<M>>(map, phase, noise);
    }
    std::optional<double> duration(double next_state, int phase) const override {
      if constexpr (requires { map.duration(next_state, phase); })
        return map.duration(next_state, phase);
      else
        return std::nullopt;
    }
    std::optional<double> advance(int phase) const override {
      if constexpr (requires { map.advance(phase); })
        return map.advance(phase);
      else
        return std::nullopt;
    }
    std::vector<std::string> assumptions() const override {
      if constexpr (requires { map.assumptions(); })
        return map.assumptions();
      else
        return {};
    }
    bool violates(int which, double state, int phase, std::span<const double> noise) const override {
      if constexpr (requires { map.violates(which, state, phase, noise); })
        return map.violates(which, state, phase, noise);
      else
        return false;
    }
    M map;
  };

  std::shared_ptr<const Base> self_;
};

}  // namespace metastable::markov
