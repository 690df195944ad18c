/* The memory of a particle set's fields: placing, growing, copying, dropping rows.
 * SPDX-License-Identifier: MIT
 *
 * The fields of a kind lie in one block of memory, so growing them is one allocation that succeeds
 * or fails as a whole:
 *
 *     fluid     | position | momentum | mass | id | rest | past |
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

static size_t row_size(const ascc_particles *particles, const ascc_particle_field *field)
{
    return ascc_field_row_size(field, particles->dimension, particles->past_count);
}

/* Bytes of a field in a block for that many rows; false when no memory can hold them. */
static bool field_size(const ascc_particles *particles, const ascc_particle_field *field,
                       size_t rows, size_t *size)
{
    if (!ascc_multiply_size(rows, row_size(particles, field), size) || *size > PTRDIFF_MAX / 8)
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
        if (!field_size(particles, field, rows, &size) || size > PTRDIFF_MAX - sum)
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
        (void)field_size(particles, field, rows, &size);
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
        const bool same = field->width != ASCC_WIDTH_PAST || into->past_count == from->past_count;
        if ((int)field->kind == kind && rows > 0 && same)
            memcpy(ascc_field_rows(into, field), ascc_field_rows(from, field),
                   rows * row_size(into, field));
    }
}

void ascc_particles_fill_past(ascc_particles *particles, size_t first, size_t count, int32_t known)
{
    const size_t d = ascc_particles_width(particles), past = (size_t)particles->past_count;
    for (size_t row = first; row < first + count; row++)
        for (size_t age = (size_t)known; age < past; age++)
            for (size_t c = 0; c < d; c++) {
                double *const at = particles->past + (row * past + age) * d + c;
                const double own = ascc_velocity(particles, row, (int32_t)c);
                *at = age ? *(at - d) : isfinite(own) ? own : 0.0; /* a step refuses the latter */
            }
}

/* Where one set keeps more of the past than the other: what both have, and the oldest again and again. */
static void copy_past(ascc_particles *into, const ascc_particles *from)
{
    const size_t d = ascc_particles_width(into), to = (size_t)into->past_count;
    const size_t has = (size_t)from->past_count, known = ascc_min_size(has, to);
    for (size_t row = 0; row < from->fluid_count && known > 0; row++)
        memcpy(into->past + row * to * d, from->past + row * has * d, known * d * sizeof(double));
    ascc_particles_fill_past(into, 0, from->fluid_count, (int32_t)known);
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
    return ascc_particles_arrange(particles, fluid, boundary, particles->past_count);
}

bool ascc_particles_arrange(ascc_particles *particles, size_t fluid, size_t boundary, int32_t past)
{
    const bool same = past == particles->past_count;
    const size_t rows[ASCC_KIND_COUNT] = {
        same ? fluid : ascc_max_size(fluid, particles->fluid_capacity), boundary};
    bool grows[ASCC_KIND_COUNT];
    ascc_particles grown = *particles;
    grown.past_count = past;
    for (int kind = 0; kind < ASCC_KIND_COUNT; kind++) {
        grows[kind] = rows[kind] > *capacity_of(particles, kind) ||
                      (kind == ASCC_FLUID && !same && rows[kind] > 0);
        if (!grows[kind])
            continue;
        unsigned char *const block =
            ascc_allocate(&particles->context->allocator, 1, block_size(&grown, kind, rows[kind]));
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
        if (kind == ASCC_FLUID && !same)
            copy_past(&grown, particles);
        release_rows(particles, kind);
    }
    *particles = grown;
    return true;
}

void ascc_particles_zero_rows(ascc_particles *particles, ascc_kind kind, size_t first, size_t count)
{
    for (size_t i = 0; i < ASCC_FIELD_COUNT; i++) {
        const ascc_particle_field *const field = &ascc_particle_fields[i];
        const size_t size = row_size(particles, field);
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
            kept = close_gaps(ascc_field_rows(particles, field), row_size(particles, field), *count,
                              marked);
    }
    *count = kept;
}
