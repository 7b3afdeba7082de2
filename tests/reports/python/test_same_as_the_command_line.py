"""The same seed gives the same numbers as the command line, to the bit."""

import pathlib
import tempfile
import unittest

import metastable
from support import command_line, data, told


class SameAsTheCommandLine(unittest.TestCase):
    def test_study(self):
        setting = metastable.Setting(slope_deg=9.59, restitution=(0.35, 0.1), friction=(0.3, 0.05), legs=[0.15] * 8)
        study = metastable.study(setting, seed=7, cells=24, samples=256, replicates=3, how_it_fails=True, threads=1,
                                 standard_errors={"friction_mean": 0.01})
        self.assertEqual(told(study.to_dict()),
                         command_line("steps", "--slope", "9.59", "--restitution", "0.35,0.1", "--friction",
                                      "0.3,0.05", "--legs", "0.15", "--seed", "7", "--cells", "24", "--samples", "256",
                                      "--replicates", "3", "--how-it-fails", "--friction-se", "0.01,0"))

    def test_integrated_under_another_law(self):
        setting = metastable.Setting(slope_deg=5, initial_speed=(6, 0.3), law="coulomb", legs=[0.15] * 8)
        study = metastable.study(setting, method="integrated")
        self.assertEqual(told(study.to_dict()),
                         command_line("steps", "--slope", "5", "--initial-speed", "6,0.3", "--law", "coulomb", "--legs",
                                      "0.15", "--method", "integrated"))

    def test_compare(self):
        settings = [metastable.Setting(slope_deg=slope) for slope in (7.02, 9.59)]
        self.assertEqual(told(metastable.compare(settings, cells=24, samples=256).to_dict()),
                         command_line("compare", "--cells", "24", "--samples", "256"))

    def test_compare_by_values(self):
        several = metastable.compare(slope_deg=9.59, law=["published", "coulomb"], friction_mean=[0.4, 0.6], cells=24,
                                     samples=256)
        self.assertEqual(told(several.to_dict()),
                         command_line("compare", "--slope", "9.59", "--law", "published,coulomb", "--friction-mean",
                                      "0.4,0.6", "--cells", "24", "--samples", "256"))
        self.assertEqual([one.label for one in several.settings][:2], ["law published, mu 0.4", "law published, mu 0.6"])
        launches = metastable.compare(slope_deg=[6, 7], initial_speed=[(5, 0.1), (6, 0.1)], legs=[0.15] * 8, cells=24,
                                      samples=256)
        self.assertEqual([one.label for one in launches.settings], ["6 deg, omega_0 5", "7 deg, omega_0 6"])
        for wrong, said in ((dict(friction_men=[1, 2]), "friction_men: is neither"), (dict(mass=[]), "mass: holds no value"),
                            (dict(mass=[1, -1]), "mass"), (dict(mass=2), "two or more")):
            with self.assertRaisesRegex(metastable.InputError, said):
                metastable.compare(**wrong)
        with self.assertRaisesRegex(metastable.InputError, "mass: varies one setting"):
            metastable.compare([metastable.Setting()] * 2, mass=[1, 2])

    def test_walker(self):
        setting = metastable.WalkerSetting("simplest", slope_sd_deg=0.5)
        study = metastable.study(setting, spacing=1.2, simulated_steps=20000, how_it_fails=True)
        self.assertEqual(told(study.to_dict()),
                         command_line("steps", "--walker", "simplest", "--slope-sd", "0.5", "--spacing", "1.2",
                                      "--simulated-steps", "20000", "--how-it-fails"))

    def test_simulate_and_describe(self):
        setting = metastable.Setting(slope_deg=9.59, law="coulomb", friction=(0.35, 0.04))
        words = ("--slope", "9.59", "--law", "coulomb", "--friction", "0.35,0.04", "--trials", "8", "--seed", "6")
        for options, more in ((dict(), ()), (dict(reality=True, sensor_noise=0.01), ("--reality", "--sensor-noise", "0.01"))):
            with self.subTest(**options), tempfile.TemporaryDirectory() as folder:
                ours, theirs = pathlib.Path(folder) / "ours", pathlib.Path(folder) / "theirs"
                metastable.simulate(setting, trials=8, seed=6, **options).write(ours)
                command_line("simulate", *words, *more, "--out", str(theirs))
                for name in ("collisions.csv", "trials.csv"):
                    self.assertEqual((ours / name).read_bytes(), (theirs / name).read_bytes())
        with tempfile.TemporaryDirectory() as folder:
            plain = pathlib.Path(folder) / "plain"
            metastable.simulate(metastable.Setting(law="plastic"), trials=12).write(plain)  # no contact to fit
            self.assertEqual(metastable.describe(plain).to_dict()["tables"], command_line("describe", str(plain))["tables"])

    def test_solve(self):
        setting = metastable.Setting(legs=[0.15] * 8)
        small = dict(points=3, cells=24, samples=256, replicates=3)
        words = ("--legs", "0.15", "--points", "3", "--cells", "24", "--samples", "256", "--replicates", "3")
        for parameter, name, wanted, option in (
                ("friction_mean", "friction-mean", dict(steps=10), ("--steps", "10")),
                ("slope_deg", "slope", dict(survive=(3, 0.5), start=6, stop=9),
                 ("--survive", "3:0.5", "--from", "6", "--to", "9"))):
            with self.subTest(parameter):
                solution = metastable.solve(setting, parameter, **wanted, **small)
                self.assertEqual(told(solution.to_dict()), command_line("solve", name, *option, *words))
                self.assertTrue(solution.solutions, solution)

    def test_launch_where_the_paper_has_none(self):
        setting = metastable.Setting(slope_deg=8, legs=[0.15] * 8)
        self.assertIsNone(setting.launch)
        self.assertEqual(metastable.Setting(initial_speed="steady").launch, None)
        study = metastable.study(setting, cells=24, samples=256)
        self.assertTrue(study.launch.steady)
        self.assertEqual(told(study.to_dict()),
                         command_line("steps", "--slope", "8", "--legs", "0.15", "--cells", "24", "--samples", "256"))

    def test_rigid_bodies_where_no_law_is_named(self):
        rubber = metastable.Setting(slope_deg=9.59, friction=(0.6, 0.1), legs=[0.15] * 8)
        small = dict(cells=24, samples=256)
        self.assertEqual(metastable.study(rubber, **small).rigid_bodies.verdict, "differs")
        self.assertIsNone(metastable.study(rubber.replace(law="published"), **small).rigid_bodies)
        swept = metastable.sweep(rubber, friction_mean=[0.4, 0.6], **small)
        self.assertIn("disagree in direction", swept.rigid_bodies)
        self.assertGreater(swept.rigid_bodies_steps_low95[1], 100)
        named = metastable.sweep(rubber.replace(law="published"), friction_mean=[0.4, 0.6], **small)
        self.assertIsNone(named.rigid_bodies)
        self.assertNotIn("rigid_bodies_steps", named.keys())

    def test_sweep(self):
        with tempfile.TemporaryDirectory() as folder:
            theirs = command_line("sweep", "--slope", "9.59", "--friction-mean", "0.35,0.45", "--cells", "24", "--samples",
                                  "256", "--out", f"{folder}/sweep.csv")["tables"]["sweep"]["rows"]
        ours = metastable.sweep(metastable.Setting(slope_deg=9.59), friction_mean=[0.35, 0.45], cells=24, samples=256)
        self.assertEqual(ours.expected_steps.tolist(), [row[1] for row in theirs])

    def test_diagnose(self):
        catalogue = ["slope_offset"]
        self.assertEqual(told(metastable.diagnose(data, catalogue=catalogue).to_dict()),
                         command_line("diagnose", str(data), "--catalogue", ",".join(catalogue)))

    def test_blind(self):
        size = dict(per_effect=0, none=1, pairs=0, outside=1, left_out=0)
        with tempfile.TemporaryDirectory() as folder:
            ours, theirs = pathlib.Path(folder) / "ours", pathlib.Path(folder) / "theirs"
            made = metastable.blind.make(ours, seed=5, **size)
            words = [f"--{name.replace('_', '-')}={number}" for name, number in size.items()]
            command_line("blind", "make", str(theirs), "--seed=5", *words)
            self.assertEqual(made.to_dict(), {"cases": 2, "sealed": f"{ours}-sealed"})
            self.assertIn("<td>2</td>", made._repr_html_())
            self.assertEqual(bytes_below(ours), bytes_below(theirs))
            self.assertEqual(bytes_below(made.sealed), bytes_below(f"{theirs}-sealed"))
            tool = pathlib.Path(folder) / "tool"  # answers at once, and each case with what it holds
            tool.write_text(f'#!/bin/sh\ntest "$1" = diagnose || exit 9\ncat "$2/seal.txt" > "$4.seal"; cp "{folder}/answer.json" "$4"\n')
            tool.chmod(0o755)
            slope = metastable.diagnose(data, catalogue="slope_offset")
            (pathlib.Path(folder) / "answer.json").write_text(slope._json)
            answered = metastable.blind.answer(ours, tool=tool)
            self.assertEqual(repr(answered), "<metastable.blind.Answered: 2 of 2 cases, 0 failed>")
            command_line("blind", "answer", str(theirs), "--tool", str(tool))
            mine, other = bytes_below(ours), bytes_below(theirs)
            self.assertTrue(mine.pop("answers/record.csv") and other.pop("answers/record.csv"))  # it has times
            self.assertEqual(mine, other)
            grades = metastable.blind.open(ours)
            self.assertEqual(grades.to_dict()["tables"], command_line("blind", "open", str(theirs))["tables"])
            self.assertIn("<table", grades._repr_html_())
            self.assertTrue((ours / "report" / "index.html").is_file())
            with self.assertRaisesRegex(metastable.InputError, "was opened"):
                metastable.blind.answer(ours, tool=tool)


def bytes_below(folder):
    """The files in a folder, by their paths in it."""
    root = pathlib.Path(folder)
    return {str(file.relative_to(root)): file.read_bytes() for file in sorted(root.rglob("*")) if file.is_file()}


if __name__ == "__main__":
    unittest.main()
