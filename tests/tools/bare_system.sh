#!/bin/bash
# Tries the packaged native module on a Debian that has nothing but a minimal system, Python and numpy:
#   tests/tools/bare_system.sh SUITE DIRECTORY [WHEEL]     (as root; SUITE: bookworm, trixie)
# makes the tree with debootstrap when DIRECTORY is not there yet, makes sure that no development package, X11 or GLib is in it,
# unpacks WHEEL (default: the one in dist/) and renders a picture of each format with it. Blender itself needs X11's libraries,
# so there is none here: the module is called from Python.
set -euo pipefail
if [ $# -lt 2 ] || [ $# -gt 3 ] || [ "$(id -u)" != 0 ]; then
  sed -n '2,6s/^# //p' "$0" >&2
  exit 2
fi
suite=$1
tree=$(readlink -m "$2")
root=$(cd "$(dirname "$(readlink -f "$0")")/../.." && pwd)
if [ $# = 3 ]; then wheels=("$3"); else wheels=("$root"/dist/talbot-*.whl); fi
wheel=$(readlink -f "${wheels[-1]}")
[ -f "$wheel" ] || { echo "There is no wheel in $root/dist: ./talbot package makes it." >&2; exit 1; }

command -v debootstrap >/dev/null || apt-get install -y -q --no-install-recommends debootstrap
[ -x "$tree/bin/bash" ] || debootstrap --variant=minbase --include=python3,python3-numpy "$suite" "$tree"
# Debian 13's numpy brings its own headers along.
chroot "$tree" dpkg --purge --force-depends python3-numpy-dev >/dev/null 2>&1

installed=$(chroot "$tree" dpkg-query -W -f='${Package}\n')
unwanted=$(grep -E -e '-dev$|^libx11|^libxcb|^libglib2|^libgl1|embree|libtbb|openimageio|opencolorio' <<<"$installed" || true)
if [ -n "$unwanted" ]; then
  printf 'This tree is not bare:\n%s\n' "$unwanted" >&2
  exit 1
fi

place=$tree/root/packaged
rm -rf "$place"
mkdir -p "$place/site"
cp "$wheel" "$root/tests/packaged/without_blender.py" "$place"
cp -r "$root/tests/packaged/pictures" "$place"
leave() {
  umount -l "$tree/proc" 2>/dev/null || true
}
trap leave EXIT
mount -t proc proc "$tree/proc"
# shellcheck disable=SC2016
env -i HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin LC_ALL=C.UTF-8 PYTHONPATH=/root/packaged/site PYTHONDONTWRITEBYTECODE=1 chroot "$tree" /bin/bash -ec '
  cd /root/packaged
  python3 -m zipfile -e talbot-*.whl site
  . /etc/os-release
  echo "$PRETTY_NAME, $(dpkg-query -W -f="\n" | wc -l) packages, $(ldd --version | head -n 1)"
  python3 without_blender.py'
