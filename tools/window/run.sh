#!/bin/sh
# Sanguine in the window of a real Blender: tools/window/run.sh CHROOT OUT [TOUR ...]
#
# CHROOT is a folder with Debian 13, whose Blender is 4.3.2 on Python 3.13; it is made when it is missing (root,
# debootstrap, 1.5 GB, some minutes). The extension's zip, freshly built, is installed there with Blender's own tool;
# Blender is started on a virtual screen and driven by a mouse and a keyboard (tour.py). OUT gets the screenshots and
# Blender's log; with KEEP=1 the pictures in docs/ are made of them. Needs the zip in dist/ and .venv: `make window` sees to both.
set -eu
cd "$(dirname "$0")/../.."
. tools/debian.sh
root=$1 out=$2
shift 2

window_folder "$root"

mkdir -p "$out"
root=$(realpath "$root") out=$(realpath "$out")
work=$root/tmp/sanguine
rm -rf "$work"
mkdir -p "$work"
cp dist/sanguine-*.zip tools/window/bridge.py tools/window/screen.py tools/window/tour.py "$work"
python=${SCENE_PYTHON:-.venv/bin/python}
"$python" tools/window/make_scene.py "$work/scene.blend"
"$python" tools/window/make_scene.py --own "$work/character.blend"

# A private mount namespace: nothing stays mounted, whatever happens.
set +e
# shellcheck disable=SC2016 # for the shell inside
root=$root unshare --mount sh -c '
    mount -t proc proc "$root/proc" && mount --bind /dev "$root/dev" &&
    exec chroot "$root" env --chdir=/tmp/sanguine PWD=/tmp/sanguine HOME=/tmp/sanguine/home LANG=C.UTF-8 python3 tour.py "$@"' sh "$@"
status=$?
set -e
cp -r "$work"/shots/. "$work"/*.log "$work"/clicks.* "$out" 2>/dev/null || true
if [ "$status" -eq 0 ] && [ -n "${KEEP:-}" ]; then
    "$python" tools/window/keep.py "$out" docs
fi
exit $status
