/* Solids of reference scenes: distance to them, and wall particles in layers behind their surface.
 * SPDX-License-Identifier: MIT */
#include "solids.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846

/* Outside distance of a box from the point `local` in its own axes; the direction away from it. */
static double box_distance(const double local[3], const double half[3], int32_t d, double out[3])
{
    double excess[3] = {0}, square = 0.0;
    int nearest = 0;
    for (int c = 0; c < d; c++) {
        excess[c] = fabs(local[c]) - half[c];
        if (excess[c] > 0.0)
            square += excess[c] * excess[c];
        if (excess[c] > excess[nearest])
            nearest = c;
        out[c] = 0.0;
    }
    if (square == 0.0) {
        out[nearest] = local[nearest] < 0.0 ? -1.0 : 1.0;
        return excess[nearest];
    }
    const double length = sqrt(square);
    for (int c = 0; c < d; c++)
        out[c] = excess[c] > 0.0 ? copysign(excess[c] / length, local[c]) : 0.0;
    return length;
}

static void turn(double v[3], double angle)
{
    const double x = v[0], y = v[1];
    v[0] = cos(angle) * x - sin(angle) * y;
    v[1] = sin(angle) * x + cos(angle) * y;
}

static double distance_of(const solid *s, int32_t d, const double point[3], double normal[3])
{
    double local[3] = {0};
    for (int c = 0; c < d; c++)
        local[c] = point[c] - s->center[c];
    if (s->kind == SOLID_BALL) {
        double square = 0.0;
        for (int c = 0; c < d; c++)
            square += local[c] * local[c];
        const double length = sqrt(square);
        for (int c = 0; c < d; c++)
            normal[c] = length > 0.0 ? local[c] / length : (c == 0 ? 1.0 : 0.0);
        return length - s->radius;
    }
    if (d == 2)
        turn(local, -s->angle);
    const double distance = box_distance(local, s->half, d, normal);
    if (d == 2)
        turn(normal, s->angle);
    const double sign = s->kind == SOLID_ROOM ? -1.0 : 1.0;
    for (int c = 0; c < d; c++)
        normal[c] *= sign;
    return sign * distance;
}

double solids_distance(const solid *solids, size_t count, int32_t dimension, const double point[3],
                       double normal[3])
{
    double nearest = INFINITY;
    for (size_t i = 0; i < count; i++) {
        double direction[3] = {0};
        const double distance = distance_of(&solids[i], dimension, point, direction);
        if (distance < nearest) {
            nearest = distance;
            memcpy(normal, direction, sizeof direction);
        }
    }
    return nearest;
}

/* ---- Wall particles ---- */

static bool add_point(wall_points *w, int32_t d, const double position[3], const double normal[3])
{
    if (w->count == w->capacity) {
        const size_t capacity = 2 * w->capacity + 256, size = capacity * (size_t)d * sizeof(double);
        double *positions = realloc(w->position, size);
        if (positions)
            w->position = positions;
        double *normals = realloc(w->normal, size);
        if (normals)
            w->normal = normals;
        if (!positions || !normals)
            return false;
        w->capacity = capacity;
    }
    memcpy(w->position + w->count * (size_t)d, position, (size_t)d * sizeof(double));
    memcpy(w->normal + w->count * (size_t)d, normal, (size_t)d * sizeof(double));
    w->count++;
    return true;
}

/* A rectangle's outline, points at its corners and evenly between them. */
static bool add_outline(const solid *s, double offset, double spacing, wall_points *w)
{
    const double hx = s->half[0] + offset, hy = s->half[1] + offset;
    if (hx < 0.0 || hy < 0.0)
        return true;
    const double corner[5][2] = {{-hx, -hy}, {hx, -hy}, {hx, hy}, {-hx, hy}, {-hx, -hy}};
    const bool point_like = hx < 1e-9 || hy < 1e-9;
    for (int side = 0; side < (point_like ? 1 : 4); side++) {
        const int next = point_like ? 2 : side + 1; /* a line is walked once, its end included */
        const double dx = corner[next][0] - corner[side][0], dy = corner[next][1] - corner[side][1];
        const int n = (int)fmax(1.0, rint(hypot(dx, dy) / spacing));
        for (int k = 0; k < n + point_like; k++) {
            double at[3] = {corner[side][0] + dx * k / n, corner[side][1] + dy * k / n, 0.0};
            double normal[3] = {0};
            turn(at, s->angle);
            at[0] += s->center[0];
            at[1] += s->center[1];
            (void)distance_of(s, 2, at, normal);
            if (!add_point(w, 2, at, normal))
                return false;
        }
    }
    return true;
}

static bool add_circle(const solid *s, double offset, double spacing, wall_points *w)
{
    const double radius = s->radius + offset;
    if (radius < 0.0)
        return true;
    const int n = (int)fmax(1.0, rint(2.0 * PI * radius / spacing));
    for (int k = 0; k < n; k++) {
        const double angle = 2.0 * PI * k / n;
        const double normal[3] = {cos(angle), sin(angle), 0.0};
        const double at[3] = {s->center[0] + radius * normal[0], s->center[1] + radius * normal[1],
                              0.0};
        if (!add_point(w, 2, at, normal))
            return false;
    }
    return true;
}

static bool sample_flat(const solid *solids, size_t count, double spacing, int32_t layer,
                        wall_points *w)
{
    const double depth = (layer + 0.5) * spacing;
    bool good = true;
    for (size_t i = 0; i < count && good; i++) {
        const solid *s = &solids[i];
        if (s->kind == SOLID_BALL)
            good = add_circle(s, -depth, spacing, w);
        else
            good = add_outline(s, s->kind == SOLID_ROOM ? depth : -depth, spacing, w);
    }
    return good;
}

/* Lattice cells whose centre lies behind the surface at this layer's depth. */
static bool sample_lattice(const solid *solids, size_t count, double spacing, int32_t layer,
                           wall_points *w)
{
    const solid *room = &solids[0]; /* bounds the rest, or is the only one */
    const double margin = (room->kind == SOLID_ROOM ? layer + 1 : 0) * spacing;
    int64_t low[3], high[3];
    for (int c = 0; c < 3; c++) {
        const double half = room->kind == SOLID_BALL ? room->radius : room->half[c];
        low[c] = (int64_t)floor((room->center[c] - half - margin) / spacing + 0.5 - 1e-6);
        high[c] = (int64_t)ceil((room->center[c] + half + margin) / spacing - 0.5 + 1e-6);
    }
    for (int64_t z = low[2]; z <= high[2]; z++)
        for (int64_t y = low[1]; y <= high[1]; y++)
            for (int64_t x = low[0]; x <= high[0]; x++) {
                const double at[3] = {((double)x + 0.5) * spacing, ((double)y + 0.5) * spacing,
                                      ((double)z + 0.5) * spacing};
                double normal[3] = {0};
                const double depth = -solids_distance(solids, count, 3, at, normal) / spacing;
                const bool here = depth > layer && depth <= layer + 1.0;
                if (here && !add_point(w, 3, at, normal))
                    return false;
            }
    return true;
}

bool solids_sample(const solid *solids, size_t count, int32_t dimension, double spacing,
                   int32_t layers, wall_points *walls)
{
    walls->layers = layers;
    for (int32_t layer = 0; layer < layers; layer++) {
        const size_t before = walls->count;
        const bool good = dimension == 2 ? sample_flat(solids, count, spacing, layer, walls)
                                         : sample_lattice(solids, count, spacing, layer, walls);
        if (!good)
            return false;
        walls->layer_count[layer] = walls->count - before;
    }
    return true;
}

/* ---- Points on surfaces ---- */

/* Adds a point of solid `own` unless another solid covers it. */
static bool add_bare(const solid *solids, size_t count, size_t own, const double at[3],
                     const double normal[3], wall_points *w)
{
    double away[3];
    const double before = solids_distance(solids, own, 3, at, away);
    const double behind = solids_distance(solids + own + 1, count - own - 1, 3, at, away);
    return fmin(before, behind) < 1e-6 || add_point(w, 3, at, normal);
}

static bool add_faces(const solid *solids, size_t count, size_t own, double spacing, wall_points *w)
{
    const solid *s = &solids[own];
    const double way = s->kind == SOLID_ROOM ? -1.0 : 1.0;
    for (int face = 0; face < 6; face++) {
        const int a = face % 3, b = (a + 1) % 3, c = (a + 2) % 3;
        const double sign = face < 3 ? -1.0 : 1.0;
        const int nb = (int)fmax(1.0, ceil(2.0 * s->half[b] / spacing - 1e-6)),
                  nc = (int)fmax(1.0, ceil(2.0 * s->half[c] / spacing - 1e-6));
        for (int k = 0; k < nb * nc; k++) {
            double at[3], normal[3] = {0};
            normal[a] = way * sign;
            at[a] = s->center[a] + sign * s->half[a];
            at[b] = s->center[b] + s->half[b] * (2.0 * (k % nb + 0.5) / nb - 1.0);
            at[c] = s->center[c] + s->half[c] * (2.0 * (k / nb + 0.5) / nc - 1.0);
            if (!add_bare(solids, count, own, at, normal, w))
                return false;
        }
    }
    return true;
}

static bool add_sphere(const solid *solids, size_t count, size_t own, double spacing,
                       wall_points *w)
{
    const solid *s = &solids[own];
    const double golden = PI * (3.0 - sqrt(5.0));
    const int n = (int)fmax(1.0, rint(4.0 * PI * s->radius * s->radius / (spacing * spacing)));
    for (int k = 0; k < n; k++) {
        const double z = 1.0 - 2.0 * (k + 0.5) / n, across = sqrt(1.0 - z * z);
        const double normal[3] = {across * cos(golden * k), across * sin(golden * k), z};
        double at[3];
        for (int c = 0; c < 3; c++)
            at[c] = s->center[c] + s->radius * normal[c];
        if (!add_bare(solids, count, own, at, normal, w))
            return false;
    }
    return true;
}

bool solids_sample_faces(const solid *solids, size_t count, double spacing, wall_points *walls)
{
    bool good = true;
    for (size_t i = 0; i < count && good; i++)
        good = solids[i].kind == SOLID_BALL ? add_sphere(solids, count, i, spacing, walls)
                                            : add_faces(solids, count, i, spacing, walls);
    walls->layers = 1;
    walls->layer_count[0] = walls->count;
    return good;
}

void wall_points_free(wall_points *walls)
{
    free(walls->position);
    free(walls->normal);
    *walls = (wall_points){0};
}
