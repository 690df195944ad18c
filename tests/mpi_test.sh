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
    timeout 400 mpirun -n "$processes" "$build/tests/$program" "$@"
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

# ---- Snapshots ----

check 'three processes save and load what one does, and fail together' distributed mpi_snapshots 3 "$folder"

# PROCESSES STEPS PREFIX: examples/hosts/mpi.c, which goes on from its last snapshot.
host() { timeout 400 mpirun -n "$1" "$build/examples/hosts/host_mpi" $flat "$2" "$folder/$3"; }
hash_of() { sed 's/.*: hash //' "$1"; }

# A process is killed; two go on from the last snapshot of three.
killed() {
    host 1 40 whole >"$folder/whole" || return 1
    mpirun -n 3 "$build/examples/hosts/host_mpi" $flat 1000000 "$folder/cut" >"$folder/said" 2>&1 &
    job=$!
    for _ in $(seq 1000); do
        [ -e "$folder/cut.20" ] && break
        sleep 0.1
    done
    kill -9 "$(pgrep -P $job | tail -n 1)"
    wait $job && echo 'the job went on without a process' && return 1
    find "$folder" -name 'cut.*' ! -name cut.10 ! -name cut.20 -exec rm {} +
    host 2 40 cut >"$folder/cut" && cat "$folder/whole" "$folder/cut" &&
        grep -q '^steps 20 to 40, 2 ' "$folder/cut" && [ "$(hash_of "$folder/whole")" = "$(hash_of "$folder/cut")" ] &&
        for step in 10 20 30 40; do cmp "$folder/whole.$step" "$folder/cut.$step" || return 1; done
}
check 'a job that lost a process goes on from its last snapshot, on fewer' killed

# ---- The program ----

ascc=$(cd "$build/examples" && pwd)/ascc
sim() { # FOLDER COMMAND...
    mkdir "$folder/$1" && cd "$folder/$1" || return 1
    shift
    "$@" sim "$root/$flat" dam-break-2d --size 16 -n 20 --every 10 -o s --frames f --ply p --vtk v >"$folder/said"
}
root=$(pwd)
files() {
    (sim sim1 "$ascc") && (sim sim3 timeout 200 mpirun -n 3 "$ascc") && diff -r "$folder/sim1" "$folder/sim3" &&
        grep -q '20 of 0.005 s, 3 processes of 1 threads' "$folder/said" &&
        grep -q 'momentum error      0  (0 0 0 quanta' "$folder/said"
}
check 'mpirun ascc sim writes the files that one process does' files
# TEXT ARGUMENTS...: three processes end with one line.
refuses() {
    text=$1
    shift
    timeout 200 mpirun -n 3 "$ascc-mpi" "$@" >"$folder/said" 2>&1 && return 1
    cat "$folder/said"
    [ "$(grep -c '^ascc' "$folder/said")" -eq 1 ] && grep -q "$text" "$folder/said"
}
bad() {
    refuses 'a whole number' sim demo dam-break-2d -n x && refuses "cannot open 'none'" sim none dam-break-2d -n 1 &&
        refuses '/nonexistent/s' sim demo dam-break-2d -n 2 -o /nonexistent/s &&
        refuses 'fluid cannot sleep' sim demo dam-break-2d -n 2 --sleep 1
}
check 'what is wrong is said once' bad

# ---- What is exchanged ----

law() {
    {
        "$build/bench/scaling" && for processes in 2 8 16; do
            for particles in 1000 20000 300000; do # bytes: 100 n^(2/3) (1 - P^(-1/3))
                awk -v p=$processes -v n=$particles 'BEGIN { OFS = ","; OFMT = "%.12g"; m = n / p
                    b = 100 * m ^ (2 / 3) * (1 - p ^ (-1 / 3))
                    print p, 1, n, 2, m, m, b, b, b, b, p, p, 9, 9, 0, 0, 0 }'
            done
        done
    } >"$folder/law.csv" && python3 bench/scaling/fit.py "$folder/law.csv" >"$folder/said"
    cat "$folder/said"
    grep -q '^bytes: 100 n^(2/3) (1 - P^(-1/3)), off by at most 0 %' "$folder/said"
}
# A square whose corner is the origin, where all four quarters of the plane meet: nobody has ghosts of walls' far sides.
counted() {
    timeout 200 mpirun -n 4 "$build/bench/scaling" $flat 64 1 1 >"$folder/row" && cat "$folder/row" &&
        awk -F, '{ good = NF == 17 && $1 == 4 && $3 == 4096 && $5 == 1024 && $7 > 0 && $8 < 1.1 * $7 && $9 > 48 * $7 && $11 > 0 } END { exit !good }' "$folder/row"
}
if [ -x "$build/bench/scaling" ]; then
    check 'what processes exchange is counted, and only who has fluid beside has ghosts' counted
    check 'and fitted to the law that it follows' law
fi
echo "1..$number"
exit $failed
