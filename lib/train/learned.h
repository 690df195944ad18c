/* Constants of a relaxation that are trained beside the weights. SPDX-License-Identifier: MIT
 *
 * A parameter t stands for the value (1 + t) times the one that the model came with, so that all of them move as fast,
 * and is kept where a reader takes the value. In the model file each value has room of its own: what is written
 * there is as long as what was.
 */
#ifndef ASCC_TRAIN_LEARNED_H
#define ASCC_TRAIN_LEARNED_H

#include "model/plan.h"
#include "relaxation_reverse.h"

#define ASCC_MOST_LEARNED (2 + 2 * ASCC_MAX_SWEEPS)

typedef struct ascc_learned {
    size_t first, count;   /* parameters, in this order: rest volume, epsilon, sweeps */
    uint32_t which;        /* ASCC_LEARN_* */
    ascc_relaxation given; /* the model's own */
    double spacing;        /* and its spacing and dimension */
    int32_t dimension;
    size_t place[ASCC_MOST_LEARNED]; /* in the file's bytes */
} ascc_learned;

/* errors: ARGUMENT (the model has none of them). */
ascc_status ascc_learned_open(ascc_learned *learned, uint32_t which, const ascc_plan *plan,
                              ascc_message *message);
/* The model file with room for values, in *made of *made_size, the allocator's. errors: MEMORY, FORMAT. */
ascc_status ascc_learned_make_room(ascc_learned *learned, const ascc_allocator *allocator,
                                   const unsigned char *file, size_t size, unsigned char **made,
                                   size_t *made_size, ascc_message *message);
/* Is this byte of the file in such a room? */
bool ascc_learned_covers(const ascc_learned *learned, size_t at);
/* Values of the parameters into the file. */
void ascc_learned_write(const ascc_learned *learned, const float *parameters, unsigned char *file);
/* And into the plan. */
void ascc_learned_apply(const ascc_learned *learned, const float *parameters, ascc_plan *plan);
/* Are they where a reader takes their values? */
bool ascc_learned_takes(const ascc_learned *learned, const float *parameters);
/* Takes parameters back to where a reader takes their values. */
void ascc_learned_bound(const ascc_learned *learned, float *parameters);
/* Adds a share of the gradients to those of the parameters. */
void ascc_learned_add_gradient(const ascc_learned *learned,
                               const ascc_constant_gradients *gradients, const float *parameters,
                               float share, float *to);

#endif
