#include "analysis/paper/paper_claims.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "analysis/statistics/number_text.h"

namespace metastable::analysis {
namespace {

std::string p_words(double p) {
  const Decimal decimal = to_decimal(p, NumberFormat::p_value, 2);
  return (decimal.less_than ? "P " : "P = ") + plain_text(decimal);
}

// Fewer trials that get past the 12th collision say nothing of a steady state.
constexpr std::size_t least_trials = 20;
bool lasts(const StudiedProfile& profile) { return profile.trial_means.size() >= least_trials; }
bool all_last(const LaunchPanel& panel) {
  return std::ranges::all_of(panel.runs, [](const LaunchRun& run) { return lasts(run.measured_legs); });
}
bool all_last(const MeanPanel& panel) {
  return std::ranges::all_of(panel.runs, [](const MeanRun& run) { return lasts(run.profile); });
}

// Keeps the smallest P, and of how many: times that it is the level of the family (Bonferroni).
struct Family {
  double p = 1;
  int count = 0;
  void add(double one) { p = std::min(p, one), ++count; }
  double level() const { return p * count; }
};

Finding nothing_left() {
  return {ClaimVerdict::not_applicable, "hardly a trial gets past the 12th collision where it counts"};
}

// Returns the range of `of` over the restitution means of one panel.
double range(const MeanPanel& panel, double (StudiedProfile::*of)() const) {
  std::vector<double> values;
  for (const MeanRun& run : panel.runs) values.push_back((run.profile.*of)());
  return *std::ranges::max_element(values) - *std::ranges::min_element(values);
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
  for (const LaunchPanel& panel : s.fig6) {
    if (panel.friction >= 0.5) continue;
    for (const LaunchPair& pair : panel.pairs)
      if (lasts(panel.run(pair.first).measured_legs) && lasts(panel.run(pair.second).measured_legs))
        family.add(pair.alike.p);
  }
  if (family.count == 0) return nothing_left();
  const bool alike = family.level() > 0.05;
  return {family.p > 0.9 ? ClaimVerdict::reproduced
          : alike        ? ClaimVerdict::partly
                         : ClaimVerdict::not_reproduced,
          fmt::format("smallest of {} {}{}", family.count, p_words(family.p),
                      alike && family.p <= 0.9 ? ": not significant, but not > 0.9" : "")};
}

Finding high_friction(const VariantStudy& s) {
  const LaunchPanel& panel = s.fig6.back();
  if (!all_last(panel)) return nothing_left();
  const SteadyTest slow_fast = panel.pair(1, 3).alike, middle_fast = panel.pair(2, 3).alike;
  return {slow_fast.p < 0.001 && middle_fast.p < 0.001 ? ClaimVerdict::reproduced
          : slow_fast.p < 0.05 || middle_fast.p < 0.05 ? ClaimVerdict::partly
                                                       : ClaimVerdict::not_reproduced,
          fmt::format("μ = 0.55: k = 3 against 1 {}, against 2 {}; one value a trial {}, {}", p_words(slow_fast.p),
                      p_words(middle_fast.p), p_words(slow_fast.p_by_trial), p_words(middle_fast.p_by_trial))};
}

Finding variability_grows(const VariantStudy& s) {
  if (!std::ranges::all_of(s.fig6, [](const LaunchPanel& panel) { return all_last(panel); })) return nothing_left();
  const auto over_launches = [](const LaunchPanel& panel) {
    double mean = 0;
    for (const LaunchRun& run : panel.runs) mean += run.measured_legs.steady_sd() / 3;
    return mean;
  };
  const auto over_frictions = [&](int k) {
    double mean = 0;
    for (const LaunchPanel& panel : s.fig6) mean += panel.run(k).measured_legs.steady_sd() / 4;
    return mean;
  };
  const double low = over_launches(s.fig6.front()), high = over_launches(s.fig6.back());
  const double slow = over_frictions(1), fast = over_frictions(3);
  const bool friction = high > 1.05 * low, launch = fast > 1.05 * slow;
  return {friction && launch   ? ClaimVerdict::reproduced
          : friction || launch ? ClaimVerdict::partly
                               : ClaimVerdict::not_reproduced,
          fmt::format("sd {:.3f} to {:.3f} rad/s from μ = 0.40 to 0.55; {:.3f} to {:.3f} from k = 1 to 3", low, high,
                      slow, fast)};
}

Finding leg_lengths(const VariantStudy& s) {
  Family pooled, by_trial;
  double most = 0;
  for (const LaunchPanel& panel : s.fig6)
    for (const LaunchRun& run : panel.runs) {
      if (!lasts(run.measured_legs) || !lasts(run.equal_legs)) continue;
      pooled.add(run.legs_alike.p);
      by_trial.add(run.legs_alike.p_by_trial);
      most = std::max(most, std::abs(speed_summary(run.measured_legs.trial_means).mean -
                                     speed_summary(run.equal_legs.trial_means).mean));
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

// Compares the main effects of both sds on |t|, as ranges of its means.
Finding spread_of_friction(const VariantStudy& s) {
  std::array<double, 4> friction{};
  std::array<double, 3> restitution{};
  for (std::size_t j = 0; j < friction.size(); ++j)
    for (std::size_t k = 0; k < restitution.size(); ++k) {
      const SpreadRun& run = s.fig7[j].runs[k];
      if (!run.against_experiment || !lasts(run.profile)) return nothing_left();
      friction[j] += std::abs(run.against_experiment->t) / 3;
      restitution[k] += std::abs(run.against_experiment->t) / 4;
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
  const MeanSpread &a = s.fig8.front().losses.tangential_net, &b = s.fig8.back().losses.tangential_net;
  const bool rises = b.mean > a.mean && b.sd > a.sd;
  const auto near = [](double ours, double paper) { return ours > paper / 1.5 && ours < paper * 1.5; };
  const bool close = near(a.mean, 0.05) && near(a.sd, 0.03) && near(b.mean, 0.11) && near(b.sd, 0.19);
  return {rises && close ? ClaimVerdict::reproduced
          : rises        ? ClaimVerdict::partly
                         : ClaimVerdict::not_reproduced,
          fmt::format("N({:.3f}, {:.3f}²) to N({:.3f}, {:.3f}²) J", a.mean, a.sd, b.mean, b.sd)};
}

Finding normal_loss(const VariantStudy& s) {
  const MeanSpread &a = s.fig8.front().losses.normal, &b = s.fig8.back().losses.normal;
  bool steady = true;
  for (const LossRun& run : s.fig8) steady = steady && std::abs(run.losses.normal.mean / 0.17 - 1) < 0.25;
  const bool rises = b.sd > a.sd;
  return {rises && steady ? ClaimVerdict::reproduced
          : rises         ? ClaimVerdict::partly
                          : ClaimVerdict::not_reproduced,
          fmt::format("sd {:.3f} to {:.3f} J, mean {:.3f} to {:.3f} J", a.sd, b.sd, a.mean, b.mean)};
}

Finding transient_influence(const VariantStudy& s) {
  const double transient = range(s.fig9.front(), &StudiedProfile::transient_sd);
  const double steady = range(s.fig9.front(), &StudiedProfile::steady_sd);
  if (!all_last(s.fig9.front())) return nothing_left();
  return {transient > steady ? ClaimVerdict::reproduced : ClaimVerdict::not_reproduced,
          fmt::format("μ mean 0.2: sd differs by {:.3f} rad/s at collisions 2-6, by {:.3f} beyond the 12th", transient,
                      steady)};
}

std::pair<double, double> steady_ranges(const VariantStudy& s) {
  return {range(s.fig9.front(), &StudiedProfile::steady_sd), range(s.fig9.back(), &StudiedProfile::steady_sd)};
}

Finding influence_grows(const VariantStudy& s) {
  if (!all_last(s.fig9.front()) || !all_last(s.fig9.back())) return nothing_left();
  const auto [low, high] = steady_ranges(s);
  return {high > low ? ClaimVerdict::reproduced : ClaimVerdict::not_reproduced,
          fmt::format("steady sd differs by {:.3f} rad/s over η at μ mean 0.2, by {:.3f} at 0.5", low, high)};
}

Finding restitution_raises(const VariantStudy& s) {
  int rises = 0, rows = 0;
  double low = 0, high = 0;
  for (const MeanPanel& panel : s.fig9) {
    const StudiedProfile &least = panel.low_restitution(), &most = panel.high_restitution();
    if (!lasts(least) || !lasts(most)) continue;
    ++rows;
    rises += most.steady_sd() > least.steady_sd();
    low += least.steady_sd(), high += most.steady_sd();
  }
  if (rows == 0) return nothing_left();
  return {rises == rows ? ClaimVerdict::reproduced
          : rises > 0   ? ClaimVerdict::partly
                        : ClaimVerdict::not_reproduced,
          fmt::format("steady sd {:.3f} to {:.3f} rad/s from η mean 0.3 to 0.7; up at {} of {} μ", low / rows,
                      high / rows, rises, rows)};
}

Finding influence_shrinks(const VariantStudy& s) {
  if (!all_last(s.fig9.front()) || !all_last(s.fig9.back())) return nothing_left();
  const auto [low, high] = steady_ranges(s);
  return {high < low ? ClaimVerdict::reproduced : ClaimVerdict::not_reproduced,
          fmt::format("steady sd differs by {:.3f} rad/s over η at μ mean 0.2, by {:.3f} at 0.5", low, high)};
}

Finding failures(const VariantStudy& s) {
  if (s.variant.reading == RestReading::goes_on) return {ClaimVerdict::not_applicable, "no trial can rest"};
  const double share = s.usual_spreads().profile.rest_share;
  return {share > 0.02 && share < 0.9 ? ClaimVerdict::reproduced : ClaimVerdict::not_reproduced,
          fmt::format("{:.1f} % of the trials rest within 16 collisions at 7.02 deg (sds of 0.1; of 0.05: {:.1f} %)",
                      100 * share, 100 * s.fig7.front().runs.front().profile.rest_share)};
}

// Holds the largest total index of a source over the frictions, and where it is.
struct Influence {
  Estimate steady, steps;
  bool steps_vary = false;
  double friction = 0;
};
Influence largest(const VariantStudy& s, const std::vector<VarianceSource>& sources) {
  Influence share;
  for (const VarianceRun& run : s.variance) {
    const auto largest_total = [&](const SobolResult& result) {
      Estimate total;
      for (const VarianceSource source : sources)
        if (!result.group.empty() && index_of(result, source).total.value > total.value)
          total = index_of(result, source).total;
      return total;
    };
    const Estimate steady = largest_total(run.shares.steady_speed), steps = largest_total(run.shares.steps);
    if (steady.value > share.steady.value) share.steady = steady, share.friction = run.friction;
    if (steps.value > share.steps.value) share.steps = steps;
    share.steps_vary = share.steps_vary || !run.shares.steps.group.empty();
  }
  return share;
}

std::string share_words(const Influence& share) {
  const auto words = [](const Estimate& e) {
    return fmt::format("{:.3f} ({:.3f} to {:.3f})", e.value, e.lower, e.upper);
  };
  return fmt::format("largest total index (95 %): steady speed {}{}, steps {}", words(share.steady),
                     share.steady.value > 0.01 ? fmt::format(" (μ mean {})", share.friction) : "",
                     share.steps_vary ? words(share.steps) : "do not vary");
}

// Judges the trials at 7.02 deg; there is no verdict where outcomes were not noted.
Finding failures_seen(const PaperExperiments& experiments) {
  if (!experiments.rest_share_702) return {};
  const double share = *experiments.rest_share_702;
  return {share > 0.02 && share < 0.9 ? ClaimVerdict::reproduced : ClaimVerdict::not_reproduced,
          fmt::format("{:.1f} % of the trials rest", 100 * share)};
}

// Pairs a claim of the paper with the way trials are held against it.
struct Check {
  const char *where, *brief, *claim, *paper, *reading;
  Finding (*simulated)(const VariantStudy&);
  Finding (*measured)(const PaperExperiments&) = nullptr;
};

const Check checks[] = {
    {"Fig. 4", "starts meet at 9.59°", "fast and slow start at 9.59 deg meet beyond the 12th collision", "P > 0.07",
     "Welch's test of trial means from collision 13 on, P > 0.05; no collision from the 13th on told apart",
     [](const VariantStudy& s) { return convergence(s.fig4.comparison); },
     [](const PaperExperiments& e) { return convergence(compare_conditions(e.fast_959, e.slow_959)); }},
    {"Fig. 4", "error bars shrink", "error bars shrink along the profiles, yet do not vanish", "figure only",
     "mean standard error at collisions 13 to 16 below that at the first, for both starts",
     [](const VariantStudy& s) { return error_bars(s.fig4.fast.profile, s.fig4.slow.profile); },
     [](const PaperExperiments& e) { return error_bars(speed_profile(e.fast_959), speed_profile(e.slow_959)); }},
    {"Fig. 6", "μ < 0.5 forgets the launch", "μ < 0.5: launch speed leaves no trace in the steady state",
     "P > 0.9, all pairs",
     "pooled t-test of all collisions from the 13th on at μ = 0.40 and 0.45; “partly”: none significant at 0.05 over "
     "the family. P > 0.9 for each of several pairs is itself improbable where nothing differs (P is then uniform)",
     low_friction},
    {"Fig. 6", "μ > 0.5 remembers it (k = 3)", "μ > 0.5: the fastest launch (k = 3) ends in another steady state",
     "P < 0.001 against both", "pooled t-test of all collisions from the 13th on at μ = 0.55", high_friction},
    {"Fig. 6", "spread grows with μ", "steady variability grows with μ and with launch speed", "figure only",
     "mean sd at collisions 13 to 16, by more than 5 %; the text's “variability of μ” is read as its value, μ being "
     "constant here",
     variability_grows},
    {"Sec. IV-A", "uneven legs do not matter", "uneven legs do not matter (H2)", "P > 0.1, all launches and μ",
     "the measured legs against eight of mean length, pooled t-test of all collisions, P > 0.1 for all 12; “partly”: "
     "one value a trial, none significant at 0.05 over the family. Collisions 13 to 16 land on legs 4 to 7 only, whose "
     "mean is not that of all",
     leg_lengths},
    {"Fig. 7", "spread of μ decides, not of η",
     "agreement with the experiment depends on the spread of μ, not on that of η", "figure only",
     "range of |t| (simulated against measured steady speeds at 7.02 deg) over the sds of μ more than twice that over "
     "those of η",
     spread_of_friction},
    {"Fig. 8", "spread of μ raises the loss", "more spread of μ raises mean and variance of the tangential net loss",
     "N(0.05, 0.03²) to N(0.11, 0.19²) J", "both rise, all four within a factor of 1.5; “partly”: both rise",
     tangential_loss},
    {"Fig. 8", "spread of η widens the loss", "more spread of η widens the normal loss, whose mean stays",
     "sd 0.06 to 0.1 J, mean about 0.17 J", "sd rises, means within 25 % of 0.17 J; “partly”: sd rises", normal_loss},
    {"Fig. 9", "low μ: η acts on transients",
     "low μ (< 0.3): mean η acts on the transient variability, less on the steady one", "figure only",
     "range over mean η of the sd at collisions 2 to 6 exceeds that at 13 to 16, at μ mean 0.2", transient_influence},
    {"Fig. 9", "mean η acts more with μ", "the influence of mean η on the steady variability grows with μ",
     "figure only",
     "range over mean η of the sd at collisions 13 to 16, μ mean 0.5 against 0.2; the text says the opposite three "
     "sentences later (next but one row)",
     influence_grows},
    {"Fig. 9", "mean η raises the spread", "mean η raises the steady variability in general", "figure only",
     "sd at collisions 13 to 16 at η mean 0.7 above that at 0.3, for all μ", restitution_raises},
    {"Fig. 9", "mean η acts less with μ", "this effect shrinks with μ", "figure only",
     "as two rows above, the other way round", influence_shrinks},
    {"Sec. III", "some fail at 7.02°", "intermittent failures on the 7.02 deg ramp", "observed, not counted",
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
    Claim& claim = claims.emplace_back(Claim{
        check.where, check.claim, check.paper, check.reading, {}, {}, fmt::format("{}: {}", check.where, check.brief)});
    for (const VariantStudy& study : studies) claim.findings.push_back(check.simulated(study));
    if (check.measured != nullptr) claim.experiment = check.measured(experiments);
  }
  return claims;
}

std::vector<Hypothesis> paper_hypotheses(const std::vector<VariantStudy>& studies) {
  constexpr double matters = 0.1;
  const auto judge = [](const Influence& share) {
    const bool steady = share.steady.value > matters, steps = share.steps_vary && share.steps.value > matters;
    return Finding{steady  ? ClaimVerdict::reproduced
                   : steps ? ClaimVerdict::partly
                           : ClaimVerdict::not_reproduced,
                   share_words(share)};
  };
  const struct {
    const char *name, *text;
    std::vector<VarianceSource> sources;
  } stated[] = {{"H1", "variability depends on the launch speed's distribution", {VarianceSource::launch_speed}},
                {"H2", "variability depends on the uneven leg lengths", {VarianceSource::leg_lengths}},
                {"H3",
                 "variability depends on the distributions of restitution and friction",
                 {VarianceSource::restitution, VarianceSource::friction}}};
  std::vector<Hypothesis> all;
  for (const auto& [name, text, sources] : stated) {
    Hypothesis& hypothesis = all.emplace_back(Hypothesis{name, text, {}});
    for (const VariantStudy& s : studies) {
      const Influence share = largest(s, sources);
      hypothesis.findings.push_back(judge(share));
      hypothesis.shares.push_back(share.steady.value);
    }
  }
  return all;
}

}  // namespace metastable::analysis
