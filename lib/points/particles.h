/* Fluid and boundary arrays at one instant: the state that a step advances.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_PARTICLES_H
#define ASCC_PARTICLES_H

#include <float.h>
#include <math.h>

#include "base/context.h"

struct ascc_particles {
    uint32_t magic;
    int32_t dimension;
    ascc_context *context; /* retained */
    double spacing;
    double default_mass;
    double quantum; /* momentum of one unit, kg length/s */
    uint64_t next_id;

    /* Fluid rows, in order of addition (ids ascend). Vectors are [count][dimension]. The arrays of
     * a kind lie in one block of memory that begins with the first: none is replaced alone. */
    size_t fluid_count, fluid_capacity;
    double *position;
    int64_t *momentum;
    double *mass;
    uint64_t *id;

    /* Boundary rows, likewise. */
    size_t boundary_count, boundary_capacity;
    double *wall_position;
    double *wall_normal;
    int32_t *wall_body;
    uint64_t *wall_id;
    int64_t *wall_impulse; /* received in the last step, quanta */

    ascc_message message;
};

/* Largest magnitude of one particle's momentum, in quanta: sums of two never overflow. */
#define ASCC_MOMENTUM_LIMIT ((int64_t)1 << 61)

/* Largest magnitude of a coordinate, in spacings: there a double still tells 2^-12 of one apart. */
#define ASCC_POSITION_LIMIT 0x1p40

/* Quanta nearest to a momentum; false when not finite or beyond ASCC_MOMENTUM_LIMIT. Rounds to
 * even. */
bool ascc_to_quanta(double momentum, double quantum, int64_t *quanta);

/* Velocity of fluid row i: momentum * quantum / mass. */
static inline double ascc_velocity(const ascc_particles *p, size_t i, int32_t component)
{
    return (double)p->momentum[i * (size_t)p->dimension + (size_t)component] * p->quantum /
           p->mass[i];
}

static inline bool ascc_particles_is_set(const ascc_particles *particles)
{
    return particles != NULL && particles->magic == ASCC_PARTICLES_MAGIC;
}

/* Numbers of a vector. */
static inline size_t ascc_particles_width(const ascc_particles *particles)
{
    return (size_t)particles->dimension;
}

/* A failing reader leaves its message too: that is the one thing it changes. */
static inline ascc_particles *ascc_particles_writable(const ascc_particles *particles)
{
    return (ascc_particles *)particles;
}

/* What a set can hold. Normals may be a little off: they are rounded by the host's tools. */
static inline bool ascc_is_mass(double mass)
{
    return mass > 0 && isfinite(mass);
}

static inline bool ascc_is_normal_length(double length)
{
    return fabs(length - 1) <= 1e-3;
}

static inline bool ascc_is_spacing(double spacing)
{
    return spacing >= DBL_MIN && isfinite(spacing * ASCC_POSITION_LIMIT);
}

static inline bool ascc_is_quantum(double quantum)
{
    return quantum >= DBL_MIN && isfinite(quantum);
}

/* Makes room for exactly these counts where there is less. False and unchanged without memory. */
bool ascc_particles_make_room(ascc_particles *particles, size_t fluid, size_t boundary);

/* Logs and keeps the line as the set's message; returns the status. */
ascc_status ascc_particles_fail(ascc_particles *particles, ascc_status status, const char *format,
                                ...) ASCC_PRINTF(3, 4);

#endif
