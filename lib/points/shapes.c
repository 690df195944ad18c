/* Planes, boxes and surfaces of revolution as points with normals. SPDX-License-Identifier: MIT
 *
 * A piece of a surface is cut into cells no wider than the pitch, each with its point in the middle, so that edges
 * have points half a cell away on both sides and none on them.
 */
#include "shapes.h"

#include <math.h>
#include <string.h>

#include "fields.h"
#include "particles.h"
#include "rotation.h"

#define DEFAULT_PITCH 0.64 /* spacings: what the shipped networks were trained with */

#define PI 3.14159265358979323846
#define GOLDEN_ANGLE 2.39996322972865332

/* ---- The points so far ----------------------------------------------------------------------- */

void ascc_surface_open(ascc_surface *surface, const ascc_allocator *allocator, int32_t dimension)
{
    *surface = (ascc_surface){.allocator = allocator, .dimension = (size_t)dimension};
}

void ascc_surface_close(ascc_surface *surface)
{
    ascc_release(surface->allocator, surface->position, surface->position_capacity, sizeof(double));
    ascc_release(surface->allocator, surface->normal, surface->normal_capacity, sizeof(double));
}

bool ascc_surface_add(ascc_surface *surface, const double position[3], const double normal[3])
{
    const size_t d = surface->dimension, numbers = (surface->count + 1) * d;
    if (!ascc_grow(surface->allocator, (void **)&surface->position, &surface->position_capacity,
                   numbers, sizeof(double)) ||
        !ascc_grow(surface->allocator, (void **)&surface->normal, &surface->normal_capacity,
                   numbers, sizeof(double)))
        return false;
    memcpy(surface->position + surface->count * d, position, d * sizeof(double));
    memcpy(surface->normal + surface->count * d, normal, d * sizeof(double));
    surface->count++;
    return true;
}

/* ---- Cells ----------------------------------------------------------------------------------- */

/* How many cells no wider than the pitch a length is cut into. */
static size_t cells_of(double length, double pitch)
{
    const double count = ceil(length / pitch * (1 - 1e-9));
    return count < 1 ? 1 : (size_t)count;
}

static double middle_of(size_t cell, size_t cells, double half)
{
    return ((2 * (double)cell + 1) / (double)cells - 1) * half;
}

/* A rectangle (in 2D a line) at a distance along an axis, with that axis or its opposite as normal. */
static bool add_rectangle(ascc_surface *surface, const double half[3], int axis, double at,
                          double normal_sign, double pitch)
{
    const int d = (int)surface->dimension;
    const int across = (axis + 1) % d, along = d == 3 ? (axis + 2) % 3 : axis;
    const size_t columns = cells_of(2 * half[across], pitch),
                 rows = d == 3 ? cells_of(2 * half[along], pitch) : 1;
    double point[3] = {0, 0, 0}, normal[3] = {0, 0, 0};
    normal[axis] = normal_sign;
    for (size_t j = 0; j < rows; j++)
        for (size_t i = 0; i < columns; i++) {
            if (d == 3)
                point[along] = middle_of(j, rows, half[along]);
            point[across] = middle_of(i, columns, half[across]);
            point[axis] = at;
            if (!ascc_surface_add(surface, point, normal))
                return false;
        }
    return true;
}

static bool add_box(ascc_surface *surface, const double half[3], uint32_t open, double pitch)
{
    for (int axis = 0; axis < (int)surface->dimension; axis++)
        for (int side = 0; side < 2; side++) {
            const double sign = side == 0 ? -1 : 1;
            if ((open >> (2 * axis + side) & 1u) == 0 &&
                !add_rectangle(surface, half, axis, sign * half[axis], sign, pitch))
                return false;
        }
    return true;
}

/* ---- Surfaces of revolution about y ------------------------------------------------------------ */

/* A piece of the profile, from the lower pole to the upper: a line with a constant normal, or an arc about
 * (0, middle). */
typedef struct profile {
    double length;
    double radius[2], y[2],
        normal[2]; /* of a line: from, to; normal away from the axis, and along it */
    bool arc;
    double middle, arc_radius,
        from; /* of an arc of a quarter turn or two: the angle it begins with */
} profile;

static void profile_at(const profile *piece, double share, double *radius, double *y,
                       double normal[2])
{
    if (piece->arc) {
        double sine, cosine;
        ascc_sin_cos(piece->from + share * piece->length / piece->arc_radius, &sine, &cosine);
        normal[0] = cosine;
        normal[1] = sine;
        *radius = piece->arc_radius * cosine;
        *y = piece->middle + piece->arc_radius * sine;
        return;
    }
    *radius = piece->radius[0] + share * (piece->radius[1] - piece->radius[0]);
    *y = piece->y[0] + share * (piece->y[1] - piece->y[0]);
    memcpy(normal, piece->normal, sizeof piece->normal);
}

/* One ring of points; in 2D the two points where it crosses the plane. */
static bool add_ring(ascc_surface *surface, double radius, double y, const double normal[2],
                     double pitch, double begin)
{
    const bool flat = surface->dimension == 2;
    const size_t count = flat ? 2 : cells_of(2 * PI * radius, pitch);
    for (size_t k = 0; k < count; k++) {
        double sine = 0, cosine = k == 0 ? 1 : -1;
        if (!flat)
            ascc_sin_cos(begin + 2 * PI * (double)k / (double)count, &sine, &cosine);
        const double point[3] = {radius * cosine, y, radius * sine};
        const double outwards[3] = {normal[0] * cosine, normal[1], normal[0] * sine};
        if (!ascc_surface_add(surface, point, outwards))
            return false;
    }
    return true;
}

static bool add_revolution(ascc_surface *surface, const profile *pieces, int piece_count,
                           double pitch)
{
    size_t ring = 0;
    for (int i = 0; i < piece_count; i++) {
        const size_t rings = cells_of(pieces[i].length, pitch);
        for (size_t k = 0; k < rings; k++, ring++) {
            double radius, y, normal[2];
            profile_at(&pieces[i], ((double)k + 0.5) / (double)rings, &radius, &y, normal);
            if (!add_ring(surface, radius, y, normal, pitch, (double)(ring % 1024) * GOLDEN_ANGLE))
                return false;
        }
    }
    return true;
}

static profile arc_of(double radius, double middle, double from, double turn)
{
    return (profile){
        .length = turn * radius, .arc = true, .middle = middle, .arc_radius = radius, .from = from};
}

static bool add_sphere(ascc_surface *surface, double radius, double pitch)
{
    const profile whole = arc_of(radius, 0, -PI / 2, PI);
    return add_revolution(surface, &whole, 1, pitch);
}

static profile side_of(double radius, double half)
{
    return (profile){
        .length = 2 * half, .radius = {radius, radius}, .y = {-half, half}, .normal = {1, 0}};
}

static bool add_capsule(ascc_surface *surface, double radius, double half, double pitch)
{
    const profile pieces[3] = {arc_of(radius, -half, -PI / 2, PI / 2), side_of(radius, half),
                               arc_of(radius, half, 0, PI / 2)};
    return add_revolution(surface, pieces, 3, pitch);
}

static bool add_cylinder(ascc_surface *surface, double radius, double half, double pitch)
{
    const profile pieces[3] = {
        {.length = radius, .radius = {0, radius}, .y = {-half, -half}, .normal = {0, -1}},
        side_of(radius, half),
        {.length = radius, .radius = {radius, 0}, .y = {half, half}, .normal = {0, 1}}};
    return add_revolution(surface, pieces, 3, pitch);
}

/* ---- Points as given ------------------------------------------------------------------------- */

static ascc_status add_points(ascc_surface *surface, const ascc_shape *shape, ascc_message *message)
{
    const int32_t d = (int32_t)surface->dimension;
    ascc_host_array positions, normals;
    ascc_status status =
        ascc_host_array_open("shape.position", shape->position, d, &positions, message);
    if (status == ASCC_OK)
        status = ascc_host_array_open("shape.normal", shape->normal, d, &normals, message);
    for (size_t row = 0; status == ASCC_OK && row < shape->count; row++) {
        double point[3] = {0}, normal[3] = {0};
        for (int32_t c = 0; c < d; c++) {
            point[c] = ascc_host_array_read(&positions, row, c);
            normal[c] = ascc_host_array_read(&normals, row, c);
        }
        if (!ascc_surface_add(surface, point, normal))
            status = ascc_fail(message, ASCC_ERROR_MEMORY, "out of memory for a body of %zu points",
                               shape->count);
    }
    return status;
}

/* ---- Shapes ---------------------------------------------------------------------------------- */

/* Whether a member of the kind is a length. */
static ascc_status check_length(const char *name, double value, ascc_message *message)
{
    if (value > 0 && isfinite(value))
        return ASCC_OK;
    return ascc_fail(message, isfinite(value) ? ASCC_ERROR_ARGUMENT : ASCC_ERROR_NOT_FINITE,
                     "shape: %s is %g, not a length", name, ascc_readable(value));
}

static bool has_half(const ascc_shape *shape, int32_t dimension, int c)
{
    switch (shape->kind) {
    case ASCC_SHAPE_PLANE:
        return c == 0 || (c == 2 && dimension == 3);
    case ASCC_SHAPE_BOX:
        return c < dimension;
    case ASCC_SHAPE_CAPSULE:
    case ASCC_SHAPE_CYLINDER:
        return c == 1;
    default:
        return false;
    }
}

static bool has_radius(const ascc_shape *shape)
{
    return shape->kind == ASCC_SHAPE_SPHERE || shape->kind == ASCC_SHAPE_CAPSULE ||
           shape->kind == ASCC_SHAPE_CYLINDER;
}

/* Which points lie behind the surface: those of a solid, which becomes smaller, or of a container. */
static void shrink(ascc_shape *shape, double by)
{
    if (has_radius(shape))
        shape->radius -= by;
    if (shape->kind == ASCC_SHAPE_BOX)
        for (int c = 0; c < 3; c++)
            shape->half[c] -= by;
    if (shape->kind == ASCC_SHAPE_CYLINDER)
        shape->half[1] -= by;
}

static ascc_status check_lengths(const ascc_shape *shape, int32_t dimension, ascc_message *message)
{
    static const char *const half[3] = {"half[0]", "half[1]", "half[2]"};
    ascc_status status = ASCC_OK;
    for (int c = 0; c < 3 && status == ASCC_OK; c++)
        if (has_half(shape, dimension, c))
            status = check_length(half[c], shape->half[c], message);
    if (status == ASCC_OK && has_radius(shape))
        status = check_length("radius", shape->radius, message);
    return status;
}

/* Checks a shape and writes the pitch into it. */
static ascc_status check_shape(ascc_shape *shape, int32_t dimension, double spacing,
                               ascc_message *message)
{
    if ((int)shape->kind < ASCC_SHAPE_POINTS || (int)shape->kind > ASCC_SHAPE_MESH)
        return ascc_fail(message, ASCC_ERROR_ARGUMENT, "shape: kind is %d", (int)shape->kind);
    if ((int)shape->water < ASCC_WATER_OUTSIDE || (int)shape->water > ASCC_WATER_BOTH)
        return ascc_fail(message, ASCC_ERROR_ARGUMENT, "shape: water is %d", (int)shape->water);
    if (shape->reserved != 0)
        return ascc_fail(message, ASCC_ERROR_ARGUMENT, "shape: reserved is %ld, not 0",
                         (long)shape->reserved);
    if (shape->open != 0 && (shape->kind != ASCC_SHAPE_BOX || shape->open >> (2 * dimension) != 0))
        return ascc_fail(message, ASCC_ERROR_ARGUMENT, "shape: open is %#lx: no such faces",
                         (unsigned long)shape->open);
    if (shape->pitch == 0)
        shape->pitch = DEFAULT_PITCH * spacing;
    ascc_status status = check_length("pitch", shape->pitch, message);
    if (status == ASCC_OK && !(isfinite(shape->inset) && fabs(shape->inset) <= 4 * spacing))
        status =
            ascc_fail(message, isfinite(shape->inset) ? ASCC_ERROR_ARGUMENT : ASCC_ERROR_NOT_FINITE,
                      "shape: inset is %g, over four spacings", ascc_readable(shape->inset));
    if (status == ASCC_OK)
        status = check_lengths(shape, dimension, message);
    return status;
}

/* Whether the points of a shape of these lengths are too many; those of meshes are counted as they are made. */
static ascc_status check_size(const ascc_shape *shape, int32_t dimension, ascc_message *message)
{
    double square = 0;
    for (int c = 0; c < 3; c++) {
        const double length = (has_half(shape, dimension, c) ? 2 * shape->half[c] : 0) +
                              (has_radius(shape) ? 2 * shape->radius : 0);
        square += length * length;
    }
    const double cells = sqrt(square) / shape->pitch,
                 most = 8 * (dimension == 3 ? cells * cells : cells);
    if (most < (double)ASCC_BODY_POINTS && shape->count < ASCC_BODY_POINTS)
        return ASCC_OK;
    return ascc_fail(message, ASCC_ERROR_RANGE,
                     "shape: %zu points, or a size of %g with pitch %g: over 2^26 points",
                     shape->count, sqrt(square), shape->pitch);
}

/* Spacings that what a solid displaces reaches farther than its points do, since networks keep the first layer of
 * water off them: measured on held bodies (docs/bodies.md). */
#define INSET_2D 1.0
#define INSET_3D 0.6

static double default_inset(const ascc_shape *shape, int32_t dimension, double spacing)
{
    double inset = (dimension == 2 ? INSET_2D : INSET_3D) * spacing;
    if (shape->water != ASCC_WATER_OUTSIDE || shape->kind < ASCC_SHAPE_BOX ||
        shape->kind > ASCC_SHAPE_CYLINDER)
        return 0;
    for (int c = 0; c < 3; c++)
        if (has_half(shape, dimension, c) && shape->kind != ASCC_SHAPE_CAPSULE)
            inset = fmin(inset, 0.5 * shape->half[c]);
    if (has_radius(shape))
        inset = fmin(inset, 0.5 * shape->radius);
    return inset;
}

static ascc_status add_side(ascc_surface *surface, const ascc_shape *given, bool inside,
                            ascc_message *message)
{
    ascc_shape shape = *given;
    const size_t first = surface->count, d = surface->dimension;
    const bool shrinks = shape.kind >= ASCC_SHAPE_BOX && shape.kind <= ASCC_SHAPE_CYLINDER;
    bool room = true;
    ascc_status status = ASCC_OK;
    if (shrinks) {
        shrink(&shape, inside ? -shape.inset : shape.inset);
        status = check_lengths(&shape, (int32_t)d, message);
    }
    if (status != ASCC_OK)
        return ascc_fail(message, status, "shape: no wider than twice its inset of %g",
                         shape.inset);
    switch (shape.kind) {
    case ASCC_SHAPE_POINTS:
        status = add_points(surface, &shape, message);
        break;
    case ASCC_SHAPE_PLANE:
        room = add_rectangle(surface, shape.half, 1, 0, 1, shape.pitch);
        break;
    case ASCC_SHAPE_BOX:
        room = add_box(surface, shape.half, shape.open, shape.pitch);
        break;
    case ASCC_SHAPE_SPHERE:
        room = add_sphere(surface, shape.radius, shape.pitch);
        break;
    case ASCC_SHAPE_CAPSULE:
        room = add_capsule(surface, shape.radius, shape.half[1], shape.pitch);
        break;
    case ASCC_SHAPE_CYLINDER:
        room = add_cylinder(surface, shape.radius, shape.half[1], shape.pitch);
        break;
    default:
        status = ascc_mesh_sample(surface, &shape, shape.pitch, message);
        break;
    }
    if (!room)
        status = ascc_fail(message, ASCC_ERROR_MEMORY, "out of memory for a body");
    for (size_t k = first * d; status == ASCC_OK && k < surface->count * d; k++) {
        if (inside)
            surface->normal[k] = -surface->normal[k];
        if (!shrinks)
            surface->position[k] -= shape.inset * surface->normal[k];
    }
    return status;
}

ascc_status ascc_shape_sample(ascc_surface *surface, const ascc_shape *given, double spacing,
                              ascc_message *message)
{
    ascc_shape shape = *given;
    const int32_t d = (int32_t)surface->dimension;
    ascc_status status = check_shape(&shape, d, spacing, message);
    if (status == ASCC_OK)
        status = check_size(&shape, d, message);
    const bool points = shape.kind == ASCC_SHAPE_POINTS;
    if (shape.inset == 0)
        shape.inset = default_inset(&shape, d, spacing);
    if (status == ASCC_OK && (points || shape.water != ASCC_WATER_INSIDE))
        status = add_side(surface, &shape, false, message);
    if (status == ASCC_OK &&
        (points ? shape.water == ASCC_WATER_BOTH : shape.water != ASCC_WATER_OUTSIDE))
        status = add_side(surface, &shape, true, message);
    if (status == ASCC_OK && surface->count == 0)
        status = ascc_fail(message, ASCC_ERROR_ARGUMENT, "shape: it has no points");
    return status;
}
