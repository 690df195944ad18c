#!/bin/sh
# SPDX-License-Identifier: MIT
# Runs the tests of examples/convert and prints TAP. Python and its modules are the first that can be
# had of: those of build/venv, those of the system, a new build/venv. Else everything is skipped.
root=$(cd "$(dirname "$0")/.." && pwd) || exit 1
venv=${ASCC_VENV:-$root/build/venv}
modules='import sys, numpy, h5py, msgpack, zstandard; assert sys.version_info >= (3, 9)'

usable() { "$1" -c "$modules" >/dev/null 2>&1; }

if usable "$venv/bin/python"; then
    python=$venv/bin/python
elif usable python3; then
    python=python3
elif [ ! -e "$venv" ] && python3 -m venv "$venv" >/dev/null 2>&1 &&
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check \
        -r "$root/examples/convert/requirements.txt" >&2 && usable "$venv/bin/python"; then
    python=$venv/bin/python
else
    echo '1..0 # SKIP examples/convert needs Python 3.9 and the modules in its requirements.txt'
    exit 0
fi
exec "$python" -B "$root/examples/convert/test_convert.py"
