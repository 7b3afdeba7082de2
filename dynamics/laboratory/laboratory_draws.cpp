#include "dynamics/laboratory/laboratory_draws.h"

#include <Random123/philox.h>

#include "dynamics/numerics/truncated_normal.h"

namespace metastable::dynamics {

std::array<double, 4> laboratory_uniforms(std::uint64_t seed, std::uint64_t trial, std::uint64_t event,
                                          LaboratoryDraw purpose) {
  const r123::Philox4x64::ctr_type counter{{trial, event, static_cast<std::uint64_t>(purpose), 0}};
  const auto bits = r123::Philox4x64()(counter, r123::Philox4x64::key_type{{seed, 0}});
  std::array<double, 4> all{};
  for (std::size_t i = 0; i < 4; ++i) all[i] = (static_cast<double>(bits[i] >> 12) + 0.5) * 0x1p-52;
  return all;
}

std::array<double, 4> laboratory_normals(std::uint64_t seed, std::uint64_t trial, std::uint64_t event,
                                         LaboratoryDraw purpose) {
  std::array<double, 4> all = laboratory_uniforms(seed, trial, event, purpose);
  for (double& one : all) one = normal_quantile(one);
  return all;
}

}  // namespace metastable::dynamics
