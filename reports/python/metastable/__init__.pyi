from os import PathLike
from typing import (Any, Callable, Dict, Iterable, Iterator, KeysView, List, Mapping, Optional, Sequence,
                    Tuple, Union, overload)

import numpy as np
from numpy.typing import ArrayLike, NDArray

from metastable import blind as blind

__version__: str
__all__: List[str]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Interval = Tuple[float, float]
Spread = Union[Tuple[float, float], float]
Progress = Union[None, bool, Callable[[float], object]]
Path = Union[str, PathLike[str]]
Step = Callable[..., Tuple[ArrayLike, ArrayLike]]


class InputError(ValueError):
    @property
    def lines(self) -> List[str]: ...


class InputTypeError(InputError, TypeError): ...
class ComputationError(RuntimeError): ...
class Contradiction(ComputationError): ...
class MapError(ComputationError): ...


class Record:
    def __init__(self, values: Mapping[str, Any], arrays: Optional[Mapping[str, Any]] = None,
                 path: str = "") -> None: ...
    def __getitem__(self, name: str) -> Any: ...
    def __getattr__(self, name: str) -> Any: ...
    def __iter__(self) -> Iterator[str]: ...
    def __len__(self) -> int: ...
    def keys(self) -> List[str]: ...
    def to_dict(self) -> Dict[str, Any]: ...
    def to_dataframe(self) -> Any: ...
    def plot(self, ax: Any = None) -> Any: ...


class Result(Record):
    def __init__(self, answer: Mapping[str, Any]) -> None: ...
    def to_dict(self) -> Dict[str, Any]: ...


class ExpectedSteps(Record):
    from_start: float
    interval_95: Interval
    from_quasi_stationary: float
    from_quasi_stationary_interval_95: Interval
    worst_start: float
    worst_start_interval_95: Interval
    sd: float
    median: float
    quantiles: Record
    @property
    def value(self) -> float: ...


class Provenance(Record):
    command: str
    settings: str
    seed: int
    version: str


class Regime(Record):
    edges: Floats
    mass: Floats
    def __init__(self, edges: Floats, mass: Floats) -> None: ...
    @property
    def speed_edges(self) -> Floats: ...


class HowItFails(Record):
    last_steps: Tuple[Record, ...]
    regime: Record
    by_phase: Tuple[float, ...]
    most_likely_path: Tuple[Record, ...]


class Study(Result):
    schema: int
    slope_deg: float
    law: str
    method: str
    status: str
    message: Optional[str]
    expected_steps: ExpectedSteps
    failure_rate_per_step: float
    failure_rate_interval_95: Interval
    seconds_before_failure: Any
    metres_before_failure: Any
    survival: Floats
    eigenvalue_moduli: Floats
    mixing_steps: float
    total_variation_mixing_steps: Optional[int]
    quasi_stationary: Record
    stationary_with_restart: Record
    reach_ramp_end: Optional[float]
    outside_assumptions: Record
    rest_unreachable_above: Record
    error: Record
    resolution: Record
    solver_disagreement: float
    certificate: Optional[Record]
    sensitivities: Optional[Any]
    how_it_fails: Optional[HowItFails]
    from_standard_errors: Optional[Record]
    launch: Record
    rigid_bodies: Optional[Record]
    provenance: Provenance
    @property
    def regime(self) -> Tuple[Regime, ...]: ...


class Comparison(Result):
    schema: int
    settings: Tuple[Record, ...]
    contrasts: Tuple[Record, ...]
    rigid_bodies: Optional[str]
    provenance: Provenance


class MeshEstimate(Record):
    value: float
    interval_95: Interval


class Solution(Result):
    schema: int
    parameter: str
    unit: str
    target: Record
    range: Tuple[float, float]
    solutions: Tuple[Record, ...]
    scanned: Tuple[Record, ...]
    sentences: Tuple[str, ...]
    rigid_bodies: Optional[str]
    provenance: Provenance


class WalkerSteps(MeshEstimate):
    from_quasi_stationary: Optional[float]
    from_quasi_stationary_interval_95: Optional[Interval]
    @property
    def from_start(self) -> float: ...


class WalkerStudy(Result):
    setting: str
    status: str
    method: Optional[str]
    no_mesh: Optional[str]
    expected_steps: WalkerSteps
    failure_rate_per_step: Optional[MeshEstimate]
    survival: Floats
    survival_interval_95: Optional[Floats]
    survival_after: Optional[Tuple[Record, ...]]
    mixing_steps: Optional[float]
    rounds: Optional[int]
    steps_of_a_round: Optional[int]
    rates_of_rounds: Optional[Tuple[float, ...]]
    split_by: Optional[str]
    lines_to_failure: Optional[float]
    steps_of_the_map: Optional[int]
    splitting: Optional[Record]
    relative_errors: Optional[Record]
    guided_sampling: Optional[MeshEstimate]
    direct_simulation: Optional[MeshEstimate]
    no_guided_sampling: Optional[str]
    no_direct_simulation: Optional[str]
    other_gaits: Optional[Tuple[Record, ...]]
    meshes: Optional[Tuple[Record, ...]]
    memory_bytes: Optional[float]
    gait: Optional[Record]
    how_it_fails: Optional[HowItFails]
    provenance: Provenance


class WalkerComparison(Result):
    settings: Tuple[Record, ...]
    contrasts: Tuple[Record, ...]
    provenance: Provenance


class Diagnosis(Result):
    schema: int
    verdict: str
    sentences: Tuple[str, ...]
    gap: Record
    where: Tuple[Record, ...]
    where_as_given: Tuple[Record, ...]
    where_left: Tuple[Record, ...]
    causes: Tuple[Record, ...]
    cause_set: Tuple[str, ...]
    at_work: Tuple[Record, ...]
    unnamed: Tuple[Record, ...]
    p_unnamed: float
    left: Record
    unnamed_supposed: Tuple[Record, ...]
    cause_set_alike: Tuple[str, ...]
    stepwise: Record
    not_decided: Tuple[Record, ...]
    contact: Record
    contact_beside_effects: Record
    shrinkage: Record
    shrinkage_by_measure: Tuple[Record, ...]
    steps_before_failure: Record
    visibility: Tuple[Record, ...]
    missing_columns: Tuple[Record, ...]
    not_possible: Tuple[Record, ...]
    at_bound: Tuple[Record, ...]
    next_experiment: Tuple[Record, ...]
    data: Record
    notes: Tuple[str, ...]
    provenance: Provenance


class Table:
    title: str
    notes: Tuple[str, ...]
    units: Dict[str, str]
    rows: List[Dict[str, Any]]
    def __init__(self, values: Mapping[str, Any]) -> None: ...
    def __iter__(self) -> Iterator[Dict[str, Any]]: ...
    def __len__(self) -> int: ...
    def __getitem__(self, column: str) -> List[Any]: ...
    def to_dict(self) -> Dict[str, Any]: ...
    def to_dataframe(self) -> Any: ...
    def plot(self, column: Optional[str] = None, ax: Any = None) -> Any: ...


class Description(Result):
    schema: int
    tables: Dict[str, Table]
    provenance: Provenance
    def to_dataframe(self, table: Optional[str] = None) -> Any: ...
    def plot(self, table: Optional[str] = None, column: Optional[str] = None, ax: Any = None) -> Any: ...


class Columns:
    def __init__(self, columns: Mapping[str, Any], title: str) -> None: ...
    def keys(self) -> KeysView[str]: ...
    def __getitem__(self, name: str) -> Any: ...
    def __iter__(self) -> Iterator[str]: ...
    def __len__(self) -> int: ...
    def __getattr__(self, name: str) -> Any: ...
    def to_dict(self) -> Dict[str, List[Any]]: ...
    def to_dataframe(self) -> Any: ...
    def plot(self, x: Optional[str] = None, y: Optional[str] = None, ax: Any = None) -> Any: ...


class Sweep(Columns):
    expected_steps: Floats
    expected_steps_low95: Floats
    expected_steps_high95: Floats
    expected_steps_quasi_stationary: Floats
    failure_rate_per_step: Floats
    quasi_stationary_mean_rad_s: Floats
    quasi_stationary_sd_rad_s: Floats
    reach_ramp_end: Floats
    status: List[str]
    message: List[str]
    rigid_bodies_steps: Floats
    rigid_bodies_steps_low95: Floats
    rigid_bodies_steps_high95: Floats
    rigid_bodies: Optional[str]
    def __init__(self, columns: Mapping[str, Any], title: str, rigid_bodies: Optional[str] = None) -> None: ...
    def plot(self, x: Optional[str] = None, y: str = "expected_steps", ax: Any = None) -> Any: ...


class Walks(Columns):
    steps: Integers
    fell: NDArray[np.bool_]
    def __init__(self, columns: Mapping[str, Any], steps: Integers, fell: NDArray[np.bool_]) -> None: ...
    def plot(self, ax: Any = None) -> Any: ...


class Setting:
    slope_deg: float
    initial_speed: Union[Spread, str, None]
    law: Optional[str]
    restitution: Optional[Spread]
    friction: Optional[Spread]
    correlation: Optional[float]
    contact_list: Any
    rebound_lost: Optional[float]
    legs: Any
    mass: Optional[float]
    inertia: Optional[float]
    radius_of_gyration: Optional[float]
    tip_radius: Optional[float]
    ramp_stiffness: Optional[float]
    contact_mass: Optional[float]
    gravity: Optional[float]
    ramp_length: Optional[float]
    first_leg: int
    def __init__(self, slope_deg: float = 7.02, initial_speed: Union[Spread, str, None] = None, law: Optional[str] = None,
                 restitution: Optional[Spread] = None, friction: Optional[Spread] = None,
                 correlation: Optional[float] = None, contact_list: Optional[ArrayLike] = None,
                 rebound_lost: Optional[float] = None, legs: Optional[ArrayLike] = None, mass: Optional[float] = None,
                 inertia: Optional[float] = None, radius_of_gyration: Optional[float] = None,
                 tip_radius: Optional[float] = None, ramp_stiffness: Optional[float] = None,
                 contact_mass: Optional[float] = None, gravity: Optional[float] = None,
                 ramp_length: Optional[float] = None, first_leg: int = 0) -> None: ...
    @property
    def launch(self) -> Optional[Tuple[float, float]]: ...
    def describe(self) -> str: ...
    def replace(self, **changes: Any) -> Setting: ...


class WalkerSetting:
    walker: str
    slope_sd_deg: float
    slope_deg: Optional[float]
    terrain: str
    def __init__(self, walker: str, slope_sd_deg: float, slope_deg: Optional[float] = None,
                 terrain: str = "fresh") -> None: ...
    def describe(self) -> str: ...
    def replace(self, **changes: Any) -> WalkerSetting: ...
    def machine(self, *, sensor: Mapping[str, Any], slope_known_deg: float = 0.1) -> Machine: ...


class Machine:
    step: Callable[..., Tuple[ArrayLike, ArrayLike]]
    states: Tuple[str, ...]
    noise: int
    parameters: Dict[str, Tuple[float, ...]]
    effects: Dict[str, Dict[str, Tuple[float, ...]]]
    may_vary: Tuple[str, ...]
    sensor: Dict[str, Tuple[Optional[float], float]]
    launch: Dict[str, Tuple[float, ...]]
    inputs: Tuple[str, ...]
    angles: Tuple[str, ...]
    most_wild: float
    units: Dict[str, str]
    name: str
    def walker(self, start: Optional[ArrayLike] = None, **values: float) -> Walker: ...


class Runs:
    trials: int
    rows: int
    lost: int


class Walker:
    step: Step
    dimension: int
    noise: int
    start: Tuple[float, ...]
    names: Tuple[str, ...]
    noise_names: Tuple[str, ...]
    phases: int
    name: str
    angles: Tuple[int, ...]
    def __init__(self, step: Step, dimension: int, noise: int, start: ArrayLike, names: Sequence[str] = (),
                 noise_names: Sequence[str] = (), phases: int = 1, name: str = "walker",
                 angles: Sequence[Union[str, int]] = ()) -> None: ...
    def study(self, **options: Any) -> WalkerStudy: ...
    def simulate(self, **options: Any) -> SimulatedSteps: ...


class SimulatedSteps(Record):
    mean: float
    standard_error: float
    steps: Integers
    def __init__(self, mean: float, standard_error: float, steps: Integers) -> None: ...
    @property
    def interval_95(self) -> Interval: ...


class Experiment:
    def __init__(self, held: Any) -> None: ...
    @property
    def title(self) -> str: ...
    @property
    def conditions(self) -> Tuple[str, ...]: ...
    @property
    def notes(self) -> Tuple[str, ...]: ...
    @property
    def collisions(self) -> Columns: ...
    @property
    def trials(self) -> Columns: ...
    def write(self, folder: Path) -> None: ...
    def to_dict(self) -> Dict[str, Any]: ...
    def to_dataframe(self) -> Any: ...
    def plot(self, ax: Any = None) -> Any: ...


class FirstPassage(Record):
    mean: Floats
    sd: Floats
    lower: Floats
    upper: Floats
    def __init__(self, mean: Floats, sd: Floats, lower: Floats, upper: Floats) -> None: ...


class QuasiStationary(Record):
    distribution: Floats
    survival_weight: Floats
    failure_rate: float
    lower: float
    upper: float
    distribution_error: Optional[float]
    weight_error: Optional[float]
    unproven: Optional[str]
    residual: float
    iterations: int
    def __init__(self, distribution: Floats, survival_weight: Floats, failure_rate: float, lower: float, upper: float,
                 distribution_error: Optional[float], weight_error: Optional[float], unproven: Optional[str],
                 residual: float, iterations: int) -> None: ...


class Passage(Record):
    reach: Floats
    fail: Floats
    steps: Floats
    error: Optional[float]
    def __init__(self, reach: Floats, fail: Floats, steps: Floats, error: Optional[float]) -> None: ...


class Chain:
    def __init__(self, held: Any) -> None: ...
    def __len__(self) -> int: ...
    @property
    def entries(self) -> int: ...
    def first_passage(self, *, progress: Progress = None) -> FirstPassage: ...
    def quasi_stationary(self, *, progress: Progress = None) -> QuasiStationary: ...
    def committor(self, states: ArrayLike, *, progress: Progress = None) -> Passage: ...
    def survival(self, start: ArrayLike, steps: ArrayLike, *, progress: Progress = None) -> Floats: ...


def version_text() -> str: ...


@overload
def study(setting: Setting, *, method: Optional[str] = None, cells: Optional[int] = None,
          samples: Optional[int] = None, tolerance: Optional[float] = None, sequence: Optional[str] = None,
          draws: Optional[str] = None, tail: Optional[float] = None, replicates: Optional[int] = None,
          mixing_distance: Optional[float] = None, eigenvalues: Optional[int] = None, direct: bool = False,
          certify: bool = False, sensitivities: bool = False, standard_errors: Optional[Mapping[str, float]] = None,
          how_it_fails: bool = False, seed: int = 1, threads: int = 0, time_limit: Optional[float] = None,
          progress: Progress = None) -> Study: ...
@overload
def study(setting: Union[WalkerSetting, Walker, Machine], *, method: Optional[str] = None,
          tolerance: Optional[float] = None, spacing: Optional[float] = None,
          simulated_steps: Optional[int] = None, guided_samples: Optional[int] = None,
          memory_gb: Optional[float] = None, level: Union[str, Callable[..., ArrayLike], None] = None,
          how_it_fails: bool = False, seed: int = 1, threads: int = 0, time_limit: Optional[float] = None,
          progress: Progress = None) -> WalkerStudy: ...


@overload
def compare(settings: Union[Iterable[Setting], Setting, None] = None, *, collisions: int = 16, method: Optional[str] = None,
            cells: Optional[int] = None, samples: Optional[int] = None, tolerance: Optional[float] = None,
            sequence: Optional[str] = None, draws: Optional[str] = None, tail: Optional[float] = None,
            replicates: Optional[int] = None, mixing_distance: Optional[float] = None,
            eigenvalues: Optional[int] = None, direct: bool = False,
            standard_errors: Optional[Mapping[str, float]] = None, seed: int = 1, threads: int = 0,
            progress: Progress = None, **varied: Any) -> Comparison: ...
@overload
def compare(settings: Iterable[WalkerSetting], *, spacing: Optional[float] = None,
            simulated_steps: Optional[int] = None, guided_samples: Optional[int] = None,
            memory_gb: Optional[float] = None, seed: int = 1, threads: int = 0,
            progress: Progress = None) -> WalkerComparison: ...


def sweep(setting: Setting, *, slope_deg: Optional[ArrayLike] = None, restitution_mean: Optional[ArrayLike] = None,
          restitution_sd: Optional[ArrayLike] = None, friction_mean: Optional[ArrayLike] = None,
          friction_sd: Optional[ArrayLike] = None, leg_length: Optional[ArrayLike] = None,
          inertia: Optional[ArrayLike] = None, ramp_stiffness: Optional[ArrayLike] = None,
          radius_of_gyration: Optional[ArrayLike] = None, contact_mass: Optional[ArrayLike] = None,
          tip_radius: Optional[ArrayLike] = None, method: Optional[str] = None, cells: Optional[int] = None,
          samples: Optional[int] = None, tolerance: Optional[float] = None, sequence: Optional[str] = None,
          draws: Optional[str] = None, tail: Optional[float] = None, replicates: Optional[int] = None,
          mixing_distance: Optional[float] = None, eigenvalues: Optional[int] = None, seed: int = 1,
          threads: int = 0, progress: Progress = None) -> Sweep: ...


def solve(setting: Union[Setting, WalkerSetting], parameter: str, *, steps: Optional[float] = None,
          survive: Optional[Tuple[float, float]] = None, reach: Optional[float] = None, start: Optional[float] = None,
          stop: Optional[float] = None, points: Optional[int] = None, method: Optional[str] = None,
          cells: Optional[int] = None, samples: Optional[int] = None, tolerance: Optional[float] = None,
          sequence: Optional[str] = None, draws: Optional[str] = None, tail: Optional[float] = None,
          replicates: Optional[int] = None, mixing_distance: Optional[float] = None, eigenvalues: Optional[int] = None,
          spacing: Optional[float] = None, simulated_steps: Optional[int] = None,
          guided_samples: Optional[int] = None, memory_gb: Optional[float] = None, seed: int = 1, threads: int = 0,
          progress: Progress = None) -> Solution: ...


@overload
def simulate(setting: Setting, *, trials: int = 50, collisions: int = 16, stand_in: bool = False,
             reality: bool = False, effects: Union[str, Sequence[str]] = (), outside: Optional[Mapping[str, float]] = None,
             skewness: float = 0, sensor_noise: float = 0, smoothing: float = 0, flight: bool = True,
             shuffled: bool = False, drop: Union[str, Sequence[str]] = (), angle_rate: Optional[float] = None,
             angle_noise: Optional[float] = None, seed: int = 1, threads: int = 0,
             progress: Progress = None) -> Experiment: ...
@overload
def simulate(setting: WalkerSetting, *, trials: int = 50, most_steps: Optional[int] = None, seed: int = 1,
             threads: int = 0, progress: Progress = None) -> Walks: ...
@overload
def simulate(setting: Walker, *, trials: int = 50, most_steps: Optional[int] = None, seed: int = 1,
             threads: int = 0, progress: Progress = None) -> SimulatedSteps: ...


def read_experiment(folder: Path) -> Experiment: ...


def experiment(settings: Union[Setting, Mapping[Union[str, float], Setting]], collisions: Any, trials: Any = None, *,
               title: str = "From arrays", rate_hz: Optional[float] = None,
               noise_sd: Optional[float] = None) -> Experiment: ...


def diagnose(experiment: Union[Experiment, Path, Runs], machine: Optional[Machine] = None, *, catalogue: Union[str, Sequence[str]] = (),
             at_slope: Optional[float] = None, at_speed: Optional[float] = None, seed: int = 1, threads: int = 0,
             progress: Progress = None) -> Diagnosis: ...


def describe(experiment: Union[Experiment, Path], *, transition: str = "auto",
             against: Union[str, Sequence[str]] = (), trials: int = 2000, seed: int = 1, threads: int = 0,
             progress: Progress = None) -> Description: ...


def effects() -> Tuple[Record, ...]: ...


def walker(step: Step, dimension: int, noise: int, *, start: ArrayLike, names: Sequence[str] = (),
           noise_names: Sequence[str] = (), phases: int = 1, name: str = "walker",
           angles: Sequence[Union[str, int]] = ()) -> Walker: ...


def machine(step: Callable[..., Tuple[ArrayLike, ArrayLike]], *, states: Sequence[str], noise: int,
            parameters: Mapping[str, Sequence[float]], effects: Mapping[str, Mapping[str, Sequence[float]]] = {},
            may_vary: Sequence[str] = (), sensor: Optional[Mapping[str, Any]] = None,
            launch: Mapping[str, Sequence[float]] = {}, inputs: Sequence[str] = (), most_wild: float = 0.01,
            angles: Union[str, Sequence[str]] = (), units: Mapping[str, str] = {},
            name: str = "machine") -> Machine: ...


def runs(machine: Machine, data: Any = None, *, outcome: Any = None, labels: Any = (),
         inputs: Optional[Mapping[str, ArrayLike]] = None, **columns: Any) -> Runs: ...


def chain(matrix: Any, kill: ArrayLike, *, memory_gb: float = 2, time_limit: float = 900, threads: int = 0) -> Chain: ...
