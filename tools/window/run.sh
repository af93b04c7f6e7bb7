#!/bin/sh
# Sanguine in the window of a real Blender: tools/window/run.sh CHROOT OUT [TOUR ...]
#
# CHROOT is a folder with Debian 13, whose Blender is 4.3.2 on Python 3.13; it is made when it is missing (root,
# debootstrap, 1.5 GB, some minutes). The extension's zip, freshly built, is installed there with Blender's own tool;
# Blender is started on a virtual screen and driven by a mouse and a keyboard (tour.py). OUT gets the screenshots and
# Blender's log. Needs the zip in dist/ and .venv: `make window` sees to both.
set -eu
cd "$(dirname "$0")/../.."
root=$1 out=$2
shift 2

if [ ! -e "$root/.complete-window" ]; then
    command -v debootstrap >/dev/null || apt-get install --yes --no-install-recommends debootstrap
    [ -e "$root/bin/sh" ] || debootstrap --variant=minbase trixie "$root" "${DEBIAN_MIRROR:-http://deb.debian.org/debian}"
    cp /etc/apt/apt.conf.d/* "$root/etc/apt/apt.conf.d/" # the machine's proxy, if it has one
    # shellcheck disable=SC2016 # $PATH and $@ are for the shell inside
    root=$(realpath "$root") unshare --mount sh -ec '
        mount -t proc proc "$root/proc"
        export DEBIAN_FRONTEND=noninteractive
        chroot "$root" apt-get update
        chroot "$root" apt-get install --yes --no-install-recommends \
            blender python3-numpy xvfb libgl1-mesa-dri imagemagick xdotool tesseract-ocr tesseract-ocr-eng'
    touch "$root/.complete-window"
fi

mkdir -p "$out"
root=$(realpath "$root") out=$(realpath "$out")
work=$root/tmp/sanguine
rm -rf "$work"
mkdir -p "$work"
cp dist/sanguine-*.zip tools/window/bridge.py tools/window/screen.py tools/window/tour.py "$work"
"${SCENE_PYTHON:-.venv/bin/python}" tools/window/make_scene.py "$work/scene.blend"

# A private mount namespace: nothing stays mounted, whatever happens.
set +e
root=$root unshare --mount sh -c '
    mount -t proc proc "$root/proc" && mount --bind /dev "$root/dev" &&
    exec chroot "$root" env --chdir=/tmp/sanguine PWD=/tmp/sanguine HOME=/tmp/sanguine/home LANG=C.UTF-8 python3 tour.py "$@"' sh "$@"
status=$?
set -e
cp -r "$work"/shots/. "$work"/*.log "$out" 2>/dev/null || true
exit $status
