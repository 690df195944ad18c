#!/bin/sh
# Makes the scenes that water3d learns from beside the given ones, in examples/train/runs/data3d: seconds.
# SPDX-License-Identifier: MIT
# sh examples/train/data3d.sh [PROGRAM]
set -eu
cd "$(dirname "$0")"
ascc=${1:-../../build/examples/ascc}
out=runs/data3d
mkdir -p "$out"
"$ascc" generate droplets -o "$out" --dimension 3 --seed 6 --count 3 --frames 80 --spacing 0.05
"$ascc" generate free-fall -o "$out" --dimension 3 --seed 5 --count 2 --frames 40 --spacing 0.05
