#!/bin/sh
# Prints docs/api.md, made from the public headers: sections, comments and declarations as they stand.
# sh docs/make_api.sh >docs/api.md
# SPDX-License-Identifier: MIT
cd "$(dirname "$0")/.." || exit 1
# header FILE: what stands in it from the first declaration on.
header() {
    awk '
        function flush_code() {
            if (code != "") { printf "\n```c\n%s```\n", code; code = "" }
        }
        /^#ifndef ASCC_ASCC_H/ { started = 0 }
        /^\/\*$/ && !seen { intro = 1; seen = 1; printf "\n```text\n"; next }
        intro && /^ \*\// { intro = 0; print "```"; next }
        intro { sub(/^ \* ?/, ""); print; next }
        /^typedef (enum ascc_status|struct ascc_trainer)/ { started = 1 }
        /^\/\*\* Result of every call/ { started = 1 }
        !started { next }
        /^#ifdef __cplusplus/ { flush_code(); exit }
        /^\/\* ---- / {
            flush_code()
            title = $0; sub(/^\/\* ---- /, "", title); sub(/ -+ \*\/$/, "", title)
            printf "\n## %s\n", title; next
        }
        /^\/\*\*/ { flush_code() }
        /^$/ { if (depth == 0) { if (code != "" && code !~ /\n\n$/) code = code "\n" } else code = code "\n"; next }
        { code = code $0 "\n" }
        /\{$/ { depth = 1 }
        /^\}/ { depth = 0 }
    ' "$1" | awk '
        # Drops blank lines at the end of code blocks.
        /^```$/ { while (n && held[n] == "") n--; for (i = 1; i <= n; i++) print held[i]; n = 0; print; open = 0; next }
        /^```/ { print; open = 1; n = 0; next }
        open { held[++n] = $0; next }
        { print }'
}

echo "# API reference"
echo
echo "Made from \`include/ascc/ascc.h\` and \`include/ascc/train.h\` by \`docs/make_api.sh\`; the headers are the manual."
header include/ascc/ascc.h
echo
echo "# Training: ascc/train.h, libascc-train"
header include/ascc/train.h
