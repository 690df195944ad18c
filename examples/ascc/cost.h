/* What a network costs, in multiply-adds. SPDX-License-Identifier: MIT */
#ifndef ASCC_COST_H
#define ASCC_COST_H

#include "model/model.h"

/* Neighbours and points that a cost is told for: means over frames of moving fluid. */
typedef struct ascc_cost_counts {
    double fluid; /* within 2.25 spacings of a particle; in a level likewise, in its own spacings */
    double wall;  /* within 4 spacings of a particle */
    double boundary;               /* wall particles per fluid particle */
    double level[ASCC_MAX_LEVELS]; /* points per fluid particle, [0] not used */
} ascc_cost_counts;
ascc_cost_counts ascc_cost_counts_default(int32_t dimension);

/* Multiply-adds of a step's layers per fluid particle; without search and without evaluating windows,
 * bumps and grid weights. */
double ascc_cost(const ascc_plan *plan, const ascc_cost_counts *counts);

#endif
