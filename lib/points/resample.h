/* Coarser point sets from a finer one: voxelisation in O(N), and farthest points (paper section 3.4).
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_RESAMPLE_H
#define ASCC_RESAMPLE_H

#include "neighbors.h"

/* Mean of the points in units; exact sums, so the order of points does not matter. */
void ascc_centroid(const ascc_points *points, double center[3]);

/* Centres of the voxels of edge `voxel` units, anchored at the world's origin, that hold a point.
 * errors: MEMORY, RANGE. */
ascc_status ascc_sample_centers(ascc_points *samples, const ascc_search_tools *tools,
                                const ascc_points *points, int32_t dimension, double voxel);

/* Corners of the voxels that hold x - hysteresis or x + hysteresis (voxels, on all axes at once) of a
 * point x; the grid hangs on `anchor` (docs/method.md). errors: MEMORY, RANGE. */
ascc_status ascc_sample_corners(ascc_points *samples, const ascc_search_tools *tools,
                                const ascc_points *points, int32_t dimension, double voxel,
                                double hysteresis, const double anchor[3]);

/* `count` of the points, each the farthest from those chosen before it, from the first on; ties go to
 * the earlier point; in the order of the points. Every point has a say in that, a far one first of all.
 * cost: O(points * count). errors: MEMORY. */
ascc_status ascc_sample_farthest(ascc_points *samples, const ascc_search_tools *tools,
                                 const ascc_points *points, size_t count);

#endif
