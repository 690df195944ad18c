/* Points sorted into cells. SPDX-License-Identifier: MIT
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

#include "base/sort.h"
#include "extent.h"

/* A point set sorted into cells of one size. Slot s holds row order[s] of the set. */
typedef struct ascc_grid {
    size_t count;
    double cell;     /* in units */
    uint32_t *order; /* NULL: slot = row */
    int32_t *low[3];
    size_t cell_count;
    uint64_t *key;        /* [cell_count] ascending */
    uint32_t *start;      /* [cell_count + 1] */
    int shift_y, shift_z; /* bits of key used for x, and for x and y */
    bool flat;            /* all points in one z: no cells above or below */
} ascc_grid;

/* Sorts `count` points by cell of size `cell`, position, then `order` as it comes in; fills order (room
 * for count) with the permutation. errors: MEMORY, RANGE. */
ascc_status ascc_points_order(const ascc_search_tools *tools, const ascc_points *points,
                              ascc_extent *extent, double cell, uint32_t *order);

/* Sorts a set into cells wide enough for a search of `radius` units. With sorted: the set is already in
 * the order of ascc_points_order for that cell size. */
ascc_status ascc_grid_build(ascc_grid *grid, const ascc_search_tools *tools,
                            const ascc_points *points, ascc_extent *extent, double radius,
                            bool sorted);
/* The cell size that serves a search of this radius. */
double ascc_grid_cell(double radius);

#endif
