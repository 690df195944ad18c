# Cost and accuracy of a minute, from budget.csv: gnuplot -c minute.gp FOLDER
# SPDX-License-Identifier: MIT
minute = ARG1."/budget.csv"
set datafile separator ","
set grid lc rgb "#dddddd"
set terminal svg size 900,560 font "sans-serif,13" background "white"

set output ARG1."/budget.svg"
set title "A minute of a pool that takes water and loses it: cost, and distance to all of it by water3d-large"
set xlabel "CPU time of a step of 0.02 s, ms, in the mean (one thread)"
set ylabel "Chamfer distance to that run, mm, in the mean"
set logscale x
set xtics (0.5, 1, 2, 5, 10)
set xrange [0.5:20]
set yrange [-2:*]
set key bottom left
# Fixed models are squares, ladders circles; filled: parts may sleep.
of(ladder, sleeps) = sprintf("< awk -F, 'NR > 1 && ($1 ~ / ms/) == %d && ($2 > 0) == %d' %s", ladder, sleeps, minute)
plot for [s = 0:1] of(0, s) using 3:($4 * 1e3) with points pt (s ? 5 : 4) ps 1.4 lc rgb "#2166ac" \
        title (s ? "one model, sleeping" : "one model"), \
    for [s = 0:1] of(1, s) using 3:($4 * 1e3) with points pt (s ? 7 : 6) ps 1.4 lc rgb "#c0392b" \
        title (s ? "ladder with a budget, sleeping" : "ladder with a budget"), \
    for [l = 0:1] for [s = 0:1] of(l, s) using 3:($4 * 1e3):1 with labels left offset 1,(s ? -0.4 : 0.4) \
        font ",10" notitle
