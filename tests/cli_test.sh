#!/bin/sh
# The ascc program from outside: arguments, files, pictures, interruption; prints TAP.
# $1: a build folder. SPDX-License-Identifier: MIT
cd "$(dirname "$0")/.." || exit 1
root=$(pwd)
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
    [ $status -eq "$wanted" ] && grep -qF -e "$text" err && [ ! -s out ] &&
        { [ "$(wc -l <err)" -eq 1 ] || [ $# -eq 0 ]; }
    report $? "ascc $* is refused: $text"
}

# holds NAME COMMAND...: passes when the command does.
holds() {
    name=$1
    shift
    "$@" >/dev/null 2>&1
    report $? "$name"
}

words='sim demo dam-break-2d --size 6'
# shellcheck disable=SC2086
{
    refuses 2 "usage: ascc COMMAND"
    refuses 2 "'swim' is no command" swim
    refuses 2 "MODEL and SCENE are wanted" sim
    refuses 2 "MODEL and SCENE are wanted" sim demo -n 3
    refuses 2 "-n STEPS is wanted" $words
    refuses 2 "value is missing behind: -n" $words -n
    refuses 2 "-n 0: a whole number" $words -n 0
    refuses 2 "-n 3x: a whole number" $words -n 3x
    refuses 2 "-n 99999999999999999999: a whole number" $words -n 99999999999999999999
    refuses 2 "--every 0: a whole number" $words -n 1 --every 0
    refuses 2 "--threads 1025: a whole number" $words -n 1 --threads 1025
    refuses 2 "--size 3: a whole number" sim demo dam-break-2d -n 1 --size 3
    refuses 2 "--dt -1: a number" $words -n 1 --dt -1
    refuses 2 "--dt nan: a number" $words -n 1 --dt nan
    refuses 2 "--spacing 0: a number" $words -n 1 --spacing 0
    refuses 2 "--gravity 1: two or three" $words -n 1 --gravity 1
    refuses 2 "--gravity 1,2,3,4: two or three" $words -n 1 --gravity 1,2,3,4
    refuses 2 "--gravity 1,inf: two or three" $words -n 1 --gravity 1,inf
    refuses 1 "--gravity has 3 numbers, dam-break-2d 2 dimensions" $words -n 1 --gravity 0,0,0
    refuses 2 "--velocity takes stored or difference: fast" $words -n 1 --velocity fast
    refuses 1 "--velocity difference takes two frames" $words -n 1 --velocity difference
    refuses 2 "unknown option: --what" $words -n 1 --what 3
    refuses 2 "one argument too many: more" $words more -n 1
    refuses 1 "lake: neither a file nor a scene's name" sim demo lake-2d -n 1
    refuses 1 "lake: No such file" sim demo lake -n 1
    refuses 1 "cannot open 'none', and no folder of models has 'none.safetensors'" sim none dam-break-2d -n 1
    refuses 1 "/nowhere/o: cannot be written: No such file" $words -n 1 -o /nowhere/o
    refuses 1 "/nowhere/f: No such file" $words -n 1 --frames /nowhere/f
    refuses 1 "/nowhere/p: No such file" $words -n 1 --ply /nowhere/p
    refuses 1 "/dev/null/f" $words -n 1 --frames /dev/null/f
    refuses 2 "one FILE is wanted" info
    refuses 2 "a SEQUENCE and -o DIR are wanted" show
    refuses 2 "MODEL and SCENE, or a SEQUENCE is wanted" view
    refuses 2 "MODEL and SCENE, or a SEQUENCE is wanted" view a.safetensors --model demo
    refuses 2 "one argument too many: c" view a b c
    refuses 2 "--ball 0: a number" view demo dam-break-2d --ball 0
    refuses 1 "none: No such file" view none
    refuses 2 "--every 0: no value that it takes" show none -o shown --every 0
    refuses 1 "none: No such file" show none -o shown
    refuses 1 "no folder of models has 'none.safetensors'" info none
    refuses 1 "is no regular file" info .
    printf 'not a model' >text
    refuses 1 "neither a model nor a sequence" info text
    refuses 1 "longer than the file" sim demo text -n 1
}

refuses 2 "one sequence too many: " eval ballistic $(seq 300)
refuses 2 "a METHOD and a SEQUENCE are wanted" eval
refuses 1 "ascc eval: x: No such file" eval ballistic x
refuses 2 "a FILE is wanted" lint
refuses 2 "--clump 0: no value that it takes" lint --clump 0 x
refuses 2 "lint: x: No such file" lint x
refuses 2 "a CONFIG is wanted" train
refuses 2 "a KIND and -o DIR are wanted" generate wbc2d
refuses 2 "there is no such kind: wbc2; did you mean 'wbc2d'?" generate wbc2 -o o
refuses 1 "neither a file nor a scene's name; did you mean 'dam-break-2d'?" sim demo dam-brake-2d -n 1
refuses 2 "'smi' is no command; did you mean 'sim'?" smi
refuses 2 "'conv' is no command; did you mean 'convert'?" conv
refuses 2 "'-x' is no option; ascc --help tells more" -x
refuses 2 "'nothing-like-it' is no command; ascc --help tells more" help nothing-like-it
# Every option that a help text tells is known where its last letter is missing.
for command in sim show view generate lint eval relax trust train convert; do
    "$ascc" $command --help | grep -oE -e '--[a-z]{3,}[a-z-]*' | sort -u >options
    for option in $(grep -v -x -e --help options); do
        refuses 2 "unknown option: ${option%?}; did you mean '$option'?" $command "${option%?}" x
    done
done
for words in -h 'sim -h' 'sim demo --help' 'lint x -h' 'help eval' 'generate -o x -h' -V; do
    # shellcheck disable=SC2086
    run $words
    [ $? -eq 0 ] && grep -qE "^(usage: )?ascc" out && [ ! -s err ]
    report $? "ascc $words helps"
done
holds 'help of a command is the same however it is asked for' sh -c '
    "$0" sim --help >a && "$0" help sim >b && "$0" sim demo -h >c && cmp a b && cmp a c' "$ascc"

for option in help --help version --version 'sim --help' 'info --help' 'convert --help'; do
    # shellcheck disable=SC2086
    holds "ascc $option says something on stdout" sh -c '"$0" $1 | grep -q ascc' "$ascc" "$option"
done

# A small network as the published ones are described: an input of the fuzzer's, behind its first byte.
tail -c +2 "$root/tests/fuzz/corpus/model/cconv-f" >published
run convert published -o m.safetensors
report $? 'a published network is converted'
holds 'and says what it became' grep -q '^m.safetensors: model small, 221 parameters$' out
holds 'info tells the same of both' sh -c '
    "$0" info published | tail -n +2 >a && "$0" info m.safetensors | tail -n +2 >b && cmp a b' "$ascc"
# Behind the header, which names the model.
holds 'both run to the same bytes' sh -c '
    "$0" sim published dam-break-3d --size 5 -n 3 -o p &&
        "$0" sim m.safetensors dam-break-3d --size 5 -n 3 -o q &&
        tail -c +8193 p >a && tail -c +8193 q >b && [ -s a ] && cmp a b' "$ascc"
refuses 2 "a network and -o FILE are wanted" convert
refuses 2 "a network and -o FILE are wanted" convert published
refuses 2 "one argument too many: more" convert published more -o o
refuses 1 "none: No such file" convert none -o o
refuses 1 ".: is no regular file" convert . -o o
refuses 1 "text: the header of" convert text -o o
refuses 1 "'format' is 'ascc.model', not 'ascc.weights'" convert m.safetensors -o o
refuses 1 "published: is the network that is to be converted" convert published -o published
ln -s published link
refuses 1 "link: is the network that is to be converted" convert published -o link
refuses 1 "cannot write '/nowhere/o'" convert published -o /nowhere/o
LC_ALL=C sed 's/poly6/poly7/' published >unknown
refuses 1 "architecture 'conv': 'window' is not understood: 'poly7" convert unknown -o m.safetensors
refuses 1 "'window' is not understood: 'poly7" sim unknown dam-break-3d -n 1
refuses 1 "'window' is not understood: 'poly7" info unknown
LC_ALL=C sed 's/, dim 3/, dim 2/' published >flat
refuses 1 "'network' and 'dim' contradict each other" convert flat -o m.safetensors
holds 'what is refused leaves the old file as it was' "$ascc" info m.safetensors
echo old >old
run convert published -o old
holds 'a file that is there is replaced' cmp old m.safetensors
holds 'nothing else is written' [ ! -e o ]

refuses 2 "a model, or --new with --spacing and --dt, and -o are wanted" relax
refuses 2 "a model, or --new" relax --new 3 --spacing 0.05 -o r.safetensors
refuses 2 "unknown option: --sweeps" relax --new 3 --sweeps 4
refuses 2 "--omega 0.5,x: no value that it takes" relax --new 3 --omega 0.5,x
refuses 1 "no folder of models has 'nowhere.safetensors'" relax nowhere.safetensors -o r.safetensors
echo text >r.txt
refuses 1 "r.txt: " relax r.txt -o r.safetensors
refuses 1 "'omega' would not settle" relax --new 3 --spacing 0.05 --dt 0.02 --omega 0.6 -o r.safetensors
holds 'a refused relaxation leaves no file' test ! -e r.safetensors
run relax --new 2 --spacing 0.02 --dt 0.005 -o r.safetensors
holds 'ascc relax --new makes a model that runs' "$ascc" sim r.safetensors dam-break-2d --size 8 -n 20
run relax r.safetensors --omega 0.5,0.5 --divergence none -o s.safetensors
holds 'and another relaxation takes its place' sh -c 'grep -q "omega[^a-z]*0.5,0.5]" s.safetensors && ! grep -q divergence s.safetensors'
run relax r.safetensors --hyperviscosity 0.5,0.4 --below 0.2 -o s.safetensors
holds 'a relaxation with a hyperviscosity runs' "$ascc" sim s.safetensors dam-break-2d --size 8 -n 20
refuses 1 "'shares'" relax r.safetensors --hyperviscosity 0.6 -o s.safetensors
refuses 1 "output" relax r.safetensors --none -o s.safetensors
rm -f r.safetensors s.safetensors r.txt

run sim demo dam-break-2d --size 8 -n 20 --every 10 -o a.safetensors --frames png --ply ply
report $? 'the demonstration model runs in 2D'
holds 'the table has particles, phases and energy' sh -c '
    grep -q "^particles  *32 fluid" out && grep -q "^  pairs .* ms a step" out &&
        grep -q "^energy " out'
holds 'the momentum error is exactly zero' grep -q '^momentum error  *0  (0 0 0 quanta' out
holds 'and says why angular momentum is not measured' grep -q '^angular mom. error  *not measured' out
holds 'nothing but the table is printed when stderr is no terminal' [ ! -s err ]
holds 'the sequence is described' sh -c '
    "$0" info a.safetensors | grep -q "frames  *3, .* s apart"' "$ascc"
holds 'no temporary file is left' sh -c '[ -z "$(ls | grep part)" ]'
holds 'there is a picture and a point cloud for each frame' sh -c '
    [ "$(ls png)" = "frame_00000.png
frame_00010.png
frame_00020.png" ] && [ "$(ls ply | wc -l)" -eq 3 ]'
# The signature, and the end chunk: IEND with its checksum.
holds 'pictures are whole PNG files' sh -c '
    for f in png/*; do
        [ "$(head -c 8 $f | od -An -tx1 | tr -d " ")" = 89504e470d0a1a0a ] &&
            [ "$(tail -c 8 $f | od -An -tx1 | tr -d " ")" = 49454e44ae426082 ] || exit 1
    done'
holds 'point clouds have 40 bytes a particle behind their header' sh -c '
    for f in ply/*; do
        header=$(sed "/^end_header/q" $f | wc -c)
        head -n 3 $f | tail -n 1 | grep -q "element vertex 32" &&
            [ $(($(wc -c <$f) - header)) -eq $((32 * 40)) ] || exit 1
    done'

refuses 1 "; did you mean 'ballistic'?" eval balistic a.safetensors
run show a.safetensors -o shown --every 2
holds 'show draws the frames it is asked for' sh -c '[ "$(ls shown | tr "\n" " ")" = "frame_00000.png frame_00002.png " ]'

run sim demo dam-break-2d --size 8 -n 20 --every 10 -o b.safetensors --threads 3
holds 'three threads write the same bytes as one' cmp a.safetensors b.safetensors
cp "$root/examples/models/pbf2d.safetensors" "$root/examples/models/water2d.safetensors" .
run sim --ladder pbf2d.safetensors,water2d.safetensors --budget 1000000 dam-break-2d --size 8 -n 20 --ply ladder
holds 'a ladder with time enough runs its best model' grep -q '^  water2d.safetensors  *20 steps' out
run sim water2d.safetensors dam-break-2d --size 8 -n 20 --ply alone
holds 'and moves as that model alone' diff -r ladder alone
run sim --ladder pbf2d.safetensors,water2d.safetensors --budget 0.001 dam-break-2d --size 8 -n 20
holds 'a ladder without time says that nothing is fast enough' grep -q 'over the budget  *20 of 20 .*no model of the ladder' out
run sim water2d.safetensors still-column-2d --size 8 -n 400 --sleep 1
holds 'fluid at rest sleeps when it may' grep -q '^asleep  *[1-9]' out
holds 'and no quantum is lost' grep -q '^momentum error  *0  (0 0 0 quanta' out
run sim water2d.safetensors dam-break-2d --size 8 -n 20 --trust 0 --ply measured
holds 'a network tells how far it is from its training' grep -qE '^from training  *[0-9.]+ times as far as usual' out
holds 'and moves as without' diff -r measured alone
run sim --ladder pbf2d.safetensors,water2d.safetensors --trust 0.01 dam-break-2d --size 8 -n 20
holds 'a ladder falls back where a network is far from its training' grep -q '^  pbf2d.safetensors  *19 steps' out
holds 'and says so' grep -q '^trust  *none in a network now' out
run sim pbf2d.safetensors dam-break-2d --size 8 -n 5 --trust 0
holds 'a model without a network says that it cannot tell' grep -q '^from training  *the model has no statistics' out
run sim --ladder pbf2d.safetensors,water2d.safetensors --detail surface:9 dam-break-2d --size 8 -n 20 --ply detailed
holds 'where all is detail the best model moves it' diff -r detailed alone
run sim pbf2d.safetensors dam-break-2d --size 8 -n 20 --ply first
run sim --ladder pbf2d.safetensors,water2d.safetensors --detail near:99,99,0.1 dam-break-2d --size 8 -n 20 --ply elsewhere
holds 'where none is the first one does' diff -r elsewhere first
run sim --ladder "$root/examples/models/water2d-tiny.safetensors,water2d.safetensors" --detail fast:0.4+near:0.1,0.05,0.03 dam-break-2d --size 16 -n 20
holds 'part of the fluid may be detail' grep -qE '^detail  *[1-9][0-9.]* % of the fluid by water2d' out
holds 'and momentum is exact across the seam' grep -q '^momentum error  *0  (0 0 0 quanta' out
refuses 1 'their relaxations differ in support or rest volume' sim --ladder pbf2d.safetensors,water2d.safetensors --detail surface:0.02 dam-break-2d -n 1
refuses 2 '--detail takes a --ladder' sim demo dam-break-2d -n 1 --detail fast:1
refuses 1 'near:X,Y,R, fast:V and surface:D are known' sim --ladder pbf2d.safetensors,water2d.safetensors --detail near:1,2 dam-break-2d -n 1
refuses 2 '--trust takes a number from 0' sim demo dam-break-2d -n 1 --trust far
refuses 1 'has no statistics of its training' sim --ladder "$root/examples/models/pbf3d.safetensors,$root/examples/models/paper3d.safetensors" --trust 1 dam-break-3d -n 1
refuses 2 'a MODEL, a SEQUENCE and -o are wanted' trust water2d.safetensors -o t.safetensors
refuses 2 'unknown option: --frame' trust water2d.safetensors a.safetensors --frame 3
refuses 1 'nowhere.safetensors' trust nowhere.safetensors a.safetensors -o t.safetensors
holds 'refused statistics leave no file' test ! -e t.safetensors
run generate wbc2d -o fine --seed 1 --count 3 --frames 1 --spacing 0.005
of_paper_size() {
    for n in 0 1 2; do
        "$ascc" info fine/wbc2d_1_000$n.safetensors | awk '/fluid particles/ { n = $3 + 0 } END { exit n < 6000 || n > 12000 }' || return 1
    done
}
holds 'scenes of 0.005 m are of the paper'"'"'s size, some 10,000 particles' of_paper_size
run generate wbc2d -o g --seed 4 --count 1 --frames 8 --spacing 0.0125 --solver sph
run trust water2d.safetensors g/wbc2d_4_0000.safetensors -o t.safetensors --frames 4 --threshold 3.5
refuses 1 'a 3D model cannot learn from 2D' trust "$root/examples/models/water3d.safetensors" g/wbc2d_4_0000.safetensors -o t.safetensors
holds 'statistics of given sequences are in the file' sh -c '"$0" info t.safetensors | grep -q "errors double at 3.5"' "$ascc"
refuses 2 '--sleep takes a number from 0' sim demo dam-break-2d -n 1 --sleep -1
refuses 2 '--budget takes a --ladder' sim demo dam-break-2d -n 1 --budget 4
refuses 1 "cannot open 'none'" sim --ladder none dam-break-2d -n 1
refuses 1 '--ladder takes 1 to 16 models' sim --ladder pbf2d.safetensors,,x dam-break-2d -n 1
run sim demo a.safetensors -n 10 -o c.safetensors
report $? 'a run starts from a sequence file'
run sim demo a.safetensors -n 10 --velocity difference
report $? 'a run starts from differences of frames'
run sim demo droplets-3d --size 6 -n 20
holds 'droplets conserve momentum to the last quantum' grep -q '^momentum error  *0  (0 0 0 quanta' out
holds 'angular momentum is told where nothing acts from outside' grep -q '^angular mom. error  *[0-9]' out
for scene in dam-break still-column free-fall droplets; do
    for dimension in 2d 3d; do
        holds "$scene-$dimension runs" "$ascc" sim demo $scene-$dimension --size 5 -n 3
    done
done

echo keep >d.safetensors
refuses_to_finish() { ! run sim demo dam-break-2d --size 6 -n 5 --dt 1e9 -o d.safetensors; }
refuses_to_finish
report $? 'a step that fails is an error'
holds 'and leaves the old file as it was' grep -q keep d.safetensors

"$ascc" sim demo dam-break-3d -n 1000000 --every 5 -o e.safetensors >out 2>err &
process=$!
sleep 2
kill -INT $process
wait $process
status=$?
[ $status -eq 130 ] && grep -q 'interrupted after' err && [ -f e.safetensors ]
report $? 'an interrupted run says so and ends with status 130'
holds 'and its file is whole' "$ascc" info e.safetensors

# ---- Outputs: whole files, or told before the run ----

# Far more steps than there is time for: what is refused here is refused before the run.
long='sim demo dam-break-2d --size 6 -n 100000000 --every 100000000'
# early TEXT ARGUMENTS...: is refused at once.
early() {
    text=$1
    shift
    timeout 20 "$ascc" "$@" >out 2>err
    [ $? -eq 1 ] && grep -qF -e "$text" err && [ ! -s out ]
    report $? "ascc $* is refused before the run: $text"
}
mkdir odd
mkfifo odd/fifo
mkdir odd/folder
echo text >odd/file
# One of our own, never the system's: who fails here would replace it.
mknod odd/node c 1 3 2>/dev/null || mkfifo odd/node
# shellcheck disable=SC2086
for target in fifo node; do
    early "odd/$target: cannot be written: it is no regular file" $long -o odd/$target
    for option in json csv; do
        early "odd/$target: cannot be written: it is no regular file" \
            eval ballistic a.safetensors --$option odd/$target
    done
done
# shellcheck disable=SC2086
{
    early "odd/folder: cannot be written: Is a directory" $long -o odd/folder
    early "odd/file: Not a directory" $long --frames odd/file
    early "odd/fifo: Not a directory" $long --ply odd/fifo
    early "odd/file: Not a directory" $long --vtk odd/file
}
early "odd/folder: cannot be written: Is a directory" eval ballistic a.safetensors --json odd/folder
early "odd/file: Not a directory" show a.safetensors -o odd/file
early "odd/fifo: Not a directory" show a.safetensors -o odd/fifo
early "odd/file: Not a directory" generate wbc2d -o odd/file
mkdir odd/frames
mkfifo odd/frames/frame_00000.png odd/frames/frame_00000.ply odd/frames/walls.vtp
early "frame_00000.png: cannot be written: it is no regular file" show a.safetensors -o odd/frames
# shellcheck disable=SC2086
early "frame_00000.ply: cannot be written: it is no regular file" $long --ply odd/frames
# shellcheck disable=SC2086
early "walls.vtp: cannot be written: it is no regular file" $long --vtk odd/frames
holds 'what stood there stands there' sh -c '
    [ -p odd/fifo ] && { [ -c odd/node ] || [ -p odd/node ]; } && [ -d odd/folder ] && [ "$(cat odd/file)" = text ] &&
        [ -p odd/frames/frame_00000.png ] && [ "$(ls odd/frames | wc -l)" -eq 3 ]'

ln -s real.safetensors odd/link
ln -s ../real.json odd/link.json
run sim demo dam-break-2d --size 8 -n 20 --every 10 -o odd/link
report $? 'a sequence is written through a link'
holds 'to where it leads' sh -c '[ -L odd/link ] && cmp odd/real.safetensors a.safetensors'
run eval ballistic a.safetensors --json odd/link.json --csv odd/new.csv --no-rollout
report $? 'so are reports'
holds 'to where they lead' sh -c '[ -L odd/link.json ] && grep -q runs real.json && grep -q figure odd/new.csv'
chmod 604 real.json
run eval ballistic a.safetensors --emd --csv emd.csv --quiet && grep -q '[,"]emd_final[,"]' emd.csv &&
    ! grep -q sinkhorn emd.csv
report $? "--emd measures the exact earth mover's distance alone"
run eval ballistic a.safetensors --json real.json --no-rollout --quiet
holds 'a file that is replaced keeps its mode' sh -c 'ls -l real.json | grep -q "^-rw----r--"'
holds 'nothing is left beside' sh -c '[ -z "$(ls odd . | grep part)" ]'
(
    trap '' XFSZ
    ulimit -f 1
    "$ascc" sim demo dam-break-2d --size 8 -n 20 -o a.safetensors >out 2>err ||
        "$ascc" show a.safetensors -o shown >out 2>>err
) 2>/dev/null
holds 'a full disk is told' grep -q 'a.safetensors: cannot be written: File too large' err
holds 'and leaves the old file as it was' cmp odd/real.safetensors a.safetensors
holds 'and the old pictures' sh -c '
    for f in shown/*; do
        [ "$(tail -c 8 $f | od -An -tx1 | tr -d " ")" = 49454e44ae426082 ] || exit 1
    done
    [ -z "$(ls shown . | grep part)" ]'

# ---- Standard output that is full or closed ----

if [ -c /dev/full ] && ! echo x 2>/dev/null >/dev/full; then
    for words in help version 'sim --help' 'info --help' 'info a.safetensors' 'lint a.safetensors' \
        'eval --help' 'eval ballistic a.safetensors --no-rollout' 'generate --help' 'show --help' \
        'train --help' 'sim demo dam-break-2d --size 6 -n 1'; do
        # shellcheck disable=SC2086
        "$ascc" $words >/dev/full 2>err
        [ $? -eq 1 ] && grep -q '^ascc: standard output: No space left on device$' err
        report $? "ascc $words tells that standard output is full"
    done
fi
"$ascc" sim demo dam-break-2d --size 8 -n 20 --every 10 -o closed.safetensors >&- 2>err
[ $? -eq 1 ] && grep -q '^ascc: standard output: ' err
report $? 'closed standard output is told'
holds 'and no file takes its place' cmp closed.safetensors a.safetensors

# ---- Texts of files that a terminal would obey ----

# harmless NAME ARGUMENTS...: what is printed holds no control character but the end of a line.
harmless() {
    name=$1
    shift
    run "$@"
    cat out err | LC_ALL=C grep -q . && ! cat out err | tr -d '\n' | LC_ALL=C grep -q '[[:cntrl:]]' &&
        ! cat out err | LC_ALL=C grep -q "$(printf '\302[\200-\237]\\|\342\200\256\\|^fake')"
    report $? "$name"
}
escapes='\u001b]0;x\u0007\u001b[31m\u009b31m\u202e\r\nfake'
# sequence FILE HEADER: a sequence file of one particle at rest.
sequence() {
    {
        # shellcheck disable=SC2059
        printf "\\$(printf %o $((${#2} % 256)))\\$(printf %o $((${#2} / 256)))\0\0\0\0\0\0"
        printf %s "$2"
        head -c 24 /dev/zero
    } >"$1"
}
# header MASS SOURCE DTYPE: of such a file.
header() {
    printf %s '{"__metadata__":{"format":"ascc.sequence","version":"1","dim":"3","dt":"0.02",' \
        '"particle_radius":"0.025","particle_mass":"'"$1"'","rest_density":"1000","gravity":"0 0 0",' \
        '"source":"'"$2"'"},"fluid.position":{"dtype":"'"$3"'","shape":[1,1,3],"data_offsets":[0,12]},' \
        '"fluid.velocity":{"dtype":"F32","shape":[1,1,3],"data_offsets":[12,24]},' \
        '"boundary.position":{"dtype":"F32","shape":[0,3],"data_offsets":[24,24]},' \
        '"boundary.normal":{"dtype":"F32","shape":[0,3],"data_offsets":[24,24]}}'
}
sequence escape.safetensors "$(header 0.125 "$escapes" F32)"
harmless 'the source of a sequence is shown, not obeyed' info escape.safetensors
holds 'all of it in one line' grep -q 'source .*31m.*fake$' out
sequence type.safetensors "$(header 0.125 x "$escapes")"
sequence mass.safetensors "$(header "$escapes" x F32)"
for words in 'info' 'lint' 'sim demo -n 1' 'show -o shown' 'eval ballistic'; do
    for file in type mass; do
        # shellcheck disable=SC2086
        harmless "ascc $words: a $file is quoted, not obeyed" $words $file.safetensors
    done
done
# A name as long as the one that it replaces; the file is otherwise as it was.
LC_ALL=C sed 's/water2d-tiny/\\\\u001b[31mX/' "$root/examples/models/water2d-tiny.safetensors" >escape.model
harmless "a model's name is shown, not obeyed" info escape.model
holds 'and the model is described' grep -q 'model ?.31mX$' out
odd_name=$(printf 'a\033[31m\nfake')
cp a.safetensors "$odd_name"
harmless "a file's name is shown, not obeyed" info "$odd_name"
harmless "a file's name in a table" eval ballistic "$odd_name" --no-rollout
harmless 'a file that is not there' lint "$odd_name.none"
harmless 'a command that is none' "$odd_name"
printf '{"\033[31m\\u009b": 1}' >escape.json
harmless 'a config' train escape.json
printf '{"network": {"dimension": 2, "kernel": "\\u001b[31m\\u009b"}}' >escape.json
harmless 'a word of a config' train escape.json

# ---- Numbers that no scene has ----

for mass in 1e308 1e-308 0 -1 nan; do
    sequence huge.safetensors "$(header $mass x F32)"
    for words in 'info' 'lint' 'sim demo -n 1' 'eval ballistic'; do
        # shellcheck disable=SC2086
        run $words huge.safetensors
        [ $? -ne 0 ] && grep -q 'particle_mass = ' err
        report $? "ascc $words refuses a mass of $mass by name"
    done
done

# The largest float there is, as a position or as a velocity of the one particle.
for field in velocity position; do
    sequence far.safetensors "$(header 1e30 x F32)"
    size=$(wc -c <far.safetensors)
    [ $field = position ] && at=$((size - 24)) || at=$((size - 12))
    printf '\377\377\177\177' | dd of=far.safetensors bs=1 seek=$at conv=notrunc 2>/dev/null
    refuses 1 "$field: row 0 component 0 is 3.40282e+38, beyond" sim demo far.safetensors -n 1
    run eval ballistic far.safetensors
    holds "eval has no number that is none with such a $field" sh -c '! grep -qiE "(^|[^a-z])-?(nan|inf)" out err'
done
refuses 2 "far.safetensors: a position is too far out" lint far.safetensors

if command -v script >/dev/null 2>&1; then
    script -qec "'$ascc' sim demo dam-break-3d -n 30" /dev/null >out 2>err </dev/null
    grep -q 'stepping \[' out
    report $? 'a terminal gets a progress bar'
fi
echo "1..$number"
exit $failed
