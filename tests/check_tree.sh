#!/bin/sh
# The layers of docs/architecture.md, checked with grep and nm; prints TAP. $1: a build folder.
# SPDX-License-Identifier: MIT
cd "$(dirname "$0")/.." || exit 1
build=${1:-build}
number=0
failed=0

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

# Code without comments, FILE:LINE: in front of each line.
code() {
    for file in "$@"; do
        sed -e 's|//.*||' -e 's|/\*.*\*/||' -e '/^ *\/\*/,/\*\//d' "$file" |
            grep -nE "$pattern" | sed "s|^|$file:|"
    done
}

libc='assert|errno|fcntl|fenv|float|immintrin|inttypes|limits|malloc|math|pthread|stdalign|stdarg|stdatomic|stdbool|stddef|stdint|stdio|stdlib|string|sys/stat|time|unistd|windows|arm_neon|sched'
kernels=$(cd lib/kernels && echo *.h | sed 's/\.h//g; s/ /|/g')
sources=$(find lib -name '*.c' -o -name '*.h' | sort)

check 'kernels include only kernels and libc' "$(
    grep -nE '^ *# *include' lib/kernels/* | grep -vE "<($libc)\.h>|\"($kernels)\.h\"|select\.c:.*<ascc/ascc\.h>")"
runtime=$(echo "$sources" | grep -v '^lib/train/')
check 'lib includes nothing above it' "$(
    grep -nE '# *include .*(\.\./|examples|tests|bench|train)' $runtime)"
check 'the trainer includes nothing but lib and itself' "$(
    grep -nE '# *include .*(\.\./\.\./\.\.|examples|tests|bench)' $(echo "$sources" | grep '^lib/train/'))"
check 'lib includes only itself and libc' "$(
    grep -nE '# *include *<' $sources | grep -vE '^lib/train/.*<ascc/train\.h>' | grep -vE "<($libc)\.h>|<ascc/ascc\.h>|ascc/version\.h")"
check 'model files know nothing of points, points nothing of models' "$(
    grep -nE '# *include *"(particles|neighbors|resample|hierarchy)\.h"' lib/model.[ch] lib/plan.[ch] \
        lib/description.[ch] lib/safetensors.[ch] lib/json*.[ch]
    grep -nE '# *include *"(plan|safetensors|description|network|integrate|step)\.h"' \
        lib/particles.[ch] lib/neighbors.[ch] lib/resample.[ch] lib/snapshot.c)"
pattern='(^|[^a-z_.>])(malloc|calloc|realloc|aligned_alloc|posix_memalign|free) *\('
check 'only memory.c calls the allocator' "$(code $(echo "$sources" | grep -v '^lib/memory\.c$'))"
pattern='(^|[^a-z_])(printf|fprintf|puts|putchar|perror|abort|exit|_Exit|signal|setlocale) *\('
check 'lib never prints, aborts or exits' "$(code $sources)"
check 'programs include only the public header of lib' "$(
    grep -rnE '# *include .*("|/)lib/|# *include *"\.\./\.\./(lib|include)' examples bench --include='*.[ch]')"
check 'every linkable symbol of lib starts with ascc_' "$(
    nm -gAP "$build"/lib/libascc-*.a 2>/dev/null |
        awk '$3 ~ /^[TDBRCVW]$/ && $2 !~ /^(ascc_|__(asan|ubsan|odr_asan|gcov|llvm)|_GLOBAL__)/')"
# Public functions that move no floating point number but by memcpy, if at all.
plain='version|status_text|context_.*|[a-z]+_(destroy|message)|model_(save|bytes)|trainer_(iteration|parameter_count)'
plain="$plain|particles_(reserve|remove|clear|count|capacity|dimension|find|snapshot_size|momentum_quantum)"
plain="$plain|particles_(total_momentum|get_(ids|bodies|momentum))"
check 'every public function with floating point begins with ASCC_FLOAT_SCOPE' "$(
    awk '/^[a-z].*[ *]ascc_[a-z_]+\(/ && !/;/ { sub(/\(.*/, ""); sub(/.*[ *]/, ""); name = $0 }
        body { if (/ASCC_FLOAT_SCOPE;/) print name }
        { body = /^\{/ }' $sources >"$build/scopes.txt"
    sed -n 's/^ASCC_API.*[ *]\(ascc_[a-z_]*\)(.*/\1/p' include/ascc/ascc.h include/ascc/train.h |
        grep -vE "^ascc_($plain)\$" | grep -vxFf "$build/scopes.txt")"
check 'the shared library exports what tests/exports.txt lists' "$(
    nm -D --defined-only "$build/lib/libascc.so" | awk '{ print $3 }' | LC_ALL=C sort |
        diff - tests/exports.txt)"
echo "1..$number"
exit $failed
