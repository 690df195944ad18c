/* What wall points stand for: each a volume that makes the density of walls count once, however dense they
 * are (Akinci et al. 2012). SPDX-License-Identifier: MIT */
#ifndef ASCC_WALL_VOLUMES_H
#define ASCC_WALL_VOLUMES_H

#include "points/neighbors.h"

/* Kept from step to step, made anew when walls are others. */
typedef struct ascc_wall_volumes {
    const ascc_allocator *allocator;
    float *volume;             /* [count] of the host's boundary rows, times the spline's middle */
    double *position, *normal; /* [count][dimension] that they were made for */
    size_t count, volume_capacity, position_capacity, normal_capacity;
    double support; /* likewise, in the host's unit */
} ascc_wall_volumes;

/* Volumes of walls at these positions, with these normals, [count][dimension]: 1 / sum of w over all walls within the
 * support, of thin walls (network/sheets.h) those that are seen from the point's side.
 * errors: MEMORY, RANGE, LIMIT. */
ascc_status ascc_wall_volumes_update(ascc_wall_volumes *walls, const ascc_search_tools *tools,
                                     const double *position, const double *normal, size_t count,
                                     int32_t dimension, double support);
void ascc_wall_volumes_close(ascc_wall_volumes *walls);

#endif
