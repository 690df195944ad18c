/* A residual: adds the source as it is, from rows that its set shares with the layer's.
 * SPDX-License-Identifier: MIT */
#include "network.h"
#include "reverse.h"

static ascc_status check(ascc_plan_builder *builder, const ascc_layer *layer,
                         ascc_term_entry *entry, const char *const name[ASCC_MAX_TENSORS])
{
    (void)name;
    return ascc_plan_check_shared(builder, layer, &entry->term);
}

static void forward(const ascc_tile *tile, const ascc_term *term)
{
    const ascc_network_run *run = tile->run;
    const int32_t set = ascc_network_set(run->network, term->source);
    const size_t a = ascc_padded(term->inputs);
    const float *source = ascc_term_source(run, term);
    for (size_t r = 0, j; r < tile->n; r++) {
        if (!ascc_network_shared_row(run->hierarchy, tile->layer->set, set, tile->list[r], &j))
            continue;
        float *row = tile->sum + r * tile->width + term->column;
        for (int32_t c = 0; c < term->inputs; c++)
            row[c] += source[j * a + (size_t)c];
    }
}

static void backward(const ascc_reverse *pass, const ascc_layer *layer, const ascc_term *term,
                     const uint32_t *list, size_t n)
{
    const ascc_network_run *run = pass->run;
    const int32_t set = ascc_network_set(run->network, term->source);
    const size_t a = ascc_padded(term->inputs);
    float *gradient = ascc_reverse_source(pass, term);
    for (size_t r = 0, j; gradient && r < n; r++)
        if (ascc_network_shared_row(run->hierarchy, layer->set, set, list[r], &j))
            for (size_t c = 0; c < a; c++)
                gradient[j * a + c] += pass->tile[r * a + c];
}

const ascc_operation ascc_op_identity = {.name = "identity",
                                         .type = "identity",
                                         .check = check,
                                         .forward = forward,
                                         .backward = backward};
