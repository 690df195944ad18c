#!/bin/sh
# The C in README.md and docs/getting-started.md compiles; prints TAP. SPDX-License-Identifier: MIT
cd "$(dirname "$0")/.." || exit 1
folder=$(mktemp -d) || exit 1
trap 'rm -rf "$folder"' EXIT
number=0
failed=0
for page in README.md docs/getting-started.md; do
    number=$((number + 1))
    source="$folder/page.c"
    {
        echo '#include <stddef.h>'
        echo '#include <stdint.h>'
        echo '#include <ascc/ascc.h>'
        sed -n '/^```c$/,/^```$/p' "$page" | grep -v '^```'
    } >"$source"
    if [ "$(wc -l <"$source")" -gt 15 ] &&
        cc -std=c11 -Wall -Wextra -Wpedantic -Werror -Iinclude -c "$source" -o "$folder/page.o" 2>"$folder/err"; then
        echo "ok $number - the code in $page compiles"
    else
        echo "not ok $number - the code in $page compiles"
        sed 's/^/# /' "$folder/err"
        failed=1
    fi
done
number=$((number + 1))
if sh docs/make_api.sh | cmp -s - docs/api.md; then
    echo "ok $number - docs/api.md is what the header says"
else
    echo "not ok $number - docs/api.md is what the header says: sh docs/make_api.sh >docs/api.md"
    failed=1
fi
echo "1..$number"
exit $failed
