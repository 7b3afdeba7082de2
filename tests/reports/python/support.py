"""What the tests of the Python module share."""

import json
import os
import pathlib
import subprocess

program = os.environ["METASTABLE_PROGRAM"]
data = pathlib.Path(__file__).parents[2] / "data" / "stand-in"


def command_line(*words):
    """The program's --json, without what says how it was asked."""
    ran = subprocess.run([program, *words, "--json", "-"], capture_output=True, text=True, check=True)
    return told(json.loads(ran.stdout))


def told(answer):
    """An answer without what says how it was asked."""
    answer.pop("provenance")
    return answer


def refusal(*words):
    """The sentence with which the program refuses."""
    ran = subprocess.run([program, *words], capture_output=True, text=True)
    return ran.stderr.strip().removeprefix("metastable: ")
