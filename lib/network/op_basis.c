/* A continuous convolution in a small basis: a radial basis times harmonics of the direction
 * (docs/file-format.md). SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "column.h"
#include "model/filter.h"
#include "model/initial.h"

static void read_basis(ascc_reader *reader, uint32_t object, const ascc_plan *plan, ascc_term *term,
                       const char *name[ASCC_MAX_TENSORS])
{
    ascc_filter_read_basis(reader, object, plan->dimension, &term->filter, false);
    ascc_convolution_read(reader, object, term, name);
}

static void tensors(const ascc_plan *plan, ascc_term *term, const size_t *stored,
                    ascc_tensor_wanted wanted[ASCC_MAX_TENSORS])
{
    (void)plan;
    const ascc_filter *f = &term->filter;
    ascc_plan_take_outputs(term, stored[3]);
    wanted[ASCC_TENSOR_WEIGHT] =
        (ascc_tensor_wanted){.dimensions = "bumps, harmonics, inputs, outputs",
                             .rank = 4,
                             .shape = {(size_t)f->cells[1], (size_t)f->cells[0],
                                       (size_t)term->inputs, (size_t)term->outputs}};
    ascc_plan_want_bias(term, wanted);
}

/* ---- Initial values ---- */

static double bump(const ascc_filter *filter, int32_t k, double rho)
{
    const double t = filter->bumps * rho - k;
    return t > -1.0 && t < 1.0 ? (1.0 - t * t) * (1.0 - t * t) : 0.0;
}

/* What a member of the basis sums to, over neighbours of values about 1. */
static double member_size(const ascc_initial *initial, int32_t k, int32_t harmonic)
{
    const double sum = ascc_initial_sum(initial, bump, k, 1);
    if (harmonic == 0)
        return sum + (ascc_initial_sees_itself(initial) && k == 0 ? 1.0 : 0.0);
    if (ascc_initial_source(initial) == ASCC_SET_BOUNDARY)
        return 0.5 * sum; /* walls lie on one side */
    return sqrt(ascc_initial_sum(initial, bump, k, 2) / initial->plan->dimension);
}

/* Each member alike, and what comes from another scale half of it: it stands beside the scale's own. */
static void fill_initial(ascc_initial *initial)
{
    const ascc_term *term = initial->term;
    const int32_t harmonics = term->filter.cells[0], set = ascc_initial_source(initial);
    const size_t cells = ascc_cell_count(&term->filter);
    const size_t values = (size_t)term->inputs * (size_t)term->outputs;
    const bool crosses = set != initial->layer->set && set != ASCC_SET_BOUNDARY &&
                         (set >= ASCC_SET_LEVEL || initial->layer->set >= ASCC_SET_LEVEL);
    const double share = (crosses ? 0.5 : 1.0) / sqrt((double)cells * term->inputs);
    if (initial->number != ASCC_TENSOR_WEIGHT) {
        ascc_initial_default(initial);
        return;
    }
    for (size_t c = 0; c < cells; c++) {
        const double size = member_size(initial, (int32_t)c / harmonics, (int32_t)c % harmonics);
        ascc_initial_fill(initial, c * values, values, share / fmax(size, 1.0));
    }
}

/* ---- Cost, and the way forwards ---- */

/* Two radial functions reach a neighbour, beyond the last one's centre one. */
static double cost(const ascc_plan *plan, const ascc_cost_counts *counts, int32_t set,
                   const ascc_term *term)
{
    const ascc_filter *f = &term->filter;
    const double second = f->bumps > 1 ? pow(1.0 - 1.0 / f->bumps, plan->dimension) : 0.0;
    return ascc_convolution_cost(plan, counts, set, term, f->cells[0] * (1.0 + second));
}

static void gather(const ascc_network_run *run, const ascc_term *term,
                   const ascc_neighborhood *around, float *column)
{
    const ascc_kernels *kernels = run->tools->kernels;
    const size_t harmonics = (size_t)term->filter.cells[0], bumps = (size_t)term->filter.bumps;
    kernels->basis(&around->geometry.pairs, around->count, bumps, harmonics, around->factor,
                   around->room);
    kernels->gather_basis(around->factor, around->room, bumps, harmonics, around->read,
                          around->count, around->feature, ascc_padded(term->inputs), column);
}

/* ---- The way back ---- */

static void scatter(const ascc_reverse *pass, const ascc_term *term,
                    const ascc_neighborhood *around, const uint32_t *write,
                    const float *column_gradient, float *gradient)
{
    pass->run->tools->kernels->scatter(around->factor, around->room, (size_t)term->filter.bumps,
                                       (size_t)term->filter.cells[0], write, around->count,
                                       column_gradient, ascc_padded(term->inputs), gradient);
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
static void place_pair(const ascc_reverse *pass, const ascc_filter *filter,
                       const ascc_neighborhood *around, size_t k, const double r[3], double g[3])
{
    const size_t harmonics = (size_t)filter->cells[0], room = around->room;
    const double distance = sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2]);
    double by[9][3], by_rho = 0.0, by_u[3] = {0.0, 0.0, 0.0}, along = 0.0, u[3];
    g[0] = g[1] = g[2] = 0.0;
    if (distance == 0.0)
        return; /* the centre: radial functions are flat there, and there is no direction */
    for (int c = 0; c < 3; c++)
        u[c] = r[c] / distance;
    harmonics_at(u, harmonics, by);
    for (size_t b = 0; b < (size_t)filter->bumps; b++) {
        const double t = filter->bumps * distance / filter->radius - (double)b, s = 1.0 - t * t;
        if (s <= 0.0)
            continue;
        const float *dot = pass->dot + b * harmonics * room + k;
        const float *factor = around->factor + b * harmonics * room + k;
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

static void places(const ascc_reverse *pass, const ascc_term *term, const ascc_neighborhood *around,
                   size_t row, const float *column_gradient)
{
    const ascc_rows *rows = ascc_term_list(pass->run, term, 0);
    pass->run->tools->kernels->dot(column_gradient, ascc_cell_count(&term->filter), around->read,
                                   around->count, around->feature, ascc_padded(term->inputs),
                                   pass->dot, around->room);
    for (size_t k = 0; k < around->count; k++) {
        double r[3], g[3];
        ascc_seen_displacement(pass->run, rows, row, around->neighbor[k], r);
        place_pair(pass, &term->filter, around, k, r, g);
        ascc_column_add_displacement(pass, term, row, around->neighbor[k], g);
    }
}

static const ascc_column_functions around = {gather, scatter, places};

const ascc_operation ascc_op_basis = {.name = "convolution in a basis",
                                      .type = "convolution",
                                      .with = "basis",
                                      .read = read_basis,
                                      .tensors = tensors,
                                      .check = ascc_convolution_check,
                                      .initial = fill_initial,
                                      .lists = ascc_convolution_lists,
                                      ASCC_MATRIX_PACKING,
                                      .cost = cost,
                                      .scratch = ascc_column_scratch,
                                      .reads_features = ascc_convolution_reads_features,
                                      .around = &around,
                                      .columns = ascc_column_gather,
                                      .forward = ascc_column_forward,
                                      .backward = ascc_column_backward};
