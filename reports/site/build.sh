#!/usr/bin/env bash
# Builds the site: build.sh SOURCE BUILD [PYTHON]; SOURCE is the tree, BUILD a folder for it, PYTHON where the Python
# module is, if it is. `./run docs` calls this.
set -euo pipefail
source=$1 build=$2 python=${3:-}
command -v doxygen >/dev/null || { echo 'the site needs doxygen' >&2; exit 1; }
for module in sphinx myst_parser furo breathe ${python:+nbconvert ipykernel matplotlib}; do
  /usr/bin/python3 -c "import $module" 2>/dev/null || { echo "the site needs $module for /usr/bin/python3" >&2; exit 1; }
done
pages=$build/source
rm -rf "$pages"
mkdir -p "$pages" "$build/xml"
cp -r "$source"/reports/site/{conf.py,static,*.md} "$pages"
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
