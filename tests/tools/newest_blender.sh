#!/bin/bash
# Tries Talbot in the newest Blender there is, Debian sid's, in a tree of its own:
#   tests/tools/newest_blender.sh DIRECTORY PICTURES     (as root)
# makes the tree (see debian_tree.sh), builds there, runs `./talbot test`, renders scenes/ and drives the window under a virtual
# display. Rendered pictures and screenshots land in PICTURES, for a person to look at.
set -euo pipefail
if [ $# != 2 ] || [ "$(id -u)" != 0 ]; then
  sed -n '2,5s/^# //p' "$0" >&2
  exit 2
fi
here=$(cd "$(dirname "$(readlink -f "$0")")" && pwd)
tree=$(readlink -m "$1")
mkdir -p "$2"
pictures=$(readlink -f "$2")

inside='
set -euo pipefail
out=/root/pictures
rm -rf "$out" && mkdir "$out"
# For the window, and what the extension system of Debian'\''s Blender needs but does not ask for.
wanted="xvfb xauth imagemagick xdotool libgl1-mesa-dri python3-cattr python3-requests"
dpkg-query -W $wanted >/dev/null 2>&1 || { apt-get update -q && DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends $wanted; }
failed=""
./talbot doctor || failed="$failed doctor"
for scene in scenes/*.py; do
  ./talbot render "$scene" --samples 32 --size 480x270 -o "$out/$(basename "$scene" .py).png" || failed="$failed $scene"
done
./talbot test || failed="$failed test"
tests/window/run.sh "$out/window" || failed="$failed window"
echo "Failed:${failed:- nothing}"
[ -z "$failed" ]
'
status=0
"$here/debian_tree.sh" sid "$tree" bash -c "$inside" || status=$?
cp -r "$tree/root/pictures/." "$pictures"
echo "Look at the pictures in $pictures"
exit $status
