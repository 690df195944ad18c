/* Frames as VTK XML: point clouds (.vtp), and the collection that gives them times (.pvd).
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_VTK_H
#define ASCC_VTK_H

#include <stdbool.h>

#include "cloud.h"

/* A cloud of vertices with velocity (m/s), speed (m/s) and id, and its time. */
bool ascc_vtp_write(const char *path, const ascc_cloud *cloud, char *error, size_t capacity);
/* Wall points with their normals, as Normals. */
bool ascc_vtp_write_walls(const char *path, int32_t dimension, const float *position,
                          const float *normal, size_t count, char *error, size_t capacity);
/* The collection of `frames` files frame_00000.vtp, frame_EVERY.vtp, ... beside it, time_step apart for each
 * number. */
bool ascc_pvd_write(const char *path, size_t frames, size_t every, double time_step, char *error,
                    size_t capacity);

#endif
