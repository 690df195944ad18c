/* Bodies: which boundary points move as a whole, where their frames are, and how they move.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_BODIES_H
#define ASCC_BODIES_H

#include "particles.h"

/* Its points are the boundary rows with ids in [first_id, end_id), less those removed: they lie together. Where a
 * point is in the frame stands in its row (fields.h). */
struct ascc_body {
    int32_t number;
    int32_t
        moved; /* 1: `torque` is that of the last run, 0: its points tell it, since they were at rest */
    uint64_t first_id, end_id;
    double position[3], rotation[4], angle; /* of the frame; rotation in 3D, angle in 2D */
    double velocity[3], spin[3];
    double torque[3]; /* angular impulse about the origin, over the last run */
};

/* Doubles of a body, from `position` on. */
#define ASCC_BODY_NUMBERS 17
_Static_assert(sizeof(struct ascc_body) == 24 + ASCC_BODY_NUMBERS * sizeof(double), "no gaps");

/* The body of this number, or NULL. */
struct ascc_body *ascc_bodies_find(const ascc_particles *particles, int32_t number);

/* Its rows. */
void ascc_body_rows(const ascc_particles *particles, const struct ascc_body *body, size_t *first,
                    size_t *count);

/* Whether rows [first, first + count) have one that moves with a body. */
ascc_status ascc_bodies_check_free(const ascc_particles *particles, size_t first, size_t count,
                                   ascc_message *message);

static inline bool ascc_body_moves(const struct ascc_body *body)
{
    for (int c = 0; c < 3; c++)
        if (body->velocity[c] != 0 || body->spin[c] != 0)
            return true;
    return false;
}

/* What a body is after some seconds. False if its frame is out of range then, or has turned too far to tell. */
bool ascc_body_advance(const ascc_particles *particles, struct ascc_body *body, double seconds);

/* Where its points are, into the rows of `position` [boundary count][dimension] that are its own; normals and
 * velocities likewise, if they are wanted. */
void ascc_body_place(const ascc_particles *particles, const struct ascc_body *body,
                     double *position, double *normal, double *velocity);

/* Adds angular impulses about its origin, of points where they are: those of `impulse` [boundary count][dimension],
 * quanta, less those of `before`, unless it is NULL. */
void ascc_body_add_torque(const ascc_particles *particles, struct ascc_body *body,
                          const int64_t *impulse, const int64_t *before);

/* Whether a set can have this body (but for its rows); `name` is that of the argument. A rotation is made of length
 * 1. */
ascc_status ascc_body_check(struct ascc_body *body, int32_t dimension, double spacing,
                            const char *name, ascc_message *message);

#endif
