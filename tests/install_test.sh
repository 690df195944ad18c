#!/bin/sh
# Installs into a new folder, builds both hosts against what was installed, runs them; prints TAP.
# $1: a build folder. SPDX-License-Identifier: MIT
cd "$(dirname "$0")/.." || exit 1
build=${1:-build}
. tests/support/tap.sh

# Moves the whole installation: nothing may depend on where it was configured to go.
install_it() {
    DESTDIR="$folder" meson install -C "$build" --no-rebuild --quiet || return 1
    prefix=$(meson introspect --buildoptions "$build" |
        sed 's/.*"name": "prefix", "value": "\([^"]*\)".*/\1/')
    mv "$folder$prefix" "$folder/root" && pc=$(find "$folder/root" -name ascc.pc) && [ -n "$pc" ] &&
        sed -i "s|^prefix=.*|prefix=$folder/root|" "$pc" "$(dirname "$pc")"/ascc-[mt]*.pc && libdir=$(dirname "$pc")/..
}
check 'it installs' install_it
libdir=$(cd "$libdir" && pwd)
export PKG_CONFIG_PATH="$libdir/pkgconfig" LD_LIBRARY_PATH="$libdir"

warnings='-Wall -Wextra -Wpedantic -Werror'
flags=$(pkg-config --cflags --libs ascc)
pkg_version() { [ "$(pkg-config --modversion ascc)" = "$("$folder/root/bin/ascc" version | cut -d' ' -f2)" ]; }
check 'pkg-config and the program agree on the version' pkg_version

# shellcheck disable=SC2086
{
    check 'hello.c builds as C99' cc -std=c99 $warnings examples/hello.c -o "$folder/hello" $flags
    check 'hello.cpp builds as C++17' \
        c++ -std=c++17 $warnings -Wconversion -Wshadow examples/hello.cpp -o "$folder/hello_cpp" $flags
    printf '#include <ascc/ascc.h>\n' >"$folder/header.c"
    cp "$folder/header.c" "$folder/header.cpp"
    for standard in c99 c11; do
        check "the header compiles alone as $standard" \
            cc -std=$standard $warnings -Wconversion -c "$folder/header.c" -o "$folder/header.o" $flags
    done
    check 'the header compiles alone as c++11' \
        c++ -std=c++11 $warnings -Wconversion -c "$folder/header.cpp" -o "$folder/header.o" $flags
    printf '#include <ascc/ascc.hpp>\nint main() { ascc::context c; return c.get() ? 0 : 1; }\n' >"$folder/header.cpp"
    for compiler in c++ clang++; do
        command -v $compiler >/dev/null 2>&1 || continue
        check "ascc.hpp compiles alone as C++17 and C++20 ($compiler)" sh -c '
            for standard in 17 20; do
                $0 -std=c++$standard $3 -Wconversion -Wshadow -fsyntax-only "$1" $2 || exit 1
            done' $compiler "$folder/header.cpp" "$(pkg-config --cflags ascc)" "$warnings"
    done
    # The demonstration model as a file, written by the public API alone.
    check 'a model is saved through the installed library' sh -c '
        cc -std=c11 "$1/tests/support/save_demo.c" "$1/examples/demo_model.c" -o "$2/save_demo" $3 -lm &&
            "$2/save_demo" 3 "$2/demo3.safetensors" && "$2/save_demo" 2 "$2/demo2.safetensors"' \
        sh "$PWD" "$folder" "$flags"
}
# shellcheck disable=SC2086
check 'ascc.hpp keeps what it promises' sh -c '
    c++ -std=c++17 -g -fsanitize=address,undefined $3 -Wconversion -Wshadow "$1/tests/test_hpp.cpp" -o "$2/test_hpp" $4 &&
        "$2/test_hpp" "$2/demo2.safetensors" "$2/demo3.safetensors"' sh "$PWD" "$folder" "$warnings" "$flags"
# shellcheck disable=SC2046
check 'learn.c builds as C99 against libascc-train alone' cc -std=c99 $warnings examples/learn.c \
    -o "$folder/learn" $(pkg-config --cflags --libs ascc-train)
learns() { "$folder/learn" "$folder/learnt.safetensors" | grep -c loss | grep -qx 10; }
check 'learn trains from a description, the installed way' learns
check 'what it learnt is a model' "$folder/hello" "$folder/learnt.safetensors"
unwritten() { "$folder/learn" /nonexistent/m; [ $? -eq 1 ]; }
check 'learn says so when the model cannot be written' unwritten
for host in hello hello_cpp; do
    for dimension in 2 3; do
        check "$host runs in ${dimension}D" "$folder/$host" "$folder/demo$dimension.safetensors"
    done
    refuses() { "$folder/$host" /nonexistent; [ $? -eq 1 ]; }
    check "$host says so when there is no model" refuses
done

library=$(readlink -f "$libdir/libascc.so")
dynamic=$(readelf -d "$library")
soname() { echo "$dynamic" | grep 'SONAME.*\[libascc\.so\.0\]'; }
check 'the soname is libascc.so.0' soname
needs() {
    ! echo "$dynamic" | sed -n 's/.*(NEEDED).*\[\(.*\)\]/\1/p' |
        grep -vE '^(libc|libm|libpthread|ld-linux.*)\.so'
}
check 'it needs libc, libm and threads alone' needs
trainer() {
    ! nm -D --defined-only "$libdir/libascc-train.so" | awk '{ print $3 }' | grep -vE '^ascc_train(er)?_'
}
check 'libascc-train exports ascc_train_* and ascc_trainer_* alone' trainer
if [ -e "$libdir/libascc-mpi.so" ]; then
    distributed() {
        nm -D --defined-only "$libdir/libascc-mpi.so" | awk '{ print $3 }' | sort >"$folder/exported"
        sed -n 's/^ASCC_API.*[ *]\(ascc_mpi_[a-z_]*\)(.*/\1/p' include/ascc/mpi.h | sort | diff - "$folder/exported"
    }
    check 'libascc-mpi exports what its header declares, and no more' distributed
    check 'ascc-mpi.pc asks for libascc of its version' pkg-config --print-requires ascc-mpi
    # shellcheck disable=SC2046,SC2086
    check 'examples/hosts/mpi.c builds against what is installed' mpicc -std=c99 $warnings examples/hosts/mpi.c \
        -o "$folder/host_mpi" $(pkg-config --cflags --libs ascc-mpi)
fi
exports() { nm -D --defined-only "$library" | awk '{ print $3 }' | LC_ALL=C sort | diff - tests/exports.txt; }
check 'it exports what tests/exports.txt lists' exports
only_ours() { ! nm -D --defined-only "$library" | awk '{ print $3 }' | grep -v '^ascc_'; }
check 'it exports nothing but ascc_*' only_ours

# ---- What lies beside the libraries ----

share=$folder/root/share
installed=$folder/root/bin/ascc
check 'the licence is there' cmp COPYING "$share/licenses/ascc/COPYING"
models() { diff -r examples/models "$share/ascc/models"; }
check 'every model is there' models
by_name() { (cd / && "$installed" info water3d | grep -q 'water3d: model water3d'); }
check 'the program finds a model by name, from any folder' by_name
mkdir "$folder/models" && cp examples/models/pbf2d.safetensors "$folder/models/mine.safetensors"
by_path() { (cd / && ASCC_MODEL_PATH="/nowhere:$folder/models" "$installed" sim mine dam-break-2d --size 6 -n 2); }
check 'and one of ASCC_MODEL_PATH' by_path
beside() { (cd / && "$folder/find" mine | grep -qx "$folder/models/mine.safetensors"); }
cat >"$folder/find.c" <<'END'
#include <ascc/ascc.h>
#include <stdio.h>
int main(int argc, char **argv)
{
    char path[4096];
    ascc_context *context;
    if (argc != 2 || ascc_context_create(NULL, &context) != ASCC_OK ||
        ascc_model_find(context, argv[1], path, sizeof path) != ASCC_OK)
        return 1;
    return puts(path) < 0;
}
END
# shellcheck disable=SC2086
check 'a host asks by one call' cc $warnings "$folder/find.c" -o "$folder/find" $flags
check 'it finds what lies beside it' beside
unknown() { (cd / && "$installed" info water9d 2>&1 | grep -q "no folder of models has 'water9d.safetensors'"); }
check 'what is nowhere is told by name' unknown
# Each command that `ascc --help` lists has a page; troff has nothing to say against any.
pages() {
    commands=$("$installed" --help | sed -n 's/^  \([a-z]*\)  .*/\1/p' | grep -vx version)
    [ -n "$commands" ] || return 1
    for page in ascc $(echo "$commands" | sed 's/^/ascc-/'); do
        grep -q '^\.SH SYNOPSIS' "$share/man/man1/$page.1" || return 1
        ! command -v groff >/dev/null || [ -z "$(groff -man -ww -Tutf8 -z "$share/man/man1/$page.1" 2>&1 | tee /dev/stderr)" ] || return 1
    done
}
check 'the program and every command have a page of the manual' pages
options() { grep -c '^\.TP' "$share/man/man1/ascc-sim.1" | awk '{ exit $1 < 10 }' && grep -q '^time steps$' "$share/man/man1/ascc-sim.1"; }
check 'a page has the options one by one' options
# WORDS..., the last to be completed: what bash would offer.
offers() {
    wanted=$1
    shift
    PATH=$folder/root/bin:$PATH bash -c '. "$1" && shift && COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)) && _ascc &&
        printf "%s\n" "${COMPREPLY[@]}"' bash "$share/bash-completion/completions/ascc" ascc "$@" | grep -qxe "$wanted"
}
if command -v bash >/dev/null; then
    check 'bash completes commands' offers generate gen
    check 'models' offers water2d-tiny sim water2
    check 'scenes' offers dam-break-3d sim water3d dam
    check 'and options' offers --threads sim --th
fi
echo "1..$number"
exit $failed
