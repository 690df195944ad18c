#!/bin/sh
# Measures and draws docs/figures/budget.svg and budget-frames.svg: sh bench/budget/run.sh [--build DIR] [--draw]
# [--only minute|frames|seam], and seam.svg; docs/budget.md tells what came out. Some six minutes of CPU time, one thread. --draw
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
    *) echo "usage: run.sh [--build DIR] [--only minute|frames|seam] [--draw]" >&2 && exit 2 ;;
    esac
    shift 2 || exit 2
done
figures=docs/figures
rungs=pbf3d,water3d,water3d-large
export ASCC_MODEL_PATH=examples/models
scratch=$(mktemp -d) || exit 1
trap 'rm -rf "$scratch"' EXIT

# A minute of 864 to 1,080 particles: NAME MODELS SLEEP [OPTION...]; a line of means.
minute() {
    name=$1 models=$2 sleep=$3
    shift 3
    "$build/bench/budget" "$models" --sleep "$sleep" --size 12 --frames 3000 "$@" >"$scratch/run.csv" || exit 1
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
    for budget in 6 12; do
        minute "$budget ms" $rungs 0 --budget $budget --like "$scratch/places"
        minute "$budget ms" $rungs 0.5 --budget $budget --like "$scratch/places"
    done
}

# 20,000 particles, some seconds, all frames.
measure_frames() {
    "$build/bench/budget" water3d-large --size 34 --frames 360 --keep "$scratch/places" >"$scratch/best.csv" || exit 1
    "$build/bench/budget" $rungs --size 34 --frames 360 --budget 190 --like "$scratch/places" >"$scratch/ladder.csv" ||
        exit 1
    paste -d, "$scratch/ladder.csv" "$scratch/best.csv" | cut -d, -f1-8,10
}

# Slices across a pool of 6,912 that slides to and fro: by either model, and by the better one in the half on the left.
measure_seam() {
    set -- water3d "" water3d-large "" water3d,water3d-large 0.5
    for name in rung best both; do
        "$build/bench/budget" "$1" --size 24 --frames 40 --slide 1 --detail "${2:-0}" --slices "$scratch/$name.csv" >/dev/null ||
            exit 1
        shift 2
    done
    paste -d, "$scratch/rung.csv" "$scratch/best.csv" "$scratch/both.csv" | cut -d, -f1-3,5,6,8,9
}

if [ -z "$draw" ] && { [ -z "$only" ] || [ "$only" = seam ]; }; then
    measure_seam >"$scratch/seam.csv" && mv "$scratch/seam.csv" $figures/seam.csv || exit 1
fi
if [ -z "$draw" ] && { [ -z "$only" ] || [ "$only" = minute ]; }; then
    measure_minute >"$scratch/budget.csv" && mv "$scratch/budget.csv" $figures/budget.csv || exit 1
fi
if [ -z "$draw" ] && { [ -z "$only" ] || [ "$only" = frames ]; }; then
    measure_frames >"$scratch/frames.csv" && mv "$scratch/frames.csv" $figures/budget-frames.csv || exit 1
fi
for chart in minute frames seam; do
    [ -n "$only" ] && [ "$only" != $chart ] || gnuplot -c bench/budget/$chart.gp $figures || exit 1
done
