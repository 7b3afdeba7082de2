"""The notebooks of the site are run, and say what they hold. METASTABLE_WRITE_PAGES=1 writes what comes out instead.

Cells tagged "slow" take a minute and more: they are run only to be written.
"""

import ast
import contextlib
import importlib.util
import io
import json
import os
import pathlib
import tempfile
import unittest

import support

NOTEBOOKS = pathlib.Path(__file__).resolve().parents[3] / "reports" / "site" / "notebooks"


def ran(source, names):
    """What a cell prints, and the text of its last expression, as a notebook shows them."""
    body = ast.parse(source).body
    last = ast.Expression(body.pop().value) if body and isinstance(body[-1], ast.Expr) else None
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(ast.Module(body, []), "cell", "exec"), names)
        value = None if last is None else eval(compile(last, "cell", "eval"), names)
    return printed.getvalue(), None if value is None else repr(value)


def outputs(printed, shown, count):
    made = []
    if printed:
        made.append({"name": "stdout", "output_type": "stream", "text": printed.splitlines(keepends=True)})
    if shown is not None:
        made.append({"data": {"text/plain": shown.splitlines(keepends=True)}, "execution_count": count, "metadata": {},
                     "output_type": "execute_result"})
    return made


class Notebooks(unittest.TestCase):
    def setUp(self):
        path = os.environ["PATH"]
        os.environ["PATH"] = os.path.dirname(support.program) + os.pathsep + path  # cells call metastable by its name
        self.addCleanup(os.environ.__setitem__, "PATH", path)

    def check(self, name):
        path = NOTEBOOKS / name
        notebook = json.loads(path.read_text())
        names, here = {}, os.getcwd()
        count = 0
        with tempfile.TemporaryDirectory() as folder:
            os.chdir(folder)
            try:
                for cell in notebook["cells"]:
                    if cell["cell_type"] != "code":
                        continue
                    count += 1
                    if "slow" in cell["metadata"].get("tags", []) and not os.environ.get("METASTABLE_WRITE_PAGES"):
                        continue
                    made = outputs(*ran("".join(cell["source"]), names), count)
                    if os.environ.get("METASTABLE_WRITE_PAGES"):
                        cell["outputs"], cell["execution_count"] = made, count
                    self.assertEqual(cell["outputs"], made, "".join(cell["source"]))
            finally:
                os.chdir(here)
        if os.environ.get("METASTABLE_WRITE_PAGES"):
            path.write_text(json.dumps(notebook, indent=1) + "\n")

    def test_pendulum(self):
        self.check("pendulum.ipynb")

    def test_walks(self):
        self.check("walks.ipynb")

    @unittest.skipUnless(importlib.util.find_spec("dartpy"), "the biped in DART needs python3-dartpy")
    def test_dart_biped(self):
        self.check("dart-biped.ipynb")


if __name__ == "__main__":
    unittest.main()
