/* Layer normalisation: each row less its mean, over its standard deviation, times a scale and plus an offset of
 * each channel. SPDX-License-Identifier: MIT
 *
 * Packed: scale [padded inputs], offset [padded inputs]. Sums are 8 by channel mod 8, then those in pairs.
 */
#include <math.h>
#include <string.h>

#include "model/cost.h"
#include "model/initial.h"
#include "network.h"
#include "reverse.h"

enum { TENSOR_SCALE = 0, TENSOR_OFFSET = 1 };
#define PARTS 8
#define LEAST_VARIANCE 1e-5f /* added to variances */

static void read_normalize(ascc_reader *reader, uint32_t object, const ascc_plan *plan,
                           ascc_term *term, const char *name[ASCC_MAX_TENSORS])
{
    (void)plan;
    (void)term;
    name[TENSOR_SCALE] = ascc_reader_text(reader, object, "scale");
    name[TENSOR_OFFSET] = ascc_reader_text(reader, object, "offset");
}

static void tensors(const ascc_plan *plan, ascc_term *term, const size_t *stored,
                    ascc_tensor_wanted wanted[ASCC_MAX_TENSORS])
{
    (void)plan;
    (void)stored;
    term->outputs = term->inputs;
    ascc_plan_want_bias(term, wanted);
    wanted[TENSOR_SCALE] = wanted[TENSOR_OFFSET];
}

static ascc_status check(ascc_plan_builder *builder, const ascc_layer *layer,
                         ascc_term_entry *entry, const char *const name[ASCC_MAX_TENSORS])
{
    (void)name;
    return ascc_plan_check_shared(builder, layer, &entry->term);
}

static void fill_initial(ascc_initial *initial)
{
    for (size_t i = 0; i < initial->count; i++)
        initial->value[i] = initial->number == TENSOR_SCALE ? 1.0f : 0.0f;
}

static size_t packed_size(const ascc_plan *plan, const ascc_term *term)
{
    (void)plan;
    return 2 * ascc_padded(term->inputs);
}

static void pack(const ascc_plan *plan, const ascc_term *term, float *packed)
{
    (void)plan;
    const size_t count = (size_t)term->inputs, a = ascc_padded(term->inputs);
    memcpy(packed, term->tensor[TENSOR_SCALE], count * sizeof *packed);
    memcpy(packed + a, term->tensor[TENSOR_OFFSET], count * sizeof *packed);
}

static void unpack(const ascc_plan *plan, const ascc_term *term, const float *packed,
                   float *const gradient[ASCC_MAX_TENSORS])
{
    (void)plan;
    const size_t a = ascc_padded(term->inputs);
    for (int32_t c = 0; c < term->inputs; c++) {
        gradient[TENSOR_SCALE][c] += packed[c];
        gradient[TENSOR_OFFSET][c] += packed[a + (size_t)c];
    }
}

/* A row takes some three passes over its numbers. */
static double cost(const ascc_plan *plan, const ascc_cost_counts *counts, int32_t set,
                   const ascc_term *term)
{
    (void)plan;
    return 3.0 * term->inputs * ascc_cost_points(counts, set);
}

static float total(const float sum[PARTS])
{
    return ((sum[0] + sum[4]) + (sum[2] + sum[6])) + ((sum[1] + sum[5]) + (sum[3] + sum[7]));
}

/* x[count], filled up with zeros, becomes y: less its mean, over its deviation; returns 1 / the latter. */
static float standardize(const float *restrict x, size_t count, size_t padded, float *restrict y)
{
    float sum[PARTS] = {0.0f}, square[PARTS] = {0.0f};
    for (size_t c = 0; c < padded; c += PARTS)
        for (size_t n = 0; n < PARTS; n++)
            sum[n] += x[c + n];
    const float mean = total(sum) / (float)count;
    for (size_t c = 0; c < padded; c += PARTS)
        for (size_t n = 0; n < PARTS; n++)
            y[c + n] = x[c + n] - mean;
    for (size_t c = count; c < padded; c++)
        y[c] = 0.0f;
    for (size_t c = 0; c < padded; c += PARTS)
        for (size_t n = 0; n < PARTS; n++)
            square[n] += y[c + n] * y[c + n];
    const float inverse = 1.0f / sqrtf(total(square) / (float)count + LEAST_VARIANCE);
    for (size_t c = 0; c < padded; c++)
        y[c] *= inverse;
    return inverse;
}

static void forward(const ascc_tile *tile, const ascc_term *term)
{
    const ascc_network_run *run = tile->run;
    const int32_t set = ascc_network_set(run->network, term->source);
    const size_t count = (size_t)term->inputs, a = ascc_padded(term->inputs);
    const float *restrict scale = ascc_term_packed(run, term), *restrict offset = scale + a;
    for (size_t r = 0, j; r < tile->n; r++) {
        float y[ASCC_MAX_CHANNELS];
        float *restrict to = tile->sum + r * tile->width + term->column;
        if (tile->given)
            standardize(tile->given + r * tile->given_width, count, a, y);
        else if (ascc_network_shared_row(run->hierarchy, tile->layer->set, set, tile->list[r], &j))
            standardize(ascc_term_source(run, term) + j * a, count, a, y);
        else
            continue;
        for (size_t c = 0; c < count; c++)
            to[c] += y[c] * scale[c] + offset[c];
    }
}

static void back_row(const ascc_reverse *pass, const ascc_term *term, const float *x,
                     const float *g, float *gradient)
{
    const size_t count = (size_t)term->inputs, a = ascc_padded(term->inputs);
    const float *scale = ascc_term_packed(pass->run, term);
    float *by_scale = ascc_reverse_packed(pass, term), *by_offset = by_scale + a;
    float y[ASCC_MAX_CHANNELS], by_y[ASCC_MAX_CHANNELS], sum[PARTS] = {0.0f}, dot[PARTS] = {0.0f};
    const float inverse = standardize(x, count, a, y);
    for (size_t c = 0; c < a; c += PARTS)
        for (size_t n = 0; n < PARTS; n++) {
            by_scale[c + n] += g[c + n] * y[c + n];
            by_offset[c + n] += g[c + n];
            by_y[c + n] = g[c + n] * scale[c + n];
            sum[n] += by_y[c + n];
            dot[n] += by_y[c + n] * y[c + n];
        }
    const float mean = total(sum) / (float)count, along = total(dot) / (float)count;
    for (size_t c = 0; gradient && c < count; c++)
        gradient[c] += inverse * (by_y[c] - mean - y[c] * along);
}

static void backward(const ascc_reverse *pass, const ascc_layer *layer, const ascc_term *term,
                     const uint32_t *list, size_t n)
{
    const ascc_network_run *run = pass->run;
    const int32_t set = ascc_network_set(run->network, term->source);
    const size_t a = ascc_padded(term->inputs);
    const float *source = ascc_term_source(run, term);
    float *gradient = ascc_reverse_source(pass, term);
    for (size_t r = 0, j; r < n; r++)
        if (ascc_network_shared_row(run->hierarchy, layer->set, set, list[r], &j))
            back_row(pass, term, source + j * a, pass->tile + r * a,
                     gradient ? gradient + j * a : NULL);
}

const ascc_operation ascc_op_normalize = {.name = "layer normalisation",
                                          .type = "normalize",
                                          .read = read_normalize,
                                          .tensors = tensors,
                                          .check = check,
                                          .initial = fill_initial,
                                          .packed_size = packed_size,
                                          .pack = pack,
                                          .unpack = unpack,
                                          .cost = cost,
                                          .reads_tiles = true,
                                          .forward = forward,
                                          .backward = backward};
