/* Voxelisation by sorting their keys, and farthest point sampling. SPDX-License-Identifier: MIT */
#include "resample.h"

#include <math.h>

#define LARGEST_VOXEL 9007199254740992.0 /* 2^53 units: 2^26 of the largest radius */
#define MOST_VOXELS 4.6e18               /* from the anchor on, each way; below 2^62 */

void ascc_centroid(const ascc_points *points, double center[3])
{
    for (int c = 0; c < 3; c++) {
        uint64_t low = 0, high = 0; /* two halves of the sum of positions + 2^63 */
        for (size_t i = 0; i < points->count; i++) {
            const uint64_t p = (uint64_t)points->position[c][i] + ((uint64_t)1 << 63);
            low += p & 0xffffffffu;
            high += p >> 32;
        }
        /* Subtract the offset again in whole numbers before anything is rounded. */
        const uint64_t n = points->count;
        const int64_t rest = (int64_t)(high - (n << 31));
        center[c] = n ? ((double)rest * 4294967296.0 + (double)low) / (double)n : 0.0;
    }
}

/* Voxels as keys: z, y, x from the highest bits down. */
typedef struct voxels {
    ascc_axis axis[3];
    int shift[4];
    ascc_keys keys;
} voxels;

static ascc_status no_memory(const ascc_search_tools *tools)
{
    return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for voxels");
}

/* Keys for `each` voxels of `count` points, lent. errors: MEMORY, RANGE. */
static ascc_status lend_voxels(voxels *v, const ascc_search_tools *tools, size_t count, size_t each)
{
    if (count > (UINT32_MAX - 1) / each)
        return ascc_fail(tools->message, ASCC_ERROR_RANGE, "%zu points take up too many voxels",
                         count);
    return ascc_keys_lend(&v->keys, tools->arena, count * each, false) ? ASCC_OK : no_memory(tools);
}

static inline uint64_t shifted(uint64_t x, int shift)
{
    return shift < 64 ? x << shift : 0; /* then x is 0 */
}

static inline uint64_t voxel_key(const voxels *v, const int64_t at[3])
{
    uint64_t key = 0;
    for (int c = 0; c < 3; c++)
        key |= shifted(ascc_axis_number(&v->axis[c], at[c]), v->shift[c]);
    return key;
}

static inline uint64_t field(uint64_t key, int from, int to)
{
    return from == to ? 0 : key << (64 - to) >> (64 - to) >> from;
}

/* ---- From points to voxels ---- */

typedef struct voxel_job {
    const ascc_points *points;
    int32_t dimension;
    double voxel, hysteresis, anchor[3];
    bool corners; /* else centers */
    const ascc_distinct *occupied;
    voxels *voxels;
} voxel_job;

static inline int64_t floor_of(double x)
{
    const int64_t toward_zero = (int64_t)x;
    return toward_zero - ((double)toward_zero > x);
}

/* Voxels of a coordinate: two where hysteresis makes them differ. Both grow with the position. */
static inline void voxel_of(const voxel_job *job, int c, int64_t position, int64_t *lower,
                            int64_t *upper)
{
    if (c >= job->dimension) {
        *lower = *upper = 0;
    } else if (job->corners) {
        const double u = ((double)position - job->anchor[c]) / job->voxel;
        *lower = floor_of(u - job->hysteresis);
        *upper = floor_of(u + job->hysteresis);
    } else {
        *lower = *upper = floor_of((double)position * (1.0 / job->voxel));
    }
}

/* Voxels of a stretch, the corners above included. */
static void voxels_of(const void *data, int c, int64_t low, int64_t high, int64_t *first,
                      int64_t *last)
{
    const voxel_job *job = data;
    int64_t other;
    voxel_of(job, c, low, first, &other);
    voxel_of(job, c, high, &other, last);
    *last += job->corners && c < job->dimension;
}

/* One key for each point, or two. */
static void make_voxels(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const voxel_job *job = data;
    const size_t each = job->voxels->keys.count / job->points->count;
    for (size_t i = begin; i < end; i++) {
        int64_t lower[3], upper[3];
        for (int c = 0; c < 3; c++)
            voxel_of(job, c, job->points->position[c][i], &lower[c], &upper[c]);
        job->voxels->keys.key[i * each] = voxel_key(job->voxels, lower);
        if (each == 2)
            job->voxels->keys.key[i * each + 1] = voxel_key(job->voxels, upper);
    }
}

/* The corners of the voxels [begin, end). */
static void make_corners(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const voxel_job *job = data;
    const voxels *v = job->voxels;
    const uint64_t y = shifted(1, v->shift[1]), z = shifted(1, v->shift[2]);
    const size_t corners = (size_t)1 << job->dimension;
    for (size_t i = begin; i < end; i++)
        for (size_t k = 0; k < corners; k++)
            v->keys.key[i * corners + k] =
                job->occupied->key[i] + (k & 1) + (k >> 1 & 1) * y + (k >> 2 & 1) * z;
}

/* Sorted voxels without repeats, lent. errors: MEMORY. */
static ascc_status sort_voxels(voxels *v, const ascc_search_tools *tools, ascc_distinct *distinct)
{
    if (!ascc_keys_sort(&v->keys, tools->arena, tools->workers, v->shift[3]) ||
        !ascc_keys_distinct(&v->keys, tools->arena, tools->workers, ascc_arena_lend, distinct))
        return no_memory(tools);
    return ASCC_OK;
}

/* Voxels must be numbers of 64 bits, and their corners positions. */
static ascc_status check_voxel(const voxel_job *job, const ascc_search_tools *tools,
                               const ascc_extent *extent)
{
    bool good = job->voxel <= LARGEST_VOXEL;
    for (int c = 0; c < job->dimension && job->points->count; c++)
        good = good &&
               fabs((double)extent->box[c].low - job->anchor[c]) / job->voxel < MOST_VOXELS &&
               fabs((double)extent->box[c].high - job->anchor[c]) / job->voxel < MOST_VOXELS;
    return good ? ASCC_OK
                : ascc_fail(tools->message, ASCC_ERROR_RANGE,
                            "voxels of %g units are too small or too large for these points",
                            job->voxel);
}

static ascc_status occupied_voxels(const voxel_job *job, const ascc_search_tools *tools,
                                   ascc_distinct *distinct)
{
    voxels *v = job->voxels;
    const size_t each = job->corners && job->hysteresis != 0.0 ? 2 : 1;
    ascc_extent extent = ascc_extent_of(job->points, tools->workers);
    ascc_status status = check_voxel(job, tools, &extent);
    if (status == ASCC_OK)
        status = ascc_extent_number(v->axis, v->shift, tools, &extent, voxels_of, job, 0);
    if (status == ASCC_OK)
        status = lend_voxels(v, tools, job->points->count, each);
    if (status != ASCC_OK)
        return status;
    ascc_workers_run(tools->workers, job->points->count, 4096, make_voxels, (void *)job);
    return sort_voxels(v, tools, distinct);
}

static ascc_status corners_of(voxel_job *job, const ascc_search_tools *tools,
                              const ascc_distinct *occupied, ascc_distinct *distinct)
{
    job->occupied = occupied;
    const ascc_status status =
        lend_voxels(job->voxels, tools, occupied->count, (size_t)1 << job->dimension);
    if (status != ASCC_OK)
        return status;
    ascc_workers_run(tools->workers, occupied->count, 1024, make_corners, job);
    return sort_voxels(job->voxels, tools, distinct);
}

/* ---- From voxels to points ---- */

typedef struct place_job {
    const voxel_job *from;
    const ascc_distinct *list;
    ascc_points *samples;
} place_job;

/* Points at (voxel + offset) * edge + anchor; z stays 0 in 2D. */
static void place(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const place_job *job = data;
    const voxel_job *from = job->from;
    const voxels *v = from->voxels;
    const double offset = from->corners ? 0.0 : 0.5;
    for (size_t i = begin; i < end; i++) {
        int64_t at[3] = {0};
        for (int c = 0; c < from->dimension; c++) {
            const int64_t cell = ascc_axis_coordinate(
                &v->axis[c], field(job->list->key[i], v->shift[c], v->shift[c + 1]));
            at[c] = (int64_t)rint(((double)cell + offset) * from->voxel + from->anchor[c]);
        }
        ascc_points_set(job->samples, i, at);
    }
}

static ascc_status sample(voxel_job *job, const ascc_search_tools *tools, ascc_points *samples)
{
    const ascc_arena_mark mark = ascc_arena_mark_of(tools->arena);
    voxels v;
    ascc_distinct occupied, corners;
    job->voxels = &v;
    ascc_status status = occupied_voxels(job, tools, &occupied);
    if (status == ASCC_OK && job->corners)
        status = corners_of(job, tools, &occupied, &corners);
    if (status != ASCC_OK)
        return status;
    place_job to = {job, job->corners ? &corners : &occupied, samples};
    if (!ascc_points_take(samples, tools->arena, to.list->count))
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for %zu coarse points",
                         to.list->count);
    ascc_workers_run(tools->workers, to.list->count, 1024, place, &to);
    ascc_arena_return(tools->arena, mark);
    return ASCC_OK;
}

ascc_status ascc_sample_centers(ascc_points *samples, const ascc_search_tools *tools,
                                const ascc_points *points, int32_t dimension, double voxel)
{
    voxel_job job = {.points = points, .dimension = dimension, .voxel = voxel};
    return sample(&job, tools, samples);
}

ascc_status ascc_sample_corners(ascc_points *samples, const ascc_search_tools *tools,
                                const ascc_points *points, int32_t dimension, double voxel,
                                double hysteresis, const double anchor[3])
{
    voxel_job job = {.points = points,
                     .dimension = dimension,
                     .voxel = voxel,
                     .hysteresis = hysteresis,
                     .anchor = {anchor[0], anchor[1], anchor[2]},
                     .corners = true};
    return sample(&job, tools, samples);
}

ascc_status ascc_sample_farthest(ascc_points *samples, const ascc_search_tools *tools,
                                 const ascc_points *points, size_t count)
{
    const size_t n = points->count;
    count = ascc_min_size(count, n);
    const ascc_arena_mark mark = ascc_arena_mark_of(tools->arena);
    double *nearest = ascc_arena_lend(tools->arena, n, sizeof *nearest);
    uint8_t *chosen = ascc_arena_lend(tools->arena, n, sizeof *chosen);
    if (!nearest || !chosen || !ascc_points_take(samples, tools->arena, count))
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for %zu farthest points",
                         count);
    for (size_t i = 0; i < n; i++) {
        nearest[i] = INFINITY;
        chosen[i] = 0;
    }
    size_t last = 0;
    for (size_t k = 0; k < count; k++) {
        chosen[last] = 1;
        size_t farthest = last;
        double best = -1.0;
        for (size_t i = 0; i < n; i++) {
            double d = 0.0;
            for (int c = 0; c < 3; c++) {
                const double e = (double)(points->position[c][i] - points->position[c][last]);
                d += e * e;
            }
            if (d < nearest[i])
                nearest[i] = d;
            if (!chosen[i] && nearest[i] > best) {
                best = nearest[i];
                farthest = i;
            }
        }
        last = farthest;
    }
    size_t kept = 0;
    for (size_t i = 0; i < n; i++)
        if (chosen[i]) {
            const int64_t at[3] = {points->position[0][i], points->position[1][i],
                                   points->position[2][i]};
            ascc_points_set(samples, kept++, at);
        }
    samples->count = kept;
    ascc_arena_return(tools->arena, mark);
    return ASCC_OK;
}
