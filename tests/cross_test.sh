#!/bin/sh
# The same bits everywhere: on x86-64 for every set of kernels, from gcc and clang, at -O0 and -O3; on
# 32-bit x86, aarch64, s390x (big endian), 64-bit Windows and WebAssembly, emulated, where their tools are
# installed (tests/setup.sh names the packages; this test installs nothing). Compares state hashes with
# tests/data/state-hashes.txt and kernels with portable C. Prints TAP; what the machine cannot do is a
# SKIP line.
#   tests/cross_test.sh [--update]     --update writes the hashes that gcc -O3 finds, then compares
# SPDX-License-Identifier: MIT
set -u
cd "$(dirname "$0")/.." || exit 1

expected=tests/data/state-hashes.txt
build=build-cross
tests=0
failed=0
machine_flags= # of the machine that programs are linked for
suffix=        # of its programs
also=          # what is built beside the core
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

have() {
    command -v "$1" >/dev/null 2>&1
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
    # shellcheck disable=SC2086
    ninja -C "$at" lib/libascc-core.a $also >>"$log" 2>&1
}

# Links a program with a core: NAME, compiler, optimisation, program, then sources, objects, options.
link_program() {
    at=$build/$1
    program=$at/$4$suffix
    compiler=$2
    level=$3
    shift 4
    # shellcheck disable=SC2086
    $compiler -O"$level" -std=c11 -D_POSIX_C_SOURCE=200809L -ffp-contract=off -fno-math-errno \
        -fno-trapping-math -Iinclude -Ilib -Itests $machine_flags "$@" "$at/lib/libascc-core.a" -lm \
        -lpthread -o "$program" >>"$at.log" 2>&1
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
    if ! "$@" "$build/$name/state_hash$suffix" >"$build/$name.hashes" 2>>"$build/$name.log"; then
        not_ok "$name runs" "$build/$name.log"
        return
    fi
    sed -i 's/\r$//' "$build/$name.hashes" # of Windows
    if [ "$update" = --update ]; then
        awk '$2 == 0 { print $1, $3 }' "$build/$name.hashes" >"$expected"
        update=
    fi
    compare "$name" "$build/$name.hashes"
}

# A unit's tests with a stand-in for cmocka: NAME, compiler, optimisation, unit, runner.
unit_test() {
    name=$1
    unit=$4
    sources=tests/test_$unit.c
    grep -q support/model_builder.h $sources && sources="$sources tests/support/model_builder.c examples/demo_model.c"
    grep -q support/counting.h tests/test_$unit.c && sources="$sources tests/support/counting.c"
    grep -q support/oracle.h tests/test_$unit.c && sources="$sources tests/support/oracle.c tests/op_scale.c"
    # shellcheck disable=SC2086
    link_program "$1" "$2" "$3" "test_$unit" -Itests/support/bare $before -DSOURCE_ROOT="\"$PWD\"" $sources
    linked=$?
    shift 4
    if [ $linked -eq 0 ] && "$@" "$build/$name/test_$unit$suffix" >"$build/$name.$unit.log" 2>&1; then
        ok "test_$unit: $name"
    else
        not_ok "test_$unit: $name" "$build/$name.$unit.log"
    fi
}

# Files, models by name and threads of a built core: NAME, compiler, optimisation, then what runs a program.
system_check() {
    name=$1
    program=$build/$1/system_check$suffix
    link_program "$1" "$2" "$3" system_check tests/system_check.c examples/demo_model.c $with_threads
    linked=$?
    shift 3
    if [ $linked -eq 0 ] && "$@" "$program" >"$build/$name.system.log" 2>&1; then
        ok "files by names in UTF-8, models by name, threads: $name"
    else
        not_ok "files by names in UTF-8, models by name, threads: $name" "$build/$name.system.log"
    fi
}
with_threads= # objects in place of the core's threads

system=yes # has it files and threads?
before=    # what tests of units include first

# Another machine, built without a warning: NAME (of tests/cross/NAME.ini, if there is one), compiler,
# levels of optimisation, units tested at the first, runner.
machine() {
    machine=$1
    machine_compiler=$2
    levels=$3
    units=$4
    shift 4
    if ! have "${machine_compiler%% *}" || ! have "$1"; then
        skip "state hashes: $machine" "needs ${machine_compiler%% *} and $1"
        return
    fi
    for machine_level in $levels; do
        build_name=$machine-O$machine_level
        if [ -f "tests/cross/$machine.ini" ]; then
            build_core "$build_name" "" "$machine_level" -Dwerror=true -Ddefault_library=static \
                --cross-file "tests/cross/$machine.ini"
        else
            build_core "$build_name" "$machine_compiler" "$machine_level" -Dwerror=true
        fi || {
            not_ok "$build_name builds" "$log"
            continue
        }
        hashes "$build_name" "$machine_compiler" "${link_level:-$machine_level}" "$@"
        for u in $units; do
            unit_test "$build_name" "$machine_compiler" "${link_level:-$machine_level}" "$u" "$@"
        done
        if [ -n "$system" ]; then
            system_check "$build_name" "$machine_compiler" "$machine_level" "$@"
        fi
        units= system=
    done
    system=yes
}

# A build that cannot give the bits ends with an error: LABEL, compiler, options.
refused() {
    label=$1
    shift
    if "$@" -std=c11 -D_POSIX_C_SOURCE=200809L -Iinclude -Ilib -fsyntax-only lib/base/status.c \
        >"$build/refused.log" 2>&1; then
        not_ok "$label is refused"
    elif grep -q '#error' "$build/refused.log"; then
        ok "$label is refused"
    else
        not_ok "$label is refused" "$build/refused.log"
    fi
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

    # Threads by pthreads, as the library has them here, and by C11, as it would where there are none.
    name=x86_64-gcc-O3
    if [ -f $build/$name/lib/libascc-core.a ]; then
        system_check $name gcc 3 env
        with_threads=$build/c11-threads.o
        gcc -O2 -std=c11 -Wall -Wextra -Werror -DASCC_C11_THREADS -Ilib -c lib/base/threads.c -o $with_threads \
            >"$build/c11-threads.log" 2>&1 || not_ok "threads by C11 build" "$build/c11-threads.log"
        name=x86_64-gcc-O0
        [ -f $build/$name/lib/libascc-core.a ] && system_check $name gcc 0 env
        with_threads=
    fi

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

# ---- Other machines, emulated -----------------------------------------------------------------------

also=lib/train/libascc-train-core.a
machine aarch64 aarch64-linux-gnu-gcc "3 0" "kernels fused float_env" \
    qemu-aarch64-static -L /usr/aarch64-linux-gnu

machine_flags=-fexcess-precision=fast
machine s390x s390x-linux-gnu-gcc 3 "fused float_env" qemu-s390x-static -L /usr/s390x-linux-gnu

# 32-bit x86 with SSE2: a cross compiler, or one that does both. Programs are static: no loader needed.
machine_flags="-msse2 -mfpmath=sse -static"
name=i686
for compiler in i686-linux-gnu-gcc "gcc -m32" "clang -m32"; do
    echo 'int main(void) { return 0; }' >"$build/empty.c"
    $compiler $machine_flags "$build/empty.c" -o "$build/empty" 2>/dev/null && break
    name=x86 # as a machine of its own: meson finds out from the compiler
    compiler=
done
runner=env
"$build/empty" 2>/dev/null || runner=qemu-i386-static
if [ -n "$compiler" ]; then
    machine $name "$compiler" 3 "fused float_env" $runner
else
    skip "state hashes: 32-bit x86" "needs gcc-i686-linux-gnu, or a gcc or clang that has -m32"
fi

# 64-bit Windows. Wine keeps its files in the build folder. (Its C library's fmaf, with which test_fused
# compares, rounds twice; ours does not.)
machine_flags="-D__USE_MINGW_ANSI_STDIO=1 -static"
suffix=.exe
runner=wine
for path in /usr/lib/wine/wine64 /usr/lib/wine/wine; do
    have wine || [ ! -x $path ] || runner=$path
done
export WINEPREFIX="$PWD/$build/wine" WINEDEBUG=-all WINEDLLOVERRIDES="mscoree,mshtml="
before="-include tests/support/bare/windows.h"
units="kernels json safetensors sort neighbors search metrics particles"
[ -z "${ASCC_TEST_LONG:-}" ] || units="$units float_env resample relaxation operations step"
machine mingw x86_64-w64-mingw32-gcc-posix 3 "$units" $runner
before=

# The one file of lib/embed/amalgamate.py there.
if [ -n "${ASCC_TEST_LONG:-}" ] && have x86_64-w64-mingw32-gcc-posix && have $runner && have python3; then
    one=$build/one-file
    # shellcheck disable=SC2086
    if python3 lib/embed/amalgamate.py "$one" >"$one.log" 2>&1 && mkdir -p "$one/include/ascc" &&
        mv "$one/ascc.h" "$one/include/ascc" && printf '#include "ascc/ascc.h"\n' >"$one/include/ascc.h" &&
        x86_64-w64-mingw32-gcc-posix -std=c11 -O1 -Wall -Wextra -Werror -I"$one/include" -c "$one/ascc.c" \
            -o "$one/ascc.o" >>"$one.log" 2>&1 &&
        x86_64-w64-mingw32-gcc-posix -std=c11 -O1 -I"$one/include" -Itests $machine_flags $state_hash \
            "$one/ascc.o" -o "$one/state_hash.exe" >>"$one.log" 2>&1 &&
        $runner "$one/state_hash.exe" >"$one.hashes" 2>>"$one.log"; then
        sed -i 's/\r$//' "$one.hashes"
        compare "one file on Windows" "$one.hashes"
    else
        not_ok "one file on Windows" "$one.log"
    fi
fi

# WebAssembly. Emscripten optimises scripts with a package of Node.js that may be missing: not above -O1.
machine_flags="-s ALLOW_MEMORY_GROWTH=1 -s WASM_ASYNC_COMPILATION=0"
suffix=.js
link_level=1
system=
machine wasm emcc 3 kernels node
machine_flags=
suffix=

# ---- What is refused --------------------------------------------------------------------------------

if have gcc; then
    refused "gcc -ffast-math" gcc -ffast-math
    [ "$(uname -m)" = x86_64 ] && refused "x87" gcc -mfpmath=387
fi
have s390x-linux-gnu-gcc && refused "s390x with the excess precision of C11" s390x-linux-gnu-gcc

echo "1..$tests"
[ "$failed" -eq 0 ]
