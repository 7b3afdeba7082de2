from os import PathLike
from typing import Callable, Optional, Sequence, Union

from metastable import Description, Record

Path = Union[str, PathLike[str]]
Progress = Union[None, bool, Callable[[float], object]]


class Made(Record):
    cases: int
    sealed: str
    def __init__(self, cases: int, sealed: str) -> None: ...


class Answered(Record):
    cases: int
    answered: int
    failed: int
    def __init__(self, cases: int, answered: int, failed: int) -> None: ...


class Grades(Description): ...


def make(folder: Path, *, sealed: Optional[Path] = None, seed: Optional[int] = None, per_effect: int = 6,
         none: int = 300, pairs: int = 50, outside: int = 50, left_out: int = 3, mixed: int = 0, many: int = 0,
         law: str = "published", walker: Optional[str] = None, threads: int = 0,
         progress: Progress = None) -> Made: ...


def answer(folder: Path, *, tool: Union[None, str, Sequence[str]] = None, threads: int = 0,
           progress: Progress = None) -> Answered: ...


def open(folder: Path, *, sealed: Optional[Path] = None, partial: bool = False, out: Optional[Path] = None,
         threads: int = 0, progress: Progress = None) -> Grades: ...
