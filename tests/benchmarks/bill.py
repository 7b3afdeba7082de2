#!/usr/bin/env python3
"""What each question costs here and in the best peer, in one run: writes the table of the page Speed.

    cmake --preset release -DMETASTABLE_BENCHMARKS=ON && cmake --build --preset release
    PYTHONPATH=build/release/reports/python tests/benchmarks/bill.py --build build/release --out bill.csv

Seconds are of one core's processor time, here and there, taken one after the other in this run; the ratio is the peer's
seconds over those here (of walkers also that of the calls of the map). --only takes questions by words of theirs."""

import argparse
import csv
import importlib.util
import itertools
import math
import os
import time

import sparse_chains  # before NumPy, whose threads it limits

import numpy as np
import scipy
import scipy.optimize

import compare
import metastable
from metastable import _metastable

BENCH = "bill.py --only"


def cpu(call):
    began = time.process_time()
    answer = call()
    return answer, time.process_time() - began


def rounded(ratio):
    return f"{float(f'{ratio:.2g}'):g}"


def line(question, here, peer, ratio, words):
    return [question, here, peer, rounded(ratio) if isinstance(ratio, float) else ratio, f"`{BENCH} {words}`"]


def sampled_and_integrated(build):
    """The paper's wheel, and a full chain, as `compare.py` does them."""
    program = os.path.join(build, "tests/benchmarks/benchmarks")
    best = compare.google_benchmark(program, "sampled_chain/cells:1000/samples:100000/legs:1/threads:1|"
                                             "first_passage/states:2000/threads:1|expected_steps")

    def seconds(name):
        return next(compare.milliseconds(one, "cpu_time") for run, one in best.items() if run.startswith(name)) / 1e3
    _, numpy_seconds, _ = compare.numpy_chain()
    _, lu, error = compare.scipy_lu(2000, 1)
    for question, name, digits, peer, theirs in (
            ("rows of a sampled chain, 1000 cells x 100,000 samples", "sampled_chain", "", "NumPy", numpy_seconds),
            ("expected steps of the paper's wheel", "expected_steps", ", 8 digits", "NumPy's sampled chain, 2 digits",
             numpy_seconds),
            ("first passage, full chain of 2000 states, 1e9 steps", "first_passage", ", error 1e-15",
             f"SciPy's LU, error {error:.0e}", lu)):
        yield line(question, f"{seconds(name):.3f} s{digits}", f"{theirs:.2f} s, {peer}", theirs / seconds(name), "wheel")


def own_chains(states, wanted):
    """Sparse random chains: first with SciPy's elimination, then too large for it."""
    n, direct = states
    for name, matrix, kill in sparse_chains.chains(n, np.random.default_rng(n)):
        if name not in wanted:
            continue
        chain, peer = metastable.chain(matrix, kill, threads=1), sparse_chains.Peer(matrix, kill, direct)
        for question, seconds, bound, way, theirs, off in sparse_chains.asked(chain, peer, 60, wanted[name]):
            here = "refused" if seconds is None else f"{seconds:.2f} s" + (f", proven to {bound:.0e}" if bound else "")
            there = "none" if theirs is None else f"{theirs:.2f} s, off by {off:.0e}"
            known = " (distribution known)" if question == "survival" else ""
            yield line(f"{question}{known}, {n:,} states, {name}", here, f"{there}, {way}",
                       theirs / seconds if seconds and theirs else "none", "chains")


class Counted:
    """The step of a walker of the toolkit, counting the states it is asked to step."""

    def __init__(self, setting):
        self.fields, self.calls = metastable._fields(setting), 0
        self.mean, self.sd = setting.slope_deg, setting.slope_sd_deg

    def __call__(self, state, noise):
        self.calls += len(state)
        return _metastable.step_walkers(self.fields, state, self.mean + self.sd * noise[:, 0])


def walkers(settings):
    """Built-in walkers: what an interval takes, against direct simulation for as narrow a one, whose seconds a step are
    measured on some walks and scaled. Steps before failure scatter by as much as their mean."""
    for name, slope, sd, method in settings:
        setting = metastable.WalkerSetting(name, sd, slope)
        study, seconds = cpu(lambda: metastable.study(setting, method=method, threads=1, progress=False))
        mean, (low, high) = study.expected_steps.value, study.expected_steps.interval_95
        if method == "splitting":
            calls = study.steps_of_the_map
        else:
            counted = Counted(setting)
            metastable.study(metastable.walker(counted, len(study.gait.state), 1, start=study.gait.state), threads=1,
                             progress=False)
            calls = counted.calls
        needed = (1.96 * 2 * mean / (high - low)) ** 2 * mean
        walks, walking = cpu(lambda: metastable.simulate(setting, trials=max(20, round(20000 / min(mean, 1000))), threads=1,
                                                         progress=False))
        direct = walking / sum(walks.steps) * needed
        yield line(f"steps of {name}, slope sd {sd:g} deg: {mean:.3g} within {50 * (high - low) / mean:.2g} %",
                   f"{seconds:.1f} s, {calls:.1e} steps, {method}", f"{direct:.1e} s, {needed:.1e} steps, direct simulation",
                   f"{rounded(direct / seconds)} ({rounded(needed / calls)} of steps)", "walkers")


def swing(state, noise, p):
    now = state[:, 0]
    after = p["decay"] * now - p["loss_rad"] - p["per_rad"] * now ** 2 - p["per_swing"] * now ** 3
    return (after + p["scatter_rad"] * noise[:, 0])[:, None], np.zeros(len(now), bool)


EFFECTS = {"dry_friction": {"loss_rad": (0, 0, 0.05)}, "quadratic_drag": {"per_rad": (0, 0, 0.5)},
           "cubic_drag": {"per_swing": (0, 0, 0.5)}}
PENDULUM = {"decay": (0.975, 0.01), "scatter_rad": (0.003, 0.003, 0, 0.1)}


def swings(loss, seed):
    """Trials and turning points of a pendulum whose pivot takes `loss` of every swing."""
    rng, trial, seen = np.random.default_rng(seed), [], []
    for t in range(40):
        now = 0.8 + 0.05 * rng.normal()
        for _ in range(24):
            trial.append(t)
            seen.append(now + 0.0005 * rng.normal())
            now = 0.975 * now - loss + 0.003 * rng.normal()
    return np.array(trial), np.array(seen)


def selected(trial, seen):
    """Forward selection by AICc, least squares of one swing from the last by Gauss and Newton with trust regions."""
    inside = trial[1:] == trial[:-1]
    now, after = seen[:-1][inside, None], seen[1:][inside]
    neutral = {name: bounds[0] for effect in EFFECTS.values() for name, bounds in effect.items()}

    def aicc(effects):
        free = [name for effect in effects for name in EFFECTS[effect]]
        best = scipy.optimize.least_squares(
            lambda x: after - swing(now, np.zeros((len(now), 1)), {**neutral, "scatter_rad": 0, "decay": x[0],
                                                                   **dict(zip(free, x[1:]))})[0][:, 0],
            [0.975] + [0.0] * len(free), x_scale="jac")
        k = len(free) + 2
        return len(after) * math.log(2 * best.cost / len(after)) + 2 * k * len(after) / (len(after) - k - 1)
    chosen, least = [], aicc([])
    while len(chosen) < 2:
        tried = {effect: aicc(chosen + [effect]) for effect in EFFECTS if effect not in chosen}
        best = min(tried, key=tried.get)
        if tried[best] >= least:
            break
        chosen, least = chosen + [best], tried[best]
    return chosen


def diagnosis(folders):
    """A pendulum of one's own, half with a dry pivot and half without a gap: seconds, and how many are told rightly."""
    machine = metastable.machine(swing, states=["swing_rad"], noise=1, parameters=PENDULUM, effects=EFFECTS,
                                 may_vary=["decay"], sensor={"swing_rad": 0.0005})
    data = [(["dry_friction"] if loss else [], *swings(loss, seed)) for seed in range(folders) for loss in (0, 0.004)]

    def diagnosed(trial, seen):
        answer = metastable.diagnose(metastable.runs(machine, trial=trial, swing_rad=seen), machine, threads=1,
                                     progress=False)
        return [] if answer.verdict in ("no_gap", "recalibrate") else [e for one in answer.at_work[:1] for e in one.effects]
    here, seconds = cpu(lambda: [diagnosed(trial, seen) for _, trial, seen in data])
    there, theirs = cpu(lambda: [selected(trial, seen) for _, trial, seen in data])

    def right(told):
        return f"{sum(one == truth for one, (truth, *_) in zip(told, data))} of {len(data)} right"
    yield line("what a pendulum of one's own lacks", f"{seconds / len(data):.2f} s, {right(here)}",
               f"{theirs / len(data):.3f} s, {right(there)}, Gauss-Newton with AICc", theirs / seconds, "diagnosis")


def deeptime():
    there = importlib.util.find_spec("deeptime") is not None
    yield ["chains, against deeptime", "", "installed, and not compared" if there else "not installed", "", ""]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", default="build/release")
    parser.add_argument("--out", default="bill.csv")
    parser.add_argument("--only", nargs="+", default=["wheel", "chains", "walkers", "diagnosis"])
    given = parser.parse_args()
    began, every = sum(os.times()[:4]), []
    everywhere = ["first passage", "quasi-stationary", "committor", "survival"]
    parts = {
        "wheel": lambda: sampled_and_integrated(given.build),
        "chains": lambda: itertools.chain(
            own_chains((4000, True), {"random, kill 1e-12": ["first passage", "quasi-stationary"]}),
            own_chains((100000, False), {"random, kill 1e-06": everywhere}), deeptime()),
        "walkers": lambda: walkers([("simplest", 0.5156620156, 0.0458, "mesh"), ("simplest", 0.5156620156, 0.0225, "mesh"),
                                    ("simplest", 0.5156620156, 0.0225, "splitting"), ("compass", 3, 0.458, "mesh"),
                                    ("compass", 3, 0.2108, "splitting"), ("biped", 1, 0.68, "splitting")]),
        "diagnosis": lambda: diagnosis(5)}
    for part in given.only:
        for row in parts[part]():
            print(" | ".join(row), flush=True)
            every.append(row)
    with open(given.out, "w", newline="") as out:
        csv.writer(out, lineterminator="\n").writerows([["question", "here", "best peer", "ratio", "command"], *every])
    print(f"{sum(os.times()[:4]) - began:.0f} s of processor time; NumPy {np.__version__}, SciPy {scipy.__version__}, BLAS "
          f"{compare.blas_name()}")


if __name__ == "__main__":
    main()
