/* Frames as binary PLY point clouds. SPDX-License-Identifier: MIT */
#ifndef ASCC_PLY_H
#define ASCC_PLY_H

#include <stdbool.h>

#include "cloud.h"

/* x y z nx ny nz vx vy vz as float and id as uint, little-endian; third components are 0 in 2D. The velocity
 * stands twice: VTK reads of all properties only nx ny nz (as normals), others read vx vy vz by name. */
bool ascc_ply_write(const char *path, const ascc_cloud *cloud, char *error, size_t capacity);

#endif
