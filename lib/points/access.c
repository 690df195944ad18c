/* From the host's numbers to the fields of a particle set, and back: setting, reading, finding.
 * SPDX-License-Identifier: MIT
 *
 * A call that changes the set reads the host's numbers twice: first to check them all, then, when
 * nothing can fail any more, to store them.
 */
#include <string.h>

#include "bodies.h"
#include "rest.h"

/* ---- Rows of the host's numbers -------------------------------------------------------------- */

ascc_status ascc_field_check(const ascc_particles *particles, ascc_field_index field,
                             const ascc_host_array *from, size_t count, ascc_message *message)
{
    const ascc_particle_field *const what = &ascc_particle_fields[field];
    assert(what->element == ASCC_REAL && what->check != NULL);
    double values[3];
    ascc_candidate row = {.name = from->name,
                          .values = values,
                          .numbers =
                              ascc_field_numbers(what, particles->dimension, particles->past_count),
                          .spacing = particles->spacing};
    for (row.row = 0; row.row < count; row.row++) {
        for (int32_t c = 0; c < row.numbers; c++)
            values[c] = ascc_host_array_read(from, row.row, c);
        const ascc_status status = what->check(&row, message);
        if (status != ASCC_OK)
            return status;
    }
    return ASCC_OK;
}

void ascc_field_store(ascc_particles *particles, ascc_field_index field,
                      const ascc_host_array *from, size_t first, size_t count)
{
    const ascc_particle_field *const what = &ascc_particle_fields[field];
    const int32_t numbers = ascc_field_numbers(what, particles->dimension, particles->past_count);
    double *const into = (double *)ascc_field_rows(particles, what) + first * (size_t)numbers;
    for (size_t row = 0; row < count; row++)
        for (int32_t c = 0; c < numbers; c++)
            into[row * (size_t)numbers + (size_t)c] = ascc_host_array_read(from, row, c);
}

/* ---- Setting and reading --------------------------------------------------------------------- */

/* Whether the kind exists and the rows are there. */
static ascc_status check_rows(const ascc_particles *particles, ascc_kind kind, size_t first,
                              size_t count, ascc_message *message)
{
    if (kind != ASCC_FLUID && kind != ASCC_BOUNDARY)
        return ascc_fail(message, ASCC_ERROR_ARGUMENT, "kind: %d is neither fluid nor boundary",
                         (int)kind);
    const size_t rows = ascc_particles_count(particles, kind);
    if (first > rows || count > rows - first)
        return ascc_fail(message, ASCC_ERROR_ARGUMENT,
                         "%s: rows [%zu, + %zu) go beyond the %zu there are",
                         kind == ASCC_FLUID ? "fluid" : "boundary", first, count, rows);
    return ASCC_OK;
}

/* Steps ago, of an earlier velocity. */
static int32_t age_of(ascc_field name)
{
    return (int32_t)name - (int32_t)ASCC_EARLIER_VELOCITY;
}

/* And which of the fields is meant. */
static ascc_status check_field(const ascc_particles *particles, ascc_kind kind, ascc_field name,
                               size_t first, size_t count, ascc_field_index *field,
                               ascc_message *message)
{
    const ascc_status status = check_rows(particles, kind, first, count, message);
    if (status != ASCC_OK)
        return status;
    if (kind == ASCC_FLUID && age_of(name) >= 0 && age_of(name) < ASCC_MAX_HISTORY) {
        *field = ASCC_FIELD_past;
        return ASCC_OK;
    }
    for (int i = 0; i < ASCC_FIELD_COUNT; i++) {
        const int32_t access = ascc_particle_fields[i].access;
        if (access >= 0 && access == (int32_t)name && ascc_particle_fields[i].kind == kind) {
            *field = (ascc_field_index)i;
            return ASCC_OK;
        }
    }
    return ascc_fail(message, ASCC_ERROR_ARGUMENT, "field: %d is not one of %s particles",
                     (int)name, kind == ASCC_FLUID ? "fluid" : "boundary");
}

/* Numbers of a row as the host has them: earlier velocities one by one. */
static int32_t numbers_of(const ascc_particles *particles, ascc_field_index field)
{
    return ascc_field_numbers(&ascc_particle_fields[field], particles->dimension, 1);
}

/* What was before is as this one. */
static ascc_status set_past(ascc_particles *particles, int32_t age, size_t first, size_t count,
                            const ascc_host_array *from, ascc_message *message)
{
    const size_t d = (size_t)particles->dimension;
    const ascc_status status =
        ascc_field_check(particles, ASCC_FIELD_wall_velocity, from, count, message);
    if (status != ASCC_OK)
        return status;
    if (particles->past_count <= age && !ascc_particles_arrange(particles, 0, 0, age + 1))
        return ascc_fail(message, ASCC_ERROR_MEMORY, "no memory for %d velocities of %zu particles",
                         (int)age + 1, particles->fluid_count);
    for (size_t row = 0; row < count; row++)
        for (size_t c = 0; c < d; c++)
            particles->past[((first + row) * (size_t)particles->past_count + (size_t)age) * d + c] =
                ascc_host_array_read(from, row, (int32_t)c);
    ascc_particles_fill_past(particles, first, count, age + 1);
    return ASCC_OK;
}

static double past_of(const ascc_particles *particles, int32_t age, size_t row, int32_t c)
{
    const int32_t known = particles->past_count, at = age < known ? age : known - 1;
    return known
               ? particles->past[(row * (size_t)known + (size_t)at) * (size_t)particles->dimension +
                                 (size_t)c]
               : ascc_velocity(particles, row, c);
}

static ascc_status set_field(ascc_particles *particles, ascc_field_index field, size_t first,
                             size_t count, const ascc_host_array *from, ascc_message *message)
{
    ascc_status status;
    if (field == ASCC_FIELD_momentum) {
        const ascc_host_array mass = {"mass", (const unsigned char *)(particles->mass + first),
                                      sizeof(double), 0, ASCC_DOUBLE};
        status = ascc_velocity_check(particles, from, &mass, count, message);
        if (status == ASCC_OK)
            ascc_velocity_store(particles, from, first, count);
        if (status == ASCC_OK)
            ascc_particles_fill_past(particles, first, count, 0);
    } else if (field == ASCC_FIELD_mass) {
        status = ascc_new_mass_check(particles, from, first, count, message);
        if (status == ASCC_OK)
            ascc_new_mass_store(particles, from, first, count);
    } else {
        status = ascc_field_check(particles, field, from, count, message);
        if (status == ASCC_OK)
            ascc_field_store(particles, field, from, first, count);
    }
    return status;
}

ascc_status ascc_particles_set(ascc_particles *particles, ascc_kind kind, ascc_field field,
                               size_t first, size_t count, const ascc_const_array *values)
{
    ASCC_FLOAT_SCOPE;
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    ascc_message message;
    ascc_field_index which;
    ascc_host_array from;
    ascc_status status = check_field(particles, kind, field, first, count, &which, &message);
    if (status == ASCC_OK && count > 0)
        status =
            ascc_host_array_open("values", values, numbers_of(particles, which), &from, &message);
    if (status == ASCC_OK && kind == ASCC_BOUNDARY)
        status = ascc_bodies_check_free(particles, first, count, &message);
    if (status == ASCC_OK && count > 0) {
        /* Where rows were, and where they are: a velocity of walls wakes as it moves them. */
        const bool wakes = which != ASCC_FIELD_wall_velocity;
        if (wakes)
            ascc_rest_disturb(particles, kind, first, count);
        status = which == ASCC_FIELD_past
                     ? set_past(particles, age_of(field), first, count, &from, &message)
                     : set_field(particles, which, first, count, &from, &message);
        if (wakes)
            ascc_rest_disturb(particles, kind, first, count);
    }
    return status == ASCC_OK ? status : ascc_particles_fail(particles, status, "%s", message.text);
}

/* A number of a field that the host can read: velocities are worked out, all others are held. */
static double field_value(const ascc_particles *particles, ascc_field_index field, size_t row,
                          int32_t c)
{
    const ascc_particle_field *const what = &ascc_particle_fields[field];
    if (field == ASCC_FIELD_momentum)
        return ascc_velocity(particles, row, c);
    const size_t numbers = (size_t)numbers_of(particles, field);
    return ((const double *)ascc_field_rows(particles, what))[row * numbers + (size_t)c];
}

ascc_status ascc_particles_get(const ascc_particles *particles, ascc_kind kind, ascc_field field,
                               size_t first, size_t count, const ascc_array *values)
{
    ASCC_FLOAT_SCOPE;
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    ascc_message message;
    ascc_field_index which;
    ascc_status status = check_field(particles, kind, field, first, count, &which, &message);
    if (status == ASCC_OK && count == 0)
        return ASCC_OK;
    const ascc_array into = values != NULL ? *values : (ascc_array){0};
    const ascc_const_array described = {into.data, into.stride, into.component_stride, into.scalar,
                                        into.reserved};
    ascc_host_array opened;
    int32_t numbers = 0;
    if (status == ASCC_OK) {
        numbers = numbers_of(particles, which);
        status = ascc_host_array_open("values", &described, numbers, &opened, &message);
    }
    if (status != ASCC_OK)
        return ascc_particles_fail_reading(particles, status, "%s", message.text);
    for (size_t row = 0; row < count; row++)
        for (int32_t c = 0; c < numbers; c++)
            ascc_scalar_write(
                (unsigned char *)into.data + (ptrdiff_t)row * opened.row + c * opened.component,
                into.scalar,
                which == ASCC_FIELD_past ? past_of(particles, age_of(field), first + row, c)
                                         : field_value(particles, which, first + row, c));
    return ASCC_OK;
}

/* Copies rows of a field as they are held; `name` is the argument's. */
static ascc_status get_held(const ascc_particles *particles, ascc_kind kind, ascc_field_index field,
                            size_t first, size_t count, const char *name, void *into)
{
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    ascc_message message;
    ascc_status status = check_rows(particles, kind, first, count, &message);
    if (status == ASCC_OK && count > 0 && into == NULL)
        status = ascc_fail(&message, ASCC_ERROR_ARGUMENT, "%s: NULL", name);
    if (status != ASCC_OK)
        return ascc_particles_fail_reading(particles, status, "%s", message.text);
    const ascc_particle_field *const what = &ascc_particle_fields[field];
    const size_t size = ascc_field_row_size(what, particles->dimension, particles->past_count);
    if (count > 0)
        memcpy(into, (const unsigned char *)ascc_field_rows(particles, what) + first * size,
               count * size);
    return ASCC_OK;
}

ascc_status ascc_particles_get_ids(const ascc_particles *particles, ascc_kind kind, size_t first,
                                   size_t count, uint64_t *ids)
{
    return get_held(particles, kind, kind == ASCC_FLUID ? ASCC_FIELD_id : ASCC_FIELD_wall_id, first,
                    count, "ids", ids);
}

ascc_status ascc_particles_get_bodies(const ascc_particles *particles, size_t first, size_t count,
                                      int32_t *bodies)
{
    return get_held(particles, ASCC_BOUNDARY, ASCC_FIELD_wall_body, first, count, "bodies", bodies);
}

ascc_status ascc_particles_get_momentum(const ascc_particles *particles, size_t first, size_t count,
                                        int64_t *momentum)
{
    return get_held(particles, ASCC_FLUID, ASCC_FIELD_momentum, first, count, "momentum", momentum);
}

/* ---- Finding --------------------------------------------------------------------------------- */

/* The row of an id among ascending ones, or count. */
static size_t find_row(const uint64_t *ids, size_t count, uint64_t id)
{
    size_t low = 0, high = count;
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        if (ids[middle] < id)
            low = middle + 1;
        else
            high = middle;
    }
    return low < count && ids[low] == id ? low : count;
}

bool ascc_particles_locate(const ascc_particles *particles, uint64_t id, ascc_kind *kind,
                           size_t *row)
{
    *kind = ASCC_FLUID;
    *row = find_row(particles->id, particles->fluid_count, id);
    if (*row < particles->fluid_count)
        return true;
    *kind = ASCC_BOUNDARY;
    *row = find_row(particles->wall_id, particles->boundary_count, id);
    return *row < particles->boundary_count;
}

ascc_status ascc_particles_find(const ascc_particles *particles, uint64_t id, ascc_kind *kind,
                                size_t *row)
{
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    ascc_kind found_kind;
    size_t found_row;
    if (!ascc_particles_locate(particles, id, &found_kind, &found_row))
        return ascc_particles_fail_reading(particles, ASCC_ERROR_ARGUMENT,
                                           "id: no particle has %llu", (unsigned long long)id);
    if (kind != NULL)
        *kind = found_kind;
    if (row != NULL)
        *row = found_row;
    return ASCC_OK;
}
