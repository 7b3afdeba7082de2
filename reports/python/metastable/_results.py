"""Results: objects whose fields are the keys of the command line's --json."""

import html
import json
import math

import numpy


class Record:
    """Named values: fields as attributes, and by name in brackets where the name is no word of Python."""

    def __init__(self, values, arrays=None, path=""):
        for key, value in values.items():
            self.__dict__[key] = _field(value, arrays or {}, f"{path}{key}")

    def __getitem__(self, name):
        return self.__dict__[name]

    def __iter__(self):
        return iter(self.keys())

    def __len__(self):
        return len(self.keys())

    def __eq__(self, other):
        if type(other) is not type(self):
            return NotImplemented
        return self.keys() == other.keys() and all(numpy.array_equal(self[k], other[k]) for k in self.keys())

    __hash__ = None

    def keys(self):
        """The names of the fields."""
        return [key for key in self.__dict__ if not key.startswith("_")]

    def to_dict(self):
        """Names and values as plain data: dicts, lists, numbers and texts."""
        return {key: _plain(self[key]) for key in self.keys()}

    def __repr__(self):
        return "{" + ", ".join(f"{key}: {self[key]!r}" for key in self.keys()) + "}"

    def _repr_html_(self):
        rows = "".join(f"<tr><th>{html.escape(key)}</th><td>{_cell(self[key])}</td></tr>" for key in self.keys())
        return f"<table>{rows}</table>"


def _plain(value):
    if hasattr(value, "to_dict"):
        return value.to_dict()
    if isinstance(value, (tuple, list)):
        return [_plain(each) for each in value]
    return value.tolist() if hasattr(value, "tolist") else value


def _html_table(names, rows):
    head = "".join(f"<th>{html.escape(name)}</th>" for name in names)
    return f"<table><tr>{head}</tr>" + "".join(
        "<tr>" + "".join(f"<td>{_cell(value)}</td>" for value in row) + "</tr>" for row in rows) + "</table>"


def _cell(value):
    if hasattr(value, "_repr_html_"):
        return value._repr_html_()
    if isinstance(value, float):
        return f"{value:.6g}"
    return html.escape(str(value))


def _field(value, arrays, path):
    if path in arrays:
        return arrays[path]
    if isinstance(value, dict):
        return Record(value, arrays, path + ".")
    if isinstance(value, list):
        return tuple(_field(each, arrays, path + "[]") for each in value)
    return {"infinite": math.inf, "-infinite": -math.inf}.get(value, value) if isinstance(value, str) else value


class Result(Record):
    """An answer of the toolkit. print() shows what the command line prints, a notebook a table."""

    def __init__(self, answer):
        super().__init__(json.loads(answer["json"]), answer["arrays"])
        self._json, self._text, self._html = answer["json"], answer["text"], answer["html"]

    def to_dict(self):
        """The same keys and values as the command line's --json; infinity is the word "infinite"."""
        return json.loads(self._json)

    def __str__(self):
        return self._text

    def __repr__(self):
        return f"<metastable.{type(self).__name__}: {self._headline()}>"

    def _repr_html_(self):
        return self._html


def _steps(value, interval):
    if math.isinf(value):
        return "infinitely many steps"
    return f"{value:.4g} steps (95 %: {interval[0]:.4g} to {interval[1]:.4g})"


class Study(Result):
    """How long one setting of the wheel walks. Fields: `steps --json` of reports/README.md; beside them `regime`."""

    # What is there only where it was asked for, or where there is something to say.
    message = certificate = sensitivities = how_it_fails = from_standard_errors = rigid_bodies = None

    def __init__(self, answer):
        super().__init__(answer)
        self._regime = tuple(Regime(**leg) for leg in answer["regime"])

    @property
    def regime(self):
        """The metastable regime, a Regime for each landing leg."""
        return self._regime

    def _headline(self):
        e = self.expected_steps
        return f"{_steps(e.from_start, e.interval_95)}, {self.status}"


class Regime(Record):
    """What survivors look like at one landing leg: `edges` of the cells, squared speeds [rad^2/s^2] just before the
    collision, and the probability `mass` in each."""

    def __init__(self, edges, mass):
        super().__init__(dict(edges=edges, mass=mass))

    @property
    def speed_edges(self):
        """Edges as speeds [rad/s]."""
        return numpy.sqrt(self.edges)

    def __repr__(self):
        low, high = self.speed_edges[[0, -1]]
        return f"<metastable.Regime: {len(self.mass)} cells from {low:.3g} to {high:.3g} rad/s>"


class Comparison(Result):
    """Settings side by side on common random numbers: `settings`, and `contrasts` of each later one with the first;
    `rigid_bodies` says in one line how the law of rigid bodies compares, None where a law was named."""

    rigid_bodies = None

    def _headline(self):
        return " ".join(one.sentence for one in self.contrasts)


class Solution(Result):
    """Which values of a parameter give what was asked for: `solutions`, each with `value` and `interval_95`, none where
    that is out of reach, and `sentences`. Fields: `solve --json` of reports/README.md."""

    rigid_bodies = None

    def _headline(self):
        return f"{self.parameter}: {self.sentences[0]}"


class WalkerStudy(Result):
    """How long a walker, or a simulator of your own, walks. Fields: `steps --walker --json` of reports/README.md."""

    gait = how_it_fails = None  # where there is a gait to tell of; where it was asked for

    def _headline(self):
        return f"{_steps(self.expected_steps.value, self.expected_steps.interval_95)}, {self.status}"


class WalkerComparison(Result):
    """Walkers side by side: `settings`, and `contrasts` with the ratio of expected steps to the first one's."""

    def _headline(self):
        return ", ".join(f"{one.ratio.value:.4g} times" for one in self.contrasts) + " the steps of the first"


class Diagnosis(Result):
    """What an experiment's nominal model lacks. Fields: `diagnose --json` of reports/README.md."""

    def _headline(self):
        return f"{self.verdict}: {self.sentences[0]}"


class Table:
    """A table as data. `columns` by name; iterate over its rows, which are dicts."""

    def __init__(self, values):
        self.title, self.notes = values["title"], tuple(values["notes"])
        self.units = {column["name"]: column["unit"] for column in values["columns"]}
        self.rows = [dict(zip(self.units, row)) for row in values["rows"]]

    def __iter__(self):
        return iter(self.rows)

    def __len__(self):
        return len(self.rows)

    def __getitem__(self, column):
        return [row[column] for row in self.rows]

    def to_dict(self):
        """Title, notes, units by column, and rows as dicts."""
        return {"title": self.title, "notes": list(self.notes), "units": dict(self.units), "rows": list(self.rows)}

    def _repr_html_(self):
        return f"<p>{html.escape(self.title)}</p>" + _html_table(self.units, (row.values() for row in self.rows))

    def __repr__(self):
        return f"<metastable.Table: {self.title}, {len(self.rows)} rows of {', '.join(self.units)}>"


class Description(Result):
    """What the trials of an experiment show: `tables` by name, each a Table."""

    def __init__(self, answer):
        super().__init__(answer)
        self.tables = {name: Table(values) for name, values in json.loads(answer["json"])["tables"].items()}

    def _headline(self):
        return ", ".join(table.title for table in self.tables.values())


class Columns:
    """Columns of equal length by name, as pandas.DataFrame takes them: DataFrame(dict(columns))."""

    def __init__(self, columns, title):
        self._columns, self._title = dict(columns), title

    def keys(self):
        """The names of the columns."""
        return self._columns.keys()

    def __getitem__(self, name):
        return self._columns[name]

    def __iter__(self):
        return iter(self._columns)

    def __len__(self):
        return len(next(iter(self._columns.values()), ()))

    def __getattr__(self, name):
        if name.startswith("_") or name not in self._columns:
            raise AttributeError(name)
        return self._columns[name]

    def to_dict(self):
        """Columns as lists."""
        return {name: numpy.asarray(values).tolist() for name, values in self._columns.items()}

    def __repr__(self):
        return f"<metastable.{type(self).__name__}: {self._title}, {len(self)} rows of {', '.join(self._columns)}>"

    def _repr_html_(self, most=20):
        rows = zip(*(values[:most] for values in self._columns.values()))
        more = f"<p>{len(self) - most} more rows</p>" if len(self) > most else ""
        return _html_table(self._columns, rows) + more


class Sweep(Columns):
    """Expected steps over ranges, a row a point, the last axis fastest; columns as in the command line's CSV.
    Points whose solver failed, or that have no regime to launch from, are NaN, with the reason in `message`.
    `rigid_bodies` says in one line how the law of rigid bodies compares; None where a law was named."""

    def __init__(self, columns, title, rigid_bodies=None):
        super().__init__(columns, title)
        self.rigid_bodies = rigid_bodies


class Walks(Columns):
    """Walks step by step; `steps` and `fell` tell of each walk."""

    def __init__(self, columns, steps, fell):
        super().__init__(columns, f"{len(steps)} walks")
        self.steps, self.fell = steps, fell
