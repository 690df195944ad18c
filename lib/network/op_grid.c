/* A continuous convolution with its kernel on a grid (paper Eq. 1). SPDX-License-Identifier: MIT */
#include <math.h>

#include "column.h"
#include "cube.h"
#include "model/filter.h"
#include "model/initial.h"

static void read_grid(ascc_reader *reader, uint32_t object, const ascc_plan *plan, ascc_term *term,
                      const char *name[ASCC_MAX_TENSORS])
{
    (void)plan;
    ascc_filter_read_grid(reader, object, &term->filter);
    ascc_convolution_read(reader, object, term, name);
}

static void tensors(const ascc_plan *plan, ascc_term *term, const size_t *stored,
                    ascc_tensor_wanted wanted[ASCC_MAX_TENSORS])
{
    (void)plan;
    ascc_filter_want_grid(term, -1, stored, &wanted[ASCC_TENSOR_WEIGHT]);
    ascc_plan_want_bias(term, wanted);
}

/* ---- Initial values ---- */

static double window(const ascc_filter *filter, int32_t k, double rho)
{
    (void)k;
    const double q = 1.0 - rho * rho;
    return filter->window == ASCC_WINDOW_POLY6  ? q * q * q
           : filter->window == ASCC_WINDOW_PEAK ? (1.0 - rho) * (1.0 - rho)
                                                : 1.0;
}

/* Convolutions of the layer that add to the term's columns, itself one. */
static int32_t convolutions_beside(const ascc_initial *initial)
{
    int32_t count = 0;
    for (int32_t i = 0; i < initial->layer->term_count; i++) {
        const ascc_term *a = initial->term;
        const ascc_term *b = &initial->plan->term[initial->layer->first_term + i];
        count += b->operation == a->operation && b->column < a->column + a->outputs &&
                 a->column < b->column + b->outputs;
    }
    return count;
}

/* Values spread over the cells; a column holds what the window sums to. */
static void fill_initial(ascc_initial *initial)
{
    const ascc_term *term = initial->term;
    const double cells = (double)ascc_cell_count(&term->filter);
    const double seen =
        (ascc_initial_sees_itself(initial) ? 1.0 : 0.0) + ascc_initial_sum(initial, window, 0, 1);
    if (initial->number == ASCC_TENSOR_WEIGHT)
        ascc_initial_fill(initial, 0, initial->count,
                          sqrt(cells / ((double)term->inputs * convolutions_beside(initial))) /
                              fmax(seen, 1.0));
    else
        ascc_initial_default(initial);
}

/* ---- Cost, and the way forwards ---- */

static double cost(const ascc_plan *plan, const ascc_cost_counts *counts, int32_t set,
                   const ascc_term *term)
{
    return ascc_convolution_cost(plan, counts, set, term, plan->dimension == 2 ? 4.0 : 8.0);
}

static void gather(const ascc_network_run *run, const ascc_term *term,
                   const ascc_neighborhood *around, float *column)
{
    run->tools->kernels->gather(&around->geometry.pairs, around->geometry.window, around->read,
                                around->count, around->feature, ascc_padded(term->inputs),
                                term->filter.cells, column);
}

/* ---- The way back ---- */

static void scatter(const ascc_reverse *pass, const ascc_term *term,
                    const ascc_neighborhood *around, const uint32_t *write,
                    const float *column_gradient, float *gradient)
{
    (void)pass;
    const size_t a = ascc_padded(term->inputs);
    const ascc_pairs *pairs = &around->geometry.pairs;
    for (size_t k = 0; k < around->count; k++) {
        const double at[3] = {(double)pairs->x[k], (double)pairs->y[k], (double)pairs->z[k]};
        const double window = around->geometry.window ? (double)around->geometry.window[k] : 1.0;
        ascc_trilinear t;
        ascc_trilinear_at(term->filter.cells, at, &t);
        float *to = gradient + write[k] * a;
        for (int n = 0; n < t.count; n++) {
            const float w = (float)(t.weight[n] * window);
            const float *from = column_gradient + t.cell[n] * a;
            for (size_t c = 0; c < a; c++)
                to[c] += w * from[c];
        }
    }
}

static void places(const ascc_reverse *pass, const ascc_term *term, const ascc_neighborhood *around,
                   size_t row, const float *column_gradient)
{
    const size_t a = ascc_padded(term->inputs);
    const ascc_rows *rows = ascc_term_list(pass->run, term, 0);
    for (size_t k = 0; k < around->count; k++) {
        double r[3], g[3] = {0.0, 0.0, 0.0};
        ascc_place_in_cube at;
        ascc_trilinear t;
        ascc_seen_displacement(pass->run, rows, row, around->neighbor[k], r);
        ascc_place_in_cube_of(&term->filter, r, &at);
        ascc_trilinear_at(term->filter.cells, at.at, &t);
        const float *f = around->feature + around->read[k] * a;
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
        ascc_column_add_displacement(pass, term, row, around->neighbor[k], g);
    }
}

static const ascc_column_functions around = {gather, scatter, places};

const ascc_operation ascc_op_grid = {.name = "convolution on a grid",
                                     .type = "convolution",
                                     .read = read_grid,
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
