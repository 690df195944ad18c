/* Fluid and boundary at one instant: the state that a step advances.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_PARTICLES_H
#define ASCC_PARTICLES_H

#include <float.h>
#include <math.h>

#include "base/context.h"
#include "base/host_array.h"
#include "fields.h"

#define ASCC_KIND_COUNT 2

struct ascc_particles {
    uint32_t magic;
    int32_t dimension;
    ascc_context *context; /* retained */
    double spacing;
    double default_mass;
    double quantum;   /* momentum of one unit, kg length/s */
    uint64_t next_id; /* at most ASCC_ID_LIMIT */
    int32_t
        past_count; /* velocities of earlier steps that each fluid particle has, besides its own */

    /* Rows in order of addition (ids ascend). Vectors are [count][dimension]. The arrays of a kind
     * lie in one block of memory that begins with the first: none is replaced alone. */
    size_t fluid_count, fluid_capacity;
    size_t boundary_count, boundary_capacity;
#define ASCC_MEMBER(kind, member, type, ...) type *member;
    ASCC_PARTICLE_FIELDS(ASCC_MEMBER)
#undef ASCC_MEMBER

    /* Bodies in order of their numbers (bodies.h). */
    struct ascc_body *bodies;
    size_t body_count, body_capacity;
    int64_t next_body; /* above all numbers that the set has had */

    ascc_message message; /* of the last failed call that changes the set */
};

/* Largest magnitude of one particle's momentum, in quanta: sums of two never overflow. */
#define ASCC_MOMENTUM_LIMIT ((int64_t)1 << 61)

/* Largest magnitude of what a wall particle receives, in quanta: likewise. */
#define ASCC_WALL_LIMIT ((int64_t)1 << 62)

/* Largest magnitude of a coordinate, in spacings: there a double still tells 2^-12 of one apart. */
#define ASCC_POSITION_LIMIT 0x1p40

/* Ids are below: a billion particles a second reach it in 292 years. */
#define ASCC_ID_LIMIT ((uint64_t)1 << 63)

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

/* What a set can hold. */
static inline bool ascc_is_mass(double mass)
{
    return mass > 0 && isfinite(mass);
}

static inline bool ascc_is_spacing(double spacing)
{
    return spacing >= DBL_MIN && isfinite(spacing * ASCC_POSITION_LIMIT);
}

static inline bool ascc_is_quantum(double quantum)
{
    return quantum >= DBL_MIN && isfinite(quantum);
}

/* ---- particles.c ---- */

/* Logs and keeps the line as the set's message, for calls that change it; returns the status. */
ascc_status ascc_particles_fail(ascc_particles *particles, ascc_status status, const char *format,
                                ...) ASCC_PRINTF(3, 4);

/* For readers, of which several may run at once: the line becomes the context's message. */
ascc_status ascc_particles_fail_reading(const ascc_particles *particles, ascc_status status,
                                        const char *format, ...) ASCC_PRINTF(3, 4);

/* Adds boundary rows of a body, all zeros but for ids and number; nothing can fail after it. errors: MEMORY, RANGE. */
ascc_status ascc_particles_append_walls(ascc_particles *particles, size_t count, int32_t body,
                                        size_t *first, ascc_message *message);

/* ---- storage.c: the memory of the fields ---- */

/* Makes room for exactly these counts where there is less. False and unchanged without memory. */
bool ascc_particles_make_room(ascc_particles *particles, size_t fluid, size_t boundary);

/* The same, and makes the set keep this many earlier velocities; where it kept fewer, particles have moved before
 * as they did at first. */
bool ascc_particles_arrange(ascc_particles *particles, size_t fluid, size_t boundary, int32_t past);

/* Earlier velocities of rows from the age `known` on become the one before: the particle's own before all. */
void ascc_particles_fill_past(ascc_particles *particles, size_t first, size_t count, int32_t known);

/* Whether that many rows of a kind can be in any memory. */
bool ascc_particles_can_hold(const ascc_particles *particles, ascc_kind kind, size_t rows);

/* Zeros in rows [first, first + count) of all fields of a kind. */
void ascc_particles_zero_rows(ascc_particles *particles, ascc_kind kind, size_t first,
                              size_t count);

/* Drops the rows of a kind that are marked, one byte each. */
void ascc_particles_drop_rows(ascc_particles *particles, ascc_kind kind,
                              const unsigned char *marked);

/* Gives the memory back. */
void ascc_particles_release_rows(ascc_particles *particles);

/* ---- access.c: from the host's numbers to fields, and back ---- */

/* Whether every row of the host's can be one of the field's. */
ascc_status ascc_field_check(const ascc_particles *particles, ascc_field_index field,
                             const ascc_host_array *from, size_t count, ascc_message *message);

/* Stores them in rows [first, first + count) of a field of doubles. */
void ascc_field_store(ascc_particles *particles, ascc_field_index field,
                      const ascc_host_array *from, size_t first, size_t count);

/* Looks an id up in both kinds. */
bool ascc_particles_locate(const ascc_particles *particles, uint64_t id, ascc_kind *kind,
                           size_t *row);

/* ---- snapshot.c ---- */

/* What fluid adds to the hash of a set, rows in any order; and the hash of a set that has so much fluid, some of it
 * elsewhere. */
uint64_t ascc_fluid_hash(const ascc_particles *particles);
uint64_t ascc_whole_hash(const ascc_particles *particles, size_t fluid, uint64_t fluid_hash);

/* ---- momentum.c ---- */

/* Quanta nearest to a momentum; false when not finite or beyond ASCC_MOMENTUM_LIMIT. Rounds to
 * even. */
bool ascc_to_quanta(double momentum, double quantum, int64_t *quanta);

/* Velocities of fluid rows whose masses are given, as momenta. */
ascc_status ascc_velocity_check(const ascc_particles *particles, const ascc_host_array *from,
                                const ascc_host_array *mass, size_t count, ascc_message *message);
void ascc_velocity_store(ascc_particles *particles, const ascc_host_array *from, size_t first,
                         size_t count);

/* What boundary rows [first, first + count) received, quanta, exact. False, and nothing written, where it does not
 * fit. */
bool ascc_wall_impulse_sum(const ascc_particles *particles, size_t first, size_t count,
                           int64_t impulse[3]);

/* Masses of rows [first, first + count), which keep their velocities. */
ascc_status ascc_new_mass_check(const ascc_particles *particles, const ascc_host_array *from,
                                size_t first, size_t count, ascc_message *message);
void ascc_new_mass_store(ascc_particles *particles, const ascc_host_array *from, size_t first,
                         size_t count);

#endif
