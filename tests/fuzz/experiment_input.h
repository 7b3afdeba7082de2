#pragma once
// Reads one input of the fuzz target: the files of an experiment folder in one text.

#include <cstddef>
#include <cstdint>

namespace metastable::fuzz {

/// Reads an experiment from `data` and checks what a successful reading promises; a broken promise ends the program.
/// The text before the first line "=== NAME" is experiment.toml; NAME is collisions.csv, trials.csv or angle.csv.
/// Returns whether it was an experiment without defects.
bool read_experiment_input(const std::uint8_t* data, std::size_t size);

}  // namespace metastable::fuzz
