/* Evens out velocities that are rougher than those around, pair by pair: what brings still water to rest
 * (docs/method.md). SPDX-License-Identifier: MIT */
#ifndef ASCC_STEP_HYPERVISCOSITY_H
#define ASCC_STEP_HYPERVISCOSITY_H

#include "network/pair_sum.h"
#include "stage.h"

/* Rows are those of ASCC_SET_FLUID. */
typedef struct ascc_smoothing {
    ascc_step_state *state;
    ascc_gradients pairs;
    const ascc_rows *rows;    /* what the pairs are among */
    ascc_pair_sum *sum;       /* open, 4 wide */
    const float *coefficient; /* [count] of a row's pairs; of a pair it is the smaller one */
    float *weight;            /* room for those of pairs; it may be that of the pairs' g[0] */
    size_t count;
    ascc_relaxation_trace *trace; /* where sweeps are kept for a way back, or NULL */
    int64_t *given;               /* room for impulses, [host's rows][dimension] */
} ascc_smoothing;

/* All sweeps of the model's hyperviscosity; momenta change, positions do not. errors: MEMORY, NOT_FINITE, RANGE. */
ascc_status ascc_smooth_velocities(const ascc_smoothing *smoothing);

/* A sweep takes no more than this share in a step of that length: by the model's own, if it is shorter. */
double ascc_smoothing_share(const ascc_step_state *state, double share);
/* Roughness that is left alone, supports a step: the model's own, by the share that the step's gravity is of the model's. */
float ascc_smoothing_bound(const ascc_step_state *state);
/* None where nothing falls: there is no rest to come to, and a drop keeps turning. */
int32_t ascc_smoothing_sweeps(const ascc_step_state *state);

/* The velocity of a row as it is now, in supports a step; 0 if it has no turn of its own. */
void ascc_relaxation_velocity(const ascc_step_state *state, size_t row, float velocity[4]);
/* Quanta per kilogram and support of correction. */
double ascc_relaxation_quanta(const ascc_step_state *state);
/* Adds impulses to momenta. errors: RANGE. */
ascc_status ascc_relaxation_add(ascc_step_state *state, const int64_t *given);

#endif
