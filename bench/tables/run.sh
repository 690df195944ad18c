#!/bin/sh
# The paper's tables and figures beside its own: measures, draws, writes docs/tables.md.
# sh bench/tables/run.sh [--quick] [--build DIR] [--shared DIR] [--page FILE]
# Hours, and resumable: what is measured is kept in DIR/tables and not measured again. --quick does all of it from
# smaller runs in minutes. Needs Python with numpy and matplotlib: that of build/venv, which the tests of Python make,
# or the system's. SPDX-License-Identifier: MIT
cd "$(dirname "$0")/../.." || exit 1
for python in "${ASCC_VENV:-build/venv}/bin/python" python3; do
    "$python" -c 'import numpy, matplotlib' 2>/dev/null &&
        MPLBACKEND=Agg PYTHONDONTWRITEBYTECODE=1 exec "$python" bench/tables/tables.py "$@"
done
echo 'bench/tables needs Python with numpy and matplotlib' >&2
exit 1
