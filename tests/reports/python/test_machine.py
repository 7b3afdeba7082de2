"""A simulator of one's own with logs of the real machine: the gap, its cause, and what is refused."""

import os
import tempfile
import unittest

import numpy as np

import metastable


def step(state, noise, p):
    swing = state[:, 0]
    turned = swing * p["decay"] - p["loss_rad"] - p["per_rad"] * swing * swing + p["scatter_rad"] * noise[:, 0]
    return turned[:, None], np.zeros(len(state), bool)


def pendulum(step=step, **changes):
    stated = dict(states=["swing_rad"], noise=1, name="a pendulum",
                  parameters={"decay": (0.975, 0.01), "scatter_rad": (0.003, 0.003, 1e-5, 0.1)},
                  effects={"dry_friction": {"loss_rad": (0, 0, 0.05)}, "quadratic_drag": {"per_rad": (0, 0, 0.5)}},
                  may_vary=["decay"], sensor={"swing_rad": (0.0005, 0)})
    return metastable.machine(step, **{**stated, **changes})


def swung(loss=0.0, drag=0.0, decay=0.975, trials=40, swings=24, seed=3):
    rng = np.random.default_rng(seed)
    trial, swing = [], []
    for t in range(trials):
        now = 0.8 + 0.05 * rng.normal()
        for _ in range(swings):
            trial.append(t)
            swing.append(now + 0.0005 * rng.normal())
            now = now * decay - loss - drag * now * now + 0.003 * rng.normal()
    return dict(trial=np.array(trial), swing_rad=np.array(swing))


def diagnosed(machine=None, **done):
    machine = machine or pendulum()
    return metastable.diagnose(metastable.runs(machine, **swung(**done)), machine)


class Pendulum(unittest.TestCase):
    def test_a_machine_as_its_model_says_has_no_gap(self):
        self.assertIn(diagnosed().verdict, ("no_gap", "recalibrate"))

    def test_other_parameters_are_a_recalibration(self):
        answer = diagnosed(decay=0.965)
        self.assertEqual(answer.verdict, "recalibrate")
        low, high = answer.contact.interval_90["decay"]
        self.assertTrue(low < 0.965 < high)

    def test_readings_that_are_off_one_by_one_leave_the_parameters_as_they_are_stated(self):
        data = swung()
        data["swing_rad"][7::61] += 0.02 * (-1.0) ** np.arange(16)
        machine = pendulum(most_wild=0.05)
        answer = metastable.diagnose(metastable.runs(machine, data), machine)
        self.assertEqual(answer.verdict, "recalibrate")
        self.assertRegex(answer.sentences[1], r"^Nothing but the share of wild rows, 0\.0[12]\d*, differs from the model as given")

    def test_a_parameter_that_is_stated_too_surely_is_said_with_its_sds(self):
        answer = diagnosed(pendulum(parameters={"decay": (0.99, 0.001), "scatter_rad": (0.003, 0.003, 1e-5, 0.1)}))
        self.assertEqual(answer.verdict, "recalibrate")
        self.assertRegex(answer.sentences[1], r"^decay is 0\.97\d* \(90 %: .* to .*\), 1\d of its stated sds from 0\.99: known "
                                              "less well than stated")

    def test_units_are_those_stated_or_else_those_of_the_names(self):
        answer = diagnosed(pendulum(units={"loss_rad": "turns"}), loss=0.004, trials=12)
        units = {row["effect"]: row["unit"] for row in answer.visibility}
        self.assertEqual((units["dry_friction"], units["quadratic_drag"]), ("turns", "1/rad"))

    def test_dry_friction_is_named_with_its_size(self):
        answer = diagnosed(loss=0.004)
        self.assertEqual(answer.verdict, "explained")
        self.assertEqual(answer.at_work[0].effects, ("dry_friction",))
        low, high = answer.at_work[0].interval_90.loss_rad  # two of its 90 % widths hold 0.004 in 99.9 % of experiments
        self.assertLess(abs(answer.at_work[0].parameters.loss_rad - 0.004), high - low)
        self.assertLess(high - low, 0.003)
        self.assertGreater(answer.at_work[0].closes.alone, 0.9)

    def test_the_same_seed_gives_the_same_answer_on_any_number_of_threads(self):
        machine = pendulum()
        runs = metastable.runs(machine, **swung(drag=0.05, trials=20))
        one, two = (metastable.diagnose(runs, machine, threads=n) for n in (1, 2))
        self.assertEqual([cause.to_dict() for cause in one.causes], [cause.to_dict() for cause in two.causes])

    def test_few_trials_speak_of_phases_where_there_are_any(self):
        machine, data = pendulum(), swung(trials=5, swings=9)
        statements = {}
        for phases in (1, 3):
            runs = metastable.runs(machine, phase=[f"p{k % phases}" for k in range(45)], **data)
            answer = metastable.diagnose(runs, machine, catalogue="dry_friction")
            statements[phases] = [one.statement for one in answer.not_possible]
            self.assertNotRegex(" ".join(answer.sentences), r"\bleg\b")
        self.assertIn("which phase the gap lies in", statements[3])
        self.assertNotIn("which phase the gap lies in", statements[1])

    def test_columns_come_from_anything_that_has_them(self):
        machine = pendulum(inputs=["temperature"])
        data = dict(swung(trials=10), temperature=np.full(240, 20.0))
        self.assertEqual(repr(metastable.runs(machine, data)), "<metastable.Runs: 10 trials, 240 rows>")


def spinner(angles, wraps):
    def step(state, noise, p):
        angle = state[:, 0]
        angle = angle + p["advance"] + p["pull"] * np.sin(2 * angle) + p["scatter"] * noise[:, 0]
        return (angle % (2 * np.pi) if wraps else angle)[:, None], np.zeros(len(state), bool)
    return metastable.machine(step, states=["angle_rad"], noise=1, effects={"pull": {"pull": (0, -0.5, 0.5)}},
                              parameters={"advance": (0.9, 0.05), "scatter": (0.1, 0.02, 0, 1)},
                              sensor={"angle_rad": 0.02}, angles=angles)


class Angles(unittest.TestCase):
    rng = np.random.default_rng(5)
    trial, angle = np.repeat(np.arange(20), 12), np.zeros(240)
    for row in range(240):
        before = angle[row - 1]
        angle[row] = 6 * rng.random() if row % 12 == 0 else before + 0.9 + 0.2 * np.sin(2 * before) + 0.1 * rng.normal()

    def test_that_wrap_get_the_answer_of_those_that_go_on(self):
        answers = [metastable.diagnose(metastable.runs(machine, trial=self.trial, angle_rad=angle), machine)
                   for machine, angle in [(spinner((), False), self.angle),
                                          (spinner("angle_rad", True), self.angle % (2 * np.pi) + 2 * np.pi * (self.trial % 3))]]
        for answer in answers:
            self.assertEqual((answer.verdict, answer.at_work[0].effects), ("explained", ("pull",)))
            low, high = answer.at_work[0].interval_90.pull
            self.assertLess(abs(answer.at_work[0].parameters.pull - 0.2), high - low)
        for ours, other in zip(*(answer.at_work[0].interval_90.pull for answer in answers)):
            self.assertAlmostEqual(ours, other, 4)

    def test_that_are_lost_for_a_while_are_refused(self):
        angle = self.angle.copy()
        angle[27:29] = np.nan
        with self.assertRaisesRegex(metastable.InputError, "^angles: angle_rad is missing in trial 2, row 4, and comes back"):
            metastable.runs(spinner("angle_rad", True), trial=self.trial, angle_rad=angle)
        with self.assertRaisesRegex(metastable.InputError, '^angles: "roll" is none of the states angle_rad'):
            spinner("roll", True)


class Failing(unittest.TestCase):
    def test_expected_steps_are_those_of_direct_simulation(self):
        def line(state, noise, p):
            following = p["keeps"] * state[:, 0] + noise[:, 0]
            return following[:, None], np.abs(following) > 3

        machine = metastable.machine(line, states=["x"], noise=1, parameters={"keeps": (0.6, 0.02)}, sensor={"x": 0.05})
        rng = np.random.default_rng(1)
        trial, x, outcome = [], [], []
        for t in range(60):
            state = np.zeros(1)
            for _ in range(30):
                trial.append(t)
                x.append(state[0] + 0.05 * rng.normal())
                following, failed = line(state[:, None], rng.standard_normal((1, 1)), dict(keeps=0.6))
                if failed[0]:
                    break
                state = following[:, 0]
            outcome.append("failed" if failed[0] else "stopped")
        answer = metastable.diagnose(metastable.runs(machine, trial=trial, x=x, outcome=outcome), machine)
        steps, alive, state = np.zeros(4000), np.arange(4000), np.zeros((4000, 1))
        while alive.size:
            state, failed = line(state, rng.standard_normal((alive.size, 1)), dict(keeps=0.6))
            steps[alive] += 1
            alive, state = alive[~failed], state[~failed]
        self.assertIn(answer.verdict, ("no_gap", "recalibrate"))
        study = machine.walker(start=[0]).study(simulated_steps=0)
        self.assertEqual(study.expected_steps.from_start, study.expected_steps.value)
        with self.assertRaisesRegex(AttributeError, "'ExpectedSteps' object has no attribute 'mean'; it has value, interval_95"):
            study.expected_steps.mean
        self.assertLess(abs(np.log(study.expected_steps.value / steps.mean())), 0.1)
        self.check_walkers(machine)
        self.assertLess(abs(np.log(answer.steps_before_failure.baseline / steps.mean())), 0.1)
        low, high = answer.steps_before_failure.machine[0].interval_90
        self.assertTrue(low < steps.mean() < high)


    def check_walkers(self, machine):
        with self.assertRaisesRegex(metastable.InputError, "start: launch has no x"):
            metastable.study(machine)
        with self.assertRaisesRegex(metastable.InputError, "\"kept\" is none of keeps"):
            machine.walker(start=[0], kept=0.5)
        self.assertGreater(machine.walker(start=[0], keeps=0.4).study(simulated_steps=0).expected_steps.value,
                           machine.walker(start=[0]).study(simulated_steps=0).expected_steps.value)


class Refused(unittest.TestCase):
    def check(self, sentence, make, error=metastable.InputError):
        with self.assertRaises(error) as caught:
            make()
        self.assertIn(sentence, str(caught.exception))
        self.assertNotIn("\n", str(caught.exception))

    def test_a_machine_that_is_none(self):
        self.check("states: 0 are outside 1 to 30", lambda: pendulum(states=[], sensor={}))
        self.check("\"swing\" is none of the states swing_rad", lambda: pendulum(sensor={"swing": 0.1}))
        self.check("decay: the nominal value 2 is outside its bounds [0, 1]", lambda: pendulum(parameters={"decay": (2, 0.1, 0, 1)}))
        self.check("may_vary: \"drag\" is none of the parameters", lambda: pendulum(may_vary=["drag"]))
        self.check("effects: dry: loss_rad: 2 numbers given, 3 expected (neutral, lower, upper)", lambda: pendulum(effects={"dry": {"loss_rad": (0, 1)}}))
        self.check("correlation 0.7 between neighbouring rows is outside [-0.5, 0.5]", lambda: pendulum(sensor={"swing_rad": (0.1, 0.7)}))
        self.check("step: a function expected", lambda: pendulum(step=3))
        self.check("units: \"swing\" is none of swing_rad, decay, scatter_rad, loss_rad, per_rad", lambda: pendulum(units={"swing": "rad"}))
        self.check("units: swing_rad: a word expected, not int", lambda: pendulum(units={"swing_rad": 3}))

    def test_arguments_of_the_wrong_kind(self):
        for argument, given, sentence in (
                ("parameters", [1, 2], "parameters: a dict {name: (nominal, sd[, lower, upper])} expected, not list"),
                ("parameters", {1: 2}, "whose names are words, not int"),
                ("parameters", {"decay": "x"}, "parameters: decay: numbers (nominal, sd[, lower, upper]) expected, not str"),
                ("parameters", {"decay": (1,) * 5}, "parameters: decay: 5 numbers given, 1 to 4 expected (nominal, sd[, lower, upper])"),
                ("parameters", {"decay": 10**400}, "parameters: decay: a number is too large for double precision"),
                ("states", 3, "states: a name or a list of names expected, not int"),
                ("states", {"swing_rad"}, "states: a name or a list of names expected, not set"),
                ("states", [1], "states: words expected, not int"),
                ("effects", "x", "effects: a dict {id: {name: (neutral, lower, upper)}} expected, not str"),
                ("effects", {"dry": 3}, "effects: dry: a dict {name: (neutral, lower, upper)} expected, not int"),
                ("effects", {"dry": ["loss_rad"]}, "effects: dry: a dict {name: (neutral, lower, upper)} expected, not list"),
                ("effects", {"dry": {"loss_rad": 3}}, "effects: dry: loss_rad: 1 number given, 3 expected (neutral, lower, upper)"),
                ("sensor", 5, "sensor: a dict {state: sd, or (sd, correlation), or None for an sd that is fitted} expected, not int"),
                ("sensor", {"swing_rad": "y"}, "sensor: swing_rad: a number (sd) or two (sd, correlation) expected, not str"),
                ("sensor", {"swing_rad": ()}, "sensor: swing_rad: 0 numbers given, 1 to 2 expected (sd, correlation)"),
                ("may_vary", 7, "may_vary: a name or a list of names expected, not int"),
                ("noise", "a", "noise: a whole number expected, not str"), ("noise", True, "noise: a whole number expected, not bool"),
                ("noise", 0, "noise: 0 is outside 1..16"), ("most_wild", "a", "most_wild: a number expected, not str"),
                ("launch", {"swing_rad": 1}, "launch: swing_rad: 1 number given, 2 expected (mean, sd)"),
                ("launch", {"swing": (1, 2)}, "launch: \"swing\" is none of the states swing_rad"),
                ("inputs", 5, "inputs: a name or a list of names expected, not int"), ("name", 5, "name: a text expected, not int"),
                ("units", 5, "units: a dict {name: unit} expected, not int"),
                ("step", lambda state, noise: state, "step: it is called as step(state, noise, p), and takes other arguments")):
            self.check(sentence, lambda: pendulum(**{argument: given}))
        for kind in (ValueError, TypeError, metastable.InputTypeError):
            with self.assertRaises(kind):
                pendulum(states=3)

    def test_columns_and_options_of_the_wrong_kind(self):
        machine, data = pendulum(), swung(trials=5)
        for given, sentence in (
                (dict(labels=5), "labels: a name or a list of names expected, not int"),
                (dict(labels={"crew": [{}] * 120}), "crew: words or numbers expected, not dict in row 1"),
                (dict(inputs=["load"]), "inputs: a dict {name: column} expected, not list"),
                (dict(inputs={"load": [1] * 120}), "inputs: \"load\" is none of the machine's: it has none"),
                (dict(outcome=5), "outcome: one for each of the 5 trials expected, not int"),
                (dict(outcome=["fell"] * 5), "outcome: \"fell\" is none of failed, stopped, lost"),
                (dict(trial=[{}] * 120), "trial: words or numbers expected, not dict in row 1"),
                (dict(time_s=[[1], [1, 2]] * 60), "time_s: one value a row expected, not list"),
                (dict(swing_rad=[10**400] * 120), "swing_rad: numbers expected, and NaN for missing ones, not '1000")):
            self.check(sentence, lambda: metastable.runs(machine, **{**data, **given}))
        runs = metastable.runs(machine, **data)
        for given, sentence in ((dict(catalogue=5), "catalogue: a name or a list of names expected, not int"),
                                (dict(seed="a"), "seed: a whole number expected, not str"),
                                (dict(progress=5), "progress: None, True, False or a function expected, not int")):
            self.check(sentence, lambda: metastable.diagnose(runs, machine, **given))
        self.check("experiment: an Experiment, Runs or the path of a folder expected, not int", lambda: metastable.diagnose(5))
        self.check("start: finite numbers expected, not nan", lambda: machine.walker(start=[np.nan]))
        self.check("start: real numbers expected", lambda: machine.walker(start="here"))

    def test_columns_of_a_size_that_no_machine_has(self):
        machine, data = pendulum(), swung(trials=5)
        for factor in (1e300, 1e-300):
            runs = metastable.runs(machine, trial=data["trial"], swing_rad=factor * data["swing_rad"])
            self.check("values up to 1e+100 that differ by 1e-100 or more are expected: is it in another unit than the machine?",
                       lambda: metastable.diagnose(runs, machine))

    def test_an_error_that_is_too_small_for_a_density(self):
        self.check("sensor: swing_rad: the machine's noise does not reach it, and the sd of its error, 1e-10, is less than 1e-06 "
                   "of its change from row to row", lambda: diagnosed(pendulum(
                       lambda s, z, p: ((p["decay"] * s[:, 0])[:, None], np.zeros(len(s), bool)),
                       sensor={"swing_rad": 1e-10}), trials=5))

    def test_a_step_that_is_none(self):
        def asked(function):
            return lambda: diagnosed(pendulum(step=function), trials=5)

        def writes(state, noise, p):
            state[:, 0] *= p["decay"]
            return state, np.zeros(len(state), bool)

        self.check("next states of shape", asked(lambda s, z, p: (np.zeros((len(s), 2)), np.zeros(len(s), bool))))
        self.check("step: failed of shape (), ", asked(lambda s, z, p: (s, False)))
        self.check("(next states, failed) is to be returned", asked(lambda s, z, p: s))
        self.check("step: the next states are no array of real numbers, but of dtype complex128", asked(lambda s, z, p: (s + 0j, s[:, 0] > 9)))
        self.check("step: the next states are whole numbers (dtype int64), which cut off what follows the point",
                   asked(lambda s, z, p: (s.astype(int), s[:, 0] > 9)))
        self.check("step: whether each state failed is no array of booleans, but of dtype float64", asked(lambda s, z, p: (s, s[:, 0])))
        self.check("step: it makes one number of an array, but states, noise and parameters are arrays of one number a row",
                   asked(lambda s, z, p: (float(p["decay"]) * s, s[:, 0] > 9)))
        self.check("step: it asks a dict for 'dcay', which is not there; p has decay, scatter_rad, loss_rad, per_rad",
                   asked(lambda s, z, p: (p["dcay"] * s, s[:, 0] > 9)))
        self.check("when some of the others are not asked for", asked(
            lambda s, z, p: (step(s, z, p)[0] + 0.01 * s.max(), s[:, 0] > 9)))
        self.check("step: no finite state comes of trial 0, row 1", asked(lambda s, z, p: (s + np.inf, np.zeros(len(s), bool))))
        self.check("step: the next swing_rad is NaN, and not marked as failed, from swing_rad",
                   asked(lambda s, z, p: (s * np.nan, np.zeros(len(s), bool))))
        self.check("step: it writes into a read-only array, as its arguments are", asked(writes))
        drawn = np.random.default_rng(1)
        self.check("step: it makes something else of the same states", asked(
            lambda s, z, p: (p["decay"] * s + 0.01 * drawn.standard_normal(s.shape), np.zeros(len(s), bool))))

    def test_a_step_that_knows_no_next_state_from_some_rows(self):
        def for_noise_above(limit, marks):
            def some(state, noise, p):
                following, failed = step(state, noise, p)
                lost = noise[:, 0] > limit
                return np.where(lost[:, None], np.nan, following), failed | (lost & marks)
            return some

        def for_decay_above(state, noise, p):
            following, failed = step(state, noise, p)
            return np.where((np.broadcast_to(p["decay"], len(state)) > 0.976)[:, None], np.nan, following), failed

        def asked(function):
            return lambda: diagnosed(pendulum(step=function), trials=5)

        for limit in (1, 3):
            self.check("step: the next swing_rad is NaN, and not marked as failed, from swing_rad", asked(for_noise_above(limit, False)))
        self.check(", decay 0.98", asked(for_decay_above))
        self.assertIsNotNone(asked(for_noise_above(3, True))().verdict)

    def test_a_step_that_writes_into_its_parameters(self):
        def asked(function):
            return lambda: diagnosed(pendulum(step=function), trials=5)

        def changes(state, noise, p):
            p["decay"] = 0.9
            return step(state, noise, p)

        def adds(state, noise, p):
            p["mine"] = 1
            return step(state, noise, p)

        def takes(state, noise, p):
            return step(state, noise, dict(p, loss_rad=p.pop("loss_rad")))

        self.check("step: it writes into p, whose \"decay\" is not what it was given any more", asked(changes))
        self.check("step: it writes into p, which has names that it was not given", asked(adds))
        self.check("step: it writes into p, whose \"loss_rad\"", asked(takes))
        self.check("step: it writes into p, which it may only read",
                   lambda: pendulum(step=changes).walker(start=[0.8]).study(simulated_steps=0))

    def test_a_step_that_branches_on_a_parameter(self):
        def branches(state, noise, p):
            return step(state, noise, p) if p["decay"] > 0.5 else (state, np.ones(len(state), bool))

        with self.assertRaisesRegex(metastable.InputError, "step: it asks whether an array is true, but states, noise and parameters are "
                                                "arrays of one number a row, .* \\(The truth value of an array"):
            diagnosed(pendulum(step=branches), trials=5)

    def test_values_out_of_bounds(self):
        bounded = pendulum(parameters={"decay": (0.975, 0.01, 0, 1), "scatter_rad": (0.003, 0.003, 1e-5, 0.1)})
        self.check("walker: decay: 2 is outside its bounds [0, 1]", lambda: bounded.walker(start=[0.8], decay=2))
        self.check("walker: dry_friction: loss_rad: 5 is outside its bounds [0, 0.05]", lambda: bounded.walker(start=[0.8], loss_rad=5))
        self.check("walker: decay: nan is outside its bounds [0, 1]", lambda: bounded.walker(start=[0.8], decay=np.nan))
        self.check("walker: decay: a number expected, not str", lambda: bounded.walker(start=[0.8], decay="much"))
        self.check("parameters: decay: lower is above upper in its bounds [1, 0]", lambda: pendulum(parameters={"decay": (0.9, 0.1, 1, 0)}))
        self.check("effects: dry: loss_rad: lower is above upper in its bounds [0.05, 0]", lambda: pendulum(
            effects={"dry": {"loss_rad": (0, 0.05, 0)}}))

    def test_runs_that_are_none(self):
        machine, data = pendulum(), swung(trials=5)
        self.check("there is no column trial", lambda: metastable.runs(machine, swing_rad=data["swing_rad"]))
        self.check("there is no column swing_rad", lambda: metastable.runs(machine, trial=data["trial"]))
        self.check("swing_rad: shape (3,) given, (120,) expected", lambda: metastable.runs(machine, trial=data["trial"], swing_rad=[1, 2, 3]))
        self.check("do not stand together", lambda: metastable.runs(machine, trial=[1, 2, 1], swing_rad=[1, 2, 3]))
        self.check("\"speed\" is none of the columns", lambda: metastable.runs(machine, speed=[1], **data))
        self.check("anything with columns by name", lambda: metastable.runs(machine, [data["trial"], data["swing_rad"]]))
        named = metastable.runs(machine, trial=[10, 10, 20, 20], swing_rad=[0.8, 0.7, 0.8, np.inf])
        self.check("trial 20: a state is infinite", lambda: metastable.diagnose(named, machine))
        still = metastable.runs(machine, trial=data["trial"], swing_rad=np.ones(120))
        self.check("a column that is constant says nothing", lambda: metastable.diagnose(still, machine))
        few = metastable.runs(machine, trial=[1, 1], swing_rad=[0.8, 0.7])
        self.check("1 transition is fewer than the 2 parameters", lambda: metastable.diagnose(few, machine))
        back = metastable.runs(machine, time_s=np.where(np.arange(120) == 30, -1, np.arange(120)), **data)
        self.check("time_s: it runs back in trial 1, row 7: -1 comes after 29", lambda: metastable.diagnose(back, machine))
        apart = metastable.runs(machine, trial=[1, 2], swing_rad=[0.8, 0.7])
        self.check("there is no transition", lambda: metastable.diagnose(apart, machine))
        self.check("outcome: \"fell\" is none of failed, stopped, lost", lambda: metastable.diagnose(
            metastable.runs(machine, outcome=["fell"] * 5, **data), machine))
        self.check("runs of a machine are given with it", lambda: metastable.diagnose(few))
        self.check("condition: row 2 has none", lambda: metastable.runs(machine, trial=[1, 1], swing_rad=[0.8, 0.7], condition=["a", None]))
        self.check("trial: row 2 has none", lambda: metastable.runs(machine, trial=[1, np.nan], swing_rad=[0.8, 0.7]))
        self.check("outcome: 7 is no trial", lambda: metastable.runs(machine, trial=[1, 1], swing_rad=[0.8, 0.7], outcome={7: "failed"}))
        self.check("a masked array is given", lambda: metastable.runs(
            machine, trial=[1, 1], swing_rad=np.ma.masked_equal([0.8, 0.7], 0.7)))
        self.check("a machine with other columns", lambda: metastable.diagnose(
            few, metastable.machine(step, states=["angle"], noise=1, parameters=dict(machine.parameters))))
        self.check("states: \"phase\" is a word of the runs' own", lambda: pendulum(states=["phase"], sensor={"phase": 0.1}))

    def test_effects_named_as_those_of_any_machine(self):
        for name in ("memory", "outliers", "decay_by_phase", "decay_drift", "decay_clock", "decay_with_swing_rad", "lag_load",
                     "sensor_noise_swing_rad", "sensor_bias_swing_rad", "launch_swing_rad", "launch_spread_swing_rad"):
            self.check(f"effects: \"{name}\" is the name of an effect that any machine may have: give yours another",
                       lambda: pendulum(inputs=["load"], effects={name: {"loss_rad": (0, 0, 0.05)}, "drag": {"per_rad": (0, 0, 0.5)}}))
        pendulum(may_vary=[], effects={"decay_drift": {"loss_rad": (0, 0, 0.05)}, "drag": {"per_rad": (0, 0, 0.5)}})
        labelled = pendulum(effects={"decay_by_crew": {"loss_rad": (0, 0, 0.05)}, "drag": {"per_rad": (0, 0, 0.5)}})
        data = swung(trials=5)
        self.check("effects: \"decay_by_crew\" is the name of an effect that any machine may have", lambda: metastable.diagnose(
            metastable.runs(labelled, labels={"crew": data["trial"] % 2}, **data), labelled))

    def test_other_units_are_suspected_aloud(self):
        machine, data = pendulum(), swung(trials=10)
        runs = metastable.runs(machine, trial=data["trial"], swing_rad=np.degrees(data["swing_rad"]))
        answer = metastable.diagnose(runs, machine, catalogue="dry_friction")
        self.assertIn("is it in degrees where the machine has radians?", " ".join(answer.notes))

    def test_some_trials_in_another_unit_are_suspected_aloud(self):
        machine, data = pendulum(inputs=["warmth"]), swung(trials=10)
        late, steady = data["trial"] >= 6, 20 + np.arange(240) % 7
        runs = metastable.runs(machine, trial=data["trial"], swing_rad=np.where(late, np.degrees(data["swing_rad"]), data["swing_rad"]),
                               inputs={"warmth": np.where(data["trial"] == 2, 1000 * steady, steady)})
        notes = " ".join(metastable.diagnose(runs, machine, catalogue="dry_friction").notes)
        self.assertRegex(notes, r"swing_rad: its values in 4 of 10 trials \(trial 6 for one\) are [56]\d\.?\d* times those of the others: "
                                "are these in degrees where the others are in radians\\?")
        self.assertIn("warmth: its values in trial 2 are 1000 times those of the others: is it in thousandths of the others' unit?", notes)

    def test_data_that_are_there_twice_are_noticed(self):
        machine, data = pendulum(), swung(trials=10)
        twice = metastable.runs(machine, trial=np.r_[data["trial"], 10 + data["trial"]], swing_rad=np.tile(data["swing_rad"], 2))
        self.assertIn("10 of 20 trials are there twice", " ".join(metastable.diagnose(twice, machine).notes))

    def test_an_unknown_effect_is_refused_with_those_there_are(self):
        machine = pendulum()
        runs = metastable.runs(machine, **swung(trials=5))
        self.check("catalogue: 'dry_frction' is none of dry_friction", lambda: metastable.diagnose(runs, machine, catalogue="dry_frction"))
        self.check("did you mean 'dry_friction'?", lambda: metastable.diagnose(runs, machine, catalogue=["decay_drift+dry_frction"]))


class Folder(unittest.TestCase):
    """A folder whose experiment.toml states model = "none" holds what runs() else gets as columns."""

    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)

    def put(self, name, text):
        with open(os.path.join(self.folder.name, name), "w") as file:
            file.write(text)

    def test_gives_the_answer_of_its_columns(self):
        data = swung(loss=0.004, trials=12, swings=12)
        self.put("experiment.toml", 'system = "machine"\n[machine]\nmodel = "none"\nlabels = ["crew"]\n')
        rows, number = ["trial,step,swing_rad,crew"], {}
        for trial, swing in zip(data["trial"], data["swing_rad"]):
            number[trial] = number.get(trial, 0) + 1
            rows.append(f"{trial + 1},{number[trial]},{float(swing)!r},{'day' if trial % 2 else 'night'}")
        self.put("steps.csv", "\n".join(rows) + "\n")
        self.put("trials.csv", "trial,outcome\n" + "".join(f"{t + 1},stopped\n" for t in range(12)))
        machine = pendulum()
        crew = ["day" if trial % 2 else "night" for trial in data["trial"]]
        given = metastable.runs(machine, trial=data["trial"] + 1, swing_rad=data["swing_rad"], labels={"crew": crew},
                                outcome=["stopped"] * 12)
        read = metastable.runs(machine, self.folder.name)
        self.assertEqual(repr(read), repr(given))
        catalogue = ["dry_friction", "quadratic_drag", "decay_by_crew"]
        one, other = (metastable.diagnose(runs, machine, catalogue=catalogue) for runs in (read, given))
        self.assertEqual(one.verdict, other.verdict)
        self.assertEqual(str(one.at_work), str(other.at_work))

    def test_a_label_has_a_name_of_its_own(self):
        self.put("experiment.toml", 'system = "machine"\n[machine]\nmodel = "none"\n')
        self.put("steps.csv", "trial,step,swing_rad\n1,1,0.5\n")
        for label, sentence in (("swing_rad", "^labels: 'swing_rad' is a column of its own: a label needs another"),
                                ("trial", "^labels: 'trial' is a column of its own: a label needs another name"),
                                ("crew", "there is no column crew, which labels names")):
            with self.assertRaisesRegex(metastable.InputError, sentence):
                metastable.runs(pendulum(), self.folder.name, labels=[label])
        with self.assertRaisesRegex(metastable.InputError, "^labels: 'crew' is there twice$"):
            metastable.runs(pendulum(), {"trial": [1], "swing_rad": [0.5], "crew": ["day"]}, labels=["crew", "crew"])

    def test_without_its_machine_the_way_is_named(self):
        self.put("experiment.toml", 'system = "machine"\n[machine]\nmodel = "none"\n')
        self.put("steps.csv", "trial,step,swing_rad\n1,1,0.5\n")
        with self.assertRaisesRegex(metastable.InputError, r"from Python, metastable\.diagnose\(metastable\.runs"):
            metastable.diagnose(self.folder.name)

    def test_another_machines_is_refused(self):
        self.put("experiment.toml", 'system = "machine"\n[machine]\nmodel = "compass"\n')
        self.put("steps.csv", "trial,step,swing_rad\n1,1,0.5\n")
        with self.assertRaisesRegex(metastable.InputError, 'machine.model: "none" is expected'):
            metastable.runs(pendulum(), self.folder.name)
        with self.assertRaisesRegex(metastable.InputError, "a folder holds all columns"):
            metastable.runs(pendulum(), self.folder.name, trial=[1])


if __name__ == "__main__":
    unittest.main()
