#!/bin/sh
# The C in README.md, docs/getting-started.md, walls.md and bodies.md compiles, that of other pages is what the tests run;
# prints TAP. $1: a build folder. SPDX-License-Identifier: MIT
cd "$(dirname "$0")/.." || exit 1
build=${1:-build}
folder=$(mktemp -d) || exit 1
trap 'rm -rf "$folder"' EXIT
number=0
failed=0
for page in README.md docs/getting-started.md docs/walls.md docs/bodies.md; do
    number=$((number + 1))
    source="$folder/page.c"
    {
        echo '#include <stddef.h>'
        echo '#include <stdint.h>'
        echo '#include <math.h>'
        echo '#include <ascc/ascc.h>'
        sed -n '/^```c$/,/^```$/p' "$page" | grep -v '^```'
    } >"$source"
    if [ "$(wc -l <"$source")" -gt 15 ] &&
        cc -std=c11 -Wall -Wextra -Wpedantic -Werror -Iinclude -c "$source" -o "$folder/page.o" 2>"$folder/err"; then
        echo "ok $number - the code in $page compiles"
    else
        echo "not ok $number - the code in $page compiles"
        sed 's/^/# /' "$folder/err"
        failed=1
    fi
done
number=$((number + 1))
cat docs/getting-started.md docs/callbacks.md | sed -n '/^```cpp$/,/^```$/p' | grep -v '^```' >"$folder/page.cpp"
if [ -s "$folder/page.cpp" ] &&
    c++ -std=c++17 -Wall -Wextra -Wpedantic -Werror -Wno-unused-function -Iinclude -fsyntax-only "$folder/page.cpp" 2>"$folder/err"; then
    echo "ok $number - the C++ in docs/getting-started.md and callbacks.md compiles"
else
    echo "not ok $number - the C++ in docs/getting-started.md and callbacks.md compiles"
    sed 's/^/# /' "$folder/err"
    failed=1
fi
number=$((number + 1))
csharp() {
    sed -n '/^```csharp$/,/^```$/p' docs/engines.md | grep -v '^```' >"$folder/Water.cs" &&
        mcs -out:"$folder/water.exe" "$folder/Water.cs" && cp "$build/lib/libascc.so.0" "$folder/libascc.so" &&
        LD_LIBRARY_PATH=$folder mono "$folder/water.exe" examples/models/pbf3d.safetensors | grep -q '^lowest particle at -0\.[0-9]'
}
if ! command -v mcs >/dev/null 2>&1 || ! command -v mono >/dev/null 2>&1 || [ ! -e "$build/lib/libascc.so.0" ]; then
    echo "ok $number - the C# in docs/engines.md runs # SKIP no mcs, no mono, or no $build/lib/libascc.so.0"
elif csharp >"$folder/err" 2>&1; then
    echo "ok $number - the C# in docs/engines.md runs"
else
    echo "not ok $number - the C# in docs/engines.md runs"
    sed 's/^/# /' "$folder/err"
    failed=1
fi
# What a newcomer copies is short, and is in a file that the tests build and run.
for pair in docs/measures.md:tests/test_eval.c docs/stability.md:bench/stability/scenes.c docs/contributing.md:tests/op_scale.c; do
    number=$((number + 1))
    page=${pair%%:*}
    sed -n '/^```c$/,/^```$/p' "$page" | grep -v '^```' >"$folder/shown"
    if [ -s "$folder/shown" ] && [ "$(wc -l <"$folder/shown")" -lt 20 ] &&
        awk 'NR == FNR { shown = shown $0 "\n"; next } { text = text $0 "\n" }
             END { exit !index(text, shown) }' "$folder/shown" "${pair#*:}"; then
        echo "ok $number - the code in $page is in ${pair#*:}, in less than 20 lines"
    else
        echo "not ok $number - the code in $page is in ${pair#*:}, in less than 20 lines"
        failed=1
    fi
done
echo "1..$number"
exit $failed
