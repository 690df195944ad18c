/* A throw-away operation, "scale by a constant": all that docs/contributing.md asks of one.
 * SPDX-License-Identifier: MIT */
#include "network/reverse.h"

enum { FACTOR }; /* of term->option */

static void read_scale(ascc_reader *reader, uint32_t object, const ascc_plan *plan, ascc_term *term,
                       const char *name[ASCC_MAX_TENSORS])
{
    (void)plan;
    (void)name; /* it has no tensors */
    term->option[FACTOR] = ascc_reader_number(reader, object, "factor", -1e6, 1e6);
}

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
    const float *source = ascc_term_source(run, term), factor = (float)term->option[FACTOR];
    for (size_t r = 0, j; r < tile->n; r++)
        if (ascc_network_shared_row(run->hierarchy, tile->layer->set, set, tile->list[r], &j))
            for (size_t c = 0; c < (size_t)term->inputs; c++)
                tile->sum[r * tile->width + (size_t)term->column + c] +=
                    factor * source[j * ascc_padded(term->inputs) + c];
}

static void backward(const ascc_reverse *pass, const ascc_layer *layer, const ascc_term *term,
                     const uint32_t *list, size_t n)
{
    const ascc_network_run *run = pass->run;
    const int32_t set = ascc_network_set(run->network, term->source);
    const size_t a = ascc_padded(term->inputs);
    const float factor = (float)term->option[FACTOR];
    float *gradient = ascc_reverse_source(pass, term);
    for (size_t r = 0, j; gradient && r < n; r++)
        if (ascc_network_shared_row(run->hierarchy, layer->set, set, list[r], &j))
            for (size_t c = 0; c < a; c++)
                gradient[j * a + c] += factor * pass->tile[r * a + c];
}

const ascc_operation ascc_op_scale = {.name = "scale",
                                      .type = "scale",
                                      .read = read_scale,
                                      .check = check,
                                      .forward = forward,
                                      .backward = backward};
