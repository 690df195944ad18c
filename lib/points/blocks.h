/* Blocks of space that hold something: cubes of a grid that is anchored at the world's origin.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_BLOCKS_H
#define ASCC_BLOCKS_H

#include "base/common.h"
#include "base/memory.h"

#define ASCC_NO_BLOCK UINT32_MAX

/* A table from coordinates, in whole blocks, to numbers from 0 in order of addition. */
typedef struct ascc_blocks {
    size_t count, slots; /* slots: a power of two */
    int64_t (*at)[3];    /* [count] */
    uint32_t *slot;      /* [slots] 1 + number; 0 = free */
} ascc_blocks;

/* Slots that a table of at most so many blocks needs. */
size_t ascc_blocks_slots(size_t most);

/* An empty table in the caller's memory: room for `most` coordinates, and the slots that these need. */
void ascc_blocks_open(ascc_blocks *blocks, int64_t (*at)[3], uint32_t *slot, size_t slots);

/* An empty table for at most so many in an arena, lent; false without memory. */
bool ascc_blocks_lend(ascc_blocks *blocks, ascc_arena *arena, size_t most);

/* The block of a place; edge: of a block. [2] is 0 in 2D. */
void ascc_block_of(const double *place, int32_t dimension, double edge, int64_t at[3]);

/* The number of a block, which is added if it is not there. */
uint32_t ascc_blocks_add(ascc_blocks *blocks, const int64_t at[3]);

/* The same, ASCC_NO_BLOCK if it is not there. */
uint32_t ascc_blocks_find(const ascc_blocks *blocks, const int64_t at[3]);

/* Calls `visit` with every block that is there within `reach` blocks, diagonals and the block itself included. */
typedef void (*ascc_blocks_visit)(void *data, uint32_t block);
void ascc_blocks_around(const ascc_blocks *blocks, const int64_t at[3], int32_t dimension,
                        int64_t reach, ascc_blocks_visit visit, void *data);

#endif
