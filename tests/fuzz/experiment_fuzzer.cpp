#include "tests/fuzz/experiment_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  metastable::fuzz::read_experiment_input(data, size);
  return 0;
}
