#!/bin/sh
# The benchmarks run and write what docs/benchmarks.md says, bench/tables its page; prints TAP. $1: a build folder.
# SPDX-License-Identifier: MIT
. "$(dirname "$0")/support/python.sh"
python_with 'numpy, matplotlib' || python=
cd "$(dirname "$0")/.." || exit 1
root=$(pwd)
bench=$(cd "${1:-build}" && pwd)/bench/bench
if [ ! -x "$bench" ]; then
    echo "1..0 # SKIP built without the benchmarks"
    exit 0
fi
number=0
failed=0
folder=$(mktemp -d) || exit 1
trap 'rm -rf "$folder"' EXIT
cd "$folder" || exit 1

report() {
    number=$((number + 1))
    if [ "$1" -eq 0 ]; then
        echo "ok $number - $2"
    else
        echo "not ok $number - $2"
        sed 's/^/# /' out
        failed=1
    fi
}

run() { timeout 60 "$bench" "$@" --quick --output results --figures none >out 2>&1; }

# column TABLE PREFIX NAME TEST: the column NAME of every row whose first field starts with PREFIX satisfies
# the awk TEST of x.
column() { awk -F, -v p="$2" -v name="$3" '!/^#/ && !c { for (i = 1; i <= NF; i++) if ($i == name) c = i; next }
    index($1, p) == 1 { x = $c; n++; if (!c || !('"$4"')) bad = 1 }
    END { exit bad || !n }' results/*/"$1".csv; }

run kernel --only search --particles 1000
report $? "the search is timed"
column kernel search ns_per_particle 'x > 0'
report $? "and written as a CSV row for each instruction set"
grep -q '^# cpu: .*' results/*/kernel.csv && grep -q 'load average' results/*/kernel.csv
report $? "under a header that names the machine and its load"
run kernel --only 'layer 8' --particles 1000 && column kernel layer peak_share 'x > 0 && x < 1'
report $? "a layer stays below the peak measured next to it"
run step --scene dam-break --model tiny --particles 500 && column step dam-break momentum_drift_quanta 'x == 0'
report $? "a step is timed, and its momentum is exact"
run step --model nowhere.safetensors
[ $? -eq 1 ] && grep -q 'nowhere.safetensors' out
report $? "a model that is not there is named"
run kernel --cpu 64
[ $? -eq 1 ] && grep -q 'this machine has only' out
report $? "a CPU mask that the machine lacks is refused"
if [ -n "$python" ]; then
    MPLBACKEND=Agg "$python" -B "$root/tests/test_tables.py" >tap 2>&1 || failed=1
    grep -q '^1\.\.[1-9]' tap || { echo "not ok - tests/test_tables.py runs"; sed 's/^/# /' tap; }
    awk -v number="$number" '/^1\.\./ { next }
        /^(not )?ok / { sub(/ok [0-9]+/, "ok " ++number) }
        { print }' tap
    number=$((number + $(grep -cE '^(not )?ok ' tap)))
else
    number=$((number + 1))
    echo "ok $number - the tables' page is written # SKIP no Python with numpy and matplotlib"
fi
echo "1..$number"
exit $failed
