#!/bin/sh
# Other build systems find the installed libraries and build them from source: CMake, pkg-config --static,
# Meson subprojects; prints TAP. $1: a build folder. SPDX-License-Identifier: MIT
cd "$(dirname "$0")/.." || exit 1
build=${1:-build}
source=$PWD
. tests/support/tap.sh

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

# ---- One file ----

# COMPILER WITH FLAGS: the one file gives the bits that tests/data/state-hashes.txt has, on every set of kernels.
one_file() {
    one=$folder/one
    # shellcheck disable=SC2086
    $1 -Wall -Wextra -Werror -c "$one/ascc.c" -o "$one/ascc.o" &&
        mkdir -p "$one/include/ascc" && cp "$one/ascc.h" "$one/include/ascc/ascc.h" &&
        $1 -I"$one/include" -Itests tests/state_hash.c tests/support/model_builder.c examples/demo_model.c \
            "$one/ascc.o" -lm -pthread -o "$one/state_hash" &&
        "$one/state_hash" >"$one/hashes" && [ -s "$one/hashes" ] || return 1
    for cpu in $(awk '{ print $2 }' "$one/hashes" | sort -u); do
        awk -v cpu="$cpu" '$2 == cpu { print $1, $3 }' "$one/hashes" | diff tests/data/state-hashes.txt - || return 1
    done
}
if have python3; then
    check 'the library becomes one file with its header' python3 lib/embed/amalgamate.py "$folder/one"
    check 'which builds without a warning and gives the same bits' one_file 'cc -std=c11 -O1'
    same_kernels() {
        awk '{ print $2 }' "$folder/one/hashes" | sort -u >"$folder/sets"
        "$folder/sets-of-library" | sort -u | diff - "$folder/sets"
    }
    cat >"$folder/sets.c" <<'END'
#include <ascc/ascc.h>
#include <stdio.h>
int main(void)
{
    const uint32_t all = ASCC_CPU_AVX2 | ASCC_CPU_AVX512 | ASCC_CPU_NEON | ASCC_CPU_SIMD128;
    for (uint32_t use = 0; use <= all; use++) {
        const ascc_context_options options = {.size = sizeof options, .cpu_disable = all & ~use};
        ascc_context *context = NULL;
        if (ascc_context_create(&options, &context) == ASCC_OK && ascc_context_cpu(context) == use)
            printf("%u\n", (unsigned)use);
        ascc_context_destroy(&context);
    }
    return 0;
}
END
    check 'with the kernels that the library has' sh -c 'cc -static "$1/sets.c" -o "$1/sets-of-library" $2' sh "$folder" \
        "$(pkg-config --cflags --static --libs ascc)"
    check 'all of them' same_kernels
    if [ -n "${ASCC_TEST_LONG:-}" ]; then
        check 'the same bits with -O3 -march=native and the dialect of GNU' one_file 'cc -O3 -march=native'
        have clang && check 'and from clang' one_file 'clang -O3 -march=native'
    fi
else
    skip 'the library becomes one file' 'no python3'
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
only_libraries() { targets | grep -qx hello && ! targets | grep -vE '^(hello|learn|ascc(-train|-mpi)?(-(core|hot|avx2|avx512|neon))?)$'; }
check 'a Meson project has it as a subproject, without packages' subproject --buildtype=debug
check 'no examples, tests and benchmarks come along' only_libraries
if [ -n "${ASCC_TEST_LONG:-}" ]; then
    check 'and it builds' ninja -C "$folder/game/build"
    check 'and runs' "$folder/game/build/hello" "$model"
fi
echo "1..$number"
exit $failed
