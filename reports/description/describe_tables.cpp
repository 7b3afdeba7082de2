#include "reports/description/describe_tables.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "dynamics/wheel/contact_law.h"
#include "reports/description/speed_cells.h"
#include "reports/output/known_cell.h"

namespace metastable::reports {
namespace {

// Where even the best parameters make the transitions next to impossible, the number says no more than that.
Cell log_likelihood_cell(const analysis::ContactFit& fit) {
  constexpr double hopeless = -20;  // [nats] a transition: one in 5e8
  const double value = fit.log_likelihood;
  if (value < hopeless * static_cast<double>(fit.transitions))
    return NotShown{{value, value, value}, fmt::format("below {:.0f} a transition", hopeless)};
  return value;
}

}  // namespace

std::vector<std::string> description_sentences(const analysis::Description& description) {
  std::vector<std::string> sentences;
  std::string speeds;
  std::size_t trials = 0, rests = 0, known = 0;
  for (const analysis::ConditionDescription& c : description.conditions) {
    trials += c.trials;
    if (c.survival) rests += c.survival->rests, known += c.survival->trials;
    if (c.steady.count < 2) continue;
    speeds += fmt::format("{}{} at {} rad/s", speeds.empty() ? "" : ", ", c.id,
                          format_estimate(mean_interval(c.steady), NumberFormat::significant, 3));
  }
  if (!speeds.empty())
    sentences.push_back(fmt::format("From the 13th collision on the trials roll steadily: {}.", speeds));
  // Few pairs can be told one by one.
  constexpr std::size_t most_pairs = 3;
  std::string alike;
  if (description.comparisons.size() <= most_pairs)
    for (const analysis::ConditionComparison& c : description.comparisons) {
      if (!c.trial_means || std::isnan(c.trial_means->welch.p)) continue;
      const double p = c.trial_means->welch.p;
      if (p < 0.05 || description.conditions[c.a].slope_deg != description.conditions[c.b].slope_deg) continue;
      alike += fmt::format("{}{} and {} cannot be told apart there (P = {})", alike.empty() ? "" : "; ",
                           description.conditions[c.a].id, description.conditions[c.b].id,
                           format_number(p, NumberFormat::p_value, 2));
    }
  if (!alike.empty()) sentences.push_back(alike + ".");
  if (known > 0)
    sentences.push_back(fmt::format("{} of {} trials came to rest.",
                                    rests == 0 ? std::string("None") : fmt::format("{}", rests), known));
  else
    sentences.push_back(fmt::format("How the {} trials ended is not known.", trials));
  return sentences;
}

Table short_table(const analysis::Description& description, const Provenance& provenance) {
  const Table all = conditions_table(description, provenance);
  Table table{.id = "in-short", .title = "The trials by condition", .columns = {}, .provenance = provenance};
  constexpr std::array<std::size_t, 5> shown = {0, 2, 4, 9, 10};  // of conditions_table()
  for (const std::size_t j : shown) table.columns.push_back(all.columns[j]);
  for (const std::vector<Cell>& row : all.rows) {
    table.rows.emplace_back();
    for (const std::size_t j : shown) table.rows.back().push_back(row[j]);
  }
  table.notes = {
      "Steady speed: just before a collision, from the 13th on. Below each number its 95 % interval; “> n” where "
      "no trial rested from there on."};
  return table;
}

Table conditions_table(const analysis::Description& description, const Provenance& provenance) {
  Table table{.id = "conditions",
              .title = "The conditions",
              .columns = {{"condition"},
                          {"slope", "deg", NumberFormat::general, 4},
                          {"trials"},
                          {"collisions"},
                          {"steady speed", "rad/s", NumberFormat::significant, 4},
                          {"sd between trials", "rad/s", NumberFormat::fixed, 3},
                          {"sd between collisions", "rad/s", NumberFormat::fixed, 3},
                          {"return-map slope", "", NumberFormat::fixed, 3},
                          {"its fixed point", "rad/s", NumberFormat::significant, 4},
                          {"trials that rest"},
                          {"expected steps before failure", "", NumberFormat::significant, 3}},
              .provenance = provenance};
  for (const analysis::ConditionDescription& c : description.conditions) {
    std::vector<Cell> row{c.id, c.slope_deg, c.trials, c.collisions};
    row.push_back(mean_cell(c.steady));
    row.push_back(sd_cell(c.steady));
    row.push_back(sd_cell(c.steady_collisions));
    row.push_back(c.line ? Cell(with_error(c.line->slope, c.line->slope_error)) : Cell(""));
    row.push_back(c.line && c.line->fixed_point ? Cell(*c.line->fixed_point) : Cell(""));
    row.push_back(c.survival ? Cell(c.survival->rests) : Cell(""));
    row.push_back(c.survival ? estimate_cell(c.survival->expected.from_start, 4) : Cell(""));
    table.rows.push_back(std::move(row));
  }
  table.notes = {
      "Speeds are those just before a collision. Steady: from the 13th collision on; its mean and interval are over "
      "trials, "
      "one mean a trial. Return map: straight line through all pairs of successive speeds. Brackets hold 95 % "
      "intervals.",
      "Expected steps: area under the Kaplan-Meier curve up to the 12th collision, and a constant failure rate from "
      "the "
      "13th on; “> n” where no trial rested there."};
  for (const analysis::ConditionDescription& c : description.conditions)
    if (c.survival && !c.survival->expected.message.empty())
      table.notes.push_back(fmt::format("{}: {}.", c.id, c.survival->expected.message));
  table.notes.insert(table.notes.end(), description.notes.begin(), description.notes.end());
  return table;
}

Table profiles_table(const analysis::Description& description, const Provenance& provenance) {
  Table table{.id = "profiles",
              .title = "Speed just before each collision, mean and standard error",
              .columns = {{"collision"}},
              .provenance = provenance};
  std::size_t longest = 0;
  for (const analysis::ConditionDescription& c : description.conditions) {
    table.columns.push_back({c.id + " trials"});
    table.columns.push_back({c.id + " mean", "rad/s", NumberFormat::fixed, 3});
    table.columns.push_back({c.id + " standard error", "rad/s", NumberFormat::fixed, 3});
    longest = std::max(longest, c.profile.size());
  }
  for (std::size_t k = 0; k < longest; ++k) {
    std::vector<Cell> row{k + 1};
    for (const analysis::ConditionDescription& c : description.conditions) {
      if (k >= c.profile.size()) {
        row.insert(row.end(), {std::size_t{0}, "", ""});
        continue;
      }
      const analysis::SpeedSummary& s = c.profile[k];
      row.insert(row.end(), {s.count, s.mean, s.standard_error});
      if (s.count < 2) row.back() = "";
    }
    table.rows.push_back(std::move(row));
  }
  table.notes = {"Over the trials that met the collision: where trials rest, later rows are of the survivors."};
  return table;
}

Table legs_table(const analysis::Description& description, const Provenance& provenance) {
  Table table{
      .id = "legs", .title = "Speed before the collision of each leg", .columns = {{"leg"}}, .provenance = provenance};
  std::size_t legs = 0;
  for (const analysis::ConditionDescription& c : description.conditions) {
    table.columns.push_back({c.id, "rad/s", NumberFormat::significant, 4});
    if (c.legs) legs = std::max(legs, c.legs->size());
  }
  for (std::size_t leg = 0; leg < legs; ++leg) {
    if (std::none_of(description.conditions.begin(), description.conditions.end(),
                     [&](const auto& c) { return c.legs && (*c.legs)[leg].count > 0; }))
      continue;
    std::vector<Cell> row{leg};
    for (const analysis::ConditionDescription& c : description.conditions)
      row.push_back(c.legs ? mean_cell((*c.legs)[leg]) : Cell(""));
    table.rows.push_back(std::move(row));
  }
  table.notes = {
      "From the wheel's second turn on, so that every leg counts; one mean a trial, with 95 % interval. The first of "
      "them land before the 13th collision, from which speeds are taken as steady."};
  return table;
}

Table tests_table(const analysis::Description& description, const Provenance& provenance) {
  Table table{.id = "tests",
              .title = "Steady speeds of two conditions: the same distribution?",
              .columns = {{"conditions"},
                          {"values"},
                          {"n"},
                          {"difference of means", "rad/s", NumberFormat::fixed, 3},
                          {"P Welch", "", NumberFormat::p_value, 2},
                          {"P pooled t", "", NumberFormat::p_value, 2},
                          {"P Kolmogorov-Smirnov", "", NumberFormat::p_value, 2},
                          {"P Anderson-Darling", "", NumberFormat::p_value, 2},
                          {"Hedges' g", "", NumberFormat::fixed, 2},
                          {"P(first > second)", "", NumberFormat::fixed, 3},
                          {"distance D", "", NumberFormat::fixed, 3},
                          {"not told apart from collision"}},
              .provenance = provenance};
  for (const analysis::ConditionComparison& c : description.comparisons) {
    const std::string pair = description.conditions[c.a].id + ", " + description.conditions[c.b].id;
    const auto add = [&](const std::optional<analysis::SampleComparison>& s, const char* values, bool meet) {
      if (!s) return;
      table.rows.push_back({pair, values, fmt::format("{}, {}", s->count_a, s->count_b),
                            effect_cell(s->welch.difference), known_cell(s->welch.p), known_cell(s->pooled.p),
                            known_cell(s->kolmogorov_smirnov.p), known_cell(s->anderson_darling.p),
                            effect_cell(s->hedges), effect_cell(s->superiority), effect_cell(s->distance),
                            meet ? meet_cell(c.meet) : Cell("")});
    };
    add(c.trial_means, "trial means", true);
    add(c.all_collisions, "all collisions", false);
  }
  table.notes = {
      "From the 13th collision on. P is two-sided: how often samples of one distribution differ this much. Trial means "
      "are "
      "independent of each other, and their P holds; collisions of one trial are not, so that P of “all collisions”, "
      "which is closest to what the paper reports, is too small where trials differ.",
      "Last column: first collision from which on Welch's test at every collision has P of 0.05 or more."};
  return table;
}

Table survival_table(const analysis::Description& description, const Provenance& provenance) {
  Table table{.id = "survival",
              .title = "Probability of surviving n collisions (Kaplan-Meier)",
              .columns = {{"n"}},
              .provenance = provenance};
  std::size_t longest = 0;
  for (const analysis::ConditionDescription& c : description.conditions) {
    table.columns.push_back({c.id + " at risk"});
    table.columns.push_back({c.id + " rested"});
    table.columns.push_back({c.id + " P(steps > n)", "", NumberFormat::fixed, 3});
    if (c.survival) longest = std::max(longest, c.survival->curve.size());
  }
  for (std::size_t k = 0; k < longest; ++k) {
    std::vector<Cell> row{k + 1};
    for (const analysis::ConditionDescription& c : description.conditions) {
      if (!c.survival || k >= c.survival->curve.size()) {
        row.insert(row.end(), {"", "", ""});
        continue;
      }
      const analysis::SurvivalPoint& p = c.survival->curve[k];
      row.insert(row.end(), {p.at_risk, p.rested, Estimate{p.survival, p.lower, p.upper}});
    }
    table.rows.push_back(std::move(row));
  }
  table.notes = {
      "Trials that reached the end of the ramp or of the recording are censored there, not failures. Brackets: 95 %, "
      "from "
      "Greenwood's variance on the log(−log) scale."};
  return table;
}

Table fits_table(const analysis::Description& description, dynamics::Law law, const Provenance& provenance) {
  Table table{.id = "contact",
              .title = fmt::format("Restitution and friction by maximum likelihood under {}", dynamics::law_name(law)),
              .columns = {{"fitted to"}, {"transitions"}, {"rests"}, {"left out"}},
              .provenance = provenance};
  for (const char* name : {"η mean", "η sd", "μ mean", "μ sd"})
    table.columns.push_back({name, "", NumberFormat::fixed, 3});
  table.columns.push_back({"log-likelihood", "", NumberFormat::fixed, 1});
  for (const analysis::DescribedFit& f : description.fits) {
    std::vector<Cell> row{f.of, f.fit.transitions, f.fit.rests, f.fit.impossible};
    const bool fitted = f.fit.status != analysis::ContactFit::Status::impossible;
    for (std::size_t i = 0; i < 4; ++i)
      row.push_back(fitted ? Cell(Estimate{f.fit.value[i], f.fit.lower_95[i], f.fit.upper_95[i]}) : Cell(""));
    row.push_back(fitted ? log_likelihood_cell(f.fit) : Cell(""));
    table.rows.push_back(std::move(row));
  }
  table.notes = {
      fmt::format("η ~ N(mean, sd²) on [0, 1], μ ~ N(mean, sd²) on [0, ∞), from {}. Brackets: 95 %, where the "
                  "likelihood with the other three at their best has fallen by 1.92; infinite where it does not. "
                  "Speeds are taken as exact, so that noise of the sensor counts as spread.",
                  description.transition == analysis::Transition::collision ? "each collision's ω− and ω+"
                                                                            : "each step's ω− and the next ω−")};
  for (const analysis::DescribedFit& f : description.fits) {
    if (!f.fit.message.empty()) table.notes.push_back(fmt::format("{}: {}.", f.of, f.fit.message));
    std::string sentences;
    for (const std::string& sentence : analysis::ambiguities(f.fit)) sentences += " " + sentence;
    if (!sentences.empty()) table.notes.push_back(fmt::format("{}:{}", f.of, sentences));
  }
  return table;
}

Table laws_table(const analysis::LawComparison& comparison, const Provenance& provenance) {
  Table table{.id = "laws",
              .title = "Measured beside what the contact laws predict",
              .columns = {{"condition"},
                          {"source"},
                          {"trials"},
                          {"steady speed", "rad/s", NumberFormat::significant, 4},
                          {"sd between trials", "rad/s", NumberFormat::fixed, 3},
                          {"sd between collisions", "rad/s", NumberFormat::fixed, 3},
                          {"share that rests", "", NumberFormat::fixed, 3},
                          {"P same speed", "", NumberFormat::p_value, 2}},
              .provenance = provenance};
  for (const analysis::LawRow& r : comparison.rows) {
    if (r.trials == 0) {
      table.rows.push_back({r.condition, r.source, "", "no fit", "", "", "", ""});
      continue;
    }
    table.rows.push_back({r.condition, r.source, r.trials, mean_cell(r.steady), sd_cell(r.steady),
                          r.steady.count > 0 ? Cell(r.collision_sd) : Cell(""),
                          r.outcomes_known ? estimate_cell(r.rest_share) : Cell(""), known_cell(r.p_speed)});
  }
  table.notes = {
      "Steady: from the 13th collision on, by the trials that got there; empty if none did. Brackets: 95 %. P: Welch's "
      "test "
      "of the trial means against the measured ones. “As given” takes η and μ from experiment.toml, “fitted” from all "
      "conditions by maximum likelihood of the steps."};
  for (const auto& [law, fit] : comparison.fits) {
    std::string text(dynamics::law_name(law));
    text += fit.status == analysis::ContactFit::Status::impossible
                ? ": " + fit.message
                : fmt::format(": η ~ N({:.3f}, {:.3f}²), μ ~ N({:.3f}, {:.3f}²){}{}", fit.value[0], fit.value[1],
                              fit.value[2], fit.value[3], fit.message.empty() ? "" : "; ", fit.message);
    table.notes.push_back(text + ".");
  }
  return table;
}

Table landings_table(const std::vector<analysis::LegRow>& legs, const Provenance& provenance) {
  Table table{.id = "landings",
              .title = "Landings leg by leg, measured beside settled as given",
              .columns = {{"condition"},
                          {"leg"},
                          {"landings"},
                          {"kept, measured", "", NumberFormat::fixed, 4},
                          {"kept, settled", "", NumberFormat::fixed, 4},
                          {"P same kept", "", NumberFormat::p_value, 2},
                          {"slide, measured", "mm", NumberFormat::fixed, 2},
                          {"slide, settled", "mm", NumberFormat::fixed, 2},
                          {"P same slide", "", NumberFormat::p_value, 2}},
              .provenance = provenance};
  const auto in_mm = [](const analysis::SpeedSummary& s) {
    return s.count < 2 ? Cell("") : mean_cell({s.count, 1e3 * s.mean, 1e3 * s.sd, 1e3 * s.standard_error});
  };
  std::size_t told_apart = 0, tests = 0;
  for (const analysis::LegRow& r : legs) {
    table.rows.push_back({r.condition, r.leg, r.kept_measured.count, mean_cell(r.kept_measured), mean_cell(r.kept),
                          known_cell(r.p_kept), in_mm(r.slide_measured), in_mm(r.slide), known_cell(r.p_slide)});
    for (const std::optional<double>& value : {r.p_kept, r.p_slide})
      if (value) ++tests, told_apart += *value < 0.05;
  }
  table.notes = {fmt::format(
      "Landings from the 13th collision on. Kept: the share of ω−² with which a standing foot reaches the same speed "
      "at the next touch. Slide: of the foot down the ramp until the next one touches. Nothing is fitted. {} of {} "
      "tests tell measured and predicted apart at 0.05, where chance alone gives {:.1f}.",
      told_apart, tests, 0.05 * static_cast<double>(tests))};
  return table;
}

}  // namespace metastable::reports
