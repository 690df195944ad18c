#!/bin/sh
# The same bits everywhere: on aarch64 (under qemu), and on x86-64 for every set of kernels, from gcc
# and clang, at -O0 and -O3. Compares state hashes with tests/data/state-hashes.txt and kernels with
# portable C. Prints TAP; what the machine cannot do is a SKIP line.
#   tests/cross_test.sh [--update]     --update writes the hashes that gcc -O3 finds, then compares
# SPDX-License-Identifier: MIT
set -u
cd "$(dirname "$0")/.." || exit 1

packages="gcc-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user-static"
expected=tests/data/state-hashes.txt
build=build-cross
tests=0
failed=0
update=${1:-}
mkdir -p "$build"

ok() {
    tests=$((tests + 1))
    echo "ok $tests - $1"
}

# NAME, then a file that tells why.
not_ok() {
    tests=$((tests + 1))
    failed=$((failed + 1))
    echo "not ok $tests - $1"
    [ -f "${2:-}" ] && tail -n 12 "$2" | sed 's/^/# /'
}

skip() {
    tests=$((tests + 1))
    echo "ok $tests - $1 # SKIP $2"
}

have_cross() {
    command -v aarch64-linux-gnu-gcc >/dev/null 2>&1 &&
        command -v qemu-aarch64-static >/dev/null 2>&1
}

get_cross() {
    have_cross && return 0
    if [ "$(id -u)" -eq 0 ] && command -v apt-get >/dev/null 2>&1; then
        export DEBIAN_FRONTEND=noninteractive
        apt-get update -q >/dev/null 2>&1
        # shellcheck disable=SC2086
        apt-get install -q -y --no-install-recommends $packages >/dev/null 2>&1
    fi
    have_cross
}

# Builds the core in $build/NAME: NAME, compiler, optimisation, then more options of meson.
build_core() {
    at=$build/$1
    compiler=$2
    level=$3
    log=$at.log
    shift 3
    if [ ! -f "$at/build.ninja" ]; then
        rm -rf "$at"
        CC=$compiler meson setup "$at" --buildtype=plain -Doptimization="$level" -Dexamples=false \
            -Dtests=false "$@" >"$log" 2>&1 || return 1
    fi
    ninja -C "$at" lib/libascc-core.a >>"$log" 2>&1
}

# Links a program with a core: NAME, compiler, optimisation, program, then sources, objects, options.
link_program() {
    at=$build/$1
    program=$at/$4
    compiler=$2
    level=$3
    shift 4
    # shellcheck disable=SC2086
    $compiler -O"$level" -std=c11 -D_POSIX_C_SOURCE=200809L -ffp-contract=off -fno-math-errno \
        -fno-trapping-math -Iinclude -Ilib -Itests "$@" "$at/lib/libascc-core.a" -lm -lpthread \
        -o "$program" >>"$at.log" 2>&1
}

state_hash="tests/state_hash.c tests/support/model_builder.c examples/demo_model.c"

# One line of TAP for each set of kernels: LABEL, file of "SCENE CPU HASH" lines.
compare() {
    for cpu in $(awk '{ print $2 }' "$2" | sort -nu); do
        if awk -v cpu="$cpu" '$2 == cpu { print $1, $3 }' "$2" | diff "$expected" - >"$2.diff"; then
            ok "state hashes: $1, kernels $cpu"
        else
            not_ok "state hashes: $1, kernels $cpu" "$2.diff"
        fi
    done
    [ -s "$2" ] || not_ok "state hashes: $1: none"
}

# Runs the hashes of a built core: NAME, compiler, optimisation, then what runs a program.
hashes() {
    name=$1
    # shellcheck disable=SC2086
    if ! link_program "$1" "$2" "$3" state_hash $state_hash; then
        not_ok "$name links" "$build/$name.log"
        return
    fi
    shift 3
    if ! "$@" "$build/$name/state_hash" >"$build/$name.hashes" 2>>"$build/$name.log"; then
        not_ok "$name runs" "$build/$name.log"
        return
    fi
    if [ "$update" = --update ]; then
        awk '$2 == 0 { print $1, $3 }' "$build/$name.hashes" >"$expected"
        update=
    fi
    compare "$name" "$build/$name.hashes"
}

# test_kernels.c and test_fused.c with a stand-in for cmocka: NAME, compiler, optimisation, runner.
kernel_tests() {
    name=$1
    compiler=$2
    level=$3
    shift 3
    for t in kernels fused; do
        if link_program "$name" "$compiler" "$level" "test_$t" -Itests/support/bare "tests/test_$t.c" &&
            "$@" "$build/$name/test_$t" >"$build/$name.$t.log" 2>&1; then
            ok "test_$t: $name"
        else
            not_ok "test_$t: $name" "$build/$name.$t.log"
        fi
    done
}

# ---- x86-64 -----------------------------------------------------------------------------------------

if [ "$(uname -m)" = x86_64 ]; then
    for compiler in gcc clang; do
        for level in 3 0; do
            name=x86_64-$compiler-O$level
            if ! command -v $compiler >/dev/null 2>&1; then
                skip "state hashes: $name" "no $compiler"
            elif build_core "$name" $compiler $level; then
                hashes "$name" $compiler $level env
            else
                not_ok "$name builds" "$build/$name.log"
            fi
        done
    done

    # Plain C with all the flags of this machine: contraction stays off, and fmaf is the instruction.
    name=x86_64-gcc-native
    if ! command -v gcc >/dev/null 2>&1; then
        skip "state hashes: $name" "no gcc"
    elif build_core $name gcc 3 -Dc_args=-march=native; then
        hashes $name gcc 3 env
    else
        not_ok "$name builds" "$build/$name.log"
    fi

    # AVX-512 where there is none: the code of avx512.c over emulated intrinsics. Its objects come
    # before the archive and so replace those in it.
    name=x86_64-gcc-O3
    if grep -q '^flags.* avx512vl' /proc/cpuinfo; then
        skip "AVX-512 emulated" "the real one ran"
    elif ! grep -q '^flags.* avx2' /proc/cpuinfo || [ ! -f $build/$name/lib/libascc-core.a ]; then
        skip "AVX-512 emulated" "no AVX2, or no gcc"
    else
        wide=$build/avx512-emulated
        flags="-O2 -std=c11 -ffp-contract=off -fno-math-errno -fno-trapping-math -Iinclude -c"
        # shellcheck disable=SC2086
        gcc $flags -include tests/support/avx512_emulated.h -mavx2 -mfma -mbmi2 -mpopcnt \
            lib/kernels/avx512.c -o "$wide.o" >"$wide.log" 2>&1 &&
            gcc $flags -DASCC_HAVE_AVX2 -DASCC_HAVE_AVX512 '-D__builtin_cpu_supports(x)=1' \
                lib/kernels/select.c -o "$wide-select.o" >>"$wide.log" 2>&1 &&
            link_program $name gcc 2 state_hash_512 "$wide-select.o" "$wide.o" $state_hash &&
            link_program $name gcc 2 test_kernels_512 -Itests/support/bare tests/test_kernels.c \
                "$wide-select.o" "$wide.o" &&
            "$build/$name/state_hash_512" >"$wide.hashes" 2>>"$wide.log"
        if [ $? -eq 0 ]; then
            compare "AVX-512 emulated" "$wide.hashes"
            if "$build/$name/test_kernels_512" >"$wide.kernels.log" 2>&1; then
                ok "test_kernels: AVX-512 emulated"
            else
                not_ok "test_kernels: AVX-512 emulated" "$wide.kernels.log"
            fi
        else
            not_ok "AVX-512 emulated" "$wide.log"
        fi
    fi
else
    skip "state hashes on x86-64" "this is $(uname -m)"
fi

# ---- aarch64 ----------------------------------------------------------------------------------------

if ! get_cross; then
    skip "state hashes on aarch64" "needs $packages"
else
    for level in 3 0; do
        name=aarch64-gcc-O$level
        if build_core "$name" "" $level --cross-file tests/aarch64.ini; then
            run="qemu-aarch64-static -L /usr/aarch64-linux-gnu"
            # shellcheck disable=SC2086
            hashes "$name" aarch64-linux-gnu-gcc $level $run
            # shellcheck disable=SC2086
            [ $level -eq 3 ] && kernel_tests "$name" aarch64-linux-gnu-gcc $level $run
        else
            not_ok "$name builds" "$build/$name.log"
        fi
    done
fi

echo "1..$tests"
[ "$failed" -eq 0 ]
