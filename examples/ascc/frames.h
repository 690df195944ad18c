/* Frames of a run as files that other programs open: a folder of PLY, one of VTK XML.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_FRAMES_H
#define ASCC_FRAMES_H

#include <stdbool.h>

#include "cloud.h"
#include "sequence.h"

typedef struct ascc_frames {
    const char *ply, *vtk; /* folders; NULL = none */
    size_t every;          /* numbers from frame to frame */
    double time_step;      /* s from number to number */
    size_t written;
} ascc_frames;

/* Makes the folders, and writes the walls of the scene: DIR/walls.vtp. False with a line in error; so is it
 * with all of these. */
bool ascc_frames_open(const ascc_frames *frames, const ascc_sequence *scene, char *error,
                      size_t capacity);
/* The next frame: frame_NUMBER.ply, frame_NUMBER.vtp. Sets the cloud's time. */
bool ascc_frames_add(ascc_frames *frames, ascc_cloud *cloud, char *error, size_t capacity);
/* DIR/frames.pvd, of all frames that were written. */
bool ascc_frames_close(const ascc_frames *frames, char *error, size_t capacity);

#endif
