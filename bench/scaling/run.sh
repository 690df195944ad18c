#!/bin/sh
# Measures what processes exchange, fits it and draws docs/figures/processes.svg: sh bench/scaling/run.sh [--build DIR]
# [--model FILE] [--draw]; docs/scaling.md tells what came out. --draw measures nothing and draws what
# docs/figures/processes.csv has. The machine may have fewer cores than there are processes. SPDX-License-Identifier: MIT
cd "$(dirname "$0")/../.." || exit 1
build=build
model=examples/models/water3d.safetensors
csv=docs/figures/processes.csv
draw=
while [ $# -gt 0 ]; do
    case $1 in
    --draw) draw=yes && shift && continue ;;
    --build) build=$2 ;;
    --model) model=$2 ;;
    *) echo "usage: run.sh [--build DIR] [--model FILE] [--draw]" >&2 && exit 2 ;;
    esac
    shift 2 || exit 2
done
# Of Open MPI, which otherwise refuses; other implementations ask for nothing.
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
export OMPI_MCA_rmaps_base_oversubscribe=1 OMPI_MCA_mpi_yield_when_idle=1 OMPI_MCA_hwloc_base_binding_policy=none
if [ -z "$draw" ]; then
    mpirun -n 1 "$build/bench/scaling" >"$csv.part" || exit 1
    for side in 32 48 64; do
        for processes in 2 3 4 6 8 12 16; do
            mpirun -n $processes "$build/bench/scaling" "$model" $side 1 1 >>"$csv.part" || exit 1
        done
    done
    mv "$csv.part" "$csv"
fi
python3 bench/scaling/fit.py "$csv" >"$csv.law" || exit 1
cat "$csv.law"
gnuplot -e "$(sed -n 's/^gnuplot: //p' "$csv.law")" -c bench/scaling/processes.gp "$csv" docs/figures/processes.svg
rm -f "$csv.law"
