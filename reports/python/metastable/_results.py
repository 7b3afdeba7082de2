"""Results: objects whose fields are the keys of the command line's --json."""

import html
import json
import math

import numpy

from metastable import _frames


class Record:
    """Named values: fields as attributes, and by name in brackets where the name is no word of Python."""

    def __init__(self, values, arrays=None, path=""):
        for key, value in values.items():
            self.__dict__[key] = _field(value, arrays or {}, f"{path}{key}")

    def __getitem__(self, name):
        return self.__dict__[name]

    def __getattr__(self, name):
        what = f"'{type(self).__name__}' object has no attribute '{name}'"
        if not name.startswith("_"):
            what += f"; it has {', '.join(self.keys())}"
        raise AttributeError(what, name=name, obj=self)

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

    def _rows(self):
        return [_frames.flat(self)]

    def _draw(self, ax):
        raise TypeError(f"plot: a {type(self).__name__} has no curve to draw")

    def to_dataframe(self):
        """The rows as a pandas.DataFrame; where there are none, the fields as one row. Raises ImportError where pandas
        is not installed."""
        return _frames.dataframe(self._rows())

    def plot(self, ax=None):
        """Draws it on Matplotlib's axes, by default those of a new figure, and returns them. Raises ImportError where
        Matplotlib is not installed, TypeError where there is no curve to draw."""
        return self._draw(ax)

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
        return _kinds.get(path, Record)(value, arrays, path + ".")
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


class HowItFails(Record):
    """The last steps before failure: `last_steps` with medians and middle 90 % of states and noise, and `bound_to_fail`,
    the chance of failing before being back in the middle of the metastable regime (None by splitting); `regime`, all
    steps beside them; `most_likely_path`, by splitting the walk of least noise among those that failed. By splitting a
    median has `median_interval_95`, and the ends of `middle_90` have `middle_90_intervals_95`, None where not known."""

    def _rows(self):
        rows = []
        for step in self.last_steps:
            row = {"steps_before_the_last": step.steps_before_the_last}
            for part in (step.state, step.noise):
                for name in part.keys():
                    low, high = part[name].middle_90
                    row.update({name: part[name].median, f"{name}, 5 %": low, f"{name}, 95 %": high})
                    if "median_interval_95" in part[name].keys():
                        low, high = part[name].median_interval_95 or (numpy.nan, numpy.nan)
                        row.update({f"{name}, median low95": low, f"{name}, median high95": high})
            rows.append({**row, "bound_to_fail": step.bound_to_fail})
        return rows

    def _draw(self, ax):
        ax = _frames.axes(ax)
        before = [-step.steps_before_the_last for step in self.last_steps]
        if self.regime.bound_to_fail is None:
            for name in self.regime.state.keys():
                low, high = self.regime.state[name].middle_90
                ax.plot(before, [(step.state[name].median - self.regime.state[name].median) / (high - low)
                                 for step in self.last_steps], "o-", label=name)
            ax.set(xlabel="steps before the one that fails", ylabel="median off the regime's [its middle 90 %]")
            ax.legend()
            return ax
        ax.plot(before, [step.bound_to_fail for step in self.last_steps], "o-", label="before a failure")
        ax.axhline(self.regime.bound_to_fail, linestyle="--", label="all steps of the regime")
        ax.set(xlabel="steps before the one that fails", ylabel="chance of failing before coming back", yscale="log")
        ax.legend()
        return ax


class ExpectedSteps(Record):
    """Expected steps before failure. Those from the start are `from_start` of wheels and `value` of walkers; either
    name may be asked of both."""

    def __getattr__(self, name):
        other = {"from_start": "value", "value": "from_start"}.get(name)
        return self.__dict__[other] if other in self.__dict__ else super().__getattr__(name)


_kinds = {"how_it_fails": HowItFails, "expected_steps": ExpectedSteps, "settings[].expected_steps": ExpectedSteps}


class Study(Result):
    """How long one setting of the wheel walks. Fields: `steps --json` of reports/README.md; beside them `regime`. Its
    rows and its curve are those of `survival`."""

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

    def _rows(self):
        return {"steps": numpy.arange(len(self.survival)), "survival": self.survival}

    def _draw(self, ax):
        return _frames.plot_survival(ax, self.survival, self.failure_rate_per_step)


class Regime(Record):
    """What survivors look like at one landing leg: `edges` of the cells, squared speeds [rad^2/s^2] just before the
    collision, and the probability `mass` in each."""

    def __init__(self, edges, mass):
        super().__init__(dict(edges=edges, mass=mass))

    @property
    def speed_edges(self):
        """Edges as speeds [rad/s]."""
        return numpy.sqrt(self.edges)

    def _rows(self):
        return {"speed_low": self.speed_edges[:-1], "speed_high": self.speed_edges[1:], "mass": self.mass}

    def _draw(self, ax):
        ax = _frames.axes(ax)
        ax.stairs(self.mass / numpy.diff(self.speed_edges), self.speed_edges)
        ax.set(xlabel="speed before the collision [rad/s]", ylabel="density [s/rad]")
        return ax

    def __repr__(self):
        low, high = self.speed_edges[[0, -1]]
        return f"<metastable.Regime: {len(self.mass)} cells from {low:.3g} to {high:.3g} rad/s>"


def _ratio_to_first(contrast):
    value, ends = (contrast.ratio.value, contrast.ratio.interval_95) if contrast else (1.0, (1.0, 1.0))
    return {"times_the_first": value, "times_the_first_low95": ends[0], "times_the_first_high95": ends[1]}


def _draw_compared(ax, rows):
    return _frames.plot_steps(ax, [row["label"] for row in rows], *([row[f"expected_steps{end}"] for row in rows]
                                                                    for end in ("", "_low95", "_high95")))


class Comparison(Result):
    """Settings side by side on common random numbers: `settings`, and `contrasts` of each later one with the first;
    `rigid_bodies` says in one line how the law of rigid bodies compares, None where a law was named."""

    rigid_bodies = None

    def _headline(self):
        return " ".join(one.sentence for one in self.contrasts)

    def _rows(self):
        rows = []
        for setting, contrast in zip(self.settings, (None, *self.contrasts)):
            e = setting.expected_steps
            rows.append({"label": setting.label, "expected_steps": e.from_start, "expected_steps_low95": e.interval_95[0],
                         "expected_steps_high95": e.interval_95[1],
                         "failure_rate_per_step": setting.failure_rate_per_step, **_ratio_to_first(contrast)})
        return rows

    def _draw(self, ax):
        return _draw_compared(ax, self._rows())


class Solution(Result):
    """Which values of a parameter give what was asked for: `solutions`, each with `value` and `interval_95`, none where
    that is out of reach, and `sentences`. Fields: `solve --json` of reports/README.md."""

    rigid_bodies = None

    def _headline(self):
        return f"{self.parameter}: {self.sentences[0]}"

    def _rows(self):
        return [_frames.flat(one) for one in self.scanned]

    def _draw(self, ax):
        rows, ax = self._rows(), _frames.axes(ax)
        name = next(key for key in rows[0] if key != "at" and not key.startswith("interval"))
        at, value, low, high = _frames.finite(*([row.get(key, numpy.nan) for row in rows]
                                                for key in ("at", name, *_frames.interval_names("interval_95"))))
        ax.plot(at, value, ".-")
        ax.fill_between(at, low, high, alpha=0.3)
        ax.axhline(list(_frames.flat(self.target).values())[-1], linestyle="--", color="gray")
        for one in self.solutions:
            ax.axvline(one.value, linestyle=":", color="gray")
        ax.set(xlabel=f"{self.parameter} [{self.unit}]", ylabel=name.replace("_", " "))
        if name == "expected_steps":
            ax.set_yscale("log")
        return ax


class WalkerStudy(Result):
    """How long a walker, or a simulator of your own, walks. Fields: `steps --walker --json` of reports/README.md."""

    # Where there is a gait to tell of; where it was asked for; where splitting stands beside a mesh, or no mesh beside it.
    gait = how_it_fails = splitting = no_mesh = None
    # The intervals of `survival` are NaN where they are not known.
    survival_interval_95 = None
    # By splitting: survival after steps beyond, and what the rounds took.
    survival_after = None
    method = rounds = steps_of_a_round = rates_of_rounds = split_by = lines_to_failure = steps_of_the_map = None
    # Of a mesh.
    relative_errors = guided_sampling = direct_simulation = no_guided_sampling = no_direct_simulation = None
    other_gaits = meshes = memory_bytes = None

    def _headline(self):
        return f"{_steps(self.expected_steps.value, self.expected_steps.interval_95)}, {self.status}"

    def _rows(self):
        rows = {"steps": numpy.arange(len(self.survival)), "survival": self.survival}
        if self.survival_interval_95 is not None:
            low, high = self.survival_interval_95.T
            rows.update(survival_low95=low, survival_high95=high)
        return rows

    def _draw(self, ax):
        # Walks that all fail at once have no rate (`status` "all_failed").
        return _frames.plot_survival(ax, self.survival, self.failure_rate_per_step and self.failure_rate_per_step.value)


class WalkerComparison(Result):
    """Walkers side by side: `settings`, and `contrasts` with the ratio of expected steps to the first one's."""

    def _headline(self):
        return ", ".join(f"{one.ratio.value:.4g} times" for one in self.contrasts) + " the steps of the first"

    def _rows(self):
        rows = []
        for setting, contrast in zip(self.settings, (None, *self.contrasts)):
            e = setting.expected_steps
            rows.append({"label": setting.setting, "expected_steps": e.value, "expected_steps_low95": e.interval_95[0],
                         "expected_steps_high95": e.interval_95[1],
                         "failure_rate_per_step": setting.failure_rate_per_step.value, **_ratio_to_first(contrast)})
        return rows

    def _draw(self, ax):
        return _draw_compared(ax, self._rows())


class Diagnosis(Result):
    """What an experiment's nominal model lacks. Fields: `diagnose --json` of reports/README.md. Its rows are its causes.
    A notebook shows its tables and, where gnuplot is installed, its figures."""

    def __init__(self, answer):
        super().__init__(answer)
        self._scripts = list(answer["figures"])

    def _repr_html_(self):
        return self._html + "".join(_frames.drawn(script) for script in self._scripts)

    def _headline(self):
        named = self.verdict in ("explained", "partly_explained")
        return f"{self.verdict}: {' '.join(self.sentences[:2 if named else 1])}"

    def _rows(self):
        return [_frames.flat(cause) for cause in self.causes]

    def _draw(self, ax):
        ax = _frames.axes(ax)
        causes = self.causes[::-1]
        ax.barh([cause.effect for cause in causes], [cause.probability for cause in causes])
        ax.set(xlabel="probability of the cause", xlim=(0, 1))
        return ax


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

    def _spread(self, name):
        """A column: values, and the ends of their intervals, where there are any, else None."""
        cells = self[name]
        if not any(isinstance(cell, dict) for cell in cells):
            return cells, None, None
        return tuple([cell.get(key) if isinstance(cell, dict) else cell if key == "value" else None for cell in cells]
                     for key in ("value", "low", "high"))

    def _columns(self):
        columns = {}
        for name in self.units:
            value, low, high = self._spread(name)
            columns[name] = value
            if low is not None:
                columns.update(zip(_frames.interval_names(name), (low, high)))
        return columns

    def to_dataframe(self):
        """The rows as a pandas.DataFrame, intervals as two columns more. Raises ImportError where pandas is not
        installed."""
        return _frames.dataframe(self._columns())

    def plot(self, column=None, ax=None):
        """Draws a column (by default the first that has intervals, else the first of numbers) against the first one on
        Matplotlib's axes and returns them. Raises ImportError where Matplotlib is not installed, TypeError where there
        are no numbers to draw."""
        names = list(self.units)
        numbers = [name for name in names[1:] if all(isinstance(cell, (int, float, dict)) for cell in self[name])]
        with_intervals = [name for name in numbers if self._spread(name)[1] is not None]
        if column is None and not numbers:
            raise TypeError("plot: the table has no column of numbers")
        column = column or (with_intervals or numbers)[0]
        ax = _frames.axes(ax)
        value, low, high = (numpy.array([math.nan if v is None else v for v in part or ()], float)
                            for part in self._spread(column))
        at = numpy.arange(len(self))
        ax.errorbar(at, value, yerr=None if not len(low) else numpy.nan_to_num([value - low, high - value]), fmt="o",
                    capsize=3)
        ax.set_xticks(at, [_frames.number_text(cell) for cell in self._columns()[names[0]]], rotation=20, ha="right")
        unit = self.units[column]
        ax.set(xlabel=names[0], ylabel=f"{column} [{unit}]" if unit else column, title=self.title)
        return ax

    def __str__(self):
        return f"{self.title}\n\n{_frames.text_table(self._columns())}"

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

    def _table(self, name):
        if name is None:
            name = next(iter(self.tables), None)
        if name not in self.tables:
            raise KeyError(f"table: {name!r} is none of {', '.join(self.tables)}")
        return self.tables[name]

    def to_dataframe(self, table=None):
        """One of the tables (None: the first) as a pandas.DataFrame. Raises ImportError where pandas is not installed."""
        return self._table(table).to_dataframe()

    def plot(self, table=None, column=None, ax=None):
        """Draws a column of one of the tables (None: the first), as Table.plot."""
        return self._table(table).plot(column, ax)


class Columns:
    """Columns of equal length by name."""

    _drawn = None  # what plot() draws against what, where nothing is asked for

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

    def to_dataframe(self):
        """The columns as a pandas.DataFrame. Raises ImportError where pandas is not installed."""
        return _frames.dataframe(self._columns)

    def plot(self, x=None, y=None, ax=None):
        """Draws column y against column x as dots on Matplotlib's axes and returns them. Raises ImportError where
        Matplotlib is not installed."""
        numbers = [name for name, values in self._columns.items() if numpy.asarray(values).dtype.kind in "iuf"]
        x, y = (given or name for given, name in zip((x, y), self._drawn or (numbers + [None, None])[:2]))
        for name in (x, y):
            if name not in self._columns:
                raise KeyError(f"plot: {name!r} is none of the columns {', '.join(self._columns)}")
        ax = _frames.axes(ax)
        ax.plot(self._columns[x], self._columns[y], ".")
        ax.set(xlabel=x, ylabel=y)
        return ax

    def _shown(self):
        return self._columns

    def __str__(self):
        return f"{self._title}\n\n{_frames.text_table(self._shown())}"

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
        self._axes = list(self._columns)[:list(self._columns).index("expected_steps")]

    def _shown(self):
        shown = {name: self[name] for name in self._axes}
        names = {"expected_steps": "expected steps", "expected_steps_low95": "from", "expected_steps_high95": "to (95 %)",
                 "failure_rate_per_step": "failure rate per step", "status": "status",
                 "rigid_bodies_steps": "steps of rigid bodies"}
        shown.update((words, self[name]) for name, words in names.items() if name in self._columns)
        return shown

    def __str__(self):
        lines = [super().__str__()]
        lines += [f"{', '.join(f'{name} {self[name][i]:.6g}' for name in self._axes)}: {message}"
                  for i, message in enumerate(self.message) if message]
        return "\n\n".join(lines + ([self.rigid_bodies] if self.rigid_bodies else []))

    def plot(self, x=None, y="expected_steps", ax=None):
        """Draws column y over the axis x (None: the one with most values), a curve for each combination of the others,
        on Matplotlib's axes, and returns them: expected steps with their intervals. Raises ImportError where Matplotlib
        is not installed."""
        x = x or max(self._axes, key=lambda name: len(numpy.unique(self[name])))
        for name in (x, y):
            if name not in self._columns:
                raise KeyError(f"plot: {name!r} is none of the columns {', '.join(self._columns)}")
        ax = _frames.axes(ax)
        others = [name for name in self._axes if name != x]
        curves = {}
        for i in range(len(self)):
            curves.setdefault(tuple(self[name][i] for name in others), []).append(i)
        for at, points in curves.items():
            label = ", ".join(f"{name} {value:.6g}" for name, value in zip(others, at))
            ax.plot(self[x][points], self[y][points], ".-", label=label)
            if f"{y}_low95" in self._columns:
                ax.fill_between(self[x][points], self[f"{y}_low95"][points], self[f"{y}_high95"][points], alpha=0.3)
        ax.set(xlabel=x, ylabel=y.replace("_", " "))
        if y == "expected_steps":
            ax.set_yscale("log")
        if others:
            ax.legend()
        return ax


class Walks(Columns):
    """Walks step by step; `steps` and `fell` tell of each walk."""

    def __init__(self, columns, steps, fell):
        super().__init__(columns, f"{len(steps)} walks")
        self.steps, self.fell = steps, fell

    def plot(self, ax=None):
        """Draws the share of the walks that goes on after n steps on Matplotlib's axes and returns them. Raises
        ImportError where Matplotlib is not installed."""
        return _frames.plot_walked(ax, self.steps, self.fell)
