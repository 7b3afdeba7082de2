#!/usr/bin/env python3
"""Chains of ten entries a row beside SciPy: processor seconds, proven bounds, and how far SciPy is off. Writes CSV.

    PYTHONPATH=build/release/reports/python tests/benchmarks/sparse_chains.py --states 3500 100000 --spsolve 3500

Four questions: first passage, the quasi-stationary distribution (its proven bound; of eigs the rate), the committor of
state 7, survival of 10 to 1e12 steps from state 0. SciPy's best stands beside them: SuperLU (as spsolve uses it, once for both questions) up to --spsolve
states, as its fill grows with the square of them, GMRES (a hundred products at most) beyond; eigs; and products with
the matrix up to 1000 steps, from there on by the rate that eigs found. What takes SciPy more than --patience seconds of
processor time is given up."""

import argparse
import os
import resource
import signal
import sys
import time

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ[variable] = "1"  # before NumPy starts its threads

import numpy as np
import scipy.sparse as sparse
import scipy.sparse.linalg as linalg

import metastable

TARGET, AFTER, FAR = 7, [10, 100, 1000], [1e6, 1e9, 1e12]


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


class GivenUp(Exception):
    pass


def timed(call, patience=0):
    """What a call returns, or None where it refuses or is given up, and its processor seconds."""
    def give_up(*_):
        raise GivenUp(f"not done in {patience:g} s")
    began = time.process_time()
    signal.signal(signal.SIGPROF, give_up)
    signal.setitimer(signal.ITIMER_PROF, patience)
    try:
        answer = call()
    except (metastable.ComputationError, linalg.ArpackError, GivenUp) as error:
        answer = None
        print("   none:", error, file=sys.stderr, flush=True)
    signal.setitimer(signal.ITIMER_PROF, 0)
    return answer, time.process_time() - began


def by_gmres(system, right):
    """What it has after a hundred products, or at a residual of 1e-12, which rare failures keep out of reach."""
    return linalg.gmres(system, right, tol=1e-12, atol=0, restart=50, maxiter=2)[0]


class Peer:
    """A chain as SciPy has it."""

    def __init__(self, matrix, kill, direct):
        self.matrix, self.kill, self.direct = matrix, kill, direct
        self.system = sparse.csc_matrix(sparse.eye(len(kill)) - matrix)
        self.name = "spsolve" if direct else "GMRES"
        self.factors = self.rate = None

    def first_passage(self):
        if not self.direct:
            return by_gmres(self.system, np.ones(len(self.kill)))
        self.factors = self.factors or linalg.splu(self.system)
        return self.factors.solve(np.ones(len(self.kill)))

    def quasi_stationary(self):
        value = linalg.eigs(self.matrix.T.tocsc(), k=1, which="LM", return_eigenvectors=False)[0].real
        self.rate = 1 - value
        return self.rate

    def committor(self):
        others = np.arange(len(self.kill)) != TARGET
        if self.direct:  # visits to the target, over those from itself
            self.factors = self.factors or linalg.splu(self.system)
            visits = self.factors.solve(1.0 - others)
            return visits[others] / visits[TARGET]
        return by_gmres(self.system[others][:, others], self.matrix[others][:, [TARGET]].toarray().ravel())

    def survival(self):
        survivors, told, transposed = np.zeros(len(self.kill)), [], sparse.csr_matrix(self.matrix.T)
        survivors[0] = 1
        for step in range(max(AFTER)):
            survivors = transposed @ survivors
            if step + 1 in AFTER:
                told.append(survivors.sum())
        far = [] if self.rate is None else [told[-1] * np.exp((n - AFTER[-1]) * np.log1p(-self.rate)) for n in FAR]
        return np.array(told + far)


def questions(chain, peer):
    """Name, what is asked here, its bound, what SciPy is asked, its name, and how far it is off."""
    others = np.arange(len(chain)) != TARGET
    yield ("first passage", chain.first_passage, lambda a: (a.upper / a.lower).max() - 1, peer.first_passage, peer.name,
           lambda a, b: abs(b / a.mean - 1).max())
    yield ("quasi-stationary", chain.quasi_stationary, lambda a: a.distribution_error, peer.quasi_stationary, "eigs",
           lambda a, b: abs(b / a.failure_rate - 1))
    yield ("committor", lambda: chain.committor([TARGET]), lambda a: a.error, peer.committor, peer.name,
           lambda a, b: abs(b / a.reach[others] - 1).max())
    yield ("survival", lambda: chain.survival(0, AFTER + FAR), lambda a: None, peer.survival, "products",
           lambda a, b: abs(b - a[:len(b)]).max())


def asked(chain, peer, patience, words=()):
    """By question: its name, seconds here (None: refused), bound, SciPy's way, its seconds (None: none), how far off."""
    for name, ask, bound, other, way, off in questions(chain, peer):
        if words and name not in words:
            continue
        here, seconds = timed(ask)
        there, there_seconds = timed(other, patience)
        both = here is not None and there is not None
        yield (name, None if here is None else seconds, None if here is None else bound(here), way,
               None if there is None else there_seconds, off(here, there) if both else None)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--states", type=int, nargs="+", default=[3500, 10000])
    parser.add_argument("--spsolve", type=int, default=0)
    parser.add_argument("--patience", type=float, default=30)
    parser.add_argument("--chains", nargs="+", default=[], help="words of the chains to take; all")
    given = parser.parse_args()
    names = ["first passage", "quasi-stationary", "committor", "survival"]
    print(",".join(["states", "chain", *(f"{name},SciPy" for name in names), "peak [GB]"]))
    for n in given.states:
        for name, matrix, kill in chains(n, np.random.default_rng(n)):
            if given.chains and not any(word in name for word in given.chains):
                continue
            row = [str(len(kill)), f'"{name}"']
            chain, peer = metastable.chain(matrix, kill, threads=1), Peer(matrix, kill, n <= given.spsolve)
            for _, seconds, bound, way, others, off in asked(chain, peer, given.patience):
                here = "refused" if seconds is None else f"{seconds:.2f} s" + (f" ({bound:.1e})" if bound is not None else "")
                there = f"{way}: none" if others is None else f"{way}: {others:.2f} s" + (f" ({off:.1e})" if off is not None else "")
                row += [f'"{here}"', f'"{there}"']
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
            print(",".join([*row, f"{peak:.2f}"]), flush=True)


if __name__ == "__main__":
    main()
