#!/bin/sh
# The stability suite on some scenes with a few methods: what passes, what fails; prints TAP.
# $1: a build folder. SPDX-License-Identifier: MIT
cd "$(dirname "$0")/.." || exit 1
models=$PWD/examples/models
stability=$(cd "${1:-build}" && pwd)/bench/stability || exit 1
number=0
failed=0
folder=$(mktemp -d) || exit 1
trap 'rm -rf "$folder"' EXIT
cd "$folder" || exit 1
mkdir -p docs/figures

holds() {
    name=$1
    shift
    number=$((number + 1))
    if "$@" >/dev/null 2>&1; then
        echo "ok $number - $name"
    else
        echo "not ok $number - $name"
        sed 's/^/# /' out err
        failed=1
    fi
}

cat >docs/stability.md <<'END'
before
<!-- matrix begins -->
old
<!-- matrix ends -->
<!-- flat matrix begins -->
older
<!-- flat matrix ends -->
after
END
"$stability" --quick --budget 60 --frames 8 --docs docs --methods 'SPH;DFSPH;ballistic' \
    --scenes 'dam break;jet at a sheet' >out 2>err
holds 'the suite runs' [ $? -eq 0 ]
holds 'SPH holds a dam break for eight frames' grep -qE '^dam break +SPH .* pass: 8 of 8' out
holds 'DFSPH holds a dam break for eight frames' grep -qE '^dam break +DFSPH .* pass: 8 of 8' out
holds 'SPH holds a jet at one layer of wall' grep -qE '^jet at a sheet +SPH .* pass: 8 of 8' out
holds 'free flight is seen to go through it' grep -qE '^jet at a sheet +ballistic .* through' out
holds 'the matrix replaces the old one, and nothing else' sh -c '
    [ "$(head -n 1 docs/stability.md)" = before ] && [ "$(tail -n 1 docs/stability.md)" = after ] &&
        ! grep -qx old docs/stability.md && grep -qx older docs/stability.md && grep -q "| dam break | \*\*pass: 8 of 8\*\* |" docs/stability.md'
holds 'the picture is whole' sh -c 'tail -n 1 docs/figures/stability.svg | grep -qF "</svg>"'
"$stability" --quick --budget 0.000001 --methods SPH --scenes 'still column' --jobs 1 >out 2>err
holds 'a cell out of time does not pass' grep -q 'no failure in 0 of' out
"$stability" --quick --frames 2 --methods none --model demo --model some/where.safetensors \
    --scenes 'single particle' --jobs 1 >out 2>err
holds 'a model file is a method more' grep -qE '^single particle +demo .* pass: 2 of 2' out
holds 'a file that is not there fails its cells' grep -qE '^single particle +where .* frame 0 of 2: model' out
for scenes in 'jet at a sheet' 'jet at a sheet;single particle'; do
    "$stability" --quick --frames 8 --methods ballistic --jobs 1 --keep kept --scenes "$scenes" >out 2>err
    sed -i 's/128 of 128/all/' kept
done
holds 'a run goes on with the cells that are kept' grep -q '^jet at a sheet .* frame 2 of 8: all through$' out
holds 'and runs and keeps the others' sh -c 'grep -q "^single particle .* pass: 8 of 8" out && [ "$(wc -l <kept)" = 2 ]'
"$stability" --quick --frames 2 --methods ballistic --jobs 1 --keep kept --scenes 'jet at a sheet' >out 2>err
holds 'of as many frames only' grep -q ' frame 2 of 2: 128 of 128 through' out
"$stability" --quick --frames 24 --methods ballistic --model "$models/pbf3d.safetensors" --jobs 1 \
    --scenes 'paddle;thin cup;tap' >out 2>err
holds 'a paddle leaves nothing behind' grep -qE '^paddle +pbf3d .* pass: 24 of 24' out
holds 'a cup of one sheet holds what is in it' grep -qE '^thin cup +pbf3d .* pass: 24 of 24' out
holds 'free flight leaves it' grep -qE '^thin cup +ballistic .* escaped$' out
holds 'what a method cannot do is no pass' [ "$(grep -c ' cannot: ' out)" = 2 ]
"$stability" --quick --frames 40 --methods ballistic --model "$models/water3d-tiny.safetensors" --jobs 1 \
    --scenes 'sleep and wake' >out 2>err
holds 'a method that knows no sleep says so' grep -q '^sleep and wake  *ballistic .* cannot: no sleep' out
holds 'a pool that is awake does not pass for asleep' grep -q '^sleep and wake  *water3d-tiny .* 0 % asleep at half' out
"$stability" --quick --methods ballistic --model "$models/pbf3d.safetensors" --jobs 1 --scenes budget >out 2>err
holds 'a method without a cheaper model says so' grep -q 'ballistic .* cannot: no cheaper model' out
holds 'a model changes to the one below and back' grep -qE '^budget +pbf3d .* pass: 180 of 180' out
ASCC_MODEL_PATH=$models "$stability" --quick --methods none --model demo --jobs 1 --scenes seam >out 2>err
holds 'a model that cannot share a step says why' grep -qE '^seam +demo .* cannot: detail: ' out
"$stability" --quick --dimension 2 --frames 20 --docs docs --methods ballistic --model "$models/pbf2d.safetensors" \
    --scenes 'turned tank;sideways gravity;dam break' >out 2>err
holds 'a flat tank may turn' grep -qE '^turned tank +pbf2d .* pass: 20 of 20' out
holds 'flat scenes turn as deep ones do' grep -qE '^sideways gravity +pbf2d .* pass: 20 of 20' out
holds 'the flat matrix replaces the old one, and not the deep one' sh -c '
    ! grep -qx older docs/stability.md && grep -q "run in 2D" docs/stability.md && grep -q "run in 3D" docs/stability.md &&
        [ "$(tail -n 1 docs/stability.md)" = after ]'
"$stability" --scenes nowhere >out 2>err
holds 'a scene that is not there is an error' [ $? -eq 1 ]
echo "1..$number"
exit $failed
