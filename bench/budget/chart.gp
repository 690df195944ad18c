# Cost and accuracy of a minute, and times and rungs of frames: gnuplot -c chart.gp BUDGET.csv FRAMES.csv FOLDER
# SPDX-License-Identifier: MIT
minute = ARG1
frames = ARG2
set datafile separator ","
set grid lc rgb "#dddddd"
set terminal svg size 900,560 font "sans-serif,13" background "white"

set output ARG3."/budget.svg"
set title "A minute of a pool that takes water and loses it: cost, and distance to all of it by water3d-large"
set xlabel "CPU time of a step of 0.02 s, ms, in the mean (one thread)"
set ylabel "Chamfer distance to that run, mm, in the mean"
set xrange [0:*]
set yrange [-2:*]
set key bottom left
# Fixed models are squares, ladders circles; filled: parts may sleep.
of(ladder, sleeps) = sprintf("< awk -F, 'NR > 1 && ($1 ~ / ms/) == %d && ($2 > 0) == %d' %s", ladder, sleeps, minute)
plot for [s = 0:1] of(0, s) using 3:($4 * 1e3) with points pt (s ? 5 : 4) ps 1.4 lc rgb "#2166ac" \
        title (s ? "one model, sleeping" : "one model"), \
    for [s = 0:1] of(1, s) using 3:($4 * 1e3) with points pt (s ? 7 : 6) ps 1.4 lc rgb "#c0392b" \
        title (s ? "ladder with a budget, sleeping" : "ladder with a budget"), \
    for [l = 0:1] for [s = 0:1] of(l, s) using 3:($4 * 1e3):1 with labels offset 0,(s ? -1 : 1) font ",10" notitle

set output ARG3."/budget-frames.svg"
set terminal svg size 900,640 font "sans-serif,13" background "white"
unset title
set multiplot layout 2,1 title "20,000 particles at rest, 4,913 more from frame 100 to 300 and from 400: pbf3d, water3d, water3d-large within 190 ms"
set xrange [0:600]
set yrange [0:*]
set ylabel "CPU time of a step, ms"
set xlabel ""
set key top left horizontal
colour(r) = r == 0 ? 0x1b7837 : r == 1 ? 0x2166ac : 0xc0392b
plot frames using 1:9 every ::1 with lines lc rgb "#c8c8c8" title "all by water3d-large", \
    "" using 1:2:(colour($3)) every ::1 with points pt 7 ps 0.4 lc rgb variable notitle, \
    NaN with points pt 7 lc rgb 0x1b7837 title "pbf3d", NaN with points pt 7 lc rgb 0x2166ac title "water3d", \
    NaN with points pt 7 lc rgb 0xc0392b title "water3d-large", 190 with lines dt 2 lc rgb "black" title "budget"
set ylabel "Chamfer distance between both, mm"
set xlabel "frame of 0.02 s"
set key off
plot frames using 1:($8 * 1e3) every ::1 with linespoints pt 7 ps 0.3 lc rgb "#444444"
unset multiplot
