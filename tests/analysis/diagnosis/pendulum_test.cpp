// Diagnoses a system that lives in this file alone: a pendulum's amplitudes, from a CSV text to sentences. Nothing of
// the diagnosis knows what swings here.

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "analysis/diagnosis/diagnosis.h"
#include "tests/message_of.h"

namespace metastable::analysis {
namespace {

constexpr double viscous = 0.05, noise = 0.002, first_amplitude = 0.8;  // decrement [1], sd [rad], [rad]
constexpr int swings = 24;

struct Swing {
  std::size_t trial;
  int number;
  double before, after;  // amplitudes at the turning points [rad]
};

// Models after = before exp(-decrement) - drop - bend before^2 + noise.
class Pendulum : public TransitionModel {
 public:
  explicit Pendulum(std::vector<Swing> swung) : swings_(std::move(swung)) {
    for (const Swing& s : swings_) {
      Event e;
      e.trial = s.trial;
      e.number = s.number;
      e.speed = s.before;
      events_.push_back(e);
    }
    nuisances_ = {{"decrement", viscous, 0.01, 1e-5, 0, 1}, {"log noise", std::log(noise), 0.3, 1e-4, -12, 0}};
    candidates_ = {effect("dry_friction", "drop_rad", 0.1), effect("air_drag", "bend_per_rad", 1),
                   effect("wear", "decrement_by_trial", 0.01)};
  }
  static Pendulum from_csv(std::istream& csv) {
    std::vector<Swing> all;
    std::string line;
    std::getline(csv, line);  // trial,swing,amplitude_rad
    double before = 0;
    while (std::getline(csv, line)) {
      std::istringstream fields(line);
      std::size_t trial = 0;
      int number = 0;
      double amplitude = 0;
      char comma = 0;
      fields >> trial >> comma >> number >> comma >> amplitude;
      if (number > 0) all.push_back({trial, number, before, amplitude});
      before = amplitude;
    }
    return Pendulum(std::move(all));
  }

  const std::vector<Event>& events() const override { return events_; }
  std::size_t trials() const override { return events_.back().trial + 1; }
  std::size_t conditions() const override { return 1; }
  int legs() const override { return 0; }
  bool time_tells() const override { return false; }
  std::string step_name() const override { return "swing"; }
  std::string recalibrated() const override { return "damping"; }
  std::string condition_name(std::size_t) const override { return "the pivot"; }
  const std::vector<Nuisance>& nuisances() const override { return nuisances_; }
  const std::vector<Candidate>& candidates() const override { return candidates_; }
  Evaluation evaluate(std::span<const double> n, std::span<const EffectTerm> terms) const override {
    Evaluation e;
    const double sd = std::exp(n[1]);
    for (const Swing& s : swings_) {
      const double z = (s.after - mean(s.before, s.trial, n, terms)) / sd;
      e.score.push_back(z);
      e.log_density.push_back(-0.5 * z * z - 0.91893853320467274 - n[1]);
      e.unit.push_back(sd);
    }
    return e;
  }
  std::unique_ptr<TransitionModel> simulate(std::span<const double> n, std::span<const EffectTerm> terms,
                                            std::uint64_t seed) const override {
    std::mt19937_64 generator(seed);
    std::normal_distribution<double> normal;
    std::vector<Swing> drawn = swings_;
    for (std::size_t i = 0; i < drawn.size(); ++i) {
      if (i > 0 && drawn[i].number > 1) drawn[i].before = drawn[i - 1].after;
      drawn[i].after = mean(drawn[i].before, drawn[i].trial, n, terms) + std::exp(n[1]) * normal(generator);
    }
    return std::make_unique<Pendulum>(std::move(drawn));
  }
  std::pair<double, double> rests() const override { return {0, 0}; }
  double expected_steps(std::span<const double>, std::span<const EffectTerm>, std::uint64_t) const override {
    return std::numeric_limits<double>::infinity();
  }
  const std::vector<std::string>& notes() const override { return notes_; }
  std::vector<NamedValue> report_nuisances(std::span<const double> n) const override {
    return {{"decrement", n[0]}, {"noise", std::exp(n[1])}};
  }

 private:
  static Candidate effect(const std::string& id, const std::string& parameter, double most) {
    Candidate one;
    one.id = id;
    one.parameters = {{0, -most, most, 1e-5 * most}};
    one.report = [parameter](const std::vector<double>&, const std::vector<double>& v) {
      return std::vector<NamedValue>{{parameter, v[0]}};
    };
    return one;
  }
  static double mean(double before, std::size_t trial, std::span<const double> n, std::span<const EffectTerm> terms) {
    double decrement = n[0], lost = 0;
    for (const EffectTerm& term : terms) {
      const double size = term.values[0];
      if (term.candidate->id == "dry_friction") lost += size;
      if (term.candidate->id == "air_drag") lost += size * before * before;
      if (term.candidate->id == "wear") decrement += size * static_cast<double>(trial);
    }
    return before * std::exp(-decrement) - lost;
  }

  std::vector<Swing> swings_;
  std::vector<Event> events_;
  std::vector<Nuisance> nuisances_;
  std::vector<Candidate> candidates_;
  std::vector<std::string> notes_;
};

// Forty trials of a pendulum whose pivot takes `drop` of every swing.
std::string recorded(double drop, unsigned seed) {
  std::mt19937_64 generator(seed);
  std::normal_distribution<double> normal;
  std::ostringstream csv;
  csv.precision(12);
  csv << "trial,swing,amplitude_rad\n";
  for (int trial = 0; trial < 40; ++trial) {
    double amplitude = first_amplitude + 0.05 * normal(generator);
    for (int swing = 0; swing <= swings; ++swing) {
      if (swing > 0) amplitude = amplitude * std::exp(-viscous) - drop + noise * normal(generator);
      csv << trial << ',' << swing << ',' << amplitude << '\n';
    }
  }
  return csv.str();
}

Diagnosis diagnosed(double drop, unsigned seed) {
  std::istringstream csv(recorded(drop, seed));
  const Pendulum pendulum = Pendulum::from_csv(csv);
  DiagnosisOptions options;
  options.draws = 400;
  return diagnose(pendulum, options);
}

TEST(AnySystem, APendulumWithDryFrictionIsDiagnosedFromItsFile) {
  int explained = 0, inside = 0;
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const Diagnosis d = diagnosed(0.004, seed);
    explained += d.verdict == Verdict::explained;
    EXPECT_EQ(d.causes.ranked.front().name(), "dry_friction");
    EXPECT_LT(d.causes.p_none, 0.3);
    const EstimatedParameter& drop = d.causes.ranked.front().parameters[0].at(0);
    EXPECT_EQ(drop.name, "drop_rad");
    inside += drop.lower < 0.004 && 0.004 < drop.upper;
    std::string all;
    for (const std::string& sentence : d.sentences) all += sentence + " ";
    EXPECT_NE(all.find("nats a swing"), std::string::npos) << all;
    EXPECT_EQ(all.find("collision"), std::string::npos) << all;
  }
  EXPECT_GE(explained, 3);  // a catalogue of three is often thought to lack the cause
  EXPECT_GE(inside, 7);     // 90 % intervals
}

TEST(AnySystem, APendulumAsItsModelSaysHasNoGap) {
  int gaps = 0;
  for (unsigned seed = 1; seed <= 5; ++seed) gaps += diagnosed(0, seed).gap.p_value < 0.02;
  EXPECT_LE(gaps, 1);
}

TEST(AnySystem, IsDecidedUnderOtherRulesAsByADiagnosisWithThem) {
  std::istringstream csv(recorded(0.004, 2));
  const Pendulum pendulum = Pendulum::from_csv(csv);
  DiagnosisOptions options;
  options.draws = 200;
  Rules strict;
  strict.least_at_work = 0.9999;
  const std::vector<Diagnosis> decided = decide_each(pendulum, options, {Rules{}, strict});
  ASSERT_EQ(decided.size(), 2U);
  options.rules = strict;
  const Diagnosis whole = diagnose(pendulum, options);
  EXPECT_EQ(decided[1].verdict, whole.verdict);
  EXPECT_EQ(decided[1].gap.p_value, whole.gap.p_value);
  EXPECT_EQ(decided[1].causes.set, whole.causes.set);
  EXPECT_EQ(decided[1].causes.p_unnamed, whole.causes.p_unnamed);
  EXPECT_EQ(decided[0].gap.p_value, whole.gap.p_value);
}

TEST(AnySystem, AnEffectThatThePendulumDoesNotKnowIsRefusedWithThoseItDoes) {
  std::istringstream csv(recorded(0, 1));
  DiagnosisOptions options;
  options.catalogue = {"leg_contact"};
  EXPECT_EQ(message_of([&] { diagnose(Pendulum::from_csv(csv), options); }),
            "effect: \"leg_contact\" is none of dry_friction, air_drag, wear");
}

}  // namespace
}  // namespace metastable::analysis
