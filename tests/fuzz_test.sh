#!/bin/sh
# Every fuzz target: its corpus, then some seconds of mutation each, two targets at a time; prints TAP.
# $1: a build folder; $2: seconds for each target (0). Failing inputs stay in the folder's `crashes`.
# SPDX-License-Identifier: MIT
cd "$(dirname "$0")/.." || exit 1
build=${1:-build}
seconds=${2:-0}
crashes=$build/tests/fuzz/crashes
mkdir -p "$crashes"
number=0
failed=0

# Everything of a target in one go: NAME.
fuzz() {
    seed=${FUZZ_SEED:-1}
    ASAN_OPTIONS=${ASAN_OPTIONS:-detect_leaks=1} "$build/tests/fuzz/fuzz_$1" "-max_total_time=$seconds" \
        "-seed=$seed" -dict=tests/fuzz/words.dict "-artifact_prefix=$crashes/$1-" "tests/fuzz/corpus/$1" \
        >"$crashes/$1.log" 2>&1
    echo $? >"$crashes/$1.status"
}

report() {
    number=$((number + 1))
    told=$(grep 'in all' "$crashes/$1.log" | sed 's/.*: //; s/.*corpus, //')
    if [ "$(cat "$crashes/$1.status")" = 0 ]; then
        echo "ok $number - fuzz target $1: ${told:-done}"
    else
        echo "not ok $number - fuzz target $1"
        grep -E 'kept as|does not hold|runtime error|SUMMARY' "$crashes/$1.log" | sed 's/^/# /' | head -n 20
        failed=1
    fi
}

targets=$(ls tests/fuzz/corpus)
set -- $targets
while [ $# -gt 0 ]; do
    first=$1
    second=${2:-}
    fuzz "$first" &
    [ -z "$second" ] || fuzz "$second"
    wait
    report "$first"
    [ -z "$second" ] || report "$second"
    shift
    [ $# -eq 0 ] || shift
done
echo "1..$number"
exit $failed
