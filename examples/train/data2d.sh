#!/bin/sh
# Makes the scenes that water2d learns from beside the given ones, in examples/train/runs/data2d: ten minutes.
# SPDX-License-Identifier: MIT
# sh examples/train/data2d.sh [PROGRAM]
set -eu
cd "$(dirname "$0")"
ascc=${1:-../../build/examples/ascc}
out=runs/data2d
mkdir -p "$out"
"$ascc" generate wbc2d -o "$out" --seed 100 --count 12 --frames 400 --spacing 0.0125
"$ascc" generate still-column -o "$out" --dimension 2 --seed 7 --count 2 --frames 200 --spacing 0.0125
"$ascc" generate pool-drop -o "$out" --dimension 2 --seed 8 --count 2 --frames 300 --spacing 0.0125
