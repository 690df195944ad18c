#!/bin/sh
# The program on 64-bit Windows, trainer included, under wine: what it says and writes is what this machine's says
# and writes, by names in UTF-8; prints TAP. $1: a build folder. What it has no tools for is a SKIP.
# SPDX-License-Identifier: MIT
cd "$(dirname "$0")/.." || exit 1
root=$(pwd)
. tests/support/tap.sh
native=$(cd "${1:-build}" && pwd)/examples/ascc || exit 1
libraries=build-cross/mingw-libraries
program=build-cross/mingw-program
wine=wine
for path in /usr/lib/wine/wine64 /usr/lib/wine/wine; do
    have wine || [ ! -x $path ] || wine=$path
done
leave() {
    skip 'the program on Windows' "$1"
    echo "1..$number"
    exit $failed
}
have x86_64-w64-mingw32-gcc-posix && have $wine || leave 'needs gcc-mingw-w64-x86-64-posix and wine'
[ -f /usr/x86_64-w64-mingw32/lib/libz.a ] || leave 'needs libz-mingw-w64-dev'

# jansson and libpng are built once, with --long, or by hand.
mkdir -p build-cross
if [ ! -f $libraries/lib/pkgconfig/libpng.pc ]; then
    [ -n "${ASCC_TEST_LONG:-}" ] || leave "needs sh tests/cross/mingw_libraries.sh $libraries"
    sh tests/cross/mingw_libraries.sh $libraries >build-cross/mingw-libraries.log 2>&1 || leave "$libraries.log"
fi
printf "[properties]\npkg_config_libdir = '%s:/usr/x86_64-w64-mingw32/lib/pkgconfig'\n" \
    "$root/$libraries/lib/pkgconfig" >build-cross/mingw-libraries.ini
build() {
    [ -f $program/build.ninja ] ||
        meson setup $program --cross-file tests/cross/mingw.ini --cross-file build-cross/mingw-libraries.ini \
            -Dwerror=true -Dtests=false -Dbench=false -Dview=disabled -Ddefault_library=static -Dprefer_static=true ||
        return 1
    ninja -C $program examples/ascc.exe
}
check 'it builds without a warning' build
ascc=$root/$program/examples/ascc.exe
[ -f "$ascc" ] || leave 'it does not build'
export WINEPREFIX="$root/build-cross/wine" WINEDEBUG=-all WINEDLLOVERRIDES="mscoree,mshtml="
export ASCC_MODEL_PATH="$root/examples/models" # for this machine's
windows() { ASCC_MODEL_PATH="Z:$ASCC_MODEL_PATH" $wine "$ascc" "$@"; }

# same WORDS...: both do it in the folder Wässer, each in its own; what they say but for times, and all files, are equal.
same() {
    (cd windows/Wässer && windows "$@" >../said 2>&1) || { cat windows/said; return 1; }
    (cd native/Wässer && "$native" "$@" >../said 2>&1) || { cat native/said; return 1; }
    for system in windows native; do
        grep -v -e ' [mu]s a step' -e 'CPU s' -e 'ms a frame' -e chart $system/said >$system/text
        for log in $system/Wässer/*/*.csv; do
            [ ! -f "$log" ] || { cut -d, -f1-7 "$log" >"$log.kept" && mv "$log.kept" "$log"; } # the next has seconds
        done
        rm -f $system/Wässer/*/*.checkpoint $system/Wässer/*/*.svg
    done
    diff native/text windows/text && diff -r native/Wässer windows/Wässer
}
cd "$folder" || exit 1
mkdir -p windows/Wässer native/Wässer
check 'its version' same -V
check 'a model by name' same info water2d-tiny
check 'a run, pictures, PLY and VTK by names in UTF-8' same sim water2d-tiny dam-break-2d --size 8 -n 4 \
    -o läuft-水.safetensors --frames Bilder-é --ply Wolke --vtk Bilder-é
check 'its sequence is described' same info läuft-水.safetensors
check 'its measures' same eval sph: läuft-水.safetensors --no-rollout
check 'a relaxation is added' same relax water2d-tiny -o räumt.safetensors
"$native" generate wbc2d -o data --seed 4 --count 2 --frames 12 --spacing 0.06 >/dev/null
for system in windows native; do
    cp -r data $system/Wässer/Daten
    cat >$system/Wässer/lernt.json <<'END'
{"network": {"name": "test", "dimension": 2, "spacing": 0.06, "time_step": 0.0025, "channels": 4, "levels": 1, "coarse_channels": [4]},
 "data": {"train": ["Daten/*_000?.safetensors"]}, "batch": 2, "seed": 3,
 "stages": [{"iterations": 4, "unroll": 2, "learning_rate": 0.002}], "output": "gelernt/m.safetensors"}
END
done
check 'it trains the same network' same train lernt.json --threads 2
# Sines differ in their last digit from C library to C library, and so may normals of turned walls: positions do not.
(cd windows && windows generate wbc2d -o data --seed 4 --count 2 --frames 12 --spacing 0.06 >/dev/null)
fluid_same() {
    for n in 0 1; do
        "$native" eval ballistic data/wbc2d_4_000$n.safetensors --no-rollout | tail -n +2 | grep -v ' ms a' >a
        "$native" eval ballistic windows/data/wbc2d_4_000$n.safetensors --no-rollout | tail -n +2 | grep -v ' ms a' >b
        [ -s a ] && diff a b || return 1
    done
}
check 'it generates the same fluid' fluid_same
refused() {
    (cd windows/Wässer && windows "$@" >../said 2>&1)
    [ $? -eq 1 ] && grep -q 'no folder of models has' windows/said
}
check 'what is not there is told' refused sim nowhere dam-break-2d -n 1
echo "1..$number"
exit $failed
