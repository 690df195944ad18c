#!/bin/sh
# Makes what 2D networks learn from in examples/train/runs/data2d: the scenes of water2d beside the given ones, ten
# minutes; and a set over the whole range, with configs that train from it alone (runs/plain), about 0.06 core-hours.
# SPDX-License-Identifier: MIT
# sh examples/train/data2d.sh [PROGRAM [SHARE [THREADS]]]     SHARE: per cent of the set over the range (100)
set -eu
cd "$(dirname "$0")"
ascc=${1:-../../build/examples/ascc}
share=${2:-100}
threads=${3:-$(nproc)}
out=runs/data2d
mkdir -p "$out"

. ./range.sh
kind wbc2d 30
kind ramps2d 10
kind obstacles 30 --dimension 2 --frames 300
kind dam-break 16 --dimension 2 --frames 300
kind drops 16 --dimension 2 --frames 300
kind still-tank 10 --dimension 2 --frames 200
kind tilted-tank 10 --dimension 2 --frames 300
kind filling 10 --dimension 2 --frames 300
kind draining 8 --dimension 2 --frames 400
kind held-body 10 --dimension 2 --frames 300
kind film 14 --dimension 2 --frames 300
kind jet 10 --dimension 2 --frames 120
kind space 14 --dimension 2 --frames 300
kind paddle 8 --dimension 2 --frames 300
kind turning-tank 8 --dimension 2 --frames 300
kind floating-body 8 --dimension 2 --frames 300
kind sinking-body 8 --dimension 2 --frames 140
valid wbc2d
valid obstacles --dimension 2 --frames 300
valid drops --dimension 2 --frames 300
configs "*2d*.json" 2
spent

"$ascc" generate wbc2d -o "$out" --seed 100 --count 12 --frames 400 --spacing 0.0125 --solver sph
"$ascc" generate still-column -o "$out" --dimension 2 --seed 7 --count 2 --frames 200 --spacing 0.0125 --solver sph
"$ascc" generate pool-drop -o "$out" --dimension 2 --seed 8 --count 2 --frames 300 --spacing 0.0125 --solver sph
