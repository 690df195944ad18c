#!/bin/sh
# Sets up, builds and runs all tests: release and sanitizers. Ends with "N passed, N failed".
# SPDX-License-Identifier: MIT
#
#   sh tests/run.sh [--long]     --long: a minute of each fuzz target, and more random calls and scenes
set -u
long=
fuzz_seconds=3
case ${1:-} in
--long)
    long=yes
    fuzz_seconds=60
    ;;
'') ;;
*)
    echo "usage: sh tests/run.sh [--long]" >&2
    exit 2
    ;;
esac
cd "$(dirname "$0")/.." || exit 1
. tests/setup.sh
setup || exit 1
setup_cross

passed=0
failed=0

# Failed tests of a log; cmocka calls a skipped test "not ok" too.
failures() {
    grep '^not ok ' "$1" | grep -vc '# SKIP'
}

# Counts the TAP lines of a log and shows what failed or was skipped.
count() {
    passed=$((passed + $(grep '^ok ' "$1" | grep -vc '# SKIP')))
    failed=$((failed + $(failures "$1")))
    grep -E '^(not ok|# SKIP|SKIP)|# SKIP' "$1" | sort | uniq -c
}

# One whole build in its own folder: NAME, then meson options.
suite() {
    name=$1
    shift
    echo "== $name"
    if [ -d "build-$name" ]; then
        meson setup --reconfigure "build-$name" "$@" >"build-$name.log" 2>&1
    else
        meson setup "build-$name" "$@" >"build-$name.log" 2>&1
    fi
    if [ $? -ne 0 ] || ! ninja -C "build-$name" >>"build-$name.log" 2>&1; then
        tail -n 30 "build-$name.log"
        echo "not ok - $name does not build"
        failed=$((failed + 1))
        return
    fi
    for program in "build-$name"/tests/test_*; do
        [ -x "$program" ] && [ -f "$program" ] || continue
        log="$program.log"
        CMOCKA_MESSAGE_OUTPUT=TAP "$program" >"$log" 2>&1
        status=$?
        count "$log"
        if [ $status -ne 0 ]; then
            echo "not ok - $program ended with status $status"
            tail -n 25 "$log"
            [ "$(failures "$log")" -gt 0 ] || failed=$((failed + 1))
        fi
    done
}

# A script that prints TAP lines itself, and what it is given.
script() {
    echo "== $*"
    log="build-release/$(basename "$1").log"
    sh "$@" >"$log" 2>&1 || { [ "$(failures "$log")" -gt 0 ] || { tail -n 25 "$log"; failed=$((failed + 1)); }; }
    count "$log"
}

if [ -n "$long" ]; then
    export ASCC_TEST_LONG=1
    echo "long: $fuzz_seconds s of each of the $(ls tests/fuzz/corpus | wc -l) fuzz targets, two at a time; ten times the"
    echo "random calls (test_api_fuzz) and random scenes (test_random_scenes)"
fi
export ASAN_OPTIONS=detect_leaks=1
export UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1
suite release --buildtype=release
suite sanitize --buildtype=debugoptimized -Db_sanitize=address,undefined -Db_lundef=false \
    -Db_ndebug=false -Dc_args=-fsanitize=float-cast-overflow
for t in tests/check_tree.sh tests/check_tree_test.sh tests/install_test.sh tests/embed_test.sh tests/cli_test.sh tests/view_test.sh tests/train_test.sh tests/docs_test.sh tests/convert_test.sh tests/export_test.sh tests/python_test.sh tests/bench_test.sh tests/stability_test.sh tests/cross_test.sh tests/windows_test.sh tests/web_test.sh tests/hosts_test.sh; do
    [ -f "$t" ] && script "$t" build-release
done
script tests/models_test.sh build-release
script tests/fuzz_test.sh build-sanitize "$fuzz_seconds"
script tests/cli_test.sh build-sanitize
script tests/train_test.sh build-sanitize

echo "$passed passed, $failed failed"
[ "$failed" -eq 0 ]
