"""Results as frames, figures and tables of text: with pandas and Matplotlib, and what is said without them."""

import contextlib
import importlib.util
import sys
import types
import unittest
import unittest.mock

import numpy as np

import metastable

quick = dict(cells=32, samples=256, replicates=2)


def there(name):
    return importlib.util.find_spec(name) is not None


@contextlib.contextmanager
def columns_only():
    """Where pandas is not there, a stand-in whose frame keeps what it is given."""
    if there("pandas"):
        yield
        return

    class Frame:
        def __init__(self, rows):
            self.columns = list(dict.fromkeys(name for row in rows for name in row)) if isinstance(rows, list) else list(rows)
            self.count = len(rows) if isinstance(rows, list) else len(next(iter(rows.values())))

        def __len__(self):
            return self.count

    pandas = types.ModuleType("pandas")
    pandas.DataFrame = Frame
    with unittest.mock.patch.dict(sys.modules, {"pandas": pandas}):
        yield


def line(state, noise):
    following = state / 2 + noise
    return following, following[:, 0] > 2


class Frames(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        setting = metastable.Setting(slope_deg=9.59)
        study = metastable.study(setting, how_it_fails=True, **quick)
        walker = metastable.walker(line, 1, 1, start=[0], names=["x [m]"])
        studied = walker.study(simulated_steps=0, spacing=0.5, how_it_fails=True)
        simplest = metastable.WalkerSetting("simplest", slope_sd_deg=0.6)
        trials = metastable.simulate(setting, trials=30)
        described = metastable.describe(metastable.simulate(metastable.Setting(law="plastic"), trials=12))
        chain = metastable.chain(np.array([[0, 0.5], [0.3, 0]]), kill=[0.5, 0.7])
        # Each with its number of rows, and a column.
        cls.results = [
            (study, len(study.survival), "survival"), (study.how_it_fails, 6, "bound_to_fail"),
            (study.regime[0], len(study.regime[0].mass), "mass"),
            (metastable.compare(setting, friction_mean=[0.3, 0.4], **quick), 2, "times_the_first_low95"),
            (metastable.sweep(setting, friction_mean=[0.35, 0.45], friction_sd=[0.08, 0.1], **quick), 4, "expected_steps"),
            (metastable.solve(setting, "friction_mean", steps=50, method="integrated", points=5), 5, "interval_95_low"),
            (studied, len(studied.survival), "survival"), (studied.how_it_fails, 6, "x [m], 5 %"),
            (walker.simulate(trials=40), 40, "steps"),
            (metastable.simulate(simplest, trials=20), None, "slope met [deg]"),
            (metastable.compare([simplest] * 2, spacing=1.2, simulated_steps=10000), 2, "expected_steps"),
            (trials, None, "omega_minus_rad_s"), (trials.collisions, None, "leg"), (trials.trials, 30, "outcome"),
            (metastable.diagnose(trials, catalogue="slope_offset"), None, "probability"),
            (described, 1, "trials"), (described.tables["conditions"], 1, "steady speed_low"),
            (chain.first_passage(), 2, "upper"), (chain.quasi_stationary(), 2, "distribution"),
            (chain.committor([1]), 2, "reach"),
        ]

    def test_hold_the_rows_of_each_result(self):
        with columns_only():
            for result, rows, column in self.results:
                with self.subTest(type(result).__name__):
                    frame = result.to_dataframe()
                    self.assertIn(column, list(frame.columns))
                    self.assertEqual(len(frame), rows or len(frame))
            self.assertGreater(len(self.results[11][0].to_dataframe()), 30)

    @unittest.mock.patch.dict(sys.modules, {"pandas": None})
    def test_without_pandas_a_sentence_names_it(self):
        for result, _, _ in self.results:
            with self.assertRaisesRegex(ImportError, "^to_dataframe needs the package pandas, which this Python does not"):
                result.to_dataframe()

    @unittest.mock.patch.dict(sys.modules, {"matplotlib": None, "matplotlib.pyplot": None})
    def test_without_matplotlib_a_sentence_names_it(self):
        for result, _, _ in self.results:
            with self.assertRaisesRegex(ImportError, "^plot needs the package matplotlib, which this Python does not"):
                result.plot()

    def test_are_drawn_on_the_axes_given(self):
        if not there("matplotlib"):
            return self.test_without_matplotlib_a_sentence_names_it()
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
        for result, _, _ in self.results:
            with self.subTest(type(result).__name__):
                figure = Figure()
                canvas, ax = FigureCanvasAgg(figure), figure.add_subplot()
                self.assertIs(result.plot(ax=ax), ax)
                canvas.draw()
                self.assertTrue(ax.lines or ax.patches or ax.containers or ax.collections)
                self.assertTrue(ax.get_xlabel() or ax.get_ylabel())

    def test_what_has_no_curve_says_so(self):
        with self.assertRaisesRegex(TypeError, "^plot: a Record has no curve to draw"):
            self.results[0][0].provenance.plot()


class Prints(unittest.TestCase):
    def test_of_a_sweep_show_its_rows(self):
        sweep = metastable.sweep(metastable.Setting(slope_deg=9.59), friction_mean=[0.35, 0.45], **quick)
        lines = str(sweep).splitlines()
        self.assertEqual(lines[0], "expected steps over friction_mean")
        head = next(i for i, words in enumerate(lines) if words.startswith("friction_mean"))
        self.assertIn("expected steps", lines[head])
        for i, mean in enumerate(("0.35", "0.45")):
            cells = lines[head + 1 + i].split()
            self.assertEqual(cells[0], mean)
            self.assertEqual(cells[1], f"{sweep.expected_steps[i]:.5g}")
        self.assertEqual(lines[-1], sweep.rigid_bodies)
        self.assertLess(max(map(len, lines[:-1])), 160)

    def test_of_many_rows_show_the_first_and_the_last(self):
        trials = metastable.simulate(metastable.Setting(slope_deg=9.59), trials=60)
        text = str(trials.trials)
        self.assertIn("60 rows, of which the first and the last 20 are shown", text)
        self.assertLess(len(text.splitlines()), 50)

    def test_of_one_study_speak_of_one(self):
        setting = metastable.Setting(slope_deg=9.59)
        study = metastable.study(setting, **quick)
        self.assertTrue(str(study).startswith("9.59 deg, "))
        for text in (str(study), study._repr_html_()):
            self.assertNotIn("side by side", text)
        self.assertIn("How long the wheel rolls", study._repr_html_())
        compared = metastable.compare(setting, friction_mean=[0.3, 0.4], **quick)._repr_html_()
        for words in ("The settings side by side", "mu 0.3", "mu 0.4"):
            self.assertIn(words, compared)


if __name__ == "__main__":
    unittest.main()
