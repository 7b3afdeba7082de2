#!/usr/bin/env bash
# Every command of the README runs on Debian 12 with nothing but git. A bare system is made in a temporary folder by
# debootstrap from the mirror of this machine's own apt, the repository's last commit is cloned into it, the commands run in
# it by chroot, and it is removed. By hand, before a release: root, debootstrap, 6 GB and some 40 minutes of two cores.
# Arguments: the commands, if not all are wanted (report test install python test-mpi docs).
set -uo pipefail
root=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd)
commands=("$@")
(($#)) || commands=(report test install python test-mpi docs)
die() { echo "bare_machine.sh: $1" >&2; exit 2; }
((EUID == 0)) || die 'root is needed, to make a system and to enter it'
command -v debootstrap >/dev/null || die 'debootstrap is needed'

# The mirror that apt has of this distribution's main archive: its address ends with the release's name in apt's lists.
mirror=$(apt-get indextargets --format '$(SITE) $(RELEASE) $(COMPONENT)' | awk '$2 == "bookworm" && $3 == "main" { print $1; exit }')
[[ -n $mirror ]] || die "apt of this machine has no source of Debian's bookworm, main"

work=$(mktemp -d)
bare=$work/bare
clean_up() {
  for at in proc sys dev; do mountpoint -q "$bare/$at" && umount -l "$bare/$at"; done
  rm -rf --one-file-system "$work"
}
trap clean_up EXIT
echo "==> making a bare system from $mirror"
debootstrap --variant=minbase --include=git,ca-certificates bookworm "$bare" "$mirror" >"$work/debootstrap.log" 2>&1 ||
  { tail -20 "$work/debootstrap.log"; die 'debootstrap failed'; }
# As this machine reaches its mirror: sources, keys, proxies, names and certificates.
cp -a /etc/apt/. "$bare/etc/apt/"
cp -L /etc/resolv.conf /etc/hosts "$bare/etc/" 2>/dev/null
cp -a /usr/local/share/ca-certificates/. "$bare/usr/local/share/ca-certificates/" 2>/dev/null
mount --bind /dev "$bare/dev" && mount -t proc proc "$bare/proc" && mount -t sysfs sysfs "$bare/sys" || die 'mounting failed'
in_bare() { env -i HOME=/root TERM=dumb PATH=/usr/sbin:/usr/bin:/sbin:/bin LC_ALL=C.UTF-8 chroot "$bare" "$@"; }
in_bare update-ca-certificates >/dev/null 2>&1
git clone -q --no-hardlinks "$root" "$bare/root/metastable" || die 'cloning failed'

failed=()
for command in "${commands[@]}"; do
  began=$SECONDS
  echo "==> ./run $command"
  if in_bare bash -c "cd /root/metastable && ./run $command" >"$work/$command.log" 2>&1; then
    echo "==> ./run $command: passed in $((SECONDS - began)) s"
    grep -E '^-- |left out|tests passed' "$work/$command.log"
  else
    echo "==> ./run $command: FAILED after $((SECONDS - began)) s; it said last:"
    tail -40 "$work/$command.log"
    failed+=("$command")
  fi
done
if ((${#failed[@]})); then
  echo "On a bare machine these fail: ${failed[*]}"
  exit 1
fi
echo "On a bare machine these pass: ${commands[*]}"
