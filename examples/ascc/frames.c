/* Frames of a run as files that other programs open: a folder of PLY, one of VTK XML.
 * SPDX-License-Identifier: MIT */
#include "frames.h"

#include <stdio.h>

#include "new_file.h"
#include "ply.h"
#include "vtk.h"

enum { PATH_SIZE = ASCC_NEW_FILE_PATH };

bool ascc_frames_open(const ascc_frames *frames, const ascc_sequence *scene, char *error,
                      size_t capacity)
{
    char path[PATH_SIZE];
    if ((frames->ply && !ascc_make_folder(frames->ply, error, capacity)) ||
        (frames->vtk && !ascc_make_folder(frames->vtk, error, capacity)))
        return false;
    if (!frames->vtk || !scene->walls)
        return true;
    (void)snprintf(path, sizeof path, "%s/walls.vtp", frames->vtk);
    return ascc_vtp_write_walls(path, scene->dimension, scene->wall, scene->normal, scene->walls,
                                error, capacity);
}

bool ascc_frames_add(ascc_frames *frames, ascc_cloud *cloud, char *error, size_t capacity)
{
    char path[PATH_SIZE];
    const size_t number = frames->written * frames->every;
    cloud->time = (double)number * frames->time_step;
    if (frames->ply) {
        (void)snprintf(path, sizeof path, "%s/frame_%05zu.ply", frames->ply, number);
        if (!ascc_ply_write(path, cloud, error, capacity))
            return false;
    }
    if (frames->vtk) {
        (void)snprintf(path, sizeof path, "%s/frame_%05zu.vtp", frames->vtk, number);
        if (!ascc_vtp_write(path, cloud, error, capacity))
            return false;
    }
    frames->written++;
    return true;
}

bool ascc_frames_close(const ascc_frames *frames, char *error, size_t capacity)
{
    char path[PATH_SIZE];
    if (!frames->vtk || !frames->written)
        return true;
    (void)snprintf(path, sizeof path, "%s/frames.pvd", frames->vtk);
    return ascc_pvd_write(path, frames->written, frames->every, frames->time_step, error, capacity);
}
