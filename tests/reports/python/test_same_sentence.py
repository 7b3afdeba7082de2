"""What is wrong with an argument is said in the command line's words, for every option that Python has too.

The rule: the sentence is the same, and where it names an option, --slope-sd, it names the argument, slope_sd_deg.
"""

import json
import re
import subprocess
import unittest

import metastable
from support import data, program, refusal

# Arguments that are no option's name with underscores.
others = {"slope": "slope_deg", "slopes": "slope_deg", "slope-sd": "slope_sd_deg", "memory": "memory_gb",
          "effect": "effects", "no-flight": "flight", "shuffle": "shuffled"}

# What Python does in other ways: results are objects, standard errors a dict, legs a list, a list of contacts an array,
# means and sds alone those of a Setting's pairs.
moments = {f"{of}-{moment}" for of in ("restitution", "friction") for moment in ("mean", "sd")}
files = {"json", "config", "out"}
elsewhere = {
    "steps": files | {"explain", "leg-count", "contact-list"},
    "compare": files | moments | {"leg-count", "contact-list"},
    "sweep": files | {"leg-count", "contact-list", "walker", "slope-sd", "terrain", "spacing", "simulated-steps", "memory"},
    "simulate": files | {"leg-count", "contact-list"},
    "describe": files, "diagnose": files, "blind": files | {"sealed", "tool"},
}
elsewhere = {command: names | {f"{name}-se" for name in ("slope", "restitution", "friction", "legs", "inertia",
                                                         "radius-of-gyration", "ramp-stiffness", "contact-mass")}
             for command, names in elsewhere.items()}

wheel = dict(slope_deg=9.59)
walker = dict(walker="simplest", slope_sd_deg=0.5)
of_walkers = {"walker", "slope-sd", "terrain", "spacing", "simulated-steps", "memory", "level"}


def argument_of(option):
    return others.get(option, option.replace("-", "_"))


def in_python(sentence):
    return re.sub(r"--([a-z]+(?:-[a-z]+)*)|^([a-z]+(?:-[a-z]+)*)(?=:)", lambda m: argument_of(m[1] or m[2]), sentence)


def options():
    """(command, option, what stands for its value, help) of every command that Python has."""
    for command in elsewhere:
        listed = subprocess.run([program, "man", command, "--json", "-"], capture_output=True, check=True)
        for _, option, value, _, help_text in json.loads(listed.stdout)["tables"]["options"]["rows"]:
            if option.startswith("--"):
                yield command, option[2:], value or "", help_text


def wrong_values(option, value):
    """What no option of that kind takes: as Python says it, and as text."""
    if re.fullmatch("[a-z]+(\\|[a-z]+)*", value):
        word = value.split("|")[-1]
        return [(word[1] + word[0] + word[2:], word[1] + word[0] + word[2:])]
    if value == "":
        return []
    if option in ("effect", "catalogue", "drop", "against"):
        return [("leg_contct", "leg_contct")]
    if option == "outside":
        return [({"plank": 2.0}, "plank:2")] if value == "ID:SIZE" else [(-1, "-1")]
    if value.startswith("MEAN,SD"):
        return [((-10**9, 1), "-1000000000,1"), ((0.3, -1), "0.3,-1"), ((1, 2, 3), "1,2,3"), (-10**9, "-1000000000")]
    if value == "RANGE":
        return [([-10**9], "-1000000000"), ([2, 1], "2,1")]
    if option == "legs":
        return [([0.15, -1, 0.15], "0.15,-1,0.15"), ([0.15, 0.15], "0.15,0.15")]
    if option == "slopes":
        return [(-10**9, "-1000000000,5")]
    return [(-10**9, "-1000000000")]


def ask(command, option, given):
    argument, more = argument_of(option), {}
    setting = metastable.WalkerSetting if option in of_walkers else metastable.Setting
    fields = dict(walker if option in of_walkers else wheel)
    if argument in setting.__dataclass_fields__ and (command, option) not in (("sweep", "slope"), ("blind", "law"), ("blind", "walker")):
        setting(**{**fields, argument: given})
    else:
        more = {argument: given}
    what = setting(**fields)
    if command == "sweep":
        metastable.sweep(what.replace(initial_speed=6), **more)
    elif command == "blind":
        metastable.blind.make("nowhere/run", **more)
    elif command in ("describe", "diagnose"):
        getattr(metastable, command)(data, **more)
    elif command == "simulate":
        reality = option in ("effect", "outside", "skewness", "sensor-noise", "smoothing", "drop")
        metastable.simulate(what, **(dict(reality=True) if reality else {}),
                            **(dict(angle_rate=120) if option == "angle-noise" else {}), **more)
    else:
        getattr(metastable, "study" if command == "steps" else command)([what] * 2 if command == "compare" else what, **more)


def words(command, option, text):
    said = [command]
    if command in ("describe", "diagnose"):
        said += [str(data)]
    if command == "blind":
        said += ["make", "nowhere/run"]
    if command == "simulate":
        said += ["--out", "nowhere/trials"]
        if option in ("effect", "outside", "skewness", "sensor-noise", "smoothing", "drop"):
            said += ["--reality"]
        if option == "angle-noise":
            said += ["--angle-rate", "120"]
    if command == "sweep" and option != "slope":
        said += ["--slope", "9.59"]
    if command == "sweep":
        said += ["--initial-speed", "6"] if option != "initial-speed" else []
        said += ["--friction-mean", "0.3,0.4"] if not option.endswith(("-mean", "-sd")) else []
    if command == "compare" and option == "initial-speed":
        said += [f"--{option}={text}"]
    if command == "blind":
        return [*said, f"--{option}={text}"]
    if option in of_walkers - {"walker"}:
        said += ["--walker", "simplest"]
    if option in of_walkers - {"slope-sd"}:
        said += ["--slope-sd", "0.5"]
    return [*said, f"--{option}={text}"]


class SameSentence(unittest.TestCase):
    def test_of_every_option(self):
        asked, refused = 0, {}  # commands that share an option refuse alike: the program runs once for them
        for command, option, value, help_text in options():
            if option in elsewhere[command]:
                continue
            for given, text in wrong_values(option, value):
                with self.subTest(command, option=option, text=text):
                    with self.assertRaises(metastable.InputError) as raised:
                        ask(command, option, given)
                    key = option, help_text, text
                    if key not in refused:
                        refused[key] = in_python(refusal(*words(command, option, text)))
                    self.assertEqual(str(raised.exception), refused[key])
                asked += 1
        self.assertGreater(asked, 120)

    def test_of_settings_that_cannot_be(self):
        for fields, said in (
            (dict(slope_deg=30), ["--slope=30"]),
            (dict(slope_deg=1e-9), ["--slope=1e-9"]), (dict(friction=(0, 4)), ["--friction=0,4"]),
            (dict(legs=1000), ["--legs=1000"]), (dict(legs=[0.2] * 5, first_leg=5), ["--legs=0.2", "--leg-count=5", "--first-leg=5"]),
            (dict(inertia=0.0035), ["--inertia=0.0035"]), (dict(mass=1e250), ["--mass=1e250"]), (dict(mass=float("nan")), ["--mass=nan"]),
            (dict(law="coulomb", radius_of_gyration=2), ["--law=coulomb", "--radius-of-gyration=2"]),
            (dict(law="coulomb", ramp_stiffness=9e3), ["--law=coulomb", "--ramp-stiffness=9000"]),
            (dict(law="plastic", friction=0.3), ["--law=plastic", "--friction=0.3"]),
            (dict(law="settled", tip_radius=0.01), ["--law=settled", "--tip-radius=0.01"]),
            (dict(law="settled", restitution=0.96), ["--law=settled", "--restitution=0.96"]),
        ):
            with self.subTest(said=said), self.assertRaises(metastable.InputError) as raised:
                metastable.Setting(**fields)
            self.assertEqual(str(raised.exception), in_python(refusal("steps", *said)))

    def test_of_options_that_mean_nothing_there(self):
        for setting, options, said in (
            (metastable.Setting(**wheel), dict(spacing=1), ["--spacing", "1"]),
            (metastable.Setting(**wheel), dict(direct=True), ["--direct"]),
            (metastable.Setting(**wheel), dict(method="integrated", tail=1e-20), ["--method=integrated", "--tail=1e-20"]),
            (metastable.WalkerSetting(**walker), dict(cells=32), ["--walker=simplest", "--slope-sd=0.5", "--cells=32"]),
            (metastable.WalkerSetting(**walker), dict(certify=True), ["--walker=simplest", "--slope-sd=0.5", "--certify"]),
            (metastable.Setting(law="plastic"), dict(standard_errors={"friction_mean": 1}),
             ["--law=plastic", "--friction-se=1"]),
        ):
            with self.subTest(said=said), self.assertRaises(metastable.InputError) as raised:
                metastable.study(setting, **options)
            self.assertEqual(str(raised.exception), in_python(refusal("steps", *said)))
        with self.assertRaises(metastable.InputError) as raised:  # one name here, mean and sd in the option
            metastable.study(metastable.Setting(**wheel), standard_errors={"friction_mean": -1})
        self.assertEqual(str(raised.exception), "friction_mean: standard error -1 is outside [0, inf)")
        for options, said in (
            (dict(effects="bounce"), ["--effect=bounce"]), (dict(flight=False), ["--no-flight"]),
            (dict(shuffled=True), ["--shuffle"]), (dict(drop=["leg"]), ["--drop=leg"]),
            (dict(angle_noise=0.1), ["--angle-noise=0.1"]), (dict(stand_in=True, trials=9), ["--stand-in", "--trials=9"]),
            (dict(reality=True, effects="leg_contact:leg=8"), ["--reality", "--effect=leg_contact:leg=8"]),
        ):
            with self.subTest(said=said), self.assertRaises(metastable.InputError) as raised:
                metastable.simulate(metastable.Setting(), **options)
            self.assertEqual(str(raised.exception), in_python(refusal("simulate", "--out", "nowhere/trials", *said)))


if __name__ == "__main__":
    unittest.main()
