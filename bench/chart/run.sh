#!/bin/sh
# Measures, draws and writes docs/chart.md: sh bench/chart/run.sh [BUILD [SHARED]].
# With --draw as the third word: draws what docs/figures/chart.csv has. SPDX-License-Identifier: MIT
cd "$(dirname "$0")/../.." || exit 1
build=${1:-build}
shared=${2:-../shared}
csv=docs/figures/chart.csv
if [ "${3:-}" != --draw ]; then
    before=$(cut -d' ' -f1 /proc/loadavg)
    "$build/bench/chart" "$shared" $csv || exit 1
    after=$(cut -d' ' -f1 /proc/loadavg)
    sh bench/chart/table.sh $csv "$before" "$after" || exit 1
fi
gnuplot -c bench/chart/chart.gp $csv docs/figures/chart.svg svg &&
    gnuplot -c bench/chart/chart.gp $csv docs/figures/chart.png png
