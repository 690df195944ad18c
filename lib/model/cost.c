/* Multiply-adds of a plan, operation by operation. SPDX-License-Identifier: MIT */
#include "cost.h"

#include <math.h>

#include "operation.h"

ascc_cost_counts ascc_cost_counts_default(int32_t dimension)
{
    if (dimension == 2)
        return (ascc_cost_counts){12.0, 6.0, 0.5, {0.0, 0.4, 0.12, 0.04, 0.01, 0.0, 0.0, 0.0}, 0.0};
    return (ascc_cost_counts){33.0, 10.0, 1.0, {0.0, 0.25, 0.05, 0.015, 0.005, 0.0, 0.0, 0.0}, 0.0};
}

double ascc_cost_points(const ascc_cost_counts *counts, int32_t set)
{
    const double share[3] = {1.0, counts->boundary, 1.0 + counts->boundary};
    if (set == ASCC_SET_EDGES)
        return counts->edges;
    return set < ASCC_SET_LEVEL ? share[set] : counts->level[set - ASCC_SET_LEVEL + 1];
}

double ascc_cost_voxel(const ascc_plan *plan, int32_t set)
{
    if (set < ASCC_SET_LEVEL || set == ASCC_SET_EDGES)
        return plan->spacing;
    const ascc_level *level = &plan->level[set - ASCC_SET_LEVEL + 1];
    return level->ratio > 0.0 ? plan->spacing * pow(level->ratio, -1.0 / plan->dimension)
                              : level->voxel;
}

double ascc_cost_neighbors(const ascc_plan *plan, const ascc_cost_counts *counts, int32_t source,
                           double radius)
{
    const double volume = pow(radius / (2.25 * ascc_cost_voxel(plan, source)), plan->dimension);
    const double surface = pow(radius / (4.0 * plan->spacing), plan->dimension - 1);
    const bool walls = source == ASCC_SET_BOUNDARY || source == ASCC_SET_ALL;
    return (source != ASCC_SET_BOUNDARY ? counts->fluid * volume : 0.0) +
           (walls ? counts->wall * surface : 0.0);
}

double ascc_cost(const ascc_plan *plan, const ascc_cost_counts *given)
{
    ascc_cost_counts with_edges = *given;
    const ascc_cost_counts *counts = &with_edges;
    with_edges.edges = ascc_cost_points(given, plan->edge_set) *
                       ascc_cost_neighbors(plan, given, plan->edge_set, plan->edge_radius);
    const ascc_term *output = &plan->output.term;
    double sum = output->operation->cost
                     ? output->operation->cost(
                           plan, counts, ascc_plan_value_set(plan->layer, output->source), output)
                     : 0.0;
    for (int32_t l = 0; l < plan->layer_count; l++)
        for (int32_t t = 0; t < plan->layer[l].term_count; t++) {
            const ascc_term *term = &plan->term[plan->layer[l].first_term + t];
            if (term->operation->cost)
                sum += term->operation->cost(plan, counts, plan->layer[l].set, term);
        }
    return sum;
}
