/* Frames as binary PLY point clouds. SPDX-License-Identifier: MIT */
#ifndef ASCC_PLY_H
#define ASCC_PLY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* x y z vx vy vz as float and id as uint, little-endian; z is 0 in 2D. */
bool ascc_ply_write(const char *path, int32_t dimension, const float *position,
                    const float *velocity, const uint64_t *id, size_t count, char *error,
                    size_t capacity);

#endif
