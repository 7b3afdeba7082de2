#pragma once
// metastable collisions

#include "reports/commands/request.h"

namespace metastable::reports {

/// Turns angle.csv of a folder into its collisions.csv, with details beside it; says how many were found, and how far
/// the speeds are from those of a collisions.csv that was there before.
/// @throws analysis::InputError, OutputError, std::invalid_argument (user errors: exit code 2)
void run_collisions(const CollisionsRequest& request);

}  // namespace metastable::reports
