#include "reports/description/paper_tables.h"

#include <fmt/format.h>

#include <algorithm>

#include "reports/description/speed_cells.h"
#include "reports/output/known_cell.h"

namespace metastable::reports {
namespace {

using analysis::StudiedProfile;
using analysis::VariantStudy;

// Shows the mean steady speed over trials, with its interval.
Cell steady_cell(const std::vector<double>& trial_means) {
  if (trial_means.size() < 2) return "";
  return mean_interval(analysis::speed_summary(trial_means));
}

// Says whether its steady speeds can be tested.
bool reaches_steady(const StudiedProfile& profile) { return profile.steady.size() >= 2; }

std::string experiment_name(const analysis::PaperExperiments& experiments) {
  return experiments.stand_in ? "stand-in (simulated)" : "experiment";
}

std::string experiment_note(const analysis::PaperExperiments& experiments) {
  return experiments.stand_in
             ? "The paper's measurements are not public. Where they are needed, a simulated stand-in takes their "
               "place: 51 "
               "fast and 48 slow trials at 9.59 deg, 50 at 7.02 deg, published law with η ~ N(0.54, 0.045²) and μ ~ "
               "N(0.352, 0.043²). It is no evidence about the real wheel; --data takes a measured one."
             : fmt::format("Experiment: {}.", experiments.title);
}

const char* const variants_note =
    "Published, goes on: the paper gives no rest rule; the wheel goes on whatever happens and x′ < 0 is set to 0 (the "
    "reading under which Fig. 8 comes out). Published, rests: a wheel that fails to vault is at rest; later collisions "
    "are "
    "of the survivors. Coulomb: stick and slip with r_g = 0.05 m (an assumption); at these slopes nothing rests under "
    "it. Settled: the landing of that rigid wheel followed through hops and slides, rolled event by event; a foot that "
    "slides too far stops it.";

std::string finding_text(const analysis::Finding& finding) {
  if (finding.ours.empty()) return "";
  return analysis::verdict_text(finding.verdict) + ": " + finding.ours;
}

// Returns the verdict on a claim under one variant. @throws std::out_of_range if it was not studied
analysis::ClaimVerdict verdict_of(const analysis::Claim& claim, const Studies& studies, dynamics::Law law,
                                  analysis::RestReading reading) {
  std::size_t at = 0;
  while (at < studies.size() && (studies[at].variant.law != law || studies[at].variant.reading != reading)) ++at;
  return claim.findings.at(at).verdict;
}

// Says what the verdict on a claim changes with: "reading", "law", "reading and law"; "" if it is one throughout.
std::string changes_with(const analysis::Claim& claim, const Studies& studies) {
  using enum analysis::RestReading;
  const analysis::ClaimVerdict published_goes_on = verdict_of(claim, studies, dynamics::Law::published, goes_on),
                               published_rests = verdict_of(claim, studies, dynamics::Law::published, rests),
                               coulomb = verdict_of(claim, studies, dynamics::Law::coulomb, rests),
                               settled = verdict_of(claim, studies, dynamics::Law::settled, rests);
  const auto of_its_own = [&](analysis::ClaimVerdict v) { return v != published_goes_on && v != published_rests; };
  const bool law = of_its_own(coulomb) || of_its_own(settled);
  if (published_goes_on == published_rests) return law ? "law" : "";
  return law ? "reading and law" : "reading";
}

std::size_t count(const std::vector<analysis::Claim>& claims, std::size_t variant, analysis::ClaimVerdict verdict) {
  return static_cast<std::size_t>(std::ranges::count_if(
      claims, [&](const analysis::Claim& claim) { return claim.findings.at(variant).verdict == verdict; }));
}

}  // namespace

std::vector<std::string> claims_sentences(const std::vector<analysis::Claim>& claims, const Studies& studies) {
  std::vector<std::string> parts;
  for (std::size_t v = 0; v < studies.size(); ++v)
    parts.push_back(fmt::format("{}{} under “{}”", count(claims, v, analysis::ClaimVerdict::reproduced),
                                v == 0 ? " come out" : "", studies[v].variant.name));
  return {fmt::format("Of the paper’s {} claims {}.", claims.size(), fmt::join(parts, ", "))};
}

Table claims_count_table(const std::vector<analysis::Claim>& claims, const Studies& studies,
                         const Provenance& provenance) {
  using enum analysis::ClaimVerdict;
  Table table{.id = "claim-counts",
              .title = "Claims by verdict, under each law and reading",
              .columns = {{"law and reading"}},
              .provenance = provenance};
  for (const analysis::ClaimVerdict verdict : {reproduced, partly, not_reproduced, not_applicable})
    table.columns.push_back({analysis::verdict_text(verdict)});
  for (std::size_t v = 0; v < studies.size(); ++v) {
    std::vector<Cell> row{studies[v].variant.name};
    for (const analysis::ClaimVerdict verdict : {reproduced, partly, not_reproduced, not_applicable})
      row.emplace_back(count(claims, v, verdict));
    table.rows.push_back(std::move(row));
  }
  table.notes = {variants_note};
  return table;
}

Table claims_table(const std::vector<analysis::Claim>& claims, const Studies& studies,
                   const analysis::PaperExperiments& experiments, const Provenance& provenance) {
  Table table{.id = "claims",
              .title = "The paper's claims",
              .columns = {{"where"}, {"claim"}, {"paper"}},
              .provenance = provenance};
  for (const VariantStudy& s : studies) table.columns.push_back({s.variant.name});
  table.columns.push_back({experiment_name(experiments)});
  for (const analysis::Claim& claim : claims) {
    std::vector<Cell> row{claim.where, claim.claim, claim.paper};
    for (const analysis::Finding& finding : claim.findings) row.emplace_back(finding_text(finding));
    row.emplace_back(finding_text(claim.experiment));
    table.rows.push_back(std::move(row));
  }
  table.notes = {variants_note, experiment_note(experiments)};
  return table;
}

Table changes_table(const std::vector<analysis::Claim>& claims, const Studies& studies,
                    const analysis::PaperExperiments& experiments, const Provenance& provenance) {
  Table table{
      .id = "changes", .title = "What the law and the reading change", .columns = {{"what"}}, .provenance = provenance};
  for (const VariantStudy& s : studies) table.columns.push_back({s.variant.name});
  table.columns.push_back({"changes with"});
  const auto add = [&](const std::string& what, const auto& of) {
    std::vector<Cell> row{what};
    for (const VariantStudy& s : studies) row.emplace_back(of(s));
    row.emplace_back("");
    table.rows.push_back(std::move(row));
  };
  // Figures come first, at 7.02 deg with sds of 0.1.
  add("steady speed [rad/s]", [&](const VariantStudy& s) {
    const std::vector<double>& means = s.usual_spreads().profile.trial_means;
    if (means.size() < 2) return std::string("none gets there");
    return format_estimate(mean_interval(analysis::speed_summary(means)));
  });
  add("trials that rest within 16 collisions", [](const VariantStudy& s) {
    return s.variant.reading == analysis::RestReading::goes_on
               ? std::string("cannot")
               : fmt::format("{:.3f}", s.usual_spreads().profile.rest_share);
  });
  add("largest source of the steady speed's variance (total index)", [](const VariantStudy& s) {
    const std::vector<analysis::SobolIndex>& group = s.usual_variance().shares.steady_speed.group;
    std::size_t most = 0;
    for (std::size_t g = 1; g < group.size(); ++g)
      if (group[g].total.value > group[most].total.value) most = g;
    return group.empty() ? std::string()
                         : fmt::format("{} ({:.2f})", analysis::variance_sources[most], group[most].total.value);
  });
  add("friction's net loss, normal loss [J]", [](const VariantStudy& s) {
    return fmt::format("{:.3f}, {:.3f}", s.usual_losses().losses.tangential_net.mean,
                       s.usual_losses().losses.normal.mean);
  });
  std::size_t kept = 0;
  for (const analysis::Claim& claim : claims) {
    const std::string changed_by = changes_with(claim, studies);
    if (changed_by.empty()) {
      ++kept;
      continue;
    }
    std::vector<Cell> row{claim.where + ": " + claim.claim};
    for (const analysis::Finding& finding : claim.findings) row.emplace_back(analysis::verdict_text(finding.verdict));
    row.emplace_back(changed_by);
    table.rows.push_back(std::move(row));
  }
  table.notes = {
      fmt::format("Numbers: 7.02 deg, launch N(7.35, 0.19²) rad/s, η, μ ~ N(0.4, 0.1²). Then the claims whose verdict "
                  "differs; the other {} of {} have one verdict throughout. The law changes a verdict where coulomb "
                  "or settled agrees with neither reading of published, the reading where these two differ.",
                  kept, claims.size()),
      variants_note, experiment_note(experiments)};
  return table;
}

Table readings_table(const std::vector<analysis::Claim>& claims, const Provenance& provenance) {
  Table table{.id = "readings",
              .title = "What counts as reproduced",
              .columns = {{"where"}, {"claim"}, {"reading"}},
              .provenance = provenance};
  for (const analysis::Claim& claim : claims) table.rows.push_back({claim.where, claim.claim, claim.reading});
  return table;
}

Table hypotheses_table(const std::vector<analysis::Hypothesis>& hypotheses, const Studies& studies,
                       const Provenance& provenance) {
  Table table{
      .id = "hypotheses", .title = "The three hypotheses", .columns = {{""}, {"hypothesis"}}, .provenance = provenance};
  for (const VariantStudy& s : studies) table.columns.push_back({s.variant.name});
  for (const analysis::Hypothesis& h : hypotheses) {
    std::vector<Cell> row{h.name, h.text};
    for (const analysis::Finding& f : h.findings) {
      const char* verdict = f.verdict == analysis::ClaimVerdict::reproduced ? "yes"
                            : f.verdict == analysis::ClaimVerdict::partly   ? "for the steps only"
                                                                            : "no";
      row.emplace_back(fmt::format("{}: {}", verdict, f.ours));
    }
    table.rows.push_back(std::move(row));
  }
  table.notes = {
      "Yes: the largest total Sobol' index of the steady speed over mean friction 0.3 to 0.55 exceeds 0.1. It is the "
      "share of "
      "the variance that would go if everything but this source were known; shares with interactions may add up to "
      "more "
      "than one. Brackets: 95 %, from an eighth of the samples under settled.",
      variants_note};
  return table;
}

Table variance_table(const Studies& studies, const Provenance& provenance) {
  Table table{.id = "variance",
              .title = "Where the variance comes from: Sobol' indices at 7.02 deg",
              .columns = {{"law"},
                          {"output"},
                          {"mean of μ", "", NumberFormat::fixed, 2},
                          {"mean", "", NumberFormat::significant, 4},
                          {"sd", "", NumberFormat::significant, 3}},
              .provenance = provenance};
  for (const char* source : analysis::variance_sources) {
    table.columns.push_back({fmt::format("{}, first", source), "", NumberFormat::fixed, 3});
    table.columns.push_back({fmt::format("{}, total", source), "", NumberFormat::fixed, 3});
  }
  for (const VariantStudy& s : studies) {
    if (s.variant.reading == analysis::RestReading::goes_on) continue;  // one law, one set of indices
    const std::string law(dynamics::law_name(s.variant.law));
    for (const bool steps : {false, true})
      for (const auto& [friction, shares] : s.variance) {
        const analysis::SobolResult& result = steps ? shares.steps : shares.steady_speed;
        std::vector<Cell> row{law, steps ? "steps" : "steady speed [rad/s]", friction, result.mean, result.sd};
        for (std::size_t g = 0; g < analysis::variance_sources.size(); ++g) {
          if (result.group.empty()) {
            row.insert(row.end(), {"", ""});
            continue;
          }
          const analysis::SobolIndex& index = result.group[g];
          row.insert(row.end(), {index.first, index.total});
        }
        table.rows.push_back(std::move(row));
      }
  }
  table.notes = {
      "Sources: launch N(7.35, 0.19²) rad/s; each leg N(0.1519, 0.000687²) m; η ~ N(0.4, 0.1²) and μ ~ N(mean, 0.1²), "
      "afresh "
      "at every collision. Steady speed: mean before collisions 13 to 16, with x′ < 0 set to 0 and no rest. Steps: "
      "before "
      "failure, at most the 32 on the ramp; their first-order share is that of the expected steps given the source. "
      "Empty: "
      "the output does not vary. Brackets: 95 %; sampling may put an index a little outside [0, 1]."};
  return table;
}

Table fig4_table(const Studies& studies, const analysis::PaperExperiments& experiments, const Provenance& provenance) {
  Table table{.id = "fig4",
              .title = "Fig. 4: fast and slow start at 9.59 deg",
              .columns = {{"source"},
                          {"fast, steady", "rad/s", NumberFormat::significant, 4},
                          {"slow, steady", "rad/s", NumberFormat::significant, 4},
                          {"difference", "rad/s", NumberFormat::fixed, 3},
                          {"P, trial means", "", NumberFormat::p_value, 2},
                          {"P, all collisions", "", NumberFormat::p_value, 2},
                          {"not told apart from collision"}},
              .provenance = provenance};
  const auto add = [&](const std::string& source, const analysis::TrialSpeeds& fast,
                       const analysis::TrialSpeeds& slow) {
    const analysis::ConditionComparison c = analysis::compare_conditions(fast, slow);
    std::vector<Cell> row{source, steady_cell(analysis::steady_trial_means(fast)),
                          steady_cell(analysis::steady_trial_means(slow))};
    if (c.trial_means)
      row.insert(row.end(), {effect_cell(c.trial_means->welch.difference), known_cell(c.trial_means->welch.p),
                             known_cell(c.all_collisions->pooled.p)});
    else
      row.insert(row.end(), {"", "", ""});
    row.push_back(meet_cell(c.meet));
    table.rows.push_back(std::move(row));
  };
  add(experiment_name(experiments), experiments.fast_959, experiments.slow_959);
  for (const VariantStudy& s : studies) add(s.variant.name, s.fig4.fast.speeds, s.fig4.slow.speeds);
  table.notes = {
      "Simulated with η, μ ~ N(0.4, 0.1²): the paper states no contact for this figure. Paper: P > 0.07 beyond the "
      "12th collision (two-sided t-test).",
      variants_note, experiment_note(experiments)};
  return table;
}

Table fig6_table(const Studies& studies, const Provenance& provenance) {
  Table table{.id = "fig6",
              .title = "Fig. 6: three launch speeds, constant friction, η ~ N(0.4, 0.2²), 7.02 deg",
              .columns = {{"variant"}, {"μ", "", NumberFormat::fixed, 2}},
              .provenance = provenance};
  if (!studies.empty())
    for (const analysis::LaunchRun& run : studies.front().fig6.front().runs)
      table.columns.push_back({fmt::format("steady, launch {}", run.launch), "rad/s", NumberFormat::significant, 4});
  table.columns.push_back({"sd of a collision", "rad/s", NumberFormat::fixed, 3});
  for (const char* pair : {"P 1-2", "P 1-3", "P 2-3"}) table.columns.push_back({pair, "", NumberFormat::p_value, 2});
  for (const char* pair : {"P 1-2 by trial", "P 1-3 by trial", "P 2-3 by trial"})
    table.columns.push_back({pair, "", NumberFormat::p_value, 2});
  table.columns.push_back({"trials that rest", "", NumberFormat::fixed, 3});
  for (const VariantStudy& s : studies)
    for (const analysis::LaunchPanel& panel : s.fig6) {
      std::vector<Cell> row{s.variant.name, panel.friction};
      for (const analysis::LaunchRun& run : panel.runs) row.push_back(steady_cell(run.measured_legs.trial_means));
      const StudiedProfile& fastest = panel.runs.back().measured_legs;
      row.push_back(positive_cell(fastest.steady_sd()));
      for (double analysis::SteadyTest::*p : {&analysis::SteadyTest::p, &analysis::SteadyTest::p_by_trial})
        for (const analysis::LaunchPair& pair : panel.pairs) {
          const bool both = reaches_steady(panel.run(pair.first).measured_legs) &&
                            reaches_steady(panel.run(pair.second).measured_legs);
          row.push_back(both ? known_cell(pair.alike.*p) : Cell(""));
        }
      row.emplace_back(fastest.rest_share);
      table.rows.push_back(std::move(row));
    }
  table.notes = {
      "Launches N(1.35 + 2k, 0.198²) rad/s, k = 1, 2, 3. P: pooled t-test of all collisions from the 13th on, as the "
      "paper "
      "seems to do; by trial: Welch's test with one mean a trial. The caption keeps η = 0.4, the text scatters it; the "
      "text is followed. Empty: fewer than two trials get that far. Sd and rests are of k = 3.",
      variants_note};
  return table;
}

Table equal_legs_table(const Studies& studies, const Provenance& provenance) {
  Table table{.id = "equal-legs",
              .title = "Sec. IV-A: the measured legs against eight of mean length",
              .columns = {{"variant"},
                          {"μ", "", NumberFormat::fixed, 2},
                          {"launch", "rad/s", NumberFormat::fixed, 2},
                          {"measured legs", "rad/s", NumberFormat::significant, 4},
                          {"equal legs", "rad/s", NumberFormat::significant, 4},
                          {"P", "", NumberFormat::p_value, 2},
                          {"P by trial", "", NumberFormat::p_value, 2}},
              .provenance = provenance};
  for (const VariantStudy& s : studies)
    for (const analysis::LaunchPanel& panel : s.fig6)
      for (const auto& [launch, measured, equal, alike] : panel.runs) {
        const bool both = reaches_steady(measured) && reaches_steady(equal);
        table.rows.push_back({s.variant.name, panel.friction, launch, steady_cell(measured.trial_means),
                              steady_cell(equal.trial_means), both ? known_cell(alike.p) : Cell(""),
                              both ? known_cell(alike.p_by_trial) : Cell("")});
      }
  table.notes = {
      "Steady speeds (from the 13th collision on) of the runs of Fig. 6. Paper: P > 0.1 everywhere. Collisions 13 to "
      "16 "
      "land on legs 4 to 7, whose mean length is not that of all eight.",
      variants_note};
  return table;
}

Table fig7_table(const Studies& studies, const analysis::PaperExperiments& experiments, const Provenance& provenance) {
  Table table{
      .id = "fig7",
      .title = "Fig. 7: spreads of η and μ, 7.02 deg",
      .columns = {{"variant"},
                  {"sd of μ", "", NumberFormat::fixed, 2},
                  {"sd of η", "", NumberFormat::fixed, 2},
                  {"steady speed", "rad/s", NumberFormat::significant, 4},
                  {"sd of a collision", "rad/s", NumberFormat::fixed, 3},
                  {"trials that rest", "", NumberFormat::fixed, 3},
                  {fmt::format("{} less simulated", experiment_name(experiments)), "rad/s", NumberFormat::fixed, 3},
                  {"P", "", NumberFormat::p_value, 2}},
      .provenance = provenance};
  for (const VariantStudy& s : studies)
    for (const analysis::SpreadPanel& panel : s.fig7)
      for (const auto& [restitution_sd, profile, test] : panel.runs)
        table.rows.push_back({s.variant.name, panel.friction_sd, restitution_sd, steady_cell(profile.trial_means),
                              positive_cell(profile.steady_sd()), profile.rest_share,
                              test ? effect_cell(test->difference) : Cell(""), test ? known_cell(test->p) : Cell("")});
  table.notes = {
      "η ~ N(0.4, sd²), μ ~ N(0.4, sd²), launch N(7.35, 0.19²) rad/s. P: pooled t-test of all collisions from the 13th "
      "on "
      "against the experiment at 7.02 deg.",
      variants_note, experiment_note(experiments)};
  return table;
}

Table fig8_table(const Studies& studies, const Provenance& provenance) {
  Table table{.id = "fig8",
              .title = "Fig. 8: energy lost in a collision, 7.02 deg",
              .columns = {{"variant"},
                          {"sd of η and μ", "", NumberFormat::fixed, 2},
                          {"tangential net, mean", "J", NumberFormat::fixed, 3},
                          {"tangential net, sd", "J", NumberFormat::fixed, 3},
                          {"paper"},
                          {"normal, mean", "J", NumberFormat::fixed, 3},
                          {"normal, sd", "J", NumberFormat::fixed, 3},
                          {"paper"}},
              .provenance = provenance};
  for (const VariantStudy& s : studies)
    for (const auto& [sd, losses] : s.fig8) {
      const analysis::MeanSpread &t = losses.tangential_net, &n = losses.normal;
      const bool narrowest = sd == s.fig8.front().sd, widest = sd == s.fig8.back().sd;
      table.rows.push_back({s.variant.name, sd, with_error(t.mean, t.standard_error), t.sd,
                            narrowest ? "0.05 (0.03)"
                            : widest  ? "0.11 (0.19)"
                                      : "",
                            with_error(n.mean, n.standard_error), n.sd,
                            narrowest ? "0.17 (0.06)"
                            : widest  ? "0.17 (0.1)"
                                      : ""});
    }
  table.notes = {
      "Launch N(7.35, 0.19²) rad/s, 16 collisions. Net: friction loss less the potential energy gained by slipping "
      "downhill. Paper: mean (sd).",
      variants_note};
  return table;
}

Table fig9_table(const Studies& studies, const Provenance& provenance) {
  Table table{.id = "fig9",
              .title = "Fig. 9: means of η and μ, both with sd 0.15, 7.02 deg",
              .columns = {{"variant"},
                          {"mean of μ", "", NumberFormat::fixed, 1},
                          {"mean of η", "", NumberFormat::fixed, 1},
                          {"sd at collisions 2-6", "rad/s", NumberFormat::fixed, 3},
                          {"sd at collisions 13-16", "rad/s", NumberFormat::fixed, 3},
                          {"steady speed", "rad/s", NumberFormat::significant, 4},
                          {"trials that rest", "", NumberFormat::fixed, 3}},
              .provenance = provenance};
  for (const VariantStudy& s : studies)
    for (const analysis::MeanPanel& panel : s.fig9)
      for (const auto& [restitution, profile] : panel.runs)
        table.rows.push_back({s.variant.name, panel.friction, restitution, positive_cell(profile.transient_sd()),
                              positive_cell(profile.steady_sd()), steady_cell(profile.trial_means),
                              profile.rest_share});
  table.notes = {"Launch N(7.35, 0.19²) rad/s. Sds between trials; empty where fewer than two trials get that far.",
                 variants_note};
  return table;
}

}  // namespace metastable::reports
