/* From edges to points: each point gets the sum over the edges that lead to it, in the order of its neighbours.
 * SPDX-License-Identifier: MIT */
#include "network.h"
#include "reverse.h"

#define FAIL(...) ascc_fail(builder->message, ASCC_ERROR_FORMAT, __VA_ARGS__)

static ascc_status check(ascc_plan_builder *builder, const ascc_layer *layer,
                         ascc_term_entry *entry, const char *const name[ASCC_MAX_TENSORS])
{
    (void)name;
    if (ascc_plan_value_set(builder->layer, entry->term.source) == ASCC_SET_EDGES &&
        layer->set == builder->plan.edge_set)
        return ASCC_OK;
    return FAIL("layer '%s': 'sum' goes from 'edges' to the points that they connect",
                ascc_quote(layer->name).text);
}

static void forward(const ascc_tile *tile, const ascc_term *term)
{
    const ascc_network_run *run = tile->run;
    const ascc_rows *rows = &run->rows[run->network->edge_key];
    const size_t a = ascc_padded(term->inputs);
    const float *source = ascc_term_source(run, term);
    for (size_t r = 0; r < tile->n; r++) {
        const uint32_t point = tile->list[r];
        const float *restrict from = source + run->edges.first[point] * a;
        float *restrict to = tile->sum + r * tile->width + term->column;
        for (size_t k = 0; k < rows->count[point]; k++, from += a)
            for (int32_t c = 0; c < term->inputs; c++)
                to[c] += from[c];
    }
}

static void backward(const ascc_reverse *pass, const ascc_layer *layer, const ascc_term *term,
                     const uint32_t *list, size_t n)
{
    (void)layer;
    const ascc_network_run *run = pass->run;
    const ascc_rows *rows = &run->rows[run->network->edge_key];
    const size_t a = ascc_padded(term->inputs);
    float *gradient = ascc_reverse_source(pass, term);
    for (size_t r = 0; gradient && r < n; r++) {
        float *to = gradient + run->edges.first[list[r]] * a;
        for (size_t k = 0; k < rows->count[list[r]]; k++, to += a)
            for (size_t c = 0; c < a; c++)
                to[c] += pass->tile[r * a + c];
    }
}

const ascc_operation ascc_op_sum = {.name = "sum over edges",
                                    .type = "sum",
                                    .check = check,
                                    .forward = forward,
                                    .backward = backward};
