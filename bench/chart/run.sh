#!/bin/sh
# Measures, draws and writes docs/chart.md: sh bench/chart/run.sh [--build DIR] [--shared DIR]
# [--model FILE]... [--draw]. Models are the 3D ones of examples/models unless some are named; --draw measures
# nothing and draws what docs/figures/chart.csv has. SPDX-License-Identifier: MIT
cd "$(dirname "$0")/../.." || exit 1
build=build
shared=../shared
csv=docs/figures/chart.csv
models=
draw=
while [ $# -gt 0 ]; do
    case $1 in
    --draw) draw=yes && shift && continue ;;
    --build) build=$2 ;;
    --shared) shared=$2 ;;
    --model) models="$models
$2" ;;
    *) echo "usage: run.sh [--build DIR] [--shared DIR] [--model FILE]... [--draw]" >&2 && exit 2 ;;
    esac
    shift 2 || exit 2
done
if [ -z "$draw" ]; then
    [ -n "$models" ] || models=$(ls examples/models/*3d*.safetensors 2>/dev/null)
    before=$(cut -d' ' -f1 /proc/loadavg)
    old=$IFS
    IFS='
'
    # One name a line: names may have spaces.
    # shellcheck disable=SC2086
    "$build/bench/chart" "$shared" $csv $models || exit 1
    IFS=$old
    after=$(cut -d' ' -f1 /proc/loadavg)
    sh bench/chart/table.sh $csv "$before" "$after" || exit 1
fi
gnuplot -c bench/chart/chart.gp $csv docs/figures/chart.svg svg &&
    gnuplot -c bench/chart/chart.gp $csv docs/figures/chart.png png
