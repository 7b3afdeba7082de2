#!/usr/bin/env bash
# The examples of --help run as they are pasted, those of each command in an empty folder of its own.
# help_examples.sh FOLDER COMMAND...; FOLDER is where the program is.
set -u
PATH=$1:$PATH
shift
failed=0
for command in "$@"; do
  folder=$(mktemp -d)
  metastable "$command" --help | sed -n '/^Examples$/,/^$/{//d;s/^  //p}' >"$folder.sh"
  if [[ ! -s $folder.sh ]]; then
    printf 'metastable %s --help shows no example\n' "$command"
    failed=1
  elif ! said=$(cd "$folder" && bash -eu "$folder.sh" 2>&1 >/dev/null); then
    printf 'an example of metastable %s --help fails: %s\n' "$command" "$said"
    failed=1
  fi
  rm -r "$folder" "$folder.sh"
done
exit $failed
