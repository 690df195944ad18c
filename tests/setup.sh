# Installs what building and testing need, where that is possible; sourced by run.sh and quickstart.sh.
# SPDX-License-Identifier: MIT

packages="build-essential meson ninja-build pkg-config libcmocka-dev libpng-dev libjansson-dev"

setup_have() {
    command -v meson >/dev/null 2>&1 && command -v ninja >/dev/null 2>&1 &&
        command -v cc >/dev/null 2>&1 && command -v c++ >/dev/null 2>&1 &&
        command -v pkg-config >/dev/null 2>&1 &&
        pkg-config --exists cmocka libpng jansson 2>/dev/null
}

setup() {
    setup_have && return 0
    if command -v apt-get >/dev/null 2>&1; then
        as_root=""
        if [ "$(id -u)" -ne 0 ]; then
            command -v sudo >/dev/null 2>&1 && as_root="sudo"
        fi
        if [ "$(id -u)" -eq 0 ] || [ -n "$as_root" ]; then
            echo "Installing: $packages"
            $as_root env DEBIAN_FRONTEND=noninteractive apt-get update -q >/dev/null
            # shellcheck disable=SC2086
            $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-remove $packages >/dev/null
        fi
    fi
    setup_have && return 0
    echo "Please install a C and C++ compiler, Meson >= 1.0, ninja, pkg-config, cmocka, libpng and" >&2
    echo "jansson with their headers (Debian's names: $packages) and try again." >&2
    return 1
}

# COMMAND PACKAGES: installs them if the command is missing and nothing has to go for them (Debian's
# gcc-multilib, for one, excludes the cross compilers).
setup_optional() {
    command -v "$1" >/dev/null 2>&1 && return 0
    shift
    [ -n "${setup_updated:-}" ] || apt-get update -q >/dev/null 2>&1
    setup_updated=yes
    DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-remove --no-install-recommends "$@" \
        >/dev/null 2>&1 && echo "Installed: $*"
}

# What tests/cross_test.sh needs for some machines, tests/embed_test.sh and tests/view_test.sh, and is small; for root only. Where they are it also
# uses gcc-mingw-w64-x86-64-posix with wine, and emscripten with nodejs.
setup_cross() {
    [ "$(id -u)" -eq 0 ] && command -v apt-get >/dev/null 2>&1 || return 0
    setup_optional qemu-aarch64-static qemu-user-static
    setup_optional aarch64-linux-gnu-gcc gcc-aarch64-linux-gnu libc6-dev-arm64-cross
    setup_optional s390x-linux-gnu-gcc gcc-s390x-linux-gnu libc6-dev-s390x-cross
    setup_optional i686-linux-gnu-gcc gcc-i686-linux-gnu libc6-dev-i386-cross
    setup_optional cmake cmake # tests/embed_test.sh
    setup_optional sdl2-config libsdl2-dev # ascc view
    setup_optional Xvfb xvfb               # tests/view_test.sh
    pkg-config --exists box2d bullet || setup_optional box2d-and-bullet libbox2d-dev libbullet-dev # tests/hosts_test.sh
    mpicc --version >/dev/null 2>&1 || setup_optional no-mpicc libopenmpi-dev openmpi-bin # tests/mpi_test.sh
    return 0
}
