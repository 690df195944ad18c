# Cost against accuracy from a CSV file of `chart`: gnuplot -c chart.gp CSV OUT TERMINAL(svg or png)
# SPDX-License-Identifier: MIT
csv = ARG1
if (ARG3 eq "svg") set terminal svg size 1500,1060 font "sans-serif,13" background "white"
if (ARG3 eq "png") set terminal pngcairo size 1500,1060 font "sans,11"
set output ARG2
set datafile separator ","
set logscale xy
set grid lc rgb "#dddddd"
set key off
set format x "%g"
set format y "%g"
set xrange [1:600]
set xtics (1, 2, 5, 10, 20, 50, 100, 200, 500)
# Ranges that hold every method but what flies off; tighter than powers of ten.
low(p) = p == 0 ? 0.002 : p == 1 ? 0.01 : 0.0002
high(p) = p == 0 ? 1 : p == 1 ? 30 : 2

# Columns of the CSV.
cost = 6
error(p) = p == 0 ? 9 : p == 1 ? 10 : 11
title_of(p) = p == 0 ? "two frames: err\\_n2, m" : p == 1 ? "after 1 s: Chamfer distance, m" : \
    "after 1 s: mean density error"
is(s, f) = (strcol(1) eq s && strcol(2) eq f)
good(p, s, f) = is(s, f) ? column(error(p)) : NaN
# The points of the front by cost, a method's name and its settings hold commas.
led(p, s) = sprintf("< awk '{ split($0, q, \"\\\"\"); split(q[1], a, \",\"); split(q[5], b, \",\"); if (a[1] == \"%s\" && b[%d] == 1) print b[3] \",\" b[%d] }' %s | sort -t, -g", s, 12 + p, 6 + p, csv)
floor_of(p, s) = system(sprintf("awk -F, '$1 == \"%s\" && $2 == \"floor\" { print $%d }' %s", s, error(p), csv))

set multiplot layout 2,3 margins 0.06,0.985,0.085,0.90 spacing 0.055,0.13 \
    title "Cost and accuracy: lower left is better. Grey steps: Pareto front. Dotted: ballistic, the floor"
do for [s in "test_000 dam_break"] {
    do for [p = 0:2] {
        set title sprintf("%s   %s", s eq "test_000" ? "test\\_000" : "dam\\_break", title_of(p))
        set xlabel s eq "dam_break" ? "CPU us per particle and frame, one thread" : ""
        if (s eq "test_000" && p == 2) {
            set key bottom left Left reverse samplen 1 opaque
        } else {
            set key off
        }
        set yrange [low(p):high(p)]
        flat = floor_of(p, s) + 0.0
        plot flat with lines dt 3 lw 2 lc rgb "#888888" notitle, \
            led(p, s) using 1:2 with steps lw 6 lc rgb "#d8d8d8" notitle, \
            csv using cost:(good(p, s, "network")) with points pt 7 ps 1.3 lc rgb "#c0392b" title "networks", \
            csv using cost:(good(p, s, "SPH")) with points pt 5 ps 1.2 lc rgb "#2166ac" title "SPH: speed of sound c, m/s", \
            csv using cost:(good(p, s, "PBF")) with points pt 9 ps 1.4 lc rgb "#1b7837" title "PBF: substeps x iterations", \
            csv using cost:(good(p, s, "network")):3 with labels left rotate by 45 offset 0.4,0.6 font ",10" tc rgb "#c0392b" notitle, \
            csv using cost:(good(p, s, "SPH")):3 with labels left rotate by -45 offset 0.5,-0.6 font ",10" tc rgb "#2166ac" notitle, \
            csv using cost:(good(p, s, "PBF")):3 with labels left rotate by 45 offset 0.4,0.6 font ",10" tc rgb "#1b7837" notitle
    }
}
unset multiplot
