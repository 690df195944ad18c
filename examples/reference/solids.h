/* Solids of reference scenes: distance to them, and wall particles in layers behind their surface.
 * SPDX-License-Identifier: MIT
 *
 * Distances are positive in the fluid. Layer k lies (k + 1/2) spacings behind the surface, so that
 * fluid on a lattice half a spacing away continues into the wall:
 *
 *     fluid   o   o   o | x   x   x   layers 0, 1, 2
 *                   surface
 */
#ifndef REFERENCE_SOLIDS_H
#define REFERENCE_SOLIDS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef enum solid_kind {
    SOLID_ROOM = 0, /* the fluid is inside the box */
    SOLID_BOX = 1,  /* the fluid is outside */
    SOLID_BALL = 2,
} solid_kind;

typedef struct solid {
    solid_kind kind;
    double center[3], half[3]; /* m; half extents of boxes */
    double angle;              /* of a box in 2D, radians */
    double radius;             /* m, of a ball */
} solid;

#define WALL_LAYERS 8

typedef struct wall_points {
    size_t count, capacity;
    double *position, *normal; /* [count][dimension], sorted by layer; normals into the fluid */
    int32_t layers;
    size_t layer_count[WALL_LAYERS];
} wall_points;

/* Distance of a point from the solids' surface, m; the unit direction in which it grows. */
double solids_distance(const solid *solids, size_t count, int32_t dimension, const double point[3],
                       double normal[3]);

/* Adds wall particles. In 3D, rooms and boxes have their faces on multiples of the spacing. False
 * without memory. */
bool solids_sample(const solid *solids, size_t count, int32_t dimension, double spacing,
                   int32_t layers, wall_points *walls);
/* Adds one layer of points on the surfaces, in 3D and about `spacing` apart: boxes' faces evenly, balls by the
 * golden angle. Those inside another solid, or where two touch, are left out. False without memory. */
bool solids_sample_faces(const solid *solids, size_t count, double spacing, wall_points *walls);
void wall_points_free(wall_points *walls);

#endif
