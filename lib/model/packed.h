/* Weights as the kernels read them: packed once for a model, by its operations.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_PACKED_H
#define ASCC_PACKED_H

#include "plan.h"

typedef struct ascc_packed {
    int32_t term_count;
    float *block;
    size_t count;
    const float **term; /* [term_count + 1], last: the output; what lies there the operation says */
} ascc_packed;

/* errors: MEMORY. */
ascc_status ascc_packed_create(ascc_packed *packed, const ascc_allocator *allocator,
                               const ascc_plan *plan, ascc_message *message);
void ascc_packed_destroy(ascc_packed *packed, const ascc_allocator *allocator);

/* Once more, after the weights have changed. */
void ascc_packed_update(ascc_packed *packed, const ascc_plan *plan);

/* gradient, laid out as weights (of which the plan's tensors are parts), += that of a packed block. */
void ascc_packed_fold(const ascc_packed *packed, const ascc_plan *plan, const float *weights,
                      const float *block, float *gradient);

#endif
