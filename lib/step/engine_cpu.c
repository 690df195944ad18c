/* The engine of this machine's CPU: point sets, neighbour lists, layers, pair impulses.
 * SPDX-License-Identifier: MIT */
#include "engine.h"

/* Quanta per kilogram and unit of the network's output: the output is a displacement during the
 * model's time step; with another one, the velocity it stands for is scaled as an acceleration. */
static ascc_impulse_scale impulse_scale(const ascc_step_state *state)
{
    const ascc_plan *plan = state->network->plan;
    const ascc_particles *p = state->particles;
    ascc_impulse_scale scale = {.mass = p->mass, .position = p->position};
    for (int c = 0; c < 3; c++)
        scale.factor[c] = plan->output.scale[c] / plan->time_step *
                          (state->motion->time_step * state->time_unit / plan->time_step) *
                          state->time_unit / state->length_unit / p->quantum;
    return scale;
}

/* Points of a level, of which each process tells its own. */
static size_t points_of(const ascc_hierarchy *h, int32_t level)
{
    const size_t count = h->set[ASCC_SET_LEVEL + level - 1].count;
    size_t own = 0;
    for (size_t i = 0; h->own[level] && i < count; i++)
        own += h->own[level][i];
    return h->own[level] ? own : count;
}

static void tell(ascc_step_state *state)
{
    const ascc_hierarchy *h = &state->hierarchy;
    ascc_step_statistics *s = state->statistics;
    s->neighbor_count = state->run.neighbor_count;
    s->max_neighbors = state->run.longest;
    s->level_points[0] = h->set[ASCC_SET_ALL].count;
    for (int32_t l = 1; l < state->network->plan->level_count; l++)
        s->level_points[l] = points_of(h, l);
}

/* Rows of the last layer times their shares: impulses of pairs are linear in them. */
static void share_rows(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const ascc_network_run *run = data;
    const ascc_term *term = &run->plan->output.term;
    const ascc_value *value = &run->value[term->source];
    const size_t width = ascc_padded(term->inputs);
    float *rows = term->rectify ? value->rectified : value->raw;
    for (size_t i = begin; i < end; i++)
        for (size_t c = 0; c < width; c++)
            rows[i * width + c] =
                value->active[i] ? run->hierarchy->share[i] * rows[i * width + c] : 0.0f;
}

static void take_share(ascc_step_state *state)
{
    const int32_t source = state->network->plan->output.term.source;
    if (state->hierarchy.share && source >= 2)
        ascc_workers_run(state->tools.workers, state->hierarchy.set[ASCC_SET_FLUID].count, 4096,
                         share_rows, &state->run);
}

ascc_status ascc_engine_cpu(ascc_step_state *state)
{
    ascc_status status = ascc_stage_sight(state);
    ascc_stage_lap(state, "sight");
    if (status == ASCC_OK)
        status = ascc_network_demand(&state->run, state->network, &state->hierarchy, &state->tools,
                                     state->expected);
    ascc_stage_lap(state, "search");
    if (status == ASCC_OK)
        status = ascc_network_forward(&state->run, state->fluid_features, state->boundary_features);
    ascc_arena_return(state->tools.arena, state->before_features);
    ascc_stage_lap(state, "network");
    if (status == ASCC_OK)
        ascc_measure_trust(state);
    if (state->looks)
        return status;
    if (status == ASCC_OK) {
        take_share(state);
        const ascc_impulse_scale scale = impulse_scale(state);
        status = state->network->plan->output.term.operation->impulses(
            &state->run, &scale, &state->impulses, &state->statistics->pair_count);
    }
    ascc_arena_return(state->tools.arena, state->before_features);
    state->shares = state->hierarchy.share;
    state->hierarchy.share = NULL; /* of the output alone */
    if (status == ASCC_OK)
        ascc_network_done(&state->run);
    ascc_stage_lap(state, "pairs");
    if (status == ASCC_OK)
        tell(state);
    return status;
}
