#!/bin/sh
# Sets up, builds and runs all tests, release and sanitizers, as many at a time as there are cores. Ends with
# "N passed, N failed".
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

# Runs what its input names, a log and a command on each line, as many at a time as there are cores; each
# command's exit status stays beside its log.
together() {
    xargs -P "$(nproc 2>/dev/null || echo 2)" -d '\n' -I LINE sh -c '
        log=${1%% *}
        sh -c "${1#* }" >"$log" 2>&1
        echo $? >"$log.status"' - LINE
}

# Counts a log of `together`; one that failed without saying in what is a failure too.
result() {
    count "$1"
    [ "$(cat "$1.status")" = 0 ] && return
    echo "not ok - $2 ended with status $(cat "$1.status")"
    tail -n 25 "$1"
    [ "$(failures "$1")" -gt 0 ] || failed=$((failed + 1))
}

# One whole build in its own folder and its programs: NAME, then meson options.
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
    programs=$(find "build-$name/tests" -maxdepth 1 -name 'test_*' -type f -perm -u+x | sort)
    for program in $programs; do
        echo "$program.log $program"
    done | together
    for program in $programs; do
        result "$program.log" "$program"
    done
}

# Scripts that print TAP lines themselves, each with what it is given on a line: those that take long first.
script_log() {
    echo "build-release/$(basename "$1").$2.log"
}
scripts() {
    while read -r script arguments; do
        echo "$(script_log "$script" "${arguments%% *}") sh $script $arguments"
    done <"$1" | together
    while read -r script arguments; do
        echo "== $script $arguments"
        result "$(script_log "$script" "${arguments%% *}")" "$script"
    done <"$1"
}

if [ -n "$long" ]; then
    export ASCC_TEST_LONG=1
    echo "long: $fuzz_seconds s of each of the $(ls tests/fuzz/corpus | wc -l) fuzz targets, two at a time; ten times the"
    echo "random calls (test_api_fuzz) and random scenes (test_random_scenes)"
fi
export ASAN_OPTIONS=detect_leaks=1
export CMOCKA_MESSAGE_OUTPUT=TAP
export UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1
suite release --buildtype=release
suite sanitize --buildtype=debugoptimized -Db_sanitize=address,undefined -Db_lundef=false \
    -Db_ndebug=false -Dc_args=-fsanitize=float-cast-overflow
cat >build-release/scripts <<END
tests/cross_test.sh build-release
tests/train_test.sh build-sanitize
tests/fuzz_test.sh build-sanitize $fuzz_seconds
tests/cli_test.sh build-sanitize
tests/models_test.sh build-release
tests/web_test.sh build-release
tests/check_tree_test.sh build-release
tests/install_test.sh build-release
tests/embed_test.sh build-release
tests/python_test.sh build-release
tests/stability_test.sh build-release
tests/convert_test.sh build-release
tests/export_test.sh build-release
tests/hosts_test.sh build-release
tests/mpi_test.sh build-release
tests/bench_test.sh build-release
tests/docs_test.sh build-release
tests/view_test.sh build-release
tests/cli_test.sh build-release
tests/train_test.sh build-release
tests/check_tree.sh build-release
tests/windows_test.sh build-release
END
scripts build-release/scripts

echo "$passed passed, $failed failed"
[ "$failed" -eq 0 ]
