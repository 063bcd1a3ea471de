# shellcheck shell=sh
# Sourced by setup and run: which Vulkan driver will render, and where a newer software one is kept.

# Whether any of the files is there.
exists() {
    for file in "$@"; do
        [ ! -e "$file" ] || return 0
    done
    return 1
}

# Prints where a shared library is.
find_library() {
    for ldconfig in ldconfig /sbin/ldconfig /usr/sbin/ldconfig; do
        path=$("$ldconfig" -p 2>/dev/null | sed -n "s|^[[:space:]]*$1 .*=> ||p" | head -n 1)
        [ -z "$path" ] || { echo "$path" && return 0; }
    done
    for folder in $(echo "${LD_LIBRARY_PATH:-}" | tr : ' ') /usr/lib /usr/lib64 /usr/local/lib; do
        [ ! -e "$folder/$1" ] || { echo "$folder/$1" && return 0; }
    done
    return 1
}

named_by_hand() { [ -n "${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-}${VK_ADD_DRIVER_FILES:-}" ]; }

# Whether there is a device that Mesa could render on, of the vendor where one is given.
has_device() {
    [ ! -e /dev/dxg ] || return 0
    for node in /dev/dri/renderD*; do
        [ -e "$node" ] || continue
        # A virtual machine's display has a node, too, and no Vulkan of its own.
        vendor=$(cat "/sys/class/drm/${node##*/}/device/vendor" 2>/dev/null) || vendor=
        if [ -z "${1:-}" ] || [ -z "$vendor" ] || [ "$vendor" = "$1" ]; then
            return 0
        fi
    done
    return 1
}

# Installed drivers that can work here, because their library is there and a device for it: a line "hardware PATH" or
# "software PATH" for each.
usable_drivers() {
    data=${XDG_DATA_HOME:-${HOME:-}/.local/share}
    for manifest in /usr/share/vulkan/icd.d/*.json /usr/local/share/vulkan/icd.d/*.json /etc/vulkan/icd.d/*.json \
        /usr/local/etc/vulkan/icd.d/*.json "$data"/vulkan/icd.d/*.json; do
        [ -r "$manifest" ] || continue
        kind=hardware
        case ${manifest##*/} in
        *lvp* | *lavapipe* | *swiftshader* | *swrast*) kind=software ;;
        *nvidia*) exists /dev/nvidiactl /dev/dxg || continue ;;
        *intel*) has_device 0x8086 || continue ;;
        *radeon* | *amd*) has_device 0x1002 || continue ;;
        *) has_device || continue ;;
        esac
        library=$(sed -n 's/.*"library_path"[^"]*"\([^"]*\)".*/\1/p' "$manifest" | head -n 1)
        case $library in
        /*) ;;
        */*) library=${manifest%/*}/$library ;;
        *) library=$(find_library "$library") || continue ;;
        esac
        [ ! -e "$library" ] || echo "$kind $library"
    done
}

# Prints the library of the software driver where that is the one that will render; fails where it is not.
software_driver() {
    ! named_by_hand || return 1
    drivers=$(usable_drivers)
    ! echo "$drivers" | grep -q -e '^hardware ' -e '^$' || return 1
    echo "$drivers" | sed -n '1s/^software //p'
}

# Prints the version of Mesa that a driver's library is from, and nothing for other drivers.
mesa_version() { LC_ALL=C grep -a -o -m 1 'Mesa [0-9][0-9.]*' "$1" 2>/dev/null | sed -n '1s/Mesa //p'; }

# Prints where the newer driver is kept: beside the builds, one for each release and architecture, since it uses the
# system's libraries.
newer_driver() {
    if [ -n "${XDG_CACHE_HOME:-}${HOME:-}" ]; then
        cache=${XDG_CACHE_HOME:-$HOME/.cache}/frugal-gi
    else
        cache=$(cd "$(dirname "$0")/.." && pwd)/target
    fi
    release=$(. /etc/os-release 2>/dev/null && echo "${ID:-}-${VERSION_CODENAME:-}") || release=unknown
    echo "$cache/mesa/$release-$(uname -m)"
}
