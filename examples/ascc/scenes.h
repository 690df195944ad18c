/* Built-in scenes: particles and walls of a given size, SI units. SPDX-License-Identifier: MIT */
#ifndef ASCC_SCENES_H
#define ASCC_SCENES_H

#include <stdio.h>

#include "sequence.h"

/* Names with what they show, for a help text; ends with NULL. */
typedef struct ascc_scene_name {
    const char *name, *text;
} ascc_scene_name;
extern const ascc_scene_name ascc_scene_names[];

/**
 * Makes the one frame of a named scene: dam-break, droplets, free-fall, still-column.
 *
 * dimension  2 or 3
 * size       particles along the fluid's longest edge, 4 to 1000; 0 = the scene's own
 * spacing    m
 * scene      receives position, velocity, walls with normals; freed by ascc_sequence_free.
 * returns    false with a line in error: an unknown name, a size out of range, no memory.
 */
bool ascc_scene_make(const char *name, int32_t dimension, int32_t size, double spacing,
                     ascc_sequence *scene, char *error, size_t capacity);

/* What a command line calls a scene: a sequence file, or NAME-2d, NAME-3d or NAME (3D) of a built-in one. */
bool ascc_scene_load(const char *text, int32_t size, double spacing, ascc_sequence *scene,
                     char *error, size_t capacity);
/* The built-in scenes, for a help text. */
void ascc_scene_list(FILE *to);

#endif
