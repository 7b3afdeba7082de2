#pragma once
// metastable doctor

namespace metastable::reports {

/// Prints what this program is built of, what it finds on this machine, and what a missing piece would add.
void run_doctor();

}  // namespace metastable::reports
