/* Nearest and fixed-radius search for measures: a k-d tree that takes points anywhere.
 * SPDX-License-Identifier: MIT
 *
 * The solver's grid refuses particles that fly off; measures must not, so they search on their own.
 * Each query is independent of the others, and visits the tree in one order: results depend neither on
 * threads nor on what was asked before.
 */
#ifndef ASCC_MEASURES_SEARCH_H
#define ASCC_MEASURES_SEARCH_H

#include <stdbool.h>

#include "measures.h"

typedef struct ascc_measure_tree {
    int32_t dimension;
    size_t count;
    double *position;    /* [count][dimension], in the tree's order */
    size_t *row;         /* [count] rows of the caller's set */
    unsigned char *axis; /* [count] along which a middle splits its range */
} ascc_measure_tree;

/* Copies the points. errors: MEMORY, NOT_FINITE. */
ascc_status ascc_measure_tree_build(ascc_measure_tree *tree, int32_t dimension, size_t count,
                                    const double *position);
void ascc_measure_tree_free(ascc_measure_tree *tree);

/* Squared distance from the point to the nearest other than row `skip` (SIZE_MAX = none skipped);
 * infinity when there is none. */
double ascc_measure_tree_nearest(const ascc_measure_tree *tree, const double *point, size_t skip);

/* Called for a row found, with its squared distance. */
typedef void (*ascc_measure_visit)(void *data, size_t row, double square);

/* Visits all rows with distance^2 < square, in the tree's order. */
void ascc_measure_tree_within(const ascc_measure_tree *tree, const double *point, double square,
                              ascc_measure_visit visit, void *data);

/* Calls function for blocks that cover [0, count), on up to `threads` threads. */
typedef void (*ascc_measure_range)(void *data, size_t begin, size_t end);
void ascc_measure_parallel(int32_t threads, size_t count, size_t block, ascc_measure_range function,
                           void *data);

/* Whether the set's shape is one that measures accept, and whether its positions are finite. */
bool ascc_measure_valid(const ascc_measure_set *set);
bool ascc_measure_finite(const double *values, size_t count);

#endif
