"""Rows as a pandas.DataFrame, as a table of text, and as a figure of Matplotlib, where those packages are there."""

import importlib
import math
import numbers
import subprocess

import numpy


def package(name, who, debian):
    """A package that only some answers need. Raises ImportError with a sentence that names it."""
    try:
        return importlib.import_module(name)
    except ImportError:
        raise ImportError(f"{who} needs the package {name.split('.')[0]}, which this Python does not have (Debian: {debian}; "
                          f"elsewhere: pip install {name.split('.')[0]})", name=name.split(".")[0]) from None


def dataframe(rows):
    """Columns by name, or a list of rows by name, as a pandas.DataFrame."""
    return package("pandas", "to_dataframe", "python3-pandas").DataFrame(rows)


def axes(ax):
    """The axes to draw on: those given, or of a new figure."""
    pyplot = package("matplotlib.pyplot", "plot", "python3-matplotlib")
    return pyplot.subplots()[1] if ax is None else ax


def interval_names(name):
    """Both ends of an interval as columns: expected_steps.interval_95 gives its _low and _high."""
    return f"{name}_low", f"{name}_high"


def flat(values, prefix=""):
    """One row: fields of fields by their path, an interval as two columns."""
    row = {}
    for key in values.keys():
        value, name = values[key], f"{prefix}{key}"
        pair = isinstance(value, (tuple, list)) and len(value) == 2 and all(isinstance(v, numbers.Real) for v in value)
        if hasattr(value, "keys") and hasattr(value, "__getitem__"):
            row.update(flat(value, name + "."))
        elif pair and any(word in name for word in ("interval_", "middle_", "band_")):
            row.update(zip(interval_names(name), value))
        else:
            row[name] = value
    return row


def number_text(value):
    """A value as it stands in a table of text."""
    if isinstance(value, numbers.Real) and not isinstance(value, (bool, numpy.bool_)):
        if isinstance(value, numbers.Integral):
            return str(value)
        return "" if math.isnan(value) else "infinite" if value == math.inf else f"{value:.5g}"
    return "" if value is None else str(value)


def text_table(columns, most=40):
    """Columns by name as lines: numbers to the right, text to the left; of many rows the first and the last."""
    count = len(next(iter(columns.values()), ()))
    shown = list(range(count)) if count <= most else [*range(most // 2), None, *range(count - most // 2, count)]
    lines, cells, left = [], [], []
    for name, values in columns.items():
        cells.append([str(name)] + ["..." if i is None else number_text(values[i]) for i in shown])
        left.append(any(isinstance(values[i], str) for i in shown if i is not None))
    widths = [max(map(len, column)) for column in cells]
    for row in zip(*cells):
        lines.append("  ".join(cell.ljust(width) if to_left else cell.rjust(width)
                               for cell, width, to_left in zip(row, widths, left)).rstrip())
    if count > most:
        lines.append(f"{count} rows, of which the first and the last {most // 2} are shown")
    return "\n".join(lines)


def finite(*values):
    """Arrays without the places where one of them is not a finite number."""
    arrays = [numpy.asarray(value, float) for value in values]
    keep = numpy.all([numpy.isfinite(array) for array in arrays], axis=0)
    return [array[keep] for array in arrays]


def plot_steps(ax, names, value, low, high):
    """Expected steps by name, with their intervals, on a logarithmic axis; infinite ones are left out."""
    ax = axes(ax)
    at, value, low, high = finite(numpy.arange(len(names)), value, low, high)
    ax.errorbar(at, value, yerr=[value - low, high - value], fmt="o", capsize=3)
    ax.set_xticks(range(len(names)), names, rotation=20, ha="right")
    ax.set(ylabel="expected steps before failure", yscale="log")
    return ax


def plot_survival(ax, survival, rate):
    """P(steps > n): as far as it is known step by step, and beyond at the failure rate of the metastable regime, if any."""
    ax = axes(ax)
    last = len(survival) - 1
    ax.step(numpy.arange(last + 1), survival, where="post", label="survival")
    if rate is not None and 0 < rate < 1 and survival[-1] > 0.05:
        n = numpy.linspace(last, last + numpy.log(0.05 / survival[-1]) / numpy.log1p(-rate), 200)
        ax.plot(n, survival[-1] * numpy.exp((n - last) * numpy.log1p(-rate)), "--", label="at the failure rate per step")
        ax.legend()
    ax.set(xlabel="steps n", ylabel="P(steps > n)", ylim=(0, 1.02))
    return ax


def plot_walked(ax, steps, failed):
    """The share of simulated walks that goes on after n steps."""
    ax = axes(ax)
    ended = numpy.sort(numpy.asarray(steps)[numpy.asarray(failed, bool)])
    n = numpy.concatenate([[0], ended, [numpy.max(steps)]])
    share = 1 - numpy.concatenate([[0], numpy.arange(1, len(ended) + 1), [len(ended)]]) / len(steps)
    ax.step(n, share, where="post")
    ax.set(xlabel="steps n", ylabel="share of walks with more than n steps", ylim=(0, 1.02))
    return ax


def drawn(script):
    """What gnuplot draws of a script, as SVG for a notebook; nothing where gnuplot is not installed or fails."""
    try:
        ran = subprocess.run(["gnuplot"], input=script, capture_output=True, encoding="utf-8", timeout=30, check=True)
    except (OSError, subprocess.SubprocessError):
        return ""
    return ran.stdout[max(ran.stdout.find("<svg"), 0):]
