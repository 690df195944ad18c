/* Edges: the entries of one neighbour list as rows of values, in the order of the points that they lead to and of
 * each one's neighbours. SPDX-License-Identifier: MIT
 *
 * An edge leads from its sender, the neighbour, to its receiver; a point has one to itself.
 */
#ifndef ASCC_EDGES_H
#define ASCC_EDGES_H

#include "model/operation.h"
#include "points/neighbors.h"

typedef struct ascc_edges {
    size_t count;
    size_t *first;               /* [points] of those that lead to it; they follow one another */
    uint32_t *sender, *receiver; /* [count] rows of the points */
} ascc_edges;

/* The list whose entries a plan's edges are. */
ascc_list_key ascc_edges_list(const ascc_plan *plan);

/* Numbers the entries of all lists that are made. errors: MEMORY, LIMIT. */
ascc_status ascc_edges_number(ascc_edges *edges, const ascc_rows *rows,
                              const ascc_search_tools *tools);

/* From flags of receivers to flags of edges, which take their place. errors: MEMORY. */
ascc_status ascc_edges_flags(const ascc_edges *edges, const ascc_search_tools *tools,
                             uint8_t **active);

#endif
