#include "analysis/sensitivity/propagation.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace metastable::analysis {
namespace {

double derivative(const Sensitivities& of, Parameter parameter) {
  for (const Sensitivity& one : of.ranked)
    if (one.parameter == parameter && !one.leg) return one.derivative;
  throw std::invalid_argument(
      fmt::format("{}: a standard error was given, but there is no sensitivity", parameter_name(parameter)));
}

Propagated from_variances(double value, std::vector<Propagated::VarianceShare> variances) {
  Propagated result;
  double variance = 0;
  for (const Propagated::VarianceShare& one : variances) variance += one.share;
  if (variance > 0)
    for (Propagated::VarianceShare& one : variances) one.share /= variance;
  result.log_sd = std::sqrt(variance);
  const double half = boost::math::quantile(boost::math::normal(), 0.975) * result.log_sd;
  result.interval = {value, value * std::exp(-half), value * std::exp(half)};
  std::stable_sort(variances.begin(), variances.end(), [](const auto& a, const auto& b) { return a.share > b.share; });
  result.shares = std::move(variances);
  return result;
}

}  // namespace

void check_standard_errors(const Setting& setting, const std::vector<StandardError>& errors) {
  for (std::size_t i = 0; i < errors.size(); ++i) {
    const auto name = parameter_name(errors[i].parameter);
    if (!(errors[i].value >= 0 && std::isfinite(errors[i].value)))
      throw std::invalid_argument(fmt::format("{}: standard error {} is outside [0, inf)", name, errors[i].value));
    if (!matters(setting, errors[i].parameter))
      throw std::invalid_argument(
          fmt::format("{}: a standard error was given, but the setting does not depend on it "
                      "(its law, a list of contacts, or a spread of 0)",
                      name));
    for (std::size_t k = 0; k < i; ++k)
      if (errors[k].parameter == errors[i].parameter)
        throw std::invalid_argument(fmt::format("{}: two standard errors were given", name));
  }
}

Propagated propagate(double steps, const Sensitivities& sensitivities, const std::vector<StandardError>& errors) {
  std::vector<Propagated::VarianceShare> variances;
  for (const StandardError& error : errors) {
    const double part = derivative(sensitivities, error.parameter) * error.value;
    variances.push_back({error.parameter, part * part});
  }
  return from_variances(steps, std::move(variances));
}

Propagated propagate_ratio(double ratio, const RatioSide& of, const RatioSide& against,
                           const std::vector<StandardError>& errors) {
  std::vector<Propagated::VarianceShare> variances;
  for (const StandardError& error : errors) {
    const double a = derivative(against.sensitivities, error.parameter) * error.value,
                 b = derivative(of.sensitivities, error.parameter) * error.value;
    const bool apart =
        parameter_value(of.setting, error.parameter) != parameter_value(against.setting, error.parameter);
    variances.push_back({error.parameter, apart ? a * a + b * b : (b - a) * (b - a)});
  }
  return from_variances(ratio, std::move(variances));
}

}  // namespace metastable::analysis
