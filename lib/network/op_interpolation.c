/* Interpolation between the nearest points of another set, each weighed by the inverse of its squared distance.
 * SPDX-License-Identifier: MIT
 *
 *     share(j) = w_j / sum over the nearest of w,     w = 1 / (|r|^2 / radius^2 + 1e-6)
 */
#include <math.h>
#include <stdio.h>

#include "column.h"
#include "model/cost.h"

/* A point at the query's very place has nearly all of the weight, not an infinite one. */
static const double SOFTENING = 1e-6;
#define MOST_NEAREST 64

static void read_interpolation(ascc_reader *reader, uint32_t object, const ascc_plan *plan,
                               ascc_term *term, const char *name[ASCC_MAX_TENSORS])
{
    (void)plan;
    name[ASCC_TENSOR_WEIGHT] = ascc_reader_optional_text(reader, object, "weight");
    if (name[ASCC_TENSOR_WEIGHT])
        name[ASCC_TENSOR_BIAS] = ascc_reader_optional_text(reader, object, "bias");
    term->filter = (ascc_filter){
        .cells = {1, 1, 1},
        .mapping = ASCC_MAPPING_DIRECTION,
        .window = ASCC_WINDOW_NONE,
        .neighbor_limit = ascc_reader_integer(reader, object, "nearest", 1, MOST_NEAREST),
        .radius = ascc_reader_number(reader, object, "radius", ASCC_PLAN_MIN, ASCC_PLAN_MAX)};
}

static void tensors(const ascc_plan *plan, ascc_term *term, const size_t *stored,
                    ascc_tensor_wanted wanted[ASCC_MAX_TENSORS])
{
    (void)plan;
    ascc_plan_want_matrix(term, stored, wanted);
}

static ascc_status check(ascc_plan_builder *builder, const ascc_layer *layer,
                         ascc_term_entry *entry, const char *const name[ASCC_MAX_TENSORS])
{
    (void)name;
    char where[64];
    if (ascc_plan_value_set(builder->layer, entry->term.source) == layer->set)
        return ascc_fail(builder->message, ASCC_ERROR_FORMAT,
                         "layer '%s': an interpolation goes from one point set to another",
                         ascc_quote(layer->name).text);
    snprintf(where, sizeof where, "layer '%.31s'", ascc_quote(layer->name).text);
    return ascc_plan_check_filter(builder, &entry->term.filter, where);
}

static double cost(const ascc_plan *plan, const ascc_cost_counts *counts, int32_t set,
                   const ascc_term *term)
{
    (void)plan;
    const bool weight = term->tensor[ASCC_TENSOR_WEIGHT] != NULL;
    return ascc_cost_points(counts, set) * term->inputs *
           (term->filter.neighbor_limit + (weight ? term->outputs : 0.0));
}

/* Distances become shares. */
static void find_shares(float *distance, size_t count)
{
    float sum = 0.0f;
    for (size_t k = 0; k < count; k++) {
        distance[k] = 1.0f / (distance[k] * distance[k] + (float)SOFTENING);
        sum += distance[k];
    }
    for (size_t k = 0; k < count; k++)
        distance[k] /= sum;
}

static void gather(const ascc_network_run *run, const ascc_term *term,
                   const ascc_neighborhood *around, float *column)
{
    float *share = around->geometry.pairs.distance;
    find_shares(share, around->count);
    run->tools->kernels->gather_basis(share, around->room, 1, 1, around->read, around->count,
                                      around->feature, ascc_padded(term->inputs), column);
}

/* ---- The way back ---- */

static void scatter(const ascc_reverse *pass, const ascc_term *term,
                    const ascc_neighborhood *around, const uint32_t *write,
                    const float *column_gradient, float *gradient)
{
    pass->run->tools->kernels->scatter(around->geometry.pairs.distance, around->room, 1, 1, write,
                                       around->count, column_gradient, ascc_padded(term->inputs),
                                       gradient);
}

static void places(const ascc_reverse *pass, const ascc_term *term, const ascc_neighborhood *around,
                   size_t row, const float *column_gradient)
{
    const ascc_rows *rows = ascc_term_list(pass->run, term, 0);
    const double inverse = 1.0 / (term->filter.radius * term->filter.radius);
    double sum = 0.0, mean = 0.0, r[3], g[3];
    pass->run->tools->kernels->dot(column_gradient, 1, around->read, around->count, around->feature,
                                   ascc_padded(term->inputs), pass->dot, around->room);
    for (int round = 0; round < 2; round++)
        for (size_t k = 0; k < around->count; k++) {
            ascc_seen_displacement(pass->run, rows, row, around->neighbor[k], r);
            const double q = (r[0] * r[0] + r[1] * r[1] + r[2] * r[2]) * inverse;
            const double weight = 1.0 / (q + SOFTENING);
            if (!round) {
                sum += weight;
                mean += (double)pass->dot[k] * (double)around->geometry.pairs.distance[k];
                continue;
            }
            const double by_weight = ((double)pass->dot[k] - mean) / sum;
            for (int c = 0; c < 3; c++)
                g[c] = -by_weight * weight * weight * 2.0 * r[c] * inverse;
            ascc_column_add_displacement(pass, term, row, around->neighbor[k], g);
        }
}

static const ascc_column_functions around = {gather, scatter, places};

const ascc_operation ascc_op_interpolation = {.name = "interpolation",
                                              .type = "interpolation",
                                              .read = read_interpolation,
                                              .tensors = tensors,
                                              .check = check,
                                              .lists = ascc_convolution_lists,
                                              ASCC_MATRIX_PACKING,
                                              .cost = cost,
                                              .scratch = ascc_column_scratch,
                                              .around = &around,
                                              .columns = ascc_column_gather,
                                              .forward = ascc_column_forward,
                                              .backward = ascc_column_backward};
