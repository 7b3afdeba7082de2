"""Machines of your own: a simulator with names, and the logs of the real one."""

import datetime
import math
import numbers
import os

import numpy

import metastable
from metastable import _metastable
from metastable._errors import InputError


def _words(names, what):
    names = (names,) if isinstance(names, str) else tuple(names)
    for name in names:
        if not isinstance(name, str):
            raise TypeError(f"{what}: words expected, not {type(name).__name__}")
    return names


def _row_of_numbers(value, least, most, what):
    values = tuple(value) if isinstance(value, (tuple, list, numpy.ndarray)) else (value,)
    if not least <= len(values) <= most:
        raise InputError(f"{what}: {len(values)} numbers given, {least} to {most} expected")
    for one in values:
        if isinstance(one, bool) or not isinstance(one, numbers.Real):
            raise TypeError(f"{what}: numbers expected, not {type(one).__name__}")
    return tuple(float(one) for one in values)


def _parameter(name, value):
    numbers_given = _row_of_numbers(value, 1, 4, f"parameters: {name}")
    return (numbers_given + (0.0, -math.inf, math.inf)[len(numbers_given) - 1:]) if len(numbers_given) < 4 else numbers_given


def _sensor(state, value):
    sd, correlation = value if isinstance(value, (tuple, list)) and len(value) == 2 else (value, 0.0)
    if isinstance(sd, (tuple, list)):
        raise InputError(f"sensor: {state}: (sd, correlation) expected")
    sd = None if sd is None else _row_of_numbers(sd, 1, 1, f"sensor: {state}")[0]
    return sd, _row_of_numbers(correlation, 1, 1, f"sensor: {state}: correlation")[0]


def _within_half_a_turn(angle):
    return angle - 2 * math.pi * numpy.round(angle / (2 * math.pi))


def _turning(step, at):
    """A step whose angles, the states `at`, go on beyond a turn: `step` gets them within pi of zero, and of the angles
    that are alike those come next that lie within pi of the ones before."""
    def turning(state, noise, p):
        turned = numpy.array(state)
        turned[:, at] = _within_half_a_turn(turned[:, at])
        turned.setflags(write=False)
        returned = step(turned, noise, p)
        if not isinstance(returned, tuple) or len(returned) != 2 or numpy.shape(returned[0]) != numpy.shape(state):
            return returned  # It is refused with the sentence that any step gets.
        following = numpy.array(returned[0], float)
        following[:, at] = state[:, at] + _within_half_a_turn(following[:, at] - state[:, at])
        return following, returned[1]
    return turning


def _unwrapped(values, state, index, names, about):
    """An angle that goes on beyond a turn along each trial, from within pi of `about`, or of the middle of all first ones."""
    values = values.copy()
    if about is None:  # Trials that are written in different turns begin in one.
        first = [own[0] for own in (values[(index == trial) & numpy.isfinite(values)] for trial in range(len(names))) if len(own)]
        about = math.atan2(numpy.sin(first).sum(), numpy.cos(first).sum()) if first else 0
    for trial in range(len(names)):
        begin, end = numpy.searchsorted(index, [trial, trial + 1])
        known = numpy.flatnonzero(numpy.isfinite(values[begin:end]))
        gaps = numpy.flatnonzero(numpy.diff(known) > 1)
        if len(gaps):
            raise InputError(f"angles: {state} is missing in trial {names[trial]}, row {known[gaps[0]] + 2}, and comes "
                             "back: how many turns it made there is not known. End the trial there, or give the angle "
                             "unwrapped and not under angles")
        if not len(known):
            continue
        one = values[begin + known]
        one[0] = about + _within_half_a_turn(one[0] - about)
        values[begin + known] = one[0] + numpy.concatenate([[0], numpy.cumsum(_within_half_a_turn(numpy.diff(one)))])
    return values


class Machine:
    """A simulator with its names; see machine()."""

    def __init__(self, step, *, states, noise, parameters, effects, may_vary, sensor, launch, inputs, most_wild, angles, units,
                 name):
        if not callable(step):
            raise TypeError(f"step: a function expected, not {type(step).__name__}")
        self.noise, self.name = noise, name
        self.states, self.angles = _words(states, "states"), _words(angles, "angles")
        for angle in self.angles:
            if angle not in self.states:
                raise InputError(f"angles: \"{angle}\" is none of the states {', '.join(self.states)}")
        self._given_step = step
        self.step = _turning(step, [self.states.index(angle) for angle in self.angles]) if self.angles else step
        self.parameters = {key: _parameter(key, value) for key, value in dict(parameters).items()}
        self.effects = {key: {one: _row_of_numbers(value, 3, 3, f"effects: {key}: {one}") for one, value in dict(inner).items()}
                        for key, inner in dict(effects).items()}
        self.may_vary = _words(may_vary, "may_vary")
        sensor = {state: None for state in self.states} if sensor is None else dict(sensor)
        self.sensor = {state: _sensor(state, value) for state, value in sensor.items()}
        self.launch = {state: _row_of_numbers(value, 2, 2, f"launch: {state}") for state, value in dict(launch).items()}
        self.inputs = _words(inputs, "inputs")
        self.most_wild = most_wild
        self.units = self._stated_units(dict(units))
        _metastable.check_machine(self._fields())

    def _stated_units(self, units):
        known = [*self.states, *self.parameters, *(name for inner in self.effects.values() for name in inner), *self.inputs]
        for name, unit in units.items():
            if name not in known:
                raise InputError(f"units: \"{name}\" is none of {', '.join(known)}")
            if not isinstance(unit, str):
                raise TypeError(f"units: {name}: a word expected, not {type(unit).__name__}")
        return units

    def _fields(self):
        return {key: list(value) if isinstance(value, tuple) else value for key, value in self.__dict__.items()}

    def walker(self, start=None, **values):
        """Its nominal model as a Walker, for study() and simulate().

        start   the state that walks begin from; None: the means of `launch`
        values  of parameters and of the effects' parameters that differ from the nominal and the neutral ones, within
                their bounds
        """
        nominal = {name: value[0] for name, value in self.parameters.items()}
        for parameters in self.effects.values():
            nominal.update({name: value[0] for name, value in parameters.items()})
        unknown = set(values) - set(nominal)
        if unknown:
            raise InputError(f"walker: \"{sorted(unknown)[0]}\" is none of {', '.join(nominal)}")
        if self.inputs:
            raise InputError("walker: a machine with inputs has no steps of its own")
        if start is None:
            missing = [state for state in self.states if state not in self.launch]
            if missing:
                raise InputError(f"walker: start: launch has no {missing[0]}: give the state that walks begin from")
            start = [self.launch[state][0] for state in self.states]
        bounds = {name: (value[2:], name) for name, value in self.parameters.items()}
        for effect, parameters in self.effects.items():
            bounds.update({name: (value[1:], f"{effect}: {name}") for name, value in parameters.items()})
        for name, value in values.items():
            (lower, upper), what = bounds[name]
            nominal[name] = _row_of_numbers(value, 1, 1, f"walker: {what}")[0]
            if not math.isfinite(nominal[name]) or not lower <= nominal[name] <= upper:
                raise InputError(f"walker: {what}: {nominal[name]:g} is outside its bounds [{lower:g}, {upper:g}]")
        return metastable.walker(lambda state, noise: self._step_with(nominal, state, noise), len(self.states), self.noise,
                                 start=start, names=self.states, name=self.name, angles=self.angles)

    def _step_with(self, values, state, noise):
        given = dict(values)
        returned = self._given_step(state, noise, given)
        if len(given) != len(values) or any(given.get(name) is not value for name, value in values.items()):
            raise InputError("step: it writes into p, which it may only read")
        return returned

    def __repr__(self):
        return (f"<metastable.Machine: {self.name}, states {', '.join(self.states)}, {self.noise} noise, "
                f"{len(self.parameters)} parameters, {len(self.effects)} suspected effects>")


def _column(data, name):
    if data is None:
        return None
    try:
        return data[name]
    except (KeyError, IndexError, ValueError):
        return None
    except TypeError:
        raise TypeError(f"data: anything with columns by name expected (a DataFrame, a dict of arrays), not "
                        f"{type(data).__name__}") from None


def _missing(one):
    """None, NaN, NaT, or the missing value of pandas, which can be compared with nothing."""
    if one is None or type(one).__name__ in ("NAType", "NaTType"):
        return True
    return isinstance(one, (numbers.Number, numpy.datetime64, numpy.timedelta64)) and bool(one != one)


def _one_a_row(values, name, rows, kind=None):
    array = numpy.asarray(values, kind)
    if array.ndim != 1 or len(array) != rows:
        raise InputError(f"{name}: shape {array.shape} given, ({rows},) expected: one value a row")
    return array


def _floats(values, name, rows):
    """Numbers of a column; NaN where one is missing, as an empty text of a CSV file is."""
    if numpy.ma.isMaskedArray(values):
        raise TypeError(f"{name}: a masked array is given: fill what is missing with NaN")
    array = _one_a_row(values, name, rows)
    if array.dtype.kind in "mMc":  # NumPy would count nanoseconds, or drop the imaginary part.
        raise TypeError(f"{name}: an array of numbers expected, not of {array.dtype}")
    if array.dtype == object or array.dtype.kind in "US":
        array = numpy.array([math.nan if _missing(one) or _blank(one) else one for one in array], object)
    try:
        return array.astype(float)
    except (TypeError, ValueError):
        raise TypeError(f"{name}: numbers expected, and NaN for missing ones{_first_no_number(array)}") from None


def _blank(one):
    return isinstance(one, (str, bytes)) and not one.strip()


def _first_no_number(array):
    """Names the first value that is no number."""
    for at, one in enumerate(array):
        try:
            float(one)
        except (TypeError, ValueError):
            return f", not {str(one)!r} in row {at + 1}"
    return ""


def _seconds(values, name, rows):
    """Times in seconds: numbers as they are, durations in seconds, dates in seconds since the first of them."""
    array = _one_a_row(values, name, rows)
    known = [one for one in array if not _missing(one)] if array.dtype.kind in "OmM" else []
    if known and isinstance(known[0], (datetime.date, numpy.datetime64)):
        first = known[0]
    elif known and isinstance(known[0], (datetime.timedelta, numpy.timedelta64)):
        first = None
    else:
        return _floats(values, name, rows)
    second = datetime.timedelta(seconds=1) if array.dtype == object else numpy.timedelta64(1, "s")
    try:
        return numpy.array([math.nan if _missing(one) else (one if first is None else one - first) / second
                            for one in array], float)
    except (TypeError, ValueError):
        raise TypeError(f"{name}: seconds are expected, as numbers, as durations or as dates of one kind") from None


def _ranked(values, name, rows):
    """Indices of the values among those there are, in order, and their names; missing ones are -1."""
    array = _one_a_row(values, name, rows, object)
    missing = numpy.array([_missing(one) for one in array], bool)
    known = list(array[~missing])
    try:
        kinds = sorted(set(known))
    except TypeError:
        kinds = sorted(set(known), key=str)
    place = {one: index for index, one in enumerate(kinds)}
    return (numpy.array([-1 if lost else place[one] for one, lost in zip(array, missing)], int),
            [str(one.item() if hasattr(one, "item") else one) for one in kinds])


def _require_no_mark(values, name, index):
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


class _LostRows:
    """The rows that a column step tells to be missing, put in: nothing was measured in them."""

    def __init__(self, step, index, names):
        self.index, self.names = index, names
        self.steps = _floats(step, "step", len(index))
        self.first = numpy.searchsorted(index, numpy.arange(len(names)))
        whole = numpy.isfinite(self.steps) & (self.steps == numpy.round(self.steps))
        if not whole.all():
            at = int(whole.argmin())
            raise InputError(f"step: it is {self.steps[at]:g} in {self._where(at)}: a whole number is expected, the "
                             "step's in its trial")
        same = index[1:] == index[:-1]
        ahead = numpy.where(same, numpy.diff(self.steps), 1)
        if (ahead < 1).any():
            at = int((ahead < 1).argmax()) + 1
            raise InputError(f"step: it is {self.steps[at]:.15g} in {self._where(at)}, after {self.steps[at - 1]:.15g} "
                             "in the row before: steps are expected to rise within a trial")
        if same.any() and ahead[same].min() > 1:
            raise InputError(f"step: it rises by {ahead[same].min():.15g} at least from each row to the next: numbers "
                             "of steps are expected, of which some may be missing; does it number something else?")
        self._require_few(ahead)
        self.goes_on = numpy.append(same, False)[:len(index)]  # The trial has another row behind this one.
        self.after = numpy.append(ahead, 1)[:len(index)].astype(int) - 1  # This many lost rows follow each row.
        self.source = numpy.repeat(numpy.arange(len(index)), 1 + self.after)
        self.place = numpy.arange(len(index)) + numpy.cumsum(self.after) - self.after  # Here the rows given stand.
        self.ahead = numpy.arange(len(self.source)) - self.place[self.source]  # It is 0 for a row that was given.
        self.lost = self.ahead > 0

    def _require_few(self, ahead):
        rows, longest = len(self.index), numpy.bincount(self.index, minlength=1).max()
        if not rows or (numpy.max(ahead, initial=1) - 1 <= 10 * longest and (ahead - 1).sum() <= 10 * rows):
            return
        at = int(ahead.argmax()) + 1
        raise InputError(f"step: it is {self.steps[at]:.15g} in {self._where(at)}, after {self.steps[at - 1]:.15g} "
                         f"in the row before, so that {(ahead - 1).sum():.15g} rows are missing beside the {rows} "
                         "there are: a step number is wrong, or step numbers something else")

    def _where(self, at):
        return f"trial {self.names[self.index[at]]}, row {at - self.first[self.index[at]] + 1}"

    def nothing(self, values):
        """Measured values, [rows x columns]."""
        return numpy.where(self.lost[:, None], math.nan, values[self.source])

    def evenly(self, values):
        """A clock or a place, which goes on evenly from the row before to the row after."""
        change = numpy.append(values[1:], math.nan)[:len(values)] - values
        return numpy.where(self.lost, values[self.source] + change[self.source] * self.ahead /
                           (1 + self.after[self.source]), values[self.source])

    def held(self, values, name):
        """An input, which a step needs: known where it is the same for all steps of its trial."""
        for row in numpy.flatnonzero(self.after):
            begin, end = numpy.searchsorted(self.index, [self.index[row], self.index[row] + 1])
            if (values[begin:end - 1] != values[row]).any():  # The last row has no step.
                self._refuse(row, 1, f"inputs: {name}", name)
        return values[self.source]

    def going_on(self, values, name, stays):
        """Indices of words: what was seen to follow what leads one way only from the row before to the row after.
        @param stays  what never changes within a trial goes on, though no row was seen to follow another"""
        kept = values[self.source]
        changes = numpy.append(values[1:] != values[:-1], False)[:len(values)]
        if not self.after.any() or (stays and not changes[self.goes_on].any()):
            return kept
        onward, back = {}, {}
        for one, other in {(values[at], values[at + 1]) for at in numpy.flatnonzero(self.goes_on & (self.after == 0))}:
            if min(one, other) >= 0:
                onward.setdefault(one, set()).add(other)
                back.setdefault(other, set()).add(one)
        for row in numpy.flatnonzero(self.after):
            at, count = self.place[row], self.after[row]
            if min(values[row], values[row + 1]) < 0:
                kept[at + 1:at + 1 + count] = -1
                continue
            reached, leading = [{values[row]}], [{values[row + 1]}]
            for _ in range(count):
                reached.append(set().union(*(onward.get(one, ()) for one in reached[-1])))
                leading.append(set().union(*(back.get(one, ()) for one in leading[-1])))
            for k in range(1, count + 1):
                possible = reached[k] & leading[count + 1 - k]
                if len(possible) != 1:
                    self._refuse(row, k, f"{name}: its value", f"{name} (None: not known)")
                kept[at + k], = possible
        return kept

    def _refuse(self, row, ahead, subject, wanted):
        raise InputError(f"{subject} in the lost step {self.steps[row] + ahead:.15g} of trial "
                         f"{self.names[self.index[row]]} does not follow from the other rows: put the row in, with its "
                         f"{wanted}, and NaN for what was measured")


class Runs:
    """Rows of the real machine; see runs()."""

    def __init__(self, machine, data, columns, outcome, labels, inputs):
        self._require_known(machine, columns)

        def find(name):
            given = columns.get(name)
            return given if given is not None else _column(data, name)

        trial = find("trial")
        if trial is None:
            raise InputError("runs: there is no column trial, which says to which trial each row belongs")
        if not hasattr(trial, "__len__") or isinstance(trial, (str, bytes)):
            raise TypeError(f"trial: one for every row expected, not {trial!r} for all of them")
        self.rows = rows = len(trial)
        trial = _one_a_row(trial, "trial", rows)
        by_condition = find("condition") if find("condition") is not None else numpy.full(rows, "all")
        condition, conditions = _ranked(by_condition, "condition", rows)
        if rows and condition.min() < 0:
            raise InputError(f"condition: row {int(condition.argmin()) + 1} has none")
        index = self._in_order(trial, condition, rows)
        self.trials = int(index.max()) + 1 if rows else 0
        first = numpy.searchsorted(index, numpy.arange(self.trials))
        names = self._names(trial[first], condition[first], conditions)
        seen = self._measured(machine, find, index)
        phase, phases = (numpy.full(rows, -1), []) if find("phase") is None else _ranked(find("phase"), "phase", rows)
        label_index, label_values = self._labels(data, labels, rows)
        given_inputs = self._inputs(machine, data, inputs, rows)
        time, position = (numpy.full(rows, math.nan) if find(name) is None else read(find(name), name, rows)
                          for name, read in (("time_s", _seconds), ("position_m", _floats)))
        other = "step" in machine.states or "step" not in columns and "step" in (*machine.inputs, *label_values)
        step = None if other else find("step")  # a column of this name that means something else numbers no rows
        lost = _LostRows(numpy.arange(rows) if step is None else step, index, names)
        self.lost = int(lost.lost.sum())
        self._columns = tuple(machine.sensor), machine.inputs, machine.angles
        seen, all_index = lost.nothing(seen), index[lost.source]
        for column, state in enumerate(machine.sensor):
            if state in machine.angles:
                seen[:, column] = _unwrapped(seen[:, column], state, all_index, names, machine.launch.get(state, (None,))[0])

        def stacked(all_columns, kind):
            return numpy.column_stack(all_columns) if all_columns else numpy.zeros((len(lost.source), 0), kind)

        self._laid_out = dict(
            trial=all_index, trial_names=names, seen=seen, time=lost.evenly(time),
            position=lost.evenly(position), phase=lost.going_on(phase, "phase", len(phases) < 2), phases=phases,
            conditions=conditions, trial_condition=condition[first], labels=label_values,
            label_index=stacked([lost.going_on(one, name, True) for one, name in zip(label_index, label_values)], int),
            input_values=stacked([lost.held(one, name) for one, name in zip(given_inputs, machine.inputs)], float),
            outcome=_outcomes(find("outcome") if outcome is None else outcome, trial[first],
                              numpy.asarray(by_condition, object)[first], conditions, rows))

    @staticmethod
    def _require_known(machine, columns):
        unknown = set(columns) - {"trial", "step", "condition", "phase", "time_s", "position_m", *machine.sensor}
        if unknown:
            name = sorted(unknown)[0]
            where = f": an input is given in inputs={{'{name}': ...}}" if name in machine.inputs else \
                f"; a label is given in labels={{'{name}': ...}}"
            raise InputError(f"runs: \"{name}\" is none of the columns trial, step, condition, phase, time_s, "
                             f"position_m, {', '.join(machine.sensor)}{where}")

    @staticmethod
    def _measured(machine, find, index):
        seen = []
        for state in machine.sensor:
            values = find(state)
            if values is None:
                raise InputError(f"runs: there is no column {state}, which the machine's sensor measures")
            seen.append(_floats(values, state, len(index)))
            _require_no_mark(seen[-1], state, index)
        return numpy.column_stack(seen) if len(index) else numpy.zeros((0, len(seen)))

    @staticmethod
    def _labels(data, labels, rows):
        label_index, label_values = [], {}
        for name in _words(labels if not isinstance(labels, dict) else labels.keys(), "labels"):
            if name in label_values:
                raise InputError(f"labels: '{name}' is there twice")
            values = labels[name] if isinstance(labels, dict) else _column(data, name)
            if values is None:
                raise InputError(f"labels: there is no column {name}")
            at, label_values[name] = _ranked(values, name, rows)
            label_index.append(at)
        return label_index, label_values

    @staticmethod
    def _inputs(machine, data, inputs, rows):
        given = []
        for name in machine.inputs:
            values = dict(inputs).get(name) if inputs else None
            values = values if values is not None else _column(data, name)
            if values is None:
                raise InputError(f"inputs: there is no column {name}, which the machine's step takes")
            given.append(_floats(values, name, rows))
        return given

    @staticmethod
    def _in_order(trial, condition, rows):
        """Numbers trials, those of each condition by themselves, in the order in which they come; the rows of one stand
        together."""
        seen, index = {}, numpy.zeros(rows, int)
        before = None
        for at, key in enumerate(zip(condition.tolist(), trial.tolist())):
            if _missing(key[1]):
                raise InputError(f"trial: row {at + 1} has none")
            if key != before and key in seen:
                raise InputError(f"trial: the rows of trial {key[1]} do not stand together: rows come in the order they "
                                 "were taken, trial by trial")
            index[at] = seen.setdefault(key, len(seen))
            before = key
        return index

    @staticmethod
    def _names(trial, condition, conditions):
        """What messages call the trials: as their user does, with the condition where there are several."""
        return [f"{name} of {conditions[at]}" if len(conditions) > 1 else str(name) for name, at in zip(trial, condition)]

    def __repr__(self):
        lost = f" and {self.lost} lost ones between them" if self.lost else ""
        return f"<metastable.Runs: {self.trials} trials, {self.rows} rows{lost}>"


def _outcomes(outcome, trials, conditions, condition_names, rows):
    """The outcomes in the order of the trials; None where one is not known."""
    if outcome is None:
        return [None] * len(trials)
    if isinstance(outcome, str):
        raise InputError(f"outcome: one for each of the {len(trials)} trials expected, not one word")
    if getattr(outcome, "ndim", 1) != 1:
        raise InputError("outcome: one for each trial expected, not a table")
    series = hasattr(outcome, "items") and hasattr(outcome, "index") and not callable(outcome.index)
    values = outcome.tolist() if hasattr(outcome, "tolist") else list(outcome)
    if series and not (len(values) == rows != len(trials)):  # a column of all rows is refused below
        values = _outcomes_of_series(outcome, trials, conditions, condition_names)
    elif hasattr(outcome, "items") and not series:
        values = _outcomes_by_trial(outcome.items(), trials, conditions, condition_names)
    if len(values) != len(trials):
        raise InputError(f"outcome: {len(values)} given, one for each of the {len(trials)} trials expected")
    return [None if _missing(one) else str(one) for one in values]


def _outcomes_of_series(series, trials, conditions, condition_names):
    """Those of a pandas.Series: by its index, or in their order where the index only counts them."""
    in_order, index = series.tolist(), list(series.index)
    if type(series.index).__name__ != "RangeIndex" or len(index) != len(trials) or index != list(range(len(index))):
        return _outcomes_by_trial(series.items(), trials, conditions, condition_names)
    if set(index) != set(trials.tolist()):
        return in_order
    by_trial = _outcomes_by_trial(series.items(), trials, conditions, condition_names)
    if any(one is not other and (_missing(one) or _missing(other) or one != other)
           for one, other in zip(in_order, by_trial)):
        raise InputError("outcome: the index of the Series counts from 0, and so do the trials, which come in another "
                         "order: give a dict by trial, or a list in the order of the trials")
    return in_order


def _outcomes_by_trial(items, trials, conditions, condition_names):
    """Those of keys that are trials, or (condition, trial) where several conditions have such a trial."""
    def plain(one):
        return one.item() if hasattr(one, "item") else one

    places = {}
    for at, (condition, trial) in enumerate(zip(map(plain, conditions), map(plain, trials))):
        places.setdefault(trial, []).append(at)
        places[condition, trial] = [at]
    found = {}
    for key, value in items:
        try:
            at = places[key]
        except (KeyError, TypeError):
            among = ", nor a (condition, trial)" if len(condition_names) > 1 else ""
            raise InputError(f"outcome: {key!r} is no trial{among}") from None
        if len(at) > 1:
            known = [plain(conditions[one]) for one in at]
            raise InputError(f"outcome: trial {key!r} is there in the conditions {', '.join(map(str, known))}: give "
                             f"(condition, trial), as ({known[0]!r}, {key!r})")
        if at[0] in found:
            raise InputError(f"outcome: {key!r} is there twice")
        found[at[0]] = value
    return [found.get(at) for at in range(len(trials))]


def machine(step, *, states, noise, parameters, effects={}, may_vary=(), sensor=None, launch={}, inputs=(), most_wild=0.01,
            angles=(), units={}, name="machine"):
    """Any simulator as a machine whose sim-to-real gap is diagnosed: diagnose(runs, machine) then takes it.

    step        step(state, noise, p) -> (next, failed), vectorised: `state` is an (n, states) array, `noise` an (n, noise)
                array of independent standard normal numbers, `p` maps every name of a parameter, of an effect's parameter
                and of an input to a number or to an array of n, so that it has to be written for both; `next` are the
                (n, states) states one step on, `failed` n booleans. It must be a function of its arguments alone and may
                not write into them. States that make no sense have failed; a NaN that is not marked so is refused.
    states      names of the numbers of a state, 1 to 30
    noise       numbers of noise a step, 1 to 16
    parameters  name -> (nominal, sd[, lower, upper]): the value, and the sd with which it is known; a recalibration refits
                those whose sd is above 0
    effects     id -> {name -> (neutral, lower, upper)}: what the machine may have and the nominal model lacks; the model
                holds it at the neutral value
    may_vary    parameters that may differ by phase, drift over the runs, scatter from trial to trial, go with the clock,
                the place, a state or a label
    sensor      state -> sd of its error, or (sd, correlation between neighbouring rows, -0.5 to 0.5); None for an sd that
                is fitted. States that are not named are not measured; without any, all are, with an sd that is fitted
    launch      state -> (mean, sd) of a trial's first value: a first row that has it is held against it (effects
                launch_STATE and launch_spread_STATE), and one that lacks it begins there
    inputs      names of recorded numbers that a step takes, by the row it starts from
    most_wild   largest share of rows that may say nothing (missed events, bad tracks), 0 to 0.2
    angles      states that are angles [rad] and may wrap: `step` gets them within pi of zero and may return them in any
                turn, and runs may hold them in any turn; they are taken to move by less than pi in a step
    units       name of a state, a parameter, an effect's parameter or an input -> its unit, in which the answer tells
                sizes of it. Without one a name tells it by its end: swing_rad_s is in rad/s, loss_n_m in N m, per_rad in
                1/rad; other names have none. Units are words in the answer, nothing is converted
    """
    return Machine(step, states=states, noise=noise, parameters=parameters, effects=effects, may_vary=may_vary,
                   sensor=sensor, launch=launch, inputs=inputs, most_wild=most_wild, angles=angles,
                   units=units, name=name)


def runs(machine, data=None, *, outcome=None, labels=(), inputs=None, **columns):
    """Runs of the real machine: one row for each state, in the order in which they were taken, trial by trial.

    Raises ValueError or TypeError with a sentence where they cannot be: so where a measured value that is far from all
    others stands in row after row, as -999 does for missing values.

    machine   of machine()
    data      anything with columns, a pandas.DataFrame or a dict of arrays: columns are looked for there where they are
              not given by name; or an experiment folder whose experiment.toml states model = "none"
    columns   trial, and every state that the machine's sensor measures (NaN or an empty text: missing); optionally
              step, condition, phase (which leg, which half of the cycle: it belongs to the step that starts from the
              row), time_s by one clock for all trials (durations and dates become seconds), position_m. step numbers
              the rows of a trial, from any whole number on; where some are left out, rows in which nothing was measured
              are put in. Time and place go on evenly in them, phases and labels as they are seen to follow each other,
              inputs that are the same all through the trial; what does not follow is refused
    outcome   "failed", "stopped" or "lost" by trial, as a dict or a pandas.Series whose keys are the trials, or
              (condition, trial) where each condition numbers its trials anew; or a list in the order of the trials.
              "failed": the machine failed in the step after the trial's last row
    labels    names of columns of labels (a crew, a floor), or a dict of them
    inputs    a dict of the machine's inputs, where they are not in data
    """
    if not isinstance(machine, Machine):
        raise TypeError(f"runs: a Machine expected first, not {type(machine).__name__}")
    if isinstance(data, (str, os.PathLike)):
        if columns or outcome is not None or inputs or isinstance(labels, dict):
            raise InputError("runs: a folder holds all columns, inputs and outcomes; only names of labels go with it")
        read = _metastable.read_runs(machine._fields(), os.fspath(data), list(_words(labels, "labels")))
        return Runs(machine, read["columns"], {}, read["outcome"], read["labels"], read["inputs"])
    return Runs(machine, data, columns, outcome, labels, inputs)
