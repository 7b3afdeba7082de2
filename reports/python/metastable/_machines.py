"""Machines of your own: a simulator with names, and the logs of the real one."""

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


class Machine:
    """A simulator with its names; see machine()."""

    def __init__(self, step, *, states, noise, parameters, effects, may_vary, sensor, launch, inputs, most_wild, name):
        if not callable(step):
            raise TypeError(f"step: a function expected, not {type(step).__name__}")
        self.step, self.noise, self.name = step, noise, name
        self.states = _words(states, "states")
        self.parameters = {key: _parameter(key, value) for key, value in dict(parameters).items()}
        self.effects = {key: {one: _row_of_numbers(value, 3, 3, f"effects: {key}: {one}") for one, value in dict(inner).items()}
                        for key, inner in dict(effects).items()}
        self.may_vary = _words(may_vary, "may_vary")
        sensor = {state: None for state in self.states} if sensor is None else dict(sensor)
        self.sensor = {state: _sensor(state, value) for state, value in sensor.items()}
        self.launch = {state: _row_of_numbers(value, 2, 2, f"launch: {state}") for state, value in dict(launch).items()}
        self.inputs = _words(inputs, "inputs")
        self.most_wild = most_wild
        _metastable.check_machine(self._fields())

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
                                 start=start, names=self.states, name=self.name)

    def _step_with(self, values, state, noise):
        given = dict(values)
        returned = self.step(state, noise, given)
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


def _floats(values, name, rows):
    if numpy.ma.isMaskedArray(values):
        raise TypeError(f"{name}: a masked array is given: fill what is missing with NaN")
    try:
        array = numpy.asarray(values, float)
    except (TypeError, ValueError):
        raise TypeError(f"{name}: an array of numbers expected") from None
    if array.ndim != 1 or len(array) != rows:
        raise InputError(f"{name}: shape {array.shape} given, ({rows},) expected: one value a row")
    return array


def _ranked(values, name, rows):
    """Indices of the values among those there are, in order, and their names; missing ones are -1."""
    array = numpy.asarray(values, object)
    if array.ndim != 1 or len(array) != rows:
        raise InputError(f"{name}: shape {array.shape} given, ({rows},) expected: one value a row")
    missing = numpy.array([one is None or (isinstance(one, numbers.Real) and math.isnan(one)) for one in array], bool)
    known = list(array[~missing])
    try:
        kinds = sorted(set(known))
    except TypeError:
        kinds = sorted(set(known), key=str)
    place = {one: index for index, one in enumerate(kinds)}
    return (numpy.array([-1 if lost else place[one] for one, lost in zip(array, missing)], int),
            [str(one.item() if hasattr(one, "item") else one) for one in kinds])


class Runs:
    """Rows of the real machine; see runs()."""

    def __init__(self, machine, data, columns, outcome, labels, inputs):
        def find(name):
            given = columns.get(name)
            return given if given is not None else _column(data, name)

        unknown = set(columns) - {"trial", "condition", "phase", "time_s", "position_m", *machine.sensor}
        if unknown:
            name = sorted(unknown)[0]
            where = f": an input is given in inputs={{'{name}': ...}}" if name in machine.inputs else \
                f"; a label is given in labels={{'{name}': ...}}"
            raise InputError(f"runs: \"{name}\" is none of the columns trial, condition, phase, time_s, "
                             f"position_m, {', '.join(machine.sensor)}{where}")
        trial = find("trial")
        if trial is None:
            raise InputError("runs: there is no column trial")
        rows = len(trial)
        condition, conditions = ((numpy.zeros(rows, int), ["all"]) if find("condition") is None
                                 else _ranked(find("condition"), "condition", rows))
        if rows and condition.min() < 0:
            raise InputError(f"condition: row {int(condition.argmin()) + 1} has none")
        index = self._in_order(trial, condition, rows)
        self.trials = int(index.max()) + 1 if rows else 0
        seen = []
        for state in machine.sensor:
            values = find(state)
            if values is None:
                raise InputError(f"runs: there is no column {state}, which the machine's sensor measures")
            seen.append(_floats(values, state, rows))
        optional = {name: numpy.full(rows, math.nan) if find(name) is None else _floats(find(name), name, rows)
                    for name in ("time_s", "position_m")}
        phase, phases = (numpy.full(rows, -1), []) if find("phase") is None else _ranked(find("phase"), "phase", rows)
        label_index, label_values = [], {}
        for name in _words(labels if not isinstance(labels, dict) else labels.keys(), "labels"):
            if name in label_values:
                raise InputError(f"labels: '{name}' is there twice")
            values = labels[name] if isinstance(labels, dict) else _column(data, name)
            if values is None:
                raise InputError(f"labels: there is no column {name}")
            at, label_values[name] = _ranked(values, name, rows)
            label_index.append(at)
        given_inputs = []
        for name in machine.inputs:
            values = dict(inputs).get(name) if inputs else None
            values = values if values is not None else _column(data, name)
            if values is None:
                raise InputError(f"inputs: there is no column {name}, which the machine's step takes")
            given_inputs.append(_floats(values, name, rows))
        first = numpy.array([numpy.argmax(index == t) for t in range(self.trials)], int)
        self.rows = rows
        self._columns = tuple(machine.sensor), machine.inputs
        self._laid_out = dict(
            trial=index, trial_names=self._names(numpy.asarray(trial)[first], condition[first], conditions) if rows else [],
            seen=numpy.column_stack(seen) if rows else numpy.zeros((0, len(seen))),
            time=optional["time_s"], position=optional["position_m"], phase=phase, phases=phases,
            conditions=conditions, trial_condition=condition[first] if rows else numpy.zeros(0, int), labels=label_values,
            label_index=numpy.column_stack(label_index) if label_index else numpy.zeros((rows, 0), int),
            input_values=numpy.column_stack(given_inputs) if given_inputs else numpy.zeros((rows, 0)),
            outcome=self._outcomes(find("outcome") if outcome is None else outcome, numpy.asarray(trial)[first] if rows else []))

    @staticmethod
    def _in_order(trial, condition, rows):
        """Numbers trials, those of each condition by themselves, in the order in which they come; the rows of one stand
        together."""
        seen, index = {}, numpy.zeros(rows, int)
        before = None
        for at, key in enumerate(zip(condition.tolist(), numpy.asarray(trial).tolist())):
            if key[1] is None or key[1] != key[1]:
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

    def _outcomes(self, outcome, names):
        if outcome is None:
            return [None] * self.trials
        if isinstance(outcome, dict):
            known = [name.item() if hasattr(name, "item") else name for name in names]
            unknown = [key for key in outcome if key not in known]
            if unknown:
                raise InputError(f"outcome: {unknown[0]!r} is no trial")
            outcome = [outcome.get(name) for name in known]
        values = [None if one is None or one != one else str(one) for one in
                  (outcome.tolist() if hasattr(outcome, "tolist") else list(outcome))]
        if len(values) == self.trials:
            return values
        raise InputError(f"outcome: {len(values)} given, one for each of the {self.trials} trials expected")

    def __repr__(self):
        return f"<metastable.Runs: {self.trials} trials, {self.rows} rows>"


def machine(step, *, states, noise, parameters, effects={}, may_vary=(), sensor=None, launch={}, inputs=(), most_wild=0.01,
            name="machine"):
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
    """
    return Machine(step, states=states, noise=noise, parameters=parameters, effects=effects, may_vary=may_vary,
                   sensor=sensor, launch=launch, inputs=inputs, most_wild=most_wild, name=name)


def runs(machine, data=None, *, outcome=None, labels=(), inputs=None, **columns):
    """Runs of the real machine: one row for each state, in the order in which they were taken, trial by trial.

    machine   of machine()
    data      anything with columns, a pandas.DataFrame or a dict of arrays: columns are looked for there where they are
              not given by name; or an experiment folder whose experiment.toml states model = "none"
    columns   trial, and every state that the machine's sensor measures (NaN: missing); optionally condition, phase (which
              leg, which half of the cycle: it belongs to the step that starts from the row), time_s by one clock for all
              trials, position_m
    outcome   trial -> "failed", "stopped" or "lost", as a dict or in the order of the trials; "failed": the machine failed
              in the step after the trial's last row
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
