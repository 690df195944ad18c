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

# PROGRAM PROCESSES, then its arguments.
distributed() {
    program=$1
    processes=$2
    shift 2
    timeout 120 mpirun -n "$processes" "$build/tests/$program" "$@"
}
models=examples/models
flat="$models/water2d.safetensors"
deep="$models/water3d.safetensors"
check 'what 1 process with 2 threads computes is what one computes alone' distributed mpi_check 1 2 $flat dam 4 $deep tank 2
check '2 processes' distributed mpi_check 2 1 $flat dam 6 $flat tank 6 $deep drops 4
check '3 processes of 2 threads' distributed mpi_check 3 2 $flat drops 8 $deep dam 4 $models/pbf3d.safetensors dam 3
check '4 processes' distributed mpi_check 4 1 $flat tank 6 $deep tank 4
check '7 processes' distributed mpi_check 7 1 $flat drops 6 $deep dam 3
check 'all calls, right and wrong, on 2 processes' distributed mpi_calls 2 2 $flat
check 'and on 3' distributed mpi_calls 3 1 $deep
echo "1..$number"
exit $failed
