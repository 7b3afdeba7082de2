#pragma once
// Compares numbers of a study that must agree, before anything is printed.

#include <string>

#include "analysis/study/certify.h"
#include "analysis/study/metastability.h"
#include "markov/chain/chain.h"

namespace metastable::analysis {

/// Says that two numbers must agree and do not; the message holds both. The command line turns it into exit
/// code 3.
class Contradiction : public markov::ConvergenceError {
 public:
  explicit Contradiction(const std::string& what) : ConvergenceError("contradiction: " + what) {}
};

/// Says that the chain's states leave out too much for its numbers to be known.
class StatesTooCoarse : public markov::ConvergenceError {
 public:
  explicit StatesTooCoarse(const std::string& what) : ConvergenceError("not known: " + what) {}
};

/// Says that landings under `settled` cannot be tabulated.
class NotTabulated : public markov::ConvergenceError {
 public:
  explicit NotTabulated(const std::string& why)
      : ConvergenceError("not known: law settled: " + why + "; simulate follows trials") {}
};

/// Says that a machine goes ever faster, in all that survives or in one motion that is followed: there is no regime to
/// tell numbers of.
class WithoutRegime : public markov::ConvergenceError {
 public:
  explicit WithoutRegime(const std::string& what) : ConvergenceError("not known: " + what) {}
};

/// Survival starts at 1, does not rise, and sums to no more than the expected steps; every interval holds its value;
/// expected steps are at least 1, rates lie in [0, 1]; and all of Metastability::agreements hold.
/// study() asks this of every result. @throws Contradiction
void require_consistent(const Metastability& study);

/// Do the study's interval of the expected steps and the guaranteed bounds overlap? @throws Contradiction if not
void require_consistent(const Metastability& study, const CertifiedSteps& certified);

/// Do two 95 % intervals of one quantity overlap? @throws Contradiction if not, naming both
void require_overlap(const std::string& what, const std::string& name_a, const Estimate& a, const std::string& name_b,
                     const Estimate& b);

}  // namespace metastable::analysis
