#!/usr/bin/env python3
"""Whether the experiment that `diagnose` proposes next pays: how many trials reach one name, as Markdown.

    tests/benchmarks/next_experiment.py --program build/release/reports/metastable --cases 60 --law published > next.md

Wheels of the virtual laboratory have one or two effects, 20 trials each. Where the answer is a set of causes, the same
experiment and the proposed one are run with 10, 20, ... 640 trials until the members of the set (their effects alone are
considered then) are one name, or one group that acts alike in any experiment: a constant torque, a torque that grows with
speed. Trials of the proposed experiment count as they are, longer ones too. What the first 20 trials said is not used
again. Progress goes to standard error.
"""
import argparse
import concurrent.futures
import json
import math
import os
import random
import subprocess
import sys
import tempfile

FIRST = {"slope_offset": ("offset_deg", 0.1), "rolling_resistance": ("torque_n_m", 0.004),
         "axle_drag_viscous": ("n_m_s", 0.0008), "air_drag": ("n_m_s2", 0.00016), "sensor_bias": ("bias_rad_s", 0.02),
         "speed_dependent_restitution": ("exponent", 0.15), "inertia": ("ratio", 0.01)}
SECOND = {"leg_contact": ("leg=3,friction_ratio", 0.2), "contact_memory": ("correlation", 0.2),
          "friction_patch": ("from_m=0.4,to_m=1.2,friction_ratio", 0.15), "trial_drift": ("relative_change", 0.3)}
RATIOS = {"inertia", "leg_contact", "friction_patch"}  # none at 1, not at 0
GROUPS = [{"slope_offset", "rolling_resistance"}, {"axle_drag_viscous", "air_drag"}]
MOST_TRIALS = 640


def effect(name, table, dice):
    key, size = table[name]
    size *= dice.uniform(1, 3)
    return f"{name}:{key}={(1 if name in RATIOS else 0) + size:.6g}"


def draw_effects(dice):
    names = [dice.choice(sorted(FIRST))]
    effects = [effect(names[0], FIRST, dice)]
    if dice.random() < 0.5:
        names.append(dice.choice(sorted(SECOND)))
        effects.append(effect(names[1], SECOND, dice))
    return names, effects


def draw_case(seed, law):
    dice = random.Random(seed)
    names, effects = draw_effects(dice)
    return {"names": names, "effects": effects, "law": law, "slope_deg": dice.choice([8.0, 9.59]), "launch_rad_s": 5.5,
            "collisions": 10, "drop": dice.random() < 0.7}


def changed(case, changes):
    new = dict(case)
    new["slope_deg"] += changes.get("slope_deg_by", 0)
    new["launch_rad_s"] += changes.get("launch_rad_s_by", 0)
    new["collisions"] = int(new["collisions"] * changes.get("collisions_times", 1))
    new["drop"] = new["drop"] and not changes.get("speeds_after")
    return new


def diagnosed(program, case, trials, seed, catalogue):
    with tempfile.TemporaryDirectory() as place:
        folder, answer = os.path.join(place, "wheel"), os.path.join(place, "answer.json")
        command = [program, "simulate", "--reality", "--law", case["law"], "--slope", case["slope_deg"], "--initial-speed",
                   f"{case['launch_rad_s']:.6g},0.2", "--collisions", case["collisions"], "--ramp-length", "1000",
                   "--restitution", "0.4,0.04", "--friction", "0.4,0.04", "--sensor-noise", 0.01, "--trials", trials,
                   "--seed", seed, "--threads", 1, "--out", folder]
        for one in case["effects"]:
            command += ["--effect", one]
        if case["drop"]:
            command += ["--drop", "omega_plus_rad_s"]
        made = subprocess.run([str(word) for word in command], capture_output=True, text=True)
        if made.returncode != 0:
            raise SystemExit(f"{' '.join(map(str, command))}: exit code {made.returncode}\n{made.stderr}")
        command = [program, "diagnose", folder, "--threads", "1", "--json", answer]
        if catalogue:
            command += ["--catalogue", ",".join(catalogue)]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode != 0:
            return None
        with open(answer) as text:
            return json.load(text)


def effects_of(names):
    return {effect for name in names for effect in name.split("+")}


def is_one_name(causes):
    """Whether causes differ in nothing but members of one group."""
    shared = set.intersection(*(set(name.split("+")) for name in causes))
    rest = [set(name.split("+")) - shared for name in causes]
    if len(causes) == 1:
        return True
    return all(len(one) == 1 for one in rest) and any(set.union(*rest) <= group for group in GROUPS)


def trials_needed(program, case, seed, catalogue):
    """Returns the trials that reach one name, whether it is right, or None."""
    trials = 10
    while trials <= MOST_TRIALS:
        answer = diagnosed(program, case, trials, seed, catalogue)
        causes = answer["cause_set"] if answer and answer["verdict"] in ("explained", "partly_explained") else []
        if causes and is_one_name(causes):
            right = any(effects_of([name]) == set(case["names"]) for name in causes)
            return trials, right
        trials *= 2
    return None, False


def run_case(program, seed, law):
    case = draw_case(seed, law)
    first = diagnosed(program, case, 20, seed, [])
    if not first or first["verdict"] not in ("explained", "partly_explained") or not first["next_experiment"] or \
            is_one_name(first["cause_set"]):
        return None
    proposal = first["next_experiment"][0]
    catalogue = sorted(effects_of(first["cause_set"]))
    same = trials_needed(program, case, seed + 500000, catalogue)
    other = trials_needed(program, changed(case, proposal["changes"]), seed + 700000, catalogue) if proposal["changes"] else same
    known = {kind: one["separation"] for one in first["next_experiment"] if len(one["changes"]) <= 1
             for kind in (one["changes"] or {"same": 0})
             if one["separation"] == max(two["separation"] for two in first["next_experiment"]
                                         if set(two["changes"]) == set(one["changes"]))}
    return {"seed": seed, "law": case["law"], "effects": "+".join(case["names"]), "set": len(first["cause_set"]),
            "change": proposal["change"], "same": same, "other": other, "foretold": proposal["separation"], "by_kind": known}


def times(needed_same, needed_other):
    """The trials of the same experiment in those of the proposed one; what was not reached counts as the next doubling."""
    beyond = 2 * MOST_TRIALS
    return (needed_same or beyond) / (needed_other or beyond)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="build/release/reports/metastable")
    parser.add_argument("--cases", type=int, default=60, help="with a set of causes")
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--law", choices=["published", "settled"], default="published", help="settled takes minutes a case")
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    options = parser.parse_args()
    found, seed = [], options.first_seed
    with concurrent.futures.ThreadPoolExecutor(options.threads) as pool:
        while len(found) < options.cases:
            batch = list(range(seed, seed + options.threads))
            seed += options.threads
            for case in pool.map(lambda one: run_case(options.program, one, options.law), batch):
                if case:
                    found.append(case)
                    print(json.dumps(case), file=sys.stderr, flush=True)
    found = found[:options.cases]
    told = [case for case in found if case["same"][0] or case["other"][0]]
    ratios = sorted(times(case["same"][0], case["other"][0]) for case in told)
    half = sum(ratio >= 2 for ratio in ratios)
    print(f"{len(found)} cases with a set of causes, of {seed - options.first_seed} drawn; one name within {MOST_TRIALS} trials: "
          f"{sum(bool(case['same'][0]) for case in found)} by the same experiment, "
          f"{sum(bool(case['other'][0]) for case in found)} by the proposed one, {len(told)} by either.\n")
    print(f"Of those, the proposed one takes at most half the trials in {half} and more trials in "
          f"{sum(ratio < 1 for ratio in ratios)}; the geometric mean of the ratios is "
          f"{math.exp(sum(map(math.log, ratios)) / max(1, len(ratios))):.1f}, the median {ratios[len(ratios) // 2] if ratios else 1:.0f}.")
    for which, words in (("same", "same"), ("other", "proposed")):
        names = [case[which] for case in found if case[which][0]]
        print(f"The name that the {words} experiment reaches is right in {sum(right for _, right in names)} of {len(names)}.")
    print("\n| change | cases | separation, times the same experiment's (geometric mean) |\n|---|---|---|")
    for kind in ("slope_deg_by", "launch_rad_s_by", "speeds_after", "collisions_times"):
        shares = [case["by_kind"][kind] / case["by_kind"]["same"] for case in found
                  if kind in case["by_kind"] and case["by_kind"].get("same", 0) > 0.01 and case["by_kind"][kind] > 0]
        if shares:
            print(f"| {kind} | {len(shares)} | {math.exp(sum(map(math.log, shares)) / len(shares)):.2f} |")
    best = [case["foretold"] / case["by_kind"]["same"] for case in found if case["by_kind"].get("same", 0) > 0.01]
    print(f"| the one proposed | {len(best)} | {math.exp(sum(map(math.log, best)) / max(1, len(best))):.2f} |")


if __name__ == "__main__":
    main()
