#!/bin/sh
# Puts the table of a CSV file of `chart` between the marks of docs/chart.md.
# table.sh CSV LOAD_BEFORE LOAD_AFTER [DATE]. SPDX-License-Identifier: MIT
doc=docs/chart.md
cpu=$(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -n 1)
cores=$(tail -n 1 "$1" | awk -F'"' '{ split($5, a, ","); print a[5] }')
date=${4:-$(date +%Y-%m-%d)}
new=$(mktemp) || exit 1
{
    sed '/<!-- table begins -->/q' $doc
    echo "Measured $date on ${cpu:-an unknown CPU}, $cores cores, load $2 when it began and $3 when it ended"
    echo "(other work: wall times suffer, CPU times less)."
    echo
    echo '| sequence | method | CPU us, one thread | wall us, all cores | err_n2 | Chamfer 1 s | density 1 s | escaped |'
    echo '|---|---|---|---|---|---|---|---|'
    awk 'NR > 1 {
        split($0, q, "\""); split(q[1], a, ","); split(q[5], b, ",")
        density = b[8] ~ /nan/ ? "-" : sprintf("%.4f%s", b[8], b[14] ? " *" : "")
        printf "| %s | `%s` | %.3g | %.3g | %.5f m%s | %.4f m%s | %s | %d |\n", a[1], q[4], b[3],
            b[4], b[6], b[12] ? " *" : "", b[7], b[13] ? " *" : "", density, b[10]
    }' "$1"
    sed -n '/<!-- table ends -->/,$p' $doc
} >"$new" && cat "$new" >$doc
rm -f "$new"
