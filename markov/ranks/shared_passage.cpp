#include "markov/ranks/shared_passage.h"

#include <slepceps.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include "markov/ranks/petsc_call.h"

namespace metastable::markov {
namespace {

constexpr int product_limit = 20000;
constexpr double standing_tolerance = 1e-13;  // relative change of the rate and of entries of the right vector
constexpr double moved_tolerance = 1e-12;     // distance between distributions
constexpr int in_a_row = 3;
constexpr double eigen_tolerance = 1e-9;  // products do the rest
constexpr int refinements = 8;
constexpr double residual_tolerance = 1e-12;  // of expected steps, which are 1 at least

template <class T, PetscErrorCode destroy(T*)>
struct Owned {
  T object = nullptr;
  Owned() = default;
  Owned(const Owned&) = delete;
  Owned& operator=(const Owned&) = delete;
  ~Owned() { destroy(&object); }
  operator T() const { return object; }
  T* operator&() { return &object; }
};
using OwnedVec = Owned<Vec, VecDestroy>;
using OwnedMat = Owned<Mat, MatDestroy>;
using OwnedEps = Owned<EPS, EPSDestroy>;
using OwnedKsp = Owned<KSP, KSPDestroy>;

std::vector<double> copy_of(Vec vec) {
  PetscInt n = 0;
  const PetscScalar* values = nullptr;
  petsc(VecGetLocalSize(vec, &n));
  petsc(VecGetArrayRead(vec, &values));
  std::vector<double> copy(values, values + n);
  petsc(VecRestoreArrayRead(vec, &values));
  return copy;
}

/// Makes one solution.
class Solving {
 public:
  explicit Solving(const SharedMesh& mesh) : mesh_(mesh), phases_(static_cast<std::size_t>(mesh.phases())) {
    for (std::size_t i = 0; i < mesh.size(); ++i) loss_.push_back(mesh.kill()[i] + mesh.leave()[i]);
  }

  SharedPassage solve() {
    left();
    right();
    steps();
    return std::move(passage_);
  }

 private:
  /// Sums over all nodes of each phase.
  std::vector<double> by_phase(const std::function<double(std::size_t)>& entry) const {
    std::vector<double> sums(phases_, 0.0);
    for (std::size_t i = 0; i < mesh_.size(); ++i) sums[static_cast<std::size_t>(mesh_.phase(i))] += entry(i);
    mesh_.ranks().add_up(sums);
    return sums;
  }

  /// Returns SLEPc's eigenvector of the largest real eigenvalue, made positive.
  std::vector<double> eigenvector(Mat matrix) {
    OwnedEps eps;
    OwnedVec real, imaginary;
    petsc(EPSCreate(PETSC_COMM_WORLD, &eps));
    petsc(EPSSetOperators(eps, matrix, nullptr));
    petsc(EPSSetProblemType(eps, EPS_NHEP));
    petsc(EPSSetType(eps, EPSKRYLOVSCHUR));
    petsc(EPSSetWhichEigenpairs(eps, EPS_LARGEST_REAL));
    petsc(EPSSetDimensions(eps, 1, PETSC_DEFAULT, PETSC_DEFAULT));
    petsc(EPSSetTolerances(eps, eigen_tolerance, 1000));
    petsc(MatCreateVecs(matrix, &real, &imaginary));
    petsc(VecSet(real, 1));
    petsc(EPSSetInitialSpace(eps, 1, &real));
    petsc(EPSSetFromOptions(eps));
    petsc(EPSSolve(eps));
    PetscInt converged = 0, iterations = 0;
    petsc(EPSGetConverged(eps, &converged));
    petsc(EPSGetIterationNumber(eps, &iterations));
    if (converged < 1) throw ConvergenceError("SLEPc", 0, "no eigenvalue after 1000 restarts");
    passage_.eigen_iterations += iterations;
    PetscScalar value = 0, imaginary_value = 0;
    petsc(EPSGetEigenpair(eps, 0, &value, &imaginary_value, real, imaginary));
    std::vector<double> vector = copy_of(real);
    double sum = 0;
    for (const double x : vector) sum += x;
    if (mesh_.ranks().sum(sum) < 0)
      for (double& x : vector) x = -x;
    for (double& x : vector) x = std::max(x, 0.0);
    return vector;
  }

  void count_product() {
    if (++passage_.products > product_limit)
      throw ConvergenceError("mesh", 0, "eigenvectors still change after 20000 products");
  }

  void divide_by_phase(std::vector<double>& x, const std::vector<double>& sums) const {
    for (std::size_t i = 0; i < x.size(); ++i) x[i] /= sums[static_cast<std::size_t>(mesh_.phase(i))];
  }

  void left() {
    OwnedMat transposed;
    petsc(MatCreateTranspose(mesh_.matrix(), &transposed));
    std::vector<double>& x = passage_.distribution;
    x = eigenvector(transposed);
    divide_by_phase(x, by_phase([&](std::size_t i) { return x[i]; }));
    std::vector<double> y(x.size());
    double last = 0;
    for (int stood = 0; stood < in_a_row;) {
      mesh_.apply_left(x, y);
      count_product();
      divide_by_phase(y, by_phase([&](std::size_t i) { return y[i]; }));
      double moved = 0;
      for (std::size_t i = 0; i < x.size(); ++i) moved += 0.5 * std::abs(x[i] - y[i]);
      x.swap(y);
      lost_ = by_phase([&](std::size_t i) { return x[i] * loss_[i]; });
      log_kept_ = 0;
      for (const double lost : lost_) log_kept_ += std::log1p(-std::min(1.0, lost)) / static_cast<double>(phases_);
      const double rate = phases_ == 1 ? lost_[0] : -std::expm1(log_kept_);
      const bool stands =
          std::abs(rate - last) <= standing_tolerance * rate && mesh_.ranks().sum(moved) <= moved_tolerance;
      stood = stands ? stood + 1 : 0;
      last = rate;
    }
    passage_.failure_rate = last;
  }

  void right() {
    std::vector<double>& w = passage_.survival_weight;
    const std::vector<double>& pi = passage_.distribution;
    w = eigenvector(mesh_.matrix());
    std::vector<double> y(w.size());
    const auto normalise = [&](std::vector<double>& x) {
      divide_by_phase(x, by_phase([&](std::size_t i) { return pi[i] * x[i]; }));
    };
    normalise(w);
    for (int stood = 0; stood < in_a_row;) {
      mesh_.apply(w, y);
      count_product();
      normalise(y);
      double change = 0;
      for (std::size_t i = 0; i < w.size(); ++i)
        if (y[i] > 1e-280) change = std::max(change, std::abs(w[i] / y[i] - 1));
      w.swap(y);
      stood = mesh_.ranks().largest(change) <= standing_tolerance ? stood + 1 : 0;
    }
  }

  struct Deflated {
    Mat matrix;
    Vec pi, w;
  };
  /// Computes y = (I - Q) u + w (pi . u).
  static PetscErrorCode deflated_product(Mat shell, Vec u, Vec y) {
    Deflated* d = nullptr;
    PetscCall(MatShellGetContext(shell, &d));
    PetscScalar along = 0;
    PetscCall(MatMult(d->matrix, u, y));
    PetscCall(VecAYPX(y, -1, u));
    PetscCall(VecDot(d->pi, u, &along));
    PetscCall(VecAXPY(y, along, d->w));
    return 0;
  }

  static Vec view(const std::vector<double>& values) {
    Vec vec = nullptr;
    petsc(VecCreateMPIWithArray(PETSC_COMM_WORLD, 1, static_cast<PetscInt>(values.size()), PETSC_DETERMINE,
                                values.data(), &vec));
    return vec;
  }

  void steps() {
    // Eigenvectors of one step are, phase by phase, those of a revolution times `mass` and divided by it.
    std::vector<double> mass(phases_, 1.0), pi = passage_.distribution, w = passage_.survival_weight;
    double masses = 1;
    for (std::size_t c = 1; c < phases_; ++c) {
      mass[c] = mass[c - 1] * std::exp(std::log1p(-lost_[c - 1]) - log_kept_);
      masses += mass[c];
    }
    const double share = masses / static_cast<double>(phases_);
    std::vector<double> rhs(pi.size()), u(pi.size(), 0.0), residual(pi.size());
    for (std::size_t i = 0; i < pi.size(); ++i) {
      const double m = mass[static_cast<std::size_t>(mesh_.phase(i))];
      pi[i] *= m;
      w[i] /= m;
      rhs[i] = 1 - share * w[i];
    }
    refine(pi, w, rhs, u, residual);
    passage_.expected_steps.resize(u.size());
    double from_start = 0;
    for (std::size_t i = 0; i < u.size(); ++i) {
      passage_.expected_steps[i] = share / passage_.failure_rate * w[i] + u[i];
      from_start += mesh_.start()[i] * passage_.expected_steps[i];
    }
    passage_.steps = mesh_.ranks().sum(from_start);
  }

  /// Solves (I - Q) u = rhs with pi u = 0, each time for what is left.
  void refine(const std::vector<double>& pi, const std::vector<double>& w, const std::vector<double>& rhs,
              std::vector<double>& u, std::vector<double>& residual) {
    OwnedVec pi_view, w_view, left_over, correction;
    pi_view.object = view(pi);
    w_view.object = view(w);
    Deflated deflated{mesh_.matrix(), pi_view, w_view};
    OwnedMat shell;
    const auto n = static_cast<PetscInt>(u.size());
    petsc(MatCreateShell(PETSC_COMM_WORLD, n, n, PETSC_DETERMINE, PETSC_DETERMINE, &deflated, &shell));
    petsc(MatShellSetOperation(shell, MATOP_MULT, reinterpret_cast<void (*)()>(deflated_product)));
    petsc(MatCreateVecs(shell, &correction, nullptr));
    left_over.object = view(residual);
    OwnedKsp ksp;
    PC none = nullptr;
    petsc(KSPCreate(PETSC_COMM_WORLD, &ksp));
    petsc(KSPSetOperators(ksp, shell, shell));
    petsc(KSPSetType(ksp, KSPGMRES));
    petsc(KSPGMRESSetRestart(ksp, 20));
    petsc(KSPGetPC(ksp, &none));
    petsc(PCSetType(none, PCNONE));
    petsc(KSPSetTolerances(ksp, 1e-6, 1e-300, PETSC_DEFAULT, 20000));
    petsc(KSPSetFromOptions(ksp));
    residual = rhs;
    for (int refinement = 0;; ++refinement) {
      double largest = 0;
      for (const double r : residual) largest = std::max(largest, std::abs(r));
      passage_.residual = mesh_.ranks().largest(largest);
      if (passage_.residual <= residual_tolerance) return;
      if (refinement == refinements)
        throw ConvergenceError("PETSc", passage_.residual, "expected steps keep a residual");
      PetscScalar* changed = nullptr;  // what PETSc keeps of this vector's norms is of the last one
      petsc(VecGetArray(left_over, &changed));
      petsc(VecRestoreArray(left_over, &changed));
      petsc(KSPSolve(ksp, left_over, correction));
      KSPConvergedReason reason = KSP_CONVERGED_ITERATING;
      PetscInt iterations = 0;
      petsc(KSPGetConvergedReason(ksp, &reason));
      petsc(KSPGetIterationNumber(ksp, &iterations));
      passage_.linear_iterations += iterations;
      if (reason < 0) throw ConvergenceError("PETSc", passage_.residual, "GMRES does not converge");
      const std::vector<double> more = copy_of(correction);
      double along = 0;
      for (std::size_t i = 0; i < u.size(); ++i) along += pi[i] * (u[i] += more[i]);
      along = mesh_.ranks().sum(along) / static_cast<double>(phases_);
      for (std::size_t i = 0; i < u.size(); ++i) u[i] -= along * w[i];  // what GMRES left of it would fade slowly
      mesh_.apply(u, residual);
      for (std::size_t i = 0; i < u.size(); ++i) residual[i] = rhs[i] - (u[i] - residual[i]);
    }
  }

  const SharedMesh& mesh_;
  std::size_t phases_;
  std::vector<double> loss_, lost_;  ///< of nodes; of the distribution of each phase
  double log_kept_ = 0;              ///< a step
  SharedPassage passage_;
};

}  // namespace

SharedPassage shared_passage(const SharedMesh& mesh) { return Solving(mesh).solve(); }

}  // namespace metastable::markov
