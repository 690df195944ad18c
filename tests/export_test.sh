#!/bin/sh
# Files for other programs, and theirs: runs tests/test_export.py, which prints TAP. $1: a build folder.
# SPDX-License-Identifier: MIT
. "$(dirname "$0")/support/python.sh"
if ! python_with 'numpy, h5py, meshio'; then
    echo '1..0 # SKIP export and import need Python 3.9 with numpy, h5py and meshio'
    exit 0
fi
ASCC=$(cd "${1:-build}" && pwd)/examples/ascc exec "$python" -B "$(dirname "$0")/test_export.py"
