#include "analysis/description/speed_profile.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace metastable::analysis {

TrialSpeeds speeds(const Experiment& experiment, std::size_t condition) {
  if (condition >= experiment.conditions.size())
    throw std::invalid_argument(fmt::format("condition {} of {}", condition, experiment.conditions.size()));
  TrialSpeeds all;
  for (const MeasuredTrial& trial : experiment.trials) {
    if (trial.condition != condition) continue;
    std::vector<double>& one = all.emplace_back();
    for (const MeasuredCollision& c : trial.collisions) one.push_back(c.omega_minus);
  }
  return all;
}

TrialSpeeds speeds(const std::vector<dynamics::Trial>& trials) {
  TrialSpeeds all;
  for (const dynamics::Trial& trial : trials) {
    std::vector<double>& one = all.emplace_back();
    for (const dynamics::TrialCollision& c : trial.collisions) one.push_back(c.omega_minus);
  }
  return all;
}

SpeedSummary speed_summary(std::span<const double> values) {
  SpeedSummary s;
  s.count = values.size();
  const auto n = static_cast<double>(s.count);
  for (const double x : values) s.mean += x / n;
  if (s.count < 2) return s;
  double square = 0;
  for (const double x : values) square += (x - s.mean) * (x - s.mean);
  s.sd = std::sqrt(square / (n - 1));
  s.standard_error = s.sd / std::sqrt(n);
  return s;
}

std::vector<double> at_collision(const TrialSpeeds& trials, int number) {
  std::vector<double> values;
  for (const std::vector<double>& trial : trials)
    if (static_cast<int>(trial.size()) >= number) values.push_back(trial[static_cast<std::size_t>(number) - 1]);
  return values;
}

std::vector<SpeedSummary> speed_profile(const TrialSpeeds& trials) {
  std::size_t longest = 0;
  for (const std::vector<double>& trial : trials) longest = std::max(longest, trial.size());
  std::vector<SpeedSummary> profile;
  for (std::size_t k = 1; k <= longest; ++k)
    profile.push_back(speed_summary(at_collision(trials, static_cast<int>(k))));
  return profile;
}

std::vector<double> steady_speeds(const TrialSpeeds& trials, int from) {
  std::vector<double> values;
  for (const std::vector<double>& trial : trials)
    for (std::size_t k = static_cast<std::size_t>(from) - 1; k < trial.size(); ++k) values.push_back(trial[k]);
  return values;
}

std::vector<double> steady_trial_means(const TrialSpeeds& trials, int from) {
  std::vector<double> means;
  for (const std::vector<double>& trial : trials) {
    const auto skip = static_cast<std::size_t>(from) - 1;
    if (trial.size() > skip) means.push_back(speed_summary(std::span(trial).subspan(skip)).mean);
  }
  return means;
}

std::optional<std::vector<SpeedSummary>> speed_per_leg(const Experiment& experiment, std::size_t condition, int from) {
  std::vector<std::vector<double>> means(static_cast<std::size_t>(experiment.legs()));
  for (const MeasuredTrial& trial : experiment.trials) {
    if (trial.condition != condition) continue;
    std::vector<std::vector<double>> of_leg(means.size());
    for (const MeasuredCollision& c : trial.collisions) {
      if (c.number < from) continue;
      if (!c.leg) return std::nullopt;
      of_leg[static_cast<std::size_t>(*c.leg)].push_back(c.omega_minus);
    }
    for (std::size_t leg = 0; leg < means.size(); ++leg)
      if (!of_leg[leg].empty()) means[leg].push_back(speed_summary(of_leg[leg]).mean);
  }
  std::vector<SpeedSummary> summaries;
  for (const std::vector<double>& one : means) summaries.push_back(speed_summary(one));
  return summaries;
}

std::optional<ReturnMapLine> return_map_line(const TrialSpeeds& trials, int from) {
  double count = 0, x_mean = 0, y_mean = 0;
  const auto each = [&](const auto& use) {  // use(x, y, trial)
    for (std::size_t t = 0; t < trials.size(); ++t)
      for (std::size_t k = static_cast<std::size_t>(from) - 1; k + 1 < trials[t].size(); ++k)
        use(trials[t][k], trials[t][k + 1], t);
  };
  each([&](double x, double y, std::size_t) {
    ++count;
    x_mean += (x - x_mean) / count;
    y_mean += (y - y_mean) / count;
  });
  double xx = 0, xy = 0;
  each([&](double x, double y, std::size_t) {
    xx += (x - x_mean) * (x - x_mean);
    xy += (x - x_mean) * (y - y_mean);
  });
  if (count < 3 || !(xx > 0)) return std::nullopt;
  ReturnMapLine line;
  line.pairs = static_cast<std::size_t>(count);
  line.slope = xy / xx;
  line.intercept = y_mean - line.slope * x_mean;
  if (line.slope != 1) line.fixed_point = line.intercept / (1 - line.slope);
  double squares = 0;
  std::vector<double> scores(trials.size(), 0);
  each([&](double x, double y, std::size_t t) {
    const double residual = y - y_mean - line.slope * (x - x_mean);
    squares += residual * residual;
    scores[t] += residual * (x - x_mean);
  });
  line.residual_sd = std::sqrt(squares / (count - 2));
  double between = 0;
  for (const double score : scores) between += score * score;
  line.slope_error = std::sqrt(between) / xx;
  return line;
}

}  // namespace metastable::analysis
