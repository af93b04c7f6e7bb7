#!/bin/sh
# The extension's zip in bare Debians: tools/chroots/run.sh CHROOTS WINDOW [ROOM ...]
#
#   bookworm  Debian 12, Python 3.11, bpy 4.5
#   trixie    Debian 13, Python 3.13, bpy 5.2
#   window    Debian 13 with the real Blender 4.3.2, the folder of `make window`
#
# CHROOTS holds the first two and pip's wheels of bpy; what is missing is made (root, debootstrap, some 2 GB each). A
# room has Blender and what Blender is linked to, no compiler and no image library of ours, and while the zip is in it
# no network. Packages of Python are downloaded outside, by the pip of .venv. Needs the zip in dist/: `make chroots`.
set -eu
cd "$(dirname "$0")/../.."
. tools/debian.sh
chroots=$1 window=$2
shift 2
[ $# -gt 0 ] || set -- bookworm trixie window
python=${PYTHON:-.venv/bin/python}
out=out/chroots
rm -rf "$out"
mkdir -p "$chroots" "$out"

# wheels_of ROOM: what pip needs to install bpy there, downloaded once for each of its versions.
wheels_of() {
    case $1 in
        bookworm) tag=3.11 bpy=$(sed -n '/^bpy==/p' tools/requirements-run.txt) numpy='numpy<2' ;;
        trixie) tag=3.13 bpy=bpy==$(sed -n 's/^MATRIX := .*\(5\.2\.[0-9]*\).*/\1/p' Makefile) numpy='numpy>=2' ;;
    esac
    folder=$chroots/wheels/$1-$bpy
    if [ ! -e "$folder" ]; then
        rm -rf "$folder.partial"
        "$python" -m pip download --quiet --only-binary :all: --python-version "$tag" --implementation cp \
            --platform manylinux_2_28_x86_64 --platform manylinux_2_17_x86_64 --platform manylinux2014_x86_64 \
            --dest "$folder.partial" "$bpy" "$numpy"
        mv "$folder.partial" "$folder"
    fi
}

# prepare ROOM: sets $root.
prepare() {
    if [ "$1" = window ]; then
        root=$window
        window_folder "$root"
        return
    fi
    root=$chroots/$1
    # shellcheck disable=SC2046 # the names are separate words on purpose
    debian_folder "$1" "$root" bpy python3 python3-venv $(blender_libraries)
    wheels_of "$1"
    # shellcheck disable=SC2016 # for the shell inside
    [ -e "$root/opt/$bpy" ] || root=$(realpath "$root") wheels=$(realpath "$folder") bpy=$bpy unshare --mount --net sh -ec '
        mount -t proc proc "$root/proc" && mount --bind /dev "$root/dev"
        mkdir -p "$root/mnt/wheels" && mount --bind "$wheels" "$root/mnt/wheels"
        rm -rf "$root/opt/blender"
        inside="chroot $root env --ignore-environment PATH=/usr/bin:/bin"
        $inside python3 -m venv /opt/blender
        $inside /opt/blender/bin/pip install --quiet --no-index --find-links /mnt/wheels bpy
        touch "$root/opt/$bpy"'
}

PATH=$(realpath "$(dirname "$python")"):$PATH
"$python" tools/window/make_scene.py --own "$out/character.blend" >/dev/null
echo '{"skins": [{"id": "light", "melanin": 0.03}, {"id": "dark", "melanin": 0.3, "hemoglobin": 0.05}]}' >"$out/skins.json"
"$python" -c 'import sys; from sanguine.cli.main import main; sys.exit(main(sys.argv[1:]))' \
    skin "$out/skins.json" --out "$out/expected.json"

for room in "$@"; do
    echo "== $room" >&2
    prepare "$room"
    work=$root/tmp/sanguine-chroots
    rm -rf "$work"
    mkdir -p "$work"
    cp dist/sanguine-*.zip tools/chroots/inside.py tools/chroots/check.py \
        "$out/character.blend" "$out/skins.json" "$out/expected.json" "$work"
    # Private namespaces: nothing stays mounted, and there is no network but a loopback that is down.
    # shellcheck disable=SC2016 # $root and $@ are for the shell inside
    root=$(realpath "$root") unshare --mount --net sh -c '
        mount -t proc proc "$root/proc" && mount --bind /dev "$root/dev" && mount -t tmpfs tmpfs "$root/dev/shm" &&
        exec chroot "$root" env --ignore-environment PATH=/usr/bin:/bin LANG=C.UTF-8 \
            python3 -B /tmp/sanguine-chroots/inside.py "$@"' sh "$room" >&2 || echo "$room: inside.py failed" >&2
    cp -r "$work/out" "$out/$room"
    rm -rf "$work"
done
python3 tools/chroots/inside.py --table "$@"
