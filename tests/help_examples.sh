#!/usr/bin/env bash
# The examples of --help run as they are pasted, in one folder in the order of the commands. An example runs once, whatever
# number of commands shows it; not at all where another one of its command is the same with --out, or where a page of the
# documentation runs it and no later example needs its files. Studies by sampling are made of few cells: what is asked is
# whether an example runs.
# help_examples.sh FOLDER COMMAND...; FOLDER is where the program is.
set -u
pages=$(realpath "$(dirname -- "${BASH_SOURCE[0]}")/..")
PATH=$(realpath "$1"):$PATH
shift
folder=$(mktemp -d)
trap 'rm -r "$folder"' EXIT
cd "$folder" || exit
failed=0
declare -A ran

shown_on_a_page() {  # arguments: an example
  [[ $1 =~ ^metastable\ (steps|compare|sweep|solve|describe)\  ]] &&
    grep -qxF -- "\$ $1" "$pages"/README.md "$pages"/reports/site/*.md
}

few_cells() {  # arguments: an example
  [[ ! $1 =~ ^metastable\ (steps|compare|sweep)\  || $1 == *integrated* ]] || printf ' --cells 24 --samples 256'
}

for command in "$@"; do
  lines=()
  while read line; do  # without -r: lines that end with a backslash are joined
    lines+=("$line")
  done < <(metastable "$command" --help | sed -n '/^Examples$/,/^$/{//d;s/ *# .*//;p}')
  for line in "${lines[@]}"; do
    [[ -z ${ran[$line]:-} ]] || continue
    ran[$line]=1
    [[ $(printf '%s\n' "${lines[@]}") != *"$line --out "* ]] || continue
    ! shown_on_a_page "$line" || continue
    if ! said=$(bash -eu -c "$line$(few_cells "$line")" 2>&1 >/dev/null </dev/null); then
      printf 'an example of metastable %s --help fails: %s\n%s\n' "$command" "$line" "$said"
      failed=1
    fi
  done
  if ((${#lines[@]} == 0)); then
    printf 'metastable %s --help shows no example\n' "$command"
    failed=1
  fi
done
exit "$failed"
