#!/bin/sh
# What the program wants on Windows and Debian has no packages of: jansson and libpng, built from Debian's sources.
#   mingw_libraries.sh FOLDER      then FOLDER/lib/pkgconfig is what pkg-config looks in
# Needs gcc-mingw-w64-x86-64-posix, libz-mingw-w64-dev, cmake, and apt-get with a network. SPDX-License-Identifier: MIT
set -eu
mkdir -p "$1/sources/lists/partial"
root=$(cd "$1" && pwd)
cd "$root/sources"
suite=$(. /etc/os-release && echo "$VERSION_CODENAME")
echo "deb-src [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] http://deb.debian.org/debian $suite main" >sources.list
own="-o Dir::Etc::sourcelist=$PWD/sources.list -o Dir::Etc::sourceparts=/dev/null -o Dir::State::lists=$PWD/lists"
# shellcheck disable=SC2086
{
    apt-get -q $own update
    apt-get -q $own source --download-only jansson libpng1.6
}
for archive in *.orig.tar.gz; do
    tar xf "$archive"
done
cmake -S jansson-* -B jansson -DCMAKE_SYSTEM_NAME=Windows -DCMAKE_C_COMPILER=x86_64-w64-mingw32-gcc-posix \
    -DCMAKE_BUILD_TYPE=Release -DCMAKE_INSTALL_PREFIX="$root" -DJANSSON_BUILD_DOCS=OFF -DJANSSON_EXAMPLES=OFF \
    -DJANSSON_WITHOUT_TESTS=ON
cmake --build jansson --target install
mkdir -p png
cd png
../libpng-1.6*/configure --host=x86_64-w64-mingw32 CC=x86_64-w64-mingw32-gcc-posix --prefix="$root" \
    --disable-shared --disable-tools
make install-libLTLIBRARIES install-pkgincludeHEADERS install-nodist_pkgincludeHEADERS install-pkgconfigDATA
cp "$root/lib/pkgconfig/libpng16.pc" "$root/lib/pkgconfig/libpng.pc"
