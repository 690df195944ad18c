#!/bin/sh
# Makes water.wasm and puts the page with it and a model into a folder.
#   sh examples/web/build.sh FOLDER [FLAGS]     FLAGS: -msimd128 -mbulk-memory if not given; '' for old engines
# Needs Emscripten (Debian: emscripten) and Python. SPDX-License-Identifier: MIT
set -eu
cd "$(dirname "$0")/../.."
folder=${1:?usage: build.sh FOLDER [FLAGS]}
flags=${2--msimd128 -mbulk-memory}
python3 lib/embed/amalgamate.py "$folder/source"
mkdir -p "$folder/source/ascc"
mv "$folder/source/ascc.h" "$folder/source/ascc/ascc.h"
printf '#include "ascc/ascc.h"\n' >"$folder/source/ascc.h"
# shellcheck disable=SC2086
emcc -std=c11 -O3 $flags -I"$folder/source" "$folder/source/ascc.c" examples/web/water.c --no-entry \
    -s ALLOW_MEMORY_GROWTH=1 -s STANDALONE_WASM=1 -o "$folder/water.wasm"
cp examples/web/index.html examples/web/water.js examples/models/water2d.safetensors "$folder"
