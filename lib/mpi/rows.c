/* Rows of fluid as bytes, and rows that come and go. SPDX-License-Identifier: MIT */
#include <string.h>

#include "set.h"

/* The arrays of fluid, each with the bytes of a row; the acceleration of a step is one of them. */
typedef struct columns {
    struct {
        unsigned char *rows;
        size_t size;
    } of[ASCC_FIELD_COUNT + 1];
    size_t count;
} columns;

static columns columns_of(const ascc_mpi_particles *set)
{
    const ascc_particles *p = set->local;
    columns all = {.count = 0};
    for (size_t i = 0; i < ASCC_FIELD_COUNT; i++) {
        const ascc_particle_field *field = &ascc_particle_fields[i];
        const size_t size = ascc_field_row_size(field, p->dimension, p->past_count);
        if (field->kind != ASCC_FLUID || size == 0)
            continue;
        all.of[all.count].rows = ascc_field_rows(p, field);
        all.of[all.count++].size = size;
    }
    if (set->accelerates) {
        all.of[all.count].rows = (unsigned char *)set->step->acceleration;
        all.of[all.count++].size = (size_t)p->dimension * sizeof(double);
    }
    return all;
}

size_t ascc_mpi_row_size(const ascc_mpi_particles *set)
{
    const columns all = columns_of(set);
    size_t size = 0;
    for (size_t i = 0; i < all.count; i++)
        size += all.of[i].size;
    return size;
}

void ascc_mpi_pack_row(const ascc_mpi_particles *set, size_t row, unsigned char *bytes)
{
    const columns all = columns_of(set);
    for (size_t i = 0; i < all.count; bytes += all.of[i++].size)
        memcpy(bytes, all.of[i].rows + row * all.of[i].size, all.of[i].size);
}

void ascc_mpi_unpack_row(ascc_mpi_particles *set, size_t row, const unsigned char *bytes)
{
    const columns all = columns_of(set);
    for (size_t i = 0; i < all.count; bytes += all.of[i++].size)
        memcpy(all.of[i].rows + row * all.of[i].size, bytes, all.of[i].size);
}

bool ascc_mpi_rows_reserve(ascc_mpi_particles *set, size_t rows)
{
    ascc_particles *p = set->local;
    const size_t capacity = rows > p->fluid_capacity ? ascc_max_size(rows, rows + rows / 4) : rows;
    return ascc_particles_make_room(p, capacity, 0) &&
           (!set->accelerates ||
            ascc_grow(&set->context->allocator, (void **)&set->step->acceleration,
                      &set->step->acceleration_capacity, rows * (size_t)p->dimension,
                      sizeof(double)));
}

static void move_row(const columns *all, size_t from, size_t to)
{
    for (size_t i = 0; from != to && i < all->count; i++)
        memcpy(all->of[i].rows + to * all->of[i].size, all->of[i].rows + from * all->of[i].size,
               all->of[i].size);
}

void ascc_mpi_drop_rows(ascc_mpi_particles *set, const uint8_t *marked)
{
    const columns all = columns_of(set);
    size_t kept = 0;
    for (size_t row = 0; row < set->local->fluid_count; row++)
        if (!marked[row])
            move_row(&all, row, kept++);
    set->local->fluid_count = kept;
}

/* Where the id stands in a packed row. */
static size_t id_offset(const ascc_mpi_particles *set)
{
    size_t offset = 0;
    for (size_t i = 0; i < ASCC_FIELD_id; i++)
        if (ascc_particle_fields[i].kind == ASCC_FLUID)
            offset += ascc_field_row_size(&ascc_particle_fields[i], set->local->dimension,
                                          set->local->past_count);
    return offset;
}

static uint64_t id_of(const unsigned char *row, size_t offset)
{
    uint64_t id;
    memcpy(&id, row + offset, sizeof id);
    return id;
}

void ascc_mpi_merge_rows(ascc_mpi_particles *set, const unsigned char *bytes, size_t count)
{
    const columns all = columns_of(set);
    const size_t size = ascc_mpi_row_size(set), offset = id_offset(set);
    ascc_particles *p = set->local;
    /* The rows of each process ascend; the next to be placed is the largest that is left of all of them. */
    size_t *left = set->counts + 2 * (size_t)set->size, *first = left + (size_t)set->size;
    const size_t *in = set->counts + (size_t)set->size;
    size_t at = 0;
    for (int r = 0; r < set->size; at += in[r++]) {
        first[r] = at;
        left[r] = in[r];
    }
    size_t own = p->fluid_count, to = own + count;
    p->fluid_count = to;
    for (; count; count--) {
        int best = -1;
        uint64_t largest = 0;
        for (int r = 0; r < set->size; r++)
            if (left[r]) {
                const uint64_t id = id_of(bytes + (first[r] + left[r] - 1) * size, offset);
                if (best < 0 || id > largest) {
                    best = r;
                    largest = id;
                }
            }
        while (own && p->id[own - 1] > largest)
            move_row(&all, --own, --to);
        left[best]--;
        ascc_mpi_unpack_row(set, --to, bytes + (first[best] + left[best]) * size);
    }
}
