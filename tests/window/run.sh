#!/bin/sh
# Drives Blender's window under a virtual display and takes screenshots to be looked at by a person.
#
#     tests/window/run.sh OUTPUT_FOLDER [FILE.blend]
#
# Needs xvfb, imagemagick and xdotool (which presses Escape). The Blender that `./talbot blender` starts is used; BLENDER=path chooses another.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
output=$1
file=${2:-}
mkdir -p "$output"
output=$(cd "$output" && pwd)
for tool in xvfb-run import xdotool; do
    command -v "$tool" >/dev/null || { echo "$tool is missing: apt-get install xvfb xauth imagemagick xdotool" >&2; exit 2; }
done
set -- --factory-startup --window-geometry 0 0 1280 1000 ${file:+"$file"} --python "$here/session.py" -- "$output"
if [ -n "${BLENDER:-}" ]; then
    exec xvfb-run -a -s "-screen 0 1280x1000x24" "$BLENDER" --addons talbot "$@"
fi
exec xvfb-run -a -s "-screen 0 1280x1000x24" "$here/../../talbot" blender "$@"
