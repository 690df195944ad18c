# A Python with modules: python_with 'MODULES' sets $python, or fails. SPDX-License-Identifier: MIT
#
# The first that has them: build/venv, the system's, build/venv with all of tests/requirements.txt, and of
# requirements-optional.txt what can be had.

python_install() { "$python" -m pip install --quiet --disable-pip-version-check -r "$python_root/tests/$1"; }

python_with() {
    python_root=$(cd "$(dirname "$0")/.." && pwd) || return 1
    python_venv=${ASCC_VENV:-$python_root/build/venv}
    python_needs="import sys, $1; assert sys.version_info >= (3, 9)"
    for python in "$python_venv/bin/python" python3; do
        "$python" -c "$python_needs" >/dev/null 2>&1 && return 0
    done
    python=$python_venv/bin/python
    { [ -x "$python" ] || python3 -m venv "$python_venv" >/dev/null 2>&1; } &&
        python_install requirements.txt >&2 && "$python" -c "$python_needs" >/dev/null 2>&1 &&
        { python_install requirements-optional.txt >&2 || :; }
}
