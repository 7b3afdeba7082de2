#!/usr/bin/env python3
"""Chains of ten entries a row beside SciPy's spsolve and eigs: seconds, proven widths, and how far SciPy is off.

    PYTHONPATH=build/release/reports/python tests/benchmarks/sparse_chains.py --states 3000 10000 100000

SciPy is asked up to --scipy states: the fill of its LU grows with the square of their number."""

import argparse
import resource
import time

import numpy as np
import scipy.sparse as sparse
import scipy.sparse.linalg as linalg

import metastable


def scattered(n, entries, rng):
    return sparse.csr_matrix((rng.random(n * entries), (np.repeat(np.arange(n), entries),
                                                        rng.integers(0, n, n * entries))), shape=(n, n))


def scaled(matrix, kill):
    matrix = sparse.csr_matrix(matrix)
    matrix = sparse.csr_matrix(matrix - sparse.diags(matrix.diagonal()))
    matrix.eliminate_zeros()
    return sparse.csr_matrix(sparse.diags((1 - kill) / np.asarray(matrix.sum(axis=1)).ravel()) @ matrix)


def chains(n, rng):
    even, one = rng.random(n), np.zeros(n)
    one[5] = 1
    for scale in (1e-6, 1e-12):
        yield f"random, kill {scale:g}", scaled(scattered(n, 10, rng), scale * even), scale * even
    yield "random, one state fails, 1e-6", scaled(scattered(n, 10, rng), 1e-6 * one), 1e-6 * one
    for coupling in (1e-3, 1e-6, 1e-9):
        blocks = sparse.block_diag([scaled(scattered(n // 10, 10, rng), 0) for _ in range(10)])
        matrix = blocks + coupling * scaled(scattered(blocks.shape[0], 2, rng), 0)
        kill = 1e-6 * even[:matrix.shape[0]]
        yield f"10 blocks, coupling {coupling:g}, kill 1e-06", scaled(matrix, kill), kill


def timed(call):
    began = time.time()
    try:
        answer = call()
    except metastable.ComputationError as error:
        answer = None
        print("   refused:", error)
    return answer, time.time() - began


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--states", type=int, nargs="+", default=[3000, 10000])
    parser.add_argument("--scipy", type=int, default=3000)
    parser.add_argument("--chains", nargs="+", default=[], help="words of the chains to take; all")
    parser.add_argument("--threads", type=int, default=0)
    given = parser.parse_args()
    print("states,chain,first passage [s],width,quasi-stationary [s],width,spsolve [s],off,eigs [s],off,peak [GB]")
    for n in given.states:
        for name, matrix, kill in chains(n, np.random.default_rng(n)):
            if given.chains and not any(word in name for word in given.chains):
                continue
            chain = metastable.chain(matrix, kill, threads=given.threads)
            passage, passage_seconds = timed(chain.first_passage)
            quasi, quasi_seconds = timed(chain.quasi_stationary)
            row = [len(kill), '"' + name + '"', f"{passage_seconds:.2f}",
                   f"{(passage.upper / passage.lower).max() - 1:.1e}" if passage else "", f"{quasi_seconds:.2f}",
                   f"{quasi.upper / quasi.lower - 1:.1e}" if quasi and quasi.lower > 0 else ""]
            if len(kill) <= given.scipy:
                system = sparse.csc_matrix(sparse.eye(len(kill)) - matrix)
                steps, seconds = timed(lambda: linalg.spsolve(system, np.ones(len(kill))))
                row += [f"{seconds:.2f}", f"{abs(steps / passage.mean - 1).max():.1e}" if passage else ""]
                value, seconds = timed(lambda: linalg.eigs(matrix.T.tocsc(), k=1, which="LM")[0][0].real)
                row += [f"{seconds:.2f}", f"{abs((1 - value) / quasi.failure_rate - 1):.1e}" if quasi else ""]
            else:
                row += ["", "", "", ""]
            row.append(f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6:.2f}")
            print(",".join(map(str, row)), flush=True)


if __name__ == "__main__":
    main()
