#!/usr/bin/env bash
# What the program prints does not depend on the processor: a handful of commands print the same text on this one, without
# fused multiply-adds and AVX2 in the C library (glibc's tunables), and on those that qemu emulates, which choose among the
# program's own compiled versions too. By hand; needs qemu-user. Arguments: the program, and a pattern of the processors'
# names if not all are wanted ('this|plain' are those without qemu: one minute; all take about a quarter of an hour).
set -uo pipefail
program=$(readlink -f -- "${1:-build/release/reports/metastable}") wanted=${2:-.}
[[ -x $program ]] || { echo "processors.sh: $program is no program" >&2; exit 2; }

# name: how the program is called
processors=(
  'this:'
  'plain:env GLIBC_TUNABLES=glibc.cpu.hwcaps=-AVX2,-FMA'
  'nehalem:qemu-x86_64 -cpu Nehalem'
  'haswell:qemu-x86_64 -cpu Haswell'
  'max:qemu-x86_64 -cpu max'
)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
failed=0

say_all() {  # in the current folder, with the caller's $call
  run() {
    echo "\$ metastable $*"
    $call "$program" "$@" --threads 2 2>&1 || echo "exit code $?"
  }
  run steps --cells 32 --samples 64
  run steps --slope 9.59 --friction 0.3,0.05 --cells 32 --samples 64 --how-it-fails
  run steps --law coulomb --slope 6 --cells 32 --samples 64
  run steps --law plastic --slope 4 --cells 32 --samples 64
  run steps --slope 9.59 --method integrated --cells 64
  run compare --slopes 7.02,9.59 --cells 32 --samples 64
  run steps --walker simplest --slope-sd 0.1 --spacing 1.2 --simulated-steps 20000
  run simulate --slope 9.59 --law published --reality --effect leg_contact:leg=3,friction_ratio=1.6 --friction 0.3,0.04 \
    --restitution 0.5,0.05 --trials 40 --collisions 6 --sensor-noise 0.01 --out wheel
  run describe wheel --out described
  # Leg lengths contain the waves of an eccentric hub: what is left of one beside the other is rounding.
  run diagnose wheel --catalogue leg_contact,leg_lengths,hub_eccentricity
}

# Under settled a table of motions is worked out first, which would take an emulator an hour.
say_settled() {
  echo '$ metastable steps --law settled'
  $call "$program" steps --law settled --cells 16 --samples 32 --threads 2 2>&1 || echo "exit code $?"
}

for processor in "${processors[@]}"; do
  name=${processor%%:*} call=${processor#*:}
  [[ $name =~ ^($wanted)$ || $wanted == . ]] || continue
  if [[ $call == qemu* ]] && ! command -v qemu-x86_64 >/dev/null; then
    echo "$name: left out, it needs qemu-user"
    continue
  fi
  mkdir "$work/$name" && cd "$work/$name" || exit 1
  began=$SECONDS
  # What qemu says of features that it lacks is no word of the program's.
  say_all | grep -v 'TCG doesn.t support' >"$work/$name.txt"
  [[ $call == qemu* ]] || say_settled >"$work/$name.settled.txt"
  echo "$name: $((SECONDS - began)) s"
  first=${first:-$name}
  for text in "" .settled; do
    [[ -e $work/$name$text.txt ]] || continue
    diff "$work/$first$text.txt" "$work/$name$text.txt" || { echo "$name says otherwise than $first"; failed=1; }
  done
done
[[ -n ${first:-} ]] || { echo "processors.sh: no processor is called '$wanted'" >&2; exit 2; }
exit "$failed"
