/* Points sorted into cells. SPDX-License-Identifier: MIT */
#include "grid.h"

#include <math.h>
#include <string.h>

/* A radius takes at most 2^27 units, so that the difference of two points three cells apart fits the
 * low word of a position and is exact. */
#define RADIUS_BITS 27
#define POSITION_LIMIT 4.6e18 /* units; below 2^62 */

ascc_scale ascc_scale_for_radius(double largest_radius)
{
    int exponent;
    (void)frexp(largest_radius, &exponent); /* largest_radius <= 2^exponent */
    const ascc_scale scale = {ldexp(1.0, exponent - RADIUS_BITS),
                              ldexp(1.0, RADIUS_BITS - exponent)};
    return scale;
}

bool ascc_scale_apply(const ascc_scale *scale, double length, int64_t *units)
{
    const double u = rint(length * scale->inverse);
    if (!(fabs(u) < POSITION_LIMIT))
        return false;
    *units = (int64_t)u;
    return true;
}

bool ascc_points_take(ascc_points *points, ascc_arena *arena, size_t count)
{
    points->count = count;
    for (int c = 0; c < 3; c++) {
        points->position[c] = ascc_arena_take(arena, count, sizeof(int64_t));
        points->low[c] = ascc_arena_take(arena, count, sizeof(int32_t));
        if (!points->position[c] || !points->low[c])
            return false;
    }
    return true;
}

void ascc_extent_start(ascc_extent *extent)
{
    for (int c = 0; c < 3; c++) {
        extent->low[c] = INT64_MAX;
        extent->high[c] = INT64_MIN;
    }
}

static void extent_add_part(ascc_extent *extent, const ascc_points *points, size_t begin,
                            size_t end)
{
    for (int c = 0; c < 3; c++) {
        const int64_t *p = points->position[c];
        int64_t low = extent->low[c], high = extent->high[c];
        for (size_t i = begin; i < end; i++) {
            low = p[i] < low ? p[i] : low;
            high = p[i] > high ? p[i] : high;
        }
        extent->low[c] = low;
        extent->high[c] = high;
    }
}

void ascc_extent_add(ascc_extent *extent, const ascc_points *points)
{
    extent_add_part(extent, points, 0, points->count);
}

typedef struct extent_job {
    const ascc_points *points;
    size_t part;
    ascc_extent extent[ASCC_SORT_PARTS];
} extent_job;

static void measure_part(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    extent_job *job = data;
    extent_add_part(&job->extent[begin / job->part], job->points, begin, end);
}

ascc_extent ascc_extent_of(const ascc_points *points, ascc_workers *workers)
{
    extent_job job = {.points = points, .part = ascc_part_size(points->count)};
    for (size_t p = 0; p < ASCC_SORT_PARTS; p++)
        ascc_extent_start(&job.extent[p]);
    ascc_workers_run(workers, points->count, job.part, measure_part, &job);
    ascc_extent all = job.extent[0];
    for (size_t p = 1; p < ASCC_SORT_PARTS; p++)
        for (int c = 0; c < 3; c++) {
            all.low[c] = job.extent[p].low[c] < all.low[c] ? job.extent[p].low[c] : all.low[c];
            all.high[c] = job.extent[p].high[c] > all.high[c] ? job.extent[p].high[c] : all.high[c];
        }
    return all;
}

/* ---- Cells ---- */

/* World-anchored cell of a coordinate. Monotone, so neighbours within cell * (1 - 2^-12) are at most
 * one cell apart in spite of rounding. */
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

static int bits_for(uint64_t largest)
{
    int bits = 1;
    while (bits < 64 && largest >> bits)
        bits++;
    return bits;
}

/* Where keys start and how they are packed; cells have a margin of one on every side. False if they do
 * not fit 64 bits. */
static bool key_layout(ascc_grid *grid, const ascc_extent *extent, int *bits)
{
    const double inverse = 1.0 / grid->cell;
    int width[3];
    for (int c = 0; c < 3; c++) {
        if (extent->low[c] > extent->high[c]) { /* no points at all */
            grid->base[c] = 0;
            width[c] = 2;
            continue;
        }
        grid->base[c] = cell_of(extent->low[c], inverse) - 1;
        width[c] = bits_for((uint64_t)(cell_of(extent->high[c], inverse) + 1 - grid->base[c]));
    }
    grid->flat = extent->low[2] >= extent->high[2];
    grid->shift_y = width[0];
    grid->shift_z = width[0] + width[1];
    *bits = width[0] + width[1] + width[2];
    return *bits <= 64 && grid->shift_z < 64;
}

static inline uint64_t key_of(const ascc_grid *grid, const int64_t cell[3])
{
    return (uint64_t)(cell[0] - grid->base[0]) |
           (uint64_t)(cell[1] - grid->base[1]) << grid->shift_y |
           (uint64_t)(cell[2] - grid->base[2]) << grid->shift_z;
}

typedef struct key_job {
    const ascc_points *points;
    const ascc_grid *grid;
    ascc_keys keys;
} key_job;

static void make_keys(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const key_job *job = data;
    const double inverse = 1.0 / job->grid->cell;
    for (size_t i = begin; i < end; i++) {
        const int64_t cell[3] = {cell_of(job->points->position[0][i], inverse),
                                 cell_of(job->points->position[1][i], inverse),
                                 cell_of(job->points->position[2][i], inverse)};
        job->keys.key[i] = key_of(job->grid, cell);
        if (job->keys.row)
            job->keys.row[i] = (uint32_t)i;
    }
}

/* Keys of all points, lent; with sort: and their rows, sorted by key, rows ascending within a key. */
static ascc_status lend_keys(ascc_grid *grid, const ascc_search_tools *tools,
                             const ascc_points *points, const ascc_extent *extent, bool sort,
                             ascc_keys *keys)
{
    int bits;
    if (points->count >= UINT32_MAX)
        return ascc_fail(tools->message, ASCC_ERROR_RANGE, "%zu points are too many for one set",
                         points->count);
    if (!key_layout(grid, extent, &bits))
        return ascc_fail(tools->message, ASCC_ERROR_RANGE,
                         "the points span too many cells of %g units to number them", grid->cell);
    key_job job = {.points = points, .grid = grid};
    bool room = ascc_keys_lend(&job.keys, tools->arena, points->count, sort);
    if (room) {
        ascc_workers_run(tools->workers, points->count, 4096, make_keys, &job);
        *keys = job.keys;
        room = !sort || ascc_keys_sort(keys, tools->arena, tools->workers, bits);
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

static void sift(const ascc_points *p, uint32_t *order, size_t root, size_t count)
{
    for (;;) {
        size_t child = 2 * root + 1;
        if (child >= count)
            return;
        if (child + 1 < count && precedes(p, order[child], order[child + 1]))
            child++;
        if (!precedes(p, order[root], order[child]))
            return;
        const uint32_t swap = order[root];
        order[root] = order[child];
        order[child] = swap;
        root = child;
    }
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
    for (size_t i = count / 2; i-- > 0;)
        sift(p, order, i, count);
    for (size_t i = count - 1; i > 0; i--) {
        const uint32_t swap = order[0];
        order[0] = order[i];
        order[i] = swap;
        sift(p, order, 0, i);
    }
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
                              const ascc_extent *extent, double cell, uint32_t *order)
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
                            const ascc_points *points, const ascc_extent *extent, double radius,
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
