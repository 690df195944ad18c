# Density and speed of slices across a seam, from seam.csv: gnuplot -c seam.gp FOLDER
# SPDX-License-Identifier: MIT
slices = ARG1."/seam.csv"
set datafile separator ","
set grid lc rgb "#dddddd"
set terminal svg size 900,520 font "sans-serif,13" background "white"
set output ARG1."/seam.svg"
set multiplot layout 1,2 title "A pool that slides to one side, in slices of two spacings, mean of 40 frames"
set xlabel "spacings along the pool"
set xrange [0:25]
set key at graph 0.97,0.3
set arrow 1 from 10.5, graph 0 to 10.5, graph 1 nohead dt 3 lc rgb "#888888"
set arrow 2 from 14.5, graph 0 to 14.5, graph 1 nohead dt 3 lc rgb "#888888"
set ylabel "density, of rest"
set yrange [0.8:1.2]
plot slices using 1:2 every ::1 with linespoints pt 4 lc rgb "#2166ac" title "water3d", \
    "" using 1:4 every ::1 with linespoints pt 6 lc rgb "#c0392b" title "water3d-large", \
    "" using 1:6 every ::1 with lines lw 3 lc rgb "#444444" title "large | water3d"
set ylabel "mean speed, m/s"
set yrange [0:*]
plot slices using 1:3 every ::1 with linespoints pt 4 lc rgb "#2166ac" notitle, \
    "" using 1:5 every ::1 with linespoints pt 6 lc rgb "#c0392b" notitle, \
    "" using 1:7 every ::1 with lines lw 3 lc rgb "#444444" notitle
unset multiplot
