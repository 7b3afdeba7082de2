#!/usr/bin/env python3
"""Cost of one mesh across ranks, against nodes and ranks, as Markdown: seconds, and memory at each rank's peak.

    cmake --preset release -DMETASTABLE_MPI=ON && cmake --build --preset release --target metastable-mpi shared_mesh
    tests/benchmarks/ranks.py --spacings 0.4,0.2,0.1 --ranks 1,2          # of a map that costs next to nothing
    tests/benchmarks/ranks.py --mesh '--walker compass --slope-sd 0.5 --memory 100' --spacings 0.4,0.3,0.2
"""
import argparse
import math
import os
import re
import subprocess
import time


def run(build, ranks, spacing, options):
    environment = {**os.environ, "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    command = ["mpirun", "-q", "-n", str(ranks), "--oversubscribe"]
    if options:
        command += [os.path.join(build, "reports", "metastable-mpi"), "mesh", "--spacing", str(spacing), *options]
    else:
        command += [os.path.join(build, "tests", "shared_mesh"), str(spacing)]
    began = time.monotonic()
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    wall = time.monotonic() - began
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(command)}: exit code {done.returncode}\n{done.stderr}")
    nodes, entries = map(int, re.search(r"sd\s+(\d+) nodes, (\d+) entries", done.stdout).groups())
    rows, products, solve = map(float, re.search(r"rows ([\d.]+), products ([\d.]+), \w+ and \w+ ([\d.]+)", done.stdout).groups())
    memory = [float(gb) for gb in re.findall(r"rank \d+ .* ([\d.]+) GB at its peak", done.stdout)]
    steps = re.search(r"expected steps on this mesh\s+(\S+)", done.stdout).group(1)
    return nodes, entries, steps, rows, products, solve, wall, memory


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", default="build/release")
    parser.add_argument("--spacings", default="0.4,0.3,0.2,0.15")
    parser.add_argument("--ranks", default="1,2")
    parser.add_argument("--mesh", default="", help="options of `metastable-mpi mesh`")
    arguments = parser.parse_args()
    print("| spacing | nodes | entries | steps | ranks | rows [s] | products [s] | SLEPc, PETSc [s] | wall [s] | GB a rank |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    last = {}
    exponents = []
    for spacing in map(float, arguments.spacings.split(",")):
        for ranks in map(int, arguments.ranks.split(",")):
            nodes, entries, steps, rows, products, solve, wall, memory = run(arguments.build, ranks, spacing, arguments.mesh.split())
            print(f"| {spacing} | {nodes} | {entries} | {steps} | {ranks} | {rows:.1f} | {products:.1f} | {solve:.1f} | {wall:.1f} | "
                  f"{', '.join(f'{gb:.2f}' for gb in memory)} |", flush=True)
            if ranks in last:
                before, cost = last[ranks]
                exponents.append(f"{ranks} ranks, {before} to {nodes} nodes: {math.log(wall / cost) / math.log(nodes / before):.2f}")
            last[ranks] = nodes, wall
    print("\nExponents of wall seconds in nodes: " + "; ".join(exponents) + ".")


if __name__ == "__main__":
    main()
