/* Points as integers, sorted into cells. SPDX-License-Identifier: MIT
 *
 * Positions are 64-bit integers (ascc_scale), so differences are exact. Cells are anchored at the
 * world's origin and ordered by z, y, x; within a cell points are ordered by position. So the order
 * of every sum follows from positions alone. Only occupied cells are stored:
 *
 *     key    [ (z,y,x) | (z,y,x) | ... ]   ascending          the neighbours of a cell are 9 runs of
 *     start  [    0    |    5    | ... ]   first point of it  slots (3 in 2D): one per row of cells
 */
#ifndef ASCC_GRID_H
#define ASCC_GRID_H

#include "base/context.h"
#include "base/sort.h"

/* How lengths become integers: one unit is 2^exponent metres (or whatever the caller measures in). */
typedef struct ascc_scale {
    double unit, inverse;
} ascc_scale;

/* The finest scale at which a search of this radius is exact: radius <= 2^27 units. */
ascc_scale ascc_scale_for_radius(double largest_radius);

/* Nearest integer position; false when not finite or too far from the origin. */
bool ascc_scale_apply(const ascc_scale *scale, double length, int64_t *units);

/* Points in some order, as integers: the low words are what kernels read. */
typedef struct ascc_points {
    size_t count;
    int64_t *position[3]; /* z all zero in 2D */
    int32_t *low[3];
} ascc_points;

/* Room for count points in the arena. */
bool ascc_points_take(ascc_points *points, ascc_arena *arena, size_t count);
/* Sets point i, low words included. */
static inline void ascc_points_set(ascc_points *points, size_t i, const int64_t position[3])
{
    for (int c = 0; c < 3; c++) {
        points->position[c][i] = position[c];
        points->low[c][i] = (int32_t)(uint32_t)(uint64_t)position[c];
    }
}

/* A point set sorted into cells of one size. Slot s holds row order[s] of the set. */
typedef struct ascc_grid {
    size_t count;
    double cell;     /* in units */
    uint32_t *order; /* NULL: slot = row */
    int32_t *low[3];
    size_t cell_count;
    uint64_t *key;   /* [cell_count] ascending */
    uint32_t *start; /* [cell_count + 1] */
    int64_t base[3]; /* of the cells, and bits of key used for x, and for x and y */
    int shift_y, shift_z;
    bool flat; /* all points in one z: no cells above or below */
} ascc_grid;

/* The box of cells that keys can tell apart; one box serves all grids that are searched together. */
typedef struct ascc_extent {
    int64_t low[3], high[3]; /* units */
} ascc_extent;

void ascc_extent_start(ascc_extent *extent);
void ascc_extent_add(ascc_extent *extent, const ascc_points *points);
/* The box of one set, found on all workers. */
ascc_extent ascc_extent_of(const ascc_points *points, ascc_workers *workers);

/* What a search or sort works with. */
typedef struct ascc_search_tools {
    ascc_arena *arena;
    ascc_workers *workers;
    const ascc_kernels *kernels;
    ascc_message *message;
} ascc_search_tools;

/* Sorts `count` points by cell of size `cell`, position, then `order` as it comes in; fills order (room
 * for count) with the permutation. errors: MEMORY, RANGE (more cells than a key can number). */
ascc_status ascc_points_order(const ascc_search_tools *tools, const ascc_points *points,
                              const ascc_extent *extent, double cell, uint32_t *order);

/* Sorts a set into cells wide enough for a search of `radius` units. With sorted: the set is already in
 * the order of ascc_points_order for that cell size. */
ascc_status ascc_grid_build(ascc_grid *grid, const ascc_search_tools *tools,
                            const ascc_points *points, const ascc_extent *extent, double radius,
                            bool sorted);
/* The cell size that serves a search of this radius. */
double ascc_grid_cell(double radius);

#endif
