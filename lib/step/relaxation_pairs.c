/* Neighbour lists of the relaxation at the positions that a step has reached: after an impact these are far from
 * where the network saw the particles, and its lists have not all of a particle's neighbours.
 * SPDX-License-Identifier: MIT */
#include "relaxation_pairs.h"

#include <math.h>

#include "points/search.h"

/* Positions of fluid rows as they are now, host's units. */
static double *lend_fluid(const ascc_step_state *state)
{
    const ascc_hierarchy *h = &state->hierarchy;
    const size_t d = (size_t)state->particles->dimension, count = h->set[ASCC_SET_FLUID].count;
    double *to = ascc_arena_lend(state->tools.arena, count, d * sizeof *to);
    for (size_t i = 0; to && i < count; i++)
        for (size_t c = 0; c < d; c++)
            to[i * d + c] =
                state->advance.position[ascc_hierarchy_host_row(h, ASCC_SET_FLUID, i) * d + c];
    return to;
}

/* Walls stay where the network saw them. */
static double *lend_walls(const ascc_step_state *state)
{
    const ascc_points *walls = &state->hierarchy.set[ASCC_SET_BOUNDARY];
    const size_t d = (size_t)state->particles->dimension;
    const double unit = state->hierarchy.scale.unit / state->length_unit;
    double *to = ascc_arena_lend(state->tools.arena, walls->count, d * sizeof *to);
    for (size_t i = 0; to && i < walls->count; i++)
        for (size_t c = 0; c < d; c++)
            to[i * d + c] = unit * (double)walls->position[c][i];
    return to;
}

static ascc_status find(ascc_step_state *state, const double *fluid, const double *walls,
                        const ascc_rows **rows)
{
    const ascc_hierarchy *h = &state->hierarchy;
    const ascc_network *network = state->network;
    const ascc_rows *seen = &state->run.rows[network->relaxation_key[walls ? 1 : 0]];
    const ascc_search_options options = {
        .dimension = state->particles->dimension,
        .radius = network->plan->relaxation.reach / state->length_unit,
        .query = {fluid, h->set[ASCC_SET_FLUID].count, "fluid particle, in the order of cells,"},
        .source = {walls, h->set[ASCC_SET_BOUNDARY].count, "boundary particle"},
        .max_neighbors = network->max_neighbors,
        .expected = seen->stored + 1};
    ascc_search *search = ascc_arena_take(state->tools.arena, 1, sizeof *search);
    if (!search)
        return ascc_fail(state->tools.message, ASCC_ERROR_MEMORY, "no memory for the relaxation");
    *rows = &search->rows;
    return ascc_search_run(search, &state->tools, &options);
}

/* Ghosts are all that a list needs while no fluid has gone farther than they serve. */
static ascc_status check_reached(const ascc_step_state *state, const double *fluid)
{
    const ascc_hierarchy *h = &state->hierarchy;
    const ascc_points *seen = &h->set[ASCC_SET_FLUID];
    const size_t d = (size_t)state->particles->dimension;
    const double unit = h->scale.unit / state->length_unit;
    double farthest = 0.0;
    if (!state->halo)
        return ASCC_OK;
    for (size_t i = 0; i < seen->count; i++)
        for (size_t c = 0; c < d && !ascc_hierarchy_is_idle(h, i); c++)
            farthest = fmax(farthest, fabs(fluid[i * d + c] - unit * (double)seen->position[c][i]));
    const ascc_status status = ascc_halo_largest(state->halo, &farthest, 1);
    if (status != ASCC_OK || state->halo->serve(state->halo, farthest))
        return status;
    return ascc_fail(state->tools.message, ASCC_ERROR_LIMIT, "ghosts do not reach so far");
}

ascc_status ascc_relaxation_pairs_find(ascc_step_state *state, const ascc_rows *rows[2])
{
    const ascc_arena_mark mark = ascc_arena_mark_of(state->tools.arena);
    const double *fluid = lend_fluid(state);
    const double *walls = lend_walls(state);
    ascc_status status = ASCC_ERROR_MEMORY;
    if (!fluid || !walls)
        (void)ascc_fail(state->tools.message, status, "no memory for the relaxation");
    else
        status = check_reached(state, fluid);
    if (status == ASCC_OK)
        status = find(state, fluid, NULL, &rows[0]);
    if (status == ASCC_OK)
        status = find(state, fluid, walls, &rows[1]);
    ascc_arena_return(state->tools.arena, mark);
    return status;
}
