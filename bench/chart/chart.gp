# Cost against accuracy from a CSV file of `chart`: gnuplot -c chart.gp CSV OUT TERMINAL(svg or png)
# SPDX-License-Identifier: MIT
csv = ARG1
if (ARG3 eq "svg") set terminal svg size 1500,1060 font "sans-serif,13" background "white"
if (ARG3 eq "png") set terminal pngcairo size 1500,1060 font "sans,11"
set output ARG2
set logscale xy
set grid lc rgb "#dddddd"
set key off
set format x "%g"
set format y "%g"
set xrange [1:600]
set ytics (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2)
set xtics (1, 2, 5, 10, 20, 50, 100, 200, 500)
# Ranges that hold every method but what flies off, which is drawn at the upper edge.
low(p) = p == 0 ? 0.003 : p == 1 ? 0.015 : 0.0004
high(p) = p == 0 ? 0.05 : p == 1 ? 3 : 1.5

# Columns of the CSV behind the quoted ones, as awk counts them.
cost = 3
error(p) = 6 + p
title_of(p) = p == 0 ? "two frames: err\\_n2, m" : p == 1 ? "after 1 s: Chamfer distance, m" : \
    "after 1 s: mean density error"
quoted = "split($0, q, \"\\\"\"); split(q[1], a, \",\"); split(q[5], b, \",\");"
# The points of the front by cost.
led(p, s) = sprintf("< awk '{ %s if (a[1] == \"%s\" && b[%d] == 1) print b[%d] \"\\t\" b[%d] }' %s | sort -g", \
    quoted, s, 12 + p, cost, error(p), csv)
floor_of(p, s) = system(sprintf("awk '{ %s if (a[1] == \"%s\" && a[2] == \"floor\") print b[%d] }' %s", \
    quoted, s, error(p), csv))
labelled(p, s, f) = sprintf("< awk -v s=%s -v e=%d -v low=%g -v high=%g -f bench/chart/labels.awk %s | grep '^%s'", \
    s, error(p), low(p), high(p), csv, f)

set datafile separator "\t"
families = "network SPH DFSPH PBF"
title_x = "0.08 0.20 0.51 0.72"
titles = "'networks' 'SPH: speed of sound c (m/s), time step dt, spacing dx' 'DFSPH: steps a frame' 'PBF: substeps x iterations'"
colour(k) = k == 1 ? "#c0392b" : k == 2 ? "#2166ac" : k == 3 ? "#8e44ad" : "#1b7837"
shape(k) = k == 1 ? 7 : k == 2 ? 5 : k == 3 ? 13 : 9
set multiplot layout 2,3 margins 0.06,0.985,0.115,0.90 spacing 0.055,0.13 \
    title "Cost and accuracy: lower left is better. Grey steps: Pareto front. Dotted: ballistic, the floor"
do for [k = 1:4] {
    set label k word(titles, k) at screen word(title_x, k) + 0.0,0.035 left offset 1,0 \
        point pt shape(k) ps 1.3 lc rgb colour(k)
}
do for [s in "test_000 dam_break"] {
    do for [p = 0:2] {
        set title sprintf("%s   %s", s eq "test_000" ? "test\\_000" : "dam\\_break", title_of(p))
        set xlabel s eq "dam_break" ? "CPU us per particle and frame, one thread" : ""
        set yrange [low(p):high(p)]
        flat = floor_of(p, s) + 0.0
        plot flat with lines dt 3 lw 2 lc rgb "#888888" notitle, \
            led(p, s) using 1:2 with steps lw 6 lc rgb "#d8d8d8" notitle, \
            for [k = 1:4] labelled(p, s, word(families, k)) using 2:3:($7 - $2):($8 - $3) \
                with vectors nohead lw 0.5 lc rgb colour(k) notitle, \
            for [k = 1:4] labelled(p, s, word(families, k)) using 2:3 with points pt shape(k) ps 1.3 \
                lc rgb colour(k) notitle, \
            for [k = 1:4] labelled(p, s, word(families, k)) using 4:5:6 with labels center font ",10" \
                tc rgb colour(k) notitle
        do for [k = 1:4] { unset label k }
    }
}
unset multiplot
