#!/usr/bin/python3
"""The same work here and in NumPy/SciPy, in one session; writes the ratios and the cost curves as Markdown.

    cmake --preset bench && cmake --build --preset bench
    tests/benchmarks/compare.py --build build/bench --out bench.md [--sweep]

Needs Debian's python3-numpy and python3-scipy (with libopenblas0-pthread for a fast BLAS). Nothing else should run on
the machine meanwhile. --sweep adds the sweep of 10,000 settings.
"""
import argparse
import json
import math
import multiprocessing
import os
import platform
import subprocess
import sys
import tempfile
import time

if len(sys.argv) == 4 and sys.argv[1] == "--lu":  # before NumPy starts its threads
    os.environ["OPENBLAS_NUM_THREADS"] = sys.argv[3]

import numpy as np
import scipy
import scipy.linalg


def paper_wheel():
    length, half, mass, g, slope = 0.1519, math.pi / 8, 1.39, 9.81, math.radians(7.02)
    beta = math.pi / 2 - half
    inertia = mass * length ** 2
    pendulum = 2 * mass * g * length / inertia
    return {"M": mass, "g": g, "slope": slope, "K": 9000.0, "I": inertia, "r2": length ** 2,
            "chord": 2 * length * math.sin(half), "x": length * math.cos(beta), "y": length * math.sin(beta),
            "barrier": pendulum * (1 - math.sin(beta + slope)),
            "gain": pendulum * (math.sin(beta + slope) - math.sin(beta - slope))}


def coefficients(rng, samples, w):
    """Of each draw of eta and mu: omega^2 after the collision is scale x - drag sqrt(x)."""
    def truncated(mean, sd, least, most):
        z = rng.normal(mean, sd, samples)
        outside = (z < least) | (z > most)
        while outside.any():
            z[outside] = rng.normal(mean, sd, outside.sum())
            outside = (z < least) | (z > most)
        return z
    eta, mu = truncated(0.4, 0.1, 0, 1), truncated(0.4, 0.1, 0, np.inf)
    mass = w["M"] * w["r2"] / (w["r2"] + w["x"] ** 2 - mu * w["x"] * w["y"])
    slip = (mu * (w["r2"] + w["y"] ** 2) - w["x"] * w["y"]) / (w["M"] * w["r2"])
    v0, tau = w["chord"], 1 + eta  # at 1 rad/s
    impulse = v0 * mass
    normal = v0 * tau * impulse * (2 - tau) / 2
    reverse = v0 * mu * slip * mass * tau
    tangential = reverse * tau * impulse / 2
    duration = np.sqrt(w["M"] / w["K"]) * np.sqrt(math.pi ** 2 + np.log(eta) ** 2)
    potential = -w["M"] * w["g"] * math.sin(w["slope"]) * reverse * duration / 2
    return 1 - 2 * (normal + tangential) / w["I"], -2 * potential / w["I"]


class NumpyChain:
    """The sampled chain as NumPy does it best: one set of draws for all cells with its coefficients computed once,
    sorted by the state below which each comes to rest, so that a cell lands only those that can survive from it;
    whole arrays in place, in pieces that stay in the cache; counts by bincount."""

    def __init__(self, cells=1000, samples=100000, chunk=32768, seed=1):
        w, rng = paper_wheel(), np.random.default_rng(seed)
        self.cells, self.samples, self.chunk = cells, samples, min(chunk, samples)
        self.lower = w["barrier"] + w["gain"]
        self.width = 3.3 * self.lower / cells
        scale, drag = coefficients(rng, samples, w)
        with np.errstate(all="ignore"):
            root = (drag + np.sqrt(drag * drag + 4 * scale * w["barrier"])) / (2 * scale)
        lowest = np.where(scale > 0, root * root, np.inf)
        order = np.argsort(lowest)
        self.lowest = lowest[order]
        # In cells: 1 + (after + gain - lower)/width, so that what is cut to 0 rests.
        self.scale, self.root = scale[order] / self.width, -drag[order] / self.width
        self.start = 1 + (w["gain"] - self.lower) / self.width
        self.offset = rng.random(samples)[order] * self.width

    def rows(self, cells):
        state, work = np.empty(self.chunk), np.empty(self.chunk)
        to = np.empty(self.chunk, np.int64)
        rows = []
        for cell in cells:
            origin = self.lower + self.width * cell
            alive = int(np.searchsorted(self.lowest, origin + self.width, side="right"))
            counts = np.zeros(self.cells + 1, np.int64)
            for first in range(0, alive, self.chunk):
                some = slice(first, min(first + self.chunk, alive))
                x, s, i = (array[:some.stop - first] for array in (state, work, to))
                np.add(self.offset[some], origin, out=x)
                np.sqrt(x, out=s)
                s *= self.root[some]
                x *= self.scale[some]
                x += s
                x += self.start
                np.clip(x, 0, self.cells, out=x)
                np.copyto(i, x, casting="unsafe")
                counts += np.bincount(i, minlength=self.cells + 1)
            row = counts / self.samples
            row[0] = 1 - row[1:].sum()
            rows.append(row)
        return rows


def numpy_worker(part):
    chain = NumpyChain()
    return np.array(chain.rows(range(*part)))


def numpy_chain(repeats=3, processes=2):
    """Best wall and CPU seconds of the whole chain in one process, draws and all; best wall seconds in two."""
    best, least, together = math.inf, math.inf, math.inf
    for _ in range(repeats):
        start, cpu = time.perf_counter(), time.process_time()
        numpy_worker((0, 1000))
        best, least = min(best, time.perf_counter() - start), min(least, time.process_time() - cpu)
    with multiprocessing.Pool(processes) as pool:
        pool.map(numpy_worker, [(0, 1)] * processes)  # started and warm
        for _ in range(repeats):
            start = time.perf_counter()
            pool.map(numpy_worker, [(1000 * p // processes, 1000 * (p + 1) // processes) for p in range(processes)], 1)
            together = min(together, time.perf_counter() - start)
    return best, least, together


def lu_here(n, repeats=5):
    """Best wall and CPU seconds of dense LU and solve of (I - Q) m = 1, in place in LAPACK's own order, and the largest
    relative error of m."""
    rng = np.random.default_rng(1)
    q = rng.uniform(0.01, 1, (n, n))
    q *= (1 - 1e-9) / q.sum(axis=1)[:, None]
    best, least, error = math.inf, math.inf, 0
    for _ in range(repeats):
        matrix, ones = np.asfortranarray(np.eye(n) - q), np.ones(n)
        start, cpu = time.perf_counter(), time.process_time()
        factors = scipy.linalg.lu_factor(matrix, overwrite_a=True, check_finite=False)
        mean = scipy.linalg.lu_solve(factors, ones, overwrite_b=True, check_finite=False)
        best, least = min(best, time.perf_counter() - start), min(least, time.process_time() - cpu)
        error = float(np.max(np.abs(mean * 1e-9 - 1)))
    return best, least, error


def scipy_lu(n, threads):
    """lu_here() in a process of its own, whose BLAS has so many threads."""
    out = subprocess.run([sys.executable, __file__, "--lu", str(n), str(threads)], check=True, capture_output=True,
                         text=True).stdout
    return tuple(float(word) for word in out.split())


def blas_name():
    with open("/proc/self/maps") as maps:
        files = {os.path.basename(line.split()[-1]) for line in maps if "/" in line}
    names = ("libopenblas", "libblas", "libblis", "libmkl", "libatlas")
    return ", ".join(sorted(name for name in files if name.startswith(names))) or "unknown"


def run_measured(command):
    """Wall seconds and peak resident megabytes of one program."""
    # By a small process: a child begins with the peak of the one that made it.
    code = ("import os, subprocess, sys, time; start = time.perf_counter(); "
            "child = subprocess.Popen(sys.argv[1:], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL); "
            "_, status, usage = os.wait4(child.pid, 0); print(status, time.perf_counter() - start, usage.ru_maxrss)")
    out = subprocess.run([sys.executable, "-c", code, *command], check=True, capture_output=True, text=True).stdout
    status, seconds, kilobytes = out.split()
    if status != "0":
        sys.exit(f"{command[0]}: status {status}")
    return float(seconds), float(kilobytes) / 1024


def google_benchmark(program, which="."):
    with tempfile.NamedTemporaryFile(suffix=".json") as out:
        subprocess.run([program, f"--benchmark_out={out.name}", "--benchmark_out_format=json", f"--benchmark_filter={which}",
                        "--benchmark_repetitions=3", "--benchmark_min_time=0.2"], check=True)
        results = json.load(open(out.name))["benchmarks"]
    best = {}
    for result in results:
        if result.get("run_type") == "iteration":
            name = result["run_name"].replace("/process_time", "").replace("/real_time", "")
            if name not in best or result["real_time"] < best[name]["real_time"]:
                best[name] = result
    return best


def milliseconds(result, which="real_time"):
    return result[which] * {"ns": 1e-6, "us": 1e-3, "ms": 1, "s": 1e3}[result["time_unit"]]


def exponent(points):
    """Slope of the straight line through (ln x, ln time)."""
    x, y = np.log([p[0] for p in points]), np.log([p[1] for p in points])
    return np.polyfit(x, y, 1)[0]


def curve(best, label, names):
    points = [(x, milliseconds(best[name], "real_time" if label == "threads" else "cpu_time")) for x, name in names]
    values = ", ".join(f"{x}: {t:.3g} ms" for x, t in points)
    return f"| {label} | {values} | {exponent(points):.2f} |"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", default="build/bench")
    parser.add_argument("--out", default="bench.md")
    parser.add_argument("--sweep", action="store_true")
    options = parser.parse_args()
    program = os.path.join(options.build, "tests/benchmarks/benchmarks")
    metastable = os.path.join(options.build, "reports/metastable")
    best = google_benchmark(program)

    def chain(cells, samples, legs, threads):
        return f"sampled_chain/cells:{cells}/samples:{samples}/legs:{legs}/threads:{threads}"
    ours = milliseconds(best[chain(1000, 100000, 1, 2)]) / 1e3
    one_cpu = milliseconds(best[chain(1000, 100000, 1, 1)], "cpu_time") / 1e3
    theirs, theirs_cpu, theirs_two = numpy_chain()
    lu, _, lu_error = scipy_lu(2000, 2)
    _, lu_cpu, _ = scipy_lu(2000, 1)
    dense = milliseconds(best["first_passage/states:2000/threads:2"]) / 1e3
    dense_cpu = milliseconds(best["first_passage/states:2000/threads:1"], "cpu_time") / 1e3
    landed = best[chain(1000, 100000, 1, 1)]["landed_share"]
    root, count = best["square_roots"]["ns_each"], best["count_landings"]["ns_each"]
    floor = landed * 1e8 * (root + count) * 1e-9

    lines = ["# Benchmarks", "",
             f"{time.strftime('%Y-%m-%d')}, {platform.machine()}, {os.cpu_count()} cores; NumPy {np.__version__}, "
             f"SciPy {scipy.__version__}, BLAS {blas_name()}.", "",
             "Both sides do the same work in the best form we know. The chain's draws, their loss coefficients and "
             "lowest survivors are shared by all cells; NumPy counts draws of one weight each, the chain here adds "
             "weights that reach tails of 1e-30, and assembles chain and launch row. NumPy on two cores is two processes. "
             "LU works in place, its BLAS on as many threads as the column says.", "",
             "| work | here, 2 threads: s | NumPy/SciPy, 2 cores: s | ratio | here, 1 thread: CPU s | NumPy/SciPy, 1 core: CPU s | ratio |",
             "|---|---|---|---|---|---|---|",
             f"| sampled chain, 1000 cells x 100,000 samples | {ours:.3f} | {theirs_two:.2f} (one process: {theirs:.2f}) | "
             f"{theirs_two / ours:.1f} ({theirs / ours:.1f}) | {one_cpu:.3f} | {theirs_cpu:.2f} | {theirs_cpu / one_cpu:.1f} |",
             f"| first passage, 2000 states, full (LU's relative error at 1e9 steps: {lu_error:.0e}) | {dense:.3f} | "
             f"{lu:.3f} | {lu / dense:.2f} | {dense_cpu:.3f} | {lu_cpu:.3f} | {lu_cpu / dense_cpu:.2f} |"]
    steps_cpu = milliseconds(best["expected_steps"], "cpu_time") / 1e3
    lines.append(f"| expected steps of the paper's wheel, 8 digits (NumPy's sampled chain: 2 digits) | | | | {steps_cpu:.4f} "
                 f"| {theirs_cpu:.2f} | {theirs_cpu / steps_cpu:.0f} |")
    for name in ("integrated_study/digits:4/legs:1/threads:1", "integrated_study/digits:8/legs:1/threads:1"):
        lines.append(f"| {name.split('/')[1].split(':')[1]} digits of the paper's wheel, integrated study | | | | "
                     f"{milliseconds(best[name], 'cpu_time') / 1e3:.3f} | | |")
    if options.sweep:
        with tempfile.TemporaryDirectory() as folder:
            seconds, memory = run_measured(
                [metastable, "sweep", "--legs", "0.1519", "--initial-speed", "6,0.3", "--slope", "6:10.8:0.2",
                 "--friction-mean", "0.3:0.49:0.01", "--friction-sd", "0.05:0.145:0.005", "--method", "integrated",
                 "--tolerance", "1e-4", "--out", os.path.join(folder, "sweep.csv")])
        lines.append(f"| sweep of 10,000 settings to 1e-4 | {seconds:.1f} ({memory:.0f} MB) | | | | | |")
    memory = [run_measured([program, f"--benchmark_filter={name}"])[1]
              for name in ("sampled_chain/cells:1000/samples:100000/", "first_passage/states:2000", "integrated")]
    lines += ["", f"Peak memory: sampled chain {memory[0]:.0f} MB, first passage {memory[1]:.0f} MB, integrated "
              f"{memory[2]:.0f} MB.", "",
              "## The limit of the sampled chain", "",
              f"Of the 1e8 pairs of cell and draw {100 * landed:.0f} % are landed; the others are known to rest from the "
              "draw's lowest survivor. A landing takes one square root, 3 multiplications, 2 additions and a comparison, "
              "and 32 bytes read and 8 written; finding its cell 5 operations, one comparison and 24 bytes; counting it "
              "one addition and 28 bytes, all in the first two caches. "
              f"Square roots alone take {root:.2f} ns each here, counting alone {count:.2f} ns: {floor:.3f} s on one "
              f"core, of which the chain takes {one_cpu / floor:.1f} times as long.", "",
              "## Cost", "", "| against | CPU on one thread (threads: wall) | exponent |", "|---|---|---|",
              curve(best, "cells", [(n, chain(n, 100000, 1, 1)) for n in (125, 250, 500, 1000, 2000)]),
              curve(best, "samples", [(n, chain(1000, n, 1, 1)) for n in (12500, 25000, 50000, 100000, 200000)]),
              curve(best, "different legs", [(n, chain(250, 25000, n, 1)) for n in (3, 6, 12)]),
              curve(best, "threads", [(n, chain(1000, 100000, 1, n)) for n in (1, 2)]),
              curve(best, "states of a full chain",
                    [(n, f"first_passage/states:{n}/threads:1") for n in (250, 500, 1000, 2000)]),
              curve(best, "nodes, integrated rows", [(n, f"integrated_rows/nodes:{n}") for n in (32, 64, 128)]), ""]
    with open(options.out, "w") as out:
        out.write("\n".join(lines))
    print("\n".join(lines))


if __name__ == "__main__":
    if len(sys.argv) == 4 and sys.argv[1] == "--lu":
        print(*lu_here(int(sys.argv[2])))
    else:
        main()
