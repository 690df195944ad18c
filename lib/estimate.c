/* Scratch counted as the step takes it: points, grids, rows, values. SPDX-License-Identifier: MIT */
#include "estimate.h"

#include <math.h>

/* Coarse points beyond those of a full lattice: surfaces, and voxels that only a corner reaches. */
#define SURFACE 1.4

/* Bytes of one point: three 64-bit positions and their low words; and what sorting it takes. */
#define POINT_BYTES 36.0
#define SORT_BYTES 40.0

static double power(double x, int32_t n)
{
    return n == 2 ? x * x : x * x * x;
}

/* Points of a set. */
static double set_points(const ascc_plan *plan, int32_t set, double fluid, double boundary)
{
    if (set == ASCC_SET_FLUID)
        return fluid;
    if (set == ASCC_SET_BOUNDARY)
        return boundary;
    const double all = fluid + boundary;
    if (set == ASCC_SET_ALL)
        return all;
    const ascc_level *level = &plan->level[set - ASCC_SET_LEVEL + 1];
    if (plan->sampling == ASCC_SAMPLING_FARTHEST)
        return all * level->ratio;
    return SURFACE * all * power(plan->spacing / level->voxel, plan->dimension);
}

/* Points of a set around a place inside it, a unit of volume. */
static double set_density(const ascc_plan *plan, int32_t set)
{
    const double particles = 1.0 / power(plan->spacing, plan->dimension);
    if (set <= ASCC_SET_ALL)
        return particles;
    const ascc_level *level = &plan->level[set - ASCC_SET_LEVEL + 1];
    return plan->sampling == ASCC_SAMPLING_FARTHEST ? particles * level->ratio
                                                    : 1.0 / power(level->voxel, plan->dimension);
}

static double level_zero_bytes(const ascc_plan *plan, double fluid, double boundary)
{
    const double d = plan->dimension, all = fluid + boundary;
    const double state = fluid * d * 8.0 * 6.0 + boundary * d * 8.0 * 2.0;
    const double features =
        4.0 * (fluid * plan->fluid_channels + boundary * plan->boundary_channels);
    return state + features + all * (3.0 * POINT_BYTES + SORT_BYTES + 20.0);
}

static double level_bytes(const ascc_plan *plan, double all, double points)
{
    const double corners = plan->sampling == ASCC_SAMPLING_CORNERS ? 1 << plan->dimension : 0;
    return all * 80.0 + points * (POINT_BYTES + corners * SORT_BYTES);
}

static double rows_bytes(const ascc_plan *plan, const ascc_rows_key *key, double queries)
{
    const double ball = plan->dimension == 2 ? 3.1416 * key->radius * key->radius
                                             : 4.1888 * key->radius * key->radius * key->radius;
    double neighbors = 1.0 + ball * set_density(plan, key->source);
    if (key->limit && neighbors > key->limit + 1.0)
        neighbors = key->limit + 1.0;
    return queries * (12.0 + 4.0 * 1.125 * fmax(neighbors, 8.0));
}

size_t ascc_estimate_scratch(const ascc_network *network, size_t fluid, size_t boundary,
                             int32_t threads)
{
    const ascc_plan *plan = network->plan;
    const double f = (double)fluid, b = (double)boundary;
    double bytes = level_zero_bytes(plan, f, b);
    for (int32_t l = 1; l < plan->level_count; l++)
        bytes += level_bytes(plan, f + b, set_points(plan, ASCC_SET_LEVEL + l - 1, f, b));
    for (int32_t k = 0; k < network->key_count; k++) {
        const ascc_rows_key *key = &network->key[k];
        const double queries = set_points(plan, key->query, f, b);
        bytes += rows_bytes(plan, key, queries);
        bytes += SORT_BYTES * (queries + set_points(plan, key->source, f, b));
    }
    for (int32_t v = 0; v < network->value_count; v++)
        bytes += set_points(plan, ascc_network_set(network, v), f, b) *
                 (1.0 + 4.0 * (double)ascc_padded(ascc_network_channels(network, v)));
    /* Per thread and layer: columns of a tile, a row being searched. */
    bytes += (double)threads * (double)(plan->layer_count + 1) * 300e3;
    return bytes < (double)(SIZE_MAX / 2) ? (size_t)bytes : SIZE_MAX / 2;
}
