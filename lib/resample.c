/* Voxelisation by sorting cell keys, and farthest point sampling. SPDX-License-Identifier: MIT */
#include "resample.h"

#include <math.h>
#include <string.h>

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

/* Integer cells and the box they span. */
typedef struct cells {
    size_t count;
    int64_t *at; /* [count][3] */
    int64_t low[3], high[3];
} cells;

static bool cells_take(cells *list, ascc_arena *arena, size_t count)
{
    list->count = 0;
    for (int c = 0; c < 3; c++) {
        list->low[c] = INT64_MAX;
        list->high[c] = INT64_MIN;
    }
    list->at = ascc_arena_take(arena, count * 3, sizeof *list->at);
    return list->at != NULL;
}

static void cells_add(cells *list, const int64_t at[3])
{
    for (int c = 0; c < 3; c++) {
        list->at[list->count * 3 + (size_t)c] = at[c];
        if (at[c] < list->low[c])
            list->low[c] = at[c];
        if (at[c] > list->high[c])
            list->high[c] = at[c];
    }
    list->count++;
}

static int width_of(const cells *list, int c)
{
    int bits = 0;
    for (uint64_t span = (uint64_t)(list->high[c] - list->low[c]); span; span >>= 1)
        bits++;
    return bits;
}

/* Sorts by z, y, x and drops repeated cells. */
static ascc_status cells_unique(cells *list, const ascc_search_tools *tools)
{
    if (!list->count)
        return ASCC_OK;
    const int shift_y = width_of(list, 0), shift_z = shift_y + width_of(list, 1);
    const int bits = shift_z + width_of(list, 2);
    if (bits > 64)
        return ascc_fail(tools->message, ASCC_ERROR_RANGE,
                         "the points span too many voxels to number them");
    uint64_t *key = ascc_arena_take(tools->arena, list->count, sizeof *key);
    uint64_t *spare = ascc_arena_take(tools->arena, list->count, sizeof *spare);
    if (!key || !spare)
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory to sort %zu voxels",
                         list->count);
    for (size_t i = 0; i < list->count; i++) {
        const int64_t *at = list->at + i * 3;
        key[i] = (uint64_t)(at[0] - list->low[0]);
        if (shift_y < 64)
            key[i] |= (uint64_t)(at[1] - list->low[1]) << shift_y;
        if (shift_z < 64)
            key[i] |= (uint64_t)(at[2] - list->low[2]) << shift_z;
    }
    uint32_t histogram[256];
    for (int shift = 0; shift < bits; shift += 8) {
        memset(histogram, 0, sizeof histogram);
        for (size_t i = 0; i < list->count; i++)
            histogram[key[i] >> shift & 255]++;
        uint32_t sum = 0;
        for (size_t d = 0; d < 256; d++) {
            const uint32_t n = histogram[d];
            histogram[d] = sum;
            sum += n;
        }
        for (size_t i = 0; i < list->count; i++)
            spare[histogram[key[i] >> shift & 255]++] = key[i];
        uint64_t *swap = key;
        key = spare;
        spare = swap;
    }
    const uint64_t mask_x = shift_y ? UINT64_MAX >> (64 - shift_y) : 0;
    const int width_y = shift_z - shift_y;
    const uint64_t mask_y = width_y ? UINT64_MAX >> (64 - width_y) : 0;
    size_t kept = 0;
    for (size_t i = 0; i < list->count; i++) {
        if (i && key[i] == key[i - 1])
            continue;
        int64_t *at = list->at + 3 * kept++;
        at[0] = list->low[0] + (int64_t)(key[i] & mask_x);
        at[1] = list->low[1] + (int64_t)(shift_y < 64 ? key[i] >> shift_y & mask_y : 0);
        at[2] = list->low[2] + (int64_t)(shift_z < 64 ? key[i] >> shift_z : 0);
    }
    list->count = kept;
    return ASCC_OK;
}

/* Points at (cell + offset) * voxel + anchor; z stays 0 in 2D. */
static ascc_status place(ascc_points *samples, const ascc_search_tools *tools, const cells *list,
                         int32_t dimension, double voxel, double offset, const double anchor[3])
{
    if (!ascc_points_take(samples, tools->arena, list->count))
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for %zu coarse points",
                         list->count);
    for (size_t i = 0; i < list->count; i++) {
        int64_t at[3] = {0};
        for (int c = 0; c < dimension; c++)
            at[c] =
                (int64_t)rint(((double)list->at[i * 3 + (size_t)c] + offset) * voxel + anchor[c]);
        ascc_points_set(samples, i, at);
    }
    return ASCC_OK;
}

ascc_status ascc_sample_centers(ascc_points *samples, const ascc_search_tools *tools,
                                const ascc_points *points, int32_t dimension, double voxel)
{
    cells list;
    if (!cells_take(&list, tools->arena, points->count))
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for voxels");
    const double inverse = 1.0 / voxel;
    for (size_t i = 0; i < points->count; i++) {
        int64_t at[3] = {0};
        for (int c = 0; c < dimension; c++)
            at[c] = (int64_t)floor((double)points->position[c][i] * inverse);
        cells_add(&list, at);
    }
    const ascc_status status = cells_unique(&list, tools);
    if (status != ASCC_OK)
        return status;
    const double origin[3] = {0.0, 0.0, 0.0};
    return place(samples, tools, &list, dimension, voxel, 0.5, origin);
}

ascc_status ascc_sample_corners(ascc_points *samples, const ascc_search_tools *tools,
                                const ascc_points *points, int32_t dimension, double voxel,
                                double hysteresis, const double anchor[3])
{
    cells list, nodes;
    if (!cells_take(&list, tools->arena, points->count * 2))
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for voxels");
    for (size_t i = 0; i < points->count; i++) {
        int64_t lower[3] = {0}, upper[3] = {0};
        bool differ = false;
        for (int c = 0; c < dimension; c++) {
            const double u = ((double)points->position[c][i] - anchor[c]) / voxel;
            lower[c] = (int64_t)floor(u - hysteresis);
            upper[c] = (int64_t)floor(u + hysteresis);
            differ |= lower[c] != upper[c];
        }
        cells_add(&list, lower);
        if (differ)
            cells_add(&list, upper);
    }
    ascc_status status = cells_unique(&list, tools);
    if (status != ASCC_OK)
        return status;
    const int corners = 1 << dimension;
    if (!cells_take(&nodes, tools->arena, list.count * (size_t)corners))
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for voxels");
    for (size_t i = 0; i < list.count; i++)
        for (int k = 0; k < corners; k++) {
            const int64_t *cell = list.at + i * 3;
            const int64_t node[3] = {cell[0] + (k & 1), cell[1] + (k >> 1 & 1),
                                     cell[2] + (k >> 2 & 1)};
            cells_add(&nodes, node);
        }
    status = cells_unique(&nodes, tools);
    if (status != ASCC_OK)
        return status;
    return place(samples, tools, &nodes, dimension, voxel, 0.0, anchor);
}

ascc_status ascc_sample_farthest(ascc_points *samples, const ascc_search_tools *tools,
                                 const ascc_points *points, size_t count)
{
    const size_t n = points->count;
    count = ascc_min_size(count, n);
    double *nearest = ascc_arena_take(tools->arena, n, sizeof *nearest);
    uint8_t *chosen = ascc_arena_take(tools->arena, n, sizeof *chosen);
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
    return ASCC_OK;
}
