#include "analysis/experiment/angle_recording.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <stdexcept>

#include "analysis/experiment/csv_field.h"
#include "analysis/statistics/random.h"
#include "dynamics/extended_wheel/stance_motion.h"
#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

using dynamics::Stance;
using dynamics::StanceState;

constexpr double lead = 0.3;         // [s] recorded before collision 1
constexpr std::uint64_t stream = 1;  // of random numbers, apart from the trials' own

// The motion between two collisions, or before the first, or after the last.
struct Piece {
  double begin = 0, end = 0;  // [s]
  double angle = 0;           // of the wheel at `from`
  double from = 0;            // time of `state` [s]
  StanceState state;
  double pendulum = 0;
  double at(double time) const {
    return angle + dynamics::stance_motion(pendulum, state, time - from).angle - state.angle;
  }
};

// Returns the stance before collision 1, from its end backwards.
Piece before_first(const Stance& stance, double omega) {
  Piece piece{.begin = -lead,
              .end = 0,
              .angle = 0,
              .from = 0,
              .state = {stance.end_angle_rad, omega},
              .pendulum = stance.pendulum};
  constexpr double step = 1e-4;
  StanceState now = piece.state;
  for (double time = 0; time > -lead; time -= step) {
    now = dynamics::stance_motion(stance.pendulum, now, -step);
    if (now.speed <= 0 || now.angle < stance.start_angle_rad) {
      piece.begin = time;
      break;
    }
  }
  return piece;
}

}  // namespace

void CameraOptions::validate() const {
  if (!(rate >= 10 && rate <= 100000))
    throw std::invalid_argument(fmt::format("angle rate: {} Hz is outside [10, 100000]", rate));
  if (!(noise_sd_rad >= 0) || !std::isfinite(noise_sd_rad))
    throw std::invalid_argument(fmt::format("angle noise: {} rad is outside [0, inf)", noise_sd_rad));
  if (decimals < 1 || decimals > 15)
    throw std::invalid_argument(fmt::format("angle decimals: {} is outside 1..15", decimals));
}

AngleRecording record_angle(const dynamics::WheelMap& map, const dynamics::Trial& trial, const CameraOptions& options,
                            std::uint64_t index) {
  options.validate();
  const auto phase = [&](int leg) { return leg % map.phases(); };
  std::vector<Piece> pieces;
  const dynamics::TrialCollision& first = trial.collisions.front();
  const int legs = map.wheel().legs();
  const Stance& previous = map.stance(phase((first.leg + legs - 1) % legs));
  pieces.push_back(before_first(previous, first.omega_minus));
  const bool held = pieces.front().begin > -lead &&
                    dynamics::stance_motion(previous.pendulum, pieces.front().state, pieces.front().begin).angle >
                        std::numbers::pi / 2;
  double angle = 0;
  for (std::size_t i = 0; i < trial.collisions.size(); ++i) {
    const dynamics::TrialCollision& c = trial.collisions[i];
    const Stance& stance = map.stance(phase(c.leg));
    Piece piece{.begin = c.time,
                .end = 0,
                .angle = angle,
                .from = c.time,
                .state = {stance.start_angle_rad, c.omega_plus},
                .pendulum = stance.pendulum};
    if (i + 1 < trial.collisions.size()) {
      piece.end = trial.collisions[i + 1].time;
    } else if (trial.outcome == dynamics::Outcome::rest) {
      // It goes up to where it turns and back again, which takes as long.
      double up = 0;
      for (StanceState now = piece.state; now.speed > 0; up += 1e-4)
        now = dynamics::stance_motion(piece.pendulum, now, 1e-4);
      piece.end = c.time + 2 * up;
    } else {
      piece.end = c.time + dynamics::stance_passage(piece.pendulum, piece.state, stance.end_angle_rad).first;
    }
    angle += stance.end_angle_rad - stance.start_angle_rad;
    pieces.push_back(piece);
  }
  const bool rested = trial.outcome == dynamics::Outcome::rest;
  const double begin = held ? -lead : pieces.front().begin,
               end = pieces.back().end + (rested ? recorded_after_rest_s : 0);
  const double offset = uniform_at(options.seed, index, 0, stream);
  AngleRecording recording;
  std::size_t p = 0;
  for (std::uint64_t k = 0;; ++k) {
    const double time = begin + (static_cast<double>(k) + offset) / options.rate;
    if (!(time < end)) return recording;
    while (p + 1 < pieces.size() && time >= pieces[p].end) ++p;
    const double noise =
        options.noise_sd_rad > 0
            ? options.noise_sd_rad * dynamics::normal_quantile(uniform_at(options.seed, index, k + 1, stream))
            : 0;
    // The wheel is held before the release; it stands on both feet after the fall back.
    const double moment = rested && time >= pieces[p].end ? pieces[p].begin : std::max(time, pieces.front().begin);
    recording.time.push_back(time);
    recording.angle_rad.push_back(pieces[p].at(moment) + noise);
  }
}

std::string angle_csv(const std::vector<SimulatedCondition>& conditions, const CameraOptions& options) {
  options.validate();
  std::string text = "condition,trial,time_s,angle_rad\n";
  std::size_t before = 0;
  for (const SimulatedCondition& condition : conditions) {
    if (condition.setting.law == dynamics::Law::settled)
      throw std::invalid_argument(
          "angle.csv: under settled a landing has hops and slides, of which no angle is recorded; published, coulomb "
          "or "
          "plastic can be filmed");
    const dynamics::WheelMap map = condition.setting.map();
    const std::string id = csv_field(condition.id);
    std::vector<std::string> rows(condition.trials.size());
    const auto record = [&](std::size_t t) {
      const AngleRecording recording = record_angle(map, condition.trials[t], options, before + t);
      for (std::size_t k = 0; k < recording.time.size(); ++k)
        fmt::format_to(std::back_inserter(rows[t]), "{},{},{:.6f},{:.{}f}\n", id, before + t + 1, recording.time[k],
                       recording.angle_rad[k], options.decimals);
    };
    markov::parallel_for(rows.size(), options.threads, record, options.progress);
    for (const std::string& part : rows) text += part;
    before += rows.size();
  }
  return text;
}

std::string angle_csv(const Setting& setting, const std::vector<dynamics::Trial>& trials,
                      const CameraOptions& options) {
  return angle_csv({{fmt::format("{}", setting.slope_deg), setting, trials}}, options);
}

}  // namespace metastable::analysis
