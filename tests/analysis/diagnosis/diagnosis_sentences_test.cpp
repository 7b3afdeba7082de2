#include "analysis/diagnosis/diagnosis_sentences.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "analysis/diagnosis/diagnosis.h"
#include "analysis/machine_model/machine_transitions.h"
#include "tests/analysis/machine_model/machines.h"

namespace metastable::analysis {
namespace {

std::string said_at_work(double alone, double beside) {
  Diagnosis d;
  d.verdict = Verdict::explained;
  AtWork one;
  one.name = "a_by_phase";
  one.effects = {"a_by_phase"};
  one.probability = 1;
  one.closes_alone = Estimate{alone, alone, alone};
  one.closes_beside = Estimate{beside, beside, beside};
  d.causes.at_work = {one};
  d.causes.set = {"a_by_phase"};
  Cause cause;
  cause.effects = {"a_by_phase"};
  d.causes.ranked = {cause};
  const std::vector<std::string> all = sentences(d);
  const auto at = std::ranges::find_if(all, [](const std::string& s) { return s.starts_with("At work"); });
  return at == all.end() ? "" : *at;
}

TEST(DiagnosisSentences, SayWhatAnEffectClosesBesideOtherParameters) {
  EXPECT_EQ(said_at_work(0.97, 0.12), "At work with probability 1.00: a_by_phase; it closes 97 % of the gap.");
  EXPECT_EQ(said_at_work(-0.01, 0.25),
            "At work with probability 1.00: a_by_phase; it closes less than 1 % of the gap in the model as given, 25 % "
            "when it is added to the recalibrated model.");
}

TEST(DiagnosisSentences, SayWhatStandsInThePlaceOfTheUnnamed) {
  Diagnosis d;
  d.verdict = Verdict::partly_explained;
  d.data.step_name = "collision";
  d.causes.p_unnamed = 0.93;
  d.causes.unnamed_share = 0.108;
  const auto stays = [&] {
    std::string said;
    for (const std::string& sentence : sentences(d))
      if (sentence.find("without a name") < 20 || sentence.starts_with("The likeliest model has")) said += sentence;
    return said;
  };
  EXPECT_EQ(stays(), "Something without a name stays, 11 % of the gap, with probability 0.93.");
  d.causes.stand_ins = {"contact_memory", "trial_spread"};
  EXPECT_EQ(stays(),
            "Something without a name is at work, too, 11 % of the gap, with probability 0.93."
            "The likeliest model has contact_memory and trial_spread in the place of what has no name, too unlikely to "
            "be named.");
}

TEST(DiagnosisSentences, SayWhatStaysInTheMapAndHowManyTrialsAreEnough) {
  Diagnosis d;
  d.verdict = Verdict::explained;
  d.causes.set = {"bounce"};
  d.causes.ranked.resize(1);
  d.causes.ranked.front().effects = {"bounce"};
  GapCell cell;
  cell.p_adjusted = 0.001;
  d.gap.left.cells = {cell};
  d.rules.model_error = 0.06;
  d.limits.not_possible = {{"how far the gap shrinks", "", 5760, true}};
  const std::vector<std::string> all = sentences(d);
  EXPECT_EQ(all.at(1),
            "It leaves 1 cell of the map beyond chance. What is left there is at most 6 % of the effect, an error that "
            "its form is allowed to have.");
  EXPECT_EQ(all.back(), "It takes about 5800 trials like these to say how far the gap shrinks.");
}

// A question about the data may undo the verdict.
TEST(DiagnosisSentences, TheNextStepIsToAnswerWhatIsAsked) {
  Diagnosis d;
  d.data.notes = {"x: it is 1 in every row"};
  EXPECT_TRUE(next_step(d).starts_with("Use the model as it is.")) << next_step(d);
  d.data.notes.emplace_back("x: is it in degrees?");
  EXPECT_TRUE(next_step(d).starts_with("First answer the question about the data.")) << next_step(d);
  EXPECT_NE(next_step(d).find("If it changes nothing, use the model as it is."), std::string::npos) << next_step(d);
}

std::string next_for(std::size_t trials, std::size_t steps, const std::string& step_name) {
  Diagnosis d;
  d.verdict = Verdict::unexplained;
  d.data.trials = trials;
  d.data.collisions = steps;
  d.data.step_name = step_name;
  return next_step(d);
}

TEST(DiagnosisSentences, OneLongTrialMayBeCut) {
  EXPECT_NE(
      next_for(1, 244, "step").find("or cut long ones: a trial number of its own for every 24 rows makes about 10."),
      std::string::npos)
      << next_for(1, 244, "step");
  for (const std::string& uncut :
       {next_for(1, 244, "collision"), next_for(1, 244, "revolution"), next_for(1, 43, "step")})
    EXPECT_NE(uncut.find("trials like these, and diagnose them together."), std::string::npos) << uncut;
  EXPECT_NE(next_for(10, 30, "step").find("Run 14 trials like these, or longer ones,"), std::string::npos)
      << next_for(10, 30, "step");
}

}  // namespace

// The runs are asked about and noted where something is wrong with them, and not where nothing is.

namespace test {
namespace {

/// Returns the note that holds these words; empty where there is none.
std::string note_with(const std::vector<std::string>& notes, const std::string& words) {
  const auto found =
      std::ranges::find_if(notes, [&](const std::string& note) { return note.find(words) != note.npos; });
  return found == notes.end() ? "" : *found;
}

/// A cart that goes speed times dt_s a step, beside a scatter. Its rows come after times of so many hundredths of a
/// second.
struct Cart {
  Machine machine;
  MachineRuns runs;
};
Cart cart(const std::function<int(std::size_t row, double u)>& hundredths, bool told_time) {
  Cart cart;
  Machine& machine = cart.machine;
  machine.states = {"place"};
  machine.parameters = {{"speed", 2, 0.2}, {"scatter", 0.002, 0.001, 1e-4, 1}};
  machine.observe = {{"place", 0.001, 0}};
  machine.most_wild = 0;
  if (told_time) machine.inputs = {"dt_s"};
  machine.step = [told_time](const MachineBatch& b) {
    for (std::size_t i = 0; i < b.rows; ++i)
      b.next[i] = 0.5 * b.states[i] + b.value(0, i) * (told_time ? b.value(2, i) : 0.01) + b.value(1, i) * b.scores[i];
  };
  std::mt19937_64 generator(5);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  for (std::size_t t = 0; t < 20; ++t) {
    MachineTrial& trial = cart.runs.trials.emplace_back();
    double place = 0.04 + 0.01 * normal(generator), time = static_cast<double>(t);
    for (std::size_t k = 0; k < 15; ++k) {
      const double gap = 0.01 * hundredths(k, uniform(generator));
      MachineRow& row = trial.rows.emplace_back();
      row.seen = {place + 0.001 * normal(generator)};
      row.time = time;
      if (told_time) row.inputs = {gap};
      place = 0.5 * place + 2 * gap + 0.002 * normal(generator);
      time += gap;
    }
  }
  return cart;
}

int of_a_walk(std::size_t /*row*/, double u) { return 60 + static_cast<int>(60 * u); }
int some_missing(std::size_t /*row*/, double u) { return u < 0.7 ? 1 : u < 0.9 ? 2 : 3; }

std::vector<std::string> notes_on(const Cart& cart) {
  return machine_transitions(std::make_shared<const Machine>(cart.machine), cart.runs)->notes();
}

TEST(QuestionsOnData, AnInputInMillisecondsIsACandidateBesideTheState) {
  Cart seconds = cart(of_a_walk, true);
  EXPECT_EQ(note_with(notes_on(seconds), "?"), "");
  for (MachineTrial& trial : seconds.runs.trials)
    for (MachineRow& row : trial.rows) row.inputs[0] *= 1000;
  const std::string asked = note_with(notes_on(seconds), "what the machine makes of the rows before");
  EXPECT_TRUE(asked.starts_with("place: ")) << asked;
  EXPECT_TRUE(asked.ends_with(", or is dt_s in thousandths of the machine's unit?")) << asked;
}

// Shifted by a row such a state fits better, too, but it is as far off.
TEST(QuestionsOnData, AStateInAnotherUnitIsNotAskedAboutOtherwise) {
  Cart millimetres = cart([](std::size_t, double) { return 1; }, false);
  for (MachineTrial& trial : millimetres.runs.trials)
    for (MachineRow& row : trial.rows) row.seen[0] *= 1000;
  const std::vector<std::string> notes = notes_on(millimetres);
  EXPECT_EQ(std::ranges::count_if(notes, [](const std::string& note) { return note.ends_with('?'); }), 1);
  EXPECT_NE(note_with(notes, "in thousandths of the machine's unit?"), "");
}

// Durations that differ otherwise are no sign of missing rows, nor are gaps that the machine is told.
TEST(QuestionsOnData, MissingRowsAreNotedWhereTheMapIsNotToldTheTimeStep) {
  const std::string noted = note_with(notes_on(cart(some_missing, false)), "time_s");
  EXPECT_NE(noted.find("whole multiples of the usual 0.01 s, as where rows are missing (from 0.01 to 0.03 s)"),
            std::string::npos)
      << noted;
  EXPECT_NE(noted.find("an input dt_s"), std::string::npos) << noted;
  EXPECT_EQ(note_with(notes_on(cart(some_missing, true)), "time_s"), "");
  EXPECT_EQ(note_with(notes_on(cart(of_a_walk, false)), "time_s"), "");
}

TEST(QuestionsOnData, NumbersAreRoundedForPeople) {
  Cart constant = cart([](std::size_t, double) { return 1; }, true);
  for (MachineTrial& trial : constant.runs.trials)
    for (MachineRow& row : trial.rows) row.inputs = {0.018251000000000003};
  EXPECT_TRUE(note_with(notes_on(constant), "in every row").starts_with("dt_s: it is 0.018251 in every row"));
}

// The trials of two crews differ by 0.9 in b.
TEST(QuestionsOnData, ALabelThatTellsTwoGroupsApartAnswersTheQuestion) {
  Machine machine = linear_machine(0.05);
  machine.parameters[0].nominal = 0.2;
  MachineRuns runs = scalar_runs(40, 14, 0.4, 0.05, 1, [](double x, double z, std::size_t t) {
    return 0.2 * x + 0.3 + (t < 24 ? 0 : 0.9) + 0.2 * z;
  });
  DiagnosisOptions options;
  options.draws = 400;
  options.catalogue = {"bend", "b_spread"};
  const auto said = [&] {
    const auto model = machine_transitions(std::make_shared<const Machine>(machine), runs);
    return note_with(decide_each(*model, options, {options.rules}).front().data.notes, "two groups");
  };
  EXPECT_TRUE(said().ends_with('?')) << said();
  runs.labels = {{"crew", {"old", "new"}}};
  for (std::size_t t = 0; t < runs.trials.size(); ++t)
    for (MachineRow& row : runs.trials[t].rows) row.labels = {t < 24 ? 0 : 1};
  EXPECT_TRUE(said().ends_with("; the label crew tells the same groups apart")) << said();
  for (std::size_t t = 0; t < runs.trials.size(); ++t)
    for (MachineRow& row : runs.trials[t].rows) row.labels = {t % 2 == 0 ? 0 : 1};
  EXPECT_TRUE(said().ends_with('?')) << said();
}

// Trials differ by a push, which no effect of this catalogue does, and b lies eight of its sds off.
TEST(QuestionsOnData, ParametersFarFromTheStatedAreToldOfAGapWithoutAName) {
  Machine machine = linear_machine(0.02);
  machine.parameters = {{"a", 0.5, 0.05}, {"b", 0.3, 0.05}, {"s", 0.1, 0.05, 0.01, 2}};
  machine.may_vary = {};
  const MachineRuns runs = scalar_runs(40, 14, 1, 0.02, 2, [](double x, double z, std::size_t t) {
    return 0.5 * x + 0.7 + (t % 2 == 0 ? 0.3 : -0.3) + 0.1 * z;
  });
  DiagnosisOptions options;
  options.draws = 400;
  options.catalogue = {"bend"};
  const Diagnosis d = diagnose(machine_transitions(std::make_shared<const Machine>(machine), runs), options);
  ASSERT_EQ(d.verdict, Verdict::unexplained);
  EXPECT_TRUE(std::ranges::any_of(d.sentences, [](const std::string& one) {
    return one.find("b is 0.") != one.npos && one.find("of its stated sds from 0.3") != one.npos;
  })) << fmt::format("{}", fmt::join(d.sentences, "\n"));
}

}  // namespace
}  // namespace test
}  // namespace metastable::analysis
