/* Akinci volumes of wall points. SPDX-License-Identifier: MIT */
#include "wall_volumes.h"

#include <math.h>
#include <string.h>

#define MAX_NEIGHBORS 65536

/* A normal looks so far before the point it belongs to, in supports. */
#define AHEAD 0.01
#define OPPOSITE (-0.99)

/* The walls' positions and normals, [count][dimension]. */
typedef struct places {
    const double *at, *normal;
    size_t count, d;
} places;

static bool are_known(const ascc_wall_volumes *walls, const places *p, double support)
{
    return walls->count == p->count && walls->support == support &&
           memcmp(walls->position, p->at, p->count * p->d * sizeof *p->at) == 0 &&
           memcmp(walls->normal, p->normal, p->count * p->d * sizeof *p->normal) == 0;
}

/* The cubic spline of kernels.h's `spline`, of a squared distance in supports. */
static double spline_at(double square)
{
    const double q = sqrt(square), far = 1.0 - q, near = 0.5 - q;
    if (far <= 0.0)
        return 0.0;
    return 2.0 * far * far * far - (near > 0.0 ? 8.0 * near * near * near : 0.0);
}

typedef struct volumes_job {
    const ascc_rows *rows;
    const places *places;
    const uint8_t *sheet;  /* [point] 1: of a thin wall, hidden from behind */
    const uint32_t *order; /* host's row of a point */
    float *volume;
} volumes_job;

/* Is point j, d supports from i, a thin wall's that is seen from behind? */
static bool is_hidden(const volumes_job *job, size_t i, size_t j, const double d[3])
{
    const size_t width = job->places->d;
    const double *own = job->places->normal + job->order[i] * width;
    const double *other = job->places->normal + job->order[j] * width;
    double height = 0.0;
    for (size_t c = 0; job->sheet[j] && c < width; c++)
        height += (AHEAD * own[c] - d[c]) * other[c];
    return height < 0.0;
}

/* Points at one place with opposite normals. */
static void mark_sheets(const places *p, const ascc_points *points, const uint32_t *order,
                        uint8_t *sheet)
{
    memset(sheet, 0, p->count);
    for (size_t i = 1; i < p->count; i++)
        for (size_t j = i; j-- > 0 && points->position[0][i] == points->position[0][j] &&
                           points->position[1][i] == points->position[1][j] &&
                           points->position[2][i] == points->position[2][j];) {
            double cosine = 0.0;
            for (size_t c = 0; c < p->d; c++)
                cosine += p->normal[order[i] * p->d + c] * p->normal[order[j] * p->d + c];
            if (cosine < OPPOSITE)
                sheet[i] = sheet[j] = 1;
        }
}

static void find_volumes(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const volumes_job *job = data;
    const ascc_rows *rows = job->rows;
    const double inverse = 1.0 / rows->radius;
    for (size_t i = begin; i < end; i++) {
        double sum = 0.0;
        for (uint32_t k = 0; k < rows->count[i]; k++) {
            const uint32_t j = rows->neighbor[rows->start[i] + k];
            double square = 0.0, d[3];
            for (int c = 0; c < 3; c++) {
                d[c] = inverse * (double)(int32_t)((uint32_t)rows->source->low[c][j] -
                                                   (uint32_t)rows->query->low[c][i]);
                square += d[c] * d[c];
            }
            if (!is_hidden(job, i, j, d))
                sum += spline_at(square);
        }
        job->volume[job->order[i]] = (float)(1.0 / sum); /* itself is 1 */
    }
}

/* The walls as points in the order of cells, so that sums do not depend on the host's order. */
static ascc_status sort_walls(const ascc_search_tools *tools, const places *p,
                              const ascc_scale *scale, double radius, ascc_points *points,
                              uint32_t *order, ascc_extent *extent)
{
    const size_t d = p->d, count = p->count;
    ascc_points raw;
    if (!ascc_points_take(&raw, tools->arena, count) ||
        !ascc_points_take(points, tools->arena, count))
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for %zu walls", count);
    for (size_t i = 0; i < count; i++) {
        int64_t at[3] = {0};
        for (size_t c = 0; c < d; c++)
            if (!ascc_scale_apply(scale, p->at[i * d + c], &at[c]))
                return ascc_fail(tools->message, ASCC_ERROR_RANGE,
                                 "boundary row %zu is too far from the origin for the relaxation",
                                 i);
        ascc_points_set(&raw, i, at);
    }
    *extent = ascc_extent_of(&raw, tools->workers);
    const ascc_status status =
        ascc_points_order(tools, &raw, extent, ascc_grid_cell(radius), order);
    for (size_t i = 0; status == ASCC_OK && i < count; i++) {
        const int64_t at[3] = {raw.position[0][order[i]], raw.position[1][order[i]],
                               raw.position[2][order[i]]};
        ascc_points_set(points, i, at);
    }
    return status;
}

static ascc_status make_volumes(float *volume, const ascc_search_tools *tools, const places *p,
                                double support)
{
    const ascc_scale scale = ascc_scale_for_radius(support);
    ascc_points points;
    ascc_extent extent;
    ascc_grid grid;
    ascc_rows rows = {.query = &points,
                      .source = &points,
                      .query_grid = &grid,
                      .source_grid = &grid,
                      .radius = support * scale.inverse,
                      .same = true,
                      .max_neighbors = MAX_NEIGHBORS};
    uint32_t *order = ascc_arena_take(tools->arena, p->count, sizeof *order);
    uint8_t *sheet = ascc_arena_take(tools->arena, p->count, 1);
    if (!order || !sheet)
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for %zu walls", p->count);
    ascc_status status = sort_walls(tools, p, &scale, rows.radius, &points, order, &extent);
    if (status == ASCC_OK)
        status = ascc_grid_build(&grid, tools, &points, &extent, rows.radius, true);
    if (status == ASCC_OK)
        status = ascc_rows_open(&rows, tools, 0);
    if (status == ASCC_OK)
        status = ascc_rows_make(&rows, tools, NULL);
    volumes_job job = {&rows, p, sheet, order, volume};
    if (status == ASCC_OK)
        mark_sheets(p, &points, order, sheet);
    if (status == ASCC_OK)
        ascc_workers_run(tools->workers, p->count, 1024, find_volumes, &job);
    return status;
}

ascc_status ascc_wall_volumes_update(ascc_wall_volumes *walls, const ascc_search_tools *tools,
                                     const double *position, const double *normal, size_t count,
                                     int32_t dimension, double support)
{
    const places p = {position, normal, count, (size_t)dimension};
    const size_t numbers = count * p.d;
    if (count == 0 || are_known(walls, &p, support))
        return ASCC_OK;
    walls->count = 0;
    if (!ascc_grow(walls->allocator, (void **)&walls->volume, &walls->volume_capacity, count,
                   sizeof *walls->volume) ||
        !ascc_grow(walls->allocator, (void **)&walls->position, &walls->position_capacity, numbers,
                   sizeof *walls->position) ||
        !ascc_grow(walls->allocator, (void **)&walls->normal, &walls->normal_capacity, numbers,
                   sizeof *walls->normal))
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for %zu walls", count);
    const ascc_status status = make_volumes(walls->volume, tools, &p, support);
    if (status != ASCC_OK)
        return status;
    memcpy(walls->position, position, numbers * sizeof *walls->position);
    memcpy(walls->normal, normal, numbers * sizeof *walls->normal);
    walls->count = count;
    walls->support = support;
    return ASCC_OK;
}

void ascc_wall_volumes_close(ascc_wall_volumes *walls)
{
    if (!walls->allocator)
        return;
    ascc_release(walls->allocator, walls->volume, walls->volume_capacity, sizeof *walls->volume);
    ascc_release(walls->allocator, walls->position, walls->position_capacity,
                 sizeof *walls->position);
    ascc_release(walls->allocator, walls->normal, walls->normal_capacity, sizeof *walls->normal);
}
