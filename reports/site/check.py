#!/usr/bin/env python3
"""Runs what the pages show, and compares it with what they say came of it.

    check.py --bin FOLDER... [--python FOLDER] PAGE...

A PAGE is a page of Markdown or a notebook, whose code is run (exit code 77 without Matplotlib). Blocks fenced as `console` hold commands behind "$ " (continued lines end with a backslash) and what they print, on
either stream. Blocks fenced as `pycon` hold a Python session, blocks fenced as `python` a program that is to end well. The blocks of a page run in order, in one empty folder
of their own, with the files of samples/ that the page offers; a line "..." stands for lines that are left out. A
session that begins with the import of what is not there (SciPy) is not run, nor are other blocks.

With METASTABLE_WRITE_PAGES=1 in the environment the pages are rewritten to say what came of it now; "..." stays where
it stands.
"""

import argparse
import ast
import code
import contextlib
import csv
import difflib
import importlib.util
import io
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import traceback

FENCE = re.compile(r"^```(console|pycon|python)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def steps_of(kind, body):
    """The (prompt and input, output) pairs of a block, each a list of lines."""
    steps, lines = [], body.splitlines()
    while lines:
        line = lines.pop(0)
        if not line.startswith("$ " if kind == "console" else ">>> "):
            raise SystemExit(f"a {kind} block begins with no prompt: {line!r}")
        given = [line]
        while lines and (given[-1].endswith("\\") if kind == "console" else lines[0].startswith("... ")):
            given.append(lines.pop(0))
        shown = []
        while lines and not lines[0].startswith(("$ ", ">>> ")):
            shown.append(lines.pop(0))
        steps.append((given, shown))
    return steps


def fits(shown, printed):
    """Is `printed` what is shown, with any lines in the place of each "..."?"""
    pattern = "".join("(?:.*\n)*?" if line == "..." else re.escape(line) + "\n" for line in shown)
    return re.fullmatch(pattern, "".join(line + "\n" for line in printed)) is not None


def there(body):
    """Is there what a Python session begins to import? One that needs SciPy is left out where SciPy is not."""
    imported = re.match(r">>> import (.+)\n", body)
    names = imported.group(1).split(", ") if imported else []
    return all(name.startswith("metastable") or importlib.util.find_spec(name.split(".")[0].split(" ")[0])
               for name in names)


def cut(shown, printed):
    """`printed` with "..." where `shown` has it: as many lines before and behind; what stands between two of them is
    found again by how its first line begins."""
    if "..." not in shown:
        return printed
    if fits(shown, printed):
        return shown
    parts = "\n".join(shown).split("...")
    parts = [part.strip("\n").splitlines() for part in parts]
    kept, at = printed[:len(parts[0])], len(parts[0])
    for part in parts[1:-1]:
        start = re.match(r"\s*\S*", part[0]).group()
        at = next((i for i in range(at, len(printed)) if printed[i].startswith(start)), at)
        kept += ["..."] + printed[at:at + len(part)]
        at += len(part)
    return kept + ["..."] + (printed[-len(parts[-1]):] if parts[-1] else [])


class Interpreter(code.InteractiveInterpreter):
    """Shows of an exception its last line, which is the same on every machine."""

    def showtraceback(self):
        kind, value, _ = sys.exc_info()
        self.write("".join(traceback.format_exception_only(kind, value)))


class Session:
    """One page's folder, shell environment and Python interpreter."""

    def __init__(self, folder, programs, python_folder):
        self.folder = folder
        self.environment = dict(os.environ, PATH=f"{programs}:{os.environ['PATH']}", LC_ALL="C.UTF-8", COLUMNS="110")
        if python_folder:
            sys.path.insert(0, python_folder)
            self.environment["PYTHONPATH"] = python_folder
        self.interpreter = Interpreter({"__name__": "__page__"})

    def run_program(self, text):
        """What a program in Python says of its failure; "" where it ends well."""
        done = subprocess.run([sys.executable, "-c", text], cwd=self.folder, env=self.environment,
                              stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL)
        return done.stderr.decode() or f"exit code {done.returncode}" if done.returncode else ""

    def run(self, kind, given):
        if kind == "console":
            command = "\n".join([given[0][2:]] + given[1:])
            done = subprocess.run(["bash", "-c", command], cwd=self.folder, env=self.environment,
                                  stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL)
            return done.stdout.decode().splitlines()
        source, out = "\n".join(line[4:] for line in given), io.StringIO()
        back = os.getcwd()
        os.chdir(self.folder)
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
            self.interpreter.runsource(source + ("\n" if len(given) > 1 else ""), "<page>", "single")
        os.chdir(back)
        return out.getvalue().splitlines()


def check_tables(page, text):
    """Yields what is wrong with the CSV files that a page shows as tables."""
    for name in re.findall(r"^:file: (.+)$", text, re.MULTILINE):
        file = page.parent / name
        rows = list(csv.reader(file.open())) if file.exists() else []
        if len(rows) < 2 or any(len(row) != len(rows[0]) for row in rows):
            yield f"{page.name}: {name} is no table with a head and rows of the same length"


def check(page, programs, python_folder, write):
    """Returns what is wrong with a page, as text."""
    text = page.read_text()
    wrong = list(check_tables(page, text))
    with tempfile.TemporaryDirectory() as folder:
        for sample in re.findall(r"<samples/(.+?)>`", text):  # which readers download
            shutil.copy(page.parent / "samples" / sample, folder)
        session = Session(folder, programs, python_folder)

        def run_block(match):
            kind, body = match.group(1), []
            if kind == "python":
                if python_folder and (said := session.run_program(match.group(2))):
                    wrong.append(f"{page.name}: the program in Python: {said}")
                return match.group(0)
            if not there(match.group(2)):
                return match.group(0)
            for given, shown in steps_of(kind, match.group(2)):
                printed = [line.rstrip() for line in session.run(kind, given)]
                # What is shown ends where the next prompt or the fence begins: empty lines at the end do not count.
                while printed and not printed[-1]:
                    printed.pop()
                while shown and not shown[-1]:
                    shown.pop()
                if not fits(shown, printed):
                    wrong.append("\n".join([f"{page.name}: {given[0]}"] +
                                           list(difflib.unified_diff(shown, printed, "the page", "came out", lineterm=""))))
                body += given + cut(shown, printed)
            return "```{}\n{}\n```".format(kind, "\n".join(body))

        written = FENCE.sub(run_block, text)
    if write and written != text:
        page.write_text(written)
        return ""
    return "" if write else "\n".join(wrong)


def check_notebook(page):
    """Runs the code of a notebook, without Jupyter; what a cell ends with is shown, to nobody. Returns what is wrong."""
    names = {"__name__": "__notebook__"}
    for number, cell in enumerate(json.loads(page.read_text())["cells"], 1):
        if cell["cell_type"] != "code":
            continue
        body = ast.parse("".join(cell["source"])).body
        try:
            with contextlib.redirect_stdout(io.StringIO()):
                exec(compile(ast.Module(body[:-1], []), page.name, "exec"), names)
                if isinstance(body[-1], ast.Expr):
                    value = eval(compile(ast.Expression(body[-1].value), page.name, "eval"), names)
                    getattr(value, "_repr_html_", value.__repr__)()
                else:
                    exec(compile(ast.Module(body[-1:], []), page.name, "exec"), names)
        except Exception:
            return f"{page.name}, cell {number}: {traceback.format_exc()}"
    return ""


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--bin", required=True, action="append", help="where programs are; may be repeated")
    arguments.add_argument("--python", default="", help="where the Python module is")
    arguments.add_argument("pages", nargs="+", type=pathlib.Path)
    asked = arguments.parse_args()
    programs = ":".join(os.path.abspath(folder) for folder in asked.bin)
    write = os.environ.get("METASTABLE_WRITE_PAGES") == "1"
    python = asked.python and os.path.abspath(asked.python)
    if any(page.suffix == ".ipynb" for page in asked.pages):
        os.environ["MPLBACKEND"] = "Agg"
        sys.path.insert(0, python)
        if importlib.util.find_spec("matplotlib") is None:
            print("skipped: python3-matplotlib is not there")
            sys.exit(77)
    wrong = [check_notebook(page) if page.suffix == ".ipynb" else check(page, programs, python, write)
             for page in asked.pages]
    wrong = [text for text in wrong if text]
    print("\n\n".join(wrong) if wrong else f"{len(asked.pages)} page(s) say what comes out")
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
