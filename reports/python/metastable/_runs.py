"""The logs of a real machine: rows, trial by trial, checked and laid out."""

import math
import os

import numpy

from metastable import _metastable
from metastable._arguments import by_name, kind, words
from metastable._columns import (array_of, column_of, floats, item, missing, one_a_row, ranked, require_no_mark,
                                 seconds)
from metastable._errors import InputError, InputTypeError
from metastable._machines import Machine, within_half_a_turn


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
        one[0] = about + within_half_a_turn(one[0] - about)
        values[begin + known] = one[0] + numpy.concatenate([[0], numpy.cumsum(within_half_a_turn(numpy.diff(one)))])
    return values


class _LostRows:
    """The rows that a column step tells to be missing, put in: nothing was measured in them."""

    def __init__(self, step, index, names):
        self.index, self.names = index, names
        self.steps = floats(step, "step", len(index))
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
            return given if given is not None else column_of(data, name)

        trial = find("trial")
        if trial is None:
            raise InputError("runs: there is no column trial, which says to which trial each row belongs")
        if not hasattr(trial, "__len__") or isinstance(trial, (str, bytes)):
            raise InputTypeError(f"trial: one for every row expected, not {trial!r} for all of them")
        self.rows = rows = len(trial)
        trial = numpy.array([None if missing(one) else item(one, "trial", at)
                             for at, one in enumerate(one_a_row(trial, "trial", rows, object))], object)
        by_condition = find("condition")
        by_condition = numpy.full(rows, "all") if by_condition is None else array_of(by_condition, "condition", object)
        condition, conditions = ranked(by_condition, "condition", rows)
        if rows and condition.min() < 0:
            raise InputError(f"condition: row {int(condition.argmin()) + 1} has none")
        index = self._in_order(trial, condition, rows)
        self.trials = int(index.max()) + 1 if rows else 0
        first = numpy.searchsorted(index, numpy.arange(self.trials))
        names = self._names(trial[first], condition[first], conditions)
        seen = self._measured(machine, find, index)
        phase, phases = (numpy.full(rows, -1), []) if find("phase") is None else ranked(find("phase"), "phase", rows)
        label_index, label_values = self._labels(data, labels, rows)
        given_inputs = self._inputs(machine, data, inputs, rows)
        given_outcome = column_of(data, "outcome") if outcome is None else outcome
        by_row = outcome is None and hasattr(given_outcome, "__len__") and not isinstance(given_outcome, (str, dict)) and \
            len(given_outcome) == rows
        time, position = (numpy.full(rows, math.nan) if find(name) is None else read(find(name), name, rows)
                          for name, read in (("time_s", seconds), ("position_m", floats)))
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
            outcome=self._outcomes_of_rows(given_outcome, index, names) if by_row else
            _outcomes(given_outcome, trial[first], by_condition[first], conditions, rows))

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
            seen.append(floats(values, state, len(index)))
            require_no_mark(seen[-1], state, index)
        return numpy.column_stack(seen) if len(index) else numpy.zeros((0, len(seen)))

    @staticmethod
    def _labels(data, labels, rows):
        label_index, label_values = [], {}
        for name in words(labels if not isinstance(labels, dict) else labels.keys(), "labels"):
            if name in label_values:
                raise InputError(f"labels: '{name}' is there twice")
            values = labels[name] if isinstance(labels, dict) else column_of(data, name)
            if values is None:
                raise InputError(f"labels: there is no column {name}")
            at, label_values[name] = ranked(values, name, rows)
            label_index.append(at)
        return label_index, label_values

    @staticmethod
    def _inputs(machine, data, inputs, rows):
        stated, given = {} if inputs is None else by_name(inputs, "inputs", "{name: column}"), []
        for name in stated:
            if name not in machine.inputs:
                raise InputError(f"inputs: \"{name}\" is none of the machine's: {', '.join(machine.inputs) or 'it has none'}")
        for name in machine.inputs:
            values = stated.get(name) if stated.get(name) is not None else column_of(data, name)
            if values is None:
                raise InputError(f"inputs: there is no column {name}, which the machine's step takes")
            given.append(floats(values, name, rows))
        return given

    @staticmethod
    def _in_order(trial, condition, rows):
        """Numbers trials, those of each condition by themselves, in the order in which they come; the rows of one stand
        together."""
        seen, index = {}, numpy.zeros(rows, int)
        before = None
        for at, key in enumerate(zip(condition.tolist(), trial.tolist())):
            if key[1] is None:
                raise InputError(f"trial: row {at + 1} has none")
            if key != before and key in seen:
                raise InputError(f"trial: the rows of trial {key[1]} do not stand together: rows come in the order they "
                                 "were taken, trial by trial")
            index[at] = seen.setdefault(key, len(seen))
            before = key
        return index

    @staticmethod
    def _outcomes_of_rows(values, index, names):
        """Those of a column with one for each row, which some rows of a trial may lack."""
        found = [None] * len(names)
        for trial, one in zip(index, map(_outcome_word, one_a_row(values, "outcome", len(index), object))):
            if None not in (one, found[trial]) and one != found[trial]:
                raise InputError(f"outcome: trial {names[trial]} has \"{found[trial]}\" and \"{one}\" among its rows: one "
                                 "outcome for each trial expected")
            found[trial] = one or found[trial]
        return found

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
    if isinstance(outcome, str) or not hasattr(outcome, "__len__"):
        given = "one word" if isinstance(outcome, str) else kind(outcome)
        raise InputTypeError(f"outcome: one for each of the {len(trials)} trials expected, not {given}")
    if getattr(outcome, "ndim", 1) != 1:
        raise InputError("outcome: one for each trial expected, not a table")
    series = hasattr(outcome, "items") and hasattr(outcome, "index") and not callable(outcome.index)
    values = _listed(outcome) if series or not hasattr(outcome, "items") else None
    if series and not (len(values) == rows != len(trials)):  # a column of all rows is refused below
        values = _outcomes_of_series(outcome, trials, conditions, condition_names)
    elif hasattr(outcome, "items") and not series:
        values = _outcomes_by_trial(outcome.items(), trials, conditions, condition_names)
    if len(values) != len(trials):
        raise InputError(f"outcome: {len(values)} given, one for each of the {len(trials)} trials expected")
    return [_outcome_word(one) for one in values]


def _outcome_word(one):
    if missing(one):
        return None
    if str(one) not in ("failed", "stopped", "lost"):
        raise InputError(f"outcome: \"{one}\" is none of failed, stopped, lost")
    return str(one)


def _listed(outcome):
    return outcome.tolist() if hasattr(outcome, "tolist") else array_of(outcome, "outcome", object).tolist()


def _outcomes_of_series(series, trials, conditions, condition_names):
    """Those of a pandas.Series: by its index, or in their order where the index only counts them."""
    in_order, index = _listed(series), list(series.index)
    if type(series.index).__name__ != "RangeIndex" or len(index) != len(trials) or index != list(range(len(index))):
        return _outcomes_by_trial(series.items(), trials, conditions, condition_names)
    if set(index) != set(trials.tolist()):
        return in_order
    by_trial = _outcomes_by_trial(series.items(), trials, conditions, condition_names)
    if any(one is not other and (missing(one) or missing(other) or one != other)
           for one, other in zip(in_order, by_trial)):
        raise InputError("outcome: the index of the Series counts from 0, and so do the trials, which come in another "
                         "order: give a dict by trial, or a list in the order of the trials")
    return in_order


def _outcomes_by_trial(items, trials, conditions, condition_names):
    """Those of keys that are trials, or (condition, trial) where several conditions have such a trial."""
    def plain(one):
        return one.item() if hasattr(one, "item") else one

    places = {}
    for at, (condition, trial) in enumerate(zip(map(plain, conditions), trials)):
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


def runs(machine, data=None, *, outcome=None, labels=(), inputs=None, **columns):
    """Runs of the real machine: one row for each state, in the order in which they were taken, trial by trial.

    Raises InputError with a sentence where they cannot be: so where a measured value that is far from all others stands
    in row after row, as -999 does for missing values.

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
              "failed": the machine failed in the step after the trial's last row. A column outcome of data may have
              one for each row, too: the same in all rows of a trial that have any
    labels    names of columns of labels (a crew, a floor), or a dict of them
    inputs    a dict of the machine's inputs, where they are not in data
    """
    if not isinstance(machine, Machine):
        raise InputTypeError(f"runs: a Machine expected first, not {kind(machine)}")
    if isinstance(data, (str, os.PathLike)):
        if columns or outcome is not None or inputs or isinstance(labels, dict):
            raise InputError("runs: a folder holds all columns, inputs and outcomes; only names of labels go with it")
        read = _metastable.read_runs(machine._fields(), os.fspath(data), list(words(labels, "labels")))
        return Runs(machine, read["columns"], {}, read["outcome"], read["labels"], read["inputs"])
    return Runs(machine, data, columns, outcome, labels, inputs)
