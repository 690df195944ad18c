/* The reverse pass through geometry: bumps, harmonics, hats, and the grids' maps and windows.
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "backward_parts.h"

/* ---- A grid's cube, in double precision with derivatives ---- */

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

/* Ball to cylinder, cylinder to cube (SEMANTICS section 2). */
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

/* ---- Columns of a grid ---- */

static float grid_window(const ascc_passing *p, const ascc_filter *filter, size_t k)
{
    return filter->window == ASCC_WINDOW_NONE ? 1.0f : p->scratch.geometry[3 * p->scratch.room + k];
}

void ascc_backward_scatter_grid(const ascc_passing *p, const ascc_term *term,
                                const uint32_t *neighbor, size_t count,
                                const float *column_gradient, float *gradient)
{
    const size_t a = ascc_padded(term->inputs), room = p->scratch.room;
    const float *geometry = p->scratch.geometry;
    for (size_t k = 0; k < count; k++) {
        const double at[3] = {(double)geometry[k], (double)geometry[room + k],
                              (double)geometry[2 * room + k]};
        ascc_trilinear t;
        ascc_trilinear_at(term->filter.cells, at, &t);
        float *to = gradient + neighbor[k] * a;
        const double window = (double)grid_window(p, &term->filter, k);
        for (int n = 0; n < t.count; n++) {
            const float w = (float)(t.weight[n] * window);
            const float *from = column_gradient + t.cell[n] * a;
            for (size_t c = 0; c < a; c++)
                to[c] += w * from[c];
        }
    }
}

/* ---- Positions ---- */

static void add_displacement(const ascc_passing *p, const ascc_term *term, size_t row, size_t j,
                             const double g[3])
{
    const double back[3] = {-g[0], -g[1], -g[2]};
    ascc_backward_place(p, ascc_network_set(p->run->network, term->source), j, g);
    ascc_backward_place(p, p->set, row, back);
}

/* Harmonics of a direction and their derivatives by its coordinates. */
static void harmonics_at(const double u[3], size_t harmonics, double by[9][3])
{
    const double root3 = 1.7320508075688772, x = u[0], y = u[1], z = u[2];
    memset(by, 0, 9 * sizeof *by);
    for (size_t h = 1; h < 4 && h < harmonics; h++)
        by[h][h - 1] = harmonics == 3 || harmonics == 5 ? (h < 3) : 1.0;
    if (harmonics == 5) {
        memset(by[3], 0, sizeof by[3]);
        by[3][0] = 2.0 * y;
        by[3][1] = 2.0 * x;
        by[4][0] = 2.0 * x;
        by[4][1] = -2.0 * y;
    }
    if (harmonics == 9) {
        by[4][0] = root3 * y;
        by[4][1] = root3 * x;
        by[5][1] = root3 * z;
        by[5][2] = root3 * y;
        by[6][2] = root3 * x;
        by[6][0] = root3 * z;
        by[7][0] = root3 * x;
        by[7][1] = -root3 * y;
        by[8][0] = -x;
        by[8][1] = -y;
        by[8][2] = 2.0 * z;
    }
}

/* The gradient of the displacement of one pair of a basis, from the gradients of its members. */
static void basis_pair(const ascc_passing *p, const ascc_filter *filter, size_t k,
                       const double r[3], double g[3])
{
    const size_t harmonics = (size_t)filter->cells[0], room = p->scratch.room;
    const double distance = sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2]);
    double by[9][3], by_rho = 0.0, by_u[3] = {0.0, 0.0, 0.0}, along = 0.0, u[3];
    g[0] = g[1] = g[2] = 0.0;
    if (distance == 0.0)
        return; /* the centre: bumps are flat there, and there is no direction */
    for (int c = 0; c < 3; c++)
        u[c] = r[c] / distance;
    harmonics_at(u, harmonics, by);
    for (size_t b = 0; b < (size_t)filter->bumps; b++) {
        const double t = filter->bumps * distance / filter->radius - (double)b, s = 1.0 - t * t;
        if (s <= 0.0)
            continue;
        const float *dot = p->dot + b * harmonics * room + k;
        const float *factor = p->scratch.factor + b * harmonics * room + k;
        const double bump = s * s, slope = -4.0 * t * s * filter->bumps;
        for (size_t h = 0; h < harmonics; h++) {
            const double e = (double)dot[h * room];
            by_rho += e * slope * ((double)factor[h * room] / bump);
            for (int c = 0; h > 0 && c < 3; c++)
                by_u[c] += e * bump * by[h][c];
        }
    }
    for (int c = 0; c < 3; c++)
        along += by_u[c] * u[c];
    for (int c = 0; c < 3; c++)
        g[c] = by_rho * u[c] / filter->radius + (by_u[c] - along * u[c]) / distance;
}

static void hat_pairs(const ascc_passing *p, const ascc_term *term, const ascc_rows *rows,
                      size_t row)
{
    const size_t count = rows->count[row], room = p->scratch.room;
    const uint32_t *neighbor = rows->neighbor + rows->start[row];
    const float *share = p->scratch.geometry + 3 * room;
    double sum = 0.0, mean = 0.0;
    for (int pass = 0; pass < 2; pass++) {
        if (pass && !term->normalize) {
            sum = 1.0;
            mean = 0.0;
        }
        for (size_t k = 0; k < count; k++) {
            double r[3], hat[3], slope[3], g[3];
            ascc_seen_displacement(p, rows, row, neighbor[k], r);
            for (int c = 0; c < 3; c++) {
                hat[c] = fmax(1.0 - fabs(r[c]) / term->voxel, 0.0);
                slope[c] = hat[c] > 0.0 ? (r[c] > 0.0   ? -1.0
                                           : r[c] < 0.0 ? 1.0
                                                        : 0.0) /
                                              term->voxel
                                        : 0.0;
            }
            if (!pass) {
                sum += hat[0] * hat[1] * hat[2];
                mean += (double)p->dot[k] * (double)share[k];
                continue;
            }
            const double e = ((double)p->dot[k] - mean) / sum;
            g[0] = e * slope[0] * hat[1] * hat[2];
            g[1] = e * hat[0] * slope[1] * hat[2];
            g[2] = e * hat[0] * hat[1] * slope[2];
            add_displacement(p, term, row, neighbor[k], g);
        }
    }
}

static void grid_pairs(const ascc_passing *p, const ascc_term *term, const ascc_rows *rows,
                       size_t row, const float *feature, const uint32_t *read,
                       const float *column_gradient)
{
    const size_t a = ascc_padded(term->inputs);
    const uint32_t *neighbor = rows->neighbor + rows->start[row];
    for (size_t k = 0; k < rows->count[row]; k++) {
        double r[3], g[3] = {0.0, 0.0, 0.0};
        ascc_place_in_cube at;
        ascc_trilinear t;
        ascc_seen_displacement(p, rows, row, neighbor[k], r);
        ascc_place_in_cube_of(&term->filter, r, &at);
        ascc_trilinear_at(term->filter.cells, at.at, &t);
        const float *f = feature + read[k] * a;
        for (int n = 0; n < t.count; n++) {
            double e = 0.0;
            for (size_t c = 0; c < a; c++)
                e += (double)column_gradient[t.cell[n] * a + c] * (double)f[c];
            for (int c = 0; c < 3; c++) {
                g[c] += e * t.weight[n] * at.window_slope[c];
                for (int i = 0; i < 3; i++)
                    g[c] += e * at.window * t.slope[n][i] * at.slope[i][c];
            }
        }
        add_displacement(p, term, row, neighbor[k], g);
    }
}

void ascc_backward_geometry(const ascc_passing *p, const ascc_term *term, const ascc_rows *rows,
                            size_t row, const float *column_gradient)
{
    const size_t a = ascc_padded(term->inputs), count = rows->count[row], room = p->scratch.room;
    const uint32_t *neighbor = rows->neighbor + rows->start[row];
    const float *feature = term->relative ? p->scratch.relative : ascc_network_source(p->run, term);
    const uint32_t *read = term->relative ? p->scratch.sequence : neighbor;
    if (term->kind == ASCC_TERM_TRANSFER) {
        p->run->tools->kernels->dot(column_gradient, 1, read, count, feature, a, p->dot, room);
        hat_pairs(p, term, rows, row);
        return;
    }
    if (!term->filter.bumps) {
        grid_pairs(p, term, rows, row, feature, read, column_gradient);
        return;
    }
    p->run->tools->kernels->dot(column_gradient, ascc_cell_count(&term->filter), read, count,
                                feature, a, p->dot, room);
    for (size_t k = 0; k < count; k++) {
        double r[3], g[3];
        ascc_seen_displacement(p, rows, row, neighbor[k], r);
        basis_pair(p, &term->filter, k, r, g);
        add_displacement(p, term, row, neighbor[k], g);
    }
}
