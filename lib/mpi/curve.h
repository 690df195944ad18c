/* Who owns which part of space: blocks anchored to the world, in the order of a curve that fills it, cut into as many
 * pieces as there are processes. SPDX-License-Identifier: MIT
 *
 *     key of a block (Morton order)   0 ......|............|.......|........ 2^63
 *     process                            0          1          2        3
 *
 * Every place has an owner, whether there is fluid or not, and all processes know it without a word.
 */
#ifndef ASCC_CURVE_H
#define ASCC_CURVE_H

#include "base/common.h"

typedef struct ascc_curve {
    int32_t dimension;
    int size;        /* processes */
    double edge;     /* of a block, host's unit */
    uint64_t *first; /* [size] of each process's keys; ascending, the first 0 */
    double *cut;     /* [size] scratch of ascc_curve_cut */
} ascc_curve;

/* The block that a place is in; beyond 2^20 blocks from the origin all are one. */
void ascc_curve_block(const ascc_curve *curve, const double *place, int64_t block[3]);
uint64_t ascc_curve_key(const ascc_curve *curve, const int64_t block[3]);
int ascc_curve_owner(const ascc_curve *curve, const int64_t block[3]);
int ascc_curve_owner_of(const ascc_curve *curve, const double *place);

/* The processes that own a block within `reach` of a place on every axis, each once, ascending in order of finding. */
typedef struct ascc_owners {
    int64_t low[3], high[3]; /* blocks; those of the last place */
    int64_t block[3];        /* that it was in */
    double reach;            /* that was asked for */
    bool inner;              /* one process owns all within reach of that block */
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

/* Sorts loads by key and joins those of one block; returns how many are left. */
size_t ascc_loads_join(ascc_load *load, size_t count);

/* Pieces of about the same cost, of loads that are joined. limit: how far a cut may move, in costs of a piece. */
void ascc_curve_cut(ascc_curve *curve, const ascc_load *load, size_t count, double limit);

#endif
