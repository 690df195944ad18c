#!/bin/sh
# Fuzzes all targets for so many seconds in all (an hour), two at a time: with libFuzzer where clang has it, else
# with the project's own driver and gcc's sanitizers. What fails is kept in build-fuzz/crashes.
# SPDX-License-Identifier: MIT
#
#   sh tests/fuzz/run.sh [SECONDS]         FUZZ_SEED=7 in the environment chooses other inputs
cd "$(dirname "$0")/../.." || exit 1
total=${1:-3600}
build=$PWD/build-fuzz # whole: one target changes its folder
seed=${FUZZ_SEED:-$(date +%s)}

if echo 'int LLVMFuzzerTestOneInput(const char *d, unsigned long n) { return d && n && 0; }' |
    clang -x c -fsanitize=fuzzer,address,undefined -o /dev/null - 2>/dev/null; then
    compiler=clang
    options=-Dfuzz=true
else
    compiler=${CC:-cc}
    options='-Db_sanitize=address,undefined -Dc_args=-fsanitize=float-cast-overflow'
fi
echo "fuzzing with $compiler $options, seed $seed; build-fuzz.log has the build"
if [ ! -d $build ]; then
    # shellcheck disable=SC2086
    CC=$compiler meson setup $build --buildtype=debugoptimized -Db_lundef=false -Db_ndebug=false $options \
        >"$build.log" 2>&1 || { tail -n 20 $build.log; exit 1; }
fi
targets=$(ls tests/fuzz/corpus)
# shellcheck disable=SC2046
ninja -C $build $(echo "$targets" | sed 's|^|tests/fuzz/fuzz_|') >>"$build.log" 2>&1 ||
    { tail -n 20 $build.log; exit 1; }

seconds=$((total * 2 / $(echo "$targets" | wc -w)))
[ "$seconds" -gt 0 ] || seconds=1
mkdir -p $build/crashes
failed=0

# One target: libFuzzer ends at the first fault, so it goes on with another seed until its time is over.
fuzz() {
    found=$build/corpus/$1
    mkdir -p "$found"
    end=$(($(date +%s) + seconds))
    attempt=0
    : >"$build/crashes/$1.log"
    while left=$((end - $(date +%s))) && [ $left -gt 0 ] && [ $attempt -lt 20 ]; do
        "$build/tests/fuzz/fuzz_$1" -max_total_time=$left -seed=$((seed + attempt)) -timeout=60 -rss_limit_mb=4096 \
            -dict=tests/fuzz/words.dict "-artifact_prefix=$build/crashes/$1-" "$found" "$PWD/tests/fuzz/corpus/$1" \
            >>"$build/crashes/$1.log" 2>&1 || echo "fault" >>"$build/crashes/$1.log"
        attempt=$((attempt + 1))
    done
    faults=$(grep -c '^fault$' "$build/crashes/$1.log")
    echo "$1: $seconds s, $faults faults; $build/crashes/$1.log"
    [ "$faults" -eq 0 ]
}

set -- $targets
while [ $# -gt 0 ]; do
    fuzz "$1" &
    other=$!
    if [ $# -gt 1 ]; then
        fuzz "$2" || failed=1
        shift
    fi
    shift
    wait $other || failed=1
done
exit $failed
