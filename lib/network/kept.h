/* Values on the finest lattice that outlive a step. SPDX-License-Identifier: MIT
 *
 * Where nothing within their reach is other than it was in the step before, the values of layers that read particles
 * and this lattice alone are what they were, to the bit. They are kept by corner, and so is which voxels hold fluid:
 *
 *     . . . . . . . . . .    c  voxels that fluid has moved, come or gone in, or that it was in
 *     p p p p p p p p . .    d  dirty, within the reach of these: values are computed
 *     p d d d d d p p . .    p  present, within the reach of what is computed: the fluid here is looked at
 *     p d d c d d p p . .    .  absent: its particles are not in the step's point sets; its voxels are, for coarser
 *     p d d d d d p p . .       levels to have the same corners
 */
#ifndef ASCC_KEPT_H
#define ASCC_KEPT_H

#include "network.h"
#include "points/blocks.h"

/* Corners and what they hold. */
typedef struct ascc_kept_corners {
    size_t count, at_capacity, slot_capacity, value_capacity;
    int64_t (*at)[3]; /* units */
    uint32_t *slot;   /* [ascc_blocks_slots(count)] of a table of them */
    float *value;     /* [count][width] */
} ascc_kept_corners;

typedef struct ascc_kept {
    const ascc_allocator *allocator;
    /* Of the network: */
    bool serves;  /* there are such layers, and nothing coarser reads particles */
    double voxel; /* m: of the finest lattice */
    /* Whole voxels within the reach of values that are kept; that fluid around a particle may be away. Corner k lies
     * between voxels k - 1 and k. */
    int64_t reach, around;
    int32_t *offset; /* [layer_count] of a layer's channels in a row; -1 = it is not kept */
    int32_t layer_count;
    size_t width; /* floats of a corner */
    bool valid;   /* the last step kept all values */
    ascc_kept_corners corners[2];
    int now; /* which of the two are the last step's */
    /* Of a step under way: */
    const ascc_blocks *dirty; /* voxels; NULL = all are */
    uint32_t *from;           /* [rows of the level] the last step's row; UINT32_MAX: computed */
} ascc_kept;

/* What a network lets be kept. False without memory. */
bool ascc_kept_open(ascc_kept *kept, const ascc_network *network);
void ascc_kept_close(ascc_kept *kept);

/* The voxel of a place in m, as the levels of a hierarchy have it. False where it has none. */
bool ascc_kept_voxel(const ascc_kept *kept, const ascc_scale *scale, const double *place,
                     int32_t dimension, int64_t at[3]);
/* Its middle, units. */
void ascc_kept_middle(const ascc_kept *kept, const ascc_scale *scale, const int64_t at[3],
                      int32_t dimension, int64_t middle[3]);

/* After a hierarchy has been built: which corners have their values from the last step. False without memory. */
bool ascc_kept_begin(ascc_kept *kept, const ascc_hierarchy *hierarchy, ascc_arena *arena);

/* Leaves active what has to be computed of a layer's rows. */
void ascc_kept_demand(const ascc_kept *kept, int32_t layer, size_t rows, uint8_t *active);
/* A layer has been computed: gives it the other rows, and keeps all. */
void ascc_kept_fill(const ascc_network_run *run, int32_t layer);
/* All layers have been: the next step may begin with these. */
void ascc_kept_end(ascc_kept *kept);

#endif
