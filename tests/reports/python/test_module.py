"""Settings, results, errors, progress and interruption."""

import copy
import io
import math
import pickle
import signal
import sys
import tempfile
import threading
import time
import types
import unittest
import unittest.mock
from contextlib import redirect_stderr
from pathlib import Path

import numpy as np

import metastable
from support import data

quick = dict(cells=32, samples=256, replicates=2)


class Settings(unittest.TestCase):
    def test_copies_prints_and_pickles_alike(self):
        setting = metastable.Setting(slope_deg=5, initial_speed=np.array([6, 0.3]), legs=[0.15] * 7, law="coulomb")
        for other in (copy.deepcopy(setting), pickle.loads(pickle.dumps(setting)),
                      eval(repr(setting), vars(metastable)), setting.replace(slope_deg=4).replace(slope_deg=5)):
            self.assertEqual(other, setting)
            self.assertEqual(hash(other), hash(setting))
        self.assertIn("7 legs of 0.15 m, law coulomb", setting.describe())
        self.assertEqual(metastable.Setting(legs=0.15), metastable.Setting(legs=[0.15] * 8))

    def test_launches_as_the_paper_does_until_told(self):
        self.assertEqual(metastable.Setting().launch, (7.35, 0.19))
        self.assertEqual(metastable.Setting().replace(slope_deg=9.59).launch, (5.83, 0.28))
        self.assertIsNone(metastable.Setting(slope_deg=8).launch)  # which is steady, and known once it is studied
        with self.assertRaisesRegex(metastable.InputError, "^initial_speed: 'steadily' is not"):
            metastable.Setting(initial_speed="steadily")

    def test_wrong_kinds_are_refused(self):
        for fields, sentence in ((dict(mass="heavy"), "mass: a number expected, not str"),
                                 (dict(friction=(1, 2, 3)), "friction: '1,2,3' is not 'mean,sd'"),
                                 (dict(contact_list=[1, 2]), "contact_list: an array of n rows and two columns"),
                                 (dict(legs=[0.15]), "legs: 1 legs are fewer than 3"),
                                 (dict(first_leg=8), r"first_leg: 8 is outside 0\.\.7"),
                                 (dict(mass=True), "mass: a number expected, not bool"),
                                 (dict(mass=[1, 2]), "mass: a number expected, not list"),
                                 (dict(law=3), "law: a text expected, not int"),
                                 (dict(friction=(math.nan, 0.1)), "nan")):
            with self.assertRaisesRegex(metastable.InputError, sentence):
                metastable.Setting(**fields)


class Studies(unittest.TestCase):
    def test_fields_are_the_keys_and_arrays_the_memory(self):
        study = metastable.study(metastable.Setting(slope_deg=9.59), **quick)
        told = study.to_dict()
        self.assertEqual(set(study.keys()), set(told))
        self.assertEqual(study.expected_steps.interval_95, tuple(told["expected_steps"]["interval_95"]))
        self.assertEqual(study.expected_steps.quantiles["0.5"], told["expected_steps"]["quantiles"]["0.5"])
        self.assertEqual(study.survival.tolist(), told["survival"])
        self.assertFalse(study.survival.flags.owndata)
        self.assertFalse(study.survival.flags.writeable)
        survival, first = study.survival, study.survival[0]
        for leg in study.regime:
            self.assertAlmostEqual(leg.mass.sum(), 1, 9)
            self.assertEqual(len(leg.speed_edges), len(leg.mass) + 1)
        again = pickle.loads(pickle.dumps(study))
        self.assertEqual(again, study)
        del study, leg
        self.assertEqual(survival[0], first)  # the memory lives as long as a view of it
        self.assertIn("expected steps before failure", str(again))
        self.assertIn("<table", again._repr_html_())
        self.assertRegex(repr(again), r"^<metastable.Study: .* steps \(95 %: ")
        self.assertIsNone(again.certificate)

    def test_infinity_is_a_number_here(self):
        study = metastable.study(metastable.Setting(law="coulomb"), **quick)
        self.assertEqual(study.expected_steps.from_start, math.inf)
        self.assertEqual(study.to_dict()["expected_steps"]["from_start"], "infinite")
        self.assertEqual(study.status, "rest_unreachable")

    def test_sweep_is_its_studies(self):
        setting = metastable.Setting(slope_deg=9.59)
        sweep = metastable.sweep(setting, friction_mean=[0.35, 0.45], friction_sd=[0.1], **quick)
        self.assertEqual(len(sweep), 2)
        alone = metastable.study(setting.replace(friction=(0.45, 0.1)), **quick)
        self.assertEqual(sweep.expected_steps[1], alone.expected_steps.from_start)
        self.assertEqual(sweep["friction_mean"].tolist(), [0.35, 0.45])
        with self.assertRaisesRegex(metastable.InputError, "leg_length: values must rise"):
            metastable.sweep(setting, leg_length=[0.16, 0.15])

    def test_options_that_do_nothing_are_refused(self):
        setting = metastable.Setting()
        for options, sentence in ((dict(method="integrated", samples=64), "samples: has a meaning under method"),
                                  (dict(guided_samples=16), "guided_samples: has a meaning with walker only"),
                                  (dict(tolerance=2), "tolerance"),
                                  (dict(seed=1.5), "seed: '1.5' is not a whole number in 0"),
                                  (dict(standard_errors={"mood": 1}), "mood")):
            with self.assertRaisesRegex(metastable.InputError, sentence):
                metastable.study(setting, **options)
        with self.assertRaisesRegex(metastable.InputError, "a Setting, WalkerSetting, Walker or Machine expected, not int"):
            metastable.study(3)


class Waiting(unittest.TestCase):
    def test_ctrl_c_stops_and_leaves_nothing_behind(self):
        setting = metastable.Setting(slope_deg=9.59, friction=(0.3, 0.05))
        with self.assertRaises(KeyboardInterrupt):
            metastable.study(setting, tolerance=1e-6, progress=lambda share: signal.raise_signal(signal.SIGINT))
        metastable.study(setting, **quick)

    def test_ctrl_c_stops_within_a_simulation(self):
        wheel, walker = metastable.Setting(slope_deg=9.59), metastable.WalkerSetting("simplest", slope_sd_deg=0.1)
        for setting, options in ((wheel, dict(trials=1000000)), (wheel, dict(trials=100000, reality=True)),
                                 (walker, dict(trials=100000))):
            shares = []

            def stop(share):
                shares.append(share)
                signal.raise_signal(signal.SIGINT)

            with self.subTest(**options), self.assertRaises(KeyboardInterrupt):
                metastable.simulate(setting, progress=stop, **options)
            self.assertTrue(len(shares) == 1 and shares[0] < 0.5)

    def test_other_threads_run_meanwhile_and_may_study_too(self):
        setting = metastable.Setting(slope_deg=9.59, legs=[0.15] * 8)
        turns, found = 0, []
        threads = [threading.Thread(target=lambda: found.append(metastable.study(setting, seed=3)))
                   for _ in range(2)]
        for thread in threads:
            thread.start()
        while any(thread.is_alive() for thread in threads):
            time.sleep(0.001)
            turns += 1
        self.assertGreater(turns, 20)
        self.assertEqual(found[0], found[1])

    def test_progress_is_told_and_its_errors_stop(self):
        shares = []
        setting = metastable.Setting(slope_deg=9.59, legs=[0.15] * 8)
        metastable.study(setting, tolerance=0.002, progress=shares.append)
        self.assertTrue(shares and all(0 <= share <= 1 for share in shares))
        with self.assertRaises(ZeroDivisionError):
            metastable.study(setting, tolerance=1e-5, progress=lambda share: 1 / 0)
        with self.assertRaisesRegex(metastable.InputError, "progress: None, True, False or a function expected, not str"):
            metastable.study(metastable.Setting(), progress="loud")

    def test_a_line_on_a_terminal_and_a_bar_in_a_notebook(self):
        from metastable import _progress
        shown = []

        class Handle:
            def update(self, what):
                shown.append(what)

        notebook = types.ModuleType("IPython.display")
        notebook.HTML, notebook.display = str, lambda what, display_id: shown.append(what) or Handle()
        kernel = {"IPython": types.ModuleType("IPython"), "IPython.display": notebook,
                  "ipykernel": types.ModuleType("ipykernel")}
        for modules, written in (({}, None), (kernel, shown)):
            out = io.StringIO()
            with unittest.mock.patch.dict(sys.modules, modules), redirect_stderr(out), \
                    unittest.mock.patch("time.monotonic", side_effect=[0, 3, 4]):
                with _progress.telling(True, "study") as tell:
                    tell(0.5, "steps")
                    tell(0.75, "steps")
            words = " ".join(written) if written else out.getvalue()
            self.assertIn("study: steps  50 %, about 3 s left", words)
            self.assertTrue(written[-1] == "" if written else words.endswith("\r\033[K"))


    def test_the_time_left_is_told_only_while_the_share_moves(self):
        from metastable import _progress

        class Words(_progress._Shown):
            def draw(self, share, words):
                self.shown = words

        now = [0.0]
        with unittest.mock.patch("time.monotonic", lambda: now[0]):
            words = Words("study")
            for at, share, doing, shown in (
                    (30, 0, "steps", "study: steps"),  # nothing is known yet
                    (40, 0.4, "steps", "study: steps  40 %, about 60 s left"),
                    (43, 0.4, "steps", "study: steps  40 %, about 64 s left"),
                    (60, 0.4, "steps", "study: steps  40 %"),  # it stands still
                    (70, 0.35, "steps", "study: steps  35 %, about 2 min left"),  # more has turned up
                    (100, 0, "how it fails", "study: how it fails"),  # another part, with a time of its own
                    (110, 0.5, "how it fails", "study: how it fails  50 %, about 10 s left")):
                now[0] = at
                words(share, doing)
                self.assertEqual(words.shown, shown)
            now[0] = 130
            words.again()
            self.assertEqual(words.shown, "study: how it fails  50 %")


class Experiments(unittest.TestCase):
    def test_simulated_read_and_from_arrays_are_one(self):
        setting = metastable.Setting(slope_deg=9.59, restitution=(0.54, 0.045), friction=(0.352, 0.043))
        simulated = metastable.simulate(setting, trials=20, seed=4)
        with tempfile.TemporaryDirectory() as folder:
            simulated.write(Path(folder) / "trials")
            read = metastable.read_experiment(Path(folder) / "trials")
            with self.assertRaisesRegex(metastable.InputError, "already holds experiment.toml"):
                simulated.write(Path(folder) / "trials")
        columns = simulated.collisions
        measured = {name: columns[name] for name in columns if name != "condition"}
        arrays = metastable.experiment(setting, measured, {n: simulated.trials[n] for n in ("trial", "outcome")})
        for other in (read, arrays):
            self.assertEqual(other.collisions.to_dict(), columns.to_dict())
            self.assertEqual(other.trials.to_dict(), simulated.trials.to_dict())
        self.assertFalse(columns.omega_minus_rad_s.flags.owndata)
        self.assertEqual(read.to_dict()["collisions"], columns.to_dict())
        self.assertEqual(read._repr_html_().count("<tr>"), 21)  # a head and the trials

    def test_ids_of_conditions_may_be_numbers(self):
        settings = {1: metastable.Setting(), 2: metastable.Setting(slope_deg=9.59)}
        speeds = dict(trial=[1, 1, 2, 2], collision=[1, 2, 1, 2], omega_minus_rad_s=[5.0, 5.1, 5.2, 5.3])
        for ids, conditions in ((settings, [1, 1, 2, 2]), (settings, np.array([1, 1, 2, 2])),
                                ({np.int64(1): settings[1], 2.0: settings[2]}, np.array([1.0, 1, 2, 2])),
                                ({"1": settings[1], 2: settings[2]}, ["1", "1", "2", "2"])):
            read = metastable.experiment(ids, {**speeds, "condition": conditions},
                                         dict(trial=[1, 2], condition=conditions[1:3], outcome=["rest", "rest"]))
            self.assertEqual(read.conditions, ("1", "2"))
            self.assertEqual(read.collisions.condition.tolist(), [0, 0, 1, 1])
        with self.assertRaisesRegex(metastable.InputError, "1"):
            metastable.experiment({1: settings[1], "1": settings[2]}, {**speeds, "condition": [1, 1, 1, 1]})
        with self.assertRaisesRegex(metastable.InputError, "settings: ids of conditions are texts or numbers, not tuple"):
            metastable.experiment({(1, 2): settings[1]}, speeds)

    def test_defects_have_their_places(self):
        wrong = dict(trial=[1, 1, 1], collision=[1, 2, 4], omega_minus_rad_s=[5.0, -1, 5])
        with self.assertRaises(metastable.InputError) as raised:
            metastable.experiment(metastable.Setting(), wrong)
        self.assertEqual(len(raised.exception.lines), 2)
        self.assertIn("arrays/collisions.csv:3:", raised.exception.lines[0])
        with self.assertRaisesRegex(metastable.InputError, "column leg has 2 values where the first has 3"):
            metastable.experiment(metastable.Setting(), {**wrong, "leg": [0, 1]})
        with self.assertRaisesRegex(metastable.InputError, "nowhere"):
            metastable.diagnose("nowhere")

    def test_description_tells_tables(self):
        trials = metastable.simulate(metastable.Setting(law="plastic"), trials=12)  # which has no contact to fit
        description = metastable.describe(trials)
        conditions = description.tables["conditions"]
        self.assertEqual([row["trials"] for row in conditions], [12])
        self.assertEqual(description.to_dict()["tables"]["conditions"]["title"], conditions.title)
        self.assertIn("<td>12</td>", conditions._repr_html_())
        self.assertIn("<table", description._repr_html_())

    def test_effects_are_the_catalogue(self):
        self.assertIn("leg_contact", [effect.id for effect in metastable.effects()])


if __name__ == "__main__":
    unittest.main()
