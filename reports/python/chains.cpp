// Binds chains that people bring: a sparse matrix with kill rates.

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>

#include "markov/chain/chain.h"
#include "markov/chain/envelope.h"
#include "markov/chain/solver.h"
#include "markov/passage/bounded_passage.h"
#include "markov/passage/bounded_survival.h"
#include "markov/passage/distribution_bound.h"
#include "markov/passage/first_passage.h"
#include "markov/passage/last_steps.h"
#include "markov/passage/quasi_stationary.h"
#include "markov/passage/survival_after.h"
#include "reports/python/answer.h"
#include "reports/python/arguments.h"

namespace metastable::reports::python {
namespace {

using Index = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>;
using Number = py::array_t<double, py::array::c_style | py::array::forcecast>;

/// A chain with its factors, made at the first question that needs them.
class HeldChain {
 public:
  HeldChain(markov::Chain chain, int threads, double memory_gb, double time_limit)
      : chain_(std::move(chain)),
        threads_(threads),
        time_limit_(time_limit),
        way_(markov::way_of(chain_, memory_gb * 1e9)),
        spare_(std::max(0.0, memory_gb * 1e9 - markov::iterated_memory(chain_.size(), chain_.entries()))) {}
  const markov::Chain& chain() const { return chain_; }
  int threads() const { return threads_; }
  double time_limit() const { return time_limit_; }
  double spare() const { return spare_; }  ///< memory beside what iterating takes [byte]
  bool iterates() const { return way_ == markov::Way::iterated; }
  // These are made once, whichever of several Python threads asks first.
  const markov::ChainSolver& solver() {
    const std::lock_guard lock(*making_);
    if (!solver_) solver_ = std::make_unique<markov::ChainSolver>(chain_, threads_);
    return *solver_;
  }
  const markov::BoundedQuasiStationary& quasi_stationary(const markov::Heard& heard) {
    const std::lock_guard lock(*making_);
    if (!quasi_) quasi_ = iterates() ? bounded_quasi_stationary(chain_, heard) : eliminated_quasi_stationary(heard);
    return *quasi_;
  }

 private:
  markov::BoundedQuasiStationary eliminated_quasi_stationary(const markov::Heard& heard) {
    markov::BoundedQuasiStationary found;
    found.quasi = markov::quasi_stationary(solver());
    const std::vector<markov::Extended> left(found.quasi.distribution.begin(), found.quasi.distribution.end());
    const markov::SplitVector weight = markov::split(found.quasi.survival_weight);
    markov::enclose_rate(chain_, weight, found);
    markov::bound_distribution(chain_, left, weight.rest, way_, found, heard);
    return found;
  }

  markov::Chain chain_;
  int threads_;
  double time_limit_;
  markov::Way way_;
  double spare_;
  std::unique_ptr<std::recursive_mutex> making_ = std::make_unique<std::recursive_mutex>();
  std::unique_ptr<markov::ChainSolver> solver_;
  std::optional<markov::BoundedQuasiStationary> quasi_;
};

// Listens for Ctrl-C and for the end of the time, and says how much memory there is.
markov::Heard listening(Call& call, const HeldChain& held, const char* doing) {
  const auto began = std::chrono::steady_clock::now();
  const double time_limit = held.time_limit();
  const auto listen = [&call, time_limit, doing, began] {
    call.tell(0, doing);
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - began;
    if (spent.count() > time_limit)
      throw std::runtime_error(fmt::format("chain: {} was not done after {:g} s (time_limit)", doing, time_limit));
  };
  return {listen, held.spare()};
}

// Takes rows of compressed storage, columns ascending; the diagonal is looked at and left out. Where a row gives its
// own, it has to be what is left in every row; where none does, it is understood.
HeldChain chain_of(const Index& starts, const Index& columns, const Number& values, const Number& kill, int threads,
                   double memory_gb, double time_limit) {
  constexpr double sum_tolerance = 1e-9;
  if (!(memory_gb > 0)) throw std::invalid_argument(fmt::format("memory_gb: {:g}, more than 0 expected", memory_gb));
  if (!(time_limit > 0)) throw std::invalid_argument(fmt::format("time_limit: {:g}, more than 0 expected", time_limit));
  const auto n = static_cast<std::size_t>(kill.size());
  if (n == 0) throw std::invalid_argument("chain: it has 0 states, one or more expected");
  std::vector<std::size_t> row_start{0};
  std::vector<std::uint32_t> column;
  std::vector<double> value, sums(kill.data(), kill.data() + n);
  std::optional<std::size_t> given;  // the first row with a diagonal
  for (std::size_t i = 0; i < n; ++i) {
    for (std::int64_t at = starts.data()[i]; at < starts.data()[i + 1]; ++at) {
      const double p = values.data()[at];
      sums[i] += p;
      if (columns.data()[at] == static_cast<std::int64_t>(i)) {
        if (!given) given = i;
        if (!(p >= 0)) throw std::invalid_argument(fmt::format("chain: row {}: entry {} on the diagonal", i, p));
        continue;
      }
      column.push_back(static_cast<std::uint32_t>(columns.data()[at]));
      value.push_back(p);
    }
    row_start.push_back(column.size());
  }
  HeldChain held{markov::Chain(std::move(row_start), std::move(column), std::move(value),
                               std::vector<double>(kill.data(), kill.data() + n)),
                 threads, memory_gb, time_limit};
  for (std::size_t i = 0; i < n && given; ++i)
    if (!(std::abs(sums[i] - 1) <= sum_tolerance))
      throw std::invalid_argument(
          fmt::format("chain: row {} and its kill rate sum to {:.12g}, 1 expected where the diagonal is given{}", i,
                      sums[i], *given == i ? "" : fmt::format(", as it is in row {}", *given)));
  return held;
}

py::dict first_passage(HeldChain& held, const py::object& progress) {
  markov::BoundedSteps steps;
  Call call(progress);
  call.run([&] {
    if (held.iterates()) {
      steps = markov::bounded_first_passage(held.chain(), listening(call, held, "first passage"));
      return;
    }
    steps.mean = markov::mean_first_passage(held.solver());
    steps.sd = markov::first_passage_sd(held.solver(), steps.mean);
    steps.bounds = markov::steps_enclosed(held.chain(), markov::split(steps.mean));
  });
  py::dict told;
  told["mean"] = array_of(std::move(steps.mean));
  told["sd"] = array_of(std::move(steps.sd));
  told["lower"] = array_of(std::move(steps.bounds.lower));
  told["upper"] = array_of(std::move(steps.bounds.upper));
  return told;
}

py::dict quasi_stationary(HeldChain& held, const py::object& progress) {
  Call call(progress);
  markov::BoundedQuasiStationary found;
  call.run([&] { found = held.quasi_stationary(listening(call, held, "quasi-stationary")); });
  py::dict told;
  told["distribution"] = array_of(std::move(found.quasi.distribution));
  told["survival_weight"] = array_of(std::move(found.quasi.survival_weight));
  told["failure_rate"] = found.quasi.failure_rate;
  told["lower"] = found.rate_lower;
  told["upper"] = found.rate_upper;
  told["distribution_error"] =
      std::isfinite(found.distribution_error) ? py::cast(found.distribution_error) : py::none();
  told["weight_error"] = std::isfinite(found.weight_error) ? py::cast(found.weight_error) : py::none();
  told["unproven"] = found.unproven.empty() ? py::none() : py::cast(found.unproven);
  told["residual"] = found.quasi.residual;
  told["iterations"] = found.quasi.iterations;
  return told;
}

py::dict committor(const HeldChain& held, const py::array_t<bool, py::array::c_style | py::array::forcecast>& set,
                   const py::object& progress) {
  if (static_cast<std::size_t>(set.size()) != held.chain().size())
    throw std::invalid_argument(fmt::format("states: {} marks given for {} states", set.size(), held.chain().size()));
  std::vector<std::uint8_t> marked(set.data(), set.data() + set.size());
  markov::BoundedPassage found;
  Call call(progress);
  call.run([&] {
    const markov::Heard heard = listening(call, held, "committor");
    found = held.iterates()
                ? markov::bounded_passage_to(held.chain(), marked, heard)
                : markov::BoundedPassage{markov::passage_by_elimination(held.chain(), marked, held.threads()), 0};
  });
  py::dict told;
  told["reach"] = array_of(std::move(found.passage.reach));
  told["fail"] = array_of(std::move(found.passage.fail));
  told["steps"] = array_of(std::move(found.passage.steps));
  told["error"] = held.iterates() ? py::cast(found.error) : py::none();
  return told;
}

py::array survival(HeldChain& held, const Number& start, const Number& steps, const py::object& progress) {
  const std::vector<double> from(start.data(), start.data() + start.size()),
      after(steps.data(), steps.data() + steps.size());
  std::vector<double> at;
  Call call(progress);
  call.run([&] {
    const markov::Heard heard = listening(call, held, "survival");
    at = held.chain().size() > markov::doubled_states
             ? markov::bounded_survival_after(
                   held.chain(), from, after,
                   [&]() -> const markov::QuasiStationary& { return held.quasi_stationary(heard).quasi; }, heard)
             : markov::survival_after(held.chain(), from, after);
  });
  return array_of(std::move(at));
}

}  // namespace

void add_chains(py::module_& module) {
  py::class_<HeldChain>(module, "Chain")
      .def(py::init(&chain_of))
      .def_property_readonly("size", [](const HeldChain& held) { return held.chain().size(); })
      .def_property_readonly("entries", [](const HeldChain& held) { return held.chain().entries(); })
      .def("first_passage", first_passage)
      .def("quasi_stationary", quasi_stationary)
      .def("committor", committor)
      .def("survival", survival);
}

}  // namespace metastable::reports::python
