/* Who owns which part of space: blocks anchored to the world, in the order of a curve that fills it, cut into as many
 * pieces as there are processes. SPDX-License-Identifier: MIT
 *
 *     key of a block (Morton order)   0 ......|............|.......|........ 2^63
 *     process                            0          1          2        3
 *
 * Every place has an owner, whether there is fluid or not, and all processes know it without a word. A block without
 * fluid goes with one beside it that has some: where it lies on the curve says nothing of who has fluid near it.
 */
#ifndef ASCC_CURVE_H
#define ASCC_CURVE_H

#include "base/memory.h"
#include "points/blocks.h"

/* Whose a block is; and how far, as far as was asked, all around it is the same one's: to `inner`, not to `outer`. */
typedef struct ascc_holding {
    int owner;
    double inner, outer;
} ascc_holding;

typedef struct ascc_curve {
    int32_t dimension;
    int size;        /* processes */
    double edge;     /* of a block, host's unit */
    uint64_t *first; /* [size] of each process's keys; ascending, the first 0 */
    double *cut;     /* [size] scratch */
    /* Blocks that had fluid when ascc_curve_know was told, and those beside them: */
    ascc_blocks blocks;
    ascc_holding *holding; /* [blocks] */
    size_t block_capacity, slot_capacity, holding_capacity;
    int64_t low[3], high[3]; /* of those with fluid */
} ascc_curve;

/* The block that a place is in; beyond 2^20 blocks from the origin all are one. */
void ascc_curve_block(const ascc_curve *curve, const double *place, int64_t block[3]);
uint64_t ascc_curve_key(const ascc_curve *curve, const int64_t block[3]);
int ascc_curve_owner(const ascc_curve *curve, const int64_t block[3]);
int ascc_curve_owner_of(const ascc_curve *curve, const double *place);

/* The processes that own a block within `reach` of a place on every axis, each once, ascending in order of finding. */
typedef struct ascc_owners {
    int64_t low[3], high[3]; /* blocks; those of the last place */
    bool known;
    int count, *rank; /* [size] */
    uint8_t *is;      /* [size] */
} ascc_owners;

void ascc_owners_find(ascc_owners *owners, const ascc_curve *curve, const double *place,
                      double reach);

/* What the fluid of a block costs. */
typedef struct ascc_load {
    uint64_t key, cost;
} ascc_load;

/* Where there is fluid: joined loads. What is beyond the box of these blocks belongs to who has the nearest in it, what
 * is neither known nor beyond to its place on the curve. False without memory: then nothing is known. */
bool ascc_curve_know(ascc_curve *curve, const ascc_allocator *allocator, const ascc_load *load,
                     size_t count);
/* Nothing is known any more; the memory stays for the next time. */
void ascc_curve_forget(ascc_curve *curve);
void ascc_curve_release(ascc_curve *curve, const ascc_allocator *allocator);

/* Sorts loads by key and joins those of one block; returns how many are left. */
size_t ascc_loads_join(ascc_load *load, size_t count);

/* The most that a piece costs, of loads that are joined. */
double ascc_curve_most(ascc_curve *curve, const ascc_load *load, size_t count);

/* Pieces of about the same cost, of loads that are joined. limit: how far a cut may move, in costs of a piece. */
void ascc_curve_cut(ascc_curve *curve, const ascc_load *load, size_t count, double limit);

#endif
