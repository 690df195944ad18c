/* Shapes as points with normals, in a body's own frame. SPDX-License-Identifier: MIT */
#ifndef ASCC_SHAPES_H
#define ASCC_SHAPES_H

#include "base/context.h"
#include "base/host_array.h"

/* Points and normals so far, [count][dimension] each. */
typedef struct ascc_surface {
    const ascc_allocator *allocator;
    size_t dimension, count;
    double *position, *normal;
    size_t position_capacity, normal_capacity;
} ascc_surface;

void ascc_surface_open(ascc_surface *surface, const ascc_allocator *allocator, int32_t dimension);
void ascc_surface_close(ascc_surface *surface);
/* False without memory. */
bool ascc_surface_add(ascc_surface *surface, const double position[3], const double normal[3]);

/* Most points of a body. */
#define ASCC_BODY_POINTS ((size_t)1 << 26)

/* Makes the points of a shape whose struct has been read. spacing: of particles. errors: ARGUMENT, NOT_FINITE, RANGE,
 * MEMORY. */
ascc_status ascc_shape_sample(ascc_surface *surface, const ascc_shape *shape, double spacing,
                              ascc_message *message);

/* mesh_points.c: points on a mesh, `pitch` apart at most, none nearer than three quarters of it on the same side.
 * Faces of a fine mesh share points. */
ascc_status ascc_mesh_sample(ascc_surface *surface, const ascc_shape *shape, double pitch,
                             ascc_message *message);

#endif
