/* One step as the library itself runs it, and what it leaves to be looked at.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_STEP_H
#define ASCC_STEP_H

#include "network/antisymmetric.h"
#include "integrate.h"

struct ascc_step {
    uint32_t magic;
    ascc_context *context; /* retained */
    ascc_model *model;     /* retained */
    double time_step, length_unit, max_displacement;
    ascc_network network;
    ascc_arena arena;
    double *acceleration; /* the host's, [fluid][dimension] */
    size_t acceleration_capacity;
    ascc_step_statistics statistics;
    ascc_message message;
};

/* All intermediate results of one step, in its arena: valid until that is reset. */
typedef struct ascc_step_trace {
    ascc_search_tools tools;
    ascc_hierarchy hierarchy;
    ascc_network_run run;
    ascc_advance advance;
    ascc_impulses impulses;
} ascc_step_trace;

/* One step of a particle set that suits the model, with an arena that is reset first. On failure the
 * particles stay as they were. */
ascc_status ascc_step_once(ascc_step *step, ascc_particles *p, const ascc_motion *motion,
                           ascc_arena *arena, ascc_step_trace *trace);

#endif
