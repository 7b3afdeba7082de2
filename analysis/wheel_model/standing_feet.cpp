#include "analysis/wheel_model/standing_feet.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "analysis/statistics/median.h"
#include "dynamics/settled/landing_grid.h"

namespace metastable::analysis {
namespace {

// Returns the largest restitution that a foot can have which leaves so fast, that of a foot that sticks.
double largest_restitution(const WheelRuns& measured, const WheelRun& run, const RunCollision& m) {
  const dynamics::LandingShares& landings = *measured.landings[run.condition];
  const double lost = 1 - std::sqrt(landings.legs[static_cast<std::size_t>(m.context.leg)].plastic);
  return (1 - *m.after / m.before) / lost - 1;
}

bool stands_by_its_plus(const WheelRuns& measured, const WheelRun& run, const RunCollision& m) {
  if (!m.after || !(*m.after > 0)) return false;
  const dynamics::LandingShares& landings = *measured.landings[run.condition];
  return largest_restitution(measured, run, m) <= landings.settling_restitution(m.context.leg, m.before);
}

bool springs(const WheelRuns& measured, const RunCollision& m) {
  return !measured.springing.empty() && measured.springing[static_cast<std::size_t>(m.context.leg)];
}

}  // namespace

bool stands_at_any_restitution(const WheelRuns& measured, const WheelRun& run, const RunCollision& m) {
  const dynamics::LandingShares& landings = *measured.landings[run.condition];
  return m.before < landings.legs[static_cast<std::size_t>(m.context.leg)].settles_below;
}

void find_springing_legs(WheelRuns& measured) {
  constexpr double hardly = 0.1, many = 0.3;  // of a leg's landings
  constexpr int fewest = 8;                   // landings of a leg
  if (measured.landings.empty() || !measured.legs_known || measured.wheel.legs() < 3) return;
  const double assumed = measured.contact.restitution_mean + dynamics::settling_sds * measured.contact.restitution_sd;
  const auto legs = static_cast<std::size_t>(measured.wheel.legs());
  std::vector<double> all(legs), below(legs);
  for (const WheelRun& run : measured.runs)
    for (const RunCollision& m : run.collisions) {
      if (!m.after || !(*m.after > 0)) continue;
      ++all[static_cast<std::size_t>(m.context.leg)];
      below[static_cast<std::size_t>(m.context.leg)] += largest_restitution(measured, run, m) <= assumed;
    }
  std::vector<double> share(legs, 1);
  for (std::size_t leg = 0; leg < legs; ++leg)
    if (all[leg] >= fewest) share[leg] = below[leg] / all[leg];
  std::vector<bool> springing(legs);
  for (std::size_t leg = 0; leg < legs; ++leg) springing[leg] = share[leg] < hardly;
  if (median(share) < many || std::ranges::count(springing, true) == 0) return;
  measured.springing = springing;
  tabulate_landings(measured);
  for (std::size_t leg = 0; leg < legs; ++leg)
    if (springing[leg])
      measured.notes.push_back(fmt::format(
          "leg {} leaves as a foot does that gives back more than {:.2g}: what follows its landings is judged "
          "where its omega+ leaves no doubt that it came to stand",
          leg, assumed));
}

void mark_counted(const WheelRuns& measured, WheelRun& run) {
  if (measured.landings.empty()) return;
  constexpr int forgotten = 3;  // steps after which a foot that did not stand is forgotten
  int stood = forgotten;
  for (RunCollision& m : run.collisions) {
    const bool its_plus_tells = measured.stands_by_plus || springs(measured, m);
    const bool stands = (!springs(measured, m) && stands_at_any_restitution(measured, run, m)) ||
                        (its_plus_tells && stands_by_its_plus(measured, run, m));
    m.counted = stood >= forgotten && (stands || (its_plus_tells && m.after));
    m.stands = stands && m.counted;
    stood = stands ? stood + 1 : 0;
  }
}

}  // namespace metastable::analysis
