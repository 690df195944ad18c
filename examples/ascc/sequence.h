/* Particle sequence files (docs/sequence-format.md): read whole, written frame by frame.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_SEQUENCE_H
#define ASCC_SEQUENCE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* A sequence in memory, SI units. Arrays are from malloc and freed by ascc_sequence_free. */
typedef struct ascc_sequence {
    int32_t dimension;
    double time_step;  /* s between frames */
    double gravity[3]; /* m/s^2 */
    double radius;     /* m, half the particle spacing */
    double mass;       /* kg; per metre of depth in 2D */
    double rest_density;
    size_t frames, count, walls;
    size_t velocity_frames; /* frames with velocities: all or only the first */
    size_t first_layer;     /* wall points that touch the fluid come first; = walls if not stated */
    float *position;        /* [frames][count][dimension] */
    float *velocity;        /* [velocity_frames][count][dimension] */
    bool walls_move;        /* they have places in every frame; else at rest */
    float *wall, *normal;   /* [walls][dimension], or [frames][walls][dimension] */
    char source[1024];      /* who made it */
} ascc_sequence;

/* False with one line in error[capacity] that names file and field. */
bool ascc_sequence_read(const char *path, ascc_sequence *sequence, char *error, size_t capacity);
void ascc_sequence_free(ascc_sequence *sequence);

/* Velocities of a frame, [count][dimension]: stored, or the difference to the frame before. */
void ascc_sequence_velocities(const ascc_sequence *sequence, size_t frame, float *velocity);

/* Writes into PATH.part, which takes the file's name only when it is whole. */
typedef struct ascc_sequence_writer ascc_sequence_writer;

/* Metadata and walls come from `header`, whose frames and fluid arrays are not looked at. With
 * all_velocities every frame has velocities, else only the first. Walls that move are given frame by frame,
 * by ascc_sequence_append_walls. NULL with a line in error. */
ascc_sequence_writer *ascc_sequence_create(const char *path, const ascc_sequence *header,
                                           bool all_velocities, char *error, size_t capacity);
/* One frame: position and velocity [count][dimension]. */
bool ascc_sequence_append(ascc_sequence_writer *writer, const float *position,
                          const float *velocity, char *error, size_t capacity);
/* The walls of the frame appended last, [walls][dimension] each, where they move. */
bool ascc_sequence_append_walls(ascc_sequence_writer *writer, const float *wall,
                                const float *normal, char *error, size_t capacity);
/* Completes and renames the file, or with keep = false drops it. Frees the writer either way. */
bool ascc_sequence_finish(ascc_sequence_writer *writer, bool keep, char *error, size_t capacity);

#endif
