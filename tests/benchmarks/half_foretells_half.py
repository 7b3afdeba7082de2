#!/usr/bin/env python3
"""Does the machine's expected steps hold on data that no model of ours made? Half of the trials of each folder foretell the
rests of the other half.

    half_foretells_half.py PROGRAM FOLDER...

Prints, for each half, the expected steps with their 90 % interval, the other half's count, and the distance of the two in
standard errors of the logarithm; then how many are within 1.645.
"""

import csv
import json
import math
import pathlib
import shutil
import subprocess
import sys
import tempfile


def table(path):
    rows = list(csv.reader(open(path)))
    return rows[0], rows[1:]


def half(folder, parity, target):
    """Writes the trials of one parity; returns how many collisions and rests the others have."""
    shutil.copy(folder / "experiment.toml", target)
    counted = {}
    for name in ("trials.csv", "collisions.csv"):
        head, rows = table(folder / name)
        at = head.index("trial")
        with open(target / name, "w", newline="") as out:
            csv.writer(out).writerows([head] + [row for row in rows if int(row[at]) % 2 == parity])
        counted[name] = head, [row for row in rows if int(row[at]) % 2 != parity]
    head, trials = counted["trials.csv"]
    rests = sum(row[head.index("outcome")] == "rest" for row in trials)
    return len(counted["collisions.csv"][1]), rests


def main():
    program, folders = sys.argv[1], [pathlib.Path(one) for one in sys.argv[2:]]
    near = []
    for folder in folders:
        for parity in (0, 1):
            with tempfile.TemporaryDirectory() as work:
                work = pathlib.Path(work)
                collisions, rests = half(folder, parity, work)
                subprocess.run([program, "diagnose", work, "--json", work / "answer.json"], check=True, capture_output=True)
                answer = json.loads((work / "answer.json").read_text())
            own = next(one for one in answer["steps_before_failure"]["machine"] if one["where"] == "as measured")
            low, high = own["interval_90"]
            error = math.hypot((math.log(high) - math.log(low)) / 3.29, 1 / math.sqrt(max(1, rests)))
            distance = (math.log(collisions / max(0.5, rests)) - math.log(own["steps"])) / error
            near.append(abs(distance) < 1.645)
            print(f"{folder.name}, half {parity}: {answer['verdict']}, {own['steps']:.3g} ({low:.3g} to {high:.3g}); "
                  f"{rests} rests in {collisions} collisions of the other half, {distance:+.2f}", flush=True)
    print(f"{sum(near)} of {len(near)} within 1.645")


if __name__ == "__main__":
    main()
