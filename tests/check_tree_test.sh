#!/bin/sh
# Plants one violation after another in a copy of the tree: tests/check_tree.sh finds each, and nothing else.
# Prints TAP. $1: a build folder. SPDX-License-Identifier: MIT
cd "$(dirname "$0")/.." || exit 1
root=$PWD
build=${1:-build}
case $build in /*) ;; *) build=$root/$build ;; esac
if ! git rev-parse --git-dir >/dev/null 2>&1 || [ ! -e "$build/lib/libascc.so" ]; then
    echo '1..0 # SKIP needs a git checkout and a build'
    exit 0
fi
copy=$(mktemp -d) || exit 1
trap 'rm -rf "$copy"' EXIT
# Less to read is faster: sources that no plant touches stay behind.
git ls-files -co --exclude-standard |
    grep -vE '^tests/(data|support|fuzz|test_)|^bench/[a-z_0-9]*\.[ch]$|^examples/[mr].*\.c$|^examples/ascc/[a-ln-su-z].*\.c$' |
    while read -r file; do [ -e "$file" ] && echo "$file"; done | tar -cf - -T - | tar -xf - -C "$copy"
mkdir -p "$copy/build/lib"
cp "$build/lib/libascc.so" "$copy/build/lib/"
cd "$copy" || exit 1
# archive NAME: a static library that defines NAME.
archive() {
    echo "int $1 = 1;" | cc -xc -c - -o "build/$1.o" && ar rc "build/lib/libascc-$1.a" "build/$1.o"
}
archive ascc_name
number=0
failed=0

# expect WHAT WANTED: the names of the checks that fail now are WANTED.
expect() {
    number=$((number + 1))
    got=$(sh tests/check_tree.sh build | sed -n 's/^not ok [0-9]* - //p')
    if [ "$got" = "$2" ]; then
        echo "ok $number - $1"
    else
        echo "not ok $number - $1"
        echo "$got" | sed 's/^/# failed: /'
        failed=1
    fi
}

# plant WHAT FILE WANTED: the file, changed by the caller, fails the check WANTED; then it is as before.
restore() {
    if [ -e "$root/$1" ]; then cp -p "$root/$1" "$1"; else rm -f "$1"; fi
}
plant() {
    expect "$1 is found" "$3"
    restore "$2"
}

layers='a folder of lib includes itself and lower ones'
cycles='no file of lib includes itself by way of others'
foreign='lib includes nothing but itself, the public headers and libc'
programs='programs compile with include/ and the headers of examples/'
format='C sources are formatted as .clang-format says'
documents='documents that sources name exist'
cited='sources cite no document that is not shipped'
links='every document that a page links to exists'
files='docs/architecture.md names every file of lib, and no other'
allocator='only base/memory.c calls the allocator'
prints='lib never prints, aborts or exits'
scope='every public function with floating point begins with ASCC_FLOAT_SCOPE'
symbols='every linkable symbol of lib starts with ascc_'
exports='the shared library exports what tests/exports.txt lists'

expect 'the tree as it is passes' ''

sed -i '/#include "json.h"/a #include "points/particles.h"' lib/file/json.c
plant 'a header of a higher layer' lib/file/json.c "$layers"
sed -i '/#include <assert.h>/i #include "memory.h"' lib/base/common.h
plant 'a cycle' lib/base/common.h "$cycles"
sed -i '/#include "common.h"/a #include <locale.h>' lib/base/status.c
plant 'a header of the system that is not on the list' lib/base/status.c "$foreign"
sed -i '/#include "common.h"/a #include "base/nowhere.h"' lib/base/status.c
plant 'a header that is not there' lib/base/status.c "$foreign"
sed -i '/#include <ascc\/ascc.h>/a #include <ascc/ascc.h>' lib/kernels/kernels.h
sed -i '/#include <stdint.h>/a #include <ascc/ascc.h>' lib/kernels/kernels.h
plant 'a kernel that knows the public header' lib/kernels/kernels.h "$foreign"
sed -i '/#include <ascc\/ascc.h>/a #include "base/common.h"' examples/hello.c
plant "a program with a header of lib" examples/hello.c "$programs"
if clang-format --version 2>/dev/null | grep -q 'version 14\.'; then
    echo 'static  const int  wide = 1;' >>examples/hello.c
    plant 'a line that is not formatted' examples/hello.c "$format"
fi
echo '/* See docs/nowhere.md. */' >>lib/base/status.c
plant 'a document that is not there' lib/base/status.c "$documents"
echo '/* As METHOD section 4 has it. */' >>include/ascc/ascc.h
plant 'a document that is not shipped' include/ascc/ascc.h "$cited"
echo 'See [nothing](docs/nowhere.md#here).' >>README.md
plant 'a link to nowhere' README.md "$links"
echo '/* Nobody names it. SPDX-License-Identifier: MIT */' >lib/base/unnamed.c
plant 'a file that docs/architecture.md does not name' lib/base/unnamed.c "$files"
sed -i 's/`fields.\[ch\]`/`fields.[ch]` `meadows.c`/' docs/architecture.md
plant 'a file that docs/architecture.md names and that is not there' docs/architecture.md "$files"
echo 'void *ascc_take(void);
void *ascc_take(void)
{
    return malloc(1); /* here */
}' >>lib/base/status.c
plant 'an allocation' lib/base/status.c "$allocator"
echo 'void ascc_say(void);
void ascc_say(void)
{
    puts("here"); /* and a comment */
}' >>lib/base/status.c
plant 'a line of output' lib/base/status.c "$prints"
sed -i '/ASCC_FLOAT_SCOPE;/d' lib/points/metrics.c
plant "a public function in the host's floating point environment" lib/points/metrics.c "$scope"
archive stray
plant 'a symbol of another name' build/lib/libascc-stray.a "$symbols"
sed -i 1d tests/exports.txt
plant 'an export that is not listed' tests/exports.txt "$exports"
echo "1..$number"
exit $failed
