#!/bin/sh
# `ascc train` from outside: configs, interruption, going on, a full disk; prints TAP.
# $1: a build folder. SPDX-License-Identifier: MIT
cd "$(dirname "$0")/.." || exit 1
source=$(pwd)
ascc=$(cd "${1:-build}" && pwd)/examples/ascc || exit 1
number=0
failed=0
folder=$(mktemp -d) || exit 1
trap 'rm -rf "$folder"' EXIT
cd "$folder" || exit 1

report() {
    number=$((number + 1))
    if [ "$1" -eq 0 ]; then
        echo "ok $number - $2"
    else
        echo "not ok $number - $2"
        [ -f out ] && sed 's/^/# /' out err
        failed=1
    fi
}

run() { "$ascc" "$@" >out 2>err; }

# refuses STATUS TEXT ARGUMENTS...: ends with that status and one line with the text on stderr.
refuses() {
    wanted=$1
    text=$2
    shift 2
    run "$@"
    status=$?
    [ $status -eq "$wanted" ] && grep -qF -e "$text" err && [ ! -s out ]
    report $? "ascc $* is refused: $text"
}

# holds NAME COMMAND...: passes when the command does.
holds() {
    name=$1
    shift
    "$@" >/dev/null 2>&1
    report $? "$name"
}

"$ascc" generate wbc2d -o data --seed 4 --count 2 --frames 16 --spacing 0.06 >out 2>err
report $? 'sequences to learn from are generated'
"$ascc" info data/wbc2d_4_0000.safetensors >out 2>err
step=$(sed -n 's/.*frames .*, \([0-9.e-]*\) s apart/\1/p' out)

# config NAME OUTPUT [SED SCRIPT]: a config of 24 iterations, changed by the script.
config() {
    mkdir -p "$2"
    sed -e "s/STEP/$step/" -e "s|OUTPUT|$2/m.safetensors|" >"$1" <<'END'
{
  "network": {
    "name": "test", "dimension": 2, "spacing": 0.06, "time_step": STEP, "channels": 4,
    "levels": 1, "coarse_channels": [4]
  },
  "data": {
    "train": ["data/*_0000.safetensors", {"path": "data/wbc2d_4_0001.safetensors", "share": 2}],
    "valid": ["data/wbc2d_4_0001.safetensors"]
  },
  "stages": [
    {"iterations": 12, "unroll": 1, "learning_rate": 0.002, "learning_rate_end": 0.001},
    {"iterations": 12, "unroll": 2, "warm_up": 2, "learning_rate": 0.001}
  ],
  "batch": 2, "seed": 3, "clip": 1, "average": 0.9, "jitter": 0.01, "rotate": true, "mirror": true,
  "density_weight": 0.1, "wall_weight": 0.1, "position_gradients": true, "memory": 0.5,
  "output": "OUTPUT",
  "checkpoint": {"every_seconds": 0},
  "validate": {"every_iterations": 8, "frames": 4, "starts": 3}
}
END
    [ -z "$3" ] || { sed "$3" "$1" >changed && mv changed "$1"; }
}

# ---- What a config may say ----

# wrong TEXT SED SCRIPT: a config that is changed so is refused, and the text says why.
wrong() {
    config bad.json bad "$2"
    refuses 1 "$1" train bad.json
}
refuses 2 'a CONFIG is wanted' train
refuses 2 '--iterations 0: no value that it takes' train a.json --iterations 0
refuses 2 'a value is missing behind: --threads' train a.json --threads
refuses 2 'unknown option: --what' train a.json --what
refuses 1 'none.json: No such file' train none.json
holds 'help is told' sh -c '"$0" train --help | grep -q -e --resume' "$ascc"
printf '{"network": ' >broken.json
refuses 1 'broken.json: ' train broken.json
wrong "config: unknown key 'bach'" 's/"batch"/"bach"/'
wrong "network: unknown key 'chanels'" 's/"channels"/"chanels"/'
wrong "config: 'batch' is 0" 's/"batch": 2/"batch": 0/'
wrong "config: 'batch' must be a number" 's/"batch": 2/"batch": "2"/'
wrong "network: 'coarse_channels' must be a list of 1" 's/"coarse_channels": .4./"coarse_channels": [4, 4]/'
wrong "network: 'coarse_channels' must be a list of numbers" 's/"coarse_channels": .4./"coarse_channels": [9223372036854775807]/'
wrong "network: 'coarse_channels' must be integers" 's/"coarse_channels": .4./"coarse_channels": [4.5]/'
wrong "network: 'dimension' is 4" 's/"dimension": 2/"dimension": 4/'
wrong "wbc2d_4_0000.safetensors: a 3D model cannot learn from 2D" 's/"dimension": 2/"dimension": 3/'
wrong "network: 'kernel' does not understand 'mesh'" 's/"channels": 4,/"kernel": "mesh",/'
wrong "contact is within 0 and wall_radius" 's/"channels": 4,/"contact": 9,/'
wrong "projection is for kernel grid" 's/"channels": 4,/"projection": "radial",/'
wrong "'network', 'description' or 'model' is wanted" 's/"network"/"networks"/'
wrong "config: 'description' must be a text" 's/"batch"/"description": 1, "batch"/;s/"network"/"nothing"/'
wrong "config: 'network' and 'description' exclude each other" 's/"batch"/"description": "d.json", "batch"/'
wrong "d.json: No such file" 's/"batch"/"description": "d.json", "batch"/;s/"network"/"nothing"/'
wrong "relaxation: 'learn' lists 'rest_volume'" 's/"batch"/"relaxation": {"learn": ["limit"]}, "batch"/'
wrong "has no relaxation with 'omega' to learn" 's/"batch"/"relaxation": {"learn": ["omega"]}, "batch"/'
wrong "needs relaxation_gradients 0" 's/"batch"/"relaxation": {"learn": ["omega"]}, "relaxation_gradients": false, "batch"/'
wrong "stage 1: unknown key 'horizon'" 's/"unroll": 1/"unroll": 1, "horizon": 1/'
wrong "stage 2: 'unroll' is 0" 's/"unroll": 2/"unroll": 0/'
wrong "stage 1: unknown key 'rate'" 's/"learning_rate_end"/"rate"/'
wrong "data: train: *_0009.safetensors: there is no such file" 's|data/[*]_0000|*_0009|'
wrong "data: train: unknown key 'shared'" 's/"share"/"shared"/'
wrong "config: 'whiten' must be true or false" 's/"batch": 2/"batch": 2, "whiten": 1/'
wrong "'output' is missing" '/"output"/d'
wrong "validate: unknown key 'frame'" 's/"frames"/"frame"/'
wrong "nowhere/deep/m" 's|bad/m.saf|nowhere/deep/m.saf|'
rm -rf bad bad.json

# ---- From beginning to end ----

config whole.json whole
run train whole.json --threads 1
report $? 'a network is trained'
holds 'nothing but the result is printed when stderr is no terminal' sh -c '[ -s out ] && [ ! -s err ]'
holds 'the model can be loaded' "$ascc" info whole/m.safetensors
holds 'the latest model can be loaded' "$ascc" info whole/m-latest.safetensors
holds 'the log has a row an iteration' sh -c '[ "$(wc -l <whole/m.csv)" -eq 25 ]'
holds 'and what validation found' sh -c '[ "$(grep -c ",[01]$" whole/m.csv)" -eq 3 ]'
holds 'no temporary file is left' sh -c '[ -z "$(ls whole | grep part)" ]'
if command -v gnuplot >/dev/null 2>&1; then
    holds 'there is a chart' grep -q '</svg>' whole/m.svg
else
    holds 'a missing gnuplot is told' grep -q 'no chart: gnuplot' out
fi
refuses 1 'whole/m.checkpoint: is there already: --resume' train whole.json
run train whole.json --resume
report $? 'a run that is done is resumed in vain'
config plain.json whole 's/"batch": 2/"batch": 2, "whiten": false/'
refuses 1 'is of training with whitened inputs' train plain.json --resume
mkdir -p empty
PATH=$folder/empty run train whole.json --resume
holds 'without gnuplot a line says so' grep -q 'no chart: gnuplot' out

# ---- Weights of another model ----

config other.json other 's|"batch"|"model": "whole/m.safetensors", "batch"|;s/"channels": 4,/"channels": 4, "contact": 0.4,/;s/"iterations": [0-9]*/"iterations": 1/g;s/"learning_rate": [0-9.e-]*/"learning_rate": 1e-30/g;s/"learning_rate_end": [0-9.e-]*/"learning_rate_end": 1e-30/g'
run train other.json --threads 1
report $? 'a network begins with the weights of a model'
"$ascc" info whole/m.safetensors >one
holds 'with another contact it has the same weights' sh -c '
    tail -c 512 whole/m.safetensors >a; tail -c 512 other/m-latest.safetensors >b; cmp a b; grep -q contact other/m.safetensors'
config shape.json shape 's|"batch"|"model": "whole/m.safetensors", "batch"|;s/"coarse_channels": .4./"coarse_channels": [8]/'
refuses 1 "of the network is not there, or of another shape" train shape.json

# ---- Interrupted, in every way, the result is the same ----

# equals FOLDER NAME: weights, latest weights and losses are those of the whole run.
equals() {
    cut -d , -f 1-7,9- whole/m.csv >whole.rows
    cut -d , -f 1-7,9- "$1/m.csv" >"$1.rows"
    cmp whole/m.safetensors "$1/m.safetensors" >out 2>err &&
        cmp whole/m-latest.safetensors "$1/m-latest.safetensors" >out 2>err &&
        cmp whole/m.checkpoint "$1/m.checkpoint" >out 2>err &&
        cmp whole.rows "$1.rows" >out 2>err
    report $? "$2"
}

# ---- Words of earlier versions ----

config old.json old 's/"unroll"/"horizon"/;s/"warm_up"/"presteps"/'
run train old.json --threads 1 --iterations 13
sed '1s/unroll,warm_up/horizon,presteps/;1s/cpu_seconds/seconds/' old/m.csv >changed && mv changed old/m.csv
run train old.json --threads 1 --resume
holds 'an old log is gone on with' grep -q '^iteration,stage,horizon,presteps,' old/m.csv
sed '1s/horizon,presteps/unroll,warm_up/' old/m.csv >changed && mv changed old/m.csv
equals old 'old keys and an old log train the same bits'

# ---- A description in place of an architecture ----

network=$(tail -c +9 whole/m.safetensors | head -c 8192 |
    LC_ALL=C sed -n 's/.*"network":"\(.*\)","initial_weights.*/\1/p' | sed 's/\\"/"/g')
printf '%s' "$network" >described.network
config described.json described '/"network": {/,/},/d'
sed '1a "description": "described.network",' described.json >changed && mv changed described.json
run train described.json --threads 1
equals described 'a description trains as the architecture that makes it'
config inside.json inside '/"network": {/,/},/d'
{
    printf '{"description": ' && cat described.network && printf ',' && tail -n +2 inside.json
} >changed && mv changed inside.json
run train inside.json --threads 1 --iterations 1
report $? 'a description may stand in the config itself'

config threads.json threads
run train threads.json --threads 3
equals threads 'three threads learn the same bits as one'

config parts.json parts
run train parts.json --iterations 5
holds 'a run may stop early and says how to go on' grep -q 'ascc train parts.json --resume goes on' out
run train parts.json --resume --iterations 13
run train parts.json --resume
equals parts 'three runs learn the same bits as one'

config killed.json killed
tries=0
while [ $tries -lt 5 ] && ! grep -q '^24,' killed/m.csv 2>/dev/null; do
    "$ascc" train killed.json --resume >out 2>err &
    process=$!
    sleep "0.0$((4 + tries))$(awk 'BEGIN { srand(); print int(rand() * 10) }')"
    kill -KILL $process 2>/dev/null
    wait $process 2>/dev/null
    tries=$((tries + 1))
    if [ -f killed/m.checkpoint ]; then
        holds "killed, the latest model is whole ($tries)" sh -c \
            '[ ! -f killed/m-latest.safetensors ] || "$0" info killed/m-latest.safetensors' "$ascc"
    fi
done
run train killed.json --resume
report $? 'a run that was killed goes on'
equals killed 'and learns the same bits'

config stopped.json stopped 's/"iterations": 12/"iterations": 100000/g'
"$ascc" train stopped.json >out 2>err &
process=$!
tries=0
while [ $tries -lt 100 ] && [ ! -s stopped/m.checkpoint ]; do
    sleep 0.1
    tries=$((tries + 1))
done
kill -INT $process
wait $process
report $? 'an interrupted run ends well'
holds 'and says how to go on' grep -q 'ascc train stopped.json --resume goes on' out
holds 'and leaves a model' "$ascc" info stopped/m.safetensors

# ---- A network that cannot be computed ----

# The last 20 weights become the largest float there is.
config huge.json huge 's/"network": {/"model": "huge.safetensors",/; /"name"/d; /"levels"/,/}/d'
head -c -80 whole/m.safetensors >huge.safetensors
for weight in 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20; do
    printf '\377\377\177\177' >>huge.safetensors
done
refuses 1 'nor any rollout of the 19 iterations before' train huge.json
holds 'sequence and frame are named' grep -q 'iteration 21: sequence [0-9a-z_/.]*, frame [0-9]*: ' err
holds 'the weights before are saved, and that is told' grep -q 'huge/m.checkpoint and huge/m.*hold iteration' err

# ---- Outputs that cannot be: told before the work ----

# A stage that never ends: what is refused is refused before it.
mkdir odd
mkfifo odd/fifo
for change in 's|odd/m.safetensors|odd/fifo|' 's|"batch"|"log": "odd/fifo", "batch"|' \
    's|"checkpoint": {|"checkpoint": {"path": "odd/fifo", |'; do
    config odd.json odd "$change; s/\"iterations\": 12/\"iterations\": 900000000/"
    timeout 20 "$ascc" train odd.json >out 2>err
    [ $? -eq 1 ] && grep -q 'ascc train: odd/fifo: cannot be written: it is no regular file' err
    report $? "no training for a FIFO: $change"
done
holds 'and is there still' [ -p odd/fifo ]
wrong 'a path holds a control character' 's|"batch"|"log": "a\\nb.csv", "batch"|'
# gnuplot runs what a path begins with after these; ours keeps what it is told.
mkdir -p gnuplot
printf '#!/bin/sh\ncat >>script\n' >gnuplot/gnuplot
chmod +x gnuplot/gnuplot
for first in '|' '<' -; do
    config "told.json" told "s#\"batch\"#\"log\": \"${first}touch told.csv\", \"batch\"#"
    rm -f told/* script
    PATH=$folder/gnuplot:$PATH run train told.json --iterations 1
    holds "gnuplot is given a file, not a command, where the log begins with $first" sh -c '
        grep -qF "set output '"'./${first}touch told.svg'"'" script &&
            grep -qF "plot '"'./${first}touch told.csv'"'" script'
done

# ---- A damaged checkpoint, a full disk ----

config damaged.json damaged
run train damaged.json --iterations 2
head -c 300 damaged/m.checkpoint >cut && mv cut damaged/m.checkpoint
refuses 1 'damaged/m.checkpoint: ' train damaged.json --resume
# The last float becomes NaN.
rm -f damaged/m.checkpoint
run train damaged.json --iterations 2
head -c -4 damaged/m.checkpoint >nan && printf '\000\000\300\177' >>nan && mv nan damaged/m.checkpoint
refuses 1 "tensor 'whitening' holds a value that is not finite" train damaged.json --resume

config full.json full
run train full.json --iterations 3
cp full/m.checkpoint before.checkpoint
# Files of at most one block: that is a disk without room for a checkpoint.
sh -c 'trap "" XFSZ; ulimit -f 1; exec "$0" train full.json --resume' "$ascc" >out 2>full.err
[ $? -eq 1 ] && grep -q 'ascc train: full/m' full.err && grep -qi 'too large' full.err
report $? 'a full disk is an error that names the file'
holds 'and the checkpoint from before is whole' cmp full/m.checkpoint before.checkpoint
holds 'and can be gone on from' "$ascc" train full.json --resume --iterations 4

config device.json device 's|"checkpoint": {|"checkpoint": {"path": "/dev/full/c", |'
run train device.json --iterations 2
[ $? -eq 1 ] && grep -q 'ascc train: /dev/full/c: ' err
report $? 'a checkpoint that cannot be written is an error'
config log.json log 's|"batch"|"log": "/dev/full", "batch"|'
run train log.json --iterations 2
[ $? -eq 1 ] && grep -q 'ascc train: /dev/full: ' err
report $? 'a log that cannot be written is an error'

echo 'not a log' >notes.csv
config notes.json notes 's|"batch"|"log": "notes.csv", "batch"|'
refuses 1 'notes.csv: is not the log of a training run' train notes.json --iterations 2
holds 'a file that is no log is left as it is' sh -c 'echo "not a log" | cmp - notes.csv'

# ---- A published network ----

tail -c +2 "$source/tests/fuzz/corpus/model/cconv-f" >published
run sim published dam-break-3d --size 5 -n 8 -o fall.safetensors
cat >published.json <<'END'
{"model": "published", "data": {"train": ["fall.safetensors"]}, "output": "learned.safetensors",
 "stages": [{"iterations": 2, "unroll": 1, "learning_rate": 0.001}]}
END
run train published.json
[ $? -eq 0 ] && "$ascc" info learned.safetensors | grep -q 'model small'
report $? 'a published network can be trained on'
LC_ALL=C sed 's/poly6/poly7/' published >unknown && sed 's/"published"/"unknown"/' published.json >unknown.json
refuses 1 "unknown: architecture 'conv': 'window' is not understood" train unknown.json

# ---- The mean of two networks' weights ----

average() { python3 "$source/examples/train/average.py" "$@" >out 2>err; }

# Of every number: a quarter of the one, three quarters of the other, in doubles, and no other byte.
is_mean() {
    python3 - "$@" <<'END'
import struct, sys
raw = [open(path, "rb").read() for path in sys.argv[1:4]]
end = 8 + struct.unpack("<Q", raw[0][:8])[0]
count = (len(raw[0]) - end) // 4
mean, one, two = (struct.unpack(f"<{count}f", r[end:]) for r in raw)
far = max(abs(m - 0.25 * a - 0.75 * b) for m, a, b in zip(mean, one, two))
assert raw[0][:end] == raw[1][:end] and one != two and far < 1e-7, far
END
}

cp learned.safetensors one.safetensors
sed -e 's/"published"/"one.safetensors"/' -e 's/"learned.safetensors"/"two.safetensors"/' published.json >two.json
run train two.json
average mean.safetensors one.safetensors=0.25 two.safetensors=0.75
holds 'average.py gives the mean of weights' is_mean mean.safetensors one.safetensors two.safetensors
holds 'which is a network' "$ascc" info mean.safetensors
average none.safetensors one.safetensors=0.25 two.safetensors=0.5
[ $? -ne 0 ] && [ ! -e none.safetensors ] && grep -q 'not 1 in all' err
report $? 'shares that are not 1 in all are refused'

# ---- The examples are configs that the program understands ----

for example in "$source"/examples/train/*.json; do
    [ -f "$example" ] || continue
    sed -e 's#"[^"]*/\(liquid3d\|wbc2d\|data2d\|data3d\|steps3d\)/[^"]*"#"data/*"#g' \
        -e "s#\"model\": \"[^\"]*\"#\"model\": \"$source/examples/models/water3d.safetensors\"#" \
        "$example" >example.json
    sed -i "s|\"output\": \"[^\"]*/[^\"]*\"|\"output\": \"$folder/nowhere/deep/m.safetensors\"|" example.json
    run train example.json --iterations 1
    [ $? -eq 1 ] && ! grep -q 'example.json: ' err
    report $? "$(basename "$example") is understood"
done

if command -v script >/dev/null 2>&1; then
    config bar.json bar
    script -qec "'$ascc' train bar.json --iterations 9" /dev/null >out 2>err </dev/null
    grep -q 'loss .* steps/s \[.*left' out
    report $? 'a terminal gets a progress bar with loss and time left'
fi
echo "1..$number"
exit $failed
