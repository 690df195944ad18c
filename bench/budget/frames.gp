# Times and rungs of frames, from budget-frames.csv: gnuplot -c frames.gp FOLDER
# SPDX-License-Identifier: MIT
frames = ARG1."/budget-frames.csv"
set datafile separator ","
set grid lc rgb "#dddddd"
set output ARG1."/budget-frames.svg"
set terminal svg size 900,640 font "sans-serif,13" background "white"
set multiplot layout 2,1 title "19,652 particles at rest, 4,913 more from frame 60 to 180 and from 240, within 190 ms a step"
set lmargin 9
set xrange [0:360]
set yrange [0:400]
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
set yrange [0:*]
plot frames using 1:($8 * 1e3) every ::1 with linespoints pt 7 ps 0.3 lc rgb "#444444"
unset multiplot
