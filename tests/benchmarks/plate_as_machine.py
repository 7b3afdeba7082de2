#!/usr/bin/env python3
"""Diagnoses a heated plate in NumPy whose model has one time constant: what is said of what the model lacks.

    tests/benchmarks/plate_as_machine.py wall --python build/release/reports/python [--seeds 0,1]

20 trials of 60 rows are drawn of a plate with a heater that switches now and then, and one of these:
    none         what the model has
    wall         a wall with a time constant of 19.5 rows draws the plate back by 0.08 of their distance a row
    slow         the heater has a time constant of 1.96 rows
    late         the heater acts one row late
    memory       the noise remembers: a correlation of 0.5
    saturated    the heater takes 3.5 of 5 V at most; no effect is that
    dead         the heater does nothing below 0.5 V; no effect is that
Trials begin anew, or ("cut") are one run that was cut by its clock.
"""

import argparse
import sys
import time

import numpy as np

KINDS = ("none", "wall", "slow", "late", "memory", "saturated", "dead")


def draw(kind, seed, cut, trials=20, rows=60):
    """Returns the columns of the runs, and the recorded voltage of the heater."""
    rng = np.random.default_rng(seed)
    columns, volts = {"temp_c": [], "trial": [], "time_s": []}, []
    noise = 0.0
    for trial in range(trials):
        if not cut or trial == 0:
            plate = wall = 25 + 5 * rng.normal()
            given = []
        volt = rng.uniform(0, 5)
        for row in range(rows):
            if rng.random() < 0.1:
                volt = rng.uniform(0, 5)
            given.append(volt)
            volts.append(volt)
            columns["temp_c"].append(plate + 0.02 * rng.normal())
            columns["trial"].append(trial)
            columns["time_s"].append(trial * rows + row if cut else 1000 * trial + row)
            slow = volt if len(given) == 1 else slow + 0.4 * (volt - slow)
            heat = {"slow": slow, "late": given[-2:][0], "saturated": min(volt, 3.5),
                    "dead": max(volt - 0.5, 0)}.get(kind, volt)
            fresh = rng.normal()
            noise = 0.5 * noise + np.sqrt(0.75) * fresh if kind == "memory" else fresh
            drawn_back = 0.08 * (wall - plate) if kind == "wall" else 0
            wall += 0.05 * (plate - wall)
            plate = 25 + 0.93 * (plate - 25) + 0.6 * heat + drawn_back + 0.05 * noise
    return columns, volts


def step(state, noise, p):
    """The model: one time constant, and a heater that acts at once."""
    plate = 25 + p["keep"] * (state[:, 0] - 25) + p["gain"] * p["heat_v"] + p["scatter_c"] * noise[:, 0]
    return plate[:, None], np.zeros(len(plate), bool)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("kind", choices=KINDS)
    parser.add_argument("--python", metavar="PYTHON", help="folder of the module, build/release/reports/python")
    parser.add_argument("--seeds", metavar="N,N", default="0,1")
    options = parser.parse_args()
    if options.python:
        sys.path.insert(0, options.python)
    import metastable

    plate = metastable.machine(
        step, states=["temp_c"], noise=1, name="a plate",
        parameters={"keep": (0.93, 0.02, 0, 1), "gain": (0.6, 0.1), "scatter_c": (0.05, 0.05, 1e-4, 1)},
        may_vary=["gain"], sensor={"temp_c": 0.02}, inputs=["heat_v"])
    for seed in map(int, options.seeds.split(",")):
        for cut in (False, True):
            columns, volts = draw(options.kind, seed, cut)
            began = time.time()
            answer = metastable.diagnose(metastable.runs(plate, columns, inputs={"heat_v": volts}), plate)
            named = {one.name: {name: round(value, 3) for name, value in one.parameters.to_dict().items()}
                     for one in answer.at_work if one.probability >= 0.8}
            print(f"{options.kind}, seed {seed}{', cut' if cut else ''}: {answer.verdict} {named}, something unnamed "
                  f"{answer.p_unnamed:.2f}, {time.time() - began:.0f} s", flush=True)


if __name__ == "__main__":
    main()
