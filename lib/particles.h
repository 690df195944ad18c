/* Fluid and boundary arrays at one instant: the state that a step advances.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_PARTICLES_H
#define ASCC_PARTICLES_H

#include "context.h"

struct ascc_particles {
    uint32_t magic;
    int32_t dimension;
    ascc_context *context; /* retained */
    double spacing;
    double default_mass;
    double quantum; /* momentum of one unit, kg length/s */
    uint64_t next_id;

    /* Fluid rows, in order of addition (ids ascend). Vectors are [count][dimension]. */
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

/* Largest magnitude of a coordinate, in spacings. */
#define ASCC_POSITION_LIMIT 1099511627776.0

/* Quanta nearest to a momentum; false when not finite or beyond ASCC_MOMENTUM_LIMIT. Rounds to
 * even. */
bool ascc_to_quanta(double momentum, double quantum, int64_t *quanta);

/* Velocity of fluid row i: momentum * quantum / mass. */
static inline double ascc_velocity(const ascc_particles *p, size_t i, int32_t component)
{
    return (double)p->momentum[i * (size_t)p->dimension + (size_t)component] * p->quantum /
           p->mass[i];
}

/* Logs and keeps the line as the set's message; returns the status. */
ascc_status ascc_particles_fail(ascc_particles *particles, ascc_status status, const char *format,
                                ...) ASCC_PRINTF(3, 4);

#endif
