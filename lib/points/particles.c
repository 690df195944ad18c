/* Fluid and boundary arrays at one instant: adding, removing, setting, reading.
 * SPDX-License-Identifier: MIT
 *
 * The arrays of a kind lie in one block of memory, so growing them is one allocation that succeeds
 * or fails as a whole:
 *
 *     fluid     | position | momentum | mass | id |
 *     boundary  | position | normal   | impulse | id | body |
 *
 * Every call that changes the set reads the host's numbers twice: first to check them all, then,
 * when nothing can fail any more, to store them.
 */
#include "particles.h"

#include "base/host_array.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

/* The first released layout. */
#define FIRST_OPTIONS_SIZE sizeof(ascc_particles_options)
_Static_assert(sizeof(void *) != 8 || FIRST_OPTIONS_SIZE == 56, "layout is part of the ABI");
_Static_assert(sizeof(void *) != 8 || sizeof(ascc_const_array) == 32, "part of the ABI");
_Static_assert(sizeof(void *) != 8 || sizeof(ascc_array) == 32, "part of the ABI");

/* The default quantum is this power of two below mass * spacing. */
#define QUANTUM_EXPONENT (-28)

/* ---- Failures -------------------------------------------------------------------------------- */

ascc_status ascc_particles_fail(ascc_particles *particles, ascc_status status, const char *format,
                                ...)
{
    char text[ASCC_MESSAGE_CAPACITY];
    va_list arguments;
    va_start(arguments, format);
    if (vsnprintf(text, sizeof text, format, arguments) < 0)
        text[0] = '\0';
    va_end(arguments);
    ascc_fail(&particles->message, status, "%s", text);
    ascc_context_log(particles->context, particles->message.text);
    return status;
}

/* A NaN has a sign, which nobody wants to read. */
static double readable(double value)
{
    return isnan(value) ? fabs(value) : value;
}

static ascc_status fail_rows(const ascc_particles *particles, const char *what, size_t first,
                             size_t count, size_t rows)
{
    return ascc_particles_fail(ascc_particles_writable(particles), ASCC_ERROR_ARGUMENT,
                               "%s: rows [%zu, + %zu) go beyond the %zu there are", what, first,
                               count, rows);
}

static bool has_rows(size_t first, size_t count, size_t rows)
{
    return first <= rows && count <= rows - first;
}

const char *ascc_particles_message(const ascc_particles *particles)
{
    return ascc_particles_is_set(particles) ? particles->message.text : "";
}

/* ---- Numbers of the host --------------------------------------------------------------------- */

/* Where numbers are read from. Strides of zero repeat one number for ever. */
typedef struct source {
    const char *name; /* of the argument, for messages */
    const unsigned char *data;
    ptrdiff_t row, component;
    bool wide; /* double, not float */
} source;

static double read_number(const source *from, size_t row, int32_t component)
{
    const unsigned char *const at =
        from->data + (ptrdiff_t)row * from->row + component * from->component;
    return ascc_scalar_read(at, from->wide ? ASCC_DOUBLE : ASCC_FLOAT);
}

static source repeated(const char *name, const double *value)
{
    return (source){name, (const unsigned char *)value, 0, 0, true};
}

/* The host's array as a source; without rows any array will do. */
static ascc_status open_source(ascc_particles *particles, const char *name,
                               const ascc_const_array *array, size_t count, int32_t components,
                               source *from)
{
    static const double nothing = 0;
    *from = repeated(name, &nothing);
    if (count == 0)
        return ASCC_OK;
    if (array == NULL || array->data == NULL)
        return ascc_particles_fail(particles, ASCC_ERROR_ARGUMENT, "%s: NULL", name);
    if (!ascc_scalar_known(array->scalar) || array->reserved != 0)
        return ascc_particles_fail(particles, ASCC_ERROR_ARGUMENT,
                                   "%s: scalar %d, reserved %ld: not an array known here", name,
                                   (int)array->scalar, (long)array->reserved);
    const ptrdiff_t size = ascc_scalar_size(array->scalar);
    from->data = array->data;
    from->component = array->component_stride != 0 ? array->component_stride : size;
    from->row = array->stride != 0 ? array->stride : components * size;
    from->wide = array->scalar == ASCC_DOUBLE;
    return ASCC_OK;
}

static bool is_absent(const ascc_const_array *array)
{
    return array == NULL || array->data == NULL;
}

static ascc_status fail_number(ascc_particles *particles, ascc_status status, const source *from,
                               size_t row, int32_t component, double value, const char *why)
{
    return ascc_particles_fail(particles, status, "%s: row %zu component %ld is %g%s", from->name,
                               row, (long)component, readable(value), why);
}

/* ---- Checks of one field --------------------------------------------------------------------- */

static ascc_status check_positions(ascc_particles *particles, const source *from, size_t count)
{
    const double limit = ASCC_POSITION_LIMIT * particles->spacing;
    for (size_t row = 0; row < count; row++) {
        for (int32_t c = 0; c < particles->dimension; c++) {
            const double value = read_number(from, row, c);
            if (!isfinite(value))
                return fail_number(particles, ASCC_ERROR_NOT_FINITE, from, row, c, value, "");
            if (fabs(value) > limit)
                return fail_number(particles, ASCC_ERROR_RANGE, from, row, c, value,
                                   ", beyond 2^40 spacings");
        }
    }
    return ASCC_OK;
}

static ascc_status check_masses(ascc_particles *particles, const source *from, size_t count)
{
    for (size_t row = 0; row < count; row++) {
        const double mass = read_number(from, row, 0);
        if (!ascc_is_mass(mass))
            return ascc_particles_fail(particles, ASCC_ERROR_ARGUMENT,
                                       "%s: row %zu is %g, not a mass", from->name, row,
                                       readable(mass));
    }
    return ASCC_OK;
}

static ascc_status check_normals(ascc_particles *particles, const source *from, size_t count)
{
    for (size_t row = 0; row < count; row++) {
        double square = 0;
        for (int32_t c = 0; c < particles->dimension; c++) {
            const double value = read_number(from, row, c);
            if (!isfinite(value))
                return fail_number(particles, ASCC_ERROR_ARGUMENT, from, row, c, value, "");
            square += value * value;
        }
        if (!ascc_is_normal_length(sqrt(square)))
            return ascc_particles_fail(particles, ASCC_ERROR_ARGUMENT,
                                       "%s: row %zu has length %g, not 1", from->name, row,
                                       sqrt(square));
    }
    return ASCC_OK;
}

/* Dividing by a power of two and rounding to integer are exact but for the one rounding meant. */
bool ascc_to_quanta(double momentum, double quantum, int64_t *quanta)
{
    const double units = rint(momentum / quantum);
    if (!(fabs(units) <= (double)ASCC_MOMENTUM_LIMIT))
        return false;
    *quanta = (int64_t)units;
    return true;
}

static ascc_status check_velocities(ascc_particles *particles, const source *from,
                                    const source *mass, size_t count)
{
    for (size_t row = 0; row < count; row++) {
        for (int32_t c = 0; c < particles->dimension; c++) {
            const double value = read_number(from, row, c);
            int64_t quanta;
            if (!isfinite(value))
                return fail_number(particles, ASCC_ERROR_NOT_FINITE, from, row, c, value, "");
            if (!ascc_to_quanta(value * read_number(mass, row, 0), particles->quantum, &quanta))
                return fail_number(particles, ASCC_ERROR_RANGE, from, row, c, value,
                                   ", beyond 2^61 quanta of momentum");
        }
    }
    return ASCC_OK;
}

/* Momentum of a fluid row at its velocity with another mass. */
static bool with_mass(const ascc_particles *particles, size_t row, int32_t c, double mass,
                      int64_t *quanta)
{
    *quanta = particles->momentum[row * ascc_particles_width(particles) + (size_t)c];
    return mass == particles->mass[row] ||
           ascc_to_quanta(ascc_velocity(particles, row, c) * mass, particles->quantum, quanta);
}

static ascc_status check_new_masses(ascc_particles *particles, const source *from, size_t first,
                                    size_t count)
{
    const ascc_status status = check_masses(particles, from, count);
    if (status != ASCC_OK)
        return status;
    for (size_t row = 0; row < count; row++) {
        for (int32_t c = 0; c < particles->dimension; c++) {
            const double mass = read_number(from, row, 0);
            int64_t quanta;
            if (!with_mass(particles, first + row, c, mass, &quanta))
                return ascc_particles_fail(
                    particles, ASCC_ERROR_RANGE,
                    "%s: row %zu is %g, its momentum would be beyond 2^61 quanta", from->name, row,
                    mass);
        }
    }
    return ASCC_OK;
}

/* ---- Stores of one field; checked before ----------------------------------------------------- */

static void store_vectors(const ascc_particles *particles, const source *from, double *into,
                          size_t count)
{
    for (size_t row = 0; row < count; row++)
        for (int32_t c = 0; c < particles->dimension; c++)
            into[row * ascc_particles_width(particles) + (size_t)c] = read_number(from, row, c);
}

static void store_velocities(ascc_particles *particles, const source *from, size_t first,
                             size_t count)
{
    int64_t *const momentum = particles->momentum + first * ascc_particles_width(particles);
    for (size_t row = 0; row < count; row++)
        for (int32_t c = 0; c < particles->dimension; c++)
            (void)ascc_to_quanta(read_number(from, row, c) * particles->mass[first + row],
                                 particles->quantum,
                                 &momentum[row * ascc_particles_width(particles) + (size_t)c]);
}

static void store_masses(const source *from, double *into, size_t count)
{
    for (size_t row = 0; row < count; row++)
        into[row] = read_number(from, row, 0);
}

static void store_new_masses(ascc_particles *particles, const source *from, size_t first,
                             size_t count)
{
    for (size_t row = first; row < first + count; row++) {
        const double mass = read_number(from, row - first, 0);
        for (int32_t c = 0; c < particles->dimension; c++) {
            int64_t quanta;
            (void)with_mass(particles, row, c, mass, &quanta);
            particles->momentum[row * ascc_particles_width(particles) + (size_t)c] = quanta;
        }
        particles->mass[row] = mass;
    }
}

/* ---- Memory ---------------------------------------------------------------------------------- */

/* Hands out pieces of a block; without a block it only counts. */
typedef struct layout {
    unsigned char *block;
    size_t size;
    bool fits;
} layout;

static void *place(layout *into, size_t count, size_t element)
{
    size_t size;
    if (!ascc_multiply_size(count, element, &size) || size > PTRDIFF_MAX / 8) {
        into->fits = false;
        return NULL;
    }
    void *const piece = into->block == NULL ? NULL : into->block + into->size;
    into->size += (size + ASCC_ALIGNMENT - 1) / ASCC_ALIGNMENT * ASCC_ALIGNMENT;
    return piece;
}

/* Points the set's fluid arrays into a block for `capacity` rows. Returns the block's size, or
 * SIZE_MAX if that does not fit. */
static size_t place_fluid(ascc_particles *particles, unsigned char *block, size_t capacity)
{
    layout into = {block, 0, true};
    const size_t d = ascc_particles_width(particles);
    particles->position = place(&into, capacity, d * sizeof(double));
    particles->momentum = place(&into, capacity, d * sizeof(int64_t));
    particles->mass = place(&into, capacity, sizeof(double));
    particles->id = place(&into, capacity, sizeof(uint64_t));
    particles->fluid_capacity = capacity;
    return into.fits ? into.size : SIZE_MAX;
}

static size_t place_boundary(ascc_particles *particles, unsigned char *block, size_t capacity)
{
    layout into = {block, 0, true};
    const size_t d = ascc_particles_width(particles);
    particles->wall_position = place(&into, capacity, d * sizeof(double));
    particles->wall_normal = place(&into, capacity, d * sizeof(double));
    particles->wall_impulse = place(&into, capacity, d * sizeof(int64_t));
    particles->wall_id = place(&into, capacity, sizeof(uint64_t));
    particles->wall_body = place(&into, capacity, sizeof(int32_t));
    particles->boundary_capacity = capacity;
    return into.fits ? into.size : SIZE_MAX;
}

typedef size_t (*place_function)(ascc_particles *particles, unsigned char *block, size_t capacity);

/* Bytes of a kind's block, whose arrays stay where they are. */
static size_t block_size(const ascc_particles *particles, place_function place_kind,
                         size_t capacity)
{
    ascc_particles measured = *particles;
    return place_kind(&measured, NULL, capacity);
}

static void copy(void *into, const void *from, size_t count, size_t element)
{
    if (count > 0)
        memcpy(into, from, count * element);
}

static void copy_fluid(ascc_particles *into, const ascc_particles *from)
{
    const size_t count = from->fluid_count, d = ascc_particles_width(from);
    copy(into->position, from->position, count, d * sizeof(double));
    copy(into->momentum, from->momentum, count, d * sizeof(int64_t));
    copy(into->mass, from->mass, count, sizeof(double));
    copy(into->id, from->id, count, sizeof(uint64_t));
}

static void copy_boundary(ascc_particles *into, const ascc_particles *from)
{
    const size_t count = from->boundary_count, d = ascc_particles_width(from);
    copy(into->wall_position, from->wall_position, count, d * sizeof(double));
    copy(into->wall_normal, from->wall_normal, count, d * sizeof(double));
    copy(into->wall_impulse, from->wall_impulse, count, d * sizeof(int64_t));
    copy(into->wall_id, from->wall_id, count, sizeof(uint64_t));
    copy(into->wall_body, from->wall_body, count, sizeof(int32_t));
}

static void release_fluid(const ascc_particles *particles)
{
    ascc_release(&particles->context->allocator, particles->position, 1,
                 block_size(particles, place_fluid, particles->fluid_capacity));
}

static void release_boundary(const ascc_particles *particles)
{
    ascc_release(&particles->context->allocator, particles->wall_position, 1,
                 block_size(particles, place_boundary, particles->boundary_capacity));
}

/* A new block for `capacity` rows of a kind, or NULL. */
static unsigned char *make_block(const ascc_particles *particles, place_function place_kind,
                                 size_t capacity)
{
    return ascc_allocate(&particles->context->allocator, 1,
                         block_size(particles, place_kind, capacity));
}

bool ascc_particles_make_room(ascc_particles *particles, size_t fluid, size_t boundary)
{
    ascc_particles grown = *particles;
    const bool more_fluid = fluid > particles->fluid_capacity;
    const bool more_boundary = boundary > particles->boundary_capacity;
    if (more_fluid) {
        unsigned char *const block = make_block(particles, place_fluid, fluid);
        if (block == NULL)
            return false;
        place_fluid(&grown, block, fluid);
    }
    if (more_boundary) {
        unsigned char *const block = make_block(particles, place_boundary, boundary);
        if (block == NULL) {
            if (more_fluid)
                release_fluid(&grown);
            return false;
        }
        place_boundary(&grown, block, boundary);
    }
    if (more_fluid) {
        copy_fluid(&grown, particles);
        release_fluid(particles);
    }
    if (more_boundary) {
        copy_boundary(&grown, particles);
        release_boundary(particles);
    }
    *particles = grown;
    return true;
}

/* Room for a host that adds again and again. */
static size_t grown_capacity(size_t capacity, size_t count)
{
    return count <= capacity ? capacity : ascc_max_size(count, capacity + capacity / 2);
}

static ascc_status fail_memory(ascc_particles *particles, size_t count, const char *kind)
{
    return ascc_particles_fail(particles, ASCC_ERROR_MEMORY,
                               "out of memory for %zu more %s particles", count, kind);
}

/* False when that many rows more can be in no memory; then the host's arrays are not read. */
static bool can_fit(const ascc_particles *particles, place_function place_kind, size_t rows,
                    size_t count)
{
    return count <= SIZE_MAX - rows && block_size(particles, place_kind, rows + count) != SIZE_MAX;
}

/* ---- Life ------------------------------------------------------------------------------------ */

static double default_quantum(double mass, double spacing)
{
    int exponent;
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
                         readable(options->spacing));
    if (options->mass == 0)
        options->mass = 1;
    if (!ascc_is_mass(options->mass))
        return ascc_fail(message, ASCC_ERROR_ARGUMENT, "particles: mass is %g",
                         readable(options->mass));
    if (options->momentum_quantum == 0)
        options->momentum_quantum = default_quantum(options->mass, options->spacing);
    if (!ascc_is_quantum(options->momentum_quantum))
        return ascc_fail(message, ASCC_ERROR_ARGUMENT, "particles: momentum_quantum is %g",
                         readable(options->momentum_quantum));
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
    release_fluid(old);
    release_boundary(old);
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

ascc_status ascc_particles_add_fluid(ascc_particles *particles, size_t count,
                                     const ascc_const_array *position,
                                     const ascc_const_array *velocity, const ascc_const_array *mass,
                                     uint64_t *ids)
{
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    const size_t first = particles->fluid_count;
    if (!can_fit(particles, place_fluid, first, count))
        return fail_memory(particles, count, "fluid");

    const int32_t d = particles->dimension;
    const double rest = 0;
    source positions, velocities = repeated("velocity", &rest);
    source masses = repeated("mass", &particles->default_mass);
    ascc_status status = open_source(particles, "position", position, count, d, &positions);
    if (status == ASCC_OK && !is_absent(velocity))
        status = open_source(particles, "velocity", velocity, count, d, &velocities);
    if (status == ASCC_OK && !is_absent(mass))
        status = open_source(particles, "mass", mass, count, 1, &masses);
    if (status == ASCC_OK)
        status = check_positions(particles, &positions, count);
    if (status == ASCC_OK)
        status = check_masses(particles, &masses, count);
    if (status == ASCC_OK)
        status = check_velocities(particles, &velocities, &masses, count);
    if (status != ASCC_OK || count == 0)
        return status;
    if (!ascc_particles_make_room(particles,
                                  grown_capacity(particles->fluid_capacity, first + count), 0))
        return fail_memory(particles, count, "fluid");

    store_vectors(particles, &positions,
                  particles->position + first * ascc_particles_width(particles), count);
    store_masses(&masses, particles->mass + first, count);
    store_velocities(particles, &velocities, first, count);
    give_ids(particles, particles->id, first, count, ids);
    particles->fluid_count += count;
    return ASCC_OK;
}

ascc_status ascc_particles_add_boundary(ascc_particles *particles, size_t count,
                                        const ascc_const_array *position,
                                        const ascc_const_array *normal, int32_t body, uint64_t *ids)
{
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    const size_t first = particles->boundary_count;
    if (!can_fit(particles, place_boundary, first, count))
        return fail_memory(particles, count, "boundary");
    if (body < 0)
        return ascc_particles_fail(particles, ASCC_ERROR_ARGUMENT, "body: %ld is negative",
                                   (long)body);

    const int32_t d = particles->dimension;
    source positions, normals;
    ascc_status status = open_source(particles, "position", position, count, d, &positions);
    if (status == ASCC_OK)
        status = open_source(particles, "normal", normal, count, d, &normals);
    if (status == ASCC_OK)
        status = check_positions(particles, &positions, count);
    if (status == ASCC_OK)
        status = check_normals(particles, &normals, count);
    if (status != ASCC_OK || count == 0)
        return status;
    if (!ascc_particles_make_room(particles, 0,
                                  grown_capacity(particles->boundary_capacity, first + count)))
        return fail_memory(particles, count, "boundary");

    const size_t at = first * ascc_particles_width(particles);
    store_vectors(particles, &positions, particles->wall_position + at, count);
    store_vectors(particles, &normals, particles->wall_normal + at, count);
    for (size_t i = at; i < at + count * ascc_particles_width(particles); i++)
        particles->wall_impulse[i] = 0;
    for (size_t row = first; row < first + count; row++)
        particles->wall_body[row] = body;
    give_ids(particles, particles->wall_id, first, count, ids);
    particles->boundary_count += count;
    return ASCC_OK;
}

ascc_status ascc_particles_resize_fluid(ascc_particles *particles, size_t count)
{
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    if (count <= particles->fluid_count) {
        particles->fluid_count = count;
        return ASCC_OK;
    }
    const double origin = 0;
    const size_t first = particles->fluid_count, added = count - first;
    if (!can_fit(particles, place_fluid, first, added) ||
        !ascc_particles_make_room(particles, grown_capacity(particles->fluid_capacity, count), 0))
        return fail_memory(particles, added, "fluid");
    const source zero = repeated("position", &origin);
    const source mass = repeated("mass", &particles->default_mass);
    store_vectors(particles, &zero, particles->position + first * ascc_particles_width(particles),
                  added);
    store_masses(&mass, particles->mass + first, added);
    store_velocities(particles, &zero, first, added);
    give_ids(particles, particles->id, first, added, NULL);
    particles->fluid_count = count;
    return ASCC_OK;
}

/* ---- Finding and removing -------------------------------------------------------------------- */

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

/* Looks an id up in both kinds. */
static bool find(const ascc_particles *particles, uint64_t id, ascc_kind *kind, size_t *row)
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
    if (!find(particles, id, &found_kind, &found_row))
        return ascc_particles_fail(ascc_particles_writable(particles), ASCC_ERROR_ARGUMENT,
                                   "id: no particle has %llu", (unsigned long long)id);
    if (kind != NULL)
        *kind = found_kind;
    if (row != NULL)
        *row = found_row;
    return ASCC_OK;
}

/* Restores the heap order (a parent is not below its children) under `root`. */
static void sift(uint64_t *heap, size_t root, size_t count)
{
    const uint64_t value = heap[root];
    for (size_t child; (child = 2 * root + 1) < count; root = child) {
        if (child + 1 < count && heap[child + 1] > heap[child])
            child++;
        if (heap[child] <= value)
            break;
        heap[root] = heap[child];
    }
    heap[root] = value;
}

/* Heap sort: no recursion, no memory, no bad case. */
static void sort(uint64_t *values, size_t count)
{
    for (size_t root = count / 2; root-- > 0;)
        sift(values, root, count);
    for (size_t last = count; last-- > 1;) {
        const uint64_t top = values[0];
        values[0] = values[last];
        values[last] = top;
        sift(values, 0, last);
    }
}

static void move_fluid(ascc_particles *particles, size_t into, size_t from)
{
    const size_t d = ascc_particles_width(particles);
    memcpy(particles->position + into * d, particles->position + from * d, d * sizeof(double));
    memcpy(particles->momentum + into * d, particles->momentum + from * d, d * sizeof(int64_t));
    particles->mass[into] = particles->mass[from];
    particles->id[into] = particles->id[from];
}

static void move_boundary(ascc_particles *particles, size_t into, size_t from)
{
    const size_t d = ascc_particles_width(particles);
    memcpy(particles->wall_position + into * d, particles->wall_position + from * d,
           d * sizeof(double));
    memcpy(particles->wall_normal + into * d, particles->wall_normal + from * d,
           d * sizeof(double));
    memcpy(particles->wall_impulse + into * d, particles->wall_impulse + from * d,
           d * sizeof(int64_t));
    particles->wall_id[into] = particles->wall_id[from];
    particles->wall_body[into] = particles->wall_body[from];
}

/* Closes the gaps that the sorted ids leave, and passes over ids of the other kind. Returns the
 * rows left. */
static size_t close_gaps(ascc_particles *particles, const uint64_t *ids, size_t rows,
                         void (*move)(ascc_particles *, size_t, size_t), const uint64_t *gone,
                         size_t gone_count)
{
    size_t kept = 0, next = 0;
    for (size_t row = 0; row < rows; row++) {
        while (next < gone_count && gone[next] < ids[row])
            next++;
        if (next < gone_count && gone[next] == ids[row])
            continue;
        if (kept != row)
            move(particles, kept, row);
        kept++;
    }
    return kept;
}

ascc_status ascc_particles_remove(ascc_particles *particles, size_t count, const uint64_t *ids)
{
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    if (count == 0)
        return ASCC_OK;
    if (ids == NULL)
        return ascc_particles_fail(particles, ASCC_ERROR_ARGUMENT, "ids: NULL");
    for (size_t i = 0; i < count; i++) {
        ascc_kind kind;
        size_t row;
        if (!find(particles, ids[i], &kind, &row))
            return ascc_particles_fail(particles, ASCC_ERROR_ARGUMENT,
                                       "ids: row %zu is %llu, which no particle has", i,
                                       (unsigned long long)ids[i]);
    }

    const ascc_allocator *const allocator = &particles->context->allocator;
    uint64_t *const gone = ascc_allocate(allocator, count, sizeof *gone);
    if (gone == NULL)
        return ascc_particles_fail(particles, ASCC_ERROR_MEMORY,
                                   "out of memory for removing %zu particles", count);
    memcpy(gone, ids, count * sizeof *gone);
    sort(gone, count);
    ascc_status status = ASCC_OK;
    for (size_t i = 1; i < count && status == ASCC_OK; i++)
        if (gone[i] == gone[i - 1])
            status = ascc_particles_fail(particles, ASCC_ERROR_ARGUMENT, "ids: %llu is given twice",
                                         (unsigned long long)gone[i]);
    if (status == ASCC_OK) {
        particles->fluid_count =
            close_gaps(particles, particles->id, particles->fluid_count, move_fluid, gone, count);
        particles->boundary_count = close_gaps(
            particles, particles->wall_id, particles->boundary_count, move_boundary, gone, count);
    }
    ascc_release(allocator, gone, count, sizeof *gone);
    return status;
}

static ascc_status fail_kind(const ascc_particles *particles, ascc_kind kind)
{
    return ascc_particles_fail(ascc_particles_writable(particles), ASCC_ERROR_ARGUMENT,
                               "kind: %d is neither fluid nor boundary", (int)kind);
}

ascc_status ascc_particles_clear(ascc_particles *particles, ascc_kind kind)
{
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    if (kind == ASCC_FLUID)
        particles->fluid_count = 0;
    else if (kind == ASCC_BOUNDARY)
        particles->boundary_count = 0;
    else
        return fail_kind(particles, kind);
    return ASCC_OK;
}

/* ---- Setting and reading --------------------------------------------------------------------- */

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

/* Whether the kind exists and has the field, and the rows are there. */
static ascc_status check_rows(const ascc_particles *particles, ascc_kind kind, ascc_field field,
                              size_t first, size_t count)
{
    if (kind != ASCC_FLUID && kind != ASCC_BOUNDARY)
        return fail_kind(particles, kind);
    const bool has_field =
        kind == ASCC_FLUID ? field == ASCC_POSITION || field == ASCC_VELOCITY || field == ASCC_MASS
                           : field == ASCC_POSITION || field == ASCC_NORMAL;
    if (!has_field)
        return ascc_particles_fail(ascc_particles_writable(particles), ASCC_ERROR_ARGUMENT,
                                   "field: %d is not one of %s particles", (int)field,
                                   kind == ASCC_FLUID ? "fluid" : "boundary");
    const size_t rows = ascc_particles_count(particles, kind);
    if (!has_rows(first, count, rows))
        return fail_rows(particles, kind == ASCC_FLUID ? "fluid" : "boundary", first, count, rows);
    return ASCC_OK;
}

ascc_status ascc_particles_set(ascc_particles *particles, ascc_kind kind, ascc_field field,
                               size_t first, size_t count, const ascc_const_array *values)
{
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    source from;
    ascc_status status = check_rows(particles, kind, field, first, count);
    if (status == ASCC_OK)
        status = open_source(particles, "values", values, count,
                             field == ASCC_MASS ? 1 : particles->dimension, &from);
    if (status != ASCC_OK || count == 0)
        return status;

    const size_t at = first * ascc_particles_width(particles);
    if (field == ASCC_POSITION) {
        status = check_positions(particles, &from, count);
        double *const position =
            kind == ASCC_FLUID ? particles->position : particles->wall_position;
        if (status == ASCC_OK)
            store_vectors(particles, &from, position + at, count);
    } else if (field == ASCC_NORMAL) {
        status = check_normals(particles, &from, count);
        if (status == ASCC_OK)
            store_vectors(particles, &from, particles->wall_normal + at, count);
    } else if (field == ASCC_VELOCITY) {
        source mass = repeated("mass", particles->mass + first);
        mass.row = sizeof(double);
        status = check_velocities(particles, &from, &mass, count);
        if (status == ASCC_OK)
            store_velocities(particles, &from, first, count);
    } else {
        status = check_new_masses(particles, &from, first, count);
        if (status == ASCC_OK)
            store_new_masses(particles, &from, first, count);
    }
    return status;
}

static double field_value(const ascc_particles *particles, ascc_kind kind, ascc_field field,
                          size_t row, int32_t c)
{
    const size_t at = row * ascc_particles_width(particles) + (size_t)c;
    if (field == ASCC_POSITION)
        return kind == ASCC_FLUID ? particles->position[at] : particles->wall_position[at];
    if (field == ASCC_NORMAL)
        return particles->wall_normal[at];
    if (field == ASCC_VELOCITY)
        return ascc_velocity(particles, row, c);
    return particles->mass[row];
}

ascc_status ascc_particles_get(const ascc_particles *particles, ascc_kind kind, ascc_field field,
                               size_t first, size_t count, const ascc_array *values)
{
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    const ascc_status status = check_rows(particles, kind, field, first, count);
    if (status != ASCC_OK || count == 0)
        return status;
    if (values == NULL || values->data == NULL || !ascc_scalar_known(values->scalar) ||
        values->reserved != 0)
        return ascc_particles_fail(ascc_particles_writable(particles), ASCC_ERROR_ARGUMENT,
                                   "values: NULL, or not an array known here");

    const int32_t components = field == ASCC_MASS ? 1 : particles->dimension;
    const ptrdiff_t size = ascc_scalar_size(values->scalar);
    const ptrdiff_t step = values->component_stride != 0 ? values->component_stride : size;
    const ptrdiff_t stride = values->stride != 0 ? values->stride : components * size;
    unsigned char *const data = values->data;
    for (size_t row = 0; row < count; row++)
        for (int32_t c = 0; c < components; c++)
            ascc_scalar_write(data + (ptrdiff_t)row * stride + c * step, values->scalar,
                              field_value(particles, kind, field, first + row, c));
    return ASCC_OK;
}

ascc_status ascc_particles_get_ids(const ascc_particles *particles, ascc_kind kind, size_t first,
                                   size_t count, uint64_t *ids)
{
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    const ascc_status status = check_rows(particles, kind, ASCC_POSITION, first, count);
    if (status != ASCC_OK || count == 0)
        return status;
    if (ids == NULL)
        return ascc_particles_fail(ascc_particles_writable(particles), ASCC_ERROR_ARGUMENT,
                                   "ids: NULL");
    copy(ids, (kind == ASCC_FLUID ? particles->id : particles->wall_id) + first, count,
         sizeof *ids);
    return ASCC_OK;
}

ascc_status ascc_particles_get_bodies(const ascc_particles *particles, size_t first, size_t count,
                                      int32_t *bodies)
{
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    const ascc_status status = check_rows(particles, ASCC_BOUNDARY, ASCC_POSITION, first, count);
    if (status != ASCC_OK || count == 0)
        return status;
    if (bodies == NULL)
        return ascc_particles_fail(ascc_particles_writable(particles), ASCC_ERROR_ARGUMENT,
                                   "bodies: NULL");
    copy(bodies, particles->wall_body + first, count, sizeof *bodies);
    return ASCC_OK;
}

ascc_status ascc_particles_get_momentum(const ascc_particles *particles, size_t first, size_t count,
                                        int64_t *momentum)
{
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    const ascc_status status = check_rows(particles, ASCC_FLUID, ASCC_VELOCITY, first, count);
    if (status != ASCC_OK || count == 0)
        return status;
    if (momentum == NULL)
        return ascc_particles_fail(ascc_particles_writable(particles), ASCC_ERROR_ARGUMENT,
                                   "momentum: NULL");
    copy(momentum, particles->momentum + first * ascc_particles_width(particles), count,
         ascc_particles_width(particles) * sizeof *momentum);
    return ASCC_OK;
}

/* ---- Sums ------------------------------------------------------------------------------------ */

/* A sum of 64-bit integers, exact for 2^31 of them: high * 2^32 + low. Only the end has to fit, so
 * that the order of the rows does not matter. */
typedef struct wide_sum {
    int64_t high;
    uint64_t low; /* < 2^32 */
} wide_sum;

static void add_wide(wide_sum *sum, int64_t value)
{
    const int64_t low = (int64_t)((uint64_t)value & UINT32_MAX);
    sum->low += (uint64_t)low;
    sum->high += (value - low) / (INT64_C(1) << 32) + (int64_t)(sum->low >> 32);
    sum->low &= UINT32_MAX;
}

static bool narrow(const wide_sum *sum, int64_t *value)
{
    if (sum->high < INT32_MIN || sum->high > INT32_MAX)
        return false;
    *value = sum->high * (INT64_C(1) << 32) + (int64_t)sum->low;
    return true;
}

/* All three, or none. */
static bool narrow_all(const wide_sum sum[3], int64_t values[3])
{
    int64_t narrowed[3];
    for (int c = 0; c < 3; c++)
        if (!narrow(&sum[c], &narrowed[c]))
            return false;
    memcpy(values, narrowed, sizeof narrowed);
    return true;
}

ascc_status ascc_particles_total_momentum(const ascc_particles *particles, int64_t total[3])
{
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    if (total == NULL)
        return ascc_particles_fail(ascc_particles_writable(particles), ASCC_ERROR_ARGUMENT,
                                   "total: NULL");
    const size_t d = ascc_particles_width(particles);
    wide_sum sum[3] = {{0, 0}, {0, 0}, {0, 0}};
    for (size_t row = 0; row < particles->fluid_count; row++)
        for (size_t c = 0; c < d; c++)
            add_wide(&sum[c], particles->momentum[row * d + c]);
    if (!narrow_all(sum, total))
        return ascc_particles_fail(ascc_particles_writable(particles), ASCC_ERROR_RANGE,
                                   "total: the momentum does not fit 64 bits");
    return ASCC_OK;
}

/* torque += (x - point) cross the impulse of a boundary row. */
static void add_torque(const ascc_particles *particles, size_t row, const double point[3],
                       double torque[3])
{
    const size_t d = ascc_particles_width(particles);
    double arm[3] = {0}, impulse[3] = {0};
    for (size_t c = 0; c < d; c++) {
        arm[c] = particles->wall_position[row * d + c] - point[c];
        impulse[c] = (double)particles->wall_impulse[row * d + c] * particles->quantum;
    }
    torque[0] += arm[1] * impulse[2] - arm[2] * impulse[1];
    torque[1] += arm[2] * impulse[0] - arm[0] * impulse[2];
    torque[2] += arm[0] * impulse[1] - arm[1] * impulse[0];
}

ascc_status ascc_particles_body_impulse(const ascc_particles *particles, int32_t body,
                                        const double point[3], int64_t impulse[3], double torque[3])
{
    static const double origin[3] = {0};
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    if (body < -1)
        return ascc_particles_fail(ascc_particles_writable(particles), ASCC_ERROR_ARGUMENT,
                                   "body: %ld is neither a body nor -1", (long)body);
    if (point == NULL)
        point = origin;
    const size_t d = ascc_particles_width(particles);
    for (size_t c = 0; c < d; c++)
        if (!isfinite(point[c]))
            return ascc_particles_fail(ascc_particles_writable(particles), ASCC_ERROR_ARGUMENT,
                                       "point: component %zu is %g", c, readable(point[c]));

    wide_sum sum[3] = {{0, 0}, {0, 0}, {0, 0}};
    double turn[3] = {0};
    for (size_t row = 0; row < particles->boundary_count; row++) {
        if (body != -1 && particles->wall_body[row] != body)
            continue;
        for (size_t c = 0; c < d; c++)
            add_wide(&sum[c], particles->wall_impulse[row * d + c]);
        add_torque(particles, row, point, turn);
    }
    if (impulse != NULL && !narrow_all(sum, impulse))
        return ascc_particles_fail(ascc_particles_writable(particles), ASCC_ERROR_RANGE,
                                   "impulse: that of body %ld does not fit 64 bits", (long)body);
    if (torque != NULL)
        memcpy(torque, turn, sizeof turn);
    return ASCC_OK;
}
