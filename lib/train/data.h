/* Sequences as the trainer keeps them, and what it makes of them before a rollout.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_TRAIN_DATA_H
#define ASCC_TRAIN_DATA_H

#include <ascc/train.h>

#include "base/random.h"
#include "model/model.h"
#include "points/neighbors.h"

/* In the model's units: its spacing is that of the particles, and gravity is what it was. */
typedef struct ascc_kept_sequence {
    char name[128];
    size_t frame_count, fluid_count, boundary_count;
    size_t wall_frames; /* 1: walls at rest; else all frames */
    int32_t dimension, reserved;
    float *position, *wall, *normal; /* [frame][fluid][d], [wall_frames][boundary][d] */
    double time_step;                /* s between frames */
    double gravity[3], share;
    int32_t warm_up;   /* at most; 0 = the stage's */
    double jitter;     /* up to, spacings; 0 = the trainer's */
    uint16_t *near;    /* [frame][fluid]: other fluid particles within the support radius */
    double dense;      /* rho_95 of docs/training.md */
    double wall_depth; /* s_05, m */
} ascc_kept_sequence;

/* Copies and measures. tools: an arena that is reset. errors: ARGUMENT, MEMORY, MISMATCH, NOT_FINITE. */
ascc_status ascc_kept_sequence_create(ascc_kept_sequence *sequence, const ascc_allocator *allocator,
                                      const ascc_plan *plan, const ascc_training_sequence *given,
                                      const ascc_search_tools *tools);
/* Where the walls of a frame begin in `wall` and `normal`. */
static inline size_t ascc_kept_sequence_walls(const ascc_kept_sequence *s, size_t frame)
{
    return s->wall_frames > 1 ? frame * s->boundary_count * (size_t)s->dimension : 0;
}
void ascc_kept_sequence_destroy(ascc_kept_sequence *sequence, const ascc_allocator *allocator);

/* A motion of the whole scene: x -> turn x + shift. */
typedef struct ascc_rigid_transform {
    double turn[3][3], shift[3];
} ascc_rigid_transform;

ascc_rigid_transform ascc_rigid_transform_none(void);
/* to[count][d] = the placed points; vectors are turned only. */
void ascc_rigid_transform_apply(const ascc_rigid_transform *transform, int32_t dimension,
                                const float *from, size_t count, bool vectors, double *to);

/* A turn about gravity (without gravity: about any axis), a mirror in a plane along it, and a shift
 * within a cube of this edge. */
ascc_rigid_transform ascc_rigid_transform_draw(ascc_random *random,
                                               const ascc_kept_sequence *sequence, bool rotate,
                                               bool mirror, double edge);

#endif
