/* Packs the tensors of all terms into one block, and gradients back. SPDX-License-Identifier: MIT */
#include "packed.h"

#include <string.h>

#include "operation.h"

static size_t size_of(const ascc_plan *plan, int32_t t)
{
    const ascc_term *term = ascc_plan_term(plan, t);
    return term->operation->packed_size ? term->operation->packed_size(plan, term) : 0;
}

ascc_status ascc_packed_create(ascc_packed *packed, const ascc_allocator *allocator,
                               const ascc_plan *plan, ascc_message *message)
{
    const size_t terms = (size_t)plan->term_count + 1;
    *packed = (ascc_packed){.term_count = plan->term_count};
    for (int32_t t = 0; t <= plan->term_count; t++)
        packed->count += size_of(plan, t);
    packed->block = ascc_allocate(allocator, packed->count, sizeof(float));
    packed->term = ascc_allocate(allocator, terms, sizeof *packed->term);
    if (!packed->block || !packed->term) {
        ascc_packed_destroy(packed, allocator);
        return ascc_fail(message, ASCC_ERROR_MEMORY, "no memory for %zu packed weights",
                         packed->count);
    }
    const float *at = packed->block;
    for (int32_t t = 0; t <= plan->term_count; t++) {
        packed->term[t] = at;
        at += size_of(plan, t);
    }
    ascc_packed_update(packed, plan);
    return ASCC_OK;
}

void ascc_packed_destroy(ascc_packed *packed, const ascc_allocator *allocator)
{
    if (packed->block)
        ascc_release(allocator, packed->block, packed->count, sizeof(float));
    if (packed->term)
        ascc_release(allocator, (void *)packed->term, (size_t)packed->term_count + 1,
                     sizeof *packed->term);
    packed->block = NULL;
    packed->term = NULL;
}

void ascc_packed_update(ascc_packed *packed, const ascc_plan *plan)
{
    float *to = packed->block;
    memset(to, 0, packed->count * sizeof *to);
    for (int32_t t = 0; t <= plan->term_count; t++) {
        const size_t size = size_of(plan, t);
        const ascc_term *term = ascc_plan_term(plan, t);
        if (size)
            term->operation->pack(plan, term, to);
        to += size;
    }
}

void ascc_packed_fold(const ascc_packed *packed, const ascc_plan *plan, const float *weights,
                      const float *block, float *gradient)
{
    for (int32_t t = 0; t <= plan->term_count; t++) {
        const ascc_term *term = ascc_plan_term(plan, t);
        float *part[ASCC_MAX_TENSORS];
        for (int i = 0; i < ASCC_MAX_TENSORS; i++)
            part[i] = term->tensor[i] ? gradient + (term->tensor[i] - weights) : NULL;
        if (size_of(plan, t))
            term->operation->unpack(plan, term, block + (packed->term[t] - packed->block), part);
    }
}
