# Where the labels of one panel go: awk -v s=SEQUENCE -v e=COLUMN -v low=Y -v high=Y -f labels.awk CSV.
# Prints family|x|y|label x|label y|label|nearest x of it|nearest y, tab separated. A label goes to the nearest place around its
# point that covers no point and no other label; a point above the panel is drawn at its upper edge with
# its value behind its name. Sizes are in pixels of chart.gp. SPDX-License-Identifier: MIT
function abs(a) { return a < 0 ? -a : a }
function to_x(v) { return log(v) / log(600) * WIDE }
function to_y(v) { return log(v / low) / log(high / low) * HIGH }
function from_x(u) { return exp(u / WIDE * log(600)) }
function from_y(u) { return low * exp(u / HIGH * log(high / low)) }
# Area that boxes share.
function covered(ax, ay, aw, ah, bx, by, bw, bh,    w, h) {
    w = (aw + bw) / 2 - abs(ax - bx)
    h = (ah + bh) / 2 - abs(ay - by)
    return w > 0 && h > 0 ? w * h : 0
}
function nearest(a, middle, size) {
    return a < middle - size / 2 ? middle - size / 2 : a > middle + size / 2 ? middle + size / 2 : a
}
function badness(x, y, w, h,    k, sum) {
    sum = 0
    if (x - w / 2 < 2 || x + w / 2 > WIDE - 2 || y - h / 2 < 2 || y + h / 2 > HIGH - 2)
        return 1e9
    for (k = 1; k <= n; k++)
        sum += covered(x, y, w, h, px[k], py[k], 13, 13)
    for (k = 1; k <= placed; k++)
        sum += covered(x, y, w, h, lx[k], ly[k], lw[k], h)
    return sum
}
BEGIN { WIDE = 410; HIGH = 365; n = placed = 0 }
{
    split($0, q, "\"")
    split(q[1], a, ",")
    split(q[5], b, ",")
    if (a[1] != s || a[2] == "floor" || !(b[3] > 0) || b[e] ~ /nan/ || !(b[e] > 0))
        next
    n++
    family[n] = a[2]
    text[n] = q[2]
    x[n] = b[3]
    y[n] = b[e]
    if (y[n] > high) {
        text[n] = sprintf("%s: %.2g", q[2], y[n])
        y[n] = high * exp(-0.03 * log(high / low))
    }
    px[n] = to_x(x[n])
    py[n] = to_y(y[n])
}
END {
    for (i = 1; i <= n; i++) {
        w = 6.3 * length(text[i]) + 4
        h = 13
        best = 1e18
        for (r = 0; r <= 10 && best > 0; r++)
            for (t = 0; t < 16; t++) {
                angle = 3.14159265 / 8 * (t + 2)
                cx = px[i] + cos(angle) * (8 + 9 * r + w / 2)
                cy = py[i] + sin(angle) * (14 + 9 * r)
                cost = badness(cx, cy, w, h) + 0.01 * r
                if (cost < best - 1e-9) {
                    best = cost
                    bx = cx
                    by = cy
                }
            }
        placed++
        lx[placed] = bx
        ly[placed] = by
        lw[placed] = w
        printf "%s\t%g\t%g\t%g\t%g\t%s\t%g\t%g\n", family[i], x[i], y[i], from_x(bx), from_y(by), text[i],
            from_x(nearest(px[i], bx, w)), from_y(nearest(py[i], by, h - 4))
    }
}
