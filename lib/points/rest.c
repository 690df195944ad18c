/* What the host does wakes fluid near it. SPDX-License-Identifier: MIT */
#include "rest.h"

#include <string.h>

#include "blocks.h"

size_t ascc_rest_count(const ascc_particles *particles)
{
    size_t count = 0;
    for (size_t i = 0; i < particles->fluid_count; i++)
        count += ascc_is_asleep(particles->rest[i]);
    return count;
}

void ascc_rest_end(ascc_particles *particles)
{
    if (particles->fluid_count)
        memset(particles->rest, 0, particles->fluid_count * sizeof *particles->rest);
}

/* Blocks of the rows, and those beside them: at most `most` of the rows' own. */
static bool add_blocks(ascc_blocks *blocks, const ascc_particles *p, const double *place,
                       size_t count, size_t most)
{
    const int64_t deep = p->dimension == 3;
    int64_t last[3] = {INT64_MAX, 0, 0};
    size_t own = 0;
    for (size_t i = 0; i < count; i++) {
        int64_t at[3];
        ascc_block_of(place + i * (size_t)p->dimension, p->dimension, ascc_rest_edge(p), at);
        if (memcmp(at, last, sizeof at) == 0)
            continue;
        memcpy(last, at, sizeof last);
        if (own++ == most)
            return false;
        for (int64_t z = -deep; z <= deep; z++)
            for (int64_t y = -1; y <= 1; y++)
                for (int64_t x = -1; x <= 1; x++)
                    (void)ascc_blocks_add(blocks,
                                          (const int64_t[]){at[0] + x, at[1] + y, at[2] + z});
    }
    return true;
}

static void wake_in(ascc_particles *p, const ascc_blocks *blocks)
{
    for (size_t i = 0; i < p->fluid_count; i++) {
        int64_t at[3];
        if (p->rest[i] == 0)
            continue;
        ascc_block_of(p->position + i * (size_t)p->dimension, p->dimension, ascc_rest_edge(p), at);
        if (ascc_blocks_find(blocks, at) != ASCC_NO_BLOCK)
            p->rest[i] = 0;
    }
}

/* Runs of rows in one block that are told apart; a call that changes more wakes all. */
#define MOST_BLOCKS 4096

void ascc_rest_disturb(ascc_particles *p, ascc_kind kind, size_t first, size_t count)
{
    if (count == 0 || ascc_rest_count(p) == 0)
        return;
    const ascc_allocator *allocator = &p->context->allocator;
    const size_t most = ascc_min_size(count, MOST_BLOCKS), around = p->dimension == 3 ? 27 : 9;
    const size_t slots = ascc_blocks_slots(most * around);
    const double *place =
        (kind == ASCC_FLUID ? p->position : p->wall_position) + first * (size_t)p->dimension;
    int64_t(*at)[3] = ascc_allocate(allocator, most * around, sizeof *at);
    uint32_t *slot = ascc_allocate(allocator, slots, sizeof *slot);
    bool near = at && slot;
    if (near) {
        ascc_blocks blocks;
        ascc_blocks_open(&blocks, at, slot, slots);
        near = add_blocks(&blocks, p, place, count, most);
        if (near)
            wake_in(p, &blocks);
    }
    if (!near)
        ascc_rest_end(p);
    if (at)
        ascc_release(allocator, at, most * around, sizeof *at);
    if (slot)
        ascc_release(allocator, slot, slots, sizeof *slot);
}

/* Runs of rows around which fluid wakes one by one; where more go, all of it wakes. */
#define MOST_RUNS 64

void ascc_rest_disturb_marked(ascc_particles *particles, ascc_kind kind,
                              const unsigned char *marked)
{
    const size_t count = ascc_particles_count(particles, kind);
    size_t runs = 0;
    for (size_t i = 0, end; i < count; i = end) {
        for (end = i + 1; end < count && marked[end] == marked[i];)
            end++;
        if (!marked[i])
            continue;
        if (++runs > MOST_RUNS) {
            ascc_rest_end(particles);
            return;
        }
        ascc_rest_disturb(particles, kind, i, end - i);
    }
}

ascc_status ascc_particles_get_asleep(const ascc_particles *particles, size_t first, size_t count,
                                      uint8_t *asleep)
{
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    const size_t rows = particles->fluid_count;
    if (first > rows || count > rows - first || (count > 0 && asleep == NULL))
        return ascc_particles_fail_reading(particles, ASCC_ERROR_ARGUMENT,
                                           "asleep: NULL, or rows %zu to %zu of %zu", first,
                                           first + count, rows);
    for (size_t i = 0; i < count; i++)
        asleep[i] = ascc_is_asleep(particles->rest[first + i]);
    return ASCC_OK;
}

ascc_status ascc_particles_wake(ascc_particles *particles)
{
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    ascc_rest_end(particles);
    return ASCC_OK;
}
