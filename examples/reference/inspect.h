/* Looks through a sequence for what must not be in training data: spikes, escapes, clumps.
 * SPDX-License-Identifier: MIT */
#ifndef REFERENCE_INSPECT_H
#define REFERENCE_INSPECT_H

#include <stddef.h>
#include <stdint.h>

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <ascc/ascc.h>

/* A sequence as inspect reads it. */
typedef struct inspect_input {
    int32_t dimension;
    size_t frames, count;
    double time_step, spacing; /* s, m */
    double gravity[3];
    const float *position;      /* [frames][count][dimension] */
    const float *velocity;      /* [count][dimension] of the first frame, or NULL */
    size_t walls;               /* points that touch the fluid */
    const float *wall, *normal; /* [walls][dimension] */
    size_t wall_stride;         /* numbers from one frame's to the next's; 0 = at rest */
} inspect_input;

/* What a sequence may have at most; zero is the default. */
typedef struct inspect_limits {
    double speed; /* times what the fluid can reach from its start and by falling; 0 = 5 */
    double clump; /* mean share of particles in clumps; 0 = 0.005 */
    double worst; /* share in any one frame; 0 = 0.05 */
} inspect_limits;

typedef struct inspection {
    size_t not_finite; /* coordinates */
    double reach;      /* m/s, what the fluid can reach: fastest at first, plus free fall */
    double fastest;    /* m/s, by frame differences */
    size_t spikes;     /* particles that ever move faster than limits->speed * reach */
    size_t escapes;    /* particles that ever are a spacing behind a wall or outside all */
    double pair_mean, pair_worst;   /* share with a neighbour nearer than 0.3 spacings */
    double clump_mean, clump_worst; /* share with two neighbours nearer than half a spacing */
    size_t worst_frame;
    double density_mean, density_worst; /* fluid alone, 1 = rest: mean, and mean of the worst 1 % */
    double energy_first, energy_last;   /* kinetic, J/kg */
    const char *verdict;                /* NULL = passes, else what is wrong */
} inspection;

/* errors: ARGUMENT (no frames or particles), MEMORY. */
ascc_status inspect(const inspect_input *input, const inspect_limits *limits, inspection *found);

#endif
