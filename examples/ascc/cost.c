/* Counts the multiply-adds of a plan. SPDX-License-Identifier: MIT */
#include "cost.h"

#include <math.h>

ascc_cost_counts ascc_cost_counts_default(int32_t dimension)
{
    if (dimension == 2)
        return (ascc_cost_counts){12.0, 6.0, 0.5, {0.0, 0.4, 0.12, 0.04, 0.01, 0.0, 0.0, 0.0}};
    return (ascc_cost_counts){33.0, 10.0, 1.0, {0.0, 0.25, 0.05, 0.015, 0.005, 0.0, 0.0, 0.0}};
}

/* Points of a set per fluid particle. */
static double share_of(const ascc_cost_counts *counts, int32_t set)
{
    const double share[3] = {1.0, counts->boundary, 1.0 + counts->boundary};
    return set < ASCC_SET_LEVEL ? share[set] : counts->level[set - ASCC_SET_LEVEL + 1];
}

/* How far its points are apart, m. */
static double voxel_of(const ascc_plan *plan, int32_t set)
{
    if (set < ASCC_SET_LEVEL)
        return plan->spacing;
    const ascc_level *level = &plan->level[set - ASCC_SET_LEVEL + 1];
    return level->ratio > 0.0 ? plan->spacing * pow(level->ratio, -1.0 / plan->dimension)
                              : level->voxel;
}

/* Neighbours of a point: a volume of them, and a surface of walls. */
static double neighbors_of(const ascc_plan *plan, const ascc_cost_counts *counts, int32_t source,
                           double radius)
{
    const double volume = pow(radius / (2.25 * voxel_of(plan, source)), plan->dimension);
    const double surface = pow(radius / (4.0 * plan->spacing), plan->dimension - 1);
    const bool walls = source == ASCC_SET_BOUNDARY || source == ASCC_SET_ALL;
    return (source != ASCC_SET_BOUNDARY ? counts->fluid * volume : 0.0) +
           (walls ? counts->wall * surface : 0.0);
}

/* Cells that a neighbour adds to: two bumps reach it, beyond the last bump's centre one. */
static double cells_reached(const ascc_filter *f, int32_t dimension)
{
    if (!f->bumps)
        return dimension == 2 ? 4.0 : 8.0;
    return f->cells[0] * (1.0 + (f->bumps > 1 ? pow(1.0 - 1.0 / f->bumps, dimension) : 0.0));
}

static int32_t set_of_value(const ascc_plan *plan, int32_t value)
{
    return value < 2 ? value : plan->layer[value - 2].set;
}

static double term_cost(const ascc_plan *plan, const ascc_cost_counts *counts, int32_t set,
                        const ascc_term *t)
{
    const int32_t source = set_of_value(plan, t->source), d = plan->dimension;
    const double points = share_of(counts, set), from = share_of(counts, source);
    const double matrix = (double)t->inputs * t->outputs;
    const int32_t *cells = t->filter.cells;
    switch (t->kind) {
    case ASCC_TERM_DENSE:
        return (points < from ? points : from) * matrix;
    case ASCC_TERM_TRANSFER: /* each point of the finer set has 2^d corners of the coarser */
        return (voxel_of(plan, set) < voxel_of(plan, source) ? points : from) * (double)(1 << d) *
                   t->inputs +
               points * matrix;
    case ASCC_TERM_CONVOLUTION:
        return points * (neighbors_of(plan, counts, source, t->filter.radius) *
                             cells_reached(&t->filter, d) * t->inputs +
                         matrix * cells[0] * cells[1] * cells[2]);
    default:
        return 0.0;
    }
}

/* With a basis each particle is multiplied with all bumps once; with a grid each pair is on its own. */
static double output_cost(const ascc_plan *plan, const ascc_cost_counts *counts)
{
    const ascc_output *o = &plan->output;
    const int32_t source = set_of_value(plan, o->source);
    if (o->kind == ASCC_OUTPUT_PLAIN)
        return 0.0;
    if (!o->filter.bumps)
        return 0.5 * neighbors_of(plan, counts, source, o->filter.radius) *
               cells_reached(&o->filter, plan->dimension) * o->inputs * plan->dimension;
    const int32_t pairs = o->filter.bumps * (o->damping ? 2 : 1);
    const int32_t walls = o->walls.present ? o->walls.filter.bumps * (o->walls.damping ? 2 : 1) : 0;
    return share_of(counts, source) * (pairs + walls) * o->inputs;
}

double ascc_cost(const ascc_plan *plan, const ascc_cost_counts *counts)
{
    double sum = output_cost(plan, counts);
    for (int32_t l = 0; l < plan->layer_count; l++) {
        const ascc_layer *layer = &plan->layer[l];
        for (int32_t t = layer->first_term; t < layer->first_term + layer->term_count; t++)
            sum += term_cost(plan, counts, layer->set, &plan->term[t]);
    }
    return sum;
}
