#pragma once
// Measures how visible an effect outside the catalogue is to somebody who knows it: the likelihood of an experiment in
// which each contact is changed as the effect changes it.

#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/experiment/experiment.h"
#include "analysis/experiment/laboratory_experiment.h"
#include "dynamics/catalogue/effect_catalogue.h"

namespace metastable::analysis {

/// Says whether the effect's likelihood is known. It is not where it acts through what was drawn or lost before
/// (sloshing_fluid, stored_energy, second_memory).
bool can_be_weighed(std::string_view outside);

/// Lists the columns without which nobody can tell the effect; none for an unknown id.
std::set<std::string> columns_needed(std::string_view outside);

/// Returns 2 log(likelihood with the effect / without), true contact known to both. What trials draw (a torque, a
/// phase) is integrated over. @throws std::invalid_argument for an effect that cannot be weighed
double outside_power(const Experiment& experiment, const dynamics::NominalValues& contact,
                     const dynamics::OutsideEffect& effect);

/// Returns 2 log(likelihood of the truth / of the best recalibrated model without the effect). Contacts may
/// be skewed, which no nuisance states exactly, so that the true contact need not be the likeliest: the truth is taken
/// with the true or with the refitted one, whichever is likelier.
/// @param beside  effects of the catalogue that both have; their sizes are refitted where the effect is lacking
/// @throws std::invalid_argument for an effect that cannot be weighed
double outside_power_left(const Experiment& experiment, const dynamics::NominalValues& contact,
                          const dynamics::OutsideEffect& effect, const std::vector<dynamics::Effect>& beside = {});

}  // namespace metastable::analysis
