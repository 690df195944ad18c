/* Collects the layers of a network and checks each against the tensors of its file.
 * SPDX-License-Identifier: MIT
 *
 * A reader of a description fills `plan`'s own numbers, adds features, levels, layers, terms and the
 * output in this order, then finishes. Everything the solver relies on is checked here, once, so
 * that no file gets past it, whatever its format.
 */
#ifndef ASCC_PLAN_H
#define ASCC_PLAN_H

#include "model.h"
#include "file/safetensors.h"

#define ASCC_MAX_LAYERS 256
#define ASCC_MAX_TERMS 2048
#define ASCC_PLAN_MIN 1e-15 /* smallest and largest length, time or density a file may state */
#define ASCC_PLAN_MAX 1e15

typedef struct ascc_plan_term {
    ascc_term term;
    int32_t weight, bias; /* tensors, -1 = none */
} ascc_plan_term;

/* How the antisymmetric kernel is stored. */
enum { ASCC_HALF_X = 0, ASCC_HALF_Y = 1, ASCC_HALF_Z = 2, ASCC_FULL = 3 };

typedef struct ascc_plan_builder {
    ascc_allocator allocator;
    const ascc_safetensors *file;
    ascc_message *message;
    ascc_plan plan; /* layer and term are NULL until finished */
    ascc_layer *layer;
    size_t layer_capacity;
    ascc_plan_term *term;
    size_t term_capacity;
    int32_t output_tensor, output_storage;
    int32_t damping_tensor, wall_tensor, wall_damping_tensor; /* -1 = none */
    size_t *offset; /* of each tensor in the weights; SIZE_MAX = not used */
} ascc_plan_builder;

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
/* A term of the layer added last. `inputs`, `outputs` and `filter.cells` are found here; NULL names
 * = no tensor. */
ascc_status ascc_plan_add_term(ascc_plan_builder *builder, const ascc_term *term,
                               const char *weight, const char *bias);
/* Tensors of an output; NULL = none. */
typedef struct ascc_output_names {
    const char *weight, *damping, *wall_weight, *wall_damping;
} ascc_output_names;
/* `inputs`, `filter.cells` are found here; no weight for a plain output. */
ascc_status ascc_plan_set_output(ascc_plan_builder *builder, const ascc_output *output,
                                 const ascc_output_names *names, int32_t storage);

/* Value of that name ("fluid", "boundary" or a layer's), -1 = none; its set and channels. */
int32_t ascc_plan_find_value(const ascc_plan_builder *builder, const char *name);
int32_t ascc_plan_value_set(const ascc_layer *layer, int32_t value);
int32_t ascc_plan_value_channels(const ascc_plan *plan, const ascc_layer *layer, int32_t value);

/* Arranges the weights and hands out plan and weights, both to be released with
 * ascc_plan_release. */
ascc_status ascc_plan_finish(ascc_plan_builder *builder, ascc_plan *plan, float **weights,
                             size_t *weight_count);
/* Makes the whole kernel of an output of which half is stored. */
void ascc_plan_expand(const ascc_plan *plan, float *whole);

void ascc_plan_release(const ascc_allocator *allocator, ascc_plan *plan, float *weights,
                       size_t weight_count);

/* Lengths that follow from a plan, m: of the last layer, and how far influence reaches in a step. */
double ascc_plan_support_radius(const ascc_plan *plan);
double ascc_plan_receptive_radius(const ascc_plan *plan);
int32_t ascc_plan_neighbor_limit(const ascc_plan *plan);

#endif
