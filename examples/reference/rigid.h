/* Rigid bodies of points: how they move, and what a force does to them. SPDX-License-Identifier: MIT
 *
 * Bodies do not touch each other or walls: what keeps them apart is the fluid between.
 */
#ifndef REFERENCE_RIGID_H
#define REFERENCE_RIGID_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef enum rigid_kind {
    RIGID_STILL = 0,
    RIGID_DRIVEN = 1, /* moves with its velocity and spin, whatever acts on it */
    RIGID_FREE = 2,
} rigid_kind;

/* In 2D, mass and inertia are those of a metre of depth, and spin is about z alone. */
typedef struct rigid {
    rigid_kind kind;
    int32_t reserved;
    double mass;                   /* kg, of a free body */
    double inertia[3];             /* kg m^2 about its own axes, which are the world's at first */
    double center[3];              /* m: of mass, or about which a driven body spins */
    double velocity[3], spin[3];   /* m/s of the centre, 1/s */
    double turn[4];                /* unit quaternion from its own axes to the world's */
    double impulse[3], angular[3]; /* what the fluid gave to it so far, kg m/s, kg m^2/s */
    double inverse_mass;           /* 0 if nothing moves it */
    double inverse_inertia[3][3];  /* in the world; 0 likewise */
} rigid;

/* Fills in what follows from the rest. False if a free body has no mass or inertia. */
bool rigid_begin(rigid *body, int32_t dimension);

/* Velocity and spin after a force and a torque about the centre for dt. */
void rigid_push(rigid *body, const double force[3], const double torque[3], double dt);

/* Moves and turns it for dt; gyroscopic torque included. */
void rigid_move(rigid *body, double dt);

/* A direction of its own axes in the world's. */
void rigid_direction(const rigid *body, const double own[3], double direction[3]);

/* Where a point is that lies at `own` from the centre, in the body's own axes. */
void rigid_point(const rigid *body, const double own[3], double point[3]);

static inline void rigid_cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

#endif
