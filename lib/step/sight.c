/* What the network sees: features of all particles, and the point sets of the scene.
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "stage.h"

/* vector: m/s of fluid, a normal of boundary, in units of `factor`; motion: the factor that makes of it
 * spacings a time step; past: earlier velocities; gravity: in spacings a squared time step; area: of boundary. */
static void features_of(const ascc_plan *plan, const int32_t *feature, int32_t feature_count,
                        const double *vector, const double *past, double factor, double motion,
                        const double *gravity, double area, float *to)
{
    for (int32_t f = 0; f < feature_count; f++) {
        const double scale = feature[f] == ASCC_FEATURE_MOTION ? motion : factor;
        if (feature[f] == ASCC_FEATURE_ONE)
            *to++ = 1.0f;
        else if (feature[f] == ASCC_FEATURE_AREA)
            *to++ = (float)area;
        else if (feature[f] == ASCC_FEATURE_HISTORY)
            for (int32_t c = 0; c < plan->history * plan->dimension; c++)
                *to++ = (float)(past[c] * motion);
        else if (feature[f] == ASCC_FEATURE_GRAVITY)
            for (int32_t c = 0; c < plan->dimension; c++)
                *to++ = (float)gravity[c];
        else
            for (int32_t c = 0; c < plan->dimension; c++)
                *to++ = (float)(vector[c] * scale);
    }
}

/* The area of a plane (the length of a line) that the spline weighs in all, in spacings; 0 = areas are not wanted.
 * A point has its share of it: the sum of these is the same however dense points are. */
static double whole_area(const ascc_plan *plan)
{
    static const double pi = 3.14159265358979323846;
    const double support = ascc_plan_wall_support(plan) / plan->spacing;
    if (ascc_plan_feature(plan, 1, ASCC_FEATURE_AREA) < 0)
        return 0.0;
    return plan->dimension == 2 ? 0.75 * support : 7.0 * pi / 40.0 * support * support;
}

/* What makes spacings a time step of the host's velocities. */
static double motion_factor(const ascc_step_state *state)
{
    const ascc_plan *plan = state->network->plan;
    return state->length_unit / state->time_unit * plan->time_step / plan->spacing;
}

/* Features of particles in the host's order, of walls that are near; vectors in metres. */
static bool lend_features(ascc_step_state *state, const uint8_t *near)
{
    const ascc_plan *plan = state->network->plan;
    const ascc_particles *p = state->particles;
    ascc_arena *arena = state->tools.arena;
    const size_t d = (size_t)p->dimension;
    const size_t fluid = (size_t)plan->fluid_channels, wall = (size_t)plan->boundary_channels;
    state->fluid_features = ascc_arena_lend(arena, p->fluid_count, fluid * sizeof(float));
    state->boundary_features = ascc_arena_lend(arena, p->boundary_count, wall * sizeof(float));
    if (!state->fluid_features || !state->boundary_features)
        return false;
    const double unit = state->length_unit / state->time_unit, motion = motion_factor(state);
    const double whole = whole_area(plan);
    double gravity[3] = {0.0, 0.0, 0.0};
    for (size_t c = 0; c < d; c++)
        gravity[c] = state->motion->gravity[c] * plan->time_step * motion / state->time_unit;
    for (size_t n = 0; n < ascc_sight_count(state); n++) {
        const size_t i = ascc_sight_row(state, n);
        features_of(plan, plan->fluid_features, plan->fluid_feature_count,
                    state->advance.velocity + i * d, p->past + i * (size_t)p->past_count * d, unit,
                    motion, gravity, 0.0, state->fluid_features + i * fluid);
    }
    for (size_t i = 0; i < p->boundary_count; i++) {
        if (near && !near[i])
            continue;
        const double area = whole > 0.0 ? whole * (double)state->wall_volume[i] : 1.0;
        features_of(plan, plan->boundary_features, plan->boundary_feature_count,
                    p->wall_normal + i * d, NULL, area, 0.0, gravity, area,
                    state->boundary_features + i * wall);
    }
    return true;
}

/* What the walls stand for, if the network wants to know. */
static ascc_status find_areas(ascc_step_state *state)
{
    const ascc_plan *plan = state->network->plan;
    if (ascc_plan_feature(plan, 1, ASCC_FEATURE_AREA) < 0)
        return ASCC_OK;
    return ascc_find_wall_volumes(state, ascc_plan_wall_support(plan) / state->length_unit);
}

typedef struct scale_job {
    const double *from;
    double *to, unit;
} scale_job;

static void scale_part(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const scale_job *job = data;
    for (size_t i = begin; i < end; i++)
        job->to[i] = job->from[i] * job->unit;
}

/* Positions in metres. */
static double *scaled(const ascc_search_tools *tools, const double *position, size_t count,
                      double unit)
{
    scale_job job = {position, ascc_arena_lend(tools->arena, count, sizeof(double)), unit};
    if (job.to)
        ascc_workers_run(tools->workers, count, 16384, scale_part, &job);
    return job.to;
}

/* What of rows the output takes, in the order of the set. */
static ascc_status take_shares(ascc_step_state *state)
{
    ascc_hierarchy *h = &state->hierarchy;
    const size_t count = h->set[ASCC_SET_FLUID].count;
    h->joins = state->joins;
    if (!state->share)
        return ASCC_OK;
    float *share = ascc_arena_take(state->tools.arena, count, sizeof *share);
    if (!share)
        return ascc_fail(state->tools.message, ASCC_ERROR_MEMORY, "no memory for %zu rows", count);
    for (size_t i = 0; i < count; i++)
        share[i] = state->share[ascc_hierarchy_host_row(h, ASCC_SET_FLUID, i)];
    h->share = share;
    return ASCC_OK;
}

/* Rows that sleep among others that do, in the order of the set. */
static ascc_status take_idle(ascc_step_state *state)
{
    ascc_hierarchy *h = &state->hierarchy;
    const size_t count = h->set[ASCC_SET_FLUID].count;
    if (!state->sleep.idle)
        return ASCC_OK;
    uint8_t *idle = ascc_arena_take(state->tools.arena, count, 1);
    if (!idle)
        return ascc_fail(state->tools.message, ASCC_ERROR_MEMORY, "no memory for %zu rows", count);
    for (size_t i = 0; i < count; i++)
        idle[i] = state->sleep.idle[ascc_hierarchy_host_row(h, ASCC_SET_FLUID, i)];
    h->idle = idle;
    return ASCC_OK;
}

/* Values of an earlier step come in where they still hold; rows that nobody looks at are given nothing later on, in
 * the memory of the velocities. */
static ascc_status keep_values(ascc_step_state *state)
{
    ascc_kept *kept = state->sight.kept;
    const size_t d = (size_t)state->particles->dimension;
    size_t row = 0;
    for (size_t n = 0; state->sight.row && n <= state->sight.row_count; n++) {
        const size_t next =
            n < state->sight.row_count ? state->sight.row[n] : state->particles->fluid_count;
        memset(state->advance.velocity + row * d, 0, (next - row) * d * sizeof(double));
        row = next + 1;
    }
    if (!kept)
        return ASCC_OK;
    if (!ascc_kept_begin(kept, &state->hierarchy, state->tools.arena))
        return ascc_fail(state->tools.message, ASCC_ERROR_MEMORY, "no memory to keep values");
    state->hierarchy.kept = kept;
    return ASCC_OK;
}

ascc_status ascc_stage_sight(ascc_step_state *state)
{
    const ascc_search_tools *tools = &state->tools;
    const ascc_particles *p = state->particles;
    const size_t d = (size_t)p->dimension;
    ascc_scene scene = {.fluid_count = p->fluid_count,
                        .boundary_count = p->boundary_count,
                        .velocity = state->advance.velocity,
                        .mass = p->mass,
                        .normal = p->wall_normal,
                        .wall_velocity = state->advance.walls_move ? p->wall_velocity : NULL,
                        .motion = motion_factor(state),
                        .fluid_before = p->position,
                        .boundary_before = p->wall_position,
                        .unit = state->length_unit,
                        .halo = state->halo,
                        .id = state->halo ? p->id : NULL};
    ascc_status status = find_areas(state);
    if (status == ASCC_OK)
        status = ascc_find_present(state);
    if (status != ASCC_OK)
        return status;
    scene.row = state->sight.row;
    scene.row_count = state->sight.row_count;
    scene.far = state->sight.far;
    state->before_features = ascc_arena_mark_of(tools->arena);
    uint8_t *near = NULL;
    const bool room = ascc_near_walls(state, &near) && lend_features(state, near);
    scene.near = near;
    const ascc_arena_mark before_scene = ascc_arena_mark_of(tools->arena);
    scene.fluid = scaled(tools, state->advance.seen, p->fluid_count * d, state->length_unit);
    scene.boundary =
        scaled(tools, ascc_walls_seen(state), p->boundary_count * d, state->length_unit);
    if (!room || !scene.fluid || !scene.boundary)
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for the features");
    status = ascc_hierarchy_build(&state->hierarchy, tools, state->network->plan, &scene);
    ascc_arena_return(tools->arena, before_scene);
    if (status == ASCC_OK)
        status = take_shares(state);
    if (status == ASCC_OK)
        status = keep_values(state);
    return status == ASCC_OK ? take_idle(state) : status;
}
