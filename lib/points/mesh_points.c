/* Points on a mesh of triangles, or of lines in 2D, evenly whatever the size of its faces.
 * SPDX-License-Identifier: MIT
 *
 * Each face gives candidates half a pitch apart, in its own order; one is taken unless a point taken before it lies
 * nearer than three quarters of the pitch and looks the same way. What is left is nowhere farther than that from a
 * candidate, so that there are no holes, and a fine mesh has no more points than a coarse one.
 */
#include <math.h>
#include <string.h>

#include "blocks.h"
#include "fields.h"
#include "particles.h"
#include "shapes.h"

#define CANDIDATES 0.5 /* pitches from one to the next */
#define NEAREST 0.75   /* pitches between points */
#define SAME_WAY 0.5   /* the cosine between normals */
#define BUCKETS ((size_t)1 << 16)
#define NONE SIZE_MAX

/* Points taken so far, by the cell they lie in; cells of one bucket share a list. */
typedef struct taken {
    ascc_surface *surface;
    size_t first, next_capacity;
    size_t *bucket, *next;
    double cell;
} taken;

static size_t bucket_of(const int64_t cell[3])
{
    uint64_t hash = 0;
    for (int c = 0; c < 3; c++)
        hash = (hash ^ (uint64_t)cell[c]) * UINT64_C(0x9e3779b97f4a7c15);
    return (size_t)(hash >> 48);
}

static bool is_near(const taken *points, size_t other, const double position[3],
                    const double normal[3])
{
    const size_t d = points->surface->dimension;
    double square = 0, along = 0;
    for (size_t c = 0; c < d; c++) {
        const double by = points->surface->position[other * d + c] - position[c];
        square += by * by;
        along += points->surface->normal[other * d + c] * normal[c];
    }
    return square < points->cell * points->cell && along > SAME_WAY;
}

/* Whether a point that was taken stands in the way, looking through the cells around. */
static bool is_crowded(const taken *points, const double position[3], const double normal[3])
{
    const int64_t deep = points->surface->dimension == 3 ? 1 : 0;
    int64_t cell[3];
    ascc_block_of(position, (int32_t)points->surface->dimension, points->cell, cell);
    for (int64_t z = -deep; z <= deep; z++)
        for (int64_t y = -1; y <= 1; y++)
            for (int64_t x = -1; x <= 1; x++) {
                const int64_t at[3] = {cell[0] + x, cell[1] + y, cell[2] + z};
                for (size_t i = points->bucket[bucket_of(at)]; i != NONE; i = points->next[i])
                    if (is_near(points, points->first + i, position, normal))
                        return true;
            }
    return false;
}

static bool take(taken *points, const double position[3], const double normal[3])
{
    const size_t i = points->surface->count - points->first;
    if (is_crowded(points, position, normal))
        return true;
    if (!ascc_grow(points->surface->allocator, (void **)&points->next, &points->next_capacity,
                   i + 1, sizeof *points->next) ||
        !ascc_surface_add(points->surface, position, normal))
        return false;
    int64_t cell[3];
    ascc_block_of(position, (int32_t)points->surface->dimension, points->cell, cell);
    const size_t bucket = bucket_of(cell);
    points->next[i] = points->bucket[bucket];
    points->bucket[bucket] = i;
    return true;
}

/* ---- Faces ----------------------------------------------------------------------------------- */

typedef struct face {
    double corner[3][3], normal[3];
    double longest; /* edge; 0 = no area */
} face;

static double length_of(const double v[3])
{
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

static void measure(face *f, size_t d)
{
    double along[2][3] = {{0}}, third[3];
    for (size_t k = 1; k < d; k++)
        for (size_t c = 0; c < 3; c++)
            along[k - 1][c] = f->corner[k][c] - f->corner[0][c];
    for (size_t c = 0; c < 3; c++)
        third[c] = along[1][c] - along[0][c];
    f->longest = length_of(along[0]);
    if (d == 2) {
        f->normal[0] = along[0][1];
        f->normal[1] = -along[0][0];
        f->normal[2] = 0;
    } else {
        for (size_t c = 0; c < 3; c++)
            f->normal[c] = along[0][(c + 1) % 3] * along[1][(c + 2) % 3] -
                           along[0][(c + 2) % 3] * along[1][(c + 1) % 3];
        f->longest = fmax(f->longest, fmax(length_of(along[1]), length_of(third)));
    }
    const double size = length_of(f->normal);
    if (!(size > 0) || !isfinite(1 / size) || (d == 3 && size < 1e-12 * f->longest * f->longest))
        f->longest = 0;
    for (size_t c = 0; c < 3 && f->longest > 0; c++)
        f->normal[c] /= size;
}

static bool take_at(taken *points, const face *f, double u, double v)
{
    double at[3];
    for (size_t c = 0; c < 3; c++)
        at[c] = f->corner[0][c] + u * (f->corner[1][c] - f->corner[0][c]) +
                v * (f->corner[2][c] - f->corner[0][c]);
    return take(points, at, f->normal);
}

/* The middles of n lines, or of n^2 triangles like the face itself. */
static bool take_face(taken *points, const face *f, double pitch)
{
    const size_t n = (size_t)fmax(1, ceil(f->longest / (CANDIDATES * pitch)));
    const double part = 1 / (double)n;
    bool room = true;
    if (points->surface->dimension == 2) {
        for (size_t i = 0; i < n && room; i++)
            room = take_at(points, f, part * ((double)i + 0.5), 0);
        return room;
    }
    for (size_t j = 0; j < n; j++)
        for (size_t i = 0; i + j < n && room; i++) {
            const double u = (double)i, v = (double)j;
            room = take_at(points, f, part * (u + 1.0 / 3), part * (v + 1.0 / 3));
            if (room && i + j + 1 < n)
                room = take_at(points, f, part * (u + 2.0 / 3), part * (v + 2.0 / 3));
        }
    return room;
}

static ascc_status read_face(face *f, const ascc_host_array *corners, const ascc_shape *shape,
                             size_t row, size_t d, ascc_message *message)
{
    memset(f, 0, sizeof *f);
    for (size_t k = 0; k < d; k++) {
        const int32_t corner = shape->faces[row * d + k];
        if (corner < 0 || (size_t)corner >= shape->count)
            return ascc_fail(message, ASCC_ERROR_ARGUMENT,
                             "shape.faces: row %zu has corner %ld of %zu", row, (long)corner,
                             shape->count);
        for (int32_t c = 0; c < (int32_t)d; c++)
            f->corner[k][c] = ascc_host_array_read(corners, (size_t)corner, c);
    }
    measure(f, d);
    return ASCC_OK;
}

/* Whether corners are numbers, and faces not so large that their candidates are too many. */
static ascc_status check_faces(const ascc_shape *shape, const ascc_host_array *corners, size_t d,
                               double pitch, ascc_message *message)
{
    double candidates = 0;
    for (size_t row = 0; row < shape->count; row++)
        for (int32_t c = 0; c < (int32_t)d; c++) {
            const double value = ascc_host_array_read(corners, row, c);
            if (!isfinite(value) || fabs(value) > ASCC_POSITION_LIMIT * pitch)
                return ascc_fail_number(message,
                                        isfinite(value) ? ASCC_ERROR_RANGE : ASCC_ERROR_NOT_FINITE,
                                        "shape.position", row, c, value,
                                        isfinite(value) ? ", beyond 2^40 pitches" : "");
        }
    for (size_t row = 0; row < shape->face_count; row++) {
        face f;
        const ascc_status status = read_face(&f, corners, shape, row, d, message);
        if (status != ASCC_OK)
            return status;
        const double n = ceil(f.longest / (CANDIDATES * pitch));
        candidates += d == 3 ? n * n : n;
        if (candidates >= 4.0 * (double)ASCC_BODY_POINTS)
            return ascc_fail(message, ASCC_ERROR_RANGE,
                             "shape.faces: those up to row %zu have over 2^26 points", row);
    }
    return ASCC_OK;
}

static ascc_status take_faces(taken *points, const ascc_host_array *corners,
                              const ascc_shape *shape, double pitch, ascc_message *message)
{
    for (size_t row = 0; row < shape->face_count; row++) {
        face f;
        const ascc_status status =
            read_face(&f, corners, shape, row, points->surface->dimension, message);
        if (status != ASCC_OK)
            return status;
        if (f.longest > 0 && !take_face(points, &f, pitch))
            return ascc_fail(message, ASCC_ERROR_MEMORY, "out of memory for a body");
    }
    return ASCC_OK;
}

ascc_status ascc_mesh_sample(ascc_surface *surface, const ascc_shape *shape, double pitch,
                             ascc_message *message)
{
    const size_t d = surface->dimension;
    ascc_host_array corners;
    ascc_status status =
        ascc_host_array_open("shape.position", shape->position, (int32_t)d, &corners, message);
    if (status == ASCC_OK && (shape->faces == NULL || shape->face_count == 0))
        status = ascc_fail(message, ASCC_ERROR_ARGUMENT, "shape: a mesh without faces");
    if (status == ASCC_OK)
        status = check_faces(shape, &corners, d, pitch, message);
    if (status != ASCC_OK)
        return status;
    taken points = {.surface = surface, .first = surface->count, .cell = NEAREST * pitch};
    points.bucket = ascc_allocate(surface->allocator, BUCKETS, sizeof *points.bucket);
    if (points.bucket == NULL)
        return ascc_fail(message, ASCC_ERROR_MEMORY, "out of memory for a body");
    for (size_t i = 0; i < BUCKETS; i++)
        points.bucket[i] = NONE;
    status = take_faces(&points, &corners, shape, pitch, message);
    ascc_release(surface->allocator, points.bucket, BUCKETS, sizeof *points.bucket);
    ascc_release(surface->allocator, points.next, points.next_capacity, sizeof *points.next);
    return status;
}
