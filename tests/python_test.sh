#!/bin/sh
# examples/python: the wheel, its types, the package against the library of a build, and with it a network against
# numpy; prints TAP.
# $1: a build folder. SPDX-License-Identifier: MIT
. "$(dirname "$0")/support/python.sh"
root=$(cd "$(dirname "$0")/.." && pwd) || exit 1
build=$(cd "${1:-$root/build}" && pwd) || exit 1
if ! python_with 'numpy, setuptools, wheel'; then
    echo '1..0 # SKIP examples/python needs Python 3.9 with numpy, setuptools and wheel'
    exit 0
fi
. "$root/tests/support/tap.sh"
pip() { "$python" -m pip "$@" --quiet --disable-pip-version-check --no-input; }

# The tree stays clean: setuptools builds beside what it reads.
cp -r "$root/examples/python" "$folder/package"
export PYTHONDONTWRITEBYTECODE=1
wheel() {
    pip wheel --no-deps --no-build-isolation --no-index -w "$folder/wheel" "$folder/package" &&
        [ "$(ls "$folder/wheel")" = ascc-0.1.0-py3-none-any.whl ]
}
check 'a wheel is built from the tree' wheel
check 'and installed' pip install --no-deps --no-index --no-compile --target "$folder/site" "$folder"/wheel/*.whl
export PYTHONPATH="$folder/site"
check 'it tells type checkers that it is typed' [ -f "$folder/site/ascc/py.typed" ]
if "$python" -c 'import mypy' 2>/dev/null; then
    check 'the package has the types it says' "$python" -m mypy --cache-dir /dev/null --strict -p ascc
else
    skip 'the package has the types it says' 'no mypy'
fi

# As after `meson install` into a place that the loader does not know: pkg-config tells it.
found() {
    mkdir -p "$folder/lib/pkgconfig" && cp "$build/lib/libascc.so.0" "$folder/lib" &&
        printf 'libdir=%s\nName: ascc\nDescription: x\nVersion: 0.1.0\n' "$folder/lib" >"$folder/lib/pkgconfig/ascc.pc" &&
        env -u ASCC_LIBRARY LD_LIBRARY_PATH= PKG_CONFIG_PATH="$folder/lib/pkgconfig" "$python" -c '
import ascc, sys
assert ascc.version() == (0, 1, 0)'
}
check 'the library is found where pkg-config says' found
missing() {
    ! ASCC_LIBRARY=/nonexistent/libascc.so "$python" -c 'import ascc' 2>"$folder/err" &&
        grep -q 'ImportError: libascc was not found.*ASCC_LIBRARY.*/nonexistent' "$folder/err"
}
check 'a library that is not there is told' missing

export ASCC_LIBRARY="$build/lib/libascc.so.0"
if "$python" -c 'import matplotlib' 2>/dev/null; then
    example() {
        MPLBACKEND=Agg "$python" "$root/examples/python/dam_break.py" "$root/examples/models/water2d.safetensors" \
            "$folder/dam.png" && "$python" - "$folder/dam.png" "$root/examples/python/dam_break.py" <<'END'
import sys
import matplotlib.image
picture = matplotlib.image.imread(sys.argv[1])
assert picture.shape[:2] == (600, 1000), picture.shape
assert len({tuple(p) for p in picture[::3, ::3, :3].reshape(-1, 3).round(1).tolist()}) > 30  # many speeds
assert len(open(sys.argv[2]).readlines()) < 20
END
    }
    check 'the dam break of less than 20 lines draws its picture' example
else
    skip 'the dam break of less than 20 lines draws its picture' 'no matplotlib'
fi
# page NAME: its Python, all of it in one program.
page() {
    sed -n '/^```python$/,/^```$/p' "$root/docs/$1" | grep -v '^```' >"$folder/page.py" &&
        cd "$root" && [ "$(wc -l <"$folder/page.py")" -gt 10 ] && "$python" "$folder/page.py"
}
check 'the code in docs/python.md runs' page python.md
check 'so does that in docs/walls.md' page walls.md
# The package's own tests, and a network through it; their numbers follow.
for name in test_python test_pointnet test_gns; do
    "$python" "$root/tests/$name.py" >"$folder/$name.tap" 2>&1 || failed=1
    grep -q '^1\.\.[1-9]' "$folder/$name.tap" ||
        { echo "not ok - tests/$name.py runs"; sed 's/^/# /' "$folder/$name.tap"; }
done
awk -v number="$number" '/^1\.\./ { next }
    /^ok / { sub(/^ok [0-9]+/, "ok " ++number) }
    /^not ok / { sub(/^not ok [0-9]+/, "not ok " ++number) }
    { print }
    END { print "1.." number }' "$folder/test_python.tap" "$folder/test_pointnet.tap" "$folder/test_gns.tap"
exit $failed
