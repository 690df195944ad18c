/* An output that is the correction itself: it conserves nothing, and tells walls nothing.
 * SPDX-License-Identifier: MIT */
#include "pair_reverse.h"
#include "pair_sum.h"

static ascc_status check(ascc_plan_builder *builder, const ascc_layer *layer,
                         ascc_term_entry *entry, const char *const name[ASCC_MAX_TENSORS])
{
    (void)builder;
    (void)layer;
    (void)entry;
    (void)name;
    return ASCC_OK;
}

static ascc_status impulses(const ascc_network_run *run, const ascc_impulse_scale *scale,
                            const ascc_impulses *to, uint64_t *pair_count)
{
    const ascc_hierarchy *h = run->hierarchy;
    const ascc_term *term = &run->plan->output.term;
    const int32_t set = ascc_network_set(run->network, term->source);
    const size_t d = (size_t)run->plan->dimension, a = ascc_padded(term->inputs);
    const float *value = ascc_term_source(run, term);
    *pair_count = 0;
    for (size_t i = 0; i < h->set[ASCC_SET_FLUID].count; i++) {
        if (ascc_hierarchy_is_idle(h, i))
            continue;
        const size_t from = set == ASCC_SET_FLUID ? i : h->whole[ASCC_SET_FLUID][i];
        const size_t row = ascc_hierarchy_host_row(h, set, from);
        for (size_t c = 0; c < d; c++) {
            const double impulse =
                (double)value[from * a + c] * scale->factor[c] * scale->mass[row];
            if (!ascc_round_quanta(&impulse, 1, &to->fluid[row * d + c]))
                return ascc_pair_sum_fail(run, set, from, value, a);
        }
    }
    return ASCC_OK;
}

static ascc_status backward(ascc_reverse *pass)
{
    const ascc_term *term = &pass->run->plan->output.term;
    const size_t a = ascc_padded(term->inputs), d = (size_t)pass->run->plan->dimension;
    float *gradient = ascc_reverse_source(pass, term);
    ascc_pair_reverse pairs;
    if (!ascc_pair_reverse_open(&pairs, pass))
        return ASCC_ERROR_MEMORY;
    for (size_t i = 0; i < pass->run->hierarchy->set[pairs.set].count; i++)
        for (size_t c = 0; gradient && pairs.fluid[i] && c < d; c++)
            gradient[i * a + c] += (float)pairs.force[i * 3 + c];
    return ASCC_OK;
}

const ascc_operation ascc_op_plain = {.name = "plain output",
                                      .type = "plain",
                                      .check = check,
                                      .impulses = impulses,
                                      .backward_output = backward};
