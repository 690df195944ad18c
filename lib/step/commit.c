/* The new state becomes the particles' own: nothing here can fail, once the sums over the run have been
 * found to fit. SPDX-License-Identifier: MIT */
#include "commit.h"

#include <string.h>

#include "points/bodies.h"

/* Sums for the statistics: they wrap instead of failing. */
typedef struct totals_job {
    const int64_t *rows;
    size_t dimension;
    atomic_uint_least64_t sum[3];
} totals_job;

static void add_rows(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    totals_job *job = data;
    const size_t d = job->dimension;
    uint64_t sum[3] = {0, 0, 0};
    for (size_t i = begin; i < end; i++)
        for (size_t c = 0; c < d; c++)
            sum[c] += (uint64_t)job->rows[i * d + c];
    for (size_t c = 0; c < d; c++)
        atomic_fetch_add_explicit(&job->sum[c], sum[c], memory_order_relaxed);
}

void ascc_totals(ascc_workers *workers, int64_t total[3], const int64_t *rows, size_t count,
                 size_t dimension)
{
    totals_job job = {.rows = rows, .dimension = dimension};
    ascc_workers_run(workers, count, 8192, add_rows, &job);
    for (size_t c = 0; c < 3; c++)
        total[c] = (int64_t)atomic_load(&job.sum[c]);
}

static void add_totals(ascc_workers *workers, int64_t total[3], const int64_t *rows, size_t count,
                       size_t dimension)
{
    int64_t one[3];
    ascc_totals(workers, one, rows, count, dimension);
    for (size_t c = 0; c < 3; c++)
        total[c] = (int64_t)((uint64_t)total[c] + (uint64_t)one[c]);
}

/* Impulses of walls become those since the run began. */
static ascc_status sum_walls(ascc_step_state *state)
{
    const ascc_particles *p = state->particles;
    const size_t d = (size_t)p->dimension;
    int64_t *wall = state->impulses.wall;
    for (size_t k = 0; k < p->boundary_count * d; k++)
        if (__builtin_add_overflow(wall[k], p->wall_impulse[k], &wall[k]))
            return ascc_fail(state->tools.message, ASCC_ERROR_RANGE,
                             "boundary row %zu: its impulse over the run is too large to hold",
                             k / d);
    return ASCC_OK;
}

/* The velocity before the step is the first of the past. */
static void add_past(ascc_particles *p, size_t row)
{
    const size_t d = (size_t)p->dimension, n = (size_t)p->past_count;
    double *const past = p->past + row * n * d;
    memmove(past + d, past, (n - 1) * d * sizeof *past);
    for (size_t c = 0; c < d; c++)
        past[c] = ascc_velocity(p, row, (int32_t)c);
}

typedef struct commit_job {
    ascc_particles *particles;
    const ascc_advance *advance;
} commit_job;

static void commit_rows(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const commit_job *job = data;
    const size_t d = (size_t)job->particles->dimension, n = (end - begin) * d;
    for (size_t i = begin; job->particles->past_count && i < end; i++)
        add_past(job->particles, i);
    memcpy(job->particles->position + begin * d, job->advance->position + begin * d,
           n * sizeof(double));
    memcpy(job->particles->momentum + begin * d, job->advance->momentum + begin * d,
           n * sizeof(int64_t));
}

/* Angular impulses of bodies that move, while they are where the step began; `wall` is what rows received since the run
 * began, `before` what of it earlier steps gave, or NULL. */
static void add_torques(ascc_particles *p, const int64_t *wall, const int64_t *before, bool first)
{
    for (size_t b = 0; b < p->body_count; b++) {
        struct ascc_body *body = &p->bodies[b];
        if (first) {
            body->moved = ascc_body_moves(body);
            memset(body->torque, 0, sizeof body->torque);
        }
        if (body->moved)
            ascc_body_add_torque(p, body, wall, before);
    }
}

/* Frames go on, and with them what their points have but positions, which the step has found. */
static void move_bodies(ascc_particles *p, double seconds)
{
    for (size_t b = 0; b < p->body_count; b++) {
        struct ascc_body *body = &p->bodies[b];
        if (!ascc_body_moves(body))
            continue;
        (void)ascc_body_advance(p, body, seconds);
        ascc_body_place(p, body, p->wall_position, p->wall_normal, p->wall_velocity);
    }
}

static bool any_moves(const ascc_particles *p)
{
    bool moves = false;
    for (size_t b = 0; b < p->body_count; b++)
        moves |= p->bodies[b].moved || ascc_body_moves(&p->bodies[b]);
    return moves;
}

/* What walls receive from the fluid of all processes in this step, if somebody asks for it. */
static ascc_status sum_processes(ascc_step_state *state, int64_t **wall)
{
    const ascc_particles *p = state->particles;
    const size_t count = p->boundary_count * (size_t)p->dimension;
    *wall = NULL;
    if (!state->halo || !any_moves(p))
        return ASCC_OK;
    int64_t *sum = ascc_arena_lend(state->tools.arena, count, sizeof *sum);
    ascc_status status = sum ? ASCC_OK
                             : ascc_fail(state->tools.message, ASCC_ERROR_MEMORY,
                                         "no memory for the impulses of walls");
    if (sum)
        memcpy(sum, state->impulses.wall, count * sizeof *sum);
    status = state->halo->agree(state->halo, status);
    if (status == ASCC_OK)
        status = state->halo->sum(state->halo, (uint64_t *)sum, count);
    *wall = sum;
    return status;
}

/* All that can still fail, here or elsewhere. */
static ascc_status finish(ascc_step_state *state, bool first, int64_t **all_walls)
{
    ascc_status status = sum_processes(state, all_walls);
    if (status == ASCC_OK && !first)
        status = sum_walls(state);
    return state->halo ? state->halo->agree(state->halo, status) : status;
}

ascc_status ascc_stage_commit(ascc_step_state *state, ascc_particles *p, bool first)
{
    ascc_workers *workers = state->tools.workers;
    ascc_step_statistics *s = state->statistics;
    const size_t d = (size_t)p->dimension, walls = p->boundary_count;
    const size_t n = state->halo ? state->halo->own : p->fluid_count;
    int64_t *all_walls;
    if (first)
        ascc_totals(workers, s->momentum_before, p->momentum, n, d);
    add_totals(workers, s->external_impulse, state->advance.external, n, d);
    add_totals(workers, s->wall_impulse, state->impulses.wall, walls, d);
    ascc_totals(workers, s->momentum_after, state->advance.momentum, n, d);
    s->asleep = state->sleep.count;
    for (size_t c = 0; c < 3; c++)
        s->support_impulse[c] =
            (int64_t)((uint64_t)s->support_impulse[c] + (uint64_t)state->sleep.support[c]);
    const ascc_status status = finish(state, first, &all_walls);
    if (status != ASCC_OK)
        return status;
    commit_job job = {p, &state->advance};
    ascc_workers_run(workers, n, 8192, commit_rows, &job);
    if (state->sleep.rest)
        memcpy(p->rest, state->sleep.rest, n * sizeof *p->rest);
    add_torques(p, all_walls ? all_walls : state->impulses.wall,
                first || all_walls ? NULL : p->wall_impulse, first);
    if (state->advance.walls_move)
        memcpy(p->wall_position, state->advance.wall, walls * d * sizeof(double));
    move_bodies(p, state->motion->time_step);
    if (walls)
        memcpy(p->wall_impulse, state->impulses.wall, walls * d * sizeof(int64_t));
    return ASCC_OK;
}
