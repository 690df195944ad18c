/* The way back through the relaxation of a step: from gradients behind it to those before it.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_TRAIN_RELAXATION_REVERSE_H
#define ASCC_TRAIN_RELAXATION_REVERSE_H

#include "step/stage.h"

/* Of the relaxation's constants; of the rest volume by its logarithm. */
typedef struct ascc_constant_gradients {
    double volume, epsilon, pressure[ASCC_MAX_SWEEPS], divergence[ASCC_MAX_SWEEPS];
} ascc_constant_gradients;

/* What a way back reads and writes: [host's fluid rows][dimension], gradients per m and m/s. */
typedef struct ascc_relaxation_gradients {
    const double *before;        /* positions that the step began with */
    double *position, *velocity; /* by what the step left; then by what the network left */
    double *
        by_guess; /* [host's fluid rows] = of the value that pressures begin with, if there is one */
    double *by_before; /* += gradient of `before`, which corrections may lie along */
    ascc_constant_gradients *by_constants; /* += those of the constants */
} ascc_relaxation_gradients;

/* Of a step that kept what its relaxation began with (ascc_network.keeps_values). Exact but where sweeps
 * clamp, pairs are limited or neighbours change; contact counts as if there were none. errors: MEMORY. */
ascc_status ascc_relaxation_backward(const ascc_step_state *state, ascc_arena *arena,
                                     const ascc_relaxation_gradients *gradients);

#endif
