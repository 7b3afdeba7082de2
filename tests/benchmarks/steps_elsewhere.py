#!/usr/bin/env python3
"""Whether the expected steps on another slope or from another launch hold: intervals of `diagnose --at-slope` and
`--at-speed` against many trials of the same wheel there, in the virtual laboratory.

    tests/benchmarks/steps_elsewhere.py --program build/release/reports/metastable --cases 20 --law published

Each wheel has one effect or two of the catalogue, 80 trials on a slope of 9.59 deg, and 3000 where it is asked about.
Prints each case, then how many intervals hold the count and their widths beside those of the count of the first trials.
"""
import argparse
import csv
import json
import math
import os
import random
import subprocess
import tempfile

from next_experiment import draw_effects

HERE = {"slope": 9.59, "speed": 5.5}


def simulated(program, folder, case, place, trials, seed):
    command = [program, "simulate", "--reality", "--law", case["law"], "--slope", place["slope"], "--initial-speed",
               f"{place['speed']:.6g},0.2", "--collisions", 30, "--ramp-length", "1000", "--restitution", "0.5,0.06",
               "--friction", "0.36,0.05", "--trials", trials, "--seed", seed, "--threads", 1, "--out", folder]
    for one in case["effects"]:
        command += ["--effect", one]
    subprocess.run([str(word) for word in command], capture_output=True, check=True)


def counted(folder):
    with open(os.path.join(folder, "trials.csv")) as text:
        rests = sum(row["outcome"] == "rest" for row in csv.DictReader(text))
    with open(os.path.join(folder, "collisions.csv")) as text:
        collisions = sum(1 for _ in text) - 1
    return collisions, rests


def run_case(program, law, seed):
    dice = random.Random(seed)
    case = {"law": law, "effects": draw_effects(dice)[1]}
    there = dict(HERE)
    if dice.random() < 0.5:
        there["slope"] += dice.choice([-1.2, -0.6, 0.6])
        asked = ["--at-slope", f"{there['slope']:.6g}"]
    else:
        there["speed"] += dice.choice([-1.0, -0.5, 0.8])
        asked = ["--at-speed", f"{there['speed']:.6g}"]
    with tempfile.TemporaryDirectory() as work:
        folder, answer, other = (os.path.join(work, name) for name in ("here", "answer.json", "there"))
        simulated(program, folder, case, HERE, 80, seed)
        simulated(program, other, case, there, 3000, seed + 1000000)
        subprocess.run([program, "diagnose", folder, "--threads", "1", "--json", answer] + asked, capture_output=True,
                       check=True)
        with open(answer) as text:
            said = json.load(text)
        collisions, rests = counted(other)
        _, rests_here = counted(folder)
    steps = [one for one in said["steps_before_failure"]["machine"] if one["where"] != "as measured"]
    if not steps or rests < 30:
        return f"{case['effects']}, {' '.join(asked)}: {said['verdict']}, {rests} rests there, not judged", None
    low, high = (math.inf if end == "infinite" else end for end in steps[0]["interval_90"])
    truth = collisions / rests
    spread = 1 / math.sqrt(rests)  # the count's own error
    holds = low * (1 - spread) <= truth <= high * (1 + spread)
    width = math.log(high / low) if math.isfinite(high) else math.inf
    of_count = 2 * 1.645 / math.sqrt(max(1, rests_here))
    return (f"{case['effects']}, {' '.join(asked)}: {said['verdict']}, {low:.3g} to {high:.3g}, counted {truth:.3g} "
            f"({rests} rests; {rests_here} here){'' if holds else ', MISSED'}"), (holds, width / of_count)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", required=True)
    parser.add_argument("--cases", type=int, default=20)
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--law", choices=["published", "settled"], default="published")
    options = parser.parse_args()
    judged = []
    for seed in range(options.first_seed, options.first_seed + options.cases):
        line, found = run_case(options.program, options.law, seed)
        print(f"{seed}: {line}", flush=True)
        if found:
            judged.append(found)
    widths = sorted(width for _, width in judged)
    if judged:
        print(f"{sum(holds for holds, _ in judged)} of {len(judged)} intervals hold; the middle one is "
              f"{widths[len(widths) // 2]:.2f} times as wide as a count of the first trials would be there")


if __name__ == "__main__":
    main()
