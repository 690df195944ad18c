#!/bin/sh
# examples/hosts: bodies of Box2D and Bullet in water for a few frames; prints TAP. $1: a build folder.
# SPDX-License-Identifier: MIT
cd "$(dirname "$0")/.." || exit 1
build=${1:-build}
. tests/support/tap.sh

# ENGINE MODEL SCENE FRAMES: runs, writes its pictures, and the body is where it should be (LOW to HIGH spacings).
host() {
    program=$build/examples/hosts/host_$1
    mkdir -p "$folder/$1-$3"
    "$program" "examples/models/$2.safetensors" "$3" "$4" "$folder/$1-$3" 20 >"$folder/said" &&
        [ "$(ls "$folder/$1-$3" | wc -l)" -eq $(($4 / 20 + 1)) ] &&
        awk -v low="$5" -v high="$6" '{ print; for (i = 2; i < NF; i++)
            if ($(i + 1) ~ /^spacings/) { sub(/\(/, "", $i); found = $i > low && $i < high } }
            END { exit !found }' "$folder/said"
}
for engine in box2d bullet; do
    if [ ! -x "$build/examples/hosts/host_$engine" ]; then
        skip "bodies of $engine in water" "no $engine when this was built"
        continue
    fi
    case $engine in
    box2d)
        check 'a box of half the density floats (Box2D)' host box2d water2d float 200 16 24
        check 'one of twice the density sinks to the floor (Box2D)' host box2d water2d sink 200 5 8
        check 'a driven bar turns in the surface (Box2D)' host box2d water2d wheel 40 16.9 17.1
        ;;
    bullet)
        check 'a box of half the density floats (Bullet)' host bullet pbf3d float 60 4 10
        check 'one of twice the density sinks to the floor (Bullet)' host bullet pbf3d sink 60 2.4 2.8
        check 'a light body rides a wave (Bullet)' host bullet pbf3d boat 20 7 11
        ;;
    esac
done
echo "1..$number"
exit $failed
