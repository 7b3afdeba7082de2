#!/usr/bin/env bash
# `./run` refuses wrong arguments with exit code 2 and a line that names them, before it builds anything. The site's
# script says what it misses.
set -u
run=$1/run
failed=0

refused() {  # arguments: what the message must hold, then those of ./run
  local wanted=$1 said code
  shift
  said=$("$run" "$@" 2>&1 >/dev/null)
  code=$?
  if [[ $code != 2 || $said != *"$wanted"* ]]; then
    printf './run %s: exit code %s, "%s"; 2 and "%s" are wanted\n' "$*" "$code" "$said" "$wanted"
    failed=1
  fi
}

refused "unknown command 'nonsense'" nonsense
refused "'all' is no argument of it" build all
refused "'here' is no argument of it" docs here
refused "'here' is none of its arguments" install here
refused '--prefix needs a folder' install --prefix
refused '--prefix needs a folder' python --prefix=
refused "python: 'here' is none of its arguments" python here
refused '--prefix needs a folder' install --prefix=
refused 'is no folder' install --prefix "$run"

help=$("$run" help) || failed=1
[[ $help == *'install [--prefix P]'* ]] || { echo './run help does not name install'; failed=1; }

# What the site needs and is not there is said in one line, with its package.
hidden=$(mktemp -d)
echo 'raise ImportError' | tee "$hidden/furo.py" >"$hidden/breathe.py"
said=$(PYTHONPATH=$hidden bash "$1/reports/site/build.sh" --needs 2>&1) && { echo 'build.sh needs no furo'; failed=1; }
rm -r "$hidden"
[[ $said == 'the site needs what is not there:'*' furo (furo of '*' python3-breathe ('* && $said != *$'\n'* ]] ||
  { printf 'build.sh --needs says "%s"\n' "$said"; failed=1; }
exit $failed
