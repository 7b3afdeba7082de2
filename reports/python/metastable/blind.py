"""The diagnosis tested on cases whose truth is sealed until it has answered: make, answer, open."""

import os
import pathlib
import sys

from metastable import _metastable, _progress
from metastable._results import Description, Record


class Made(Record):
    """`cases` were drawn; their truths lie `sealed` in a folder of their own."""

    def __init__(self, cases, sealed):
        super().__init__(dict(cases=cases, sealed=sealed))

    def __repr__(self):
        return f"<metastable.blind.Made: {self.cases} cases, truths in {self.sealed}>"


class Answered(Record):
    """Of `cases`, how many are `answered`, and on how many the tool `failed` now."""

    def __init__(self, cases, answered, failed):
        super().__init__(dict(cases=cases, answered=answered, failed=failed))

    def __repr__(self):
        return f"<metastable.blind.Answered: {self.answered} of {self.cases} cases, {self.failed} failed>"


class Grades(Description):
    """How well the diagnosis did: `tables` by name, each a Table."""


def _run(function, progress, label, folder, **options):
    options = {name: os.fspath(value) if isinstance(value, os.PathLike) else value for name, value in options.items()}
    options["folder"] = os.fspath(folder)
    with _progress.telling(progress, label) as tell:
        return function(options, f"metastable.blind.{label}({options['folder']!r})", tell)


def make(folder, *, sealed=None, seed=None, per_effect=6, none=300, pairs=50, outside=50, left_out=3, mixed=0, many=0,
         law="published", walker=None, threads=0, progress=None):
    """Draws cases in the virtual laboratory and seals their truths; a run cut short goes on. Returns Made.

    folder      of the run; sealed: of the truths (None: folder + "-sealed")
    seed        of all cases; None: from the system's entropy
    per_effect  cases of each effect at each of 1x, 2x, 4x; none: without a gap; pairs: with two effects;
                outside: with an effect that no catalogue holds; left_out: of each effect, with a catalogue without it;
                mixed: with one or two effects and one that no catalogue holds; many: with three effects
    law         "published" (first laboratory), "settled" (second one, a rigid body) or "both", in turn
    walker      "compass": cases of the compass gait, from the laboratory of walkers; None: of the wheel
    """
    return Made(**_run(_metastable.blind_make, progress, "make", folder, sealed=sealed, seed=seed,
                       per_effect=per_effect, none=none, pairs=pairs, outside=outside, left_out=left_out,
                       mixed=mixed, many=many, law=law, walker=walker, threads=threads))


def answer(folder, *, tool=None, threads=0, progress=None):
    """Diagnoses the folders that have no answer yet, each by a process of its own, and records digest and time.
    Returns Answered.

    tool  a program, with its first arguments as a list: run as "TOOL diagnose CASE --json FILE ..."; None: this module
    """
    if tool is None:
        tool = [sys.executable, str(pathlib.Path(__file__).with_name("__main__.py"))]
    return Answered(**_run(_metastable.blind_answer, progress, "answer", folder, tool=tool, threads=threads))


def open(folder, *, sealed=None, partial=False, out=None, threads=0, progress=None):
    """Checks seals and record, grades, and writes tables and a page. Returns Grades.

    partial  although some cases are not answered; out: folder of the page (None: report in the run's folder)
    """
    return Grades(_run(_metastable.blind_open, progress, "open", folder, sealed=sealed, partial=partial, out=out,
                       threads=threads))
