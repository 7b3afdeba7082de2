"""Arguments as they are expected: names, numbers, and dicts of them; else a sentence with the argument's name."""

import inspect
import numbers
from collections.abc import Iterable

import numpy

from metastable._errors import InputError, InputTypeError


def kind(value):
    """What a sentence calls a value of the wrong kind."""
    return type(value).__name__


def words(names, what, ordered=False):
    """Names: one, or several. A set, which has no order, is refused where names have to be `ordered`."""
    if isinstance(names, str):
        return (names,)
    unordered = isinstance(names, (set, frozenset))
    if not isinstance(names, Iterable) or isinstance(names, bytes) or (unordered and ordered):
        raise InputTypeError(f"{what}: a name or a list of names expected, not {kind(names)}")
    names = tuple(sorted(names, key=str) if unordered else names)
    for name in names:
        if not isinstance(name, str):
            raise InputTypeError(f"{what}: words expected, not {kind(name)}")
    return tuple(str(name) for name in names)


def by_name(given, what, wanted, other_names=False):
    """A dict by name, of what the words `wanted` say; names are words, or with `other_names` anything."""
    pairs = isinstance(given, (list, tuple)) and all(isinstance(one, (list, tuple)) for one in given)
    try:
        values = dict(given) if pairs or hasattr(given, "keys") else None
    except (TypeError, ValueError):
        values = None
    if values is None:
        raise InputTypeError(f"{what}: a dict {wanted} expected, not {kind(given)}")
    for name in values:
        if not isinstance(name, str) and not other_names:
            raise InputTypeError(f"{what}: a dict {wanted} expected, whose names are words, not {kind(name)}")
    return values


def row_of_numbers(value, least, most, what, which=""):
    """From `least` to `most` numbers, or one alone, as a tuple; `which` names them, " (mean, sd)"."""
    if isinstance(value, numpy.ndarray) and value.ndim == 0:
        value = value.item()
    values = tuple(value) if isinstance(value, (tuple, list, numpy.ndarray)) else (value,)
    for one in values:
        if isinstance(one, bool) or not isinstance(one, numbers.Real):
            raise InputTypeError(f"{what}: {'a number' if most == 1 else 'numbers'}{which} expected, not {kind(one)}")
    if not least <= len(values) <= most:
        given = f"{len(values)} number{'' if len(values) == 1 else 's'} given"
        raise InputError(f"{what}: {given}, {least if least == most else f'{least} to {most}'} expected{which}")
    try:
        return tuple(float(one) for one in values)
    except OverflowError:
        raise InputError(f"{what}: a number is too large for double precision") from None


def require_call(function, count, what, called):
    """Refuses a function that cannot be called with `count` arguments."""
    try:
        signature = inspect.signature(function, follow_wrapped=False)
    except (TypeError, ValueError):  # Functions that are no Python need not tell theirs.
        return
    try:
        signature.bind(*[None] * count)
    except TypeError as error:
        raise InputTypeError(f"{what}: it is called as {called}, and takes other arguments ({error})") from None
