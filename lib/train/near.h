/* Who is near whom among the particles of a loss. SPDX-License-Identifier: MIT */
#ifndef ASCC_TRAIN_NEAR_H
#define ASCC_TRAIN_NEAR_H

#include "points/neighbors.h"

/* Neighbours of query row i: rows->neighbor[rows->start[i] ..] of the source. */
typedef struct ascc_near {
    ascc_points points[2]; /* query, source */
    ascc_grid grid[2];
    ascc_rows rows;
} ascc_near;

/* positions [count][dimension], m; source NULL = the queries themselves, each its own neighbour, too.
 * errors: MEMORY, RANGE. */
ascc_status ascc_near_find(ascc_near *near, const ascc_search_tools *tools, int32_t dimension,
                           double radius, const double *query, size_t query_count,
                           const double *source, size_t source_count);

/* e[3] = from query row i to source row j over the radius; returns its square. */
static inline double ascc_near_separation(const ascc_near *near, size_t i, size_t j, double e[3])
{
    double square = 0.0;
    for (int c = 0; c < 3; c++) {
        e[c] = (double)(near->rows.source->position[c][j] - near->rows.query->position[c][i]) /
               near->rows.radius;
        square += e[c] * e[c];
    }
    return square;
}

#endif
