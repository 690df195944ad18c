/* Points sorted into cells. SPDX-License-Identifier: MIT */
#include "grid.h"

#include <math.h>
#include <string.h>

/* World-anchored cell of a coordinate. Monotone, and rounded by less than 2^-12 cells up to cell 2^40, so
 * that points within cell * (1 - 2^-11) are at most one cell apart. */
static inline int64_t cell_of(int64_t position, double inverse_cell)
{
    const double x = (double)position * inverse_cell; /* below 2^62: whole numbers fit */
    const int64_t toward_zero = (int64_t)x;
    return toward_zero - ((double)toward_zero > x);
}

double ascc_grid_cell(double radius)
{
    return radius * (1.0 + 1.0 / 2048.0) + 1.0;
}

static void cells_of(const void *data, int c, int64_t low, int64_t high, int64_t *first,
                     int64_t *last)
{
    (void)c;
    const double *inverse = data;
    *first = cell_of(low, *inverse);
    *last = cell_of(high, *inverse);
}

typedef struct key_job {
    const ascc_points *points;
    ascc_axis axis[3];
    int shift[4];
    double inverse; /* of the cell size */
    ascc_keys keys;
} key_job;

static void make_keys(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const key_job *job = data;
    for (size_t i = begin; i < end; i++) {
        uint64_t key = 0;
        for (int c = 0; c < 3; c++)
            key |=
                ascc_axis_number(&job->axis[c], cell_of(job->points->position[c][i], job->inverse))
                << job->shift[c];
        job->keys.key[i] = key;
        if (job->keys.row)
            job->keys.row[i] = (uint32_t)i;
    }
}

/* Keys of all points, lent; with sort: and their rows, sorted by key, rows ascending within a key. Cells
 * have a margin of one on every side, for the cells around. */
static ascc_status lend_keys(ascc_grid *grid, const ascc_search_tools *tools,
                             const ascc_points *points, ascc_extent *extent, bool sort,
                             ascc_keys *keys)
{
    if (points->count >= UINT32_MAX)
        return ascc_fail(tools->message, ASCC_ERROR_RANGE, "%zu points are too many for one set",
                         points->count);
    key_job job = {.points = points, .inverse = 1.0 / grid->cell};
    const ascc_status status =
        ascc_extent_number(job.axis, job.shift, tools, extent, cells_of, &job.inverse, 1);
    if (status != ASCC_OK)
        return status;
    grid->shift_y = job.shift[1];
    grid->shift_z = job.shift[2];
    grid->flat = extent->box[2].low >= extent->box[2].high;
    bool room = ascc_keys_lend(&job.keys, tools->arena, points->count, sort);
    if (room) {
        ascc_workers_run(tools->workers, points->count, 4096, make_keys, &job);
        *keys = job.keys;
        room = !sort || ascc_keys_sort(keys, tools->arena, tools->workers, job.shift[3]);
    }
    return room ? ASCC_OK
                : ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory to sort %zu points",
                            points->count);
}

/* ---- Order within a cell ---- */

static bool precedes(const ascc_points *p, uint32_t a, uint32_t b)
{
    for (int c = 2; c >= 0; c--)
        if (p->position[c][a] != p->position[c][b])
            return p->position[c][a] < p->position[c][b];
    return a < b;
}

static bool row_precedes(const void *points, const void *a, const void *b)
{
    return precedes(points, *(const uint32_t *)a, *(const uint32_t *)b);
}

/* Sorts by position, then by row: insertion for the usual handful, a heap for a crowd. */
static void sort_cell(const ascc_points *p, uint32_t *order, size_t count)
{
    if (count <= 32) {
        for (size_t i = 1; i < count; i++) {
            const uint32_t moved = order[i];
            size_t j = i;
            for (; j > 0 && precedes(p, moved, order[j - 1]); j--)
                order[j] = order[j - 1];
            order[j] = moved;
        }
        return;
    }
    ascc_heap_sort(order, count, sizeof *order, row_precedes, p);
}

typedef struct order_job {
    const ascc_points *points;
    const ascc_keys *keys;
    uint32_t *order;
} order_job;

/* The cells that begin in [begin, end). */
static void sort_cells(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const order_job *job = data;
    const uint64_t *key = job->keys->key;
    const size_t count = job->keys->count;
    size_t i = begin;
    while (i > 0 && i < end && key[i] == key[i - 1])
        i++;
    const size_t first = i;
    while (i < end) {
        size_t stop = i + 1;
        while (stop < count && key[stop] == key[i])
            stop++;
        sort_cell(job->points, job->keys->row + i, stop - i);
        i = stop;
    }
    if (first < i)
        memcpy(job->order + first, job->keys->row + first, (i - first) * sizeof *job->order);
}

ascc_status ascc_points_order(const ascc_search_tools *tools, const ascc_points *points,
                              ascc_extent *extent, double cell, uint32_t *order)
{
    const ascc_arena_mark mark = ascc_arena_mark_of(tools->arena);
    ascc_grid grid = {.cell = cell};
    ascc_keys keys;
    const ascc_status status = lend_keys(&grid, tools, points, extent, true, &keys);
    if (status != ASCC_OK)
        return status;
    order_job job = {points, &keys, order};
    ascc_workers_run(tools->workers, points->count, 2048, sort_cells, &job);
    ascc_arena_return(tools->arena, mark);
    return ASCC_OK;
}

typedef struct slots_job {
    const ascc_points *points;
    const ascc_keys *keys;
    ascc_grid *grid;
} slots_job;

/* What kernels read, in the order of slots. */
static void fill_slots(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const slots_job *job = data;
    for (size_t s = begin; s < end; s++) {
        const uint32_t row = job->grid->order[s] = job->keys->row[s];
        for (int c = 0; c < 3; c++)
            job->grid->low[c][s] = job->points->low[c][row];
    }
}

ascc_status ascc_grid_build(ascc_grid *grid, const ascc_search_tools *tools,
                            const ascc_points *points, ascc_extent *extent, double radius,
                            bool sorted)
{
    const ascc_arena_mark mark = ascc_arena_mark_of(tools->arena);
    ascc_keys keys;
    grid->count = points->count;
    grid->cell = ascc_grid_cell(radius);
    grid->order = NULL;
    for (int c = 0; c < 3; c++)
        grid->low[c] = points->low[c];
    const ascc_status status = lend_keys(grid, tools, points, extent, !sorted, &keys);
    if (status != ASCC_OK)
        return status;
    bool room = true;
    if (!sorted) {
        grid->order = ascc_arena_take(tools->arena, grid->count, sizeof *grid->order);
        for (int c = 0; c < 3; c++) {
            grid->low[c] = ascc_arena_take(tools->arena, grid->count, sizeof *grid->low[c]);
            room &= grid->low[c] != NULL;
        }
        room &= grid->order != NULL;
        slots_job job = {points, &keys, grid};
        if (room)
            ascc_workers_run(tools->workers, grid->count, 4096, fill_slots, &job);
    }
    ascc_distinct cells;
    room = room && ascc_keys_distinct(&keys, tools->arena, tools->workers, ascc_arena_take, &cells);
    if (!room)
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for a grid of %zu points",
                         grid->count);
    grid->key = cells.key;
    grid->start = cells.start;
    grid->cell_count = cells.count;
    ascc_arena_return(tools->arena, mark);
    return ASCC_OK;
}
