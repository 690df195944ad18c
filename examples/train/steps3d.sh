#!/bin/sh
# Makes what water3d-range.json learns from besides the given sequences, in examples/train/runs/steps3d: scenes whose frames
# lie 0.005 to 0.0225 s apart, so that gravity is 0 to 0.1 spacings a squared step. SPDX-License-Identifier: MIT
# sh examples/train/steps3d.sh [PROGRAM [SHARE [THREADS]]]     SHARE: per cent of the set (100)
set -eu
cd "$(dirname "$0")"
ascc=${1:-../../build/examples/ascc}
share=${2:-100}
threads=${3:-$(nproc)}
out=runs/steps3d
mkdir -p "$out"

. ./range.sh
# step SEED INTERVAL FRAMES: scenes with so many seconds between frames.
step() {
    seed=$1
    kind liquid3d 3 --interval "$2" --frames "$3"
    kind dam-break 2 --interval "$2" --frames "$3"
    kind drops 2 --interval "$2" --frames "$3"
    kind still-tank 3 --interval "$2" --frames 40
    kind film 1 --interval "$2" --frames "$3"
    kind jet 2 --interval "$2" --frames 40
    kind space 2 --interval "$2" --frames "$3"
}
step 21 0.005 120
step 22 0.010 80
step 23 0.014 60
step 24 0.0225 50
seed=22
valid drops --interval 0.010 --frames 60
valid dam-break --interval 0.010 --frames 60
spent
