#!/usr/bin/env bash
# Builds the site: build.sh SOURCE BUILD [PYTHON]; SOURCE is the tree, BUILD a folder for it, PYTHON where the Python
# module is, if it is. `build.sh --needs` only says what is missing, in one line. `./run docs` calls both.
set -euo pipefail

missing=$(/usr/bin/python3 - 2>/dev/null <<'CHECK' || echo ' python3'
import importlib
for module, package in (("sphinx", "python3-sphinx"), ("myst_parser", "python3-myst-parser"), ("furo", "furo"),
                        ("breathe", "python3-breathe"), ("nbconvert", "jupyter-nbconvert"),
                        ("ipykernel", "python3-ipykernel"), ("matplotlib", "python3-matplotlib")):
    try:
        importlib.import_module(module)
    except ImportError:
        print(f" {package} ({module} of /usr/bin/python3)", end="")
CHECK
)
command -v doxygen >/dev/null || missing+=' doxygen'
[[ -z $missing ]] || { echo "the site needs what is not there:$missing" >&2; exit 1; }
[[ ${1:-} != --needs ]] || exit 0
source=$1 build=$2 python=${3:-}
pages=$build/source
rm -rf "$pages"
mkdir -p "$pages" "$build/xml"
cp -r "$source"/reports/site/{conf.py,static,samples,notebooks,results,*.md} "$pages"
rm "$pages/README.md"

# All headers with their folders, in which the reference looks its public ones up.
{
  cat "$source/reports/site/Doxyfile"
  printf 'INPUT = %s %s %s\nFILE_PATTERNS = *.h\nRECURSIVE = YES\n' "$source"/{markov,dynamics,analysis}
  printf 'STRIP_FROM_PATH = %s\nOUTPUT_DIRECTORY = %s\n' "$source" "$build"
} | doxygen - >"$build/doxygen.log" 2>&1 || { tail -20 "$build/doxygen.log" >&2; exit 1; }

# Doxygen knows a header by its name alone; the pages say how it is included.
sed -i '/<includes /d' "$build"/xml/{class,struct}*.xml

if [[ -n $python ]]; then
  export PYTHONPATH=$python
  cp "$source"/reports/site/gallery/*.ipynb "$pages"/
  (cd "$pages" && /usr/bin/python3 -m nbconvert --to markdown --execute ./*.ipynb) >"$build/gallery.log" 2>&1 ||
    { tail -20 "$build/gallery.log" >&2; exit 1; }
  rm "$pages"/*.ipynb
fi

METASTABLE_SOURCE=$source METASTABLE_XML=$build/xml \
  /usr/bin/python3 -m sphinx -q -b html -j auto "$pages" "$build/html" 2>"$build/sphinx.log" ||
  { cat "$build/sphinx.log" >&2; exit 1; }
grep -F .md: "$build/sphinx.log" | grep -v reference/ >&2 || true
