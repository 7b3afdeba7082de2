#!/usr/bin/env bash
# The examples of --help run as they are pasted, in one folder in the order of the commands; what several commands show,
# as the experiment folder to try, runs once.
# help_examples.sh FOLDER COMMAND...; FOLDER is where the program is.
set -u
PATH=$(realpath "$1"):$PATH
shift
folder=$(mktemp -d)
trap 'rm -r "$folder"' EXIT
cd "$folder" || exit
failed=0
declare -A ran
for command in "$@"; do
  shown=0
  while read line; do  # without -r: lines that end with a backslash are joined
    shown=1
    [[ -z ${ran[$line]:-} ]] || continue
    ran[$line]=1
    if ! said=$(bash -eu -c "$line" 2>&1 >/dev/null </dev/null); then
      printf 'an example of metastable %s --help fails: %s\n%s\n' "$command" "$line" "$said"
      failed=1
    fi
  done < <(metastable "$command" --help | sed -n '/^Examples$/,/^$/{//d;s/ *# .*//;p}')
  if [[ $shown == 0 ]]; then
    printf 'metastable %s --help shows no example\n' "$command"
    failed=1
  fi
done
exit "$failed"
