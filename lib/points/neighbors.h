/* Fixed-radius search in any domain: neighbour lists of grids, made on demand.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_NEIGHBORS_H
#define ASCC_NEIGHBORS_H

#include <stdatomic.h>

#include "grid.h"

/* The count of a list that is not made. */
#define ASCC_ROW_ABSENT UINT32_MAX

/* Neighbour lists of query points among source points, in compressed rows: each made when it is first
 * asked for. Row i of the query set has neighbor[start[i] ..], count[i] of them, in the order of cells. */
typedef struct ascc_rows {
    const ascc_points *query, *source;
    const ascc_grid *query_grid, *source_grid;
    double radius; /* units; no less than half the edge of the cube below, if there is one */
    float
        inverse_cube; /* 1 / half the edge, in units, of a cube searched in place of the ball; 0 = none */
    bool same;        /* query and source are one set */
    bool skip_self;
    int32_t limit;         /* nearest neighbours kept, mutual if `same`; 0 = all */
    int32_t max_neighbors; /* before LIMIT */
    /* Which neighbours lists leave out, the same from both sides if query and source are one set; NULL: none. */
    bool (*hides)(const void *data, uint32_t query, uint32_t source);
    const void *hides_data;
    uint32_t *count;       /* [query count] neighbours, or ASCC_ROW_ABSENT */
    size_t *start;         /* [query count] into neighbor */
    uint32_t *neighbor;    /* rows of the source set */
    size_t capacity, used; /* entries there is room for, and set aside */
    size_t stored;         /* entries that lists hold */
    uint32_t longest;      /* list */
    size_t span; /* if query and source are one set: rows that neighbours are apart at most */
} ascc_rows;

/* Room for all lists, none of them made. expected: neighbours to make room for at first; 0 = count them first. */
ascc_status ascc_rows_open(ascc_rows *rows, const ascc_search_tools *tools, size_t expected);

/* Makes the lists of queries with wanted[row] != 0 (NULL = all) that are not made yet.
 * errors: MEMORY, LIMIT. */
ascc_status ascc_rows_make(ascc_rows *rows, const ascc_search_tools *tools, const uint8_t *wanted);

#endif
