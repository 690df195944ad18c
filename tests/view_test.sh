#!/bin/sh
# ascc view from outside: a script of keys and the mouse, pictures, the window on a screen; prints TAP.
# $1: a build folder. Installs nothing; what it has no tools for is a SKIP. SPDX-License-Identifier: MIT
cd "$(dirname "$0")/.." || exit 1
. tests/support/tap.sh
ascc=$(cd "${1:-build}" && pwd)/examples/ascc || exit 1
screen=
trap '[ -z "$screen" ] || kill $screen 2>/dev/null; rm -rf "$folder"' EXIT
tool=$(pwd)/tests/view_screen.py
export ASCC_MODEL_PATH="$(pwd)/examples/models"
cd "$folder" || exit 1

# refused TEXT ARGUMENTS...: ends with 1 and that text.
refused() {
    text=$1
    shift
    "$ascc" view "$@" >out 2>err
    [ $? -eq 1 ] && [ ! -s out ] && grep -qF -e "$text" err
}

# Two pictures that differ.
differ() { [ -s "$1" ] && [ -s "$2" ] && ! cmp -s "$1" "$2"; }

scene='water2d-tiny dam-break-2d --size 12'
echo '3 key' >bad
# shellcheck disable=SC2086
{
    check 'a script that says nothing is refused' refused "bad: line 1: '3 key' is nothing to do" $scene --script bad
    check 'a model of other dimensions is refused' refused 'is a model in 3D' $scene --model water3d-tiny
}

echo '0 quit' >script
# shellcheck disable=SC2086
if refused 'built without SDL2' $scene --script script; then
    check 'without SDL2 the command says so' true
    skip 'the window' 'built without SDL2'
    echo "1..$number"
    exit $failed
fi

# Times are not the same twice: they are hidden.
cat >script <<'END'
# a ball through falling water
0 key t
4 picture first.png
4 key b
5 picture ball.png
6 press 640 360
30 picture later.png
31 key c
32 picture density.png
33 key m
34 key space
35 picture paused.png
38 picture still.png
39 key .
40 picture stepped.png
41 wheel 2
42 picture near.png
43 key 0
43 key r
44 picture again.png
45 key p
46 quit
END
played() { SDL_VIDEODRIVER=dummy timeout 60 "$ascc" view "$@"; }

# shellcheck disable=SC2086
{
    check 'a script is played to its end' played $scene --model demo --script script
    mkdir once && mv ./*.png once
    check 'and again' played $scene --model demo --script script
}
for picture in first ball later density paused stepped near; do
    check "the same picture twice: $picture" cmp once/$picture.png $picture.png
done
check 'the ball is seen' differ first.png ball.png
check 'the water moves' differ ball.png later.png
check 'colours change' differ later.png density.png
check 'paused is paused' cmp paused.png still.png
check 'one step is a step' differ still.png stepped.png
check 'the wheel brings it near' differ stepped.png near.png
check 'the key p writes a picture' test -s view-00000.png

"$ascc" sim water2d-tiny droplets-2d --size 6 -n 3 -o run.safetensors >/dev/null
printf '0 key t\n1 key .\n2 picture one.png\n3 key .\n4 picture two.png\n5 key ,\n6 picture back.png\n7 quit\n' >script
check 'a sequence is played' played run.safetensors --paused --script script
check 'forwards' differ one.png two.png
check 'and backwards' cmp one.png back.png
printf '0 key t\n1 press 640 360\n2 move 700 330\n3 release 0 0\n3 picture turned.png\n4 move 0 0\n5 picture let-go.png\n5 quit\n' >script
check 'a scene in 3D is shown' played water3d-tiny dam-break-3d --size 6 --paused --script script
printf '0 key t\n1 picture straight.png\n2 quit\n' >script
check 'and seen from where it began' played water3d-tiny dam-break-3d --size 6 --paused --script script
check 'the mouse turns it' differ straight.png turned.png
check 'until the button is let go' cmp turned.png let-go.png

if ! have Xvfb || ! have python3; then
    skip 'the window on a screen' 'needs Xvfb and python3'
    echo "1..$number"
    exit $failed
fi
mkdir buffer
Xvfb -displayfd 3 -screen 0 1400x800x24 -fbdir buffer -nolisten tcp >xvfb.log 2>&1 3>display &
screen=$!
tries=0
while [ ! -s display ] && [ $tries -lt 100 ]; do
    sleep 0.1
    tries=$((tries + 1))
done
printf '0 key t\n10 key space\n12 picture shown.png\n' >script
# shellcheck disable=SC2086
DISPLAY=:$(cat display) "$ascc" view $scene --script script >out 2>err &
viewer=$!
# What is shown is on the screen soon after it is written, and stays; a machine may be busy.
on_screen() {
    tries=0
    while [ ! -s shown.png ] && [ $tries -lt 400 ]; do
        sleep 0.2
        tries=$((tries + 1))
    done
    for try in 1 2 3 4 5 6 7 8 9 10; do
        python3 "$tool" buffer/Xvfb_screen0 shown.png && return
        sleep 0.5
    done
    cat err
    return 1
}
check 'each pixel of the window is on the screen' on_screen
interrupted() {
    kill -TERM $viewer
    wait $viewer
    [ $? -eq 130 ]
}
check 'a signal closes it' interrupted

echo "1..$number"
exit $failed
