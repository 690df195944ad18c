/* Neighbours of one set of positions in another, found once. SPDX-License-Identifier: MIT */
#ifndef ASCC_SEARCH_H
#define ASCC_SEARCH_H

#include "neighbors.h"

/* Positions [count][dimension], in the unit of the radius. */
typedef struct ascc_positions {
    const double *at;
    size_t count;
    const char *name; /* of one in messages, such as "fluid row"; NULL = "point" */
} ascc_positions;

/* What is searched for. Zero is the default of what comes after the query. */
typedef struct ascc_search_options {
    int32_t dimension;
    double radius;
    ascc_positions query;
    ascc_positions source; /* at NULL: the queries themselves, each a neighbour of itself, too */
    bool skip_self;
    int32_t max_neighbors; /* before LIMIT; 0 = 2^20 */
    size_t expected;       /* neighbours in all to make room for at first; 0 = 36 a query */
    const uint8_t *wanted; /* [query count]: 0 = makes no list for it; NULL = all */
} ascc_search_options;

/* Neighbours of query i: rows.neighbor[rows.start[i] ..], rows.count[i] of them. The struct stays where
 * it is while it is used, and lies in the arena. */
typedef struct ascc_search {
    ascc_points points[2]; /* query, source */
    ascc_grid grid[2];
    ascc_rows rows;
} ascc_search;

/* errors: MEMORY, RANGE (a position not finite or too far from the origin, by name), LIMIT. */
ascc_status ascc_search_run(ascc_search *search, const ascc_search_tools *tools,
                            const ascc_search_options *options);

/* e[3] = from query i to source j over the radius; returns its square. */
static inline double ascc_search_separation(const ascc_search *search, size_t i, size_t j,
                                            double e[3])
{
    const ascc_rows *rows = &search->rows;
    double square = 0.0;
    for (int c = 0; c < 3; c++) {
        e[c] = (double)(rows->source->position[c][j] - rows->query->position[c][i]) / rows->radius;
        square += e[c] * e[c];
    }
    return square;
}

#endif
