#!/bin/sh
# From a fresh machine to pictures of a dam break: installs what is missing, builds, runs.
# SPDX-License-Identifier: MIT
set -u
cd "$(dirname "$0")/.." || exit 1
. tests/setup.sh
setup || exit 1

[ -f build/build.ninja ] || meson setup build || exit 1
meson compile -C build || exit 1

# The published network where it is at hand; it is not part of libascc.
model=${1:-../shared/data/weights/dmcf-liquid3d.safetensors}
if [ -f "$model" ]; then
    what="the network in $model"
    set -- --size 16 -n 75 --every 3
else
    what="the demonstration model, which is not trained (no network at $model)"
    model=demo
    set -- --size 16 -n 600 --every 24
fi

out=build/dam-break
rm -rf "$out"
mkdir -p "$out" || exit 1
echo "Running $what on a 3D dam break."
build/examples/ascc sim "$model" dam-break-3d "$@" --threads "$(getconf _NPROCESSORS_ONLN)" \
    -o "$out/dam-break.safetensors" --frames "$out/frames" || exit 1
echo
echo "This was $what."
echo "Pictures: $out/frames/*.png ($(find "$out/frames" -name '*.png' | wc -l | tr -d ' '))"
echo "Sequence: $out/dam-break.safetensors"
if command -v ffmpeg >/dev/null 2>&1; then
    echo "As a film: ffmpeg -pattern_type glob -i '$out/frames/*.png' $out/dam-break.mp4"
fi
