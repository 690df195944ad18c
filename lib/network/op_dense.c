/* A dense layer on each row, from a row that the source's set shares with the layer's.
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "matrix.h"
#include "model/cost.h"

static void read_dense(ascc_reader *reader, uint32_t object, const ascc_plan *plan, ascc_term *term,
                       const char *name[ASCC_MAX_TENSORS])
{
    (void)plan;
    (void)term;
    name[ASCC_TENSOR_WEIGHT] = ascc_reader_text(reader, object, "weight");
    name[ASCC_TENSOR_BIAS] = ascc_reader_optional_text(reader, object, "bias");
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
    entry->term.filter = (ascc_filter){.cells = {1, 1, 1}};
    return ascc_plan_check_shared(builder, layer, &entry->term);
}

static double cost(const ascc_plan *plan, const ascc_cost_counts *counts, int32_t set,
                   const ascc_term *term)
{
    const double own = ascc_cost_points(counts, set);
    const double from = ascc_cost_points(counts, ascc_plan_value_set(plan->layer, term->source));
    return fmin(own, from) * term->inputs * term->outputs;
}

static void scratch(const ascc_plan *plan, const ascc_term *term, ascc_scratch_sizes *sizes)
{
    (void)plan;
    sizes->column = ascc_max_size(sizes->column, ascc_padded(term->inputs));
}

static size_t columns(const ascc_tile *tile, const ascc_term *term)
{
    const ascc_network_run *run = tile->run;
    const int32_t set = ascc_network_set(run->network, term->source);
    const size_t a = ascc_padded(term->inputs);
    const float *source = ascc_term_source(run, term);
    size_t count = 0;
    for (size_t r = 0, j; r < tile->n; r++)
        if (ascc_network_shared_row(run->hierarchy, tile->layer->set, set, tile->list[r], &j))
            memcpy(tile->column + count++ * (a + ASCC_COLUMN_PADDING), source + j * a,
                   a * sizeof(float));
    return count;
}

static bool all_zero(const float from[8])
{
    uint64_t bits[4];
    memcpy(bits, from, sizeof bits);
    return !(bits[0] | bits[1] | bits[2] | bits[3]);
}

/* Inputs up to the last that is not 0 in all n rows: away from walls half of all moments are. */
static size_t used_inputs(const float *in, size_t stride, size_t n, size_t a)
{
    size_t used = 8;
    for (size_t r = 0; r < n && used < a; r++) {
        size_t end = a;
        while (end > used && all_zero(in + r * stride + end - 8))
            end -= 8;
        used = end;
    }
    return used;
}

/* n rows of the tile from r on, whose inputs follow one another. */
static void multiply_rows(const ascc_tile *tile, const ascc_term *term, size_t r, size_t n,
                          const float *in, size_t stride)
{
    float *to = tile->sum + r * tile->width + term->column;
    for (size_t i = 0; i < n; i++)
        ascc_matrix_add_bias(tile->run, term, to + i * tile->width);
    tile->run->tools->kernels->multiply(
        in, stride, n, used_inputs(in, stride, n, ascc_padded(term->inputs)),
        ascc_term_packed(tile->run, term), ascc_padded(term->outputs), to, tile->width);
}

static void forward(const ascc_tile *tile, const ascc_term *term)
{
    const ascc_network_run *run = tile->run;
    const int32_t set = ascc_network_set(run->network, term->source);
    const size_t a = ascc_padded(term->inputs);
    const float *source = ascc_term_source(run, term);
    if (tile->given) {
        multiply_rows(tile, term, 0, tile->n, tile->given, tile->given_width);
        return;
    }
    for (size_t r = 0, n, j, next; r < tile->n; r += n) {
        n = 1;
        if (!ascc_network_shared_row(run->hierarchy, tile->layer->set, set, tile->list[r], &j))
            continue;
        while (r + n < tile->n &&
               ascc_network_shared_row(run->hierarchy, tile->layer->set, set, tile->list[r + n],
                                       &next) &&
               next == j + n)
            n++;
        multiply_rows(tile, term, r, n, source + j * a, a);
    }
}

static void backward(const ascc_reverse *pass, const ascc_layer *layer, const ascc_term *term,
                     const uint32_t *list, size_t n)
{
    const ascc_network_run *run = pass->run;
    const int32_t set = ascc_network_set(run->network, term->source);
    const size_t a = ascc_padded(term->inputs), b = ascc_padded(term->outputs);
    const float *source = ascc_term_source(run, term);
    float *gradient = ascc_reverse_source(pass, term);
    if (gradient)
        ascc_matrix_back(pass, term, n);
    for (size_t r = 0, j; r < n; r++) {
        if (ascc_network_shared_row(run->hierarchy, layer->set, set, list[r], &j)) {
            for (size_t c = 0; gradient && c < a; c++)
                gradient[j * a + c] += pass->column_gradient[r * a + c];
            memcpy(pass->column, source + j * a, a * sizeof(float));
        } else { /* this row has no such term */
            memset(pass->tile + r * b, 0, b * sizeof(float));
            memset(pass->column, 0, a * sizeof(float));
        }
        ascc_matrix_keep_column(pass, term, r);
    }
    ascc_matrix_back_weights(pass, term, n);
}

const ascc_operation ascc_op_dense = {.name = "dense",
                                      .type = "dense",
                                      .read = read_dense,
                                      .tensors = tensors,
                                      .check = check,
                                      ASCC_MATRIX_PACKING,
                                      .cost = cost,
                                      .scratch = scratch,
                                      .reads_tiles = true,
                                      .columns = columns,
                                      .forward = forward,
                                      .backward = backward};
