# What a process sends in a step, measured and fitted: gnuplot -e "a = ..." -c processes.gp CSV SVG
# SPDX-License-Identifier: MIT
set terminal svg size 800,560 font "sans-serif,13" background "white"
set output ARG2
set datafile separator ","
set logscale xy
set grid lc rgb "#dddddd"
set key top left
set xlabel "particles of a process, N / P"
set ylabel "MB that a process sends in a step, mean"
set xrange [800:2e6]
law(n, p) = a * n**(2.0/3) * (1 - p**(-1.0/3)) / 1e6
plot for [p in "2 4 8 16"] ARG1 using ($1 == p + 0 ? $3 / $1 : NaN):($9 / 1e6) with points pt 7 ps 0.8 \
        lc rgb (p eq "2" ? "#2166ac" : p eq "4" ? "#1b7837" : p eq "8" ? "#8e44ad" : "#c0392b") title p . " processes", \
    for [p in "2 4 8 16"] (x < 2e5 ? law(x, p + 0) : NaN) lw 1.5 \
        lc rgb (p eq "2" ? "#2166ac" : p eq "4" ? "#1b7837" : p eq "8" ? "#8e44ad" : "#c0392b") notitle, \
    law(x, 1024) dt 2 lw 1.5 lc rgb "#666666" title "1,024 processes, extrapolated", \
    "+" using (1e9 / 1024):(law(1e9 / 1024, 1024)) every ::0::0 with points pt 2 ps 1.3 lc rgb "#666666" \
        title "10^9 particles on 1,024"
