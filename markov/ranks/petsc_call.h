#pragma once
// Failures of PETSc and SLEPc as exceptions.

namespace metastable::markov {

/// @param code  what a function of theirs returned
/// @throws ConvergenceError with their text unless that is 0
void petsc(int code);

}  // namespace metastable::markov
