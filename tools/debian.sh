# shellcheck shell=sh
# A Debian in a folder: sourced by tools/matrix.sh, tools/window/run.sh and tools/chroots/run.sh, from the top of the
# tree. Root and debootstrap.

# debian_folder SUITE FOLDER NAME PACKAGE ...: makes it unless it is there and complete. NAME marks what it is complete
# for, so that a change of the packages makes only what is missing.
debian_folder() {
    suite=$1 folder=$2 name=$3
    shift 3
    [ ! -e "$folder/.complete-$name" ] || return 0
    command -v debootstrap >/dev/null || apt-get install --yes --no-install-recommends debootstrap
    if [ ! -e "$folder/.debootstrapped" ]; then
        rm -rf "$folder"
        mkdir -p "$(dirname "$folder")"
        debootstrap --variant=minbase "$suite" "$folder" "${DEBIAN_MIRROR:-http://deb.debian.org/debian}"
        touch "$folder/.debootstrapped"
    fi
    cp /etc/apt/apt.conf.d/* "$folder/etc/apt/apt.conf.d/" # the machine's proxy, if it has one
    # shellcheck disable=SC2016 # $root and $@ are for the shell inside
    root=$(realpath "$folder") unshare --mount sh -ec '
        mount -t proc proc "$root/proc"
        export DEBIAN_FRONTEND=noninteractive
        chroot "$root" apt-get update
        chroot "$root" apt-get install --yes --no-install-recommends "$@"' sh "$@"
    touch "$folder/.complete-$name"
}

# window_folder FOLDER: Debian 13 with the real Blender 4.3.2, a virtual screen, a mouse and what reads the screen.
window_folder() {
    debian_folder trixie "$1" window blender python3-numpy xvfb libgl1-mesa-dri imagemagick xdotool tesseract-ocr \
        tesseract-ocr-eng
}

# What a Blender without a window is linked to.
blender_libraries() {
    sed -n "s/^blender='\(.*\)'/\1/p" tools/install_system_packages.sh
}
