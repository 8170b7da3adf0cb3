#!/bin/bash
# Tries Talbot on a fresh Debian of another release, in a tree of its own:
#   tests/tools/debian_tree.sh SUITE DIRECTORY [COMMAND...]     (as root; SUITE: bookworm, trixie, sid)
# makes the tree with debootstrap when DIRECTORY is not there yet, puts a clean clone of this repository into it, and runs
# COMMAND (default: ./talbot render -o /root/picture.png) there. The clone keeps its build folder from one call to the next.
set -euo pipefail
if [ $# -lt 2 ] || [ "$(id -u)" != 0 ]; then
  sed -n '2,5s/^# //p' "$0" >&2
  exit 2
fi
suite=$1
tree=$(readlink -m "$2")
shift 2
[ $# -gt 0 ] || set -- ./talbot render -o /root/picture.png
root=$(cd "$(dirname "$(readlink -f "$0")")/../.." && pwd)

command -v debootstrap >/dev/null || apt-get install -y -q --no-install-recommends debootstrap
[ -x "$tree/bin/bash" ] || debootstrap --variant=minbase --include=ca-certificates "$suite" "$tree"
# What the network asks of this machine, it asks of the tree: name servers, certificates, pip's settings.
cp /etc/resolv.conf "$tree/etc/resolv.conf"
if compgen -G '/usr/local/share/ca-certificates/*.crt' > /dev/null; then
  cp /usr/local/share/ca-certificates/*.crt "$tree/usr/local/share/ca-certificates/"
  chroot "$tree" update-ca-certificates > /dev/null 2>&1
fi
[ ! -f /etc/pip.conf ] || cp /etc/pip.conf "$tree/etc/pip.conf"
# A mirror may lag behind: sid's lists are good for a week only.
echo 'Acquire::Check-Valid-Until "false";' > "$tree/etc/apt/apt.conf.d/90mirror-may-lag"

# Brought up to date rather than unpacked anew: untouched files keep their times, so the next build is short.
clone=$tree/root/talbot
[ -d "$clone/.git" ] || git clone -q --no-hardlinks "$root" "$clone"
git -C "$clone" fetch -q "$root" HEAD
git -C "$clone" reset -q --hard FETCH_HEAD

leave() {
  umount -l "$tree/dev" "$tree/proc" "$tree/sys" 2>/dev/null || true
}
trap leave EXIT
mount --rbind /dev "$tree/dev" && mount --make-rslave "$tree/dev"
mount -t proc proc "$tree/proc"
mount -t sysfs sysfs "$tree/sys" || true
env -i HOME=/root TERM="${TERM-dumb}" PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin LC_ALL=C.UTF-8 \
  chroot "$tree" /bin/bash -c 'cd /root/talbot && "$@"' talbot "$@"
