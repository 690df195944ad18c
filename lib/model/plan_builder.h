/* Collects the layers of a network and checks each against the tensors of its file; or without a file says
 * which tensors it wants. SPDX-License-Identifier: MIT
 *
 * A reader of a description fills `plan`'s own numbers, adds features, levels, layers, terms and the
 * output in this order, then finishes. What every term must obey is checked here, once, so that no
 * file gets past it; what only one operation asks for, the operation checks with the calls below.
 */
#ifndef ASCC_PLAN_BUILDER_H
#define ASCC_PLAN_BUILDER_H

#include "file/safetensors.h"
#include "plan.h"

/* A term while its tensors are numbers of the file's; -1 = none. */
typedef struct ascc_term_entry {
    ascc_term term;
    int32_t tensor[ASCC_MAX_TENSORS];
} ascc_term_entry;

/* What a tensor must be. */
typedef struct ascc_tensor_wanted {
    const char *dimensions; /* their names, for messages */
    int32_t rank;
    int32_t reserved;
    size_t shape[ASCC_SAFETENSORS_MAX_RANK]; /* 0 = nothing tells */
} ascc_tensor_wanted;

typedef struct ascc_plan_builder {
    ascc_allocator allocator;
    const ascc_safetensors *file; /* NULL: none yet, weights are zeros */
    ascc_message *message;
    ascc_plan plan; /* layer and term are NULL until finished */
    ascc_layer *layer;
    size_t layer_capacity;
    ascc_term_entry *term;
    size_t term_capacity;
    ascc_term_entry output;
    /* The file's tensors, or the wanted ones, whose names are the builder's. */
    ascc_tensor *tensor;
    size_t tensor_count, tensor_capacity;
    size_t *offset; /* of each tensor in the weights; SIZE_MAX = not used */
} ascc_plan_builder;

/* file: NULL to find out which tensors a description wants. */
ascc_status ascc_plan_open(const ascc_allocator *allocator, const ascc_safetensors *file,
                           ascc_plan_builder *builder, ascc_message *message);
void ascc_plan_close(ascc_plan_builder *builder);

/* Copies a file's text into an array of the plan. */
ascc_status ascc_plan_text(ascc_plan_builder *builder, const char *what, const char *text,
                           char *into, size_t capacity);

/* Counts channels of the features and checks dimension and the plan's own numbers. */
ascc_status ascc_plan_begin(ascc_plan_builder *builder);
ascc_status ascc_plan_add_layer(ascc_plan_builder *builder, const char *name, int32_t set,
                                int32_t channels);
/* A term of the layer added last: `inputs` are found here, `outputs` and `filter.cells` unless given. */
ascc_status ascc_plan_add_term(ascc_plan_builder *builder, const ascc_term *term,
                               const char *const name[ASCC_MAX_TENSORS]);
ascc_status ascc_plan_set_output(ascc_plan_builder *builder, const ascc_output *output,
                                 const char *const name[ASCC_MAX_TENSORS]);

/* Value of that name ("fluid", "boundary" or a layer's), -1 = none. */
int32_t ascc_plan_find_value(const ascc_plan_builder *builder, const char *name);

/* ---- What operations want and check with; errors: FORMAT, the message names layer or tensor ---- */

/* Numbers that the description leaves open (0) become those of the tensor as it is stored. */
void ascc_plan_take_outputs(ascc_term *term, size_t stored);
/* A bias [outputs]; and a weight [inputs][outputs] with it. */
void ascc_plan_want_bias(const ascc_term *term, ascc_tensor_wanted wanted[ASCC_MAX_TENSORS]);
void ascc_plan_want_matrix(ascc_term *term, const size_t *stored,
                           ascc_tensor_wanted wanted[ASCC_MAX_TENSORS]);
ascc_status ascc_plan_check_filter(ascc_plan_builder *builder, const ascc_filter *filter,
                                   const char *name);
/* Source and layer have rows in common. */
ascc_status ascc_plan_check_shared(ascc_plan_builder *builder, const ascc_layer *layer,
                                   const ascc_term *term);

/* Arranges the weights and hands out plan and weights, both to be released with
 * ascc_plan_release. */
ascc_status ascc_plan_finish(ascc_plan_builder *builder, ascc_plan *plan, float **weights,
                             size_t *weight_count);
void ascc_plan_release(const ascc_allocator *allocator, ascc_plan *plan, float *weights,
                       size_t weight_count);

/* Floats between the beginnings of tensors in the weights, for one of so many. */
static inline size_t ascc_plan_align(size_t count)
{
    return (count + 15) & ~(size_t)15;
}

#endif
