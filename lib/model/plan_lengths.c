/* Lengths that follow from a plan: how far its operations look. SPDX-License-Identifier: MIT */
#include <math.h>

#include "operation.h"

/* Neighbour lists of a term by number, the output's last. */
static int lists_of(const ascc_plan *plan, int32_t t, ascc_list_key key[ASCC_MAX_LISTS])
{
    const ascc_term *term = ascc_plan_term(plan, t);
    return term->operation->lists ? term->operation->lists(plan, term, 0, key) : 0;
}

/* How far a term looks; of an output: at other fluid particles. 0 = it does not. */
static double radius_of(const ascc_plan *plan, int32_t t)
{
    ascc_list_key key[ASCC_MAX_LISTS];
    return lists_of(plan, t, key) ? ascc_plan_term(plan, t)->filter.radius : 0.0;
}

void ascc_plan_radii(const ascc_plan *plan, double *smallest, double *largest)
{
    *smallest = INFINITY;
    *largest = 0.0;
    for (int32_t t = 0; t <= plan->term_count; t++) {
        const double radius = radius_of(plan, t);
        *smallest = radius > 0.0 ? fmin(*smallest, radius) : *smallest;
        *largest = fmax(*largest, radius);
    }
    *largest = fmax(*largest, fmax(plan->output.walls.radius, plan->relaxation.reach));
    if (plan->relaxation.pressure.count && *smallest > ASCC_LONGER * plan->relaxation.reach)
        *smallest = plan->relaxation.reach;
    if (*largest == 0.0) /* a network of dense layers: any scale will do */
        *smallest = *largest = plan->spacing > 0.0 ? plan->spacing : 1.0;
}

/* Largest radius among the terms of a layer. */
static double layer_radius(const ascc_plan *plan, const ascc_layer *layer)
{
    double radius = 0.0;
    for (int32_t i = 0; i < layer->term_count; i++)
        radius = fmax(radius, radius_of(plan, layer->first_term + i));
    return radius;
}

double ascc_plan_support_radius(const ascc_plan *plan)
{
    const double own = fmax(radius_of(plan, plan->term_count), plan->relaxation.support);
    const int32_t source = plan->output.term.source;
    return own > 0.0 || source < 2 ? own : layer_radius(plan, &plan->layer[source - 2]);
}

/* How far from a point of the set the particles lie that put it there. */
static double sampling_reach(const ascc_plan *plan, int32_t set)
{
    if (set < ASCC_SET_LEVEL || set == ASCC_SET_EDGES)
        return 0.0;
    const double diagonal =
        plan->level[set - ASCC_SET_LEVEL + 1].voxel * sqrt((double)plan->dimension);
    return plan->sampling == ASCC_SAMPLING_CORNERS ? diagonal * (1.0 + plan->hysteresis) : diagonal;
}

/* A density is carried over two supports by each sweep. */
static double relaxation_reach(const ascc_plan *plan)
{
    const ascc_relaxation *r = &plan->relaxation;
    return 2.0 * r->support * (r->pressure.count + r->divergence.count);
}

double ascc_plan_receptive_radius(const ascc_plan *plan)
{
    double reach[ASCC_MAX_LAYERS + 2] = {0.0, 0.0};
    for (int32_t i = 0; i < plan->layer_count; i++) {
        const ascc_layer *layer = &plan->layer[i];
        double farthest = 0.0;
        for (int32_t t = layer->first_term; t < layer->first_term + layer->term_count; t++) {
            const int32_t source = plan->term[t].source;
            const int32_t set = ascc_plan_value_set(plan->layer, source);
            farthest =
                fmax(farthest, radius_of(plan, t) + fmax(reach[source], sampling_reach(plan, set)));
        }
        reach[i + 2] = farthest;
    }
    const double last = fmax(radius_of(plan, plan->term_count), plan->output.walls.radius);
    return last + reach[plan->output.term.source] + relaxation_reach(plan);
}

int32_t ascc_plan_neighbor_limit(const ascc_plan *plan)
{
    int32_t most = 0;
    if (plan->relaxation.pressure.count)
        return 0;
    for (int32_t t = 0; t <= plan->term_count; t++) {
        ascc_list_key key[ASCC_MAX_LISTS];
        if (!lists_of(plan, t, key))
            continue;
        if (key[0].limit == 0)
            return 0;
        most = most > key[0].limit ? most : key[0].limit;
    }
    return most;
}
