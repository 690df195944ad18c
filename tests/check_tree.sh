#!/bin/sh
# What the sources promise, read from the real include graph, symbols and layout; prints TAP.
# $1: a build folder; without its libraries the two checks of symbols are skipped.
# tests/check_tree_test.sh plants a violation of each. SPDX-License-Identifier: MIT
cd "$(dirname "$0")/.." || exit 1
export LC_ALL=C
build=${1:-build}
number=0
failed=0
scratch=$(mktemp -d) || exit 1
trap 'rm -rf "$scratch"' EXIT

# check NAME LINES: passes when there are no lines, which are what was found at fault.
check() {
    number=$((number + 1))
    if [ -z "$2" ]; then
        echo "ok $number - $1"
    else
        echo "not ok $number - $1"
        echo "$2" | sed 's/^/# /'
        failed=1
    fi
}

skip() {
    number=$((number + 1))
    echo "ok $number - $1 # SKIP $2"
}

# ---- Which file includes which ----

lib=$(find lib -name '*.[ch]' -o -name '*.list' | sort)
own=$(find lib include examples bench tests -name '*.[ch]' | sort)
scripts=$(find tests bench docs examples -name '*.sh' ! -name check_tree_test.sh) # that one says what is wrong
# Lines FILE INCLUDED, or FILE <INCLUDED> of the system. A quoted name is of the same folder or counted from lib/.
awk '
    BEGIN { while (("find lib -type f" | getline f) > 0) exists[f] = 1 }
    /^[ \t]*#[ \t]*include[ \t]*["<]/ {
        name = $0
        sub(/^[^"<]*/, "", name)
        if (name ~ /^</) { sub(/>.*/, ">", name); print FILENAME, name; next }
        sub(/^"/, "", name); sub(/".*/, "", name)
        folder = FILENAME; sub(/[^\/]*$/, "", folder)
        print FILENAME, (folder name in exists) ? folder name : ("lib/" name in exists) ? "lib/" name : "missing:" name
    }' $lib >"$scratch/includes"
grep -v '<' "$scratch/includes" >"$scratch/graph"

check 'a folder of lib includes itself and lower ones' "$(awk '
    BEGIN { n = split("kernels base file points model network step train mpi", order, " ")
            for (i = 1; i <= n; i++) level["lib/" order[i]] = i }
    function folder(f) { sub(/\/[^\/]*$/, "", f); return f }
    { from = folder($1); to = folder($2) }
    $2 ~ /^missing:/ { next }
    !(from in level) { print from ": no layer" ; next }
    level[to] > level[from] { print $1 ": includes " $2 ", of a higher layer" }
    ' "$scratch/graph" | sort -u)"
check 'no file of lib includes itself by way of others' "$(
    tsort <"$scratch/graph" 2>&1 >/dev/null | sed -n 's/^tsort: //p')"
libc='assert|errno|fcntl|fenv|float|immintrin|inttypes|limits|malloc|math|pthread|stdalign|stdarg|stdatomic|stdbool'
libc="$libc|stddef|stdint|stdio|stdlib|string|sys/stat|time|unistd|windows|arm_neon|sched|threads|wasm_simd128"
check 'lib includes nothing but itself, the public headers and libc' "$(
    grep 'missing:' "$scratch/includes" | sed 's/missing:/"/; s/$/"/'
    grep '<' "$scratch/includes" | grep -vE " <($libc)\.h>$| <ascc/(ascc|version)\.h>$|^lib/train/.* <ascc/train\.h>$|^lib/mpi/.* <(ascc/)?mpi\.h>$"
    grep '^lib/kernels/.*<ascc/' "$scratch/includes" | grep -v '^lib/kernels/select\.c ')"

# ---- Programs ----

compiler=$(command -v mpicc || echo cc) # it knows where mpi.h is
for file in $(find examples bench/chart bench/stability bench/scaling -name '*.c' | grep -v '^examples/[mr]e[a-z]*/'); do
    "$compiler" -MM -Iinclude -Iexamples/ascc -Iexamples/measures -Iexamples/reference "$file" 2>&1 >/dev/null |
        grep 'error: ' | grep -v ' mpi\.h: No such file'
done >"$scratch/programs"
check 'programs compile with include/ and the headers of examples/' "$(cat "$scratch/programs")"

# ---- Text ----

if clang-format --version 2>/dev/null | grep -q 'version 14\.'; then # others lay out a little differently
    check 'C sources are formatted as .clang-format says' "$(
        clang-format --dry-run $own 2>&1 | sed -n 's/^\([^:]*\):[0-9].*clang-format-violations.*/\1/p' | uniq)"
else
    skip 'C sources are formatted as .clang-format says' 'no clang-format 14'
fi
check 'documents that sources name exist' "$(
    grep -noE '(docs|examples|bench|tests)/[A-Za-z0-9_./-]*\.md' $own $scripts |
        while IFS=: read -r file line name; do
            [ -f "$name" ] || echo "$file:$line: $name"
        done)"
check 'sources cite no document that is not shipped' "$(
    grep -nE '(METHOD|SEMANTICS|DESIGN|STYLE|PERFORMANCE|HOUSE|TRUNK|RELIABILITY)(\.md|,? (section )?[0-9]|[,;:)]? *\*/|$)' \
        $own $scripts)"
check 'every document that a page links to exists' "$(
    for page in README.md docs/*.md docs/*/*.md; do
        grep -oE '\]\([^)#: ]+[)#]' "$page" | sed 's/^](//; s/.$//' | while read -r link; do
            [ -e "$(dirname "$page")/$link" ] || echo "$page: $link"
        done
    done)"
# A file stands in the table with its folder: a row `points/` ... `grid.[ch]`.
awk -F'|' '/^\| *`[a-z]+\/`/ { folder = $2; gsub(/[ `]/, "", folder) }
    /^\|/ && folder {
        for (text = $3; match(text, /`[^`]+`/); text = substr(text, RSTART + RLENGTH)) {
            name = substr(text, RSTART + 1, RLENGTH - 2)
            if (sub(/\[ch\]$/, "", name)) { print "lib/" folder name "c"; print "lib/" folder name "h" }
            else print "lib/" folder name
        }
    }
    !/^\|/ { folder = "" }' docs/architecture.md | sort >"$scratch/named"
find lib -type f ! -name meson.build | sort >"$scratch/there"
check 'docs/architecture.md names every file of lib, and no other' "$(
    comm -13 "$scratch/named" "$scratch/there" | sed 's/$/: not named/'
    comm -23 "$scratch/named" "$scratch/there" | sed 's/$/: named, not there/'
    uniq -d "$scratch/named" | sed 's/$/: named twice/')"

# ---- What functions call ----

# Code of lib without comments that matches a pattern, FILE:LINE: in front.
code() {
    awk -v pattern="$1" '
        FNR == 1 { comment = 0 }
        {
            text = $0
            sub(/\/\/.*/, "", text)
            gsub(/\/\*[^*]*\*+([^\/*][^*]*\*+)*\//, "", text)
            if (comment && !sub(/.*\*\//, "", text)) next
            comment = sub(/\/\*.*/, "", text)
            if (text ~ pattern) print FILENAME ":" FNR ": " $0
        }' $(echo "$lib" | grep '\.[ch]$' | grep -vxF "$2")
}
check 'only base/memory.c calls the allocator' "$(
    code '(^|[^a-z_.>])(malloc|calloc|realloc|aligned_alloc|posix_memalign|free) *\(' lib/base/memory.c)"
check 'lib never prints, aborts or exits' "$(
    code '(^|[^a-z_])(printf|fprintf|puts|putchar|perror|abort|exit|_Exit|signal|setlocale) *\(' none)"
# Public functions that move no floating point number but by memcpy, if at all.
plain='version|status_text|(train_)?context_.*|[a-z]+_(destroy|message)|model_(save|bytes|find)|trainer_(iteration|parameter_count)'
plain="$plain|particles_(reserve|remove|clear|count|capacity|dimension|find|snapshot_size|momentum_quantum)"
plain="$plain|particles_(get_asleep|wake)"
plain="$plain|ladder_(step|step_count|get_choices|snapshot_size)"
plain="$plain|particles_(total_momentum|get_(ids|bodies|momentum))"
plain="$plain|body_remove|bodies_list"
plain="$plain|mpi_particles_(local|destroy|message|count|total_momentum|get_statistics)"
awk '/^[a-z].*[ *]ascc_[a-z_]+\(/ && !/;/ { sub(/\(.*/, ""); sub(/.*[ *]/, ""); name = $0 }
    body { if (/ASCC_FLOAT_SCOPE;/) print name }
    { body = /^\{/ }' $lib >"$scratch/scopes"
check 'every public function with floating point begins with ASCC_FLOAT_SCOPE' "$(
    sed -n 's/^ASCC_API.*[ *]\(ascc_[a-z_]*\)(.*/\1/p' include/ascc/ascc.h include/ascc/train.h include/ascc/mpi.h |
        grep -vE "^ascc_($plain)\$" | grep -vxFf "$scratch/scopes")"

# ---- Symbols ----

if [ -e "$build/lib/libascc.so" ]; then
    check 'every linkable symbol of lib starts with ascc_' "$(
        nm -gAP "$build"/lib/libascc-*.a 2>"$scratch/errors" |
            awk '$3 ~ /^[TDBRCVW]$/ && $2 !~ /^(ascc_|__(asan|ubsan|odr_asan|gcov|llvm)|_GLOBAL__)/'
        grep -v ': no symbols$' "$scratch/errors")"
    check 'the shared library exports what tests/exports.txt lists' "$(
        nm -D --defined-only "$build/lib/libascc.so" | awk '{ print $3 }' | sort | diff - tests/exports.txt)"
else
    skip 'every linkable symbol of lib starts with ascc_' "no $build/lib/libascc.so"
    skip 'the shared library exports what tests/exports.txt lists' "no $build/lib/libascc.so"
fi
echo "1..$number"
exit $failed
