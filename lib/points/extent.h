/* Positions as integers, where on each axis there are any, and numbers for cells and voxels there.
 * SPDX-License-Identifier: MIT
 *
 * A key has 64 bits for the cells of three axes. The box of all points mostly fits. Where it does not,
 * because some are far from the rest, an axis is numbered by stretches that hold points; what lies
 * between them is left out, but for one number, so that order and adjacency are those of the cells:
 *
 *     cell     -7 -6 -5  . . . . . . . . .  812 813  . . . . . . .  9001
 *     number    1  2  3                       5   6                    8
 */
#ifndef ASCC_EXTENT_H
#define ASCC_EXTENT_H

#include "base/context.h"

/* How lengths become integers: one unit is 2^exponent metres (or whatever the caller measures in). */
typedef struct ascc_scale {
    double unit, inverse;
} ascc_scale;

/* A search's radius takes at most 2^27 units, so that the difference of two points three cells apart
 * fits the low word of a position and is exact. */
#define ASCC_RADIUS_BITS 27

/* The finest scale at which a search of this radius is exact. */
ascc_scale ascc_scale_for_radius(double largest_radius);

/* Nearest integer position; false when not finite or too far from the origin: 2^62 units and more. */
bool ascc_scale_apply(const ascc_scale *scale, double length, int64_t *units);

/* Points in some order, as integers: the low words are what kernels read. */
typedef struct ascc_points {
    size_t count;
    int64_t *position[3]; /* z all zero in 2D */
    int32_t *low[3];
} ascc_points;

/* Room for count points in the arena; room: ascc_arena_take or ascc_arena_lend. */
bool ascc_points_room(ascc_points *points, ascc_arena *arena, size_t count,
                      void *(*room)(ascc_arena *, size_t, size_t));
bool ascc_points_take(ascc_points *points, ascc_arena *arena, size_t count);
/* Sets point i, low words included. */
static inline void ascc_points_set(ascc_points *points, size_t i, const int64_t position[3])
{
    for (int c = 0; c < 3; c++) {
        points->position[c][i] = position[c];
        points->low[c][i] = (int32_t)(uint32_t)(uint64_t)position[c];
    }
}

/* What a search or sort works with. */
typedef struct ascc_search_tools {
    ascc_arena *arena;
    ascc_workers *workers;
    const ascc_kernels *kernels;
    ascc_message *message;
} ascc_search_tools;

/* ---- Where the points are ---- */

#define ASCC_EXTENT_SETS 16

/* Positions with no gap wider than four times the largest radius between them; units. */
typedef struct ascc_stretch {
    int64_t low, high;
} ascc_stretch;

/* Where the points of some sets are. One extent serves all grids that are searched together. */
typedef struct ascc_extent {
    ascc_stretch box[3]; /* low > high: no points */
    int set_count;
    const ascc_points *set[ASCC_EXTENT_SETS]; /* read again where the box is too wide */
    size_t stretch_count[3];                  /* 0: the box was enough so far */
    const ascc_stretch *stretch[3];           /* ascending, in the arena */
} ascc_extent;

void ascc_extent_start(ascc_extent *extent);
/* Takes in a set, which stays where it is while the extent is used; at most ASCC_EXTENT_SETS. */
void ascc_extent_add(ascc_extent *extent, const ascc_points *points);
/* The extent of one set, found on all workers. */
ascc_extent ascc_extent_of(const ascc_points *points, ascc_workers *workers);

/* ---- Numbers ---- */

typedef struct ascc_axis_run {
    int64_t first; /* coordinate, in whole cells */
    uint64_t number;
} ascc_axis_run;

/* Numbers for the coordinates of an axis. */
typedef struct ascc_axis {
    ascc_axis_run only; /* if count = 1 */
    size_t count;
    const ascc_axis_run *run; /* [count] ascending, lent by the arena */
    uint64_t last;            /* the largest number */
} ascc_axis;

/* The cells or voxels of axis c that points from low to high may lie in: monotone in both. */
typedef void (*ascc_cells_of)(const void *data, int c, int64_t low, int64_t high, int64_t *first,
                              int64_t *last);

/* Numbers all three axes, from `margin` to axis.last + margin, for keys of 64 bits: axis c has bits
 * shift[c] to shift[c + 1]. errors: MEMORY, RANGE (over a million points, each far from all others). */
ascc_status ascc_extent_number(ascc_axis axis[3], int shift[4], const ascc_search_tools *tools,
                               ascc_extent *extent, ascc_cells_of cells, const void *data,
                               uint64_t margin);

static inline uint64_t ascc_axis_number(const ascc_axis *axis, int64_t coordinate)
{
    if (axis->count == 1)
        return (uint64_t)(coordinate - axis->only.first) + axis->only.number;
    size_t low = 0, high = axis->count; /* the run is in [low, high) */
    while (high - low > 1) {
        const size_t middle = low + (high - low) / 2;
        if (axis->run[middle].first <= coordinate)
            low = middle;
        else
            high = middle;
    }
    return (uint64_t)(coordinate - axis->run[low].first) + axis->run[low].number;
}

/* The coordinate of a number. */
int64_t ascc_axis_coordinate(const ascc_axis *axis, uint64_t number);

#endif
