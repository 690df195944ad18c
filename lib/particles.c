/* The particle set: adding, removing, setting, reading. SPDX-License-Identifier: MIT */
#include "particles.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "arrays.h"

_Static_assert(sizeof(void *) != 8 || sizeof(ascc_particles_options) == 56, "released layout");
_Static_assert(sizeof(void *) != 8 || sizeof(ascc_const_array) == 32, "released layout");

#define NORMAL_TOLERANCE 1e-3

ascc_status ascc_particles_fail(ascc_particles *particles, ascc_status status, const char *format,
                                ...)
{
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(particles->message.text, sizeof particles->message.text, format, arguments);
    va_end(arguments);
    ascc_context_log(particles->context, particles->message.text);
    return status;
}

static bool valid(const ascc_particles *p)
{
    return p && p->magic == ASCC_PARTICLES_MAGIC;
}

const char *ascc_particles_message(const ascc_particles *particles)
{
    return valid(particles) ? particles->message.text : "";
}

bool ascc_to_quanta(double momentum, double quantum, int64_t *quanta)
{
    const double q = rint(momentum / quantum);
    if (!(fabs(q) <= (double)ASCC_MOMENTUM_LIMIT))
        return false;
    *quanta = (int64_t)q;
    return true;
}

/* ---- Create and destroy ---- */

static bool positive(double x)
{
    return x > 0.0 && isfinite(x);
}

static ascc_status check_options(const ascc_particles_options *o, ascc_message *m)
{
    if (o->dimension != 2 && o->dimension != 3)
        return ascc_fail(m, ASCC_ERROR_ARGUMENT, "dimension = %d: 2 or 3 is wanted", o->dimension);
    if (!positive(o->spacing))
        return ascc_fail(m, ASCC_ERROR_ARGUMENT, "spacing = %g: a positive length is wanted",
                         o->spacing);
    if (o->mass != 0.0 && !positive(o->mass))
        return ascc_fail(m, ASCC_ERROR_ARGUMENT, "mass = %g: a positive mass is wanted", o->mass);
    if (o->momentum_quantum != 0.0 && !positive(o->momentum_quantum))
        return ascc_fail(m, ASCC_ERROR_ARGUMENT, "momentum_quantum = %g is not positive",
                         o->momentum_quantum);
    return ASCC_OK;
}

/* 2^-28 of the power of two at or below mass * spacing. */
static double default_quantum(double mass, double spacing)
{
    int exponent;
    (void)frexp(mass * spacing, &exponent);
    return ldexp(1.0, exponent - 1 - 28);
}

ascc_status ascc_particles_create(ascc_context *context, const ascc_particles_options *options,
                                  ascc_particles **particles)
{
    if (particles)
        *particles = NULL;
    if (!context || context->magic != ASCC_CONTEXT_MAGIC || !particles)
        return ASCC_ERROR_ARGUMENT;
    ascc_message m;
    ascc_particles_options o;
    if (!options || !ascc_read_struct(&o, sizeof o, options, sizeof o))
        return ascc_context_fail(context,
                                 ascc_fail(&m, ASCC_ERROR_ARGUMENT,
                                           "ascc_particles_options is missing, or its size is not "
                                           "understood"),
                                 &m);
    ascc_status status = check_options(&o, &m);
    if (status != ASCC_OK)
        return ascc_context_fail(context, status, &m);
    ascc_particles *p = ascc_allocate(&context->allocator, 1, sizeof *p);
    if (!p)
        return ascc_context_fail(
            context, ascc_fail(&m, ASCC_ERROR_MEMORY, "no memory for a particle set"), &m);
    memset(p, 0, sizeof *p);
    p->magic = ASCC_PARTICLES_MAGIC;
    p->dimension = o.dimension;
    p->context = context;
    p->spacing = o.spacing;
    p->default_mass = o.mass > 0.0 ? o.mass : 1.0;
    p->quantum = o.momentum_quantum > 0.0 ? o.momentum_quantum
                                          : default_quantum(p->default_mass, p->spacing);
    p->next_id = 1;
    ascc_context_retain(context);
    status = positive(p->quantum)
                 ? ascc_particles_reserve(p, o.fluid_capacity, o.boundary_capacity)
                 : ascc_particles_fail(p, ASCC_ERROR_ARGUMENT,
                                       "mass * spacing = %g is too small for a momentum quantum",
                                       p->default_mass * p->spacing);
    if (status != ASCC_OK) {
        (void)ascc_context_fail(context, status, &p->message);
        ascc_particles_destroy(&p);
        return status;
    }
    *particles = p;
    return ASCC_OK;
}

void ascc_particles_destroy(ascc_particles **particles)
{
    if (!particles || !*particles)
        return;
    ascc_particles *p = *particles;
    *particles = NULL;
    if (!valid(p))
        return;
    ascc_context *context = p->context;
    const ascc_allocator *a = &context->allocator;
    const size_t d = (size_t)p->dimension, n = p->fluid_capacity, w = p->boundary_capacity;
    ascc_release(a, p->position, n, d * sizeof *p->position);
    ascc_release(a, p->momentum, n, d * sizeof *p->momentum);
    ascc_release(a, p->mass, n, sizeof *p->mass);
    ascc_release(a, p->id, n, sizeof *p->id);
    ascc_release(a, p->wall_position, w, d * sizeof *p->wall_position);
    ascc_release(a, p->wall_normal, w, d * sizeof *p->wall_normal);
    ascc_release(a, p->wall_body, w, sizeof *p->wall_body);
    ascc_release(a, p->wall_id, w, sizeof *p->wall_id);
    ascc_release(a, p->wall_impulse, w, d * sizeof *p->wall_impulse);
    p->magic = 0;
    ascc_release(a, p, 1, sizeof *p);
    ascc_context_release(context);
}

/* ---- Room ---- */

/* One array of a kind that must grow with the others. */
typedef struct column {
    void **memory;
    size_t element;
} column;

/* Grows all columns to the same capacity, or none: new memory first, then the old is dropped. */
static bool grow_columns(const ascc_allocator *a, const column *columns, size_t column_count,
                         size_t used, size_t *capacity, size_t wanted)
{
    if (wanted <= *capacity)
        return true;
    void *fresh[8] = {NULL};
    const size_t room = ascc_max_size(wanted, *capacity + *capacity / 2);
    for (size_t i = 0; i < column_count; i++) {
        fresh[i] = ascc_allocate(a, room, columns[i].element);
        if (!fresh[i]) {
            while (i-- > 0)
                ascc_release(a, fresh[i], room, columns[i].element);
            return false;
        }
    }
    for (size_t i = 0; i < column_count; i++) {
        if (used)
            memcpy(fresh[i], *columns[i].memory, used * columns[i].element);
        ascc_release(a, *columns[i].memory, *capacity, columns[i].element);
        *columns[i].memory = fresh[i];
    }
    *capacity = room;
    return true;
}

static bool reserve_fluid(ascc_particles *p, size_t count)
{
    const size_t d = (size_t)p->dimension;
    const column columns[] = {{(void **)&p->position, d * sizeof *p->position},
                              {(void **)&p->momentum, d * sizeof *p->momentum},
                              {(void **)&p->mass, sizeof *p->mass},
                              {(void **)&p->id, sizeof *p->id}};
    return grow_columns(&p->context->allocator, columns, 4, p->fluid_count, &p->fluid_capacity,
                        count);
}

static bool reserve_boundary(ascc_particles *p, size_t count)
{
    const size_t d = (size_t)p->dimension;
    const column columns[] = {{(void **)&p->wall_position, d * sizeof *p->wall_position},
                              {(void **)&p->wall_normal, d * sizeof *p->wall_normal},
                              {(void **)&p->wall_body, sizeof *p->wall_body},
                              {(void **)&p->wall_id, sizeof *p->wall_id},
                              {(void **)&p->wall_impulse, d * sizeof *p->wall_impulse}};
    return grow_columns(&p->context->allocator, columns, 5, p->boundary_count,
                        &p->boundary_capacity, count);
}

ascc_status ascc_particles_reserve(ascc_particles *particles, size_t fluid, size_t boundary)
{
    if (!valid(particles))
        return ASCC_ERROR_ARGUMENT;
    if (!reserve_fluid(particles, fluid) || !reserve_boundary(particles, boundary))
        return ascc_particles_fail(particles, ASCC_ERROR_MEMORY,
                                   "no memory for %zu fluid and %zu boundary particles", fluid,
                                   boundary);
    return ASCC_OK;
}

/* ---- Checking what the host gives ---- */

static bool given(const ascc_const_array *array)
{
    return array && array->data;
}

static ascc_status check_array(ascc_particles *p, const char *name, const ascc_const_array *array)
{
    if (array->scalar != ASCC_FLOAT && array->scalar != ASCC_DOUBLE)
        return ascc_particles_fail(p, ASCC_ERROR_ARGUMENT, "%s: scalar = %d is no ascc_scalar",
                                   name, (int)array->scalar);
    return ASCC_OK;
}

static ascc_status check_positions(ascc_particles *p, size_t count, const ascc_const_array *array)
{
    const size_t d = (size_t)p->dimension;
    for (size_t i = 0; i < count; i++)
        for (size_t c = 0; c < d; c++) {
            const double x = ascc_array_read(array, i, c, d);
            if (!isfinite(x))
                return ascc_particles_fail(p, ASCC_ERROR_NOT_FINITE,
                                           "position: row %zu component %zu is %g", i, c, x);
            if (fabs(x) > ASCC_POSITION_LIMIT * p->spacing)
                return ascc_particles_fail(p, ASCC_ERROR_RANGE,
                                           "position: row %zu component %zu = %g is out of range",
                                           i, c, x);
        }
    return ASCC_OK;
}

static ascc_status check_masses(ascc_particles *p, size_t count, const ascc_const_array *array)
{
    for (size_t i = 0; i < count; i++) {
        const double m = ascc_array_read(array, i, 0, 1);
        if (!isfinite(m))
            return ascc_particles_fail(p, ASCC_ERROR_NOT_FINITE, "mass: row %zu is %g", i, m);
        if (!(m > 0.0))
            return ascc_particles_fail(p, ASCC_ERROR_ARGUMENT, "mass: row %zu = %g is not positive",
                                       i, m);
    }
    return ASCC_OK;
}

/* Velocities that these masses turn into momenta that can be held. mass NULL: the rows' own, from
 * `first` on; a given array: those. */
static ascc_status check_velocities(ascc_particles *p, size_t count, const ascc_const_array *array,
                                    const ascc_const_array *mass, const double *own)
{
    const size_t d = (size_t)p->dimension;
    for (size_t i = 0; i < count; i++) {
        const double m = given(mass) ? ascc_array_read(mass, i, 0, 1)
                         : own       ? own[i]
                                     : p->default_mass;
        for (size_t c = 0; c < d; c++) {
            const double v = ascc_array_read(array, i, c, d);
            int64_t quanta;
            if (!isfinite(v))
                return ascc_particles_fail(p, ASCC_ERROR_NOT_FINITE,
                                           "velocity: row %zu component %zu is %g", i, c, v);
            if (!ascc_to_quanta(m * v, p->quantum, &quanta))
                return ascc_particles_fail(p, ASCC_ERROR_RANGE,
                                           "velocity: row %zu component %zu = %g: momentum too "
                                           "large to hold",
                                           i, c, v);
        }
    }
    return ASCC_OK;
}

static ascc_status check_normals(ascc_particles *p, size_t count, const ascc_const_array *array)
{
    const size_t d = (size_t)p->dimension;
    for (size_t i = 0; i < count; i++) {
        double square = 0.0;
        for (size_t c = 0; c < d; c++) {
            const double x = ascc_array_read(array, i, c, d);
            if (!isfinite(x))
                return ascc_particles_fail(p, ASCC_ERROR_NOT_FINITE,
                                           "normal: row %zu component %zu is %g", i, c, x);
            square += x * x;
        }
        if (fabs(sqrt(square) - 1.0) > NORMAL_TOLERANCE)
            return ascc_particles_fail(p, ASCC_ERROR_ARGUMENT,
                                       "normal: row %zu has length %g, not 1", i, sqrt(square));
    }
    return ASCC_OK;
}

static ascc_status check_room(ascc_particles *p, size_t have, size_t count)
{
    if (count >= UINT32_MAX || have + count >= UINT32_MAX)
        return ascc_particles_fail(p, ASCC_ERROR_MEMORY, "%zu particles more do not fit", count);
    return ASCC_OK;
}

/* ---- Storing what was checked ---- */

static void store_vectors(double *to, size_t count, size_t d, const ascc_const_array *array)
{
    for (size_t i = 0; i < count; i++)
        for (size_t c = 0; c < d; c++)
            to[i * d + c] = ascc_array_read(array, i, c, d);
}

static void store_velocities(ascc_particles *p, size_t first, size_t count,
                             const ascc_const_array *array)
{
    const size_t d = (size_t)p->dimension;
    for (size_t i = 0; i < count; i++)
        for (size_t c = 0; c < d; c++) {
            int64_t quanta = 0;
            if (given(array))
                (void)ascc_to_quanta(p->mass[first + i] * ascc_array_read(array, i, c, d),
                                     p->quantum, &quanta);
            p->momentum[(first + i) * d + c] = quanta;
        }
}

ascc_status ascc_particles_add_fluid(ascc_particles *p, size_t count,
                                     const ascc_const_array *position,
                                     const ascc_const_array *velocity, const ascc_const_array *mass,
                                     uint64_t *ids)
{
    if (!valid(p))
        return ASCC_ERROR_ARGUMENT;
    if (count && !given(position))
        return ascc_particles_fail(p, ASCC_ERROR_ARGUMENT, "position: missing");
    ascc_status status = check_room(p, p->fluid_count, count);
    if (status == ASCC_OK && count)
        status = check_array(p, "position", position);
    if (status == ASCC_OK && count)
        status = check_positions(p, count, position);
    if (status == ASCC_OK && given(mass) && (status = check_array(p, "mass", mass)) == ASCC_OK)
        status = check_masses(p, count, mass);
    if (status == ASCC_OK && given(velocity) &&
        (status = check_array(p, "velocity", velocity)) == ASCC_OK)
        status = check_velocities(p, count, velocity, mass, NULL);
    if (status != ASCC_OK)
        return status;
    if (!reserve_fluid(p, p->fluid_count + count))
        return ascc_particles_fail(p, ASCC_ERROR_MEMORY, "no memory for %zu fluid particles more",
                                   count);
    const size_t first = p->fluid_count, d = (size_t)p->dimension;
    store_vectors(p->position + first * d, count, d, position);
    for (size_t i = 0; i < count; i++) {
        p->mass[first + i] = given(mass) ? ascc_array_read(mass, i, 0, 1) : p->default_mass;
        p->id[first + i] = p->next_id++;
    }
    store_velocities(p, first, count, velocity);
    p->fluid_count += count;
    if (ids && count)
        memcpy(ids, p->id + first, count * sizeof *ids);
    return ASCC_OK;
}

ascc_status ascc_particles_add_boundary(ascc_particles *p, size_t count,
                                        const ascc_const_array *position,
                                        const ascc_const_array *normal, int32_t body, uint64_t *ids)
{
    if (!valid(p))
        return ASCC_ERROR_ARGUMENT;
    if (count && (!given(position) || !given(normal)))
        return ascc_particles_fail(p, ASCC_ERROR_ARGUMENT, "%s: missing",
                                   given(position) ? "normal" : "position");
    if (body < 0)
        return ascc_particles_fail(p, ASCC_ERROR_ARGUMENT, "body = %d is negative", body);
    ascc_status status = check_room(p, p->boundary_count, count);
    if (status == ASCC_OK && count)
        status = check_array(p, "position", position);
    if (status == ASCC_OK && count)
        status = check_array(p, "normal", normal);
    if (status == ASCC_OK && count)
        status = check_positions(p, count, position);
    if (status == ASCC_OK && count)
        status = check_normals(p, count, normal);
    if (status != ASCC_OK)
        return status;
    if (!reserve_boundary(p, p->boundary_count + count))
        return ascc_particles_fail(p, ASCC_ERROR_MEMORY,
                                   "no memory for %zu boundary particles more", count);
    const size_t first = p->boundary_count, d = (size_t)p->dimension;
    store_vectors(p->wall_position + first * d, count, d, position);
    store_vectors(p->wall_normal + first * d, count, d, normal);
    for (size_t i = first; i < first + count; i++) {
        p->wall_body[i] = body;
        p->wall_id[i] = p->next_id++;
        memset(p->wall_impulse + i * d, 0, d * sizeof *p->wall_impulse);
    }
    p->boundary_count += count;
    if (ids && count)
        memcpy(ids, p->wall_id + first, count * sizeof *ids);
    return ASCC_OK;
}

/* ---- Finding and removing ---- */

static bool find_in(const uint64_t *ids, size_t count, uint64_t id, size_t *row)
{
    size_t low = 0, high = count;
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        if (ids[middle] < id)
            low = middle + 1;
        else
            high = middle;
    }
    *row = low;
    return low < count && ids[low] == id;
}

ascc_status ascc_particles_find(const ascc_particles *p, uint64_t id, ascc_kind *kind, size_t *row)
{
    size_t found;
    if (!valid(p) || !kind || !row)
        return ASCC_ERROR_ARGUMENT;
    if (find_in(p->id, p->fluid_count, id, &found))
        *kind = ASCC_FLUID;
    else if (find_in(p->wall_id, p->boundary_count, id, &found))
        *kind = ASCC_BOUNDARY;
    else
        return ASCC_ERROR_ARGUMENT;
    *row = found;
    return ASCC_OK;
}

static void remove_fluid_row(ascc_particles *p, size_t to, size_t from)
{
    const size_t d = (size_t)p->dimension;
    memmove(p->position + to * d, p->position + from * d, d * sizeof *p->position);
    memmove(p->momentum + to * d, p->momentum + from * d, d * sizeof *p->momentum);
    p->mass[to] = p->mass[from];
    p->id[to] = p->id[from];
}

static void remove_wall_row(ascc_particles *p, size_t to, size_t from)
{
    const size_t d = (size_t)p->dimension;
    memmove(p->wall_position + to * d, p->wall_position + from * d, d * sizeof(double));
    memmove(p->wall_normal + to * d, p->wall_normal + from * d, d * sizeof(double));
    memmove(p->wall_impulse + to * d, p->wall_impulse + from * d, d * sizeof(int64_t));
    p->wall_body[to] = p->wall_body[from];
    p->wall_id[to] = p->wall_id[from];
}

ascc_status ascc_particles_remove(ascc_particles *p, size_t count, const uint64_t *ids)
{
    if (!valid(p))
        return ASCC_ERROR_ARGUMENT;
    if (count && !ids)
        return ascc_particles_fail(p, ASCC_ERROR_ARGUMENT, "ids: missing");
    /* One flag a row: fluid, then boundary. */
    const size_t rows = p->fluid_count + p->boundary_count;
    uint8_t *gone = ascc_allocate(&p->context->allocator, rows, 1);
    if (!gone)
        return ascc_particles_fail(p, ASCC_ERROR_MEMORY, "no memory to remove %zu particles",
                                   count);
    memset(gone, 0, rows);
    ascc_status status = ASCC_OK;
    for (size_t k = 0; status == ASCC_OK && k < count; k++) {
        ascc_kind kind;
        size_t row;
        if (ascc_particles_find(p, ids[k], &kind, &row) != ASCC_OK)
            status =
                ascc_particles_fail(p, ASCC_ERROR_ARGUMENT,
                                    "ids: entry %zu: no particle has the id %" PRIu64, k, ids[k]);
        else if (gone[row += kind == ASCC_FLUID ? 0 : p->fluid_count]++)
            status =
                ascc_particles_fail(p, ASCC_ERROR_ARGUMENT,
                                    "ids: entry %zu: the id %" PRIu64 " is given twice", k, ids[k]);
    }
    if (status == ASCC_OK) {
        size_t fluid = 0, walls = 0;
        for (size_t i = 0; i < p->fluid_count; i++)
            if (!gone[i])
                remove_fluid_row(p, fluid++, i);
        for (size_t i = 0; i < p->boundary_count; i++)
            if (!gone[p->fluid_count + i])
                remove_wall_row(p, walls++, i);
        p->fluid_count = fluid;
        p->boundary_count = walls;
    }
    ascc_release(&p->context->allocator, gone, rows, 1);
    return status;
}

ascc_status ascc_particles_clear(ascc_particles *p, ascc_kind kind)
{
    if (!valid(p))
        return ASCC_ERROR_ARGUMENT;
    if (kind == ASCC_FLUID)
        p->fluid_count = 0;
    else if (kind == ASCC_BOUNDARY)
        p->boundary_count = 0;
    else
        return ascc_particles_fail(p, ASCC_ERROR_ARGUMENT, "kind = %d is no ascc_kind", (int)kind);
    return ASCC_OK;
}

ascc_status ascc_particles_resize_fluid(ascc_particles *p, size_t count)
{
    if (!valid(p))
        return ASCC_ERROR_ARGUMENT;
    if (count <= p->fluid_count) {
        p->fluid_count = count;
        return ASCC_OK;
    }
    const size_t first = p->fluid_count, d = (size_t)p->dimension;
    const ascc_status status = check_room(p, first, count - first);
    if (status != ASCC_OK)
        return status;
    if (!reserve_fluid(p, count))
        return ascc_particles_fail(p, ASCC_ERROR_MEMORY, "no memory for %zu fluid particles",
                                   count);
    memset(p->position + first * d, 0, (count - first) * d * sizeof *p->position);
    memset(p->momentum + first * d, 0, (count - first) * d * sizeof *p->momentum);
    for (size_t i = first; i < count; i++) {
        p->mass[i] = p->default_mass;
        p->id[i] = p->next_id++;
    }
    p->fluid_count = count;
    return ASCC_OK;
}

/* ---- Sizes ---- */

size_t ascc_particles_count(const ascc_particles *p, ascc_kind kind)
{
    return !valid(p)               ? 0
           : kind == ASCC_FLUID    ? p->fluid_count
           : kind == ASCC_BOUNDARY ? p->boundary_count
                                   : 0;
}

size_t ascc_particles_capacity(const ascc_particles *p, ascc_kind kind)
{
    return !valid(p)               ? 0
           : kind == ASCC_FLUID    ? p->fluid_capacity
           : kind == ASCC_BOUNDARY ? p->boundary_capacity
                                   : 0;
}

int32_t ascc_particles_dimension(const ascc_particles *p)
{
    return valid(p) ? p->dimension : 0;
}

double ascc_particles_momentum_quantum(const ascc_particles *p)
{
    return valid(p) ? p->quantum : 0.0;
}

/* ---- Set and get ---- */

static bool rows_valid(const ascc_particles *p, ascc_kind kind, size_t first, size_t count)
{
    const size_t rows = ascc_particles_count(p, kind);
    return first <= rows && count <= rows - first;
}

static bool field_valid(ascc_kind kind, ascc_field field)
{
    return field == ASCC_POSITION ||
           (kind == ASCC_FLUID ? field == ASCC_VELOCITY || field == ASCC_MASS
                               : kind == ASCC_BOUNDARY && field == ASCC_NORMAL);
}

static ascc_status set_masses(ascc_particles *p, size_t first, size_t count,
                              const ascc_const_array *values)
{
    const size_t d = (size_t)p->dimension;
    ascc_status status = check_masses(p, count, values);
    for (size_t i = 0; status == ASCC_OK && i < count; i++)
        for (size_t c = 0; c < d; c++) {
            int64_t quanta;
            if (!ascc_to_quanta(ascc_array_read(values, i, 0, 1) *
                                    ascc_velocity(p, first + i, (int32_t)c),
                                p->quantum, &quanta))
                return ascc_particles_fail(p, ASCC_ERROR_RANGE,
                                           "mass: row %zu: momentum too large to hold", first + i);
        }
    for (size_t i = 0; status == ASCC_OK && i < count; i++) {
        const double mass = ascc_array_read(values, i, 0, 1);
        for (size_t c = 0; c < d; c++)
            (void)ascc_to_quanta(mass * ascc_velocity(p, first + i, (int32_t)c), p->quantum,
                                 &p->momentum[(first + i) * d + c]);
        p->mass[first + i] = mass;
    }
    return status;
}

ascc_status ascc_particles_set(ascc_particles *p, ascc_kind kind, ascc_field field, size_t first,
                               size_t count, const ascc_const_array *values)
{
    if (!valid(p))
        return ASCC_ERROR_ARGUMENT;
    if (!field_valid(kind, field))
        return ascc_particles_fail(p, ASCC_ERROR_ARGUMENT, "kind %d has no field %d", (int)kind,
                                   (int)field);
    if (!rows_valid(p, kind, first, count))
        return ascc_particles_fail(p, ASCC_ERROR_ARGUMENT,
                                   "rows %zu to %zu are beyond the %zu there are", first,
                                   first + count, ascc_particles_count(p, kind));
    if (!count)
        return ASCC_OK;
    if (!given(values))
        return ascc_particles_fail(p, ASCC_ERROR_ARGUMENT, "values: missing");
    const size_t d = (size_t)p->dimension;
    ascc_status status = check_array(p, "values", values);
    if (status != ASCC_OK)
        return status;
    switch (field) {
    case ASCC_POSITION:
        if ((status = check_positions(p, count, values)) == ASCC_OK)
            store_vectors((kind == ASCC_FLUID ? p->position : p->wall_position) + first * d, count,
                          d, values);
        return status;
    case ASCC_VELOCITY:
        if ((status = check_velocities(p, count, values, NULL, p->mass + first)) == ASCC_OK)
            store_velocities(p, first, count, values);
        return status;
    case ASCC_NORMAL:
        if ((status = check_normals(p, count, values)) == ASCC_OK)
            store_vectors(p->wall_normal + first * d, count, d, values);
        return status;
    case ASCC_MASS:
        return set_masses(p, first, count, values);
    }
    return ASCC_ERROR_ARGUMENT;
}

static double field_value(const ascc_particles *p, ascc_kind kind, ascc_field field, size_t i,
                          size_t c)
{
    const size_t k = i * (size_t)p->dimension + c;
    switch (field) {
    case ASCC_POSITION:
        return kind == ASCC_FLUID ? p->position[k] : p->wall_position[k];
    case ASCC_VELOCITY:
        return ascc_velocity(p, i, (int32_t)c);
    case ASCC_MASS:
        return p->mass[i];
    case ASCC_NORMAL:
        return p->wall_normal[k];
    }
    return 0.0;
}

ascc_status ascc_particles_get(const ascc_particles *p, ascc_kind kind, ascc_field field,
                               size_t first, size_t count, const ascc_array *values)
{
    if (!valid(p) || !field_valid(kind, field) || !rows_valid(p, kind, first, count) ||
        (count && (!values || !values->data ||
                   (values->scalar != ASCC_FLOAT && values->scalar != ASCC_DOUBLE))))
        return ASCC_ERROR_ARGUMENT;
    const size_t components = field == ASCC_MASS ? 1 : (size_t)p->dimension;
    for (size_t i = 0; i < count; i++)
        for (size_t c = 0; c < components; c++)
            ascc_array_write(values, i, c, components, field_value(p, kind, field, first + i, c));
    return ASCC_OK;
}

ascc_status ascc_particles_get_ids(const ascc_particles *p, ascc_kind kind, size_t first,
                                   size_t count, uint64_t *ids)
{
    if (!valid(p) || (kind != ASCC_FLUID && kind != ASCC_BOUNDARY) ||
        !rows_valid(p, kind, first, count) || (count && !ids))
        return ASCC_ERROR_ARGUMENT;
    if (count)
        memcpy(ids, (kind == ASCC_FLUID ? p->id : p->wall_id) + first, count * sizeof *ids);
    return ASCC_OK;
}

ascc_status ascc_particles_get_bodies(const ascc_particles *p, size_t first, size_t count,
                                      int32_t *bodies)
{
    if (!valid(p) || !rows_valid(p, ASCC_BOUNDARY, first, count) || (count && !bodies))
        return ASCC_ERROR_ARGUMENT;
    if (count)
        memcpy(bodies, p->wall_body + first, count * sizeof *bodies);
    return ASCC_OK;
}

/* ---- Momentum ---- */

ascc_status ascc_particles_get_momentum(const ascc_particles *p, size_t first, size_t count,
                                        int64_t *momentum)
{
    if (!valid(p) || !rows_valid(p, ASCC_FLUID, first, count) || (count && !momentum))
        return ASCC_ERROR_ARGUMENT;
    const size_t d = (size_t)p->dimension;
    if (count)
        memcpy(momentum, p->momentum + first * d, count * d * sizeof *momentum);
    return ASCC_OK;
}

/* A sum of many 64-bit integers, exact: high words and low words apart. */
typedef struct wide_sum {
    int64_t high;
    uint64_t low;
} wide_sum;

static void wide_add(wide_sum *sum, int64_t value)
{
    sum->high += value >> 32;
    sum->low += (uint64_t)value & 0xffffffffu;
}

static bool wide_value(const wide_sum *sum, int64_t *value)
{
    const int64_t high = sum->high + (int64_t)(sum->low >> 32);
    if (high > INT32_MAX || high < INT32_MIN)
        return false;
    *value = (int64_t)((uint64_t)high << 32 | (sum->low & 0xffffffffu));
    return true;
}

ascc_status ascc_particles_total_momentum(const ascc_particles *p, int64_t total[3])
{
    if (!valid(p) || !total)
        return ASCC_ERROR_ARGUMENT;
    const size_t d = (size_t)p->dimension;
    wide_sum sum[3] = {{0, 0}, {0, 0}, {0, 0}};
    int64_t value[3];
    for (size_t i = 0; i < p->fluid_count; i++)
        for (size_t c = 0; c < d; c++)
            wide_add(&sum[c], p->momentum[i * d + c]);
    for (size_t c = 0; c < 3; c++)
        if (!wide_value(&sum[c], &value[c]))
            return ASCC_ERROR_RANGE;
    memcpy(total, value, sizeof value);
    return ASCC_OK;
}

ascc_status ascc_particles_body_impulse(const ascc_particles *p, int32_t body,
                                        const double point[3], int64_t impulse[3], double torque[3])
{
    if (!valid(p) || body < -1)
        return ASCC_ERROR_ARGUMENT;
    const size_t d = (size_t)p->dimension;
    wide_sum sum[3] = {{0, 0}, {0, 0}, {0, 0}};
    double turn[3] = {0.0, 0.0, 0.0};
    for (size_t i = 0; i < p->boundary_count; i++) {
        if (body >= 0 && p->wall_body[i] != body)
            continue;
        double r[3] = {0.0, 0.0, 0.0}, j[3] = {0.0, 0.0, 0.0};
        for (size_t c = 0; c < d; c++) {
            wide_add(&sum[c], p->wall_impulse[i * d + c]);
            r[c] = p->wall_position[i * d + c] - (point ? point[c] : 0.0);
            j[c] = (double)p->wall_impulse[i * d + c] * p->quantum;
        }
        turn[0] += r[1] * j[2] - r[2] * j[1];
        turn[1] += r[2] * j[0] - r[0] * j[2];
        turn[2] += r[0] * j[1] - r[1] * j[0];
    }
    int64_t value[3];
    for (size_t c = 0; c < 3; c++)
        if (!wide_value(&sum[c], &value[c]))
            return ASCC_ERROR_RANGE;
    if (impulse)
        memcpy(impulse, value, sizeof value);
    if (torque)
        memcpy(torque, turn, sizeof turn);
    return ASCC_OK;
}
