#!/usr/bin/env python3
"""What `diagnose` says of data that its own model made, and of how few, as Markdown.

    tests/benchmarks/own_data.py --program build/release/reports/metastable --seeds 100     # of every law
    tests/benchmarks/own_data.py --program build/release/reports/metastable --few --seeds 50

The nominal model is the one that was simulated: there is no gap, and other contact parameters are none to ask for. Each
line counts the verdicts, with the 95 % interval (Clopper-Pearson) of the share that claims something. With --few the
table is over trials and collisions a trial, of folders of three kinds: as simulated; speeds of four digits without
omega_plus; and with a stated friction that is 0.05 off, of which a recalibration is the truth and an effect is not.
"""
import argparse
import concurrent.futures
import itertools
import json
import os
import re
import subprocess
import tempfile
from collections import Counter

VERDICTS = ["no_gap", "recalibrate", "explained", "partly_explained", "unexplained"]


def run(command):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(map(str, command))}: exit code {done.returncode}\n{done.stderr}")


def simulated(program, folder, law, spread, friction, trials, collisions, seed):
    contact = [] if law == "plastic" else ["--restitution", f"0.4,{spread}", "--friction", f"{friction},{spread}"]
    run([program, "simulate", "--slope", 9.59, "--law", law, *contact, "--trials", trials, "--collisions", collisions,
         "--seed", seed, "--out", folder])


def verdict_of(program, folder):
    answer = os.path.join(folder, "answer.json")
    done = subprocess.run([program, "diagnose", folder, "--threads", "1", "--json", answer], capture_output=True, text=True)
    if done.returncode != 0:
        return "refused"
    with open(answer) as text:
        return json.load(text)["verdict"]


def rewritten(path, change):
    with open(path) as text:
        lines = text.read().split("\n")
    with open(path, "w") as text:
        text.write("\n".join(change(lines)))


def coarsely_measured(folder):
    """Leaves omega_plus out, and four digits of omega_minus."""
    def change(lines):
        yield lines[0].rsplit(",", 1)[0]
        for line in lines[1:]:
            if line:
                fields = line.split(",")
                yield ",".join(fields[:6] + [f"{float(fields[6]):.3f}"])
        yield ""
    rewritten(os.path.join(folder, "collisions.csv"), change)


def misstated(folder):
    def change(lines):
        return [re.sub(r"mean = [\d.]+", "mean = 0.35", line) if line.startswith("friction") else line for line in lines]
    rewritten(os.path.join(folder, "experiment.toml"), change)


def interval(count, total):
    """95 % interval of a share, by bisection of the binomial's tails."""
    def tail(share, least):
        term, total_tail = (1 - share) ** total, 0.0
        for k in range(total + 1):
            if k >= least:
                total_tail += term
            term *= (total - k) / (k + 1) * share / (1 - share)
        return total_tail
    def where(least, level):
        low, high = 0.0, 1.0
        for _ in range(50):
            middle = (low + high) / 2
            low, high = (middle, high) if tail(middle, least) < level else (low, middle)
        return low
    return (where(count, 0.025) if count else 0.0, where(count + 1, 0.975) if count < total else 1.0)


def table(jobs, keys, threads):
    """Prints a line for each key. @param jobs: pairs of a key and what returns a verdict"""
    counts = {}
    with concurrent.futures.ThreadPoolExecutor(threads) as pool:
        for key, verdict in pool.map(lambda job: (job[0], job[1]()), jobs):
            counts.setdefault(key, Counter())[verdict] += 1
    print("| " + " | ".join(keys + VERDICTS + ["refused", "claims of a gap, 95 %"]) + " |")
    print("|" + "---|" * len(keys) + "--:|" * (len(VERDICTS) + 2))
    for key, count in counts.items():
        total, claims = sum(count.values()), count["explained"] + count["partly_explained"] + count["unexplained"]
        low, high = interval(claims, total)
        print("| " + " | ".join([*map(str, key), *(str(count[v]) for v in VERDICTS + ["refused"]),
                                 f"{100 * claims / total:.0f} ({100 * low:.0f} to {100 * high:.0f}) %"]) + " |")


def own(program, law, spread, trials, collisions, friction, seed, change=None):
    with tempfile.TemporaryDirectory() as parent:
        folder = os.path.join(parent, "wheel")
        simulated(program, folder, law, spread, friction, trials, collisions, seed)
        if change:
            change(folder)
        return verdict_of(program, folder)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="build/release/reports/metastable")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--laws", default="published,coulomb,plastic,settled")
    parser.add_argument("--spreads", default="0.1,0.05")
    parser.add_argument("--trials", default="20,60")
    parser.add_argument("--few", action="store_true", help="over trials and collisions, few of them")
    parser.add_argument("--threads", type=int, default=1)
    given = parser.parse_args()
    seeds = range(given.first_seed, given.first_seed + given.seeds)
    if given.few:
        kinds = {"as simulated": None, "coarse": coarsely_measured, "misstated": misstated}
        jobs = [((kind, trials, collisions),
                 lambda t=trials, c=collisions, s=seed, change=kinds[kind]:
                 own(given.program, "published", 0.05, t, c, 0.3, s, change))
                for kind, trials, collisions, seed in itertools.product(kinds, [2, 3, 4, 6, 10], [2, 4, 8, 16], seeds)]
        return table(jobs, ["kind", "trials", "collisions"], given.threads)
    jobs = [((law, trials, spread),
             lambda law=law, t=trials, s=spread, seed=seed: own(given.program, law, s, t, 16, 0.4, seed))
            for law, trials, spread, seed in itertools.product(given.laws.split(","), map(int, given.trials.split(",")),
                                                               given.spreads.split(","), seeds)]
    return table(jobs, ["law", "trials", "sds of eta, mu"], given.threads)


if __name__ == "__main__":
    main()
