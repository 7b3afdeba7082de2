#!/usr/bin/env python3
"""What `diagnose` says of wheels in an engine of soft contact: answers the folders that soft_wheels wrote, and grades.

    soft_wheels.py answer RUN PROGRAM           RUN/case-NN -> RUN-answers/case-NN.json, two at a time;
                                                again for those that came later
    soft_wheels.py grade RUN CSV [STEPS]        needs all answers; opens RUN-sealed; STEPS: lines of `soft_wheels steps`

An effect is at work where its group has probability 0.8. The engine's own contact, soft_contact or restitution that
depends on speed, is kept apart from false names.
"""

import csv
import json
import math
import pathlib
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

OWN = {"soft_contact", "speed_dependent_restitution"}
NO_NAME_IN_CATALOGUE = {"loose_weight", "yielding_ramp", "magnet", "gust"}
SIZE = {"leg_contact": ("friction_ratio", "restitution_ratio"), "slope_offset": ("offset_deg",), "slope_profile": ("sag_m",),
        "rolling_resistance": ("torque_n_m",), "axle_drag_viscous": ("n_m_s",), "trial_drift": ("relative_change",),
        "contact_memory": ("correlation",)}


def cases_of(run):
    return sorted(f for f in run.iterdir() if f.suffix != ".part")


def answer(run, program):
    out = pathlib.Path(f"{run}-answers")
    out.mkdir(exist_ok=True)

    def one(folder):
        to = out / f"{folder.name}.json"
        part = to.with_suffix(".part")
        done = subprocess.run(["nice", program, "diagnose", folder, "--threads", "1", "--json", part],
                              capture_output=True, text=True, timeout=900)
        if done.returncode == 0:
            part.rename(to)
        print(folder.name, done.returncode, done.stderr.strip(), flush=True)

    with ThreadPoolExecutor(2) as pool:
        list(pool.map(one, (f for f in cases_of(run) if not (out / f"{f.name}.json").exists())))


def size_inside(effect, said):
    """Whether every size of an effect lies in its interval; None where the answer is not of this effect."""
    if effect["effect"] not in said["effects"] or said["name"] != effect["effect"]:
        return None
    names = [n for n in SIZE.get(effect["effect"], ()) if n in effect["parameters"]]
    if not names or any(n not in said["interval_90"] for n in names):
        return None
    if said["parameters"].get("leg") != effect["parameters"].get("leg"):
        return False
    return all(said["interval_90"][n][0] <= effect["parameters"][n] <= said["interval_90"][n][1] for n in names)


def row_of(case, truth, told, counted):
    named = [one for one in told["at_work"] if one["probability"] >= 0.8]
    true = truth["effects"]
    catalogue = [e for e in true if e["effect"] not in NO_NAME_IN_CATALOGUE]
    hit = [e for e in catalogue if any(e["effect"] in one["effects"] for one in named)]
    ids = {e["effect"] for e in catalogue}
    false = [one["name"] for one in named if not ids & set(one["effects"]) and not OWN & set(one["effects"])]
    own = [one for one in named if OWN & set(one["effects"]) and not ids & set(one["effects"])]
    sizes = [size_inside(e, one) for e in catalogue for one in named]
    sizes = [s for s in sizes if s is not None]
    soft = next((one for one in own if one["name"] == "soft_contact"), None)
    interval = soft["interval_90"].get("stiffness_n_m") if soft else None
    here = next((one for one in told["steps_before_failure"].get("machine", []) if one["where"] == "as measured"), None)
    row = {"case": case, "kind": truth["kind"],
           "truth": " + ".join(e["effect"] + " " + " ".join(f"{v:.3g}" for v in e["parameters"].values()) for e in true),
           "times": truth["times"], "stiffness": f"{truth['stiffness_n_m']:.2g}", "verdict": told["verdict"],
           "named": "; ".join(f"{one['name']} {one['probability']:.2f}" for one in named),
           "true named": f"{len(hit)}/{len(catalogue)}", "false": len(false),
           "size inside": f"{sum(sizes)}/{len(sizes)}" if sizes else "",
           "own": " ".join(one["name"] for one in own) or "",
           "stiffness said": f"{interval[0]:.2g} to {interval[1]:.2g}" if interval else "",
           "closed %": "" if told["shrinkage"]["closed"] is None else round(100 * told["shrinkage"]["closed"]),
           "steps": "", "steps_low": "", "steps_high": "", "counted": "", "counted_sd": "", "away": ""}
    if here:
        row.update(steps=f"{here['steps']:.3g}", steps_low=f"{here['interval_90'][0]:.3g}",
                   steps_high=f"{here['interval_90'][1] or math.inf:.3g}")
        if case in counted and here["interval_90"][1]:
            collisions, rests = counted[case]
            low, high = here["interval_90"]
            error = math.hypot((math.log(high) - math.log(low)) / 3.29, 1 / math.sqrt(max(1, rests)))
            row.update(counted=f"{collisions / max(1, rests):.3g}", counted_sd=f"{1 / math.sqrt(max(1, rests)):.2f}",
                       away=f"{(math.log(collisions / max(1, rests)) - math.log(here['steps'])) / error:+.2f}")
    return row


def summary(rows):
    def count(kind, right):
        chosen = [r for r in rows if r["kind"] in kind]
        return f"{sum(bool(right(r)) for r in chosen)} of {len(chosen)}"

    everything = ("none", "one", "restitution", "two", "outside")
    whole = lambda r: r["true named"].split("/")[0] == r["true named"].split("/")[1]
    print("none: an effect beside the engine's own contact is named", count(("none",), lambda r: r["false"]))
    for kind in ("one", "restitution", "two"):
        print(f"{kind}: all named {count((kind,), whole)}; something false {count((kind,), lambda r: r['false'])}")
    print("outside: something of the catalogue named", count(("outside",), lambda r: r["false"]))
    print("soft_contact named", count(everything, lambda r: "soft_contact" in r["own"]),
          "; its exponent instead", count(everything, lambda r: r["own"] == "speed_dependent_restitution"))
    inside = [r["size inside"].split("/") for r in rows if r["size inside"]]
    print("sizes inside 90 %:", sum(int(a) for a, b in inside), "of", sum(int(b) for a, b in inside))
    soft = [(float(r["stiffness"]), *map(float, r["stiffness said"].split(" to "))) for r in rows if r["stiffness said"]]
    print("stiffness inside 90 %:", sum(a <= k <= b for k, a, b in soft), "of", len(soft))
    away = [abs(float(r["away"])) for r in rows if r["away"]]
    print("expected steps within 1.645 of the counted:", sum(a < 1.645 for a in away), "of", len(away))
    for verdict in sorted({r["verdict"] for r in rows}):
        print(verdict, sum(r["verdict"] == verdict for r in rows))


def grade(run, out, steps):
    answers = {f.name: pathlib.Path(f"{run}-answers") / f"{f.name}.json" for f in cases_of(run)}
    missing = [case for case, at in answers.items() if not at.exists()]
    if missing:
        sys.exit(f"not answered yet: {' '.join(missing)}")
    counted = {line[0]: (int(line[1]), int(line[2])) for line in csv.reader(open(steps))} if steps else {}
    rows = [row_of(case, json.loads((pathlib.Path(f"{run}-sealed") / f"{case}.json").read_text()),
                   json.loads(answers[case].read_text()), counted) for case in answers]
    filled = [name for name in rows[0] if any(row[name] != "" for row in rows) and name != "times"]
    with open(out, "w", newline="") as file:
        writer = csv.DictWriter(file, filled, extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    summary(rows)


if __name__ == "__main__":
    if len(sys.argv) == 4 and sys.argv[1] == "answer":
        answer(pathlib.Path(sys.argv[2]), sys.argv[3])
    elif len(sys.argv) in (4, 5) and sys.argv[1] == "grade":
        grade(pathlib.Path(sys.argv[2]), sys.argv[3], sys.argv[4] if len(sys.argv) == 5 else None)
    else:
        sys.exit(__doc__)
