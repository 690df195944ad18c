/* Sums of pair impulses that cancel to the bit (paper Eq. 2): for the last layer, and for any stage that
 * acts on pairs. SPDX-License-Identifier: MIT
 *
 * Each unordered pair is evaluated once, rounded to whole quanta once, and added to one side and taken
 * from the other. Integer sums do not depend on order, so neither do they on threads:
 *
 *     rows in cell order   | chunk 0 | chunk 1 | chunk 2 | chunk 3 | ...
 *
 * no neighbour is farther than one chunk away, so chunks 0, 3, 6, ... touch nothing in common, then
 * 1, 4, 7, ..., then 2, 5, 8, ...
 */
#ifndef ASCC_PAIR_SUM_H
#define ASCC_PAIR_SUM_H

#include "network.h"
#include "points/particles.h"

/* Impulses in quanta, [host's rows][dimension]. */
typedef struct ascc_impulses {
    int64_t *fluid, *wall;
} ascc_impulses;

/* From outputs to quanta. */
typedef struct ascc_impulse_scale {
    const double *mass;     /* of fluid rows, kg */
    double factor[3];       /* quanta per kg and unit of output */
    const double *position; /* of fluid rows, before the step */
} ascc_impulse_scale;

/* The greatest impulse of one pair, quanta. */
#define ASCC_IMPULSE_LIMIT ((double)((int64_t)1 << 50))

/* Pairs of one row, evaluated together. */
typedef struct ascc_pair_batch {
    size_t count;
    uint32_t neighbor[ASCC_PAIR_BATCH];
} ascc_pair_batch;

/* Impulses on a row from each neighbour of a batch, in quanta before rounding. */
typedef double ascc_pair_impulses[3][ASCC_PAIR_BATCH];

struct ascc_pair_sum;

/* Evaluates the pairs of row i with the neighbours of the batch, and adds their impulses with the calls
 * below. The batch may be filled up to a multiple of 8. */
typedef void (*ascc_pair_function)(struct ascc_pair_sum *sum, size_t i, ascc_pair_batch *batch);

typedef struct ascc_pair_sum {
    const ascc_network_run *run;
    int32_t set;          /* whose pairs: fluid, or fluid and walls together */
    const uint8_t *fluid; /* [set rows] 1 = a fluid particle */
    const double *mass;   /* [set rows] kg, 0 for walls */
    const uint8_t *idle;  /* [set rows] 1 = its pairs are not wanted; NULL = all are */
    bool uniform;         /* all fluid particles have one mass */
    int64_t *sum;         /* [set rows][stride] */
    size_t stride;
    int64_t *wall;    /* [boundary rows of the host][dimension] */
    const void *data; /* the function's own */
    /* Evaluates all pairs of row i of a set of fluid at once, if it can; else, or NULL: batch by batch. */
    bool (*whole)(struct ascc_pair_sum *sum, size_t i);

    /* Under way: */
    const ascc_rows *rows;
    ascc_pair_function evaluate;
    bool skip_coincident;
    size_t chunk, phase;
    atomic_uint_least64_t pairs;
    atomic_size_t bad_row; /* 1 + smallest set row with an impulse that cannot be held */
} ascc_pair_sum;

/* Sums of zero for the rows of a set, in what the arena lends. stride: numbers of a row, at least the
 * dimension. errors: MEMORY. */
ascc_status ascc_pair_sum_open(ascc_pair_sum *sum, const ascc_network_run *run, int32_t set,
                               const double *mass, size_t stride);

/* Every unordered pair of a neighbour list within the set, walls with walls left out. */
void ascc_pair_sum_run(ascc_pair_sum *sum, const ascc_rows *rows, ascc_pair_function evaluate);
/* Every pair of a row of the set and a wall of a neighbour list into the boundary. wall: the host's
 * impulses of walls; several threads add to them at once. */
void ascc_pair_sum_run_walls(ascc_pair_sum *sum, const ascc_rows *rows, int64_t *wall,
                             ascc_pair_function evaluate);

/* Rounds and adds; an impulse that cannot be held is noted. */
void ascc_pair_sum_add(ascc_pair_sum *sum, size_t i, const ascc_pair_batch *batch,
                       ascc_pair_impulses impulse);
void ascc_pair_sum_add_walls(ascc_pair_sum *sum, size_t i, const ascc_pair_batch *batch,
                             ascc_pair_impulses impulse);
void ascc_pair_sum_note_bad(ascc_pair_sum *sum, size_t i);

/* Mass that turns a velocity correction into an impulse: the particles' own if they agree, else twice
 * the reduced mass; a wall counts as the fluid particle's equal (docs/method.md). */
static inline double ascc_pair_mass(double a, double b)
{
    return a == b || b == 0.0 ? a : 2.0 * (a * b) / (a + b);
}

/* Displacements from row i to the batch's neighbours and their squares: at their places [row][3], in the
 * host's unit, or as the network sees them, in units (place NULL). */
void ascc_pair_displacements(const ascc_rows *rows, const double *place, size_t i,
                             const ascc_pair_batch *batch, ascc_pair_impulses displacement,
                             double square[ASCC_PAIR_BATCH]);

/* Gives the sums to the host's rows. values, [set rows][channels]: what the impulses were made of, to tell
 * one that is not finite from one too large. errors: NOT_FINITE, RANGE; the message names the row. */
ascc_status ascc_pair_sum_give(ascc_pair_sum *sum, const float *values, size_t channels,
                               const ascc_impulses *impulses, uint64_t *pair_count);

/* The message for a set row whose impulse cannot be held. */
ascc_status ascc_pair_sum_fail(const ascc_network_run *run, int32_t set, size_t row,
                               const float *values, size_t channels);

/* Nearest integers, ties to even. False when a value is beyond what one pair may give. */
bool ascc_round_quanta(const double *x, size_t count, int64_t *quanta);

#endif
