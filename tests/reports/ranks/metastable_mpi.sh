#!/usr/bin/env bash
# metastable-mpi on two ranks: a sweep's bytes are those of one process, a mesh's steps too; wrong options and files
# that cannot be written end with one line and exit code 2.
# arguments: metastable, metastable-mpi, mpirun, a folder to work in
set -u
one=$1 shared=$2 mpirun=$3
rm -rf "$4" && mkdir -p "$4" && cd "$4" || exit 1
failed=0
fault() { echo "$1"; failed=1; }
ranks() { "$mpirun" -q -n "$1" --oversubscribe "$shared" "${@:2}"; }

same_sweep() {  # arguments: a name, the sweep's options
  "$one" sweep "${@:2}" --out "$1-one.csv" >/dev/null || fault "$1: one process fails"
  ranks 2 sweep "${@:2}" --out "$1-two.csv" >/dev/null || fault "$1: two ranks fail"
  cmp "$1-one.csv" "$1-two.csv" && cmp "$1-one.svg" "$1-two.svg" || fault "$1: the bytes differ"
}
same_sweep wheel --slope 8:9.5:0.25 --initial-speed 5.5,0.3 --method integrated
same_sweep walker --walker simplest --slope-sd 0.1,0.11 --spacing 1.2 --simulated-steps 0

# Cut short after two points, and gone on with by three ranks.
head -n $(($(grep -c '^#' wheel-one.csv) + 3)) wheel-one.csv >cut.csv.partial
ranks 3 sweep --slope 8:9.5:0.25 --initial-speed 5.5,0.3 --method integrated --out cut.csv | grep -q '(2 taken over)' ||
  fault 'the sweep was not taken up again'
cmp wheel-one.csv cut.csv || fault 'taken up again, the bytes differ'

# On the coarsest mesh of `steps`, unshifted, one process finds the same steps: both follow the survivors until the rate of
# failure changes by less than 1e-9 of itself, which leaves the steps some 1e-7 of theirs.
mesh=(--walker compass --slope-sd 0.7 --spacing 2)
ranks 2 mesh "${mesh[@]}" --json mesh.json >mesh.txt || fault 'mesh fails'
"$one" steps "${mesh[@]}" --simulated-steps 0 --json steps.json >/dev/null || fault 'steps fails'
shared_steps=$(sed -n '/"expected_steps"/,/}/s/.*"value": \([0-9.e+]*\),*/\1/p' mesh.json)
own_steps=$(sed -n '/"meshes"/,$p' steps.json | sed -n '/"steps": \[/{n;s/[ ,]//g;p;q}')
awk -v a="$shared_steps" -v b="$own_steps" 'BEGIN { exit !(b > 0 && (a / b - 1) ^ 2 < 1e-12) }' ||
  fault "expected steps on one mesh: '$shared_steps' by two ranks, '$own_steps' by one process"

refused() {  # arguments: what the line must hold, then those of metastable-mpi
  local said code
  said=$(ranks 2 "${@:2}" 2>&1 >/dev/null)
  code=$?
  [[ $code == 2 && $(wc -l <<<"$said") == 1 && $said == *"$1"* ]] ||
    fault "${*:2}: exit code $code, '$said'; 2 and one line with '$1' are wanted"
}
refused '--spacing: is needed' mesh --walker compass --slope-sd 0.5
refused '--walker: is needed' mesh
refused '--spacing: has a meaning with --walker only' mesh --spacing 1
refused 'none of the subcommands mesh, sweep' steps
refused '--slope-sd' mesh --walker compass --slope-sd 50 --spacing 1
refused 'no-such-folder' mesh --walker compass --slope-sd 0.5 --spacing 1 --json no-such-folder/mesh.json
refused 'no-such-folder' sweep --slope 8:9:0.5 --initial-speed 5.5,0.3 --out no-such-folder/sweep.csv
refused '--threads' sweep --slope 8:9:0.5 --initial-speed 5.5,0.3 --threads 2

said=$(ranks 2 mesh --walker compass --slope-sd 0.5 --spacing 0.3 --memory 0.001 2>&1 >/dev/null)
[[ $? == 3 && $said == *'takes more than 0.001 GB'* ]] || fault "a mesh beyond --memory: '$said'"
exit $failed
