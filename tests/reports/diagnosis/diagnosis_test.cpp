// Shows a diagnosis as text, JSON and page, from one filled by hand.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "dynamics/catalogue/effect_catalogue.h"
#include "reports/diagnosis/diagnosis_figures.h"
#include "reports/diagnosis/diagnosis_json.h"
#include "reports/diagnosis/diagnosis_tables.h"
#include "reports/diagnosis/diagnosis_text.h"
#include "reports/experiment_commands/diagnose_command.h"
#include "reports/output/text_table.h"
#include "tests/own_folder.h"

namespace metastable::reports {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

analysis::GapCell cell(const std::string& aspect, const std::string& at, double statistic, double p_adjusted) {
  analysis::GapCell made;
  made.facet = "leg";
  made.aspect = aspect;
  made.at = at;
  made.stance = at.find("stance") != std::string::npos;
  made.statistic = statistic;
  made.p_adjusted = p_adjusted;
  made.size = 0.02 * statistic;
  made.band = 0.07;
  made.unit = "rad/s";
  made.events = 100;
  return made;
}

analysis::Diagnosis sample() {
  analysis::Diagnosis d;
  d.verdict = analysis::Verdict::explained;
  d.sentences = {"One cause explains it: leg_contact."};
  d.gap.p_as_given = 1e-4;
  d.gap.p_value = 3e-4;
  for (analysis::GapMap* map : {&d.gap.as_given, &d.gap.recalibrated, &d.gap.left})
    map->cells = {cell("mean", "leg 1, collision", 4, 0.02), cell("mean", "leg 3, collision", -8, 0.001),
                  cell("spread", "leg 3, collision", 3.9, 0.02), cell("mean", "leg 3, stance", 0.3, 0.9)};
  analysis::Cause leg, both, bounce;
  leg.effects = {"leg_contact"};
  leg.probability = 0.6, leg.gain = 80, leg.p_value = 1e-9, leg.evidence = 30;
  leg.parameters = {{{"leg", 3, 3, 3, false}, {"friction_ratio", 1.6, 1.4, 1.9, true}}};
  both.effects = {"leg_lengths", "slope_offset"};
  both.probability = 0.3;
  both.parameters = {{{"leg_lengths_m", 0.15, 0.149, 0.151, true}, {"leg_lengths_m", 0.16, 0.159, 0.161, true}},
                     {{"offset_deg", 0.2, 0.1, 0.3, true}}};
  d.causes.ranked = {leg, both};
  bounce.effects = {"bounce"};
  bounce.not_decided = "the fit did not converge";
  d.causes.not_decided = {bounce};
  d.causes.set = {"leg_contact", "leg_lengths+slope_offset"};
  d.causes.unnamed = {{{"leg_contact"}, 31, {{"order", "mean", false, 12, 8, 0.15, -3}}}};
  d.causes.p_none = 0.08;
  d.causes.p_recalibrate = 0.02;
  d.gap.contact = {{"friction_mean", 0.35, 0.34, 0.36, true}};
  analysis::Shrinkage score, open;
  score.measure = "held-out log score per collision", score.unit = "nats";
  score.baseline = 0.41, score.recalibrated = 0.33, score.with_effect = 0.02;
  score.closed = 0.95, score.closed_lower = 0.88, score.closed_upper = 1.0;
  open.measure = "error of P(rest)";
  d.shrinkage.measures = {score, open};
  d.shrinkage.steps = {
      .observed = infinity, .observed_lower = 40, .observed_upper = infinity, .baseline = 50, .with_effect = 70};
  d.shrinkage.steps.machine = {{"", {3000, 1300, infinity}, true}, {"on a slope of 8 deg", {120, 80, 170}, false}};
  d.limits.visible = {{"leg_contact", "friction_ratio", 0.04, {{"leg_lengths", 0.7}}, ""},
                      {"sensor_noise", "sd_rad_s", 0, {}, "no noise is stated"}};
  d.limits.missing = {{"leg", {{"leg_contact", "friction_ratio", {}, 0.04, {"friction_patch"}}}}, {"position_m", {}}};
  d.limits.not_possible = {{"where the gap lies", "7 transitions; a cell of the map takes 20", 3, true}};
  d.limits.next = {{"slopes flatter by 2 deg", {{"slope_deg_by", -2}}, 21.5}};
  d.data.condition_names = {"fast"};
  for (int k = 1; k <= 3; ++k)
    d.shrinkage.profile.push_back({.condition = 0,
                                   .collision = k,
                                   .trials = 50,
                                   .measured = 5.5,
                                   .measured_error = 0.02,
                                   .baseline = 5.3,
                                   .with_effect = 5.5,
                                   .band = 0.05});
  d.data.notes = {"The noise was taken from the data."};
  d.data.trials = 50, d.data.collisions = 800, d.data.events = 1600;
  return d;
}

const Provenance provenance{"metastable diagnose wheel", "experiment: wheel", 7, "0.1.0"};

nlohmann::json parsed(const analysis::Diagnosis& d) { return nlohmann::json::parse(diagnosis_json(d, provenance)); }

TEST(DiagnosisJson, HasTheKeysOfTheSchema) {
  const auto json = parsed(sample());
  EXPECT_EQ(json.at("schema"), 1);
  EXPECT_EQ(json.at("verdict"), "explained");
  EXPECT_EQ(json.at("gap").at("p_value_as_given"), 1e-4);
  EXPECT_EQ(json.at("gap").at("p_value"), 3e-4);
  EXPECT_EQ(json.at("cause_set"), (std::vector<std::string>{"leg_contact", "leg_lengths+slope_offset"}));
  for (const char* key :
       {"measure", "baseline", "recalibrated", "with_effect", "floor", "closed", "closed_interval_90"})
    EXPECT_TRUE(json.at("shrinkage").contains(key)) << key;
  EXPECT_EQ(json.at("shrinkage").at("closed_interval_90"), (std::vector<double>{0.88, 1.0}));
  EXPECT_EQ(json.at("not_decided").at(0).at("reason"), "the fit did not converge");
  EXPECT_EQ(json.at("unnamed_supposed").at(0).at("beside"), std::vector<std::string>{"leg_contact"});
  EXPECT_EQ(json.at("unnamed_supposed").at(0).at("facets").at(0).at("chi_squared"), 12);
  EXPECT_EQ(json.at("unnamed_supposed").at(0).at("facets").at(0).at("of"), "steps");
  EXPECT_TRUE(json.at("missing_columns").at(0).at("effects").at(0).at("smallest").is_null());
  EXPECT_EQ(json.at("missing_columns").at(0).at("effects").at(0).at("not_told_from").at(0), "friction_patch");
  EXPECT_EQ(json.at("not_possible").at(0).at("trials"), 3);
  EXPECT_EQ(json.at("next_experiment").at(0).at("separation"), 21.5);
  EXPECT_EQ(json.at("next_experiment").at(0).at("changes").at("slope_deg_by"), -2);
  EXPECT_EQ(json.at("visibility").at(0).at("alike").at("leg_lengths"), 0.7);
  EXPECT_EQ(json.at("provenance").at("seed"), 7);
}

TEST(DiagnosisJson, WhereHoldsTheSignificantCellsByPThenByScore) {
  const auto where = parsed(sample()).at("where");
  ASSERT_EQ(where.size(), 3U);
  EXPECT_EQ(where[0].at("at"), "leg 3, collision");
  EXPECT_EQ(where[0].at("aspect"), "mean");
  EXPECT_EQ(where[0].at("p_adjusted"), 0.001);
  EXPECT_EQ(where[0].at("size"), -0.16);
  EXPECT_EQ(where[0].at("unit"), "rad/s");
  EXPECT_EQ(where[1].at("at"), "leg 1, collision");
  EXPECT_EQ(where[2].at("aspect"), "spread");
}

TEST(DiagnosisJson, CausesCarryProbabilitiesThatSumToOne) {
  const auto causes = parsed(sample()).at("causes");
  double sum = 0;
  for (const auto& cause : causes) sum += cause.at("probability").get<double>();
  EXPECT_NEAR(sum, 1, 1e-12);
  ASSERT_EQ(causes.size(), 5U);
  EXPECT_EQ(causes[0].at("effect"), "leg_contact");
  EXPECT_TRUE(causes[0].at("parameters").at("leg").is_number_integer());
  EXPECT_EQ(causes[0].at("parameters").at("friction_ratio"), 1.6);
  EXPECT_EQ(causes[0].at("interval_90"), nlohmann::json::parse(R"({"friction_ratio": [1.4, 1.9]})"));
  EXPECT_EQ(causes[1].at("effect"), "leg_lengths+slope_offset");
  EXPECT_EQ(causes[1].at("parameters"),
            nlohmann::json::parse(
                R"({"leg_lengths": {"leg_lengths_m": [0.15, 0.16]}, "slope_offset": {"offset_deg": 0.2}})"));
  EXPECT_EQ(causes[1].at("interval_90").at("leg_lengths").at("leg_lengths_m").at(1),
            (std::vector<double>{0.159, 0.161}));
  EXPECT_EQ(causes[2].at("effect"), "none_of_these");
  EXPECT_EQ(causes[3].at("effect"), "recalibration");
  EXPECT_EQ(causes[3].at("parameters").at("friction_mean"), 0.35);
  EXPECT_EQ(causes[4].at("effect"), "no_gap");
}

TEST(DiagnosisJson, InfiniteIsAWordAndUnknownIsNull) {
  const auto json = parsed(sample());
  EXPECT_EQ(json.at("steps_before_failure").at("observed"), "infinite");
  EXPECT_TRUE(json.at("steps_before_failure").at("recalibrated").is_null());
  EXPECT_TRUE(json.at("steps_before_failure").at("machine").at(0).at("at_least"));
  EXPECT_EQ(json.at("steps_before_failure").at("machine").at(1).at("interval_90").at(1), 170);
  EXPECT_TRUE(json.at("shrinkage_by_measure").at(1).at("closed").is_null());
  EXPECT_TRUE(json.at("shrinkage_by_measure").at(1).at("closed_interval_90").is_null());
  EXPECT_TRUE(json.at("visibility").at(1).at("smallest").is_null());
  analysis::Diagnosis d = sample();
  d.shrinkage.measures[0].floor = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(parsed(d).at("shrinkage").at("floor").is_null());
}

TEST(DiagnosisText, SaysTheVerdictFirstAndAnswersEveryQuestion) {
  const std::string text = diagnosis_text(sample(), 400);
  EXPECT_EQ(text.find("verdict: explained\nOne cause explains it: leg_contact.\n"), 0U);
  std::size_t last = 0;
  for (const char* part :
       {"Next: Tell the causes apart before changing the model: slopes flatter by 2 deg would do it best",
        "Is there a gap?",
        "Where it lies",
        "leg 3, collision",
        "Which effect",
        "leg 3, friction_ratio 1.6 (1.4 to 1.9)",
        "none of these",
        "How far it shrinks",
        "95 % (88 to 100)",
        "not known: the gap as given may be none",
        "Expected steps before failure",
        "> 40",
        "at least 1300",
        "on a slope of 8 deg",
        "120 (80 to 170)",
        "What these data could have seen",
        "leg_lengths imitates 70 % of it",
        "no noise is stated",
        "What missing columns hide",
        "friction_patch",
        "no effect is much harder to see",
        "Not decided",
        "the fit did not converge",
        "What these data cannot say",
        "where the gap lies",
        "The next experiment",
        "slopes flatter by 2 deg",
        "Data",
        "The noise was taken"}) {
    const std::size_t at = text.find(part, last);
    EXPECT_NE(at, std::string::npos) << part << "\n" << text;
    if (at != std::string::npos) last = at;
  }
}

TEST(DiagnosisText, EveryVerdictSaysWhatToDoNext) {
  analysis::Diagnosis d = sample();
  const auto next = [&] {
    const std::string text = diagnosis_text(d, 1000);
    const std::size_t at = text.find("\nNext: ");
    return at == std::string::npos ? text : text.substr(at + 7, text.find('\n', at + 1) - at - 7);
  };
  d.causes.set = {"leg_contact"};
  EXPECT_NE(next().find("Give the model leg_contact"), std::string::npos) << next();
  EXPECT_NE(next().find("take it out of the machine;"), std::string::npos) << next();
  d.causes.set = {"sensor_bias_half_angle_rad"};
  EXPECT_NE(next().find("take it out of the measurement;"), std::string::npos) << next();
  d.causes.set = {"hip_damping", "sensor_noise_half_angle_rad"};
  EXPECT_NE(next().find("slopes flatter by 2 deg would do it best"), std::string::npos) << next();
  d.limits.next.clear();
  d.limits.missing.clear();
  EXPECT_EQ(next(), "Tell the causes apart before changing the model: with more trials.");
  d.verdict = analysis::Verdict::partly_explained;
  for (const char* id : {"hip_damping", "sensor_noise_half_angle_rad"}) {
    analysis::AtWork& one = d.causes.at_work.emplace_back();
    one.name = id, one.effects = {id}, one.probability = 1;
  }
  EXPECT_NE(next().find("take them out of machine and measurement,"), std::string::npos) << next();
  d.verdict = analysis::Verdict::no_gap;
  EXPECT_NE(next().find("Use the model as it is"), std::string::npos) << next();
  d.verdict = analysis::Verdict::recalibrate;
  EXPECT_NE(next().find("Give the model the recalibrated parameters"), std::string::npos) << next();
  d.verdict = analysis::Verdict::unexplained;
  EXPECT_NE(next().find("Check the measurement first"), std::string::npos) << next();
}

// What says nothing is not shown as a number; files and JSON keep it.
TEST(DiagnosisText, SaysLessWhereLessIsKnown) {
  analysis::Diagnosis d = sample();
  d.gap.p_as_given = 1e-23;
  d.causes.ranked[0].p_value = 5e-72;
  d.causes.ranked[1].evidence = -732427.8;
  analysis::Shrinkage& wide = d.shrinkage.measures[0];
  wide.closed = 1.37, wide.closed_lower = -1.41, wide.closed_upper = 1.42;
  const std::string text = diagnosis_text(d, 400);
  for (const char* absurd : {"10⁻²³", "10⁻⁷²", "732427", "7.32×10⁵", "137 %"})
    EXPECT_EQ(text.find(absurd), std::string::npos) << absurd << text;
  for (const char* said :
       {"< 10⁻¹²", "< 10⁻¹¹", "< −100", "not known: 90 % interval −140 to 140 %, wider than the gap"})
    EXPECT_NE(text.find(said), std::string::npos) << said << text;
  EXPECT_NE(to_csv(shrinkage_table(d)).find(",1.37,-1.41,1.42"), std::string::npos) << to_csv(shrinkage_table(d));
  EXPECT_NE(to_csv(causes_table(d)).find(",-732427.8,"), std::string::npos) << to_csv(causes_table(d));
  EXPECT_EQ(parsed(d).at("shrinkage").at("closed"), 1.37);
  EXPECT_EQ(parsed(d).at("gap").at("p_value_as_given"), 1e-23);
}

TEST(DiagnosisText, NoLineIsLongerThanTheWindow) {
  for (const std::size_t width : {80U, 100U, 160U}) {
    std::istringstream lines(diagnosis_text(sample(), width));
    for (std::string line; std::getline(lines, line);)
      EXPECT_LE(std::count_if(line.begin(), line.end(), [](char c) { return (c & 0xC0) != 0x80; }),
                static_cast<std::ptrdiff_t>(width))
          << line;
  }
}

TEST(DiagnosisText, SaysSoWhenNoCellIsBeyondChance) {
  analysis::Diagnosis d = sample();
  for (analysis::GapCell& one : d.gap.recalibrated.cells) one.p_adjusted = 0.5;
  EXPECT_NE(diagnosis_text(d).find("no cell is beyond chance"), std::string::npos);
}

TEST(DiagnosisTables, CauseOfAListShowsItsValuesWithoutIntervals) {
  const Table table = causes_table(sample());
  EXPECT_EQ(std::get<std::string>(table.rows.at(1).back().value()),
            "leg_lengths_m 0.1500; 0.1600 + offset_deg 0.20 (0.10 to 0.30)");
}

TEST(DiagnosisFigures, MapHasAPhaseAFigureAndRowsFromTheTop) {
  const std::vector<Figure> figures = map_figures(sample());
  ASSERT_EQ(figures.size(), 2U);
  const HeatMap& map = *figures[0].heat_map;
  EXPECT_EQ(map.y_names, (std::vector<std::string>{"leg 3", "leg 1"}));
  ASSERT_EQ(map.x_names.size(), 6U);
  EXPECT_EQ(map.x_names[1], "mean, recalibrated");
  EXPECT_EQ(map.value[0][1], -8);
  EXPECT_EQ(map.value[0][4], 3.9);
  EXPECT_TRUE(std::isnan(map.value[1][4]));
}

// What a reader sees first holds only what says something, in letters of the size of a caption.
TEST(DiagnosisFigures, FirstMapHoldsThePlacesThatTellAlone) {
  analysis::Diagnosis d = sample();
  std::vector<Figure> figures = furthest_figures(d);
  ASSERT_EQ(figures.size(), 2U);
  EXPECT_EQ(figures[0].heat_map->y_names,
            (std::vector<std::string>{"leg 3, stance", "leg 1, collision", "leg 3, collision"}));
  EXPECT_EQ(figures[0].heat_map->x_names, (std::vector<std::string>{"as given", "recalibrated", "with effect"}));
  EXPECT_EQ(figures[0].heat_map->value.back(), (std::vector<double>{-8, -8, -8}));
  EXPECT_EQ(figures[1].title, "Spread of the speed, collisions");
  EXPECT_EQ(figures[1].heat_map->y_names, std::vector<std::string>{"leg 3"});

  for (analysis::GapMap* map : {&d.gap.as_given, &d.gap.recalibrated, &d.gap.left}) {
    const analysis::GapCell pattern = map->cells.front();
    map->cells.clear();
    for (int leg = 0; leg < 40; ++leg) {
      analysis::GapCell one = pattern;
      one.at = fmt::format("leg {}, collision", leg);
      one.statistic = leg < 20 ? 5 : 1;
      map->cells.push_back(one);
    }
  }
  figures = furthest_figures(d);
  ASSERT_EQ(figures.size(), 1U);
  EXPECT_EQ(figures[0].heat_map->y.size(), 8U);
  for (analysis::GapMap* map : {&d.gap.as_given, &d.gap.recalibrated, &d.gap.left})
    for (analysis::GapCell& one : map->cells) one.statistic = 1;
  EXPECT_EQ(furthest_figures(d).at(0).heat_map->y.size(), 3U);
  // The whole map is a picture, its numbers are a table.
  EXPECT_EQ(map_figures(d).at(0).heat_map->digits, 0);
}

TEST(DiagnosisPage, HoldsFiguresAndTablesAndLoadsNothing) {
  const std::filesystem::path folder = metastable::test::own_folder();
  std::filesystem::remove_all(folder);
  write_diagnosis(sample(), "Wheel <1>", "coulomb", provenance, folder.string());
  std::ifstream in(folder / "index.html");
  const std::string html{std::istreambuf_iterator<char>(in), {}};
  for (const char* part : {"Wheel &lt;1&gt;", "Verdict: explained", "(law coulomb)", "figure-map-furthest",
                           "figure-map-collisions", "figure-map-stances", "figure-profile-1", "figure-ranking",
                           "figure-shrinkage-1", "table-gap", "table-where", "table-causes", "table-shrinkage",
                           "table-steps", "table-visibility", "table-next-experiment", "table-map", "seed: 7"})
    EXPECT_NE(html.find(part), std::string::npos) << part;
  EXPECT_EQ(html.find("<script"), std::string::npos);
  EXPECT_EQ(html.find("src="), std::string::npos);
  for (const char* name : {"causes", "parameters", "profile", "not-decided", "contact"})
    for (const char* ending : {".csv", ".md", ".tex"})
      EXPECT_TRUE(std::filesystem::exists(folder / "tables" / (std::string(name) + ending))) << name << ending;
  std::filesystem::remove_all(folder);
}

TEST(EffectsJson, ListsTheCatalogue) {
  const auto json = nlohmann::json::parse(effects_json());
  const auto& catalogue = dynamics::effect_catalogue();
  ASSERT_EQ(json.at("effects").size(), catalogue.size());
  const auto& leg = *std::find_if(json.at("effects").begin(), json.at("effects").end(),
                                  [](const auto& effect) { return effect.at("id") == "leg_contact"; });
  EXPECT_EQ(leg.at("parameters").at(1).at("name"), "friction_ratio");
  EXPECT_EQ(leg.at("parameters").at(1).at("lower"), 0.1);
}

}  // namespace
}  // namespace metastable::reports
