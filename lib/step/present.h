/* Which fluid a step looks at, where the rest is as it was before. SPDX-License-Identifier: MIT */
#ifndef ASCC_PRESENT_H
#define ASCC_PRESENT_H

#include "network/kept.h"
#include "points/particles.h"

struct ascc_step_state;

/* What the last step saw, [rows][dimension] where not said; kept while some of the fluid sleeps. */
typedef struct ascc_past_sight {
    double *position, *velocity, *mass; /* mass: [rows] */
    int64_t (*voxel)[3];                /* [rows] that it was seen in */
    double *wall_position, *wall_normal;
    double constant[6]; /* gravity, time step, units of length and time */
    size_t count, wall_count;
    size_t position_capacity, velocity_capacity, mass_capacity, voxel_capacity, wall_capacity,
        normal_capacity;
} ascc_past_sight;

/* Kept by a step from one to the next. */
typedef struct ascc_memory {
    ascc_kept kept;
    ascc_past_sight past;
} ascc_memory;

bool ascc_memory_open(ascc_memory *memory, const ascc_network *network);
void ascc_memory_close(ascc_memory *memory);

#endif
