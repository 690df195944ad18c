/* The way back through the sweeps of a hyperviscosity. SPDX-License-Identifier: MIT */
#ifndef ASCC_TRAIN_HYPERVISCOSITY_REVERSE_H
#define ASCC_TRAIN_HYPERVISCOSITY_REVERSE_H

#include "step/stage.h"

/* Gradients by squares of the pairs' gradients |g|^2; of particles of one mass. */
typedef struct ascc_smoothing_gradients {
    float *
        velocity; /* [row][4] of supports a step: by what the sweeps left; then by what they began with */
    float *by_squares; /* [row] = of their sum over a row's pairs */
    float
        *by_square; /* [pair] = of each pair, those of a row with neighbours after it, row by row */
    double *by_lattice; /* += of the lattice's response, where that cuts coefficients */
} ascc_smoothing_gradients;

/* How many pairs that are. */
size_t ascc_smoothing_pairs(const ascc_relaxation_trace *trace, size_t rows);

/* Of a step that kept them. Exact but where a row's coefficient is cut. errors: MEMORY. */
ascc_status ascc_smoothing_backward(const ascc_step_state *state, ascc_arena *arena,
                                    const ascc_smoothing_gradients *gradients);

#endif
