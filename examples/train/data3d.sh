#!/bin/sh
# Makes what 3D networks learn from in examples/train/runs/data3d: the scenes of water3d beside the given ones, minutes;
# and a set over the whole range, with configs that train from it alone (runs/plain), about 0.5 core-hours.
# SPDX-License-Identifier: MIT
# sh examples/train/data3d.sh [PROGRAM [SHARE [THREADS]]]     SHARE: per cent of the set over the range (100)
set -eu
cd "$(dirname "$0")"
ascc=${1:-../../build/examples/ascc}
share=${2:-100}
threads=${3:-$(nproc)}
out=runs/data3d
mkdir -p "$out"
"$ascc" generate droplets -o "$out" --dimension 3 --seed 6 --count 3 --frames 80 --spacing 0.05 --solver sph
"$ascc" generate free-fall -o "$out" --dimension 3 --seed 5 --count 2 --frames 40 --spacing 0.05 --solver sph
"$ascc" generate still-tank -o "$out" --dimension 3 --seed 77 --count 8 --frames 60 --spacing 0.05
"$ascc" generate still-column -o "$out" --dimension 3 --seed 77 --count 2 --frames 60 --spacing 0.05
for bodies in "held-body 6" "floating-body 6" "sinking-body 6" "paddle 4"; do
    "$ascc" generate "${bodies% *}" -o "$out" --seed 31 --count "${bodies#* }" --frames 60 --threads "$threads"
done

. ./range.sh
kind liquid3d 30
kind obstacles 30
kind dam-break 16
kind drops 14
kind still-tank 10
kind tilted-tank 10
kind filling 10
kind draining 8
kind held-body 10
kind film 14
kind jet 10
kind space 14
kind paddle 8 --frames 60
kind turning-tank 8 --frames 60
kind floating-body 8 --frames 60
kind sinking-body 8
kind free-fall 3 --dimension 3 --frames 40
valid liquid3d
valid obstacles
valid dam-break
valid drops
configs "*3d*.json"
spent
