"""Machines of your own: a simulator with names."""

import math

import numpy

import metastable
from metastable import _metastable
from metastable._arguments import by_name, kind, require_call, row_of_numbers, words
from metastable._errors import InputError, InputTypeError


def within_half_a_turn(angle):
    """The angle [rad], within pi of zero."""
    return angle - 2 * math.pi * numpy.round(angle / (2 * math.pi))


def _turning(step, at):
    """A step whose angles, the states `at`, go on beyond a turn: `step` gets them within pi of zero, and of the angles
    that are alike those come next that lie within pi of the ones before."""
    def turning(state, noise, p):
        turned = numpy.array(state)
        turned[:, at] = within_half_a_turn(turned[:, at])
        turned.setflags(write=False)
        returned = step(turned, noise, p)
        if not isinstance(returned, tuple) or len(returned) != 2:
            return returned  # It is refused with the sentence that any step gets.
        following = numpy.array(returned[0])
        if following.shape != numpy.shape(state) or following.dtype.kind not in "fiu":
            return returned
        following = following.astype(float)
        following[:, at] = state[:, at] + within_half_a_turn(following[:, at] - state[:, at])
        return following, returned[1]
    return turning


def _parameter(name, value):
    given = row_of_numbers(value, 1, 4, f"parameters: {name}", " (nominal, sd[, lower, upper])")
    return given + (0.0, -math.inf, math.inf)[len(given) - 1:]


def _sensor(state, value):
    both = " (sd, correlation)"
    several = isinstance(value, (tuple, list)) or isinstance(value, numpy.ndarray) and value.ndim == 1
    sd, *rest = value if several and len(value) else (value,)
    if several and not 1 <= len(value) <= 2:
        raise InputError(f"sensor: {state}: {len(value)} numbers given, 1 to 2 expected{both}")
    sd = None if sd is None else row_of_numbers(sd, 1, 1, f"sensor: {state}", f" (sd) or two{both}")[0]
    return sd, row_of_numbers(rest[0] if rest else 0.0, 1, 1, f"sensor: {state}: correlation")[0]


class Machine:
    """A simulator with its names; see machine()."""

    def __init__(self, step, *, states, noise, parameters, effects, may_vary, sensor, launch, inputs, most_wild, angles, units,
                 name):
        if not callable(step):
            raise InputTypeError(f"step: a function expected, not {kind(step)}")
        require_call(step, 3, "step", "step(state, noise, p)")
        self.noise, self.name = noise, name
        self.states, self.angles = words(states, "states", ordered=True), words(angles, "angles")
        for angle in self.angles:
            if angle not in self.states:
                raise InputError(f"angles: \"{angle}\" is none of the states {', '.join(self.states)}")
        self._given_step = step
        self.step = _turning(step, [self.states.index(angle) for angle in self.angles]) if self.angles else step
        self.parameters = {one: _parameter(one, value) for one, value in
                           by_name(parameters, "parameters", "{name: (nominal, sd[, lower, upper])}").items()}
        self.effects = {one: {name: row_of_numbers(value, 3, 3, f"effects: {one}: {name}", " (neutral, lower, upper)")
                              for name, value in by_name(inner, f"effects: {one}", "{name: (neutral, lower, upper)}").items()}
                        for one, inner in by_name(effects, "effects", "{id: {name: (neutral, lower, upper)}}").items()}
        self.may_vary = words(may_vary, "may_vary")
        sensor = {state: None for state in self.states} if sensor is None else \
            by_name(sensor, "sensor", "{state: sd, or (sd, correlation), or None for an sd that is fitted}")
        self.sensor = {state: _sensor(state, value) for state, value in sensor.items()}
        self.launch = {state: row_of_numbers(value, 2, 2, f"launch: {state}", " (mean, sd)")
                       for state, value in by_name(launch, "launch", "{state: (mean, sd)}").items()}
        self.inputs = words(inputs, "inputs")
        self.most_wild = most_wild
        self.units = self._stated_units(by_name(units, "units", "{name: unit}"))
        _metastable.check_machine(self._fields())

    def _stated_units(self, units):
        known = [*self.states, *self.parameters, *(name for inner in self.effects.values() for name in inner), *self.inputs]
        for name, unit in units.items():
            if name not in known:
                raise InputError(f"units: \"{name}\" is none of {', '.join(known)}")
            if not isinstance(unit, str):
                raise InputTypeError(f"units: {name}: a word expected, not {kind(unit)}")
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
            nominal[name] = row_of_numbers(value, 1, 1, f"walker: {what}")[0]
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
