#!/bin/sh
# The networks that are shipped: small, as cheap as said, and exact about momentum, and baselines; prints TAP.
# $1: a build folder. SPDX-License-Identifier: MIT
cd "$(dirname "$0")/.." || exit 1
ascc=${1:-build}/examples/ascc
. tests/support/tap.sh

small() { [ "$(wc -c <"$1")" -le 1048576 ]; }
card() { [ -f "docs/models/$1.md" ] && grep -q '^## Measured' "docs/models/$1.md"; }
conserves() { "$ascc" info "$1" | grep -E "^ *conserves +$2"; }
cheap() { "$ascc" info "$1" | awk -v most="$2" '/^ *cost/ { print; fine = $3 <= most } END { exit !fine }'; }
# Two drops collide: no momentum is made or lost, in whole quanta.
trusted() { "$ascc" info "$1" | grep -E '^ *trust .*errors double at [1-9]'; }
exact() { "$ascc" sim "$1" "droplets-$2" --size 8 -n 60 -o "$folder/d" 2>&1 | grep 'momentum error *0  (0 0 0 quanta'; }
turns() {
    "$ascc" sim "$1" "droplets-$2" --size 8 -n 60 -o "$folder/d" 2>&1 |
        awk '/^angular mom. error/ { print; fine = $4 < 1e-6 } END { exit !fine }'
}
same() {
    for threads in 1 3; do
        "$ascc" sim "$1" "dam-break-$2" --size 8 -n 20 --threads $threads -o "$folder/t$threads" || return 1
    done
    cmp "$folder/t1" "$folder/t3"
}

for dimension in 2d 3d; do
    for model in water$dimension water$dimension-tiny water$dimension-large; do
        [ $model = water2d-large ] && continue
        file=examples/models/$model.safetensors
        most=60000
        [ $model = water$dimension-tiny ] && most=15000
        check "$model is at most 1 MB" small "$file"
        check "$model takes at most $most multiply-adds a particle" cheap "$file" $most
        check "$model has a card with measurements" card $model
        check "$model says that it conserves momentum" conserves "$file" momentum
        check "$model conserves momentum to the bit when drops collide" exact "$file" $dimension
        check "$model gives the same bits on three threads" same "$file" $dimension
        check "$model tells its distance from training" trusted "$file"
    done
    tiny=examples/models/water$dimension-tiny.safetensors
    check "water$dimension-tiny says that it conserves angular momentum" conserves "$tiny" 'momentum, angular momentum'
    check "water$dimension-tiny conserves angular momentum when drops collide" turns "$tiny" $dimension
done
for dimension in 2d 3d; do
    file=examples/models/pbf$dimension.safetensors
    check "pbf$dimension has a card with measurements" card pbf$dimension
    check "pbf$dimension conserves momentum to the bit when drops collide" exact "$file" $dimension
    check "pbf$dimension gives the same bits on three threads" same "$file" $dimension
done
file=examples/models/paper3d.safetensors
check "paper3d is at most 1 MB" small "$file"
check "paper3d has a card with measurements" card paper3d
check "paper3d conserves momentum to the bit when drops collide" exact "$file" 3d

# Other methods', for comparison: what they lose is told.
described() { grep -q "^### $1\$" docs/models/baselines.md; }
loses() {
    "$ascc" sim "$1" "droplets-$2" --size 8 -n 20 -o "$folder/d" 2>&1 |
        grep -E '^momentum error .*\([-0-9 ]*[1-9][-0-9 ]* quanta.*this model does not conserve it'
}
for file in examples/models/baselines/*.safetensors; do
    model=$(basename "$file" .safetensors)
    dimension=$(echo "$model" | grep -o '[23]d')
    check "$model is at most 1 MB" small "$file"
    check "$model has its part of a card with measurements" described "$model"
    check "$model says that it conserves nothing" conserves "$file" 'nothing exactly'
    check "what momentum $model loses is told" loses "$file" "$dimension"
    check "$model gives the same bits on three threads" same "$file" "$dimension"
done
echo "1..$number"
exit $failed
