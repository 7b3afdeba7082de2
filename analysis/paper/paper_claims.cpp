#include "analysis/paper/paper_claims.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace metastable::analysis {
namespace {

std::string p_words(double p) { return p < 1e-6 ? "P < 1e-6" : fmt::format("P = {:.2g}", p); }

// Fewer trials that get past the 12th collision say nothing of a steady state.
constexpr std::size_t least_trials = 20;
bool lasts(const StudiedProfile& profile) { return profile.trial_means.size() >= least_trials; }
bool all_last(const std::array<StudiedProfile, 3>& row) { return std::all_of(row.begin(), row.end(), lasts); }

constexpr std::array<std::array<std::size_t, 2>, 3> launch_pairs{{{0, 1}, {0, 2}, {1, 2}}};  // of fig6_p

// The smallest P, and of how many: times that it is the level of the family (Bonferroni).
struct Family {
  double p = 1;
  int count = 0;
  void add(double one) { p = std::min(p, one), ++count; }
  double level() const { return p * count; }
};

Finding nothing_left() {
  return {ClaimVerdict::not_applicable, "hardly a trial gets past the 12th collision where it counts"};
}

// Range of `of` over the restitution means at one friction of Fig. 9.
double range(const std::array<StudiedProfile, 3>& row, double (StudiedProfile::*of)() const) {
  const double a = (row[0].*of)(), b = (row[1].*of)(), c = (row[2].*of)();
  return std::max({a, b, c}) - std::min({a, b, c});
}

Finding convergence(const ConditionComparison& c) {
  if (!c.trial_means) return nothing_left();
  const double p = c.trial_means->welch.p;
  const bool met = c.meet && *c.meet <= steady_collision;
  return {p > 0.05 && met ? ClaimVerdict::reproduced
          : p > 0.05      ? ClaimVerdict::partly
                          : ClaimVerdict::not_reproduced,
          fmt::format("{} beyond the 12th; not told apart from collision {}", p_words(p),
                      c.meet ? fmt::format("{}", *c.meet) : "(never)")};
}

Finding error_bars(const std::vector<SpeedSummary>& fast, const std::vector<SpeedSummary>& slow) {
  const auto ratio = [](const std::vector<SpeedSummary>& profile) {
    double late = 0;
    int count = 0;
    for (std::size_t n = steady_collision; n <= std::min<std::size_t>(16, profile.size()); ++n)
      late += profile[n - 1].standard_error, ++count;
    return count > 0 ? late / count / profile[0].standard_error : 0;
  };
  const double a = ratio(fast), b = ratio(slow);
  if (a == 0 || b == 0) return nothing_left();
  return {a < 1 && b < 1   ? ClaimVerdict::reproduced
          : a < 1 || b < 1 ? ClaimVerdict::partly
                           : ClaimVerdict::not_reproduced,
          fmt::format("late over first standard error: fast {:.2f}, slow {:.2f}", a, b)};
}

Finding low_friction(const VariantStudy& s) {
  Family family;
  for (std::size_t j = 0; j < 2; ++j)
    for (std::size_t i = 0; i < 3; ++i)
      if (lasts(s.fig6[j][launch_pairs[i][0]]) && lasts(s.fig6[j][launch_pairs[i][1]])) family.add(s.fig6_p[j][i]);
  if (family.count == 0) return nothing_left();
  const bool alike = family.level() > 0.05;
  return {family.p > 0.9 ? ClaimVerdict::reproduced
          : alike        ? ClaimVerdict::partly
                         : ClaimVerdict::not_reproduced,
          fmt::format("smallest of {} {}{}", family.count, p_words(family.p),
                      alike && family.p <= 0.9 ? ": not significant, but not > 0.9" : "")};
}

Finding high_friction(const VariantStudy& s) {
  if (!all_last(s.fig6[3])) return nothing_left();
  const double low_fast = s.fig6_p[3][1], middle_fast = s.fig6_p[3][2];
  return {low_fast < 0.001 && middle_fast < 0.001 ? ClaimVerdict::reproduced
          : low_fast < 0.05 || middle_fast < 0.05 ? ClaimVerdict::partly
                                                  : ClaimVerdict::not_reproduced,
          fmt::format("μ = 0.55: k = 3 against 1 {}, against 2 {}; one value a trial {}, {}", p_words(low_fast),
                      p_words(middle_fast), p_words(s.fig6_p_trials[3][1]), p_words(s.fig6_p_trials[3][2]))};
}

Finding variability_grows(const VariantStudy& s) {
  if (!std::all_of(s.fig6.begin(), s.fig6.end(), all_last)) return nothing_left();
  double slow = 0, fast = 0;
  for (std::size_t k = 0; k < 3; ++k) slow += s.fig6[0][k].steady_sd() / 3, fast += s.fig6[3][k].steady_sd() / 3;
  double k1 = 0, k3 = 0;
  for (std::size_t j = 0; j < 4; ++j) k1 += s.fig6[j][0].steady_sd() / 4, k3 += s.fig6[j][2].steady_sd() / 4;
  const bool friction = fast > 1.05 * slow, launch = k3 > 1.05 * k1;
  return {friction && launch   ? ClaimVerdict::reproduced
          : friction || launch ? ClaimVerdict::partly
                               : ClaimVerdict::not_reproduced,
          fmt::format("sd {:.3f} to {:.3f} rad/s from μ = 0.40 to 0.55; {:.3f} to {:.3f} from k = 1 to 3", slow, fast,
                      k1, k3)};
}

Finding leg_lengths(const VariantStudy& s) {
  Family pooled, by_trial;
  double most = 0;
  for (std::size_t j = 0; j < 4; ++j)
    for (std::size_t k = 0; k < 3; ++k) {
      const StudiedProfile &measured = s.fig6[j][k], &equal = s.equal_legs[j][k];
      if (!lasts(measured) || !lasts(equal)) continue;
      pooled.add(s.legs_p[j][k]);
      by_trial.add(s.legs_p_trials[j][k]);
      most = std::max(most, std::abs(summarize(measured.trial_means).mean - summarize(equal.trial_means).mean));
    }
  if (pooled.count == 0) return nothing_left();
  const bool chance = by_trial.level() > 0.05;
  return {pooled.p > 0.1 ? ClaimVerdict::reproduced
          : chance       ? ClaimVerdict::partly
                         : ClaimVerdict::not_reproduced,
          fmt::format("smallest of {} {}, one value a trial {}{}; means differ by at most {:.3f} rad/s", pooled.count,
                      p_words(pooled.p), p_words(by_trial.p),
                      pooled.p <= 0.1 && chance ? " (no more than chance among so many)" : "", most)};
}

// Main effects of rows and columns on |t|, as ranges of their means.
Finding spread_of_friction(const VariantStudy& s) {
  std::array<double, 4> friction{};
  std::array<double, 3> restitution{};
  for (std::size_t j = 0; j < 4; ++j)
    for (std::size_t k = 0; k < 3; ++k) {
      if (!s.fig7_test[j][k] || !lasts(s.fig7[j][k])) return nothing_left();
      friction[j] += std::abs(s.fig7_test[j][k]->t) / 3;
      restitution[k] += std::abs(s.fig7_test[j][k]->t) / 4;
    }
  const auto spread = [](const auto& values) {
    return *std::max_element(values.begin(), values.end()) - *std::min_element(values.begin(), values.end());
  };
  const double of_friction = spread(friction), of_restitution = spread(restitution);
  return {of_friction > 2 * of_restitution ? ClaimVerdict::reproduced
          : of_friction > of_restitution   ? ClaimVerdict::partly
                                           : ClaimVerdict::not_reproduced,
          fmt::format("|t| against the experiment changes by {:.1f} over the sds of μ, by {:.1f} over those of η",
                      of_friction, of_restitution)};
}

Finding tangential_loss(const VariantStudy& s) {
  const MeanSpread &a = s.fig8[0].tangential_net, &b = s.fig8[3].tangential_net;
  const bool rises = b.mean > a.mean && b.sd > a.sd;
  const auto near = [](double ours, double paper) { return ours > paper / 1.5 && ours < paper * 1.5; };
  const bool close = near(a.mean, 0.05) && near(a.sd, 0.03) && near(b.mean, 0.11) && near(b.sd, 0.19);
  return {rises && close ? ClaimVerdict::reproduced
          : rises        ? ClaimVerdict::partly
                         : ClaimVerdict::not_reproduced,
          fmt::format("N({:.3f}, {:.3f}²) to N({:.3f}, {:.3f}²) J", a.mean, a.sd, b.mean, b.sd)};
}

Finding normal_loss(const VariantStudy& s) {
  const MeanSpread &a = s.fig8[0].normal, &b = s.fig8[3].normal;
  bool steady = true;
  for (const EnergyLosses& losses : s.fig8) steady = steady && std::abs(losses.normal.mean / 0.17 - 1) < 0.25;
  const bool rises = b.sd > a.sd;
  return {rises && steady ? ClaimVerdict::reproduced
          : rises         ? ClaimVerdict::partly
                          : ClaimVerdict::not_reproduced,
          fmt::format("sd {:.3f} to {:.3f} J, mean {:.3f} to {:.3f} J", a.sd, b.sd, a.mean, b.mean)};
}

Finding transient_influence(const VariantStudy& s) {
  const double transient = range(s.fig9[0], &StudiedProfile::transient_sd);
  const double steady = range(s.fig9[0], &StudiedProfile::steady_sd);
  if (!all_last(s.fig9[0])) return nothing_left();
  return {transient > steady ? ClaimVerdict::reproduced : ClaimVerdict::not_reproduced,
          fmt::format("μ mean 0.2: sd differs by {:.3f} rad/s at collisions 2-6, by {:.3f} beyond the 12th", transient,
                      steady)};
}

std::pair<double, double> steady_ranges(const VariantStudy& s) {
  return {range(s.fig9[0], &StudiedProfile::steady_sd), range(s.fig9[3], &StudiedProfile::steady_sd)};
}

Finding influence_grows(const VariantStudy& s) {
  if (!all_last(s.fig9[0]) || !all_last(s.fig9[3])) return nothing_left();
  const auto [low, high] = steady_ranges(s);
  return {high > low ? ClaimVerdict::reproduced : ClaimVerdict::not_reproduced,
          fmt::format("steady sd differs by {:.3f} rad/s over η at μ mean 0.2, by {:.3f} at 0.5", low, high)};
}

Finding restitution_raises(const VariantStudy& s) {
  int rises = 0, rows = 0;
  double low = 0, high = 0;
  for (const auto& row : s.fig9) {
    if (!lasts(row[0]) || !lasts(row[2])) continue;
    ++rows;
    rises += row[2].steady_sd() > row[0].steady_sd();
    low += row[0].steady_sd(), high += row[2].steady_sd();
  }
  if (rows == 0) return nothing_left();
  return {rises == rows ? ClaimVerdict::reproduced
          : rises > 0   ? ClaimVerdict::partly
                        : ClaimVerdict::not_reproduced,
          fmt::format("steady sd {:.3f} to {:.3f} rad/s from η mean 0.3 to 0.7; up at {} of {} μ", low / rows,
                      high / rows, rises, rows)};
}

Finding influence_shrinks(const VariantStudy& s) {
  if (!all_last(s.fig9[0]) || !all_last(s.fig9[3])) return nothing_left();
  const auto [low, high] = steady_ranges(s);
  return {high < low ? ClaimVerdict::reproduced : ClaimVerdict::not_reproduced,
          fmt::format("steady sd differs by {:.3f} rad/s over η at μ mean 0.2, by {:.3f} at 0.5", low, high)};
}

Finding failures(const VariantStudy& s) {
  if (s.variant.reading == RestReading::goes_on) return {ClaimVerdict::not_applicable, "no trial can rest"};
  const double share = s.fig7[1][1].rest_share;  // both sds 0.1
  return {share > 0.02 && share < 0.9 ? ClaimVerdict::reproduced : ClaimVerdict::not_reproduced,
          fmt::format("{:.1f} % of the trials rest within 16 collisions at 7.02 deg (sds of 0.1)", 100 * share)};
}

// The largest total index of a source over the frictions, and where.
struct Influence {
  double steady = 0, steps = 0;
  bool steps_vary = false;
  double friction = 0;
};
Influence largest(const VariantStudy& s, std::initializer_list<std::size_t> sources) {
  Influence share;
  for (std::size_t f = 0; f < s.variance.size(); ++f) {
    const auto sum = [&](const SobolResult& result) {
      double total = 0;
      for (const std::size_t source : sources)
        if (!result.group.empty()) total = std::max(total, result.group[source].total.value);
      return total;
    };
    const double steady = sum(s.variance[f].steady_speed);
    if (steady > share.steady) share.steady = steady, share.friction = variance_friction[f];
    share.steps = std::max(share.steps, sum(s.variance[f].steps));
    share.steps_vary = share.steps_vary || !s.variance[f].steps.group.empty();
  }
  return share;
}

std::string share_words(const Influence& share) {
  return fmt::format("largest total index: steady speed {:.3f}{}, steps {}", share.steady,
                     share.steady > 0.01 ? fmt::format(" (μ mean {})", share.friction) : "",
                     share.steps_vary ? fmt::format("{:.3f}", share.steps) : "do not vary");
}

// At 7.02 deg; without a verdict where outcomes were not noted.
Finding failures_seen(const PaperExperiments& experiments) {
  if (!experiments.rest_share_702) return {};
  const double share = *experiments.rest_share_702;
  return {share > 0.02 && share < 0.9 ? ClaimVerdict::reproduced : ClaimVerdict::not_reproduced,
          fmt::format("{:.1f} % of the trials rest", 100 * share)};
}

// One claim of the paper, and how trials are held against it.
struct Check {
  const char *where, *claim, *paper, *reading;
  Finding (*simulated)(const VariantStudy&);
  Finding (*measured)(const PaperExperiments&) = nullptr;
};

const Check checks[] = {
    {"Fig. 4", "fast and slow start at 9.59 deg meet beyond the 12th collision", "P > 0.07",
     "Welch's test of trial means from collision 13 on, P > 0.05; no collision from the 13th on told apart",
     [](const VariantStudy& s) { return convergence(s.fig4_comparison); },
     [](const PaperExperiments& e) { return convergence(compare_conditions(e.fast_959, e.slow_959)); }},
    {"Fig. 4", "error bars shrink along the profiles, yet do not vanish", "figure only",
     "mean standard error at collisions 13 to 16 below that at the first, for both starts",
     [](const VariantStudy& s) { return error_bars(s.fig4[0].profile, s.fig4[1].profile); },
     [](const PaperExperiments& e) { return error_bars(speed_profile(e.fast_959), speed_profile(e.slow_959)); }},
    {"Fig. 6", "μ < 0.5: launch speed leaves no trace in the steady state", "P > 0.9, all pairs",
     "pooled t-test of all collisions from the 13th on at μ = 0.40 and 0.45; “partly”: none significant at 0.05 over "
     "the family. P > 0.9 for each of several pairs is itself improbable where nothing differs (P is then uniform)",
     low_friction},
    {"Fig. 6", "μ > 0.5: the fastest launch (k = 3) ends in another steady state", "P < 0.001 against both",
     "pooled t-test of all collisions from the 13th on at μ = 0.55", high_friction},
    {"Fig. 6", "steady variability grows with μ and with launch speed", "figure only",
     "mean sd at collisions 13 to 16, by more than 5 %; the text's “variability of μ” is read as its value, μ being "
     "constant here",
     variability_grows},
    {"Sec. IV-A", "uneven legs do not matter (H2)", "P > 0.1, all launches and μ",
     "the measured legs against eight of mean length, pooled t-test of all collisions, P > 0.1 for all 12; “partly”: "
     "one value a trial, none significant at 0.05 over the family. Collisions 13 to 16 land on legs 4 to 7 only, whose "
     "mean is not that of all",
     leg_lengths},
    {"Fig. 7", "agreement with the experiment depends on the spread of μ, not on that of η", "figure only",
     "range of |t| (simulated against measured steady speeds at 7.02 deg) over the sds of μ more than twice that over "
     "those of η",
     spread_of_friction},
    {"Fig. 8", "more spread of μ raises mean and variance of the tangential net loss",
     "N(0.05, 0.03²) to N(0.11, 0.19²) J", "both rise, all four within a factor of 1.5; “partly”: both rise",
     tangential_loss},
    {"Fig. 8", "more spread of η widens the normal loss, whose mean stays", "sd 0.06 to 0.1 J, mean about 0.17 J",
     "sd rises, means within 25 % of 0.17 J; “partly”: sd rises", normal_loss},
    {"Fig. 9", "low μ (< 0.3): mean η acts on the transient variability, less on the steady one", "figure only",
     "range over mean η of the sd at collisions 2 to 6 exceeds that at 13 to 16, at μ mean 0.2", transient_influence},
    {"Fig. 9", "the influence of mean η on the steady variability grows with μ", "figure only",
     "range over mean η of the sd at collisions 13 to 16, μ mean 0.5 against 0.2; the text says the opposite three "
     "sentences later (next but one row)",
     influence_grows},
    {"Fig. 9", "mean η raises the steady variability in general", "figure only",
     "sd at collisions 13 to 16 at η mean 0.7 above that at 0.3, for all μ", restitution_raises},
    {"Fig. 9", "this effect shrinks with μ", "figure only", "as two rows above, the other way round",
     influence_shrinks},
    {"Sec. III", "intermittent failures on the 7.02 deg ramp", "observed, not counted",
     "between 2 and 90 % of the trials rest within 16 collisions, at η, μ ~ N(0.4, 0.1²)", failures, failures_seen},
};

}  // namespace

std::string verdict_text(ClaimVerdict verdict) {
  switch (verdict) {
    case ClaimVerdict::reproduced:
      return "reproduced";
    case ClaimVerdict::partly:
      return "partly";
    case ClaimVerdict::not_reproduced:
      return "not reproduced";
    case ClaimVerdict::not_applicable:
      return "says nothing";
  }
  return "";
}

std::vector<Claim> paper_claims(const std::vector<VariantStudy>& studies, const PaperExperiments& experiments) {
  std::vector<Claim> claims;
  for (const Check& check : checks) {
    Claim& claim = claims.emplace_back(Claim{check.where, check.claim, check.paper, check.reading, {}, {}});
    for (const VariantStudy& study : studies) claim.findings.push_back(check.simulated(study));
    if (check.measured != nullptr) claim.experiment = check.measured(experiments);
  }
  return claims;
}

std::vector<Hypothesis> paper_hypotheses(const std::vector<VariantStudy>& studies) {
  constexpr double matters = 0.1;
  std::vector<Hypothesis> all{{"H1", "variability depends on the launch speed's distribution", {}},
                              {"H2", "variability depends on the uneven leg lengths", {}},
                              {"H3", "variability depends on the distributions of restitution and friction", {}}};
  for (const VariantStudy& s : studies) {
    const auto judge = [&](const Influence& share) {
      const bool steady = share.steady > matters, steps = share.steps_vary && share.steps > matters;
      return Finding{steady  ? ClaimVerdict::reproduced
                     : steps ? ClaimVerdict::partly
                             : ClaimVerdict::not_reproduced,
                     share_words(share)};
    };
    all[0].findings.push_back(judge(largest(s, {0})));
    all[1].findings.push_back(judge(largest(s, {1})));
    all[2].findings.push_back(judge(largest(s, {2, 3})));
  }
  return all;
}

}  // namespace metastable::analysis
