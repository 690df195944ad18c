/* The seam of an engine: from a scene to integer impulses. What computes networks elsewhere, on a GPU or on
 * many machines, replaces this one function and nothing else.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_ENGINE_H
#define ASCC_ENGINE_H

#include "stage.h"

/* Reads particles, motion and `advance` (seen, velocity); fills state->impulses, which are cleared before,
 * and names its own stages with ascc_stage_lap. The same integers from every engine.
 * errors: MEMORY, NOT_FINITE, RANGE, LIMIT. */
typedef ascc_status (*ascc_engine)(ascc_step_state *state);

ascc_status ascc_engine_cpu(ascc_step_state *state);

#endif
