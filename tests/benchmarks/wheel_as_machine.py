#!/usr/bin/env python3
"""Brings the wheel as a user would bring any machine, as a simulator in NumPy, and diagnoses its experiment folders.

    tests/benchmarks/wheel_as_machine.py --python build/release/reports/python FOLDER...

The law is `published`, for feet that do not slide before they land. Restitution and friction are two noises, legs are
phases, slopes and places are inputs. Each folder takes some minutes. The table says what `metastable.diagnose` says of
the machine, beside what it says of the folder.
"""

import argparse
import csv
import sys
import time
import tomllib
from pathlib import Path

import numpy as np

G, STIFFNESS = 9.81, 9000.0


def wheel(legs, mass, inertia):
    """Returns the step from one speed before a collision to the next."""
    length = np.asarray(legs)
    angle = 2 * np.pi / len(length)

    def triangle(one, other):
        chord = np.sqrt(one**2 + other**2 - 2 * one * other * np.cos(angle))
        return chord, one * other * np.sin(angle) / chord

    def step(states, scores, p):
        eta = np.clip(p["restitution"] + p["restitution_sd"] * scores[:, 0], 1e-3, 0.999)
        mu = np.maximum(p["friction"] + p["friction_sd"] * scores[:, 1], 1e-3)
        along = p["at_m"] / 0.915 - 1  # a sagging stretch of 1.83 m
        sag = np.where(np.abs(along) <= 1, -2 * p["sag_m"] / 0.915 * along, 0)
        gamma = np.deg2rad(p["slope_deg"]) + sag
        leg = np.asarray(p["leg"]).astype(int)
        landing, following = length[leg], length[(leg + 1) % len(length)]
        chord, height = triangle(length[leg - 1], landing)
        beta = np.arcsin(height / landing)
        ahead, speed, tau = landing * np.cos(beta), states[:, 0] * chord, 1 + eta
        normal = mass * landing**2 / (landing**2 + ahead**2 - mu * ahead * height)
        ratio = normal * (landing**2 + height**2 - ahead * height / mu) / (mass * landing**2)
        impulse = speed * normal
        lost = speed * tau * impulse * (2 - tau) / 2
        slid = speed * mu**2 * ratio * tau**2 * impulse / 2
        damping = np.log(eta)
        rebound = np.pi / np.sqrt(STIFFNESS / mass * np.pi**2 / (np.pi**2 + damping**2))
        lost = lost + slid + mass * G * slid * rebound / (tau * impulse) * np.sin(gamma)
        after = states[:, 0] ** 2 - 2 * lost / inertia
        _, next_height = triangle(landing, following)
        fall = np.sin(beta + gamma) - np.sin(np.arcsin(next_height / landing) - gamma)
        barrier = np.maximum(0, mass * G * landing * (1 - np.sin(beta + gamma)))
        following_squared = after + 2 / inertia * mass * G * landing * fall
        return np.sqrt(np.maximum(following_squared, 1e-6))[:, None], inertia * after / 2 < barrier

    return step


def diagnosed(metastable, folder):
    """Diagnoses a folder through the machine's door; returns the answer, seconds, calls and rows."""
    setting = tomllib.loads((folder / "experiment.toml").read_text())
    rows = list(csv.DictReader((folder / "collisions.csv").open()))
    outcome = {t["trial"]: "failed" if t["outcome"] == "rest" else "stopped"
               for t in csv.DictReader((folder / "trials.csv").open())}
    slope = {c["id"]: c["slope_deg"] for c in setting["condition"]}
    own, contact = setting["wheel"], setting["contact"]
    mass, legs = own["hub_mass_kg"], own["leg_lengths_m"]
    simulated = wheel(legs, mass, own.get("inertia_kg_m2", mass * np.mean(legs) ** 2))
    asked = [0, 0]

    def counted(states, scores, p):
        asked[0] += 1
        asked[1] += len(states)
        return simulated(states, scores, p)

    eta, mu = contact["restitution"], contact["friction"]
    machine = metastable.machine(
        counted, states=["omega"], noise=2,
        parameters={"restitution": (eta["mean"], 0.02), "restitution_sd": (eta["sd"], 0.01, 0.001, 0.3),
                    "friction": (mu["mean"], 0.02), "friction_sd": (mu["sd"], 0.01, 0.001, 0.3)},
        effects={"slope_profile": {"sag_m": (0, -0.05, 0.05)}},
        may_vary=["friction", "restitution"], inputs=["slope_deg", "leg", "at_m"],
        sensor={"omega": (setting["sensor"]["noise_sd_rad_s"], 0)})
    runs = metastable.runs(
        machine, trial=[r["trial"] for r in rows], omega=[float(r["omega_minus_rad_s"]) for r in rows],
        condition=[r["condition"] for r in rows], phase=[r["leg"] for r in rows],
        position_m=[float(r["position_m"]) for r in rows], outcome=outcome,
        inputs={"slope_deg": [slope[r["condition"]] for r in rows], "leg": [float(r["leg"]) for r in rows],
                "at_m": [float(r["position_m"]) for r in rows]})
    start = time.process_time()
    return metastable.diagnose(runs, machine), time.process_time() - start, *asked


def causes(answer):
    """Names what is likelier at work than not."""
    return "+".join("/".join(one.effects) for one in answer.at_work if one.probability > 0.5) or "none"


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--python", required=True, help="folder of the package metastable")
    options.add_argument("folders", nargs="+", type=Path)
    given = options.parse_args()
    sys.path.insert(0, given.python)
    import metastable
    print("folder,verdict of the machine,its causes,seconds,calls,rows,verdict of the folder,its causes")
    for folder in given.folders:
        answer, seconds, calls, rows = diagnosed(metastable, folder)
        own = metastable.diagnose(str(folder))
        print(f"{folder.name},{answer.verdict},{causes(answer)},{seconds:.0f},{calls},{rows},"
              f"{own.verdict},{causes(own)}", flush=True)


if __name__ == "__main__":
    main()
