/* An output that gives nothing: of a model that is a relaxation alone. SPDX-License-Identifier: MIT */
#include "pair_sum.h"

static void read_none(ascc_reader *reader, uint32_t object, const ascc_plan *plan, ascc_term *term,
                      const char *name[ASCC_MAX_TENSORS])
{
    (void)reader;
    (void)object;
    (void)plan;
    (void)term;
    (void)name;
}

static ascc_status check(ascc_plan_builder *builder, const ascc_layer *layer,
                         ascc_term_entry *entry, const char *const name[ASCC_MAX_TENSORS])
{
    (void)layer;
    (void)name;
    ascc_output *output = &builder->plan.output;
    output->conserves = output->central = output->current_direction = 1;
    entry->term.outputs = builder->plan.dimension;
    return ASCC_OK;
}

static ascc_status impulses(const ascc_network_run *run, const ascc_impulse_scale *scale,
                            const ascc_impulses *to, uint64_t *pair_count)
{
    (void)run;
    (void)scale;
    (void)to;
    *pair_count = 0;
    return ASCC_OK;
}

static ascc_status backward(struct ascc_reverse *pass)
{
    (void)pass;
    return ASCC_OK;
}

const ascc_operation ascc_op_none = {.name = "no output",
                                     .type = "none",
                                     .read = read_none,
                                     .check = check,
                                     .impulses = impulses,
                                     .backward_output = backward};
