"""A machine of one's own: against direct simulation that shares nothing with the toolkit but the step."""

import unittest

import numpy as np

import cart_pole
import metastable


def line(step, **more):
    return metastable.walker(step, 1, 1, start=[0], names=["x [m]"], name="a line", **more)


def drift(state, noise):
    following = 0.6 * state + noise
    return following, np.abs(following[:, 0]) > 3


class CartPole(unittest.TestCase):
    def test_direct_simulation_confirms_the_interval(self):
        study = cart_pole.pole.study(spacing=1.0, simulated_steps=0, how_it_fails=True, seed=3)
        rng = np.random.default_rng(11)
        steps, alive, state = np.zeros(4000), np.arange(4000), np.zeros((4000, 2))
        while alive.size:
            state, failed = cart_pole.step(state, rng.standard_normal((alive.size, 1)))
            steps[alive] += 1
            alive, state = alive[~failed], state[~failed]
        mean, error = steps.mean(), steps.std(ddof=1) / np.sqrt(steps.size)
        low, high = study.expected_steps.interval_95
        self.assertLess(high / low, 1.2)
        # Both 95 % intervals, widened to 99.9 %.
        self.assertLess(abs(np.log(study.expected_steps.value / mean)),
                        1.7 * np.hypot(np.log(high / low) / 2, 1.96 * error / mean))
        self.assertGreater(study.how_it_fails.last_steps[0].bound_to_fail, study.how_it_fails.regime.bound_to_fail)
        # Survival is that of one mesh, without extrapolation.
        np.testing.assert_allclose(study.survival[:40], [(steps > n).mean() for n in range(40)], atol=0.05)


class Steps(unittest.TestCase):
    def test_are_told_the_same_on_any_number_of_threads(self):
        one, two = (line(drift).study(spacing=0.4, simulated_steps=20000, threads=threads) for threads in (1, 2))
        told = [{**study.to_dict(), "memory_bytes": None} for study in (one, two)]  # of which two threads take twice
        self.assertEqual(*told)
        self.assertEqual(one.status, "agreed")
        simulated = line(drift).simulate(trials=2000, seed=5)
        self.assertEqual(len(simulated.steps), 2000)
        self.assertLess(abs(simulated.mean - one.expected_steps.value), 4 * simulated.standard_error + 0.01)

    def test_take_a_whole_number_of_seconds_as_their_limit(self):
        limited = line(drift).study(spacing=0.8, simulated_steps=0, time_limit=600)
        self.assertEqual(limited.survival[1], line(drift).study(spacing=0.8, simulated_steps=0).survival[1])
        for limit in (np.float64(1e-9), 1e-9):
            with self.assertRaisesRegex(metastable.ComputationError, "the time limit of 1e-09 s is reached"):
                line(drift).study(time_limit=limit)

    def test_run_in_the_thread_that_called_and_may_keep_what_they_get(self):
        import threading
        kept, threads = [], set()

        def keep(state, noise):
            kept.append((state, state.copy()))
            threads.add(threading.get_ident())
            return drift(state, noise)

        line(keep).simulate(trials=50, threads=2)
        self.assertEqual(threads, {threading.get_ident()})
        self.assertTrue(all(np.array_equal(*both) for both in kept))

    def test_of_several_phases_are_told_which(self):
        def alternate(state, noise, phase):
            following = (0.3 if phase else 0.9) * state + noise
            return following, np.abs(following[:, 0]) > 3

        study = line(alternate, phases=2).study(spacing=0.4, simulated_steps=40000, how_it_fails=True)
        self.assertEqual(study.status, "agreed")
        self.assertEqual(len(study.how_it_fails.by_phase), 2)

    def test_that_break_their_promises_are_named(self):
        fine = np.zeros((1, 1)), np.zeros(1, bool)
        for step, kind, sentence in (
            (lambda s, z: (np.full_like(s, np.nan), fine[1].repeat(len(s))), metastable.MapError,
             r"from the state x \[m\] = 0 \(phase 0\) it leads to x \[m\] = nan, which is not finite"),
            (lambda s, z: s, metastable.InputError, r"step: \(next states, failed\) is to be returned, not ndarray"),
            (lambda s, z: (s[:, :0], fine[1].repeat(len(s))), ValueError,
             r"step: next states of shape \(\d+, 0\), \(\d+, 1\) expected"),
            (lambda s, z: (s, np.zeros((len(s), 1), bool)), ValueError, r"step: failed of shape \(\d+, 1\)"),
            (lambda s, z: (s * 1j, fine[1].repeat(len(s))), metastable.InputError, "of dtype complex128"),
            (lambda s, z: (s, np.zeros(len(s))), metastable.InputError, "no array of booleans, but of dtype float64"),
            (lambda s, z: (None, None), metastable.InputError, "no array of real numbers"),
            (lambda s, z: 1 / 0, ZeroDivisionError, "division by zero"),
            (lambda s, z: (2 * s + z, fine[1].repeat(len(s))), metastable.MapError, "unstable"),
        ):
            with self.subTest(sentence), self.assertRaisesRegex(kind, sentence):
                line(step).study(progress=False)
        with self.assertRaises(KeyboardInterrupt):
            line(self.interrupting).study()
        for fields, sentence in ((dict(dimension=31), r"dimension: 31 is outside 1\.\.30"),
                                 (dict(noise=0), r"noise: 0 is outside 1\.\.16"),
                                 (dict(start=[0, 0]), "a start of 1 numbers expected"),
                                 (dict(names=["a", "b"]), "one name for each dimension"),
                                 (dict(noise_names=["a", "b"]), "noise_names: 2 given")):
            with self.subTest(sentence), self.assertRaisesRegex(metastable.InputError, sentence):
                metastable.walker(**{**dict(step=drift, dimension=1, noise=1, start=[0]), **fields})
        with self.assertRaisesRegex(metastable.InputError, "step: a function expected, not int"):
            metastable.walker(3, 1, 1, start=[0])

    def test_failures_that_the_meshes_step_over_give_no_number(self):
        def band(state, noise):  # simulation says 11.8 steps, the meshes 4.9e6
            following = 0.5 * state + noise
            return following, (np.abs(following[:, 0]) > 6) | ((noise[:, 0] > 0.9) & (noise[:, 0] < 1.3))

        with self.assertRaisesRegex(metastable.Contradiction, r"a line: the mesh \(4\.92.* walks failed within \d+ steps, "
                                    "where the mesh foretells .*disagree: no number is given"):
            line(band).study(simulated_steps=100000)

    def test_may_have_angles_and_gaits_of_two_steps(self):
        def turned(state, noise):  # the angles +1 and -1 about pi follow each other; it fails beyond two of them
            beside = np.remainder(state - np.pi + np.pi, 2 * np.pi) - np.pi
            following = 0.2 * beside ** 3 - 1.2 * beside + 0.4 * noise
            wrapped = np.remainder(following + 2 * np.pi, 2 * np.pi) - np.pi
            return wrapped, np.abs(following[:, 0]) > 2

        walker = metastable.walker(turned, 1, 1, start=[np.pi], names=["angle [rad]"], angles=["angle [rad]"])
        study = walker.study(simulated_steps=0, how_it_fails=True)
        self.assertEqual(study.gait.period, 2)
        self.assertLess(abs(study.expected_steps.value / 233.763 - 1), 0.003)  # of the same map about 0, by quadrature
        for angles, sentence in ((["x"], "angles: 'x' is none of the names angle"), ([1], r"angles: 1 is outside 0\.\.0")):
            with self.assertRaisesRegex(metastable.InputError, sentence):
                metastable.walker(turned, 1, 1, start=[np.pi], names=["angle [rad]"], angles=angles)
        for angles, sentence in ((5, "names or places in a list expected, not 5"), ([0.5], "a name or a whole number")):
            with self.assertRaisesRegex(metastable.InputError, "angles: " + sentence):
                metastable.walker(turned, 1, 1, start=[np.pi], angles=angles)

    def test_of_six_dimensions_are_split(self):
        kept = np.linspace(0.3, 0.8, 6)

        def six(state, noise):  # 1140.3 steps: the product of the survivals of six lines, by Nystrom's method
            following = kept * state + np.sqrt(1 - kept ** 2) * noise
            return following, (following > 3.6).any(axis=1)

        walker = metastable.walker(six, 6, 6, start=[0] * 6)
        with self.assertRaisesRegex(metastable.InputError, "6 dimensions, where meshes hold 1 to 4; method splitting"):
            walker.study()
        for method in ("splitting", "auto"):
            study = walker.study(method=method, tolerance=0.3, how_it_fails=True)
            last = study.how_it_fails.last_steps[0]
            self.assertIsNone(last.bound_to_fail)
            self.assertGreater(last.state["x6"].middle_90[1], 2.2)  # 1.6 in the regime
            low, high = study.expected_steps.interval_95
            self.assertLess(abs(np.log(study.expected_steps.value / 1140.3)), np.log(high / low))
            self.assertEqual(study.status, "rounds_agree")
            self.assertEqual(study.survival[0], 1)
            low, high = study.survival_interval_95.T
            self.assertTrue((np.isnan(low) | (low <= study.survival) & (study.survival <= high)).all())
            self.assertTrue(0 < low[-1] < high[-1] < 1)
            after = study.survival_after[1]
            self.assertEqual(after.steps, 1000)
            self.assertTrue(after.interval_95[0] < after.share < after.interval_95[1])
            low, high = last.state["x6"].median_interval_95
            self.assertTrue(low <= last.state["x6"].median <= high)
        self.assertIn("meshes hold 1 to 4", study.no_mesh)
        with self.assertRaisesRegex(metastable.InputError, "spacing: has no meaning under method splitting"):
            walker.study(method="splitting", spacing=1)

    def test_a_level_of_ones_own_is_split_by(self):
        def line(state, noise):
            following = 0.5 * state + noise
            return following, following[:, 0] > 3.5

        walker = metastable.walker(line, 1, 1, start=[0])
        learnt = walker.study(method="splitting", tolerance=0.2).expected_steps
        own = walker.study(method="splitting", tolerance=0.2, level=lambda state: state[:, 0]).expected_steps
        low, high = own.interval_95
        self.assertLess(abs(np.log(own.value / learnt.value)), 2 * np.log(high / low))
        by_mesh = walker.study(method="splitting", tolerance=0.2, level="mesh")
        self.assertEqual(by_mesh.split_by, "mesh")
        self.assertLess(abs(np.log(by_mesh.expected_steps.value / learnt.value)), 2 * np.log(high / low))
        self.assertIn("of a mesh of", str(by_mesh))
        self.assertEqual(walker.study(method="auto", tolerance=0.2, simulated_steps=0).splitting.split_by, "learnt")
        for level, kind, sentence in (
                (lambda state: state, ValueError, r"level: \d+ numbers, one for each state, expected, and shape"),
                (lambda state: "far", metastable.InputError, "level: numbers are to be returned, not str"),
                (lambda state: np.where(state[:, 0] > 0, np.nan, 0), metastable.MapError, "level function: it is nan"),
                ("far", metastable.InputError, "level: 'far' is none of learnt, mesh"),
                (3, metastable.InputError, 'level: "learnt", "mesh" or a function expected, not int')):
            with self.subTest(sentence), self.assertRaisesRegex(kind, sentence):
                walker.study(method="splitting", tolerance=0.2, level=level)
        with self.assertRaisesRegex(metastable.InputError, 'level: has no meaning with method "mesh"'):
            walker.study(level=lambda state: state[:, 0])
        with self.assertRaisesRegex(metastable.InputError, "level: has no meaning under this setting"):
            metastable.study(metastable.WalkerSetting("simplest", slope_sd_deg=0.05), level=abs)
        with self.assertRaisesRegex(metastable.InputError, "level: has no meaning under this setting"):
            metastable.study(metastable.Setting(), level="mesh")
        with self.assertRaisesRegex(metastable.InputError, "level: has a meaning under method splitting and auto only"):
            walker.study(level="mesh")

    def test_a_mesh_stands_alone_where_splitting_has_no_number(self):
        def two_gaits(state, noise):
            following = np.tanh(3 * state) + 0.3 * noise
            return following, following[:, 0] < -1.9

        walker = metastable.walker(two_gaits, 1, 1, start=[-1])
        with self.assertRaisesRegex(metastable.Contradiction, "are in another gait, at"):
            walker.study(method="splitting", tolerance=0.3)
        study = walker.study(method="auto", tolerance=0.3)
        self.assertLess(abs(np.log(study.expected_steps.value / 1767.8)), 0.01)
        self.assertIn("are in another gait, at", study.splitting["no_number"])
        self.assertIn("Beside it, no number: ", str(study))

    def test_a_biped_is_walked_without_a_mesh(self):
        biped = metastable.WalkerSetting("biped", slope_sd_deg=3)
        with self.assertRaisesRegex(metastable.InputError, "the biped has 9 dimensions, where meshes hold 1 to 4"):
            metastable.study(biped)
        walks = metastable.simulate(biped, trials=40, seed=2)
        self.assertIn("swing shank rate [rad/s]", list(walks))
        self.assertTrue(walks.fell.all())
        with self.assertRaisesRegex(metastable.InputError, "'biped' is none of simplest, compass"):
            biped.machine(sensor={})

    def test_slips_to_another_gait_count(self):
        def gaits(state, noise):  # 7.207e5 steps by elimination of fine cells
            following = np.tanh(3 * state) + 0.2 * noise
            return following, following[:, 0] < -1.9

        study = metastable.walker(gaits, 1, 1, start=[-1]).study(simulated_steps=20000)
        self.assertLess(abs(study.expected_steps.value / 7.207e5 - 1), 0.005)
        self.assertEqual(study.status, "mesh_alone")
        self.assertAlmostEqual(study.other_gaits[0].share_of_steps, 0.5, delta=0.01)
        self.assertLess(study.other_gaits[0].share_of_failures, 0.01)
        self.assertIn("of the failures", str(study))

    def test_orbits_of_several_steps_are_one_gait_and_there_may_be_none(self):
        for r, sd, period, exact in ((3.5, 0.04, 4, 4226.0), (3.8, 0.02, 0, 1602.45)):  # by Nystrom's method
            def logistic(state, noise):
                following = r * state * (1 - state) + sd * noise
                return following, (following[:, 0] <= 0) | (following[:, 0] >= 1)

            study = metastable.walker(logistic, 1, 1, start=[0.5]).study(simulated_steps=20000, how_it_fails=True)
            self.assertLess(abs(study.expected_steps.value / exact - 1), 0.003)
            self.assertEqual(study.gait.period, period)
            self.assertEqual(len(study.other_gaits), 0)
            self.assertAlmostEqual(sum(study.how_it_fails.by_phase), 1, 6)
            self.assertEqual(len(study.how_it_fails.by_phase), max(period, 1))
        self.assertIsNone(study.gait.state)
        self.assertIsNone(study.gait.fails_without_noise_after)
        self.assertIn("none: without noise it comes to no orbit", str(study))

    def test_what_was_not_asked_for_is_called_so(self):
        study = line(drift).study(spacing=0.4, simulated_steps=0)
        self.assertEqual(study.no_direct_simulation, "not asked for")
        self.assertIn("not asked for", str(study))

    def test_answers_tell_the_orbit_its_eigenvalues_and_the_regime(self):
        def spiral(state, noise):  # about (2, 1) at phase 0, eigenvalues 0.6 e^(+-i pi / 3) a step
            turn = 0.6 * np.array([[0.5, -np.sqrt(0.75)], [np.sqrt(0.75), 0.5]])
            following = (state - [2, 1]) @ turn.T + [2, 1] + noise
            return following, following[:, 0] > 4.5

        study = metastable.walker(spiral, 2, 2, start=[2, 1], names=["x", "y"]).study(spacing=1, simulated_steps=0)
        self.assertEqual(study.gait.names, ("x", "y"))
        np.testing.assert_allclose(study.gait.state, [2, 1], atol=1e-9)
        values = [complex(*value) for value in study.gait.eigenvalues]
        np.testing.assert_allclose(values, 0.6 * np.exp([1j * np.pi / 3, -1j * np.pi / 3]), atol=1e-7)
        regime = study.expected_steps
        self.assertAlmostEqual(regime.from_quasi_stationary * study.failure_rate_per_step.value, 1, 12)
        low, high = regime.from_quasi_stationary_interval_95
        self.assertLess(low, regime.from_quasi_stationary)
        self.assertLess(regime.from_quasi_stationary, high)
        for words in ("from the metastable regime", "gait: x", "gait: eigenvalues", "0.3000 ± 0.5196 i"):
            self.assertIn(words, str(study))

        def alternate(state, noise, phase):
            following = (0.3 if phase else 0.9) * state + 1 + noise
            return following, following[:, 0] > 6

        study = metastable.walker(alternate, 1, 1, start=[0], phases=2).study(spacing=0.4, simulated_steps=0)
        first = 1.3 / 0.73
        np.testing.assert_allclose([s[0] for s in study.gait.state_by_phase], [first, 0.9 * first + 1], atol=1e-9)
        self.assertAlmostEqual(study.gait.eigenvalues[0][0], 0.27, 7)

    def test_are_asked_for_in_few_calls_of_many_rows(self):
        # In calls of a thousand rows at least, but for stragglers and searches whose next row hangs on the last one.
        def calls(threads, **options):
            rows = []

            def step(state, noise):
                rows.append(len(state))
                following = state / 2 + noise
                return following, following[:, 0] > 3

            study = line(step).study(threads=threads, progress=False, **options)
            return rows, study.to_dict()

        options = dict(simulated_steps=0, how_it_fails=True)
        (one, told), (two, again) = calls(1, **options), calls(2, **options)
        self.assertEqual(one, two)  # call by call: a step's last bits may hang on how many rows it gets
        self.assertEqual(told, again)
        self.assertGreater(sum(one) / len(one), 1000)
        self.assertGreater(sum(n for n in one if n >= 1000) / sum(one), 0.9)
        simulated, _ = calls(2, simulated_steps=400000, guided_samples=0)
        self.assertLess(len(simulated), len(one) + 4000)

    def test_that_fail_by_the_state_before_them_are_resolved(self):
        # Against elimination on fine cells: x' = x / 2 + z, and the step from x > 2.5 fails.
        h, half = 0.01, 6.0
        x = np.arange(-half + h / 2, half, h)
        rows = np.exp(-0.5 * (x[None, :] - x[:, None] / 2) ** 2)
        rows /= rows.sum(axis=1, keepdims=True)
        for fails, of_new in ((x > 2.5, False), (np.abs(x) > 2.2, False), (x > 2.5, True)):
            kept = rows * (~fails)[None, :] if of_new else rows * (~fails)[:, None]
            expected = np.linalg.solve(np.eye(len(x)) - kept, np.ones(len(x)))
            start = np.interp(0.0, x, expected)
            two_sided = fails[0]

            def step(state, noise):
                following = state / 2 + noise
                told = following if of_new else state
                return following, np.abs(told[:, 0]) > 2.2 if two_sided else told[:, 0] > 2.5

            study = line(step).study(simulated_steps=0, guided_samples=0)
            low, high = study.expected_steps.interval_95
            with self.subTest(of_new=of_new, two_sided=two_sided):
                self.assertLess(high / low, 1.1)
                self.assertLess(abs(np.log(study.expected_steps.value / start)), 1.7 * np.log(high / low) / 2 + 0.005)

    @staticmethod
    def interrupting(state, noise):
        raise KeyboardInterrupt

    def test_contradicting_ways_give_no_number(self):
        # Failure hangs on hidden memory: what meshes see, a map of the state alone, is not what walks do.
        calls = [0]

        def moody(state, noise):
            calls[0] += 1
            following, failed = drift(state, noise)
            return following, failed | (np.abs(noise[:, 0]) > (1.0 if calls[0] > self.mood else 9.0))

        counted = line(moody)
        self.mood = float("inf")
        counted.study(spacing=0.4, simulated_steps=0, threads=1)
        self.mood, calls[0] = calls[0], 0  # as many calls as the meshes need
        with self.assertRaisesRegex(metastable.Contradiction, "a line: .* disagree: no number is given"):
            counted.study(spacing=0.4, simulated_steps=20000, threads=1)

    def test_of_the_librarys_walkers_are_those_of_their_walks(self):
        walks = metastable.simulate(metastable.WalkerSetting("simplest", slope_sd_deg=0.17), trials=200, seed=2)
        self.assertEqual(walks.steps.sum(), len(walks))
        self.assertTrue(walks.fell.all())


if __name__ == "__main__":
    unittest.main()
