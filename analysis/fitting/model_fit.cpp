#include "analysis/fitting/model_fit.h"

#include <algorithm>
#include <boost/math/tools/minima.hpp>
#include <cmath>
#include <iterator>
#include <limits>
#include <optional>

#include "markov/dense_matrix.h"

namespace metastable::analysis {
namespace {

constexpr double worth_a_step = 0.003;  // rise of the log likelihood; less is the optimum
// Where no step rises, a promised rise of the log likelihood below this, plus this share of what the fit has risen, is
// what differences do not resolve.
constexpr double unresolved = 0.5, unresolved_share = 1e-4;
// Shares of the information's diagonal that are added to it. Where a step rises by less than this share of what it
// promised, the next one is damped more.
constexpr double dampings[] = {0, 1e-4, 1e-3, 1e-2, 0.1, 1}, least_kept = 0.25;
// A step that foretold no more than this rise of the log likelihood, and rose by that up to this share, leaves next to
// nothing: of the order of that share squared. A larger one may have met its promise by chance.
constexpr double small_rise = 3, least_missed = 0.1;
// A fit that would have to rise by so much more, and by twice what its last step missed, to come to a likelihood that
// is known stops below it.
constexpr double worth_beating = 0.1;
// A promise below the first number is kept up to the second share of it.
constexpr double small_promise = 5, kept_promise = 1.5;
constexpr const char* stays_below = "it stays below what another fit has reached";
constexpr int most_halvings = 7, few_halvings = 3;  // of a step; of one that is damped more where another failed
// A step that rises by so many times what it foretold is too short. It is made longer, by so many times at most.
constexpr double much_more = 1.25, longest = 8;
constexpr int rough_steps = 2;             // A fit that is only looked at takes so many steps by another one's slopes.
constexpr double largest_change = 1e5;     // of an event's log density or score, over the step of a difference
constexpr double difference_share = 0.05;  // step of a difference, of what the data resolve
constexpr double widening = 8;             // factor on that step where kinks of single events' densities hide a slope

// Holds a hypothesis with one of its parameters moved by a step.
struct Moved {
  double step;
  std::vector<double> nuisance;
  std::vector<EffectTerm> terms;
};

// Holds all parameters of a hypothesis in one vector.
class Point {
 public:
  Point(const TransitionModel& model, std::vector<double> nuisance, std::vector<EffectTerm> terms,
        const FitOptions& options)
      : model_(model), nuisance_(std::move(nuisance)), terms_(std::move(terms)) {
    if (options.refit_nuisances)
      for (std::size_t i = 0; i < nuisance_.size(); ++i) {
        const Nuisance& n = model.nuisances()[i];
        slots_.push_back({&nuisance_[i], n.step, n.step, n.lower, n.upper, n, true});
      }
    if (!options.refit_effects) return;
    for (EffectTerm& term : terms_)
      for (std::size_t i = 0; i < term.values.size(); ++i) {
        const FreeParameter& p = term.candidate->parameters[i];
        Nuisance prior;
        prior.nominal = p.neutral;
        prior.prior_sd = p.prior_sd;
        slots_.push_back({&term.values[i], p.step, p.step, p.lower, p.upper, prior, false});
      }
    if (!options.last_variant_too) return;
    EffectTerm& last = terms_.back();
    for (std::size_t i = 0; i < last.candidate->refine.size(); ++i)
      if (const double spacing = last.candidate->refine[i]; spacing > 0) {
        double& entry = last.variant[i];
        const double step = difference_share * spacing;
        slots_.push_back({&entry, step, step, entry - spacing, entry + spacing, {}, false});
      }
  }
  Point(const Point&) = delete;
  Point& operator=(const Point&) = delete;

  struct Slot {
    double* value;
    double step, largest_step, lower, upper;
    Nuisance prior;  // of sd 0: there is none
    bool of_nuisance;
  };
  std::vector<Slot>& slots() { return slots_; }
  const std::vector<double>& nuisance() const { return nuisance_; }
  const std::vector<EffectTerm>& terms() const { return terms_; }
  Evaluation evaluate() const { return model_.evaluate(nuisance_, terms_); }
  // Returns the hypothesis with one parameter moved.
  Moved moved(std::size_t slot, double step) {
    double& value = *slots_[slot].value;
    const double here = value;
    value += step;
    Moved there{step, nuisance_, terms_};
    value = here;
    return there;
  }
  double log_prior() const {
    double sum = 0;
    for (const Slot& s : slots_)
      if (s.prior.prior_sd > 0) sum -= s.prior.cost(*s.value);
    return sum;
  }

 private:
  const TransitionModel& model_;
  std::vector<double> nuisance_;
  std::vector<EffectTerm> terms_;
  std::vector<Slot> slots_;
};

// Says between which points a slope is differenced: here and one side, both sides, or both sides further off.
enum class Reach { one_side, both_sides, wide };

Derivatives differences(const TransitionModel& model, Point& point, const Evaluation& here,
                        Reach reach = Reach::one_side) {
  const auto events = static_cast<Eigen::Index>(here.score.size());
  auto& slots = point.slots();
  Derivatives d{Eigen::MatrixXd(events, static_cast<Eigen::Index>(slots.size())),
                Eigen::MatrixXd(events, static_cast<Eigen::Index>(slots.size())), std::vector<double>(slots.size())};
  std::vector<Moved> moved;
  std::vector<std::size_t> first;  // of a slot's
  for (std::size_t p = 0; p < slots.size(); ++p) {
    const double value = *slots[p].value, step = slots[p].step * (reach == Reach::wide ? widening : 1);
    const bool above = value + step <= slots[p].upper, below = value - step >= slots[p].lower;
    first.push_back(moved.size());
    d.steps[p] = above ? step : -step;
    moved.push_back(point.moved(p, d.steps[p]));
    if (reach != Reach::one_side && above && below) {
      moved.push_back(point.moved(p, -step));
      d.steps[p] = 0;
    }
  }
  std::vector<Evaluation> there(moved.size());
  model.side_by_side(moved.size(), 1,
                     [&](std::size_t i) { there[i] = model.evaluate(moved[i].nuisance, moved[i].terms); });
  for (std::size_t p = 0; p < slots.size(); ++p) {
    const bool both_sides = d.steps[p] == 0;
    const Evaluation &up = there[first[p]], &from = both_sides ? there[first[p] + 1] : here;
    const double step = both_sides ? moved[first[p]].step - moved[first[p] + 1].step : d.steps[p];
    for (Eigen::Index i = 0; i < events; ++i) {
      const auto k = static_cast<std::size_t>(i);
      // Events at the floor of the density have no slope there.
      const auto bounded = [](double difference) { return std::clamp(difference, -largest_change, largest_change); };
      d.slope(i, static_cast<Eigen::Index>(p)) = bounded(up.log_density[k] - from.log_density[k]) / step;
      d.change(i, static_cast<Eigen::Index>(p)) = bounded(up.score[k] - from.score[k]) / step;
    }
  }
  return d;
}

double counted(const Evaluation& e, const Eigen::VectorXd& weights) {
  return Eigen::Map<const Eigen::VectorXd>(e.log_density.data(), weights.size()).dot(weights);
}

Eigen::VectorXd picked(const Eigen::VectorXd& all, const std::vector<Eigen::Index>& part) {
  Eigen::VectorXd some(static_cast<Eigen::Index>(part.size()));
  for (std::size_t a = 0; a < part.size(); ++a) some[static_cast<Eigen::Index>(a)] = all[part[a]];
  return some;
}

// Solves with a diagonal that is so much larger: where a ridge bends, undamped steps along it leave it. No step goes
// along what the data do not resolve.
Eigen::VectorXd gauss_newton(const Eigen::MatrixXd& information, const Eigen::VectorXd& gradient,
                             const std::vector<Eigen::Index>& part, double damping) {
  const auto size = static_cast<Eigen::Index>(part.size());
  Eigen::MatrixXd block(size, size);
  for (Eigen::Index a = 0; a < size; ++a)
    for (Eigen::Index b = 0; b < size; ++b)
      block(a, b) = information(part[static_cast<std::size_t>(a)], part[static_cast<std::size_t>(b)]);
  block.diagonal() *= 1 + damping;
  const Eigen::MatrixXd root = resolved_root(block);
  return root * (root.transpose() * picked(gradient, part));
}

// Halves the step until the penalised likelihood rises above `best`; the point stays where it was if it never does. A
// step that rises much more than it foretold is too short, because the information is less than it seems: it is made as
// long as a parabola through that rise says.
void search(Point& point, const std::vector<Eigen::Index>& part, const Eigen::VectorXd& step, double foretold,
            const Eigen::VectorXd& weights, int halvings, double& best, Evaluation& evaluation) {
  auto& slots = point.slots();
  std::vector<double> before;
  for (const Eigen::Index p : part) before.push_back(*slots[static_cast<std::size_t>(p)].value);
  const double start = best;
  const auto go = [&](double share) {
    for (std::size_t a = 0; a < part.size(); ++a) {
      const Point::Slot& s = slots[static_cast<std::size_t>(part[a])];
      *s.value = std::clamp(before[a] + share * step[static_cast<Eigen::Index>(a)], s.lower, s.upper);
    }
  };
  const auto better = [&](double share) {
    go(share);
    Evaluation tried = point.evaluate();
    const double value = counted(tried, weights) + point.log_prior();
    if (!(value > best)) return false;
    best = value;
    evaluation = std::move(tried);
    return true;
  };
  double share = 1;
  for (int halving = 0; !better(share); ++halving, share /= 2)
    if (halving + 1 == halvings) return go(0);
  const double ratio = (best - start) / foretold;
  if (share == 1 && ratio > much_more && !better(std::min(longest, 1 / std::max(1e-9, 2 - ratio)))) go(1);
}

// Returns the gradient of the penalised likelihood at the point where result.derivatives were taken. The prior goes
// into the information, too, and the slots get the steps of their next differences.
Eigen::VectorXd penalised_gradient(std::vector<Point::Slot>& slots, const Eigen::VectorXd& weights, Fit& result) {
  Eigen::VectorXd gradient = result.derivatives.slope.transpose() * weights;
  for (std::size_t k = 0; k < slots.size(); ++k) {
    const auto p = static_cast<Eigen::Index>(k);
    Point::Slot& s = slots[k];
    double& resolved = result.information(p, p);
    if (resolved > 0) s.step = std::min(s.largest_step, difference_share / std::sqrt(resolved));
    // A forward difference is the slope half a step on: taken back by the curvature, which matters along ridges.
    gradient[p] += 0.5 * result.derivatives.steps[k] * resolved;
    if (s.prior.prior_sd > 0) {
      gradient[p] -= s.prior.pull(*s.value);
      resolved += s.prior.information(*s.value);
    }
  }
  return gradient;
}

// Holds the indices of the parameters that may move: one held at a bound by the gradient stays there.
struct FreeParts {
  std::vector<Eigen::Index> all, of_nuisances, of_terms;
};

FreeParts free_parts(const std::vector<Point::Slot>& slots, const Eigen::VectorXd& gradient,
                     const Eigen::MatrixXd& information) {
  FreeParts parts;
  for (std::size_t k = 0; k < slots.size(); ++k) {
    const auto p = static_cast<Eigen::Index>(k);
    const Point::Slot& s = slots[k];
    const bool held = (*s.value <= s.lower && gradient[p] <= 0) || (*s.value >= s.upper && gradient[p] >= 0);
    const double range = s.upper - s.lower;
    if (held || !(information(p, p) * range * range > resolved_range)) continue;
    parts.all.push_back(p);
    (s.of_nuisance ? parts.of_nuisances : parts.of_terms).push_back(p);
  }
  return parts;
}

// The result of one iteration of a climb, in rises of the penalised likelihood.
struct Stride {
  double promised = 0;  // by an undamped step of all parameters, to first order
  double foretold = 0;  // by the last step that was tried
  double risen = 0;     // in truth
  bool better = false;  // or nothing is promised

  bool leaves_nothing() const {
    return better && foretold < small_rise && std::abs(risen - foretold) < least_missed * foretold;
  }
};

// A climb of the penalised likelihood by damped steps. `fit` holds the evaluation and the slopes where it stands.
class Climb {
 public:
  Climb(Point& point, const Eigen::VectorXd& weights, Fit& fit)
      : point_(point), weights_(weights), fit_(fit), best_(counted(fit.evaluation, weights) + point.log_prior()) {}

  double best() const { return best_; }

  // Says whether a small promise, even if more than kept, leaves the likelihood below a value that is known.
  bool stays_below(double known, const FreeParts& parts) const {
    Stride stride;
    step_of(parts.all, 0, stride);
    return stride.foretold < small_promise && best_ + kept_promise * stride.foretold < known;
  }

  // Says the same after a step, by what this missed. A likelihood that is above the known one is followed to its top.
  bool gives_up(const Stride& stride, double known) const {
    return stride.better && stride.foretold < small_promise && best_ <= known &&
           best_ + 2 * std::abs(stride.risen - stride.foretold) < known + worth_beating;
  }

  // Moves all parameters together; where that fails, the effects' and the nuisances' by themselves, and all of them
  // by steps that are damped more. @param resolved  a promise below it is not resolved
  Stride stride(const FreeParts& parts, double resolved, Reach reach) {
    const double before = best_;
    Stride stride;
    step_of(parts.all, 0, stride);
    stride.promised = stride.foretold;
    stride.better = !(stride.promised > worth_a_step) || rises(parts.all, level_, most_halvings, before, stride);
    const bool at_the_top = reach != Reach::one_side && stride.promised < resolved;
    if (!stride.better && !at_the_top)
      stride.better = rises(parts.of_terms, 0, most_halvings, before, stride) ||
                      rises(parts.of_nuisances, 0, most_halvings, before, stride);
    for (std::size_t damped = 0; !stride.better && !at_the_top && damped < std::size(dampings); ++damped)
      if (damped != level_ && (damped == 0 || stride.promised > resolved) &&
          rises(parts.all, damped, few_halvings, before, stride)) {
        stride.better = true;
        level_ = damped;
      }
    stride.risen = best_ - before;
    return stride;
  }

  // Moves all parameters together and says whether that was better.
  bool step(const FreeParts& parts) {
    Stride stride;
    return rises(parts.all, 0, few_halvings, best_, stride);
  }

  void damp_next(const Stride& stride) {
    if (stride.risen < least_kept * stride.foretold)
      level_ = std::min(level_ + 1, std::size(dampings) - 1);
    else if (level_ > 0)
      --level_;
  }

 private:
  Eigen::VectorXd step_of(const std::vector<Eigen::Index>& part, std::size_t damped, Stride& stride) const {
    const Eigen::VectorXd step = gauss_newton(fit_.information, fit_.gradient, part, dampings[damped]);
    stride.foretold = 0.5 * step.dot(picked(fit_.gradient, part));
    return step;
  }
  bool rises(const std::vector<Eigen::Index>& part, std::size_t damped, int halvings, double before, Stride& stride) {
    if (part.empty()) return false;
    const Eigen::VectorXd step = step_of(part, damped, stride);
    if (stride.foretold > worth_a_step)
      search(point_, part, step, stride.foretold, weights_, halvings, best_, fit_.evaluation);
    return best_ - before >= worth_a_step;
  }

  Point& point_;
  const Eigen::VectorXd& weights_;
  Fit& fit_;
  double best_;
  std::size_t level_ = 0;  // of damping
};

}  // namespace

Eigen::MatrixXd resolved_root(const Eigen::MatrixXd& information) {
  return markov::resolved_root(information, information.diagonal(), resolved_share);
}

Eigen::VectorXd prior_scatter(const TransitionModel& model, const Fit& fit) {
  std::vector<double> scatter;
  for (std::size_t p = 0; p < fit.nuisance.size(); ++p)
    scatter.push_back(model.nuisances()[p].prior_sd > 0 ? std::sqrt(model.nuisances()[p].information(fit.nuisance[p]))
                                                        : 0);
  for (const EffectTerm& term : fit.terms)
    for (const FreeParameter& p : term.candidate->parameters) scatter.push_back(p.prior_sd > 0 ? 1 / p.prior_sd : 0);
  return Eigen::VectorXd::Map(scatter.data(), static_cast<Eigen::Index>(scatter.size()));
}

Eigen::VectorXd event_weights(const TransitionModel& model, const std::vector<char>& count) {
  Eigen::VectorXd weights = Eigen::VectorXd::Ones(static_cast<Eigen::Index>(model.events().size()));
  if (!count.empty())
    for (std::size_t i = 0; i < model.events().size(); ++i)
      weights[static_cast<Eigen::Index>(i)] = count[model.events()[i].trial] ? 1 : 0;
  return weights;
}

Eigen::MatrixXd information(const Derivatives& columns, const Evaluation& here, const Eigen::VectorXd& weights) {
  const Eigen::Map<const Eigen::VectorXd> z(here.score.data(), weights.size());
  const Eigen::MatrixXd stretch = columns.slope + z.asDiagonal() * columns.change;
  return columns.change.transpose() * weights.asDiagonal() * columns.change +
         stretch.transpose() * weights.asDiagonal() * stretch;
}

Derivatives derivatives(const TransitionModel& model, const std::vector<double>& nuisance,
                        const std::vector<EffectTerm>& terms, const Evaluation& here, bool with_nuisances) {
  Point point(model, nuisance, terms, {.count = {}, .refit_nuisances = with_nuisances});
  return differences(model, point, here);
}

void fill_differences(const Evaluation& here, const Evaluation& there, double step, Eigen::Index column,
                      Derivatives& all) {
  for (Eigen::Index row = 0; row < all.slope.rows(); ++row) {
    const auto event = static_cast<std::size_t>(row);
    all.slope(row, column) = (there.log_density[event] - here.log_density[event]) / step;
    all.change(row, column) = (there.score[event] - here.score[event]) / step;
  }
}

namespace {

// Fills in information and gradient by the fit's derivatives, and returns which parameters may move.
FreeParts parts_by_slopes(Point& point, const Eigen::VectorXd& weights, Fit& fit) {
  fit.information = information(fit.derivatives, fit.evaluation, weights);
  fit.gradient = penalised_gradient(point.slots(), weights, fit);
  return free_parts(point.slots(), fit.gradient, fit.information);
}

}  // namespace

Fit stepped(const TransitionModel& model, const Fit& near, const std::vector<EffectTerm>& terms) {
  Point point(model, near.nuisance, terms, {});
  const Eigen::VectorXd weights = event_weights(model, {});
  Fit result;
  result.evaluation = point.evaluate();
  result.derivatives = near.derivatives;
  Climb climb(point, weights, result);
  const auto scores = [&](const Evaluation& of) {
    return Eigen::VectorXd(Eigen::VectorXd::Map(of.score.data(), weights.size()));
  };
  Eigen::VectorXd z = scores(near.evaluation);
  const auto carry = [&] {
    const Eigen::VectorXd now = scores(result.evaluation);
    result.derivatives.slope += (z - now).asDiagonal() * result.derivatives.change;
    z = now;
  };
  carry();
  for (int step = 0; step < rough_steps; ++step) {
    if (!climb.step(parts_by_slopes(point, weights, result))) break;
    carry();
  }
  result.nuisance = point.nuisance();
  result.terms = point.terms();
  result.log_likelihood = counted(result.evaluation, weights);
  result.penalised = climb.best();
  result.converged = false;
  return result;
}

Fit fit(const TransitionModel& model, const std::vector<double>& nuisance, const std::vector<EffectTerm>& terms,
        const FitOptions& options) {
  Point point(model, nuisance, terms, options);
  const Eigen::VectorXd weights = event_weights(model, options.count);
  Fit result;
  result.evaluation = options.evaluation ? *options.evaluation : point.evaluate();
  Climb climb(point, weights, result);
  const double start = climb.best();
  const bool finite = std::isfinite(start);
  Reach reach = Reach::one_side;  // It widens where no step rises: one side of a kink promises what is not there.
  result.converged = point.slots().empty() && finite;
  if (!finite) result.reason = "its likelihood is not finite";
  for (int iteration = 0;
       finite && iteration < options.most_iterations + static_cast<int>(reach) && !point.slots().empty(); ++iteration) {
    result.derivatives = iteration == 0 && options.derivatives ? *options.derivatives
                                                               : differences(model, point, result.evaluation, reach);
    const FreeParts parts = parts_by_slopes(point, weights, result);
    if (parts.all.empty()) {
      result.converged = true;
      break;
    }
    if (climb.stays_below(options.to_beat, parts)) {
      result.reason = stays_below;
      break;
    }
    const double resolved = unresolved + unresolved_share * (climb.best() - start);  // promise, by differences
    const Stride stride = climb.stride(parts, resolved, reach);
    result.promised = stride.promised;
    const bool given_up = climb.gives_up(stride, options.to_beat);
    if (given_up || (options.ends_as_foretold && stride.leaves_nothing())) {
      result.converged = !given_up;
      if (given_up) result.reason = stays_below;
      break;
    }
    if (!stride.better && stride.promised >= resolved && reach != Reach::wide) {
      reach = reach == Reach::one_side ? Reach::both_sides : Reach::wide;
      continue;
    }
    climb.damp_next(stride);
    if (!(stride.promised > worth_a_step)) {
      result.converged = std::isfinite(stride.promised);
      if (!result.converged) result.reason = "its information matrix is singular";
      break;
    }
    if (!stride.better) {
      // This is the optimum, up to what the differences resolve.
      result.converged = stride.promised < resolved;
      if (!result.converged) result.reason = "no step along the gradient improves the likelihood";
      break;
    }
  }
  if (!result.converged && result.reason.empty())
    result.reason = "the likelihood was still rising after " + std::to_string(options.most_iterations) + " steps";
  result.nuisance = point.nuisance();
  result.terms = point.terms();
  result.log_likelihood = counted(result.evaluation, weights);
  result.penalised = climb.best();
  return result;
}

std::vector<double> given_values(const TransitionModel& model) {
  constexpr int bits = 10;         // A value that was assumed is found to so many.
  constexpr int most_passes = 10;  // All that were assumed are gone through so often at most.
  int passes = 0;
  std::vector<double> values = nominal_values(model);
  const auto assumed = std::ranges::count_if(model.nuisances(), &Nuisance::assumed);
  double last = std::numeric_limits<double>::infinity(), now = last;
  do {  // The best value of one depends on the others.
    last = now;
    for (std::size_t p = 0; p < values.size(); ++p) {
      const Nuisance& n = model.nuisances()[p];
      if (!n.assumed) continue;
      const double held = values[p];
      const auto cost = [&](double value) {
        values[p] = value;
        double sum = -model.evaluate(values, {}).total();
        for (std::size_t q = 0; q < values.size(); ++q)
          if (model.nuisances()[q].assumed) sum += model.nuisances()[q].cost(values[q]);
        return sum;
      };
      const auto [best, least] = boost::math::tools::brent_find_minima(cost, n.lower, n.upper, bits);
      values[p] = least < now ? best : held;
      now = std::min(now, least);
    }
  } while (assumed > 1 && now < last - unresolved && ++passes < most_passes);
  return values;
}

Fit best_fit(const TransitionModel& model, const std::vector<double>& nuisance, const std::vector<EffectTerm>& terms,
             const FitOptions& options) {
  const std::vector<FitStart> starts = model.starts(terms);
  const auto moved_to = [&](const FitStart& start) {
    std::vector<EffectTerm> moved = terms;
    for (std::size_t i = 0; i < moved.size(); ++i) moved[i].values = start.values[i];
    return moved;
  };
  const bool suffice = std::ranges::any_of(starts, [&](const FitStart& start) {
    return start.alone &&
           model.evaluate(start.nuisance, moved_to(start)).total() > model.evaluate(nuisance, terms).total();
  });
  std::optional<Fit> found;
  if (!suffice) found = fit(model, nuisance, terms, options);
  FitOptions elsewhere = options;
  elsewhere.evaluation = nullptr;
  elsewhere.derivatives = nullptr;
  for (const FitStart& start : starts) {
    if (found) elsewhere.to_beat = found->penalised;
    Fit tried = fit(model, start.nuisance, moved_to(start), elsewhere);
    if (!found || tried.penalised > found->penalised || !std::isfinite(found->penalised)) found = std::move(tried);
  }
  Fit best = std::move(*found);
  if (!starts.empty() && !best.converged && std::isfinite(best.penalised)) {  // the last stretch of the way
    FitOptions longer = elsewhere;
    longer.to_beat = FitOptions{}.to_beat;
    longer.most_iterations *= 3;
    best = fit(model, best.nuisance, best.terms, longer);
  }
  return best;
}

}  // namespace metastable::analysis
