/* A grid's cube in double precision, with derivatives: maps, windows, trilinear weights.
 * SPDX-License-Identifier: MIT */
#include "cube.h"

#include <math.h>
#include <string.h>

/* A number and its derivatives by the three coordinates of a displacement. */
typedef struct dual {
    double value, by[3];
} dual;

static dual constant(double value)
{
    return (dual){value, {0.0, 0.0, 0.0}};
}

static dual linear(dual a, double x, dual b, double y)
{
    dual r = {a.value * x + b.value * y, {0.0, 0.0, 0.0}};
    for (int c = 0; c < 3; c++)
        r.by[c] = a.by[c] * x + b.by[c] * y;
    return r;
}

static dual product(dual a, dual b)
{
    dual r = {a.value * b.value, {0.0, 0.0, 0.0}};
    for (int c = 0; c < 3; c++)
        r.by[c] = a.by[c] * b.value + a.value * b.by[c];
    return r;
}

/* f(a), given its value and derivative there. */
static dual chain(dual a, double value, double slope)
{
    dual r = {value, {0.0, 0.0, 0.0}};
    for (int c = 0; c < 3; c++)
        r.by[c] = slope * a.by[c];
    return r;
}

static dual quotient(dual a, dual b)
{
    return product(a, chain(b, 1.0 / b.value, -1.0 / (b.value * b.value)));
}

static dual root(dual a)
{
    const double s = sqrt(a.value);
    return chain(a, s, s > 0.0 ? 0.5 / s : 0.0);
}

static dual magnitude(dual a)
{
    return a.value < 0.0 ? linear(a, -1.0, a, 0.0) : a;
}

/* |a| with the sign of b. */
static dual signed_like(dual a, dual b)
{
    return signbit(a.value) == signbit(b.value) ? a : linear(a, -1.0, a, 0.0);
}

static void map_radial(dual at[3])
{
    const dual square = linear(linear(product(at[0], at[0]), 1.0, product(at[1], at[1]), 1.0), 1.0,
                               product(at[2], at[2]), 1.0);
    dual largest = magnitude(at[0]);
    for (int c = 1; c < 3; c++)
        if (fabs(at[c].value) > largest.value)
            largest = magnitude(at[c]);
    if (square.value < 1e-12) {
        at[0] = at[1] = at[2] = constant(0.0);
        return;
    }
    const dual s = quotient(root(square), largest);
    for (int c = 0; c < 3; c++)
        at[c] = product(at[c], s);
}

/* Ball to cylinder, cylinder to cube (docs/method.md). */
static void map_volume(dual at[3])
{
    const dual h2 = linear(product(at[0], at[0]), 1.0, product(at[1], at[1]), 1.0);
    const dual n2 = linear(h2, 1.0, product(at[2], at[2]), 1.0);
    if (n2.value < 1e-12) {
        at[0] = at[1] = at[2] = constant(0.0);
        return;
    }
    const bool cap = 1.25 * at[2].value * at[2].value > h2.value;
    const dual n = root(n2);
    const dual above = cap ? linear(n, 3.0, n, 0.0) : n2;
    const dual below = cap ? linear(n, 1.0, magnitude(at[2]), 1.0) : h2;
    const dual s = root(quotient(above, below));
    at[2] = cap ? signed_like(n, at[2]) : linear(at[2], 1.5, at[2], 0.0);
    at[0] = product(at[0], s);
    at[1] = product(at[1], s);
    const dual c2 = linear(product(at[0], at[0]), 1.0, product(at[1], at[1]), 1.0);
    if (c2.value < 1e-12) {
        at[0] = at[1] = constant(0.0);
        return;
    }
    const bool along_x = fabs(at[1].value) <= fabs(at[0].value);
    const dual large = along_x ? at[0] : at[1], small = along_x ? at[1] : at[0];
    const dual t = signed_like(root(c2), large), v = quotient(small, large);
    const double four_by_pi = 1.2732395447351628;
    const dual o =
        product(t, chain(v, four_by_pi * atan(v.value), four_by_pi / (1.0 + v.value * v.value)));
    at[0] = along_x ? t : o;
    at[1] = along_x ? o : t;
}

void ascc_place_in_cube_of(const ascc_filter *filter, const double r[3], ascc_place_in_cube *place)
{
    dual at[3];
    for (int c = 0; c < 3; c++) {
        at[c] = constant(r[c] / filter->radius);
        at[c].by[c] = 1.0 / filter->radius;
    }
    const dual square = linear(linear(product(at[0], at[0]), 1.0, product(at[1], at[1]), 1.0), 1.0,
                               product(at[2], at[2]), 1.0);
    dual window = constant(1.0);
    if (filter->window == ASCC_WINDOW_POLY6) {
        const double t = fmax(1.0 - square.value, 0.0);
        window = chain(square, t * t * t, -3.0 * t * t);
    } else if (filter->window == ASCC_WINDOW_PEAK) {
        const dual q = root(square);
        const double t = fmax(1.0 - q.value, 0.0);
        window = chain(q, t * t, -2.0 * t);
    }
    if (filter->mapping == ASCC_MAPPING_RADIAL)
        map_radial(at);
    else if (filter->mapping == ASCC_MAPPING_VOLUME)
        map_volume(at);
    place->window = window.value;
    for (int c = 0; c < 3; c++) {
        place->at[c] = at[c].value;
        place->window_slope[c] = window.by[c];
        memcpy(place->slope[c], at[c].by, sizeof at[c].by);
    }
}

void ascc_trilinear_at(const int32_t cells[3], const double at[3], ascc_trilinear *t)
{
    double share[3][2], slope[3];
    size_t low[3], step[3] = {1, (size_t)cells[0], (size_t)cells[0] * (size_t)cells[1]};
    for (int c = 0; c < 3; c++) {
        const double x = (at[c] * 0.5 + 0.5) * (cells[c] - 1);
        const double whole = floor(fmin(fmax(x, 0.0), cells[c] > 1 ? cells[c] - 2.0 : 0.0));
        const double fraction = fmin(fmax(x - whole, 0.0), 1.0);
        low[c] = (size_t)whole;
        share[c][0] = 1.0 - fraction;
        share[c][1] = fraction;
        slope[c] = x - whole > 0.0 && x - whole < 1.0 ? 0.5 * (cells[c] - 1) : 0.0;
        if (cells[c] == 1)
            step[c] = 0;
    }
    t->count = cells[2] > 1 ? 8 : 4;
    for (int n = 0; n < t->count; n++) {
        const int bit[3] = {n & 1, n >> 1 & 1, n >> 2};
        double weight = 1.0;
        t->cell[n] = 0;
        for (int c = 0; c < 3; c++) {
            weight *= share[c][bit[c]];
            t->cell[n] += (low[c] + (bit[c] && step[c] ? 1u : 0u)) *
                          (c == 0   ? 1
                           : c == 1 ? (size_t)cells[0]
                                    : (size_t)cells[0] * (size_t)cells[1]);
        }
        t->weight[n] = weight;
        for (int c = 0; c < 3; c++) {
            double by = bit[c] ? slope[c] : -slope[c];
            for (int k = 0; k < 3; k++)
                by *= k == c ? 1.0 : share[k][bit[k]];
            t->slope[n][c] = by;
        }
    }
}
