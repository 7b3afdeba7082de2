#pragma once
// Offers starts to fits of a machine whose measured rows lie far off its model.

#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "analysis/fitting/effect_scan.h"
#include "analysis/fitting/transition_model.h"
#include "analysis/machine_model/machine.h"
#include "analysis/machine_model/machine_runs.h"

namespace metastable::analysis {

/// Fits terms to the same runs under a tolerant model, whose sensors err three times as much and of which no row is
/// wild. Where an effect moves most rows far off, the likelihood of the model itself rises nearly nowhere towards it:
/// row after row counts as wild. Where a recalibration alone brings the rows back, it starts from there.
class TolerantStarts {
 public:
  TolerantStarts(std::shared_ptr<const Machine> machine, MachineRuns runs);
  /// Returns where a fit of these terms may start; nothing where wild rows explain the runs, where the machine has no
  /// wild rows or no sensor of known error, and for one effect that promises far less than another. May be called from
  /// several threads.
  std::vector<FitStart> starts(std::span<const EffectTerm> terms) const;
  /// Fits the tolerant model, once, if it is needed: the first call of starts() does it, too.
  void prepare() const;

 private:
  struct Tolerant {
    std::unique_ptr<TransitionModel> model;
    Fit recalibrated;
    bool for_effects = false;  // Recalibrated it is far off, too; else only the recalibration starts from there.
    EffectScan scan;           // of all its effects, where it is for them
  };
  std::unique_ptr<Tolerant> tolerant() const;

  std::shared_ptr<const Machine> machine_;
  MachineRuns runs_;
  mutable std::once_flag asked_;
  mutable std::unique_ptr<Tolerant> tolerant_;  // null: not needed
};

}  // namespace metastable::analysis
