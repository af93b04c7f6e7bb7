#!/bin/sh
# Run the Blender tests on other Blender versions, each in an environment of its
# own (.venv-<version>): tools/matrix.sh 4.2.23 5.0.1 5.2.3
#
# TESTS="tests/e2e ..." runs fewer of them.
#
# Blender 5.1 and later need Python 3.13. Where the system has none, a Debian 13
# folder (.cache/trixie) provides it, which needs root and debootstrap.
set -eu
cd "$(dirname "$0")/.."
. tools/debian.sh

# A Python 3.13 that runs: on the path, or among pyenv's, whose shim on the path
# may answer without having one selected.
find_python_3_13() {
    for candidate in python3.13 "${PYENV_ROOT:-$HOME/.pyenv}"/versions/3.13.*/bin/python3.13; do
        if "$candidate" -c '' 2>/dev/null; then
            command -v "$candidate"
            return
        fi
    done
    return 1
}

# Prepare the Debian 13 folder and run the given command in it, in this directory.
in_trixie() {
    root=.cache/trixie
    # shellcheck disable=SC2046 # the names are separate words on purpose
    debian_folder trixie "$root" matrix ca-certificates python3-venv $(blender_libraries)
    # A private mount namespace: nothing stays mounted, whatever happens.
    # shellcheck disable=SC2016 # for the shell inside
    root=$(realpath "$root") here=$(pwd) unshare --mount sh -ec '
        mkdir -p "$root$here" "$root/etc/ssl/certs"
        mount -t proc proc "$root/proc"
        mount --bind /dev "$root/dev"
        mount --bind "$here" "$root$here"
        mount --bind /etc/ssl "$root/etc/ssl"
        cp /etc/resolv.conf "$root/etc/"
        exec chroot "$root" env --chdir="$here" "$@"' sh "$@"
}

run_version() {
    version=$1
    case "$version" in
        4.* | 5.0.*) base_python=/usr/bin/python3.11 run='' numpy='numpy<2' ;;
        *)
            numpy='numpy>=2'
            if base_python=$(find_python_3_13); then run=''; else base_python=python3.13 run=in_trixie; fi
            ;;
    esac
    venv=.venv-$version
    python=$venv/bin/python
    # The Python counts too: one inside Debian 13 does not run outside, nor the reverse.
    stamp=$venv/.installed-$({
        cat tools/requirements-*.txt addon/pyproject.toml tools/matrix.sh
        echo "$run $base_python"
    } | sha256sum | cut -c1-16)
    if [ ! -e "$stamp" ]; then
        rm -rf "$venv"
        $run "$base_python" -m venv "$venv"
        # The pins of the main environment, except bpy and NumPy: each Blender has its own generation of it.
        grep -hvE '^(bpy|numpy|-r )' tools/requirements-addon.txt tools/requirements-run.txt \
            tools/requirements-test.txt >"$venv/pins.txt"
        grep -hE '^(setuptools|wheel)=' tools/requirements-build.txt >>"$venv/pins.txt"
        $run "$python" -m pip install --quiet --no-deps --requirement "$venv/pins.txt"
        $run "$python" -m pip install --quiet "bpy==$version" "$numpy"
        touch "$stamp"
    fi
    $run "$python" -m pip install --quiet --no-deps --force-reinstall dist/wheels/sanguine_core-*.whl
    $run "$python" -m pip install --quiet --no-deps --no-build-isolation --editable addon
    # shellcheck disable=SC2086 # the folders are separate words on purpose
    $run "$python" -m pytest ${TESTS:-tests/blender tests/e2e tests/render}
}

failed=''
for version in "$@"; do
    echo "== Blender $version" >&2
    # Not `run_version || ...`: a condition would switch `set -e` off inside it.
    set +e
    (
        set -e
        run_version "$version"
    )
    # shellcheck disable=SC2181 # a condition would switch `set -e` off
    [ $? -eq 0 ] || failed="$failed $version"
    set -e
done
[ -z "$failed" ] || { echo "Failed on Blender:$failed" >&2; exit 1; }
