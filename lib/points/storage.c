/* The memory of a particle set's fields: placing, growing, copying, dropping rows.
 * SPDX-License-Identifier: MIT
 *
 * The fields of a kind lie in one block of memory, so growing them is one allocation that succeeds
 * or fails as a whole:
 *
 *     fluid     | position | momentum | mass | id | rest |
 *     boundary  | position | normal   | impulse | id | body | velocity | own position | own normal |
 */
#include <string.h>

#include "particles.h"

static size_t *count_of(ascc_particles *particles, int kind)
{
    return kind == ASCC_FLUID ? &particles->fluid_count : &particles->boundary_count;
}

static size_t *capacity_of(ascc_particles *particles, int kind)
{
    return kind == ASCC_FLUID ? &particles->fluid_capacity : &particles->boundary_capacity;
}

/* Bytes of a field in a block for that many rows; false when no memory can hold them. */
static bool field_size(const ascc_particle_field *field, int32_t dimension, size_t rows,
                       size_t *size)
{
    if (!ascc_multiply_size(rows, ascc_field_row_size(field, dimension), size) ||
        *size > PTRDIFF_MAX / 8)
        return false;
    *size = (*size + ASCC_ALIGNMENT - 1) / ASCC_ALIGNMENT * ASCC_ALIGNMENT;
    return true;
}

/* Bytes of a kind's block, or SIZE_MAX if they do not fit. */
static size_t block_size(const ascc_particles *particles, int kind, size_t rows)
{
    size_t sum = 0, size;
    for (size_t i = 0; i < ASCC_FIELD_COUNT; i++) {
        const ascc_particle_field *const field = &ascc_particle_fields[i];
        if ((int)field->kind != kind)
            continue;
        if (!field_size(field, particles->dimension, rows, &size) || size > PTRDIFF_MAX - sum)
            return SIZE_MAX;
        sum += size;
    }
    return sum;
}

/* Points a kind's fields into a block for that many rows, which fit. */
static void place(ascc_particles *particles, int kind, unsigned char *block, size_t rows)
{
    for (size_t i = 0; i < ASCC_FIELD_COUNT; i++) {
        const ascc_particle_field *const field = &ascc_particle_fields[i];
        size_t size = 0;
        if ((int)field->kind != kind)
            continue;
        (void)field_size(field, particles->dimension, rows, &size);
        ascc_field_point(particles, field, block);
        block += size;
    }
    *capacity_of(particles, kind) = rows;
}

static void copy_rows(ascc_particles *into, ascc_particles *from, int kind)
{
    const size_t rows = *count_of(from, kind);
    for (size_t i = 0; i < ASCC_FIELD_COUNT; i++) {
        const ascc_particle_field *const field = &ascc_particle_fields[i];
        if ((int)field->kind == kind && rows > 0)
            memcpy(ascc_field_rows(into, field), ascc_field_rows(from, field),
                   rows * ascc_field_row_size(field, from->dimension));
    }
}

/* A block begins with the first field of its kind. */
static void *block_of(const ascc_particles *particles, int kind)
{
    size_t first = 0;
    while ((int)ascc_particle_fields[first].kind != kind)
        first++;
    return ascc_field_rows(particles, &ascc_particle_fields[first]);
}

static void release_rows(ascc_particles *particles, int kind)
{
    ascc_release(&particles->context->allocator, block_of(particles, kind), 1,
                 block_size(particles, kind, *capacity_of(particles, kind)));
}

void ascc_particles_release_rows(ascc_particles *particles)
{
    for (int kind = 0; kind < ASCC_KIND_COUNT; kind++)
        release_rows(particles, kind);
}

bool ascc_particles_can_hold(const ascc_particles *particles, ascc_kind kind, size_t rows)
{
    return block_size(particles, (int)kind, rows) != SIZE_MAX;
}

bool ascc_particles_make_room(ascc_particles *particles, size_t fluid, size_t boundary)
{
    const size_t rows[ASCC_KIND_COUNT] = {fluid, boundary};
    bool grows[ASCC_KIND_COUNT];
    ascc_particles grown = *particles;
    for (int kind = 0; kind < ASCC_KIND_COUNT; kind++) {
        grows[kind] = rows[kind] > *capacity_of(particles, kind);
        if (!grows[kind])
            continue;
        unsigned char *const block = ascc_allocate(&particles->context->allocator, 1,
                                                   block_size(particles, kind, rows[kind]));
        if (block == NULL) {
            if (kind == ASCC_BOUNDARY && grows[ASCC_FLUID])
                release_rows(&grown, ASCC_FLUID);
            return false;
        }
        place(&grown, kind, block, rows[kind]);
    }
    for (int kind = 0; kind < ASCC_KIND_COUNT; kind++) {
        if (!grows[kind])
            continue;
        copy_rows(&grown, particles, kind);
        release_rows(particles, kind);
    }
    *particles = grown;
    return true;
}

void ascc_particles_zero_rows(ascc_particles *particles, ascc_kind kind, size_t first, size_t count)
{
    for (size_t i = 0; i < ASCC_FIELD_COUNT; i++) {
        const ascc_particle_field *const field = &ascc_particle_fields[i];
        const size_t size = ascc_field_row_size(field, particles->dimension);
        if (field->kind == kind && count > 0)
            memset((unsigned char *)ascc_field_rows(particles, field) + first * size, 0,
                   count * size);
    }
}

/* Closes the gaps of one field. Returns the rows left. */
static size_t close_gaps(unsigned char *rows, size_t size, size_t count,
                         const unsigned char *marked)
{
    size_t kept = 0;
    for (size_t row = 0; row < count; row++) {
        if (marked[row])
            continue;
        if (kept != row)
            memcpy(rows + kept * size, rows + row * size, size);
        kept++;
    }
    return kept;
}

void ascc_particles_drop_rows(ascc_particles *particles, ascc_kind kind,
                              const unsigned char *marked)
{
    size_t *const count = count_of(particles, (int)kind);
    size_t kept = *count;
    for (size_t i = 0; i < ASCC_FIELD_COUNT; i++) {
        const ascc_particle_field *const field = &ascc_particle_fields[i];
        if (field->kind == kind)
            kept = close_gaps(ascc_field_rows(particles, field),
                              ascc_field_row_size(field, particles->dimension), *count, marked);
    }
    *count = kept;
}
