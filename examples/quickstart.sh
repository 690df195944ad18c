#!/bin/sh
# From a fresh machine to pictures of a dam break: installs what is missing, builds, runs.
# SPDX-License-Identifier: MIT
set -u
cd "$(dirname "$0")/.." || exit 1
. tests/setup.sh
setup || exit 1

[ -f build/build.ninja ] || meson setup build || exit 1
meson compile -C build || exit 1

model=${1:-examples/models/water3d.safetensors}
out=build/dam-break
rm -rf "$out"
mkdir -p "$out" || exit 1
echo "Running the network in $model on a 3D dam break."
build/examples/ascc sim "$model" dam-break-3d --size 24 -n 100 --every 4 --threads "$(getconf _NPROCESSORS_ONLN)" \
    -o "$out/dam-break.safetensors" --frames "$out/frames" || exit 1
echo
echo "Pictures: $out/frames/*.png ($(find "$out/frames" -name '*.png' | wc -l | tr -d ' '))"
echo "Sequence: $out/dam-break.safetensors"
if command -v ffmpeg >/dev/null 2>&1; then
    echo "As a film: ffmpeg -pattern_type glob -i '$out/frames/*.png' $out/dam-break.mp4"
fi
