"""Columns of a user's rows as arrays: anything that has columns by name is looked into."""

import datetime
import math
import numbers

import numpy

from metastable._arguments import kind
from metastable._errors import InputError, InputTypeError


def column_of(data, name):
    """A column of anything that has columns by name; None where there is none of this name."""
    if data is None:
        return None
    try:
        return data[name]
    except (KeyError, IndexError, ValueError):
        return None
    except TypeError:
        raise InputTypeError(f"data: anything with columns by name expected (a DataFrame, a dict of arrays), not "
                             f"{kind(data)}") from None
    except Exception:  # Frames of other packages raise errors of their own for a name that they do not know.
        if name in getattr(data, "columns", (name,)):
            raise
        return None


def array_of(values, name, of=None):
    """A column as an array. Columns of frames give theirs: their index, from which NumPy would count, is no place."""
    if hasattr(values, "to_numpy"):
        values = values.to_numpy()
    if numpy.ma.isMaskedArray(values):
        raise InputTypeError(f"{name}: a masked array is given: fill what is missing with NaN")
    try:
        return numpy.asarray(values, of)
    except (TypeError, ValueError):
        raise InputTypeError(f"{name}: one value a row expected, not {kind(values)}") from None


def listed(values, name):
    """A column as a list; None where a value is missing."""
    array = array_of(values, name, object)
    if array.ndim != 1:
        raise InputError(f"{name}: shape {array.shape} given, (n,) expected: one value a row")
    return [None if missing(one) else one for one in array.tolist()]


def missing(one):
    """None, NaN, NaT, an empty text, or the missing value of pandas, which can be compared with nothing."""
    if one is None or type(one).__name__ in ("NAType", "NaTType"):
        return True
    if isinstance(one, (str, bytes)):
        return not one.strip()
    return isinstance(one, (numbers.Number, numpy.datetime64, numpy.timedelta64)) and bool(one != one)


def item(one, name, at):
    """A value by which rows are told apart, as Python has it: a word, a number, a date."""
    one = one.item() if hasattr(one, "item") else one
    try:
        hash(one)
    except TypeError:
        raise InputTypeError(f"{name}: words or numbers expected, not {kind(one)} in row {at + 1}") from None
    return one


def one_a_row(values, name, rows, of=None):
    """A column as an array with one value for every row."""
    array = array_of(values, name, of)
    if array.ndim != 1 or len(array) != rows:
        raise InputError(f"{name}: shape {array.shape} given, ({rows},) expected: one value a row")
    return array


def floats(values, name, rows):
    """Numbers of a column; NaN where one is missing, as an empty text of a CSV file is."""
    array = one_a_row(values, name, rows)
    if array.dtype.kind in "mMc":  # NumPy would count nanoseconds, or drop the imaginary part.
        raise InputTypeError(f"{name}: an array of numbers expected, not of {array.dtype}")
    if array.dtype == object or array.dtype.kind in "US":
        array = numpy.array([math.nan if missing(one) else one for one in array], object)
    try:
        return array.astype(float)
    except (OverflowError, TypeError, ValueError):
        raise InputTypeError(f"{name}: numbers expected, and NaN for missing ones{_first_no_number(array)}") from None


def _first_no_number(array):
    """Names the first value that is no number."""
    for at, one in enumerate(array):
        try:
            float(one)
        except (OverflowError, TypeError, ValueError):
            return f", not {str(one)!r} in row {at + 1}"
    return ""


def seconds(values, name, rows):
    """Times in seconds: numbers as they are, durations in seconds, dates in seconds since the first of them."""
    array = one_a_row(values, name, rows)
    known = [one for one in array if not missing(one)] if array.dtype.kind in "OmM" else []
    if known and isinstance(known[0], (datetime.date, numpy.datetime64)):
        first = known[0]
    elif known and isinstance(known[0], (datetime.timedelta, numpy.timedelta64)):
        first = None
    else:
        return floats(values, name, rows)
    second = datetime.timedelta(seconds=1) if array.dtype == object else numpy.timedelta64(1, "s")
    try:
        return numpy.array([math.nan if missing(one) else (one if first is None else one - first) / second
                            for one in array], float)
    except (TypeError, ValueError):
        raise InputTypeError(f"{name}: seconds are expected, as numbers, as durations or as dates of one kind") from None


def ranked(values, name, rows):
    """Indices of the values among those there are, in order, and their names; missing ones are -1."""
    array = one_a_row(values, name, rows, object)
    lost = numpy.array([missing(one) for one in array], bool)
    known = [item(one, name, at) for at, one in enumerate(array) if not lost[at]]
    try:
        kinds = sorted(set(known))
    except TypeError:
        kinds = sorted(set(known), key=str)
    place = {one: index for index, one in enumerate(kinds)}
    index = numpy.full(rows, -1)
    index[~lost] = [place[one] for one in known]
    return index, [str(one) for one in kinds]


def require_no_mark(values, name, index):
    """Refuses a value that stands for missing ones: it is there again and again, far from all others. Rows between the
    first and the last of a trial count: trials may all begin, or end at a stop, far from where they go. Nor is 0 a
    mark, as machines do stand still."""
    if not len(index):
        return
    turns = index[1:] != index[:-1]
    between = ~(numpy.concatenate([[True], turns]) | numpy.concatenate([turns, [True]]))
    found, counts = numpy.unique(values[between & numpy.isfinite(values)], return_counts=True)
    often = counts >= max(3, 0.005 * len(values))  # These rows stand between the ends of trials; all rows count below.
    for one in found[often & (found != 0)]:
        others = values[numpy.isfinite(values) & (values != one)]
        count = int((values == one).sum())
        if not len(others) or count < 0.01 * len(values):
            continue
        low, high = numpy.percentile(others, [25, 75])
        scale = high - low if high > low else others.max() - others.min()
        if scale > 0 and numpy.abs(others - one).min() > 20 * scale:
            raise InputError(f"{name} is {one:g} in {count} of {len(values)} rows, far from all "
                             "other values: is it a mark for missing values? Give NaN there (in a file: no value)")
