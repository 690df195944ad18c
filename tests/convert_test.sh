#!/bin/sh
# SPDX-License-Identifier: MIT
# Runs the tests of examples/convert and prints TAP; skipped where there is no Python with its modules.
. "$(dirname "$0")/support/python.sh"
if ! python_with 'numpy, h5py, msgpack, zstandard'; then
    echo '1..0 # SKIP examples/convert needs Python 3.9 and the modules in its requirements.txt'
    exit 0
fi
exec "$python" -B "$(dirname "$0")/../examples/convert/test_convert.py"
