#!/bin/sh
# libascc-mpi under mpirun, against one process; prints TAP. $1: a build folder. The machine may have fewer cores than
# there are processes. SPDX-License-Identifier: MIT
cd "$(dirname "$0")/.." || exit 1
build=${1:-build}
. tests/support/tap.sh

# Of Open MPI, which otherwise refuses; other implementations ask for nothing.
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
export OMPI_MCA_rmaps_base_oversubscribe=1 OMPI_MCA_mpi_yield_when_idle=1 OMPI_MCA_hwloc_base_binding_policy=none

if ! have mpirun || [ ! -x "$build/tests/mpi_check" ]; then
    skip 'one fluid on several processes' 'no MPI when this was built: libopenmpi-dev, openmpi-bin'
    echo "1..$number"
    exit 0
fi

# PROCESSES THREADS, then a model, a scene and steps for each case.
same() {
    processes=$1
    threads=$2
    shift 2
    timeout 120 mpirun -n "$processes" "$build/tests/mpi_check" "$threads" "$@"
}
models=examples/models
flat="$models/water2d.safetensors"
deep="$models/water3d.safetensors"
for processes in 1 2 3 4 7; do
    threads=$((processes % 2 + 1))
    # shellcheck disable=SC2086
    check "hash, sums and snapshot of $processes processes are those of one" same $processes $threads \
        $flat dam 8 $flat drops 8 $flat tank 8 $deep dam 4 $deep drops 4 $deep tank 4 $models/pbf3d.safetensors dam 4
done
echo "1..$number"
exit $failed
