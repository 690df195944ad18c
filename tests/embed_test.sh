#!/bin/sh
# Other build systems find the installed libraries and build them from source: CMake, pkg-config --static,
# Meson subprojects; prints TAP. $1: a build folder. SPDX-License-Identifier: MIT
cd "$(dirname "$0")/.." || exit 1
build=${1:-build}
source=$PWD
number=0
failed=0
folder=$(mktemp -d) || exit 1
trap 'rm -rf "$folder"' EXIT

# check NAME COMMAND...: passes when the command does; shows its output when it does not.
check() {
    number=$((number + 1))
    name=$1
    shift
    if "$@" >"$folder/out" 2>&1; then
        echo "ok $number - $name"
    else
        echo "not ok $number - $name"
        tail -n 20 "$folder/out" | sed 's/^/# /'
        failed=1
    fi
}

skip() {
    number=$((number + 1))
    echo "ok $number - $1 # SKIP $2"
}

have() { command -v "$1" >/dev/null 2>&1; }
fails() { ! "$@"; }

# As a package would be, and then moved: nothing may depend on where it was configured to go.
install_it() {
    DESTDIR="$folder" meson install -C "$build" --no-rebuild --quiet || return 1
    prefix=$(meson introspect --buildoptions "$build" |
        sed 's/.*"name": "prefix", "value": "\([^"]*\)".*/\1/')
    mv "$folder$prefix" "$folder/root" && pc=$(find "$folder/root" -name ascc.pc) && [ -n "$pc" ] &&
        sed -i "s|^prefix=.*|prefix=$folder/root|" "$pc" "$(dirname "$pc")/ascc-train.pc"
}
check 'it installs' install_it
libdir=$(cd "$(dirname "$pc")/.." && pwd)
model=$source/examples/models/pbf3d.safetensors
needs_ascc() { readelf -d "$1" | grep -q 'NEEDED.*libascc'; }

# ---- pkg-config --static ----

export PKG_CONFIG_PATH="$libdir/pkgconfig"
# PROGRAM PACKAGE: a whole static one.
static_program() {
    # shellcheck disable=SC2046
    cc -static "examples/$1.c" -o "$folder/$1-static" $(pkg-config --cflags --static --libs "$2")
}
check 'hello.c links with libascc.a by pkg-config --static' static_program hello ascc
check 'and runs' "$folder/hello-static" "$model"
check 'learn.c links with libascc-train.a' static_program learn ascc-train
cat >"$folder/both.c" <<'END'
#include <ascc/ascc.h>
#include <ascc/train.h>
int main(void)
{
    ascc_context *run = NULL;
    ascc_train_context *train = NULL;
    return ascc_context_create(NULL, &run) != ASCC_OK || ascc_train_context_create(NULL, &train) != ASCC_OK;
}
END
# shellcheck disable=SC2046
check 'both static libraries go into one program' cc -static "$folder/both.c" -o "$folder/both" \
    $(pkg-config --cflags --static --libs ascc ascc-train)
check 'and it runs' "$folder/both"

# ---- CMake ----

# FOLDER, then options of cmake: configures and builds examples/cmake.
cmake_build() {
    at=$folder/$1
    shift
    cmake -S examples/cmake -B "$at" "$@" && cmake --build "$at"
}
if have cmake; then
    check 'find_package(ascc) builds both hosts' cmake_build found -DCMAKE_PREFIX_PATH="$folder/root"
    check 'it is the installed library' needs_ascc "$folder/found/hello"
    check 'hello runs' "$folder/found/hello" "$model"
    check 'learn runs' "$folder/found/learn" "$folder/learnt.safetensors"
    check 'find_package(ascc) with ascc_USE_STATIC_LIBS' cmake_build static \
        -DCMAKE_PREFIX_PATH="$folder/root" -Dascc_USE_STATIC_LIBS=ON
    check 'it is the static library' fails needs_ascc "$folder/static/hello"
    check 'hello runs with it' "$folder/static/hello" "$model"
    # VERSION: does find_package take what is installed for it?
    takes() {
        printf 'cmake_minimum_required(VERSION 3.18)\nproject(x LANGUAGES C)\nfind_package(ascc %s REQUIRED)\n' "$1" \
            >"$folder/CMakeLists.txt"
        rm -rf "$folder/version"
        cmake -S "$folder" -B "$folder/version" -DCMAKE_PREFIX_PATH="$folder/root"
    }
    version=$("$folder/root/bin/ascc" version | cut -d' ' -f2)
    check "a project that wants $version gets it" takes "$version"
    check "one that wants ${version%.*} gets it" takes "${version%.*}"
    check 'one that wants 0.0.9 does not' fails takes 0.0.9
    check 'one that wants 99 does not' fails takes 99
    type=Debug # a quarter of the time
    [ -z "${ASCC_TEST_LONG:-}" ] || type=Release
    check "FetchContent builds libraries and hosts ($type)" cmake_build fetched -DCMAKE_DISABLE_FIND_PACKAGE_ascc=ON \
        -DCMAKE_BUILD_TYPE=$type -DCMAKE_C_FLAGS='-Wall -Wextra -Werror'
    same_output() { "$1" "$model" >"$folder/a" && "$2" "$model" >"$folder/b" && cmp "$folder/a" "$folder/b"; }
    check 'hello of FetchContent prints what the installed one does' same_output "$folder/fetched/hello" "$folder/found/hello"
else
    skip 'CMake' 'no cmake'
fi

# ---- Meson subproject ----

# A project with libascc in it, on a machine without pkg-config's packages: no libpng, jansson, cmocka.
mkdir -p "$folder/game/subprojects" && ln -s "$source" "$folder/game/subprojects/ascc"
cp examples/hello.c examples/learn.c "$folder/game"
cat >"$folder/game/meson.build" <<'END'
project('game', 'c', default_options: ['c_std=c11'])
executable('hello', 'hello.c', dependencies: dependency('ascc', fallback: 'ascc'))
executable('learn', 'learn.c', dependencies: dependency('ascc-train', fallback: 'ascc'))
END
subproject() {
    env PKG_CONFIG_PATH= PKG_CONFIG_LIBDIR="$folder/none" meson setup "$folder/game/build" "$folder/game" "$@"
}
targets() { meson introspect --targets "$folder/game/build" | tr ',' '\n' | sed -n 's/^ *{*\[*{*"name": "\(.*\)"/\1/p'; }
only_libraries() { targets | grep -qx hello && ! targets | grep -vE '^(hello|learn|ascc(-train)?(-(core|hot|avx2|avx512|neon))?)$'; }
check 'a Meson project has it as a subproject, without packages' subproject --buildtype=debug
check 'no examples, tests and benchmarks come along' only_libraries
if [ -n "${ASCC_TEST_LONG:-}" ]; then
    check 'and it builds' ninja -C "$folder/game/build"
    check 'and runs' "$folder/game/build/hello" "$model"
fi
echo "1..$number"
exit $failed
