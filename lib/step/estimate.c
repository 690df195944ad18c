/* Scratch counted as the step takes it: points, grids, rows, values, and the most of what is lent
 * meanwhile. SPDX-License-Identifier: MIT */
#include "estimate.h"

#include <math.h>

/* Coarse points beyond those of a full lattice: surfaces, and voxels that only a corner reaches. */
#define SURFACE 1.4

/* Of a wall within a relaxation's support: points in one layer, 0.65 spacings apart. */
#define WALL_NEIGHBORS 32.0

/* Bytes of one point: three 64-bit positions and their low words. */
#define POINT_BYTES 36.0
/* An edge: its two points. */
#define EDGE_BYTES 8.0
/* A point that is sorted: key and row, twice. */
#define SORT_BYTES 24.0

static double power(double x, int32_t n)
{
    return n == 2 ? x * x : x * x * x;
}

static double edge_count(const ascc_plan *plan, double fluid, double boundary);

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
    if (set == ASCC_SET_EDGES)
        return edge_count(plan, fluid, boundary);
    const ascc_level *level = &plan->level[set - ASCC_SET_LEVEL + 1];
    if (plan->sampling == ASCC_SAMPLING_FARTHEST)
        return all * level->ratio;
    return SURFACE * (plan->fluid_sampled ? fluid : all) *
           power(plan->spacing / level->voxel, plan->dimension);
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

/* Neighbours of a row inside the fluid, itself included. */
static double row_length(const ascc_plan *plan, const ascc_list_key *key)
{
    const double ball = plan->dimension == 2 ? 3.1416 * key->radius * key->radius
                                             : 4.1888 * key->radius * key->radius * key->radius;
    const double cube = power(2.0 * key->cube, plan->dimension);
    const double all = 1.0 + (key->cube > 0.0 ? cube : ball) * set_density(plan, key->source);
    return key->limit ? fmin(all, key->limit + 1.0) : all;
}

static double edge_count(const ascc_plan *plan, double fluid, double boundary)
{
    const ascc_list_key key = {.source = plan->edge_set, .radius = plan->edge_radius};
    return set_points(plan, plan->edge_set, fluid, boundary) * row_length(plan, &key);
}

/* What a list has: where rows begin, and the neighbours. */
#define ROW_BYTES 12.0

static double list_bytes(const ascc_plan *plan, const ascc_list_key *key, double queries)
{
    return queries * 4.0 * 1.125 * row_length(plan, key);
}

/* Slots of a set that is sorted again for a radius, and its cells. */
static double grid_bytes(const ascc_plan *plan, int32_t set, double radius, double points)
{
    const double filled = set_density(plan, set) * power(radius, plan->dimension);
    double smallest, largest;
    ascc_plan_radii(plan, &smallest, &largest);
    const bool sorted = set <= ASCC_SET_ALL && radius == smallest;
    return points * ((sorted ? 0.0 : 16.0) + 12.0 / fmax(1.0, filled));
}

/* Grids of all searches, and where their rows begin. */
static double grids_bytes(const ascc_network *network, double fluid, double boundary)
{
    const ascc_plan *plan = network->plan;
    double bytes = 0.0;
    for (int32_t k = 0; k < network->key_count; k++) {
        const ascc_list_key *key = &network->key[k];
        const double queries = set_points(plan, key->query, fluid, boundary);
        bytes += ROW_BYTES * queries;
        bool query_done = false, source_done = false; /* grids are shared */
        for (int32_t j = 0; j < k; j++) {
            const ascc_list_key *old = &network->key[j];
            const bool same = old->radius == key->radius;
            query_done |= same && (old->query == key->query || old->source == key->query);
            source_done |= same && (old->query == key->source || old->source == key->source);
        }
        if (!query_done)
            bytes += grid_bytes(plan, key->query, key->radius, queries);
        if (!source_done && key->source != key->query)
            bytes += grid_bytes(plan, key->source, key->radius,
                                set_points(plan, key->source, fluid, boundary));
    }
    return bytes;
}

/* Neighbour lists that outlive the layers, or the others. */
static double lists_bytes(const ascc_network *network, double fluid, double boundary, bool lasting)
{
    double bytes = 0.0;
    for (int32_t k = 0; k < network->key_count; k++) {
        const ascc_list_key *key = &network->key[k];
        const bool lasts = k == network->relaxation_key[0] || k == network->relaxation_key[1] ||
                           k == network->term_key[network->plan->term_count][0];
        if (lasts == lasting)
            bytes += list_bytes(network->plan, key,
                                set_points(network->plan, key->query, fluid, boundary));
    }
    return bytes;
}

/* Floats that are stored of a value's row. */
static double value_width(const ascc_network *network, int32_t v)
{
    const bool stored = v < 2 || !ascc_network_passes_on(network, v - 2);
    const int copies = (network->wants[v] & 1) + (network->wants[v] >> 1 & 1);
    return stored ? copies * (double)ascc_padded(ascc_network_channels(network, v)) : 0.0;
}

/* Do two values take over memory from each other? */
static bool are_alike(const ascc_network *network, int32_t v, int32_t u)
{
    return v > 1 && u > 1 && ascc_network_set(network, v) == ascc_network_set(network, u) &&
           ascc_padded(ascc_network_channels(network, v)) ==
               ascc_padded(ascc_network_channels(network, u));
}

/* Floats of a row of all values like v, those at once that are still to be read. */
static double width_at_once(const ascc_network *network, int32_t v)
{
    double most = value_width(network, v);
    for (int32_t l = 0; l < network->plan->layer_count; l++) {
        double floats = 0.0;
        for (int32_t u = 2; u <= l + 2; u++)
            if (are_alike(network, v, u) && network->last_reader[u] >= l)
                floats += value_width(network, u);
        most = fmax(most, floats);
    }
    return most;
}

static double value_bytes(const ascc_network *network, double fluid, double boundary)
{
    double bytes = 0.0;
    for (int32_t v = 0; v < network->value_count; v++) {
        bool counted = false;
        for (int32_t u = 2; u < v; u++)
            counted |= are_alike(network, u, v);
        bytes += set_points(network->plan, ascc_network_set(network, v), fluid, boundary) *
                 (1.0 + (counted ? 0.0 : 4.0 * width_at_once(network, v)));
    }
    return bytes;
}

/* Lent to a worker for the widest layer: columns of a tile, scratch of its terms; roughly. */
static double layer_bytes(const ascc_plan *plan, double longest)
{
    double most = 0.0;
    for (int32_t t = 0; t < plan->term_count; t++) {
        const ascc_term *term = &plan->term[t];
        ascc_scratch_sizes sizes = {.room = (size_t)longest};
        if (term->operation->scratch)
            term->operation->scratch(plan, term, &sizes);
        most = fmax(most, ASCC_TILE_ROWS * ((double)sizes.column + 80.0) + (double)sizes.scratch);
    }
    return 4.0 * most;
}

/* Lent for each row of the output's set. */
static double output_bytes(const ascc_plan *plan)
{
    ascc_scratch_sizes sizes = {0};
    if (plan->output.term.operation->scratch)
        plan->output.term.operation->scratch(plan, &plan->output.term, &sizes);
    return 9.0 + (double)sizes.column;
}

/* Lent while the points are sorted and sampled. */
static double hierarchy_bytes(const ascc_plan *plan, double fluid, double boundary)
{
    const double all = fluid + boundary;
    double bytes = boundary * 4.0 + all * (28.0 + SORT_BYTES);
    for (int32_t l = 1; l < plan->level_count; l++) {
        const double points = set_points(plan, ASCC_SET_LEVEL + l - 1, fluid, boundary);
        const bool corners = plan->sampling == ASCC_SAMPLING_CORNERS;
        const double keys = corners && plan->hysteresis > 0.0 ? 2.0 * all : all;
        bytes = fmax(bytes, 16.0 * keys + (corners ? 16.0 * (1 << plan->dimension) : 8.0) * points);
    }
    return bytes +
           all * (plan->dimension * 8.0 + (ascc_hierarchy_reads_whole(plan) ? 0.0 : POINT_BYTES));
}

/* Lent for a relaxation: numbers and pairs of each row, its impulses; and its walls as points with rows. */
static double relaxation_bytes(const ascc_network *network, double fluid, double boundary)
{
    const ascc_plan *plan = network->plan;
    if (!plan->relaxation.pressure.count)
        return 0.0;
    const ascc_list_key key = {
        .query = ASCC_SET_FLUID, .source = ASCC_SET_FLUID, .radius = plan->relaxation.reach};
    double anew = 0.0; /* of a second round: points, cells and lists */
    if (plan->relaxation.rounds > 1) {
        const ascc_list_key wall_key = {
            .query = ASCC_SET_FLUID, .source = ASCC_SET_BOUNDARY, .radius = key.radius};
        anew = 3.0 * (fluid + boundary) * (2.0 * POINT_BYTES + 28.0) + 2.0 * ROW_BYTES * fluid +
               list_bytes(plan, &key, fluid) + list_bytes(plan, &wall_key, fluid);
    }
    const double smoothing = plan->relaxation.viscosity.count ? 68.0 : 0.0;
    const double walls = 2.0 * POINT_BYTES + 4.0 + SORT_BYTES + 4.0 * 1.125 * WALL_NEIGHBORS;
    return fluid * (144.0 + smoothing + 21.0 * (row_length(plan, &key) + 4.0)) +
           boundary * (4.0 + walls) + anew;
}

size_t ascc_estimate_scratch(const ascc_network *network, size_t fluid, size_t boundary,
                             int32_t threads)
{
    const ascc_plan *plan = network->plan;
    const double f = (double)fluid, b = (double)boundary, all = f + b, d = plan->dimension;
    double points = 8.0 * d * (5.0 * f + b) +
                    all * ((ascc_hierarchy_reads_whole(plan) ? 2.0 : 1.0) * POINT_BYTES + 28.0);
    for (int32_t l = 1; l < plan->level_count; l++)
        points += POINT_BYTES * set_points(plan, ASCC_SET_LEVEL + l - 1, f, b);
    double longest = 0.0;
    for (int32_t k = 0; k < network->key_count; k++)
        longest = fmax(longest, row_length(plan, &network->key[k]));
    if (plan->edge_radius > 0.0)
        points += EDGE_BYTES * edge_count(plan, f, b) + 8.0 * all;
    const double features = 4.0 * (f * plan->fluid_channels + b * plan->boundary_channels);
    const double lasting = grids_bytes(network, f, b) + lists_bytes(network, f, b, true);
    const double forward =
        features + all * 4.0 + (double)threads * layer_bytes(plan, 1.5 * longest);
    const double layers = lists_bytes(network, f, b, false) + value_bytes(network, f, b) +
                          fmax(forward, all * output_bytes(plan));
    double bytes = fmax(features + hierarchy_bytes(plan, f, b),
                        lasting + fmax(layers, relaxation_bytes(network, f, b)));
    bytes = 1.125 * (points + bytes) + 64e3; /* what a block has more; small things */
    return bytes < (double)(SIZE_MAX / 2) ? (size_t)bytes : SIZE_MAX / 2;
}
