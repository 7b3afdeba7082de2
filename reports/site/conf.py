"""The documentation site: Sphinx with MyST and Furo; Doxygen and Breathe for the reference of the C++ library."""

import os
import pathlib
import re

from docutils import nodes
from docutils.utils.math import latex2mathml

root = pathlib.Path(os.environ["METASTABLE_SOURCE"])  # the source tree
pages = pathlib.Path(__file__).parent  # the staged copy of this folder

project = "metastable"
author = "the authors of metastable"
version = re.search(r"project\(metastable VERSION ([\d.]+)", (root / "CMakeLists.txt").read_text()).group(1)
extensions = ["myst_parser", "breathe", "sphinx.ext.autodoc"]
html_theme = "furo"
html_title = f"metastable {version}"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_copyright = False
exclude_patterns = ["xml", "static"]
myst_heading_anchors = 3
myst_enable_extensions = ["dollarmath", "deflist"]
html_math_renderer = "mathml"
breathe_projects = {"metastable": os.environ["METASTABLE_XML"]}
breathe_default_project = "metastable"
breathe_order_parameters_first = True
# Names of the standard library and of concepts have no page here.
nitpicky = False
suppress_warnings = ["cpp.parse_function_declaration", "misc.highlighting_failure"]


def public_headers(folder):
    """What the folder's CMakeLists.txt lists as its public headers, room by room."""
    listed = re.search(r"FILE_SET HEADERS[^\n]*FILES(.*?)\)", (root / folder / "CMakeLists.txt").read_text(), re.DOTALL)
    rooms = {}
    for header in listed.group(1).split():
        rooms.setdefault(header.rpartition("/")[0], []).append(header)
    return rooms


def summary(path):
    """The comment at the head of a header."""
    lines = []
    for line in path.read_text().splitlines()[1:]:
        if not line.startswith("//"):
            break
        lines.append(line[2:].strip())
    return " ".join(lines).partition("  ")[0]


def write_reference(folder):
    text = f"# {folder}/\n\n`#include <metastable/{folder}/ROOM/HEADER.h>`\n"
    for room, headers in public_headers(folder).items():
        text += f"\n## {room or folder}\n"
        for header in headers:
            text += f"\n### {pathlib.Path(header).name}\n\n{summary(root / folder / header)}\n\n"
            text += f"```{{doxygenfile}} {folder}/{header}\n```\n"
    (pages / "reference").mkdir(exist_ok=True)
    (pages / "reference" / f"{folder}.md").write_text(text)


for folder in ("markov", "dynamics", "analysis"):
    write_reference(folder)


def keep_layout(app, what, name, obj, options, lines):
    """Docstrings are plain text: tables of arguments and programs in them keep their lines."""
    told = []
    for paragraph in re.split(r"\n\s*\n", "\n".join(lines)):
        laid_out = re.search(r"^ |\S  +\S", paragraph, re.MULTILINE)
        told += ["::", "", *("    " + line for line in paragraph.split("\n"))] if laid_out else paragraph.split("\n")
        told.append("")
    lines[:] = told


def mathml(display):
    """A writer of formulas as MathML, which browsers show without a script from the network."""
    def visit(writer, node):
        formula, row = latex2mathml.math(xmlns="http://www.w3.org/1998/Math/MathML", display=display), latex2mathml.mrow()
        formula.append(row)
        latex2mathml.parse_latex_math(row, node.astext())
        writer.body.append(formula.toprettyxml())
        raise nodes.SkipNode
    return visit, None


def setup(app):
    app.connect("autodoc-process-docstring", keep_layout)
    app.add_html_math_renderer("mathml", inline_renderers=mathml("inline"), block_renderers=mathml("block"))
