/* Positions as integers, the stretches they lie in, and numbers for cells and voxels there.
 * SPDX-License-Identifier: MIT */
#include "extent.h"

#include <math.h>
#include <string.h>

#include "base/sort.h"

#define POSITION_LIMIT 4.6e18 /* units; below 2^62 */

ascc_scale ascc_scale_for_radius(double largest_radius)
{
    int exponent;
    (void)frexp(largest_radius, &exponent); /* largest_radius <= 2^exponent */
    const ascc_scale scale = {ldexp(1.0, exponent - ASCC_RADIUS_BITS),
                              ldexp(1.0, ASCC_RADIUS_BITS - exponent)};
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
    return ascc_points_room(points, arena, count, ascc_arena_take);
}

bool ascc_points_room(ascc_points *points, ascc_arena *arena, size_t count,
                      void *(*room)(ascc_arena *, size_t, size_t))
{
    points->count = count;
    for (int c = 0; c < 3; c++) {
        points->position[c] = room(arena, count, sizeof(int64_t));
        points->low[c] = room(arena, count, sizeof(int32_t));
        if (!points->position[c] || !points->low[c])
            return false;
    }
    return true;
}

/* ---- Where the points are ---- */

static void box_start(ascc_stretch box[3])
{
    for (int c = 0; c < 3; c++)
        box[c] = (ascc_stretch){INT64_MAX, INT64_MIN};
}

static void box_add_box(ascc_stretch box[3], const ascc_stretch other[3])
{
    for (int c = 0; c < 3; c++) {
        box[c].low = other[c].low < box[c].low ? other[c].low : box[c].low;
        box[c].high = other[c].high > box[c].high ? other[c].high : box[c].high;
    }
}

static void box_add(ascc_stretch box[3], const ascc_points *points, size_t begin, size_t end)
{
    for (int c = 0; c < 3; c++) {
        const int64_t *p = points->position[c];
        ascc_stretch all = box[c];
        for (size_t i = begin; i < end; i++) {
            all.low = p[i] < all.low ? p[i] : all.low;
            all.high = p[i] > all.high ? p[i] : all.high;
        }
        box[c] = all;
    }
}

void ascc_extent_start(ascc_extent *extent)
{
    memset(extent, 0, sizeof *extent);
    box_start(extent->box);
}

static void add_set(ascc_extent *extent, const ascc_points *points)
{
    assert(extent->set_count < ASCC_EXTENT_SETS);
    extent->set[extent->set_count++] = points;
    memset(extent->stretch_count, 0, sizeof extent->stretch_count);
}

void ascc_extent_add(ascc_extent *extent, const ascc_points *points)
{
    add_set(extent, points);
    box_add(extent->box, points, 0, points->count);
}

typedef struct box_job {
    const ascc_points *points;
    size_t part;
    ascc_stretch box[ASCC_SORT_PARTS][3];
} box_job;

static void box_of_part(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    box_job *job = data;
    box_add(job->box[begin / job->part], job->points, begin, end);
}

ascc_extent ascc_extent_of(const ascc_points *points, ascc_workers *workers)
{
    box_job job = {.points = points, .part = ascc_part_size(points->count)};
    for (size_t p = 0; p < ASCC_SORT_PARTS; p++)
        box_start(job.box[p]);
    ascc_workers_run(workers, points->count, job.part, box_of_part, &job);
    ascc_extent all;
    ascc_extent_start(&all);
    add_set(&all, points);
    for (size_t p = 0; p < ASCC_SORT_PARTS; p++)
        box_add_box(all.box, job.box[p]);
    return all;
}

/* ---- Stretches ---- */

/* Units between two stretches, at least: four times the largest radius. */
#define GAP ((uint64_t)4 << ASCC_RADIUS_BITS)

static int bits_for(uint64_t largest)
{
    int bits = 0;
    for (; largest; largest >>= 1)
        bits++;
    return bits;
}

/* How far all points are from the lowest on axis c, sorted and lent. */
static bool sort_axis(ascc_keys *keys, const ascc_search_tools *tools, const ascc_extent *extent,
                      int c)
{
    const uint64_t low = (uint64_t)extent->box[c].low, high = (uint64_t)extent->box[c].high;
    size_t count = 0;
    for (int s = 0; s < extent->set_count; s++)
        count += extent->set[s]->count;
    if (!ascc_keys_lend(keys, tools->arena, count, false))
        return false;
    size_t next = 0;
    for (int s = 0; s < extent->set_count; s++)
        for (size_t i = 0; i < extent->set[s]->count; i++)
            keys->key[next++] = (uint64_t)extent->set[s]->position[c][i] - low;
    return ascc_keys_sort(keys, tools->arena, tools->workers, bits_for(high - low));
}

static bool find_stretches(ascc_extent *extent, const ascc_search_tools *tools, int c)
{
    const ascc_arena_mark mark = ascc_arena_mark_of(tools->arena);
    ascc_keys keys;
    if (!sort_axis(&keys, tools, extent, c))
        return false;
    size_t count = 1;
    for (size_t i = 1; i < keys.count; i++)
        count += keys.key[i] - keys.key[i - 1] > GAP;
    ascc_stretch *stretch = ascc_arena_take(tools->arena, count, sizeof *stretch);
    if (!stretch)
        return false;
    const int64_t low = extent->box[c].low;
    size_t next = 0;
    for (size_t i = 0; i < keys.count; i++) {
        const int64_t at = low + (int64_t)keys.key[i];
        if (i == 0 || keys.key[i] - keys.key[i - 1] > GAP)
            stretch[next++].low = at;
        stretch[next - 1].high = at;
    }
    extent->stretch[c] = stretch;
    extent->stretch_count[c] = count;
    ascc_arena_return(tools->arena, mark);
    return true;
}

/* ---- Numbers ---- */

/* Two free coordinates between runs become one: no two of them are adjacent. */
#define FARTHEST_IN_RUN 2

/* Numbers the cells of some stretches; run has room for as many. */
static void number_axis(ascc_axis *axis, ascc_axis_run *run, int c, const ascc_stretch *stretch,
                        size_t count, ascc_cells_of cells, const void *data, uint64_t margin)
{
    *axis = (ascc_axis){.only = {0, margin}, .count = 1, .last = margin};
    int64_t end = 0; /* the last coordinate that has a number */
    size_t runs = 0;
    for (size_t k = 0; k < count; k++) {
        int64_t first, last;
        cells(data, c, stretch[k].low, stretch[k].high, &first, &last);
        if (k == 0 || first > end + FARTHEST_IN_RUN) {
            run[runs++] = (ascc_axis_run){first, k == 0 ? margin : axis->last + FARTHEST_IN_RUN};
        }
        end = last;
        axis->last = run[runs - 1].number + (uint64_t)(end - run[runs - 1].first);
    }
    if (runs) {
        axis->only = run[0];
        axis->count = runs;
        axis->run = runs > 1 ? run : NULL;
    }
}

static bool fits(const ascc_axis axis[3], int shift[4], uint64_t margin)
{
    shift[0] = 0;
    for (int c = 0; c < 3; c++)
        shift[c + 1] = shift[c] + bits_for(axis[c].last + margin);
    return shift[3] <= 64;
}

ascc_status ascc_extent_number(ascc_axis axis[3], int shift[4], const ascc_search_tools *tools,
                               ascc_extent *extent, ascc_cells_of cells, const void *data,
                               uint64_t margin)
{
    for (int c = 0; c < 3; c++) {
        ascc_axis_run run;
        const bool empty = extent->box[c].low > extent->box[c].high;
        number_axis(&axis[c], &run, c, &extent->box[c], !empty, cells, data, margin);
    }
    if (fits(axis, shift, margin))
        return ASCC_OK;
    for (int c = 0; c < 3; c++) {
        bool room = extent->stretch_count[c] || find_stretches(extent, tools, c);
        const size_t count = extent->stretch_count[c];
        ascc_axis_run *run = room ? ascc_arena_lend(tools->arena, count, sizeof *run) : NULL;
        if (!run)
            return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory to number cells");
        number_axis(&axis[c], run, c, extent->stretch[c], count, cells, data, margin);
    }
    if (fits(axis, shift, margin))
        return ASCC_OK;
    return ascc_fail(tools->message, ASCC_ERROR_RANGE,
                     "the points lie scattered over too many cells to number them");
}

int64_t ascc_axis_coordinate(const ascc_axis *axis, uint64_t number)
{
    if (axis->count == 1)
        return axis->only.first + (int64_t)(number - axis->only.number);
    size_t low = 0, high = axis->count;
    while (high - low > 1) {
        const size_t middle = low + (high - low) / 2;
        if (axis->run[middle].number <= number)
            low = middle;
        else
            high = middle;
    }
    return axis->run[low].first + (int64_t)(number - axis->run[low].number);
}
