/* Akinci volumes of wall points. SPDX-License-Identifier: MIT */
#include "wall_volumes.h"

#include <math.h>
#include <string.h>

#define MAX_NEIGHBORS 65536

/* A normal looks so far before the point it belongs to, in supports. */
#define AHEAD 0.01
#define OPPOSITE (-0.99)

/* Walls' positions and normals, [count][dimension]: all, or those of some rows. */
typedef struct places {
    const double *at, *normal;
    size_t count, d;
    const uint32_t *row;   /* the host's rows; NULL: row i is the host's */
    const uint8_t *wanted; /* whose volumes are asked for; NULL: all */
} places;

static size_t host_row(const places *p, size_t i)
{
    return p->row ? p->row[i] : i;
}

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
    const uint32_t *order; /* the place of a point */
    float *volume;         /* of the host's rows */
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
        if (rows->count[i] == ASCC_ROW_ABSENT)
            continue;
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
        /* itself is 1 */
        job->volume[host_row(job->places, job->order[i])] = (float)(1.0 / sum);
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
                                 host_row(p, i));
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
    uint8_t *wanted = p->wanted ? ascc_arena_take(tools->arena, p->count, 1) : NULL;
    if (!order || !sheet || (p->wanted && !wanted))
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for %zu walls", p->count);
    ascc_status status = sort_walls(tools, p, &scale, rows.radius, &points, order, &extent);
    if (status == ASCC_OK)
        status = ascc_grid_build(&grid, tools, &points, &extent, rows.radius, true);
    if (status == ASCC_OK)
        status = ascc_rows_open(&rows, tools, 0);
    for (size_t i = 0; status == ASCC_OK && wanted && i < p->count; i++)
        wanted[i] = p->wanted[order[i]];
    if (status == ASCC_OK)
        status = ascc_rows_make(&rows, tools, wanted);
    volumes_job job = {&rows, p, sheet, order, volume};
    if (status == ASCC_OK)
        mark_sheets(p, &points, order, sheet);
    if (status == ASCC_OK)
        ascc_workers_run(tools->workers, p->count, 1024, find_volumes, &job);
    return status;
}

/* ---- Of some walls ---------------------------------------------------------------------------- */

/* Supports that what a point adds to may be away from it, in coordinates that are rounded. */
#define REACH 1.01

/* The box around points that have changed, where they were and where they are. */
typedef struct change {
    const places *now;
    const ascc_wall_volumes *before;
    double low[3], high[3];
} change;

static bool has_changed(const change *c, size_t i)
{
    const size_t d = c->now->d, bytes = d * sizeof(double);
    return memcmp(c->before->position + i * d, c->now->at + i * d, bytes) != 0 ||
           memcmp(c->before->normal + i * d, c->now->normal + i * d, bytes) != 0;
}

static void find_changes(change *c)
{
    const size_t d = c->now->d;
    for (size_t k = 0; k < d; k++) {
        c->low[k] = (double)INFINITY;
        c->high[k] = -(double)INFINITY;
    }
    for (size_t i = 0; i < c->now->count; i++) {
        if (!has_changed(c, i))
            continue;
        for (size_t k = 0; k < d; k++) {
            const double was = c->before->position[i * d + k], is = c->now->at[i * d + k];
            c->low[k] = fmin(c->low[k], fmin(was, is));
            c->high[k] = fmax(c->high[k], fmax(was, is));
        }
    }
}

static bool is_around(const change *c, size_t i, double margin)
{
    const size_t d = c->now->d;
    const double *at = c->now->at + i * d;
    bool in = true;
    for (size_t k = 0; k < d; k++)
        in &= at[k] >= c->low[k] - margin && at[k] <= c->high[k] + margin;
    return in;
}

/* Volumes of points within a support of the box, for which those within two are looked at: in the host's order, so
 * that cells and sums are those that all rows would give. */
static ascc_status update_some(ascc_wall_volumes *walls, const ascc_search_tools *tools,
                               const places *p, double support)
{
    const size_t d = p->d;
    const double margin = REACH * support;
    change c = {.now = p, .before = walls};
    size_t near = 0, n = 0;
    find_changes(&c);
    for (size_t i = 0; i < p->count; i++)
        near += is_around(&c, i, 2.0 * margin);
    double *at = ascc_arena_take(tools->arena, near * d, sizeof *at);
    double *normal = ascc_arena_take(tools->arena, near * d, sizeof *normal);
    uint32_t *row = ascc_arena_take(tools->arena, near, sizeof *row);
    uint8_t *wanted = ascc_arena_take(tools->arena, near, 1);
    if (!at || !normal || !row || !wanted)
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for %zu walls", near);
    for (size_t i = 0; i < p->count; i++) {
        if (!is_around(&c, i, 2.0 * margin))
            continue;
        memcpy(at + n * d, p->at + i * d, d * sizeof *at);
        memcpy(normal + n * d, p->normal + i * d, d * sizeof *normal);
        row[n] = (uint32_t)i;
        wanted[n++] = is_around(&c, i, margin);
    }
    const places some = {at, normal, n, d, row, wanted};
    return make_volumes(walls->volume, tools, &some, support);
}

ascc_status ascc_wall_volumes_update(ascc_wall_volumes *walls, const ascc_search_tools *tools,
                                     const double *position, const double *normal, size_t count,
                                     int32_t dimension, double support)
{
    const places p = {.at = position, .normal = normal, .count = count, .d = (size_t)dimension};
    const size_t numbers = count * p.d;
    const bool others = walls->count != count || walls->support != support;
    if (count == 0 || are_known(walls, &p, support))
        return ASCC_OK;
    walls->count = 0; /* until all is well */
    if (!ascc_grow(walls->allocator, (void **)&walls->volume, &walls->volume_capacity, count,
                   sizeof *walls->volume) ||
        !ascc_grow(walls->allocator, (void **)&walls->position, &walls->position_capacity, numbers,
                   sizeof *walls->position) ||
        !ascc_grow(walls->allocator, (void **)&walls->normal, &walls->normal_capacity, numbers,
                   sizeof *walls->normal))
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for %zu walls", count);
    const ascc_status status = others ? make_volumes(walls->volume, tools, &p, support)
                                      : update_some(walls, tools, &p, support);
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
