"""How long does a walking machine walk? The toolkit metastable from Python.

    import metastable

    setting = metastable.Setting(slope_deg=9.59, friction=(0.3, 0.05))
    study = metastable.study(setting)
    study.expected_steps.from_start, study.expected_steps.interval_95

Angles are in degrees where a name ends in `_deg`; everything else is in SI units. The same seed gives the same numbers
as the command line, to the bit, on any number of threads. Wrong arguments are an InputError (a ValueError; those of the
wrong kind also a TypeError), failed computations a ComputationError (a RuntimeError).
"""

import dataclasses
import decimal
import html
import itertools
import json
import math
import numbers
import operator
import os
import statistics
from typing import Iterable, Optional, Sequence, Tuple, Union

import numpy

from metastable import _frames, _metastable, _progress, blind
from metastable._arguments import by_name, kind, require_call, words
from metastable._columns import listed
from metastable._errors import ComputationError, Contradiction, InputError, InputTypeError, MapError
from metastable._machines import Machine, machine
from metastable._results import (Columns, Comparison, Description, Diagnosis, HowItFails, Record, Regime, Result, Solution,
                                 Study, Sweep, Table, WalkerComparison, WalkerStudy, Walks)
from metastable._runs import Runs, runs

__version__ = _metastable.version

__all__ = [
    "Chain", "Columns", "Comparison", "ComputationError", "Contradiction", "Description", "Diagnosis", "Experiment",
    "FirstPassage", "HowItFails", "InputError", "InputTypeError", "Machine", "MapError", "Passage", "QuasiStationary", "Record",
    "Regime", "Result", "Runs", "Setting", "SimulatedSteps", "Solution", "Study", "Sweep", "Table", "Walker", "WalkerComparison", "WalkerSetting", "WalkerStudy", "Walks",
    "blind", "chain", "compare", "describe", "diagnose", "effects", "experiment", "machine", "read_experiment", "runs", "simulate",
    "solve", "study", "sweep", "version_text", "walker",
]


def version_text():
    """Version, commit, compiler and libraries, as `metastable --version`."""
    return _metastable.version_text()


def _fields(instance):
    return {field.name: getattr(instance, field.name) for field in dataclasses.fields(instance)}


def _called(name, *what, **options):
    """The call that makes a result again, for its provenance."""
    words = [repr(each) for each in what]
    words += [f"{key}={value!r}" for key, value in options.items() if value is not None and value is not False]
    return f"metastable.{name}({', '.join(words)})"


@dataclasses.dataclass(frozen=True, eq=True)
class Setting:
    """A rimless wheel on a ramp, with its contact law and its noise. What is None is the paper's; `replace` changes.

    slope_deg           of the ramp [deg], from 0.001 to below half the angle between legs
    initial_speed       (mean, sd) just before collision 1 [rad/s], or "steady": of wheels that still roll long after
                        any launch; None: the paper's at 7.02 and 9.59 deg, elsewhere "steady"
    law                 "published", "coulomb", "plastic" or "settled"; None: "published", and answers then say as
                        well what wheels rolled under the law of rigid bodies, "settled", give
    restitution         eta, (mean, sd) of a normal truncated to [0, 1], or a constant; None: (0.4, 0.1)
    friction            mu, (mean, sd) of a normal truncated to [0, inf), or a constant; None: (0.4, 0.1)
    correlation         of the normal scores of eta and mu, (-1, 1)
    contact_list        instead of these three: pairs (eta, mu) to draw from, an array of n rows
    rebound_lost        share of the rebound's energy lost in hops, 0 to 1 (coulomb)
    legs                lengths [m] in the order they land, 3 or more, or one length for eight; None: the paper's eight
    mass                of the hub [kg]; None: 1.39
    inertia             about the stance foot [kg m^2]; None: mass times mean leg squared, and what the law adds
    radius_of_gyration  about the hub [m] (coulomb, plastic, settled); None: 0.05, under plastic 0
    tip_radius          of the legs' round tips [m] (settled); None: 0
    ramp_stiffness      [N/m] (published); None: 9000
    contact_mass        [kg] (published); None: the hub's
    gravity             [m/s^2]; None: 9.81
    ramp_length         [m]; None: 3.66; math.inf for a ramp without end
    first_leg           that lands at collision 1, counted from 0

    Raises InputError naming the quantity and its range.
    """

    slope_deg: float = 7.02
    initial_speed: Union[Tuple[float, float], float, str, None] = None
    law: Optional[str] = None
    restitution: Union[Tuple[float, float], float, None] = None
    friction: Union[Tuple[float, float], float, None] = None
    correlation: Optional[float] = None
    contact_list: Optional[Sequence[Tuple[float, float]]] = None
    rebound_lost: Optional[float] = None
    legs: Union[None, float, Sequence[float]] = None
    mass: Optional[float] = None
    inertia: Optional[float] = None
    radius_of_gyration: Optional[float] = None
    tip_radius: Optional[float] = None
    ramp_stiffness: Optional[float] = None
    contact_mass: Optional[float] = None
    gravity: Optional[float] = None
    ramp_length: Optional[float] = None
    first_leg: int = 0

    def __post_init__(self):
        if isinstance(self.legs, numbers.Real):
            object.__setattr__(self, "legs", (float(self.legs),) * 8)
        _metastable.describe_setting(_fields(self))
        # Plain numbers and tuples: equal settings compare, hash, print and pickle alike.
        for name, value in _fields(self).items():
            if value is not None and not isinstance(value, str):
                object.__setattr__(self, name, _plain(value))

    @property
    def launch(self):
        """(mean, sd) of the speed just before collision 1 [rad/s], the paper's where it was not given; None where it
        is steady, which a study finds (its `launch`)."""
        return _metastable.launch(_fields(self))

    def describe(self):
        """Every quantity in one line."""
        return _metastable.describe_setting(_fields(self))

    def replace(self, **changes):
        """The same setting with other values of some fields."""
        return dataclasses.replace(self, **changes)

    def __repr__(self):
        return _repr(self)


@dataclasses.dataclass(frozen=True, eq=True)
class WalkerSetting:
    """A walker on two legs on rough ground.

    walker        "simplest" (Garcia et al. 1998: lengths in legs, times in sqrt(l/g)), "compass" (Goswami et
                  al. 1998), or "biped", of five links, which only study(method="splitting") and simulate() take
    slope_sd_deg  sd of the slope from step to step [deg], in (0, 45)
    slope_deg     mean slope [deg], in (0, 45); None: 0.009 rad of the simplest, 3 deg of the compass, 1 deg of the
                  biped
    terrain       "fresh": a plane that tilts anew at every step; "facets": the feet still stand on the last one
    """

    walker: str
    slope_sd_deg: float
    slope_deg: Optional[float] = None
    terrain: str = "fresh"

    def __post_init__(self):
        _metastable.describe_walker(_fields(self))

    def describe(self):
        """Every quantity in one line."""
        return _metastable.describe_walker(_fields(self))

    def replace(self, **changes):
        """The same setting with other values of some fields."""
        return dataclasses.replace(self, **changes)

    def machine(self, *, sensor, slope_known_deg=0.1):
        """This walker as a machine whose walks are diagnosed: diagnose(runs, machine) then takes it.

        sensor           sds of the errors of its states, by name: half_angle_rad, stance_rate_rad_s and, of the compass,
                         swing_rate_rad_s; as machine() takes them
        slope_known_deg  sd with which the mean slope is known [deg]

        The suspected effect is impact_loss, a share of the energy that a strike takes beyond the plastic one; the mean
        slope may vary by phase, run, clock, place, state and label. The ground is one plane that tilts anew at every
        step (terrain "fresh"). Sixty walks of 15 steps are diagnosed in some ten seconds; where most walks end in a
        fall it takes many minutes.
        """
        if self.terrain != "fresh":
            raise InputError(f"terrain: '{self.terrain}' is no machine's: only fresh is")
        if self.walker == "biped":
            raise InputError("walker: 'biped' is none of simplest, compass, which can be machines")
        slope = self.slope_deg if self.slope_deg is not None else {"simplest": math.degrees(0.009), "compass": 3.0}[self.walker]
        fields = _fields(self)

        def step(state, noise, p):
            next_state, fell = _metastable.step_walkers(
                fields, state, p["slope_deg"] + p["slope_sd_deg"] * noise[:, 0])
            kept = numpy.broadcast_to(numpy.sqrt(1 - numpy.asarray(p["share"])), len(state))
            next_state[:, 1:] *= kept[:, None]
            return next_state, fell

        states = ["half_angle_rad", "stance_rate_rad_s"] + (["swing_rate_rad_s"] if self.walker == "compass" else [])
        return machine(step, states=states, noise=1, name=self.describe(), sensor=sensor, may_vary=["slope_deg"],
                       parameters={"slope_deg": (slope, slope_known_deg),
                                   "slope_sd_deg": (self.slope_sd_deg, self.slope_sd_deg, 1e-4 * self.slope_sd_deg, 45)},
                       effects={"impact_loss": {"share": (0, -0.2, 0.2)}})

    def __repr__(self):
        return _repr(self)


def _plain(value):
    value = value.tolist() if hasattr(value, "tolist") else value
    return tuple(_plain(each) for each in value) if isinstance(value, (list, tuple)) else value


def _repr(setting):
    given = [f"{f.name}={getattr(setting, f.name)!r}" for f in dataclasses.fields(setting)
             if f.default is dataclasses.MISSING or getattr(setting, f.name) != f.default]
    return f"{type(setting).__name__}({', '.join(given)})"


def study(setting, *, method=None, cells=None, samples=None, tolerance=None, sequence=None, draws=None, tail=None,
          replicates=None, mixing_distance=None, eigenvalues=None, direct=False, certify=False, sensitivities=False,
          standard_errors=None, spacing=None, simulated_steps=None, guided_samples=None, memory_gb=None,
          level=None, how_it_fails=False, seed=1, threads=0, time_limit=None, progress=None):
    """How many steps before it fails, with its 95 % interval, and what goes with that: `metastable steps`.

    setting          a Setting (returns a Study), a WalkerSetting, a Walker or a Machine, which stands for its walker()
                     (returns a WalkerStudy)

    Of a Setting:
    tolerance        relative half-width wanted of the interval of the expected steps, (0, 1); None: 0.01
    method           "sampled", or "integrated" for many digits; None: "sampled". Of a WalkerSetting or a Walker see below
    cells, samples   a landing leg, 8 to 4096, and draws a cell, 16 to 2^24; None: refined until the tolerance is met
    sequence         of the draws, "sobol" or "random"; draws: "weighted" or "plain"; tail: the probability they reach
    replicates       independent randomisations behind the interval, 2 to 64; None: 8
    mixing_distance  total variation distance that counts as mixed, (0, 1); None: 0.05
    eigenvalues      how many moduli, 1 to 64; None: 6
    direct           every landing followed instead of read from a table, hundreds of times slower (law "settled")
    certify          guaranteed bounds as well (law "published")
    sensitivities    how ln(expected steps) responds to each parameter, ranked
    standard_errors  of parameters by name, {"friction_mean": 0.01}: an interval from them is given apart

    Of a WalkerSetting or a Walker:
    method           "mesh"; "splitting", which takes a Walker of any dimension: an ensemble of replicas, split where
                     failures are near; or "auto": a mesh where it can be had and splitting beside it, which have to
                     agree; None: "mesh"
    tolerance        relative half-width wanted of the interval by splitting, (0, 1); None: 0.05
    spacing          of the coarsest mesh, in stationary sds of the noise, 0.05 to 2; None: by dimension
    simulated_steps  how many steps, about, direct simulation takes beside it, however rare failures are; None: 2
                     million, 0: none, and failures that the meshes step over may go unseen
    guided_samples   of the importance sampling beside it, asked above 100 steps; None: 4000, 0: none. It takes some
                     hundred rows of a Walker's step for each
    memory_gb        most memory of the meshes, that of a level too; None: 3
    level            what splitting splits by: "learnt", the chance of failing as it learns it; "mesh", that of a mesh,
                     in up to four dimensions; or, of a Walker or a Machine, level(state) -> n numbers that rise towards
                     failure, of an (n, dimension) array of states (with phases > 1 level(state, phase)); angles are
                     within pi of the start's; None: learnt

    Of all:
    how_it_fails     the last steps before failure as well, from the chain or from the walks that splitting sees fail
    seed             the same seed gives the same numbers, on any number of threads (0: all cores)
    time_limit       seconds after which a RuntimeError says how far the work was; None: 900. It changes no number
    progress         None: shown on a terminal and in a notebook; True, False, or a function of the share of the time
                     that has passed (0 to 1), 0 until it is known how long the rest takes; each part, as the steps and
                     then how it fails, begins at 0
    """
    options = dict(method=method, cells=cells, samples=samples, tolerance=tolerance, sequence=sequence, draws=draws,
                   tail=tail, replicates=replicates, mixing_distance=mixing_distance, eigenvalues=eigenvalues,
                   direct=direct, certify=certify, sensitivities=sensitivities, standard_errors=standard_errors,
                   spacing=spacing, simulated_steps=simulated_steps, guided_samples=guided_samples,
                   memory_gb=memory_gb, how_it_fails=how_it_fails, seed=seed, threads=threads, time_limit=time_limit)
    if level is not None and not callable(level) and not isinstance(level, str):
        raise InputTypeError(f'level: "learnt", "mesh" or a function expected, not {type(level).__name__}')
    if level is not None and not isinstance(setting, (Walker, Machine, WalkerSetting) if isinstance(level, str)
                                            else (Walker, Machine)):
        raise InputError("level: has no meaning under this setting")
    called = level if level is None or isinstance(level, str) else getattr(level, "__name__", "level")
    command = _called("study", setting, level=called,
                      **{key: value for key, value in options.items() if key not in ("threads", "time_limit")})
    if isinstance(level, str):
        options["level"], level = level, None
    if isinstance(setting, Machine):
        setting = setting.walker()
    with _progress.telling(progress, "study") as tell:
        if isinstance(setting, Setting):
            return Study(_metastable.study(_fields(setting), options, command, tell))
        if isinstance(setting, WalkerSetting):
            return WalkerStudy(_metastable.study_walkers([_fields(setting)], options, command, tell))
        if isinstance(setting, Walker):
            return WalkerStudy(_metastable.study_map(_fields(setting), options, command, tell, level))
    raise InputTypeError(f"setting: a Setting, WalkerSetting, Walker or Machine expected, not {type(setting).__name__}")


def compare(settings=None, *, collisions=16, method=None, cells=None, samples=None, tolerance=None, sequence=None,
            draws=None, tail=None, replicates=None, mixing_distance=None, eigenvalues=None, direct=False,
            standard_errors=None, spacing=None, simulated_steps=None, guided_samples=None, memory_gb=None, seed=1,
            threads=0, progress=None, **varied):
    """Expected steps of two or more settings on common random numbers, each compared with the first: `metastable
    compare`. Settings of the wheel give a Comparison, WalkerSettings a WalkerComparison.

    settings    two or more settings; or one Setting (None: the paper's), of which `varied` makes several
    varied      any field of Setting, and restitution_mean, restitution_sd, friction_mean and friction_sd: a list of
                values, or one. All combinations are compared, the first values together are the reference; of several
                slopes, as many launches are taken one a slope. What is a list itself, (mean, sd) or the legs of a
                wheel, is one value: a list of such lists holds several.

        metastable.compare(law=["published", "settled"], friction_mean=[0.4, 0.6])

    collisions  of a measured trial, 1 to 63: how many such trials would tell the settings apart
    The other arguments are those of study().
    """
    if settings is None or isinstance(settings, Setting):
        settings = _combinations(settings or Setting(), varied)
    elif varied:
        raise InputError(f"{next(iter(varied))}: varies one setting, and several are given")
    settings = list(settings)
    kinds = {type(setting) for setting in settings}
    if len(settings) < 2 or len(kinds) > 1 or not kinds <= {Setting, WalkerSetting}:
        raise InputError("settings: two or more of one kind, Setting or WalkerSetting, expected")
    options = dict(collisions=None if collisions == 16 else collisions, method=method, cells=cells, samples=samples,
                   tolerance=tolerance, sequence=sequence, draws=draws, tail=tail, replicates=replicates,
                   mixing_distance=mixing_distance, eigenvalues=eigenvalues, direct=direct,
                   standard_errors=standard_errors, spacing=spacing, simulated_steps=simulated_steps,
                   guided_samples=guided_samples, memory_gb=memory_gb, seed=seed, threads=threads)
    command = _called("compare", settings, **{key: value for key, value in options.items() if key != "threads"})
    fields = [_fields(setting) for setting in settings]
    with _progress.telling(progress, "compare") as tell:
        if kinds == {Setting}:
            return Comparison(_metastable.compare(fields, options, command, tell))
        return WalkerComparison(_metastable.study_walkers(fields, options, command, tell))


_moments = {"restitution_mean": ("restitution", 0), "restitution_sd": ("restitution", 1),
            "friction_mean": ("friction", 0), "friction_sd": ("friction", 1)}


def _values_of(name, given):
    """The values that an argument of compare() holds."""
    given = given.tolist() if hasattr(given, "tolist") else given
    if not isinstance(given, (list, tuple, range)):
        return [given]
    flat = all(isinstance(each, numbers.Real) for each in given)
    one = (name == "legs" and len(given) > 2) or name in ("initial_speed", "restitution", "friction")
    listed = name == "contact_list" and all(numpy.ndim(each) == 1 for each in given)
    return [given] if listed or (flat and one) else list(given)


def _with(setting, changes):
    """The setting with other values, of a mean or an sd alone too."""
    fields = {name: value for name, value in changes.items() if name not in _moments}
    for name, value in changes.items():
        if name in _moments:
            field, place = _moments[name]
            spread = fields.get(field, getattr(setting, field))
            spread = (0.4, 0.1) if spread is None else spread
            spread = list(spread) if isinstance(spread, (list, tuple)) else [spread, 0.0]
            spread[place] = value
            fields[field] = tuple(spread)
    return setting.replace(**fields)


def _combinations(setting, varied):
    """All combinations of the values, the last argument's fastest."""
    known = [field.name for field in dataclasses.fields(Setting)] + list(_moments)
    for name in varied:
        if name not in known:
            raise InputError(f"{name}: is neither an argument of compare nor a field of Setting")
    values = {name: _values_of(name, given) for name, given in varied.items()}
    for name in values:
        if not values[name]:
            raise InputError(f"{name}: holds no value")
    slopes, launches = values.get("slope_deg", ()), values.get("initial_speed", ())
    together = len(slopes) > 1 and len(launches) > 1
    if together and len(slopes) != len(launches):
        raise InputError(f"initial_speed: {len(launches)} values for {len(slopes)} slopes (give it once a slope, in order)")
    if together:
        values["slope_deg"] = list(zip(slopes, values.pop("initial_speed")))
    settings = []
    for each in itertools.product(*values.values()):
        changes = dict(zip(values, each))
        if together:
            changes["slope_deg"], changes["initial_speed"] = changes["slope_deg"]
        settings.append(_with(setting, changes))
    return settings


def sweep(setting, *, slope_deg=None, restitution_mean=None, restitution_sd=None, friction_mean=None, friction_sd=None,
          leg_length=None, inertia=None, ramp_stiffness=None, radius_of_gyration=None, contact_mass=None,
          tip_radius=None, method=None, cells=None, samples=None, tolerance=None, sequence=None, draws=None, tail=None,
          replicates=None, mixing_distance=None, eigenvalues=None, seed=1, threads=0, progress=None):
    """Expected steps over the product of ranges, rising values of what varies (units as in Setting): `metastable
    sweep`. A slope that varies keeps the setting's launch; where that is None, each is launched steadily. Returns a
    Sweep. Where the setting's law is None, wheels are rolled under "settled" at up to 16 points, and `rigid_bodies` says
    how the two compare.

    The other arguments are those of study().
    """
    axes = dict(slope_deg=slope_deg, restitution_mean=restitution_mean, restitution_sd=restitution_sd,
                friction_mean=friction_mean, friction_sd=friction_sd, leg_length=leg_length, inertia=inertia,
                ramp_stiffness=ramp_stiffness, radius_of_gyration=radius_of_gyration, contact_mass=contact_mass,
                tip_radius=tip_radius)
    axes = {name: values for name, values in axes.items() if values is not None}
    options = dict(method=method, cells=cells, samples=samples, tolerance=tolerance, sequence=sequence, draws=draws,
                   tail=tail, replicates=replicates, mixing_distance=mixing_distance, eigenvalues=eigenvalues,
                   seed=seed, threads=threads)
    with _progress.telling(progress, "sweep") as tell:
        found = _metastable.sweep(_fields(setting), axes, options, tell)
    return Sweep(found["columns"], "expected steps over " + ", ".join(axes), found["rigid_bodies"])


def solve(setting, parameter, *, steps=None, survive=None, reach=None, start=None, stop=None, points=None, method=None,
          cells=None, samples=None, tolerance=None, sequence=None, draws=None, tail=None, replicates=None,
          mixing_distance=None, eigenvalues=None, spacing=None, simulated_steps=None, guided_samples=None,
          memory_gb=None, seed=1, threads=0, progress=None):
    """Which value of a parameter gives the steps, or the survival, that are asked for: `metastable solve`. Returns a
    Solution, with every value that the points looked at show; none where it is out of reach.

    setting    a Setting or a WalkerSetting, with any value of the parameter
    parameter  of a Setting what sweep() varies ("slope_deg", "friction_mean", ...); of a WalkerSetting "slope_deg" or
               "slope_sd_deg"
    steps      wanted: so many expected steps, above 1; or
    survive    wanted: (n, p), a share p of all that takes more than n steps; or
    reach      wanted: a share of all that reaches the end of the ramp
    start      least value looked at; stop: the largest; None: by parameter
    points     values looked at first, 3 to 1000; None: 17, of a walker 9

    The interval of a value is what that of the expected steps leaves (tolerance). A slope that is solved for keeps the
    setting's launch; where that is None, each is launched steadily. The other arguments are those of study().
    """
    if not isinstance(setting, (Setting, WalkerSetting)):
        raise InputTypeError(f"setting: a Setting or WalkerSetting expected, not {type(setting).__name__}")
    if not isinstance(parameter, str):
        raise InputTypeError(f"parameter: a text expected, not {type(parameter).__name__}")
    options = dict(steps=steps, survive=survive, reach=reach, start=start, stop=stop, points=points, method=method,
                   cells=cells, samples=samples, tolerance=tolerance, sequence=sequence, draws=draws, tail=tail,
                   replicates=replicates, mixing_distance=mixing_distance, eigenvalues=eigenvalues, spacing=spacing,
                   simulated_steps=simulated_steps, guided_samples=guided_samples, memory_gb=memory_gb, seed=seed,
                   threads=threads)
    command = _called("solve", setting, parameter, **{key: value for key, value in options.items() if key != "threads"})
    with _progress.telling(progress, "solve") as tell:
        return Solution(_metastable.solve(_fields(setting), isinstance(setting, WalkerSetting), parameter, options,
                                          command, tell))


class Experiment:
    """Trials of one wheel: measured (read_experiment), simulated (simulate), or from arrays (experiment).

    `collisions` and `trials` are Columns, `conditions` the ids that their column `condition` counts from 0.
    """

    def __init__(self, held):
        self._held = held

    @property
    def title(self):
        """What it is called."""
        return self._held.title

    @property
    def conditions(self):
        """The ids of the conditions, in order."""
        return tuple(self._held.conditions)

    @property
    def notes(self):
        """What is not known or looks odd, a sentence each."""
        return tuple(self._held.notes)

    @property
    def collisions(self):
        """A row a collision: condition, trial, collision, leg (-1: not known), time_s, position_m, omega_minus_rad_s,
        omega_plus_rad_s (NaN: not known)."""
        columns = Columns(self._held.collisions(), "collisions")
        columns._drawn = "collision", "omega_minus_rad_s"
        return columns

    @property
    def trials(self):
        """A row a trial: condition, trial, collisions (how many), outcome ("rest", "end_of_ramp", "max_collisions" or
        None)."""
        return Columns(self._held.trials(), "trials")

    def write(self, folder):
        """As an experiment folder: experiment.toml, collisions.csv, trials.csv. Raises InputError if it holds one."""
        self._held.write(_path(folder))

    def to_dict(self):
        """Title, ids of the conditions, notes, and the columns of collisions and trials, as plain data."""
        return {"title": self.title, "conditions": list(self.conditions), "notes": list(self.notes),
                "collisions": self.collisions.to_dict(), "trials": self.trials.to_dict()}

    def to_dataframe(self):
        """The collisions, a row each, as a pandas.DataFrame, conditions by their ids; `trials.to_dataframe()` has the
        trials. Raises ImportError where pandas is not installed."""
        columns = dict(self.collisions)
        columns["condition"] = [self.conditions[i] for i in columns["condition"]]
        return _frames.dataframe(columns)

    def plot(self, ax=None):
        """Draws the speeds before each collision, by condition, with their means, on Matplotlib's axes and returns
        them. Raises ImportError where Matplotlib is not installed."""
        ax, columns = _frames.axes(ax), self.collisions
        for i, name in enumerate(self.conditions):
            own = columns.condition == i
            number, speed = columns.collision[own], columns.omega_minus_rad_s[own]
            dots, = ax.plot(number, speed, ".", alpha=0.3)
            at = numpy.unique(number)
            ax.plot(at, [speed[number == n].mean() for n in at], color=dots.get_color(), label=name)
        ax.set(xlabel="collision", ylabel="speed before the collision [rad/s]")
        ax.legend(title="condition")
        return ax

    def _repr_html_(self):
        return f"<p>{html.escape(self.title)}</p>{self.trials._repr_html_()}"

    def __repr__(self):
        trials = self._held.trials()
        return (f"<metastable.Experiment: {self.title}, {len(trials['trial'])} trials, "
                f"{int(trials['collisions'].sum())} collisions>")


def read_experiment(folder):
    """An experiment folder (experiment.toml, collisions.csv, trials.csv) as an Experiment. Raises InputError with all
    that is wrong, each with file, line and column (InputError.lines)."""
    return Experiment(_metastable.read_experiment(_path(folder)))


def _condition_id(given):
    """An id as a file holds it: 1, 1.0 and "1" are one."""
    if isinstance(given, bool) or not isinstance(given, (str, numbers.Real)):
        raise InputTypeError(f"settings: ids of conditions are texts or numbers, not {type(given).__name__}")
    return str(int(given)) if isinstance(given, numbers.Real) and given == given // 1 else str(given)


def experiment(settings, collisions, trials=None, *, title="From arrays", rate_hz=None, noise_sd=None):
    """Arrays as an Experiment, checked as files are: rows are then lines of arrays/collisions.csv.

    settings    a Setting, or {id: Setting}, ids being texts or numbers: wheel and contact of the first, slope, ramp and
                launch of each
    collisions  columns by name (a dict, a pandas.DataFrame): trial, collision (from 1) and omega_minus_rad_s; also
                condition (an id), leg, time_s, position_m, omega_plus_rad_s, as far as they were measured
    trials      trial, outcome ("rest", "end_of_ramp", "max_collisions"), and condition; None: outcomes are not known
    rate_hz     of the sensor [Hz]; noise_sd: believed noise of the speeds [rad/s]
    """
    if isinstance(settings, Setting):
        settings = {f"{settings.slope_deg:g}": settings}

    def columns(table, what):
        if not hasattr(table, "keys"):
            raise InputTypeError(f"{what}: columns by name expected (a dict, a DataFrame), not {kind(table)}")
        return {str(name): listed(table[name], f"{what}: {name}") for name in table.keys()}

    for each in by_name(settings, "settings", "{id: Setting}", other_names=True).values():
        if not isinstance(each, Setting):
            raise InputTypeError(f"settings: a Setting, or a dict {{id: Setting}}, expected, not {kind(each)}")
    return Experiment(_metastable.experiment_from_arrays(
        [_condition_id(each) for each in settings], [_fields(each) for each in settings.values()],
        columns(collisions, "collisions"), None if trials is None else columns(trials, "trials"), dict(title=title, rate_hz=rate_hz, noise_sd=noise_sd)))


def simulate(setting, *, trials=50, collisions=16, most_steps=None, stand_in=False, reality=False, effects=(),
             outside=None, skewness=0, sensor_noise=0, smoothing=0, flight=True, shuffled=False, drop=(),
             angle_rate=None, angle_noise=None, seed=1, threads=0, progress=None):
    """Trials, one by one: `metastable simulate`.

    A Setting gives an Experiment of `trials` trials of at most `collisions` collisions:
    stand_in     the paper's three experiments, 51, 48 and 50 trials, instead; slope, launch and numbers are theirs, and
                 contacts that are not given their estimates
    reality      in the virtual laboratory, which shares no formula with the model; with it
      effects      that the model lacks, texts "leg_contact:leg=3,friction_ratio=1.4" (see effects())
      outside      effects of no catalogue, {"planks": 2.0}
      skewness     of restitution, (-2, 2); sensor_noise: of every speed [rad/s]; smoothing: over this time [s]
      flight       False: feet that should lift stay down; shuffled: conditions take turns at random
      drop         columns and statements left out
    angle_rate   angles as a camera of this rate [Hz] sees them, with angle_noise [rad]; written with the folder

    A WalkerSetting gives Walks, each of at most `most_steps` steps (None: 1000). A Walker gives SimulatedSteps: every
    trial is followed until it fails; more than `most_steps` steps of all together (None: no limit) are an error.
    """
    if not isinstance(setting, (Setting, WalkerSetting, Walker)):
        raise InputTypeError(f"setting: a Setting, WalkerSetting or Walker expected, not {type(setting).__name__}")
    is_wheel = isinstance(setting, Setting)
    if most_steps is not None and is_wheel:
        raise InputError("most_steps: has a meaning with walker only")
    if collisions != 16 and not is_wheel:
        raise InputError("collisions: has no meaning with walker")
    options = dict(trials=None if trials == 50 else trials, collisions=None if collisions == 16 else collisions,
                   stand_in=stand_in, reality=reality, effects=list(words(effects, "effects")),
                   outside=outside, skewness=skewness or None, sensor_noise=sensor_noise or None,
                   smoothing=smoothing or None, flight=not flight, shuffled=shuffled,
                   drop=list(words(drop, "drop")), angle_rate=angle_rate,
                   angle_noise=angle_noise, seed=seed, threads=threads)
    told = {key: value for key, value in options.items() if key not in ("flight", "threads") and value}
    command = _called("simulate", setting, **told, **({} if flight else {"flight": 0}))
    fields = _fields(setting)
    if stand_in and fields.get("slope_deg") == Setting.slope_deg:
        fields["slope_deg"] = None  # which conditions of its own have
    with _progress.telling(progress, "simulate") as tell:
        if is_wheel:
            return Experiment(_metastable.simulate(fields, options, command, tell))
        options["most_steps"] = most_steps
        if isinstance(setting, Walker):
            return SimulatedSteps(**_metastable.simulate_map(fields, {**options, "trials": trials}, tell))
        walks = _metastable.simulate_walks(fields, options, tell)
        return Walks(walks["walks"], walks["steps"], walks["fell"])


def _path(given, what="folder: the path of one"):
    if not isinstance(given, (str, os.PathLike)):
        raise InputTypeError(f"{what} expected, not {kind(given)}")
    return os.fspath(given)


def _experiment(what):
    if isinstance(what, Experiment):
        return what._held
    return _metastable.read_experiment(_path(what, "experiment: an Experiment or the path of a folder"))


def diagnose(experiment, machine=None, *, catalogue=(), at_slope=None, at_speed=None, seed=1, threads=0, progress=None):
    """What the nominal model of an experiment lacks: is there a gap, where, which effect causes it, how far it shrinks.

    experiment  an Experiment, or the path of an experiment folder, of walks too; or Runs of a machine of your own
    machine     that the runs are of: a Machine
    catalogue   effects to consider, ids of effects(); a pair "a+b" is tried in any case; none: all
    at_slope    [deg] the machine's expected steps on another slope, too
    at_speed    [rad/s] the same for another launch, omega just before the first collision
    """
    options = dict(catalogue=list(words(catalogue, "catalogue")), seed=seed, threads=threads)
    options.update({key: value for key, value in (("at_slope", at_slope), ("at_speed", at_speed)) if value is not None})
    command = _called("diagnose", experiment, *([] if machine is None else [machine]),
                      catalogue=options["catalogue"] or None, seed=seed)
    if isinstance(experiment, Runs) or machine is not None:
        if not isinstance(experiment, Runs) or not isinstance(machine, Machine):
            raise InputTypeError("diagnose: runs of a machine are given with it: diagnose(runs, machine)")
        if experiment._columns != (tuple(machine.sensor), machine.inputs, machine.angles):
            raise InputError("diagnose: the runs were made for a machine with other columns")
        if at_slope is not None or at_speed is not None:
            raise InputError("at_slope, at_speed: have no meaning with a machine of your own")
        with _progress.telling(progress, "diagnose") as tell:
            return Diagnosis(_metastable.diagnose_machine(machine._fields(), experiment._laid_out, options, command, tell))
    with _progress.telling(progress, "diagnose") as tell:
        if not isinstance(experiment, Experiment):
            walks = _metastable.diagnose_walks(_path(experiment, "experiment: an Experiment, Runs or the path of a folder"), options, command, tell)
            if walks is not None:
                return Diagnosis(walks)
        return Diagnosis(_metastable.diagnose(_experiment(experiment), options, command, tell))


def describe(experiment, *, transition="auto", against=(), trials=2000, seed=1, threads=0, progress=None):
    """What the trials of an experiment show by themselves: speeds, tests between conditions, survival, restitution and
    friction by maximum likelihood. Returns a Description.

    experiment  an Experiment, or the path of an experiment folder
    transition  that is fitted: "collision" (omega_minus to omega_plus), "step" (to the next omega_minus), or "auto"
    against     laws to compare with, by `trials` simulated trials each
    """
    options = dict(transition=transition, against=list(words(against, "against")), trials=trials, seed=seed, threads=threads)
    command = _called("describe", experiment, transition=transition, seed=seed)
    with _progress.telling(progress, "describe") as tell:
        return Description(_metastable.describe(_experiment(experiment), options, command, tell))


def effects():
    """The catalogue of effects that a model may lack: a Record each of id, summary and parameters."""
    return tuple(Record(one) for one in json.loads(_metastable.effects_json())["effects"])


@dataclasses.dataclass(frozen=True, eq=False)
class Walker:
    """A simulator of your own as a stochastic return map; see walker()."""

    step: object
    dimension: int
    noise: int
    start: Sequence[float]
    names: Sequence[str] = ()
    noise_names: Sequence[str] = ()
    phases: int = 1
    name: str = "walker"
    angles: Sequence = ()

    def __post_init__(self):
        if not callable(self.step):
            raise InputTypeError(f"step: a function expected, not {kind(self.step)}")
        if isinstance(self.phases, numbers.Integral) and self.phases > 1:
            require_call(self.step, 3, "step", "step(state, noise, phase)")
        else:
            require_call(self.step, 2, "step", "step(state, noise)")
        start = numpy.atleast_1d(_numbers(self.start, "start"))
        if not numpy.isfinite(start).all():
            raise InputError(f"start: finite numbers expected, not {start.flat[numpy.isfinite(start).argmin()]}")
        object.__setattr__(self, "start", _plain(start))
        object.__setattr__(self, "names", words(self.names, "names", ordered=True))
        object.__setattr__(self, "noise_names", words(self.noise_names, "noise_names", ordered=True))
        if isinstance(self.angles, str) or not isinstance(self.angles, Iterable):
            raise InputTypeError(f"angles: names or places in a list expected, not {self.angles!r}")
        object.__setattr__(self, "angles", tuple(self._place(angle) for angle in self.angles))
        _metastable.check_map(_fields(self))

    def _place(self, angle):
        if isinstance(angle, str):
            if angle not in self.names:
                raise InputError(f"angles: {angle!r} is none of the names {', '.join(self.names) or '(none are given)'}")
            return self.names.index(angle)
        try:
            return operator.index(angle)
        except TypeError:
            raise InputTypeError(f"angles: a name or a whole number expected, not {angle!r}") from None

    def study(self, **options):
        """study(self, ...)."""
        return study(self, **options)

    def simulate(self, **options):
        """simulate(self, ...)."""
        return simulate(self, **options)

    def __repr__(self):
        return f"<metastable.Walker: {self.name}, {self.dimension} dimensions, {self.noise} noise>"


def walker(step, dimension, noise, *, start, names=(), noise_names=(), phases=1, name="walker", angles=()):
    """Any simulator as a walker: study() and simulate() then take it.

    step         step(state, noise) -> (next, failed), vectorised: `state` is an (n, dimension) array of states just
                 after one event (a touchdown, a period), `noise` an (n, noise) array of independent standard normal
                 numbers, `next` the (n, dimension) states just after the next event, `failed` n booleans. It must be a
                 function of its arguments alone; states that make no sense have failed. With phases > 1 it is called
                 as step(state, noise, phase). It runs in the thread that called, one call at a time, on as many
                 rows as there are at once, some of which may turn out not to be needed.
    dimension    numbers of a state, 1 to 30; above 4 study() takes method="splitting"
    noise        numbers of noise a step, 1 to 16
    start        the state that walks begin from, at phase 0: expected steps are counted from it. The orbit that the map
                 settles into without noise, the gait, is what meshes are centred on and the answer tells (`gait`);
                 expected steps from the metastable regime, `expected_steps.from_quasi_stationary`, do not depend on it
    names        of the numbers of a state, with units; noise_names likewise
    phases       events after which the map repeats itself
    angles       numbers of the state that are angles [rad], by name or place: they are counted within pi of the
                 start's, and `step` gets them within pi of zero, so that an orbit may lie where they wrap

    Where the orbit is unstable, and without noise the map leads on to another one, which may come back after several
    steps (up to 16), that is the gait, however the noise shifts it against itself. Where there is none, because the map
    wanders or fails without noise, the answer is the first passage from the start alone (`gait.period` 0). Raises
    MapError naming the state where a landing is not finite, and where an unstable orbit leads to no failure.
    """
    return Walker(step, dimension, noise, start, names, noise_names, phases, name, angles)


class SimulatedSteps(Record):
    """Steps before failure by direct simulation: `mean`, its `standard_error`, and `steps` of each trial."""

    def __init__(self, mean, standard_error, steps):
        super().__init__(dict(mean=mean, standard_error=standard_error, steps=steps))

    @property
    def interval_95(self):
        """Normal 95 % interval of the mean."""
        half = statistics.NormalDist().inv_cdf(0.975) * self.standard_error
        return self.mean - half, self.mean + half

    def _rows(self):
        return {"trial": numpy.arange(1, len(self.steps) + 1), "steps": self.steps}

    def _draw(self, ax):
        return _frames.plot_walked(ax, self.steps, numpy.ones(len(self.steps), bool))

    def __repr__(self):
        low, high = self.interval_95
        return (f"<metastable.SimulatedSteps: {self.mean:.4g} steps (95 %: {low:.4g} to {high:.4g}), "
                f"{len(self.steps)} trials>")


class _ByState(Record):
    """Numbers by state of a chain, of which the first is drawn."""

    def _rows(self):
        by_state = {name: self[name] for name in self.keys() if numpy.ndim(self[name]) == 1}
        return {"state": numpy.arange(len(next(iter(by_state.values())))), **by_state}

    def _draw(self, ax):
        rows, ax = self._rows(), _frames.axes(ax)
        name = list(rows)[1]
        ax.plot(rows["state"], rows[name], ".-")
        ax.set(xlabel="state", ylabel=name)
        return ax


class FirstPassage(_ByState):
    """Steps before failure from each state: `mean` and `sd`, and guaranteed bounds `lower` <= mean <= `upper`. Of a chain
    that is iterated the `sd` is proven to 1e-6 of itself, or of one step where it is less than a step."""

    def __init__(self, mean, sd, lower, upper):
        super().__init__(dict(mean=mean, sd=sd, lower=lower, upper=upper))

    def __repr__(self):
        return (f"<metastable.FirstPassage: {self.mean.min():.4g} to {self.mean.max():.4g} steps from "
                f"{len(self.mean)} states>")


class QuasiStationary(_ByState):
    """What survivors look like once the start is forgotten: their `distribution`, the `survival_weight` of each state
    (largest 1), and the `failure_rate` per step, proven to lie from `lower` to `upper`; where some states do not lead
    to others, that is proven of the group of states found to fade slowest, not that no other group fades more slowly,
    unless there is a `distribution_error`: a proven bound of the total variation (half of the sum of absolute
    differences) between the distribution and the true one of the chain as given. It is None where groups of states change
    places too rarely to prove one below 1, or no state is visited twice; `unproven` says why then, and is None otherwise.
    `weight_error` is a proven bound of the relative error of every entry of the survival weight, None where there is
    none. `residual` is the largest of |y Q - lambda y| and
    |Q x - lambda x|, entry by entry, relative to the entry times the probability of leaving its state, and of the error
    that may be left along other eigenvectors; `iterations` says how long it took."""

    def __init__(self, distribution, survival_weight, failure_rate, lower, upper, distribution_error, weight_error,
                 unproven, residual, iterations):
        super().__init__(dict(distribution=distribution, survival_weight=survival_weight, failure_rate=failure_rate,
                              lower=lower, upper=upper, distribution_error=distribution_error,
                              weight_error=weight_error, unproven=unproven, residual=residual, iterations=iterations))

    def __repr__(self):
        return f"<metastable.QuasiStationary: failure rate {self.failure_rate:.6g} per step>"


class Passage(_ByState):
    """First passage to a set of states: the committor `reach` (probability of being there before failing), `fail`
    (neither is one minus the other), and the expected `steps` until either, infinite where neither need come. `error` is
    a proven bound of the relative error of every entry; None of a chain that was eliminated, whose error is rounding."""

    def __init__(self, reach, fail, steps, error):
        super().__init__(dict(reach=reach, fail=fail, steps=steps, error=error))

    def __repr__(self):
        return f"<metastable.Passage: from {len(self.reach)} states>"


class Chain:
    """An absorbing Markov chain; see chain()."""

    def __init__(self, held):
        self._held = held

    def __len__(self):
        return self._held.size

    @property
    def entries(self):
        """How many transition probabilities are stored."""
        return self._held.entries

    def first_passage(self, *, progress=None):
        """Steps before failure from each state, as FirstPassage, by elimination without a subtraction or by iteration
        (see chain()). The bounds are proven from the answer's residual."""
        with _progress.telling(progress, "first passage") as tell:
            return FirstPassage(**self._held.first_passage(tell))

    def quasi_stationary(self, *, progress=None):
        """The quasi-stationary distribution, as QuasiStationary: the left eigenvector of the whole chain, which sums to
        one (of a chain of period d, what walkers spread over all d classes look like). A ComputationError says where
        there is more than one, or double precision does not tell."""
        with _progress.telling(progress, "quasi-stationary") as tell:
            return QuasiStationary(**self._held.quasi_stationary(tell))

    def committor(self, states, *, progress=None):
        """First passage to `states`, a list of indices or n booleans, as Passage. From states that can reach neither
        these nor failure, both probabilities are 0; where neither need come, the steps are infinite."""
        with _progress.telling(progress, "committor") as tell:
            return Passage(**self._held.committor(self._marks(states), tell))

    def survival(self, start, steps, *, progress=None):
        """P(no failure within n steps) for each n of `steps`, whole numbers (infinity: ever), from a distribution `start`
        over the states (or the index of one)."""
        if numpy.ndim(start) == 0:
            index = numpy.asarray(start)[()]
            if not isinstance(index, numbers.Integral) or not 0 <= index < len(self):
                raise InputError(f"start: {index} is no distribution over the states, nor an index from 0 to {len(self) - 1}")
            start = self._marks([index])
        with _progress.telling(progress, "survival") as tell:
            return self._held.survival(_numbers(start, "start"), _numbers(numpy.atleast_1d(steps), "steps"), tell)

    def _marks(self, states):
        states = numpy.asarray(states)
        if states.dtype == bool and states.ndim == 1:
            return states
        if states.ndim != 1 or (states.size and states.dtype.kind not in "iu"):
            raise InputError(f"states: a list of indices or {len(self)} booleans expected")
        for state in states.tolist():
            if not 0 <= state < len(self):
                raise InputError(f"states: {state} is not one of 0 to {len(self) - 1}")
        marks = numpy.zeros(len(self), bool)
        marks[states.astype(int)] = True
        return marks

    def __repr__(self):
        return f"<metastable.Chain: {len(self)} states, {self.entries} entries>"


def _numbers(values, what):
    """Real numbers as an array of doubles; what would lose something on the way is refused."""
    if isinstance(values, numpy.ma.MaskedArray):
        raise InputError(f"{what}: a masked array; fill in the numbers that are masked")
    try:
        given = numpy.asarray(values)
    except ValueError:
        raise InputError(f"{what}: an array of numbers expected, all its rows of one length") from None
    if given.dtype.kind == "O" and not all(isinstance(one, (numbers.Real, decimal.Decimal)) for one in given.flat):
        raise InputError(f"{what}: real numbers expected, not all of them are")
    if given.dtype.kind not in "biufO":
        raise InputError(f"{what}: real numbers expected, not {given.dtype}")
    doubles = numpy.ascontiguousarray(given, float)
    if doubles.shape != given.shape:  # a single number
        doubles = doubles.reshape(given.shape)
    if given.dtype.kind in "fO" and numpy.any((doubles == 0) & (given != 0)):
        raise InputError(f"{what}: a number other than 0 is too small for double precision")
    return doubles


def chain(matrix, kill, *, memory_gb=2, time_limit=900, threads=0):
    """A Markov chain of your own that may fail, as a Chain.

    matrix  transition probabilities, rows FROM: a NumPy array or any SciPy sparse matrix, n x n. The diagonal may be
            left out, all of it: zeros in an array, nothing stored in a sparse matrix. Where one of its entries is
            given, every row and its kill rate have to sum to one (1e-9), also those whose diagonal is zero
    kill    n probabilities of failing in the next step. They are asked for because one minus a row's sum has lost the
            digits that matter where failures are rare
    memory_gb   most memory of the answers; a ComputationError says how much would do
    time_limit  seconds after which a question that iterates ends with a ComputationError

    A chain whose elimination takes a second or two (a full one of 3000 states, a band of 200 around the diagonal of 1e5)
    is eliminated without a subtraction: full relative accuracy however rare failures are. Others are solved by iteration.
    Of these, mean and sd of the steps, failure rate and committor are refused with a ComputationError where they cannot be
    proven to 1e-6, relative. Distribution and survival weight come with proven bounds, or with none; they are refused
    where their residual is above 1e-8, and survival far ahead where survivors settle too slowly.

    Both hold real numbers; complex ones, masked arrays, text and missing numbers are refused.
    """
    kill = _numbers(kill, "kill")
    if kill.ndim != 1:
        raise InputError(f"kill: a vector expected, not an array of shape {kill.shape}")
    sparse = hasattr(matrix, "tocsr")
    if not sparse:
        matrix = _numbers(matrix, "matrix")
    if len(matrix.shape) != 2 or matrix.shape != (len(kill), len(kill)):
        raise InputError(f"matrix: shape {matrix.shape}, {(len(kill), len(kill))} expected for {len(kill)} kill rates")
    if sparse:
        if matrix.dtype.kind not in "biuf":
            raise InputError(f"matrix: real numbers expected, not {matrix.dtype}")
        stored = matrix.astype(float)  # first: duplicates are added up
        rows = stored.tocsr(copy=stored is matrix)
        rows.sum_duplicates()  # columns ascend then
        starts, columns, values = rows.indptr, rows.indices, rows.data
    else:
        i, columns = matrix.nonzero()
        starts, values = numpy.searchsorted(i, numpy.arange(len(kill) + 1)), matrix[i, columns]
    for what, given in (("memory_gb", memory_gb), ("time_limit", time_limit)):
        if not isinstance(given, numbers.Real):
            raise InputError(f"{what}: a number expected, not {given!r}")
    return Chain(_metastable.Chain(starts, columns, values, kill, threads, float(memory_gb), float(time_limit)))
