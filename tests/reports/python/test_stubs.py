"""The type stubs say what is there, neither more nor less."""

import ast
import inspect
import pathlib
import unittest

import numpy

import metastable

folder = pathlib.Path(metastable.__file__).parent


def public(names):
    return {name for name in names if not name.startswith("_")}


class Stub:
    """A stub file: its classes and functions by name; of overloads, all."""

    def __init__(self, name):
        self.classes, self.functions = {}, {}
        for node in ast.parse((folder / name).read_text()).body:
            if isinstance(node, ast.ClassDef):
                self.classes[node.name] = node
            elif isinstance(node, ast.FunctionDef):
                self.functions.setdefault(node.name, []).append(node)

    def fields(self, name):
        return {node.target.id: ast.unparse(node.annotation) for node in self.classes[name].body
                if isinstance(node, ast.AnnAssign)}

    def methods(self, name):
        return {node.name: node for node in self.classes[name].body if isinstance(node, ast.FunctionDef)}


def parameters(node):
    """Name, kind and default of each."""
    a = node.args
    places = [*a.posonlyargs, *a.args]
    defaults = [None] * (len(places) - len(a.defaults)) + a.defaults
    told = {arg.arg: ("place", default) for arg, default in zip(places, defaults)}
    told.update({arg.arg: ("name", default) for arg, default in zip(a.kwonlyargs, a.kw_defaults)})
    if a.kwarg:
        told[a.kwarg.arg] = ("rest", None)
    return {name: (kind, default and ast.literal_eval(default)) for name, (kind, default) in told.items()}


def runtime_parameters(function):
    kinds = {inspect.Parameter.KEYWORD_ONLY: "name", inspect.Parameter.VAR_KEYWORD: "rest"}
    return {name: (kinds.get(p.kind, "place"), None if p.default is inspect.Parameter.empty else p.default)
            for name, p in inspect.signature(function).parameters.items()}


class Stubs(unittest.TestCase):
    def compare_signature(self, nodes, function):
        stated = {}
        for node in nodes:
            stated.update(parameters(node))
            order = [name for name in runtime_parameters(function) if name in parameters(node)]
            self.assertEqual(sorted(parameters(node)), sorted(order))
        self.assertEqual(stated, runtime_parameters(function), function)

    def test_name_everything_public_with_its_signature(self):
        for module, name in ((metastable, "__init__.pyi"), (metastable.blind, "blind.pyi")):
            stub = Stub(name)
            stated = public([*stub.classes, *stub.functions])
            exported = public(getattr(module, "__all__", ())) - {"blind"} or public(
                name for name, value in vars(module).items() if getattr(value, "__module__", "") == module.__name__)
            inner = {"ExpectedSteps", "Provenance", "MeshEstimate", "WalkerSteps"}  # records that only stubs tell apart
            self.assertEqual(stated - inner, exported)
            for function, nodes in stub.functions.items():
                self.compare_signature(nodes, getattr(module, function))
                self.assertTrue(getattr(module, function).__doc__, function)
            for kind in stated & set(stub.classes) - inner:
                real = getattr(module, kind)
                self.assertTrue(real.__doc__, kind)
                methods = stub.methods(kind)
                own = {n for n, value in vars(real).items() if callable(value) or isinstance(value, property)}
                told = own if "__init__" in methods else own - {"__init__"}  # a dataclass's, an inherited one
                self.assertEqual(public(methods), public(told), kind)
                for method in public(methods):
                    if callable(vars(real)[method]):
                        self.compare_signature([methods[method]], vars(real)[method])
                    self.assertTrue(vars(real)[method].__doc__, f"{kind}.{method}")
                if "__init__" in methods:
                    self.compare_signature([methods["__init__"]], real.__init__)

    def test_fields_are_those_of_results(self):
        stub = Stub("__init__.pyi")
        setting = metastable.Setting(law="published", slope_deg=9.59)
        small = dict(cells=32, samples=256, replicates=2)
        drum = metastable.walker(lambda s, z: (0.6 * s + z, abs(s[:, 0]) > 2.5), 1, 1, start=[0])
        trials = metastable.simulate(setting, trials=6)
        plain = metastable.study(setting, **small)
        mesh = drum.study(spacing=0.5, simulated_steps=10000)
        simplest = metastable.WalkerSetting("simplest", slope_sd_deg=0.6)
        several = metastable.compare([simplest] * 2, spacing=1.2, simulated_steps=10000)
        for result, name in (
            (plain, "Study"), (plain.expected_steps, "ExpectedSteps"), (plain.provenance, "Provenance"),
            (plain.regime[0], "Regime"), (mesh, "WalkerStudy"), (mesh.failure_rate_per_step, "MeshEstimate"),
            (drum.study(method="splitting", tolerance=0.3), "WalkerStudy"), (several, "WalkerComparison"),
            (metastable.compare([setting, setting], **small), "Comparison"),
            (metastable.simulate(metastable.Setting(law="plastic"), trials=3), "Experiment"),
            (metastable.describe(metastable.simulate(metastable.Setting(law="plastic"), trials=3)), "Description"),
            (metastable.diagnose(trials, catalogue="slope_offset"), "Diagnosis"),
            (drum.simulate(trials=20), "SimulatedSteps"), (setting, "Setting"), (drum, "Walker"),
            (metastable.chain(numpy.zeros((1, 1)), [0.5]).first_passage(), "FirstPassage"),
        ):
            with self.subTest(name):
                stated = stub.fields(name)
                there = public(vars(result)) if name != "Experiment" else set()
                needed = {field for field, kind in stated.items() if not kind.startswith("Optional")}
                self.assertLessEqual(needed, there)
                self.assertLessEqual(there, set(stated))
                for field in set(stated) - there:
                    self.assertIsNone(getattr(result, field), field)
        self.assertTrue((folder / "py.typed").is_file())


if __name__ == "__main__":
    unittest.main()
