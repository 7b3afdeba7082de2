"""Rows in a data frame: whatever gives columns by name is read as a pandas.DataFrame is, which need not be there."""

import math
import unittest

import numpy as np

import metastable

nan = math.nan


def step(state, noise, p):
    push = p["push"] * p["load"]
    return (p["decay"] * state[:, 0] + push + p["scatter_rad"] * noise[:, 0])[:, None], np.zeros(len(state), bool)


def pendulum(**changes):
    stated = dict(states=["swing_rad"], noise=1, may_vary=["decay"], sensor={"swing_rad": 0.0005}, inputs=["load"],
                  parameters={"decay": (0.975, 0.01), "push": (0.01, 0.01), "scatter_rad": (0.003, 0.003, 1e-5, 0.1)})
    return metastable.machine(step, **{**stated, **changes})


class UnknownColumn(Exception):
    """What a frame of another package raises for a name that it does not have."""


class FrameColumn:
    """A column as frames have it: places are counted by an index, so that column[0] need not be there, and NumPy gets
    its values from nothing but to_numpy()."""

    def __init__(self, values, index):
        self._values, self.index = values, index

    def __len__(self):
        return len(self._values)

    def __getitem__(self, label):
        return self._values[self.index.index(label)]  # A ValueError where there is no such label.

    def to_numpy(self):
        return self._values

    def items(self):
        return zip(self.index, self._values)


class Frame:
    """As much of a data frame as runs() asks for."""

    def __init__(self, columns, first=7):
        self._columns = {name: values if isinstance(values, np.ndarray) else np.array(values, object)
                         for name, values in columns.items()}
        self._first = first

    @property
    def columns(self):
        return list(self._columns)

    def keys(self):
        return self.columns

    def __len__(self):
        return len(next(iter(self._columns.values())))

    def __getitem__(self, name):
        if name not in self._columns:
            raise UnknownColumn(name)
        return FrameColumn(self._columns[name], list(range(self._first, self._first + len(self))))


class Frames(unittest.TestCase):
    rows = dict(trial=["a", "a", "a", "b", "b"], swing_rad=np.array([0.8, 0.7, 0.6, 0.8, 0.7]), load=np.array([1, 2, 1, 2, 1]))

    def laid_out(self, machine=None, data=None, **arguments):
        return metastable.runs(machine or pendulum(), Frame(data or self.rows), **arguments)._laid_out

    def refused(self, sentence, **arguments):
        with self.assertRaises(metastable.InputError) as caught:
            self.laid_out(**arguments)
        self.assertIn(sentence, str(caught.exception))
        self.assertNotIn("\n", str(caught.exception))

    def test_give_all_columns_that_they_have(self):
        data = dict(self.rows, phase=["l", nan, "l", "r", "l"], time_s=np.arange(5) / 2, position_m=np.arange(5.0),
                    condition=["x"] * 3 + ["y"] * 2, outcome=[nan, nan, "failed", nan, None], crew=["day", "night", nan] + ["day"] * 2)
        found = self.laid_out(data=data, labels="crew")
        for name, expected in dict(trial=[0, 0, 0, 1, 1], trial_names=["a of x", "b of y"], phase=[0, -1, 0, 1, 0], phases=["l", "r"],
                                   time=[0, 0.5, 1, 1.5, 2], position=[0, 1, 2, 3, 4], outcome=["failed", None],
                                   label_index=[[0], [1], [-1], [0], [0]], input_values=[[1], [2], [1], [2], [1]],
                                   conditions=["x", "y"], seen=[[0.8], [0.7], [0.6], [0.8], [0.7]]).items():
            np.testing.assert_array_equal(found[name], expected, name)
        self.assertEqual(found["labels"], {"crew": ["day", "night"]})

    def test_are_read_as_dicts_of_arrays(self):
        machine = pendulum()
        by_dict, by_frame = (metastable.runs(machine, kind(self.rows))._laid_out for kind in (dict, Frame))
        for name, values in by_dict.items():
            np.testing.assert_array_equal(by_frame[name], values, name)

    def test_may_hold_truth_values_texts_and_missing_ones(self):
        seen = self.laid_out(data=dict(self.rows, swing_rad=[True, None, "0.6", " ", nan]))["seen"]
        np.testing.assert_array_equal(seen[:, 0], [1, nan, 0.6, nan, nan])
        seen = self.laid_out(data=dict(self.rows, swing_rad=np.array([True, False, True, True, False])))["seen"]
        np.testing.assert_array_equal(seen[:, 0], [1, 0, 1, 1, 0])
        found = self.laid_out(data=dict(self.rows, wet=np.array([True, False, True, True, False]), phase=["", "l", "l", "l", "l"]),
                              labels=["wet"])
        self.assertEqual((found["labels"], found["phase"].tolist()), ({"wet": ["False", "True"]}, [-1, 0, 0, 0, 0]))
        times = np.datetime64("2024-01-01", "ns") + 500 * np.arange(5).astype("timedelta64[ms]")
        np.testing.assert_array_equal(self.laid_out(data=dict(self.rows, time_s=times))["time"], np.arange(5) / 2)

    def test_have_an_outcome_in_some_rows_of_a_trial(self):
        for column, outcome in ((["failed"] * 3 + ["stopped"] * 2, ["failed", "stopped"]),
                                ([nan, nan, "failed", nan, nan], ["failed", None]),
                                (["", None, "", "lost", ""], [None, "lost"])):
            self.assertEqual(self.laid_out(data=dict(self.rows, outcome=column))["outcome"], outcome)
        self.refused('outcome: trial a has "stopped" and "failed" among its rows: one outcome for each trial expected',
                     data=dict(self.rows, outcome=["stopped", "stopped", "failed", nan, nan]))
        self.refused('outcome: "walks" is none of failed, stopped, lost', data=dict(self.rows, outcome=["walks"] * 5))
        self.assertEqual(self.laid_out(outcome={"b": "failed"})["outcome"], [None, "failed"])
        self.assertEqual(self.laid_out(outcome=FrameColumn(["failed", "lost"], ["b", "a"]))["outcome"], ["lost", "failed"])

    def test_lack_a_column_with_its_name(self):
        for name, sentence in (("trial", "runs: there is no column trial"), ("swing_rad", "runs: there is no column swing_rad"),
                               ("load", "inputs: there is no column load, which the machine's step takes")):
            self.refused(sentence, data={one: values for one, values in self.rows.items() if one != name})
        self.refused("labels: there is no column crew", labels="crew")
        self.refused("trial: row 2 has none", data=dict(self.rows, trial=["a", nan, "a", "b", "b"]))
        self.refused("swing_rad: numbers expected, and NaN for missing ones, not 'far' in row 3",
                     data=dict(self.rows, swing_rad=[0.8, nan, "far", 0.8, 0.7]))
        self.refused("swing_rad: shape (5, 2) given, (5,) expected", data=dict(self.rows, swing_rad=np.zeros((5, 2))))

    def test_get_the_diagnosis_of_their_columns(self):
        rng = np.random.default_rng(4)
        swing, load = np.zeros((12, 12)), rng.normal(size=(12, 12))
        swing[:, 0] = 0.8 + 0.05 * rng.standard_normal(12)
        for k in range(1, 12):
            swing[:, k] = 0.975 * swing[:, k - 1] + 0.01 * load[:, k - 1] + 0.003 * rng.standard_normal(12)
        columns = dict(trial=np.repeat([f"run {t}" for t in range(12)], 12).astype(object), load=load.ravel(),
                       swing_rad=swing.ravel() + 0.0005 * rng.standard_normal(144))
        machine = pendulum()
        one, other = (metastable.diagnose(metastable.runs(machine, kind(columns)), machine, catalogue="decay_drift")
                      for kind in (dict, Frame))
        self.assertEqual(one.sentences, other.sentences)

    def test_make_an_experiment_of_a_wheel(self):
        trials = metastable.simulate(metastable.Setting(law="plastic"), trials=3)
        columns = {name: np.asarray(trials.collisions[name]) for name in ("trial", "collision", "omega_minus_rad_s")}
        read = metastable.experiment(metastable.Setting(law="plastic"), Frame(columns), Frame(
            dict(trial=[1, 2, 3], outcome=list(trials.trials["outcome"]))))
        np.testing.assert_array_equal(read.collisions["omega_minus_rad_s"], columns["omega_minus_rad_s"])


if __name__ == "__main__":
    unittest.main()
