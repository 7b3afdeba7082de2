#pragma once
// Turns failures of PETSc and SLEPc into exceptions.

namespace metastable::markov {

/// @param code  what a function of theirs returned
/// @throws ConvergenceError with their text unless that is 0
void petsc(int code);

}  // namespace metastable::markov
