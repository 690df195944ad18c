/* A hash table of blocks. SPDX-License-Identifier: MIT */
#include "blocks.h"

#include <math.h>
#include <string.h>

#define FARTHEST 1e18

size_t ascc_blocks_slots(size_t most)
{
    size_t slots = 64;
    while (slots < 2 * most)
        slots *= 2;
    return slots;
}

void ascc_blocks_open(ascc_blocks *blocks, int64_t (*at)[3], uint32_t *slot, size_t slots)
{
    *blocks = (ascc_blocks){.at = at, .slot = slot, .slots = slots};
    memset(slot, 0, slots * sizeof *slot);
}

bool ascc_blocks_lend(ascc_blocks *blocks, ascc_arena *arena, size_t most)
{
    const size_t slots = ascc_blocks_slots(most);
    int64_t(*at)[3] = ascc_arena_lend(arena, most, sizeof *at);
    uint32_t *slot = ascc_arena_lend(arena, slots, sizeof *slot);
    if (at && slot)
        ascc_blocks_open(blocks, at, slot, slots);
    return at && slot;
}

void ascc_block_of(const double *place, int32_t dimension, double edge, int64_t at[3])
{
    for (int32_t c = 0; c < 3; c++) /* what is farther than integers reach is cut */
        at[c] =
            c < dimension ? (int64_t)fmax(-FARTHEST, fmin(FARTHEST, floor(place[c] / edge))) : 0;
}

/* Where the block is, or would be. */
static size_t slot_of(const ascc_blocks *blocks, const int64_t at[3])
{
    uint64_t hash = 0;
    for (int c = 0; c < 3; c++) {
        hash = (hash ^ (uint64_t)at[c]) * UINT64_C(0x9e3779b97f4a7c15);
        hash ^= hash >> 29;
    }
    size_t s = (size_t)hash & (blocks->slots - 1);
    while (blocks->slot[s] && memcmp(blocks->at[blocks->slot[s] - 1], at, sizeof *blocks->at) != 0)
        s = (s + 1) & (blocks->slots - 1);
    return s;
}

uint32_t ascc_blocks_add(ascc_blocks *blocks, const int64_t at[3])
{
    const size_t s = slot_of(blocks, at);
    if (!blocks->slot[s]) {
        memcpy(blocks->at[blocks->count], at, sizeof *blocks->at);
        blocks->slot[s] = (uint32_t)++blocks->count;
    }
    return blocks->slot[s] - 1;
}

uint32_t ascc_blocks_find(const ascc_blocks *blocks, const int64_t at[3])
{
    const uint32_t found = blocks->slot[slot_of(blocks, at)];
    return found ? found - 1 : ASCC_NO_BLOCK;
}

void ascc_blocks_around(const ascc_blocks *blocks, const int64_t at[3], int32_t dimension,
                        int64_t reach, ascc_blocks_visit visit, void *data)
{
    const int64_t deep = dimension == 3 ? reach : 0;
    for (int64_t z = -deep; z <= deep; z++)
        for (int64_t y = -reach; y <= reach; y++)
            for (int64_t x = -reach; x <= reach; x++) {
                const int64_t there[3] = {at[0] + x, at[1] + y, at[2] + z};
                const uint32_t found = ascc_blocks_find(blocks, there);
                if (found != ASCC_NO_BLOCK)
                    visit(data, found);
            }
}
