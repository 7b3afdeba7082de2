#!/usr/bin/env python3
"""Diagnoses a compass gait in NumPy, as a user would bring it: what is said, and what it asks of the simulator.

    tests/benchmarks/compass_as_machine.py --python build/release/reports/python [--gap lost=0.003]

The simulator integrates both legs by Runge-Kutta and knows a slope that scatters from step to step, a damped hip and a
loss at heel strike. 100 trials of 20 steps are drawn from it with the gap asked for, and their three states measured
with errors. A line says the verdict, the effects at work, seconds, calls and rows.
"""

import argparse
import sys
import time

import numpy as np

LEG, HIP, FOOT_TO_MASS, MASS_TO_HIP, G = 5.0, 10.0, 0.5, 0.5, 9.81
LENGTH = FOOT_TO_MASS + MASS_TO_HIP
GAIT = np.array([0.27103, -1.09238, -0.37737])  # half angle [rad], stance and swing rate [rad/s] on 3 degrees
SENSOR = {"half_angle_rad": 0.001, "stance_rate": 0.005, "swing_rate": 0.01}
STEP_S, MOST_STEPS = 0.02, 150
GAPS = {"slope": 0.05236, "scatter": 0.004, "leg_mass": LEG, "hip_damping": 0.0, "lost": 0.0}


def motion(legs, slope, damping, mass):
    """Returns the rates of (stance angle, swing angle, their rates), by the equations of Lagrange."""
    stance, swing, stance_rate, swing_rate = legs
    cosine, sine = np.cos(stance - swing), np.sin(stance - swing)
    about_foot = (HIP + mass) * LENGTH**2 + mass * FOOT_TO_MASS**2
    about_hip, coupling = mass * MASS_TO_HIP**2, mass * LENGTH * MASS_TO_HIP
    torque = damping * (stance_rate - swing_rate)
    falls = G * (HIP * LENGTH + mass * (FOOT_TO_MASS + LENGTH)) * np.sin(stance - slope)
    on_stance = coupling * sine * swing_rate**2 + falls - torque
    on_swing = torque - coupling * sine * stance_rate**2 - G * mass * MASS_TO_HIP * np.sin(swing - slope)
    determinant = about_foot * about_hip - (coupling * cosine) ** 2
    return np.array([stance_rate, swing_rate, (about_hip * on_stance + coupling * cosine * on_swing) / determinant,
                     (coupling * cosine * on_stance + about_foot * on_swing) / determinant])


def hermite(share, before, rate_before, after, rate_after):
    """Returns the cubic with these values and rates (a step) at both ends."""
    s2, s3 = share**2, share**3
    return ((2 * s3 - 3 * s2 + 1) * before + (s3 - 2 * s2 + share) * rate_before + (3 * s2 - 2 * s3) * after
            + (s3 - s2) * rate_after)


def hermite_rate(share, before, rate_before, after, rate_after):
    """Returns the rate of that cubic."""
    s2 = share**2
    return ((6 * s2 - 6 * share) * (before - after) + (3 * s2 - 4 * share + 1) * rate_before
            + (3 * s2 - 2 * share) * rate_after)


def strike(legs, mass, lost):
    """Returns the state after both feet stand: angular momenta about the struck foot and about the hip are kept."""
    half, stance, swing = legs[1], legs[2], legs[3]
    cosine = np.cos(2 * half)
    momentum = (HIP * LENGTH**2 * cosine * stance
                + mass * FOOT_TO_MASS * (LENGTH * cosine * stance - MASS_TO_HIP * swing)
                + mass * FOOT_TO_MASS * stance * (LENGTH * cosine - MASS_TO_HIP))
    carried = (LENGTH * cosine - MASS_TO_HIP) * FOOT_TO_MASS * stance
    inertia = (HIP * LENGTH**2 + mass * FOOT_TO_MASS**2 + mass * LENGTH * (LENGTH - MASS_TO_HIP * cosine)
               - mass * (LENGTH * cosine - MASS_TO_HIP) * LENGTH * cosine)
    new_stance = (momentum - mass * carried) / inertia
    new_swing = (LENGTH * cosine * new_stance - FOOT_TO_MASS * stance) / MASS_TO_HIP
    kept = np.sqrt(1 - lost)
    return np.stack([half, kept * new_stance, kept * new_swing], axis=1)


class Asked:
    """Counts what is asked of the simulator."""

    calls = rows = 0
    seconds = 0.0


def step(state, noise, p):
    began, n = time.perf_counter(), len(state)
    Asked.calls, Asked.rows = Asked.calls + 1, Asked.rows + n
    slope = np.broadcast_to(p["slope"] + p["scatter"] * noise[:, 0], n)
    damping, mass, lost = (np.broadcast_to(p[name], n) for name in ("hip_damping", "leg_mass", "lost"))
    legs = np.array([state[:, 0], -state[:, 0], state[:, 1], state[:, 2]])
    after, failed, at = np.full((n, 3), np.nan), np.ones(n, bool), np.arange(n)
    for _ in range(MOST_STEPS):
        given = slope[at], damping[at], mass[at]
        first = motion(legs, *given)
        second = motion(legs + STEP_S / 2 * first, *given)
        third = motion(legs + STEP_S / 2 * second, *given)
        fourth = motion(legs + STEP_S * third, *given)
        later = legs + STEP_S / 6 * (first + 2 * second + 2 * third + fourth)
        struck = (later[0] < 0) & (legs[0] + legs[1] > 0) & (later[0] + later[1] <= 0)
        if struck.any():
            who = at[struck]
            ends = (legs[:, struck], STEP_S * first[:, struck], later[:, struck],
                    STEP_S * motion(later[:, struck], slope[who], damping[who], mass[who]))
            gap = [end[0] + end[1] for end in ends]
            share = gap[0] / (gap[0] - gap[2])
            for _ in range(4):
                share = np.clip(share - hermite(share, *gap) / hermite_rate(share, *gap), 0, 1)
            after[who] = strike(hermite(share, *ends), mass[who], lost[who])
            failed[who] = ~((after[who, 0] > 0) & (after[who, 0] < np.pi / 2))
        goes_on = ~struck & (np.abs(later[0]) < np.pi / 2)
        if not goes_on.any():
            break
        legs, at = later[:, goes_on], at[goes_on]
    Asked.seconds += time.perf_counter() - began
    return after, failed


def walks(values, trials=100, steps=20, seed=1):
    """Draws trials; returns the trial of each row, and its states with errors of measurement."""
    rng = np.random.default_rng(seed)
    state, alive, trial, seen = np.tile(GAIT, (trials, 1)), np.ones(trials, bool), [], []
    for _ in range(steps):
        trial.append(np.flatnonzero(alive))
        seen.append(state[alive] + rng.normal(size=(alive.sum(), 3)) * list(SENSOR.values()))
        state, fell = step(state, rng.normal(size=(trials, 1)), values)
        alive &= ~fell
        state[~alive] = GAIT
    trial, seen = np.concatenate(trial), np.concatenate(seen)
    order = np.argsort(trial, kind="stable")
    return trial[order], seen[order]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--python", help="folder of the module, build/release/reports/python")
    parser.add_argument("--gap", action="append", default=[], metavar="NAME=VALUE", help=f"one of {', '.join(GAPS)}")
    options = parser.parse_args()
    values = dict(GAPS)
    for entry in options.gap:
        name, _, value = entry.partition("=")
        if name not in GAPS:
            parser.error(f"--gap: {name} is none of {', '.join(GAPS)}")
        try:
            values[name] = float(value)
        except ValueError:
            parser.error(f"--gap: {name}: '{value}' is no number")
    if options.python:
        sys.path.insert(0, options.python)
    import metastable

    machine = metastable.machine(
        step, states=list(SENSOR), noise=1, name="a compass gait",
        parameters={"slope": (0.05236, 0.003), "scatter": (0.004, 0.002, 0.0003, 0.03), "leg_mass": (LEG, 0.05, 3, 7)},
        effects={"hip_damping": {"hip_damping": (0, -0.5, 2)}, "impact_loss": {"lost": (0, 0, 0.2)}},
        may_vary=["slope"], sensor=SENSOR)
    trial, seen = walks(values)
    runs = metastable.runs(machine, dict(zip(SENSOR, seen.T)), trial=trial)
    Asked.calls, Asked.rows, Asked.seconds, began = 0, 0, 0.0, time.perf_counter()
    answer = metastable.diagnose(runs, machine)
    print(f"{answer.verdict}: {[(one.effects, round(one.probability, 2)) for one in answer.at_work]}")
    print(f"{time.perf_counter() - began:.0f} s, of the simulator {Asked.seconds:.0f}; {Asked.calls} calls, "
          f"{Asked.rows / 1e6:.1f} million rows")


if __name__ == "__main__":
    main()
