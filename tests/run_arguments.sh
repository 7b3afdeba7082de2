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

# What the site needs and is not there is said in one line, with its package. Where there is no Python, as on a machine
# that has built nothing but the program, it is Python itself.
needs() {  # arguments: a folder of modules that come first, the script
  PYTHONPATH=$1 bash "$2" --needs 2>&1
}
hidden=$(mktemp -d)
echo 'raise ImportError' | tee "$hidden/furo.py" >"$hidden/breathe.py"
said=$(needs "$hidden" "$1/reports/site/build.sh") && { echo 'build.sh needs no furo'; failed=1; }
[[ -x /usr/bin/python3 ]] && wanted='*: *furo (furo of * python3-breathe (*' || wanted='*: python3*'
# shellcheck disable=SC2053 # a pattern
[[ $said == 'the site needs what is not there:'* && $said == $wanted && $said != *$'\n'* ]] ||
  { printf 'build.sh --needs says "%s"\n' "$said"; failed=1; }
sed "s|/usr/bin/python3|$hidden/none|g" "$1/reports/site/build.sh" >"$hidden/build.sh"
said=$(needs "$hidden" "$hidden/build.sh") && { echo 'build.sh needs no Python'; failed=1; }
[[ $said == 'the site needs what is not there: python3'* && $said != *$'\n'* ]] ||
  { printf 'build.sh --needs says "%s" without Python\n' "$said"; failed=1; }
rm -r "$hidden"
exit $failed
