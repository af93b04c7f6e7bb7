#!/bin/sh
# Install what pip cannot give, on Debian or Ubuntu: only what is missing, so
# that a second run touches neither the network nor the package database.
set -eu

python='python3 python3-dev python3-venv'
compiler='g++ make'
libraries='libeigen3-dev libfmt-dev libglm-dev libgtest-dev libimath-dev libopenexr-dev'
# Blender as a module opens no window, but its library is linked to these.
blender='libgl1 libice6 libsm6 libx11-6 libxext6 libxfixes3 libxi6 libxkbcommon0 libxrender1'

if ! command -v dpkg-query >/dev/null; then
    echo "Not a Debian: please see that these (or their likes) are installed: $python $compiler $libraries $blender" >&2
    exit 0
fi

missing=''
for package in $python $compiler $libraries $blender; do
    case "$(dpkg-query --show --showformat='${Status}' "$package" 2>/dev/null)" in
        *' installed') ;;
        *) missing="$missing $package" ;;
    esac
done
[ -n "$missing" ] || exit 0

echo "Installing:$missing" >&2
as_root=''
[ "$(id -u)" -eq 0 ] || as_root=sudo
export DEBIAN_FRONTEND=noninteractive
# The lists may be absent (a container) or old: fetch them only when needed.
# shellcheck disable=SC2086 # the names are separate words on purpose
$as_root apt-get install --yes --no-install-recommends $missing ||
    { $as_root apt-get update && $as_root apt-get install --yes --no-install-recommends $missing; }
