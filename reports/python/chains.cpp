// Binds chains that people bring: a sparse matrix with kill rates.

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>

#include "markov/chain/chain.h"
#include "markov/chain/eigenpairs.h"
#include "markov/chain/solver.h"
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
  HeldChain(markov::Chain chain, int threads) : chain_(std::move(chain)), threads_(threads) {}
  const markov::Chain& chain() const { return chain_; }
  int threads() const { return threads_; }
  const markov::ChainSolver& solver() {
    if (!solver_) solver_ = std::make_unique<markov::ChainSolver>(chain_, threads_);
    return *solver_;
  }
  const markov::QuasiStationary& quasi_stationary() {
    if (!quasi_) quasi_ = markov::quasi_stationary(solver());
    return *quasi_;
  }

 private:
  markov::Chain chain_;
  int threads_;
  std::unique_ptr<markov::ChainSolver> solver_;
  std::optional<markov::QuasiStationary> quasi_;
};

// Takes rows of compressed storage, columns ascending; the diagonal is looked at and left out. Where a row gives its
// own, it has to be what is left in every row; where none does, it is understood.
HeldChain chain_of(const Index& starts, const Index& columns, const Number& values, const Number& kill, int threads) {
  constexpr double sum_tolerance = 1e-9;
  const auto n = static_cast<std::size_t>(kill.size());
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
                 threads};
  for (std::size_t i = 0; i < n && given; ++i)
    if (!(std::abs(sums[i] - 1) <= sum_tolerance))
      throw std::invalid_argument(
          fmt::format("chain: row {} and its kill rate sum to {:.12g}, 1 expected where the diagonal is given{}", i,
                      sums[i], *given == i ? "" : fmt::format(", as it is in row {}", *given)));
  return held;
}

struct Bounds {
  std::vector<double> lower, upper;
};

// Returns bounds of the expected steps m, (I - Q) m = 1: with v the answer and r = v - Q v, v / max r <= m <= v / min
// r, because (I - Q)^-1 has no negative entry. It takes r in extended precision, as kill v + sum q (v_i - v_j), with
// the rounding of that.
Bounds enclosed(const markov::Chain& chain, const std::vector<double>& v) {
  constexpr long double eps = std::numeric_limits<long double>::epsilon();
  long double low = std::numeric_limits<long double>::infinity(), high = 0;
  for (std::size_t i = 0; i < chain.size(); ++i) {
    const long double own = v[i];
    long double residual = own * chain.kill(i), size = residual;
    const auto columns = chain.columns(i);
    const auto values = chain.values(i);
    for (std::size_t k = 0; k < columns.size(); ++k) {
      const long double part = values[k] * (own - v[columns[k]]);
      residual += part;
      size += std::abs(part);
    }
    const long double error = 2 * eps * static_cast<long double>(columns.size() + 2) * size;
    low = std::min(low, residual - error);
    high = std::max(high, residual + error);
  }
  Bounds bounds;
  constexpr double out = 4 * std::numeric_limits<double>::epsilon();
  for (const double value : v) {
    bounds.lower.push_back(static_cast<double>(value / high) * (1 - out));
    bounds.upper.push_back(low > 0 ? static_cast<double>(value / low) * (1 + out)
                                   : std::numeric_limits<double>::infinity());
  }
  return bounds;
}

py::dict first_passage(HeldChain& held, const py::object& progress) {
  std::vector<double> mean, sd;
  Bounds bounds;
  Call call(progress);
  call.run([&] {
    mean = markov::mean_first_passage(held.solver());
    sd = markov::first_passage_sd(held.solver(), mean);
    bounds = enclosed(held.chain(), mean);
  });
  py::dict told;
  told["mean"] = array_of(std::move(mean));
  told["sd"] = array_of(std::move(sd));
  told["lower"] = array_of(std::move(bounds.lower));
  told["upper"] = array_of(std::move(bounds.upper));
  return told;
}

py::dict quasi_stationary(HeldChain& held, const py::object& progress) {
  Call call(progress);
  markov::QuasiStationary q;
  call.run([&] { q = held.quasi_stationary(); });
  py::dict told;
  told["distribution"] = array_of(std::move(q.distribution));
  told["survival_weight"] = array_of(std::move(q.survival_weight));
  told["failure_rate"] = q.failure_rate;
  told["residual"] = q.residual;
  told["iterations"] = q.iterations;
  return told;
}

py::dict committor(const HeldChain& held, const py::array_t<bool, py::array::c_style | py::array::forcecast>& set,
                   const py::object& progress) {
  if (static_cast<std::size_t>(set.size()) != held.chain().size())
    throw std::invalid_argument(fmt::format("states: {} marks given for {} states", set.size(), held.chain().size()));
  std::vector<std::uint8_t> marked(set.data(), set.data() + set.size());
  markov::PassageTo found;
  Call call(progress);
  call.run([&] { found = markov::passage_to(held.chain(), marked); });
  py::dict told;
  told["reach"] = array_of(std::move(found.reach));
  told["fail"] = array_of(std::move(found.fail));
  told["steps"] = array_of(std::move(found.steps));
  return told;
}

py::array survival(const HeldChain& held, const Number& start, const Number& steps, const py::object& progress) {
  const std::vector<double> from(start.data(), start.data() + start.size()),
      after(steps.data(), steps.data() + steps.size());
  std::vector<double> at;
  Call call(progress);
  call.run([&] { at = markov::survival_after(held.chain(), from, after, held.threads()); });
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
