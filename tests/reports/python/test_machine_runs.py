"""What runs() makes of columns: lost rows, outcomes by trial, missing values, times, marks."""

import datetime
import unittest

import numpy as np

import metastable


def step(state, noise, p):
    return p["decay"] * state[:, 0] + p["scatter_rad"] * noise[:, 0], np.zeros(len(state), bool)


def pendulum(**changes):
    stated = dict(states=["swing_rad"], noise=1, may_vary=["decay"], sensor={"swing_rad": 0.0005},
                  parameters={"decay": (0.975, 0.01), "scatter_rad": (0.003, 0.003, 1e-5, 0.1)})
    return metastable.machine(step, **{**stated, **changes})


def laid_out(*data, machine=None, **columns):
    return metastable.runs(machine or pendulum(), *data, **columns)._laid_out


class NAType:
    """The missing value of pandas: it can be compared with nothing."""

    def __eq__(self, other):
        return self

    __ne__ = __eq__
    __hash__ = object.__hash__

    def __bool__(self):
        raise TypeError("boolean value of NA is ambiguous")


class RangeIndex(list):
    """The index of a Series that only counts."""


class Series:
    """As much of a pandas.Series as runs() asks for."""

    def __init__(self, values, index):
        self.values, self.index = values, index

    def __len__(self):
        return len(self.values)

    def tolist(self):
        return list(self.values)

    def items(self):
        return zip(self.index, self.values)


class Columns(unittest.TestCase):
    rows = dict(trial=[1, 1, 1, 2, 2, 2], swing_rad=[0.8, 0.7, 0.6, 0.8, 0.7, 0.6])

    def refused(self, sentence, **columns):
        with self.assertRaises(metastable.InputError) as caught:
            metastable.runs(columns.pop("machine", None) or pendulum(), **{**self.rows, **columns})
        self.assertIn(sentence, str(caught.exception))
        self.assertNotIn("\n", str(caught.exception))


class LostRows(Columns):
    gaps = [1, 2, 5, -3, -1, 0]

    def test_are_as_rows_of_nan(self):
        nan, machine = np.nan, pendulum(inputs=["load"])
        given = metastable.runs(machine, step=self.gaps, phase=list("lrlrrl"), time_s=[0, 1, 4, 5, 7, 8], **self.rows,
                                labels={"crew": list("aaabbb")}, inputs={"load": [3, 3, 3, 4, 4, nan]})
        by_hand = metastable.runs(machine, trial=[1] * 5 + [2] * 4, phase=list("lrlrlrlrl"), time_s=np.arange(9.0),
                                  swing_rad=[0.8, 0.7, nan, nan, 0.6, 0.8, nan, 0.7, 0.6],
                                  labels={"crew": list("aaaaabbbb")}, inputs={"load": [3] * 5 + [4] * 3 + [nan]})
        for name, values in by_hand._laid_out.items():
            np.testing.assert_array_equal(given._laid_out[name], values, name)
        self.assertEqual(repr(given), "<metastable.Runs: 2 trials, 6 rows and 3 lost ones between them>")

    def test_make_no_gap_between_model_and_machine(self):
        rng = np.random.default_rng(11)
        swing = np.zeros((40, 20))
        swing[:, 0] = 0.8 + 0.05 * rng.standard_normal(40)
        for k in range(1, 20):
            swing[:, k] = 0.975 * swing[:, k - 1] + 0.003 * rng.standard_normal(40)
        data = dict(trial=np.repeat(np.arange(40), 20), step=np.tile(np.arange(20), 40),
                    swing_rad=swing.ravel() + 0.0005 * rng.standard_normal(800))
        keep = (rng.random(800) > 0.06) | (data["step"] == 0)
        runs = metastable.runs(pendulum(), {name: values[keep] for name, values in data.items()})
        answer = metastable.diagnose(runs, pendulum(), catalogue="outliers")
        self.assertIn(answer.verdict, ("no_gap", "recalibrate"))

    def test_that_cannot_be_put_in_are_refused(self):
        for steps, sentence in (
            ([1, 2, 1, 1, 2, 3], "it is 1 in trial 1, row 3, after 2 in the row before: steps are expected to rise"),
            ([1, 2, 3, 1, 1, 3], "it is 1 in trial 2, row 2, after 1"),
            ([1, 2, 2.5, 1, 2, 3], "it is 2.5 in trial 1, row 3: a whole number is expected"),
            ([1, 2, np.nan, 1, 2, 3], "it is nan in trial 1, row 3: a whole number is expected"),
            ([1, 2, 4000, 1, 2, 3], "it is 4000 in trial 1, row 3, after 2 in the row before, so that 3997 rows are "
                                    "missing beside the 6 there are: a step number is wrong"),
        ):
            self.refused("step: " + sentence, step=steps)

    def test_whose_phase_label_or_input_is_not_known_are_refused(self):
        self.refused("phase: its value in the lost step -2 of trial 2 does not follow from the other rows: put the row "
                     "in, with its phase", step=self.gaps, phase=list("lllrrl"))
        self.refused("crew: its value in the lost step 3 of trial 1 does not follow", step=self.gaps,
                     labels={"crew": list("abaaab")})
        self.refused("inputs: load in the lost step 3 of trial 1 does not follow", machine=pendulum(inputs=["load"]),
                     step=self.gaps, inputs={"load": [1, 2, 2, 3, 3, 3]})

    def test_are_none_where_step_means_something_else(self):
        machine = pendulum(inputs=["step"])
        self.assertEqual(len(laid_out(dict(self.rows, step=[0.3, 0.1, 0.2] * 2), machine=machine)["trial"]), 6)
        self.assertEqual(len(laid_out(dict(self.rows, step=list("abcabc")), labels="step")["trial"]), 6)


class Outcomes(Columns):
    conditions = dict(trial=[1] * 6, condition=["slow"] * 3 + ["fast"] * 3)

    def outcomes(self, outcome, **columns):
        return laid_out(outcome=outcome, **{**self.rows, **columns})["outcome"]

    def test_of_trials_that_are_numbered_anew_in_each_condition(self):
        self.refused("outcome: trial 1 is there in the conditions slow, fast: give (condition, trial), as ('slow', 1)",
                     outcome={1: "failed"}, **self.conditions)
        self.refused("outcome: ('slwo', 1) is no trial, nor a (condition, trial)", outcome={("slwo", 1): "failed"},
                     **self.conditions)
        self.assertEqual(self.outcomes({("fast", 1): "failed"}, **self.conditions), [None, "failed"])
        self.assertEqual(self.outcomes(["failed", "lost"], **self.conditions), ["failed", "lost"])
        self.refused("outcome: ('all', 1) is there twice", outcome={1: "failed", ("all", 1): "lost"})

    def test_of_a_series_go_by_its_index(self):
        self.assertEqual(self.outcomes(Series(["failed", "lost"], [2, 1])), ["lost", "failed"])
        self.assertEqual(self.outcomes(Series(["failed", NAType()], RangeIndex(range(2)))), ["failed", None])
        self.refused("outcome: 5 is no trial", outcome=Series(["failed", "lost"], [1, 5]))
        self.refused("outcome: 1 is there twice", outcome=Series(["failed", "lost"], [1, 1]))
        self.refused("outcome: 6 given, one for each of the 2 trials expected",
                     outcome=Series(["failed"] * 6, RangeIndex(range(6))))
        turned, counted = [1, 1, 1, 0, 0, 0], RangeIndex(range(2))
        self.refused("so do the trials, which come in another order", trial=turned,
                     outcome=Series(["failed", "lost"], counted))
        self.assertEqual(self.outcomes(Series(["lost", "lost"], counted), trial=turned), ["lost", "lost"])

    def test_are_no_word_and_no_table(self):
        self.refused("outcome: one for each of the 2 trials expected, not one word", outcome="failed")
        self.refused("outcome: one for each trial expected, not a table", outcome=np.array([["failed", "lost"]]))


class Missing(Columns):
    def test_values_of_pandas_are_nan(self):
        seen = laid_out(trial=[1, 1], swing_rad=[0.8, NAType()])["seen"]
        np.testing.assert_array_equal(seen, [[0.8], [np.nan]])
        self.assertEqual(laid_out(phase=["l", NAType()] * 3, **self.rows)["phase"].tolist(), [0, -1] * 3)
        self.refused("trial: row 2 has none", trial=[1, NAType(), 1, 2, 2, 2])
        self.refused("condition: row 2 has none", condition=["a", NAType()] * 3)
        self.refused("step: it is nan in trial 1, row 2", step=[1, NAType(), 3, 1, 2, 3])

    def test_texts_of_files_are_numbers(self):
        seen = laid_out(trial=[1, 1, 1], swing_rad=["0.8", " ", "0.75"])["seen"]
        np.testing.assert_array_equal(seen, [[0.8], [np.nan], [0.75]])
        self.refused("swing_rad: numbers expected, and NaN for missing ones, not '0,7' in row 2",
                     swing_rad=["0.8", "0,7", "0.6", "0.8", "0.7", "0.6"])
        self.refused("trial: one for every row expected, not 1 for all of them", trial=1)

    def test_times_are_seconds(self):
        dates = np.datetime64("2024-01-01", "ns") + 500 * np.arange(6).astype("timedelta64[ms]")
        half, start = datetime.timedelta(seconds=0.5), datetime.datetime(2024, 1, 1, tzinfo=datetime.timezone.utc)
        for given in (dates, dates - dates[0], [start + half * k for k in range(6)], [half * k for k in range(6)]):
            np.testing.assert_array_equal(laid_out(time_s=given, **self.rows)["time"], np.arange(6) / 2)
        self.assertTrue(np.isnan(laid_out(time_s=[start, None] * 3, **self.rows)["time"][1]))
        self.refused("time_s: seconds are expected", time_s=[start, 1, 2, 3, 4, 5])
        self.refused("position_m: an array of numbers expected, not of datetime64[ns]", position_m=dates)

    def test_values_are_not_marked_by_a_number(self):
        rng = np.random.default_rng(1)
        trial, swing, some = np.repeat(np.arange(30), 20), 0.6 + 0.1 * rng.standard_normal(600), rng.random(600) < 0.04
        for mark in (-999, 99, 1e6):
            self.refused(f"swing_rad is {mark:g} in {some.sum()} of 600 rows, far from all other values: is it a mark "
                         "for missing values? Give NaN there", trial=trial, swing_rad=np.where(some, mark, swing))
        first = np.arange(600) % 20 == 0
        for real in (np.where(some, 0, swing), np.minimum(swing, 0.65), np.round(swing, 1), some * 1.0,
                     np.where(some, np.nan, swing), np.where(first, 40, swing), np.where(np.roll(first, -1), 40, swing),
                     np.clip(rng.standard_cauchy(600), -50, 50)):
            self.assertEqual(len(laid_out(trial=trial, swing_rad=real)["seen"]), 600)


if __name__ == "__main__":
    unittest.main()
