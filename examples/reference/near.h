/* Neighbour lists of the reference solvers: kept while no particle moves half a skin.
 * SPDX-License-Identifier: MIT
 *
 * Points are [ moving | fixed | ghosts ]: moving and fixed ones are the caller's, ghosts are copies of
 * moving points across the faces of a periodic box. Lists hold every point within radius + skin, so a
 * sweep tests the distance itself. Order of a list: as lib/points/grid.h, from positions alone.
 */
#ifndef REFERENCE_NEAR_H
#define REFERENCE_NEAR_H

#include "base/context.h"

typedef struct near_options {
    int32_t dimension;
    int32_t thread_count; /* 0 = 1 */
    double radius;        /* m, within which every pair is listed */
    double skin;          /* m, by which the lists reach farther */
    double period[3];     /* m; the box [0, period) repeats; 0 = does not */
} near_options;

/* Read by sweeps; written by near_update. */
typedef struct near_lists {
    near_options options;
    size_t moving, fixed, ghosts;
    const size_t *start;   /* [moving + fixed] into index */
    const uint32_t *count; /* moving rows: points of all three kinds; fixed rows: moving points */
    const uint32_t *index;
    const size_t *wall_start; /* [fixed + 1] into wall_index */
    const uint32_t *wall_index;
    const uint32_t *owner;    /* [ghosts] moving point that a ghost copies */
    const double (*shift)[3]; /* [ghosts] its displacement */
    uint64_t rebuilds;
    ascc_message message; /* of the last failure */
} near_lists;

/* NULL without memory. */
near_lists *near_create(const near_options *options);
void near_destroy(near_lists **lists);

/* Runs a sweep over [0, count) on the lists' threads. */
void near_run(near_lists *lists, size_t count, ascc_range_function function, void *data);

/* Forgets the lists: the points are others than before. */
void near_forget(near_lists *lists);

/* True if lists made now are good for these positions: position[i * stride], moving points first. */
bool near_current(const near_lists *lists, size_t moving, const double *position, size_t stride);

/* Makes the lists. Moving points must lie inside the periodic box. errors: MEMORY, RANGE, LIMIT. */
ascc_status near_update(near_lists *lists, size_t moving, size_t fixed, const double *position,
                        size_t stride);

#endif
