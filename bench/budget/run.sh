#!/bin/sh
# Measures and draws docs/figures/budget.svg and budget-frames.svg: sh bench/budget/run.sh [--build DIR] [--draw]
# [--only minute|frames]; docs/budget.md tells what came out. A quarter of an hour of CPU time, one thread. --draw
# measures nothing and draws what docs/figures/budget.csv and budget-frames.csv have. SPDX-License-Identifier: MIT
cd "$(dirname "$0")/../.." || exit 1
build=build
only=
draw=
while [ $# -gt 0 ]; do
    case $1 in
    --draw) draw=yes && shift && continue ;;
    --build) build=$2 ;;
    --only) only=$2 ;;
    *) echo "usage: run.sh [--build DIR] [--only minute|frames] [--draw]" >&2 && exit 2 ;;
    esac
    shift 2 || exit 2
done
figures=docs/figures
rungs=pbf3d,water3d,water3d-large
export ASCC_MODEL_PATH=examples/models
scratch=$(mktemp -d) || exit 1
trap 'rm -rf "$scratch"' EXIT

# A minute of 2,048 to 2,560 particles: NAME MODELS SLEEP [OPTION...]; a line of means.
minute() {
    name=$1 models=$2 sleep=$3
    shift 3
    "$build/bench/budget" "$models" --sleep "$sleep" --size 16 --frames 3000 "$@" >"$scratch/run.csv" || exit 1
    awk -F, -v name="$name" -v sleep="$sleep" 'NR > 1 { n++; ms += $2; asleep += $6; if ($3 != last && n > 1) changes++
        last = $3; if ($8 ~ /[0-9]/) { far += $8; compared++ } }
        END { printf "%s,%s,%.4f,%.6f,%.3f,%d\n", name, sleep, ms / n, compared ? far / compared : 0, asleep / n, changes }' \
        "$scratch/run.csv"
}

measure_minute() {
    echo "name,sleep,ms,chamfer,asleep,changes"
    minute water3d-large water3d-large 0 --keep "$scratch/places"
    for model in pbf3d water3d; do
        minute $model $model 0 --like "$scratch/places"
        minute $model $model 0.5 --like "$scratch/places"
    done
    minute water3d-large water3d-large 0.5 --like "$scratch/places"
    for budget in 10 16 22; do
        minute "$budget ms" $rungs 0 --budget $budget --like "$scratch/places"
        minute "$budget ms" $rungs 0.5 --budget $budget --like "$scratch/places"
    done
}

# 20,000 particles, some seconds, all frames.
measure_frames() {
    "$build/bench/budget" water3d-large --size 34 --frames 600 --keep "$scratch/places" >"$scratch/best.csv" || exit 1
    "$build/bench/budget" $rungs --size 34 --frames 600 --budget 190 --like "$scratch/places" >"$scratch/ladder.csv" ||
        exit 1
    paste -d, "$scratch/ladder.csv" "$scratch/best.csv" | cut -d, -f1-8,10
}

if [ -z "$draw" ] && [ "$only" != frames ]; then
    measure_minute >"$scratch/budget.csv" && mv "$scratch/budget.csv" $figures/budget.csv || exit 1
fi
if [ -z "$draw" ] && [ "$only" != minute ]; then
    measure_frames >"$scratch/frames.csv" && mv "$scratch/frames.csv" $figures/budget-frames.csv || exit 1
fi
gnuplot -c bench/budget/chart.gp $figures/budget.csv $figures/budget-frames.csv $figures
