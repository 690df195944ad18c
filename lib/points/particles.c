/* Life of a particle set: making it, adding particles and removing them.
 * SPDX-License-Identifier: MIT */
#include "particles.h"

#include "bodies.h"
#include "rest.h"

#include <stdio.h>
#include <string.h>

/* The first released layout. */
#define FIRST_OPTIONS_SIZE sizeof(ascc_particles_options)
_Static_assert(sizeof(void *) != 8 || FIRST_OPTIONS_SIZE == 56, "layout is part of the ABI");
_Static_assert(sizeof(void *) != 8 || sizeof(ascc_const_array) == 32, "part of the ABI");
_Static_assert(sizeof(void *) != 8 || sizeof(ascc_array) == 32, "part of the ABI");

/* The default quantum is this power of two below mass * spacing. */
#define QUANTUM_EXPONENT (-28)

/* kg/m^3; in 2D of a layer one metre deep. */
#define WATER_DENSITY 1000.0

/* ---- Failures -------------------------------------------------------------------------------- */

static void write_line(ascc_message *message, ascc_status status, const char *format,
                       va_list arguments)
{
    char text[ASCC_MESSAGE_CAPACITY];
    if (vsnprintf(text, sizeof text, format, arguments) < 0)
        text[0] = '\0';
    ascc_fail(message, status, "%s", text);
}

ascc_status ascc_particles_fail(ascc_particles *particles, ascc_status status, const char *format,
                                ...)
{
    va_list arguments;
    va_start(arguments, format);
    write_line(&particles->message, status, format, arguments);
    va_end(arguments);
    ascc_context_log(particles->context, particles->message.text);
    return status;
}

ascc_status ascc_particles_fail_reading(const ascc_particles *particles, ascc_status status,
                                        const char *format, ...)
{
    ascc_message message;
    va_list arguments;
    va_start(arguments, format);
    write_line(&message, status, format, arguments);
    va_end(arguments);
    return ascc_context_fail(particles->context, status, &message);
}

const char *ascc_particles_message(const ascc_particles *particles)
{
    return ascc_particles_is_set(particles) ? particles->message.text : "";
}

/* ---- Life ------------------------------------------------------------------------------------ */

static double default_mass(int32_t dimension, double spacing)
{
    const double area = spacing * spacing;
    return WATER_DENSITY * (dimension == 3 ? area * spacing : area);
}

/* 0 or infinite where mass * spacing leaves the range of numbers. */
static double default_quantum(double mass, double spacing)
{
    int exponent;
    if (!isfinite(mass * spacing))
        return (double)INFINITY;
    (void)frexp(mass * spacing, &exponent); /* mass * spacing = f * 2^exponent, f in [1/2, 1) */
    return ldexp(1, exponent - 1 + QUANTUM_EXPONENT);
}

/* Checks the options and writes the defaults into them. */
static ascc_status settle_options(ascc_particles_options *options, ascc_message *message)
{
    if (options->dimension != 2 && options->dimension != 3)
        return ascc_fail(message, ASCC_ERROR_ARGUMENT, "particles: dimension is %ld, not 2 or 3",
                         (long)options->dimension);
    if (options->reserved != 0)
        return ascc_fail(message, ASCC_ERROR_ARGUMENT, "particles: reserved is %ld, not 0",
                         (long)options->reserved);
    if (!ascc_is_spacing(options->spacing))
        return ascc_fail(message, ASCC_ERROR_ARGUMENT, "particles: spacing is %g",
                         ascc_readable(options->spacing));
    const bool no_mass = options->mass == 0, no_quantum = options->momentum_quantum == 0;
    if (no_mass)
        options->mass = default_mass(options->dimension, options->spacing);
    if (no_mass && !ascc_is_mass(options->mass))
        return ascc_fail(message, ASCC_ERROR_ARGUMENT,
                         "particles: spacing %g has no default mass: %g kg", options->spacing,
                         options->mass);
    if (!ascc_is_mass(options->mass))
        return ascc_fail(message, ASCC_ERROR_ARGUMENT, "particles: mass is %g",
                         ascc_readable(options->mass));
    if (no_quantum)
        options->momentum_quantum = default_quantum(options->mass, options->spacing);
    if (no_quantum && !ascc_is_quantum(options->momentum_quantum))
        return ascc_fail(message, ASCC_ERROR_ARGUMENT,
                         "particles: mass %g times spacing %g has no default momentum_quantum",
                         options->mass, options->spacing);
    if (!ascc_is_quantum(options->momentum_quantum))
        return ascc_fail(message, ASCC_ERROR_ARGUMENT, "particles: momentum_quantum is %g",
                         ascc_readable(options->momentum_quantum));
    return ASCC_OK;
}

static ascc_status make(ascc_context *context, const ascc_particles_options *options,
                        ascc_particles **particles, ascc_message *message)
{
    ascc_particles *const made = ascc_allocate(&context->allocator, 1, sizeof *made);
    if (made == NULL)
        return ascc_fail(message, ASCC_ERROR_MEMORY, "particles: out of memory");
    *made = (ascc_particles){
        .dimension = options->dimension,
        .context = context,
        .spacing = options->spacing,
        .default_mass = options->mass,
        .quantum = options->momentum_quantum,
        .next_id = 1,
    };
    if (!ascc_particles_make_room(made, options->fluid_capacity, options->boundary_capacity)) {
        ascc_release(&context->allocator, made, 1, sizeof *made);
        return ascc_fail(message, ASCC_ERROR_MEMORY,
                         "particles: out of memory for %zu fluid and %zu boundary particles",
                         options->fluid_capacity, options->boundary_capacity);
    }
    made->magic = ASCC_PARTICLES_MAGIC;
    ascc_context_retain(context);
    *particles = made;
    return ASCC_OK;
}

ascc_status ascc_particles_create(ascc_context *context, const ascc_particles_options *options,
                                  ascc_particles **particles)
{
    ASCC_FLOAT_SCOPE;
    if (particles == NULL)
        return ASCC_ERROR_ARGUMENT;
    *particles = NULL;
    if (context == NULL || context->magic != ASCC_CONTEXT_MAGIC)
        return ASCC_ERROR_ARGUMENT;

    ascc_particles_options read;
    ascc_message message;
    ascc_status status;
    if (options == NULL || !ascc_read_struct(&read, sizeof read, options, FIRST_OPTIONS_SIZE))
        status = ascc_fail(&message, ASCC_ERROR_ARGUMENT,
                           "particles: options are NULL, or of a size not known here");
    else
        status = settle_options(&read, &message);
    if (status == ASCC_OK)
        status = make(context, &read, particles, &message);
    return status == ASCC_OK ? status : ascc_context_fail(context, status, &message);
}

void ascc_particles_destroy(ascc_particles **particles)
{
    if (particles == NULL || !ascc_particles_is_set(*particles))
        return;
    ascc_particles *const old = *particles;
    *particles = NULL;
    ascc_context *const context = old->context;
    ascc_particles_release_rows(old);
    ascc_release(&context->allocator, old->bodies, old->body_capacity, sizeof *old->bodies);
    old->magic = 0;
    ascc_release(&context->allocator, old, 1, sizeof *old);
    ascc_context_release(context);
}

ascc_status ascc_particles_reserve(ascc_particles *particles, size_t fluid, size_t boundary)
{
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    if (!ascc_particles_make_room(particles, fluid, boundary))
        return ascc_particles_fail(particles, ASCC_ERROR_MEMORY,
                                   "out of memory for %zu fluid and %zu boundary particles", fluid,
                                   boundary);
    return ASCC_OK;
}

/* ---- Adding ---------------------------------------------------------------------------------- */

/* Room for a host that adds again and again. */
static size_t grown_capacity(size_t capacity, size_t count)
{
    return count <= capacity ? capacity : ascc_max_size(count, capacity + capacity / 2);
}

static ascc_status fail_memory(ascc_message *message, size_t count, const char *kind)
{
    return ascc_fail(message, ASCC_ERROR_MEMORY, "out of memory for %zu more %s particles", count,
                     kind);
}

/* Whether that many rows more can be in any memory and have ids; asked before the host's arrays are
 * read. */
static ascc_status check_count(const ascc_particles *particles, ascc_kind kind, size_t count,
                               ascc_message *message)
{
    const size_t rows = ascc_particles_count(particles, kind);
    if (count > SIZE_MAX - rows || !ascc_particles_can_hold(particles, kind, rows + count))
        return fail_memory(message, count, kind == ASCC_FLUID ? "fluid" : "boundary");
    if (count > ASCC_ID_LIMIT - particles->next_id)
        return ascc_fail(message, ASCC_ERROR_RANGE,
                         "ids: the next is %llu, and %zu more would go beyond 2^63",
                         (unsigned long long)particles->next_id, count);
    return ASCC_OK;
}

/* Gives rows [first, first + count) the next ids, and tells the host. */
static void give_ids(ascc_particles *particles, uint64_t *rows, size_t first, size_t count,
                     uint64_t *ids)
{
    for (size_t row = 0; row < count; row++) {
        rows[first + row] = particles->next_id++;
        if (ids != NULL)
            ids[row] = rows[first + row];
    }
}

/* The host's numbers for new fluid, opened and checked. */
typedef struct new_fluid {
    ascc_host_array position, velocity, mass;
} new_fluid;

static ascc_status open_fluid(const ascc_particles *particles, size_t count,
                              const ascc_const_array *position, const ascc_const_array *velocity,
                              const ascc_const_array *mass, new_fluid *from, ascc_message *message)
{
    static const double rest = 0;
    const int32_t d = particles->dimension;
    from->velocity = ascc_host_array_repeat("velocity", &rest);
    from->mass = ascc_host_array_repeat("mass", &particles->default_mass);
    ascc_status status = ascc_host_array_open("position", position, d, &from->position, message);
    if (status == ASCC_OK && !ascc_host_array_is_absent(velocity))
        status = ascc_host_array_open("velocity", velocity, d, &from->velocity, message);
    if (status == ASCC_OK && !ascc_host_array_is_absent(mass))
        status = ascc_host_array_open("mass", mass, 1, &from->mass, message);
    if (status == ASCC_OK)
        status = ascc_field_check(particles, ASCC_FIELD_position, &from->position, count, message);
    if (status == ASCC_OK)
        status = ascc_field_check(particles, ASCC_FIELD_mass, &from->mass, count, message);
    if (status == ASCC_OK)
        status = ascc_velocity_check(particles, &from->velocity, &from->mass, count, message);
    return status;
}

static ascc_status add_fluid(ascc_particles *particles, size_t count,
                             const ascc_const_array *position, const ascc_const_array *velocity,
                             const ascc_const_array *mass, uint64_t *ids, ascc_message *message)
{
    new_fluid from;
    ascc_status status = check_count(particles, ASCC_FLUID, count, message);
    if (status == ASCC_OK && count > 0)
        status = open_fluid(particles, count, position, velocity, mass, &from, message);
    if (status != ASCC_OK || count == 0)
        return status;
    const size_t first = particles->fluid_count;
    if (!ascc_particles_make_room(particles,
                                  grown_capacity(particles->fluid_capacity, first + count), 0))
        return fail_memory(message, count, "fluid");

    ascc_particles_zero_rows(particles, ASCC_FLUID, first, count);
    ascc_field_store(particles, ASCC_FIELD_position, &from.position, first, count);
    ascc_field_store(particles, ASCC_FIELD_mass, &from.mass, first, count);
    ascc_velocity_store(particles, &from.velocity, first, count);
    ascc_particles_fill_past(particles, first, count, 0);
    give_ids(particles, particles->id, first, count, ids);
    particles->fluid_count += count;
    ascc_rest_disturb(particles, ASCC_FLUID, first, count);
    return ASCC_OK;
}

ascc_status ascc_particles_add_fluid(ascc_particles *particles, size_t count,
                                     const ascc_const_array *position,
                                     const ascc_const_array *velocity, const ascc_const_array *mass,
                                     uint64_t *ids)
{
    ASCC_FLOAT_SCOPE;
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    ascc_message message;
    const ascc_status status = add_fluid(particles, count, position, velocity, mass, ids, &message);
    return status == ASCC_OK ? status : ascc_particles_fail(particles, status, "%s", message.text);
}

ascc_status ascc_particles_append_walls(ascc_particles *particles, size_t count, int32_t body,
                                        size_t *first, ascc_message *message)
{
    *first = particles->boundary_count;
    const ascc_status status = check_count(particles, ASCC_BOUNDARY, count, message);
    if (status != ASCC_OK)
        return status;
    if (!ascc_particles_make_room(particles, 0,
                                  grown_capacity(particles->boundary_capacity, *first + count)))
        return fail_memory(message, count, "boundary");
    ascc_particles_zero_rows(particles, ASCC_BOUNDARY, *first, count);
    for (size_t row = *first; row < *first + count; row++)
        particles->wall_body[row] = body;
    give_ids(particles, particles->wall_id, *first, count, NULL);
    particles->boundary_count += count;
    if (body >= particles->next_body)
        particles->next_body = (int64_t)body + 1;
    return ASCC_OK;
}

static ascc_status add_boundary(ascc_particles *particles, size_t count,
                                const ascc_const_array *position, const ascc_const_array *normal,
                                int32_t body, uint64_t *ids, ascc_message *message)
{
    ascc_status status = check_count(particles, ASCC_BOUNDARY, count, message);
    if (status != ASCC_OK)
        return status;
    if (body < 0)
        return ascc_fail(message, ASCC_ERROR_ARGUMENT, "body: %ld is negative", (long)body);
    if (ascc_bodies_find(particles, body) != NULL)
        return ascc_fail(message, ASCC_ERROR_ARGUMENT,
                         "body: %ld is one of ascc_body_add, whose points come with it",
                         (long)body);
    if (count == 0)
        return ASCC_OK;

    const int32_t d = particles->dimension;
    ascc_host_array positions, normals;
    size_t first;
    status = ascc_host_array_open("position", position, d, &positions, message);
    if (status == ASCC_OK)
        status = ascc_host_array_open("normal", normal, d, &normals, message);
    if (status == ASCC_OK)
        status = ascc_field_check(particles, ASCC_FIELD_wall_position, &positions, count, message);
    if (status == ASCC_OK)
        status = ascc_field_check(particles, ASCC_FIELD_wall_normal, &normals, count, message);
    if (status == ASCC_OK)
        status = ascc_particles_append_walls(particles, count, body, &first, message);
    if (status != ASCC_OK)
        return status;
    ascc_field_store(particles, ASCC_FIELD_wall_position, &positions, first, count);
    ascc_field_store(particles, ASCC_FIELD_wall_normal, &normals, first, count);
    ascc_rest_disturb(particles, ASCC_BOUNDARY, first, count);
    if (ids != NULL)
        memcpy(ids, particles->wall_id + first, count * sizeof *ids);
    return ASCC_OK;
}

ascc_status ascc_particles_add_boundary(ascc_particles *particles, size_t count,
                                        const ascc_const_array *position,
                                        const ascc_const_array *normal, int32_t body, uint64_t *ids)
{
    ASCC_FLOAT_SCOPE;
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    ascc_message message;
    const ascc_status status =
        add_boundary(particles, count, position, normal, body, ids, &message);
    return status == ASCC_OK ? status : ascc_particles_fail(particles, status, "%s", message.text);
}

static ascc_status add_resting(ascc_particles *particles, size_t count, ascc_message *message)
{
    const size_t first = particles->fluid_count, added = count - first;
    const ascc_status status = check_count(particles, ASCC_FLUID, added, message);
    if (status != ASCC_OK)
        return status;
    if (!ascc_particles_make_room(particles, grown_capacity(particles->fluid_capacity, count), 0))
        return fail_memory(message, added, "fluid");
    const ascc_host_array mass = ascc_host_array_repeat("mass", &particles->default_mass);
    ascc_particles_zero_rows(particles, ASCC_FLUID, first, added);
    ascc_field_store(particles, ASCC_FIELD_mass, &mass, first, added);
    give_ids(particles, particles->id, first, added, NULL);
    particles->fluid_count = count;
    ascc_rest_disturb(particles, ASCC_FLUID, first, added);
    return ASCC_OK;
}

ascc_status ascc_particles_resize_fluid(ascc_particles *particles, size_t count)
{
    ASCC_FLOAT_SCOPE;
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    if (count <= particles->fluid_count) {
        ascc_rest_disturb(particles, ASCC_FLUID, count, particles->fluid_count - count);
        particles->fluid_count = count;
        return ASCC_OK;
    }
    ascc_message message;
    const ascc_status status = add_resting(particles, count, &message);
    return status == ASCC_OK ? status : ascc_particles_fail(particles, status, "%s", message.text);
}

/* ---- Removing -------------------------------------------------------------------------------- */

/* Marks the rows that have these ids: fluid first, boundary after it. */
static ascc_status mark_rows(const ascc_particles *particles, size_t count, const uint64_t *ids,
                             unsigned char *marked, ascc_message *message)
{
    for (size_t i = 0; i < count; i++) {
        ascc_kind kind;
        size_t row;
        if (!ascc_particles_locate(particles, ids[i], &kind, &row))
            return ascc_fail(message, ASCC_ERROR_ARGUMENT,
                             "ids: row %zu is %llu, which no particle has", i,
                             (unsigned long long)ids[i]);
        unsigned char *const mark =
            marked + row + (kind == ASCC_FLUID ? 0 : particles->fluid_count);
        if (*mark)
            return ascc_fail(message, ASCC_ERROR_ARGUMENT, "ids: %llu is given twice",
                             (unsigned long long)ids[i]);
        *mark = 1;
    }
    return ASCC_OK;
}

ascc_status ascc_particles_remove(ascc_particles *particles, size_t count, const uint64_t *ids)
{
    ASCC_FLOAT_SCOPE;
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    if (count == 0)
        return ASCC_OK;
    if (ids == NULL)
        return ascc_particles_fail(particles, ASCC_ERROR_ARGUMENT, "ids: NULL");

    const ascc_allocator *const allocator = &particles->context->allocator;
    const size_t rows = particles->fluid_count + particles->boundary_count;
    unsigned char *const marked = ascc_allocate(allocator, rows, 1);
    if (marked == NULL)
        return ascc_particles_fail(particles, ASCC_ERROR_MEMORY,
                                   "out of memory for removing %zu particles", count);
    memset(marked, 0, rows);
    ascc_message message;
    const ascc_status status = mark_rows(particles, count, ids, marked, &message);
    if (status == ASCC_OK) {
        const size_t fluid = particles->fluid_count; /* before it shrinks */
        ascc_rest_disturb_marked(particles, ASCC_FLUID, marked);
        ascc_rest_disturb_marked(particles, ASCC_BOUNDARY, marked + fluid);
        ascc_particles_drop_rows(particles, ASCC_FLUID, marked);
        ascc_particles_drop_rows(particles, ASCC_BOUNDARY, marked + fluid);
    }
    ascc_release(allocator, marked, rows, 1);
    return status == ASCC_OK ? status : ascc_particles_fail(particles, status, "%s", message.text);
}

ascc_status ascc_particles_clear(ascc_particles *particles, ascc_kind kind)
{
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    if (kind == ASCC_FLUID)
        particles->fluid_count = 0;
    else if (kind == ASCC_BOUNDARY) {
        ascc_rest_end(particles);
        particles->boundary_count = particles->body_count = 0;
    } else
        return ascc_particles_fail(particles, ASCC_ERROR_ARGUMENT,
                                   "kind: %d is neither fluid nor boundary", (int)kind);
    return ASCC_OK;
}

/* ---- Sizes ----------------------------------------------------------------------------------- */

size_t ascc_particles_count(const ascc_particles *particles, ascc_kind kind)
{
    if (!ascc_particles_is_set(particles))
        return 0;
    return kind == ASCC_FLUID      ? particles->fluid_count
           : kind == ASCC_BOUNDARY ? particles->boundary_count
                                   : 0;
}

size_t ascc_particles_capacity(const ascc_particles *particles, ascc_kind kind)
{
    if (!ascc_particles_is_set(particles))
        return 0;
    return kind == ASCC_FLUID      ? particles->fluid_capacity
           : kind == ASCC_BOUNDARY ? particles->boundary_capacity
                                   : 0;
}

int32_t ascc_particles_dimension(const ascc_particles *particles)
{
    return ascc_particles_is_set(particles) ? particles->dimension : 0;
}

double ascc_particles_momentum_quantum(const ascc_particles *particles)
{
    return ascc_particles_is_set(particles) ? particles->quantum : 0;
}
