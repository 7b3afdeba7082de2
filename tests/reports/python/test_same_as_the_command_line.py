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


if __name__ == "__main__":
    unittest.main()
