/* The reverse pass through one step that the run-time computed: from the gradient of the velocity
 * corrections to those of weights, velocities and positions.
 * SPDX-License-Identifier: MIT
 *
 * Values are those of the forward pass, kept in its arena (ascc_step_trace); columns and geometry are
 * computed again, row by row, as forwards. Neighbour lists, lattices and rounding count as constants.
 */
#ifndef ASCC_BACKWARD_H
#define ASCC_BACKWARD_H

#include "step/step.h"

/* Weights once more, turned over: what gradients of columns are made with. */
typedef struct ascc_transposed {
    float *block;
    size_t count;
    const float **term;            /* [term_count]: [outputs][cells][inputs], padded; NULL = none */
    const float *part[ASCC_PARTS]; /* of an output with a basis: [8][inputs] */
} ascc_transposed;

bool ascc_transposed_create(ascc_transposed *transposed, const ascc_network *network);
void ascc_transposed_update(ascc_transposed *transposed, const ascc_network *network);
void ascc_transposed_destroy(ascc_transposed *transposed, const ascc_network *network);

/* What one reverse pass reads and writes. Vectors are [host's fluid rows][dimension]. */
typedef struct ascc_backward {
    const ascc_step *step;
    const ascc_step_trace *trace;
    const ascc_transposed *transposed;
    ascc_arena *arena;        /* scratch */
    const double *position;   /* before the step */
    const double *correction; /* gradient of the velocity corrections, per m/s */
    float *arranged;          /* += gradient of the weights as the network arranges them */
    float *bias;              /* += gradient of biases, laid out as the model's weights */
    double *velocity;         /* += gradient of the velocities seen, per m/s; or NULL */
    double *seen, *place; /* += gradient of positions seen and before the step, per m; or NULL */
} ascc_backward;

/* errors: MEMORY. */
ascc_status ascc_backward_run(const ascc_backward *pass);

/* Adds a gradient of arranged weights to one laid out as the model's weights (an output stored in half:
 * the whole kernel). */
void ascc_backward_fold(const ascc_network *network, const ascc_model *model, const float *arranged,
                        float *gradient);

#endif
