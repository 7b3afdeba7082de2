"""The command line: python -m metastable steps --slope 9.59."""

import pathlib
import sys

if not __package__:  # run as a file
    sys.path[0] = str(pathlib.Path(__file__).parent.parent)

from metastable import _metastable

sys.exit(_metastable.run_command_line(["metastable", *sys.argv[1:]]))
