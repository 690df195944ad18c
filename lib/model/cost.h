/* What a network costs: multiply-adds, counted from its plan. SPDX-License-Identifier: MIT */
#ifndef ASCC_COST_H
#define ASCC_COST_H

#include "plan.h"

/* Neighbours and points that a cost is told for: means over frames of moving fluid. */
struct ascc_cost_counts {
    double fluid; /* within 2.25 spacings of a particle; in a level likewise, in its own spacings */
    double wall;  /* within 4 spacings of a particle */
    double boundary;               /* wall particles per fluid particle */
    double level[ASCC_MAX_LEVELS]; /* points per fluid particle, [0] not used */
    double edges;                  /* per fluid particle; ascc_cost finds it */
};
typedef struct ascc_cost_counts ascc_cost_counts;

ascc_cost_counts ascc_cost_counts_default(int32_t dimension);

/* Multiply-adds of a step's layers per fluid particle; without search and without evaluating windows,
 * bumps and grid weights. */
double ascc_cost(const ascc_plan *plan, const ascc_cost_counts *counts);

/* ---- What operations count with ---- */

/* Points of a set per fluid particle. */
double ascc_cost_points(const ascc_cost_counts *counts, int32_t set);
/* How far its points are apart, m. */
double ascc_cost_voxel(const ascc_plan *plan, int32_t set);
/* Neighbours of a point within a radius (m) in a set: a volume of them, and a surface of walls. */
double ascc_cost_neighbors(const ascc_plan *plan, const ascc_cost_counts *counts, int32_t source,
                           double radius);

#endif
