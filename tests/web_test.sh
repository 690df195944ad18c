#!/bin/sh
# The web page: the module gives the bits that this machine gives, in Node.js and in a browser; prints TAP.
# $1: a build folder. Installs nothing; what it has no tools for is a SKIP. SPDX-License-Identifier: MIT
cd "$(dirname "$0")/.." || exit 1
build=${1:-build}
. tests/support/tap.sh
server=
trap '[ -z "$server" ] || kill $server; rm -rf "$folder"' EXIT

if ! have emcc || ! have node || ! have python3; then
    skip 'the web page' 'needs emcc, node and python3'
    echo "1..$number"
    exit 0
fi
level=-O1 # a third of the time; the bits are the same
[ -z "${ASCC_TEST_LONG:-}" ] || level=-O3
web=$folder/web
check 'the page and its module are built' sh examples/web/build.sh "$web" "-msimd128 -mbulk-memory $level"

# The same tank by the library of this machine. The page's own is 24 x 32.
cat >"$folder/tank.c" <<'END'
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
int water_open(const void *model, size_t size, int columns, int rows);
int water_run(int steps, double gravity_x, double gravity_y);
uint32_t water_hash(int upper);
void water_close(void);
int main(int argc, char **argv)
{
    static char bytes[1 << 20];
    FILE *file = argc == 3 ? fopen(argv[1], "rb") : NULL;
    if (!file || !water_open(bytes, fread(bytes, 1, sizeof bytes, file), 24, 32) ||
        !water_run(atoi(argv[2]), 0.0, -9.81))
        return 1;
    printf("%08x%08x\n", (unsigned)water_hash(1), (unsigned)water_hash(0));
    water_close();
    return fclose(file);
}
END
native() {
    cc -O1 -Wall -Wextra -Werror -Iinclude "$folder/tank.c" examples/web/water.c -o "$folder/tank" \
        "$build/lib/libascc.so" -Wl,-rpath,"$(cd "$build/lib" && pwd)" -lm &&
        "$folder/tank" examples/models/water2d.safetensors 40 >"$folder/hash" && grep -qE '^[0-9a-f]{16}$' "$folder/hash"
}
check 'the same tank runs here' native
cp examples/web/check.mjs "$web"
in_node() { node "$web/check.mjs" "$web" 24 32 20 | grep "^$(cat "$folder/hash") "; }
check 'the module gives the same hash in Node.js after 40 steps' in_node

# ---- A browser ----

browser=
for name in chromium chromium-browser google-chrome; do
    have $name && browser=$name && break
done
if [ -z "$browser" ]; then
    skip 'the page in a browser' 'no chromium'
else
    python3 -u - "$web" >"$folder/port" <<'END' &
import functools, http.server, sys
class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass
server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=sys.argv[1]))
print(server.server_address[1], flush=True)
server.serve_forever()
END
    server=$!
    for _ in 1 2 3 4 5 6 7 8 9 10; do [ -s "$folder/port" ] || sleep 0.3; done
    page=http://127.0.0.1:$(cat "$folder/port")/index.html
    # ADDRESS: the page as it is after some seconds of its own time.
    page_after() {
        timeout 120 $browser --headless --no-sandbox --disable-gpu --disable-extensions --disable-background-networking \
            --user-data-dir="$folder/profile" --virtual-time-budget="$2" --dump-dom "$1" 2>/dev/null
    }
    # told PATTERN ADDRESS: what the page shows of that. Its own time may run out before the module is compiled, on a
    # machine that has much to do: then it gets more.
    told() {
        for budget in 20000 100000 500000; do
            page_after "$2" $budget | grep -oE "$1" && return
        done
    }
    in_browser() { told '<title>hash [^<]*' "$page?steps=40" | tee "$folder/title"; [ "$(cat "$folder/title")" = "<title>hash $(cat "$folder/hash")" ]; }
    check 'the page gives the same hash in a browser' in_browser
    # Its frames go on by themselves.
    advances() { told 'frame [0-9]+, ' "$page" | awk '{ print; fine = $2 > 10 } END { exit !fine }'; }
    check 'the page runs: frames advance' advances
fi
echo "1..$number"
exit $failed
