/* Where walls end, each point going on with its own velocity or with its body, and what they stand for there.
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "points/bodies.h"
#include "stage.h"

typedef struct motion_job {
    const ascc_particles *p;
    const ascc_motion *motion;
    double *to;        /* NULL: only look whether any moves */
    atomic_bool moves; /* one of them */
    atomic_uint_least64_t
        farthest;      /* the bits of the square of the longest way: they ascend with it */
    atomic_size_t bad; /* 1 + first row that fails */
} motion_job;

static void look_at_rows(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    motion_job *job = data;
    const size_t d = (size_t)job->p->dimension;
    bool moves = false;
    for (size_t k = begin * d; k < end * d && !moves; k++)
        moves = job->p->wall_velocity[k] != 0.0;
    if (moves)
        atomic_store_explicit(&job->moves, true, memory_order_relaxed);
}

static void note_way(motion_job *job, double square)
{
    uint64_t bits;
    memcpy(&bits, &square, sizeof bits);
    uint_least64_t seen = atomic_load_explicit(&job->farthest, memory_order_relaxed);
    while (seen < bits &&
           !atomic_compare_exchange_weak_explicit(&job->farthest, &seen, bits, memory_order_relaxed,
                                                  memory_order_relaxed))
        ;
}

static ascc_status move_row(motion_job *job, size_t i, ascc_message *message)
{
    const ascc_particles *p = job->p;
    const size_t d = (size_t)p->dimension;
    const double most = job->motion->max_displacement;
    double moved = 0.0;
    for (size_t c = 0; c < d; c++) {
        const size_t k = i * d + c;
        const double way = job->motion->time_step * p->wall_velocity[k];
        job->to[k] = p->wall_position[k] + way;
        moved += way * way;
        if (!(fabs(job->to[k]) <= ASCC_POSITION_LIMIT * p->spacing))
            return ascc_fail(message, ASCC_ERROR_RANGE,
                             "boundary row %zu: its velocity takes it out of range", i);
    }
    note_way(job, moved);
    if (most > 0.0 && moved > most * most)
        return ascc_fail(message, ASCC_ERROR_RANGE,
                         "boundary row %zu would move %g, more than max_displacement = %g", i,
                         sqrt(moved), most);
    return ASCC_OK;
}

static void move_rows(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    motion_job *job = data;
    ascc_message message;
    for (size_t i = begin; i < end; i++)
        if (move_row(job, i, &message) != ASCC_OK) {
            ascc_note_first(&job->bad, i);
            return;
        }
}

/* Points of bodies end where their frames do, so that what turns does not grow. to: NULL = only checks. */
static ascc_status place_bodies(const ascc_step_state *state, double *to)
{
    const ascc_particles *p = state->particles;
    for (size_t b = 0; b < p->body_count; b++) {
        struct ascc_body body = p->bodies[b];
        if (!ascc_body_moves(&body))
            continue;
        if (!ascc_body_advance(p, &body, state->motion->time_step))
            return ascc_fail(state->tools.message, ASCC_ERROR_RANGE,
                             "body %ld moves or turns beyond what can be held", (long)body.number);
        if (to != NULL)
            ascc_body_place(p, &body, to, NULL, NULL);
    }
    return ASCC_OK;
}

/* Velocities as the step had them; for a way back they are its own, since the set's go on. NULL without memory. */
static const double *own_velocity(const ascc_step_state *state)
{
    const ascc_particles *p = state->particles;
    const size_t numbers = p->boundary_count * (size_t)p->dimension;
    if (!state->network->keeps_values)
        return p->wall_velocity;
    double *own = ascc_arena_take(state->tools.arena, numbers, sizeof *own);
    if (own)
        memcpy(own, p->wall_velocity, numbers * sizeof *own);
    return own;
}

ascc_status ascc_stage_wall_motion(ascc_step_state *state)
{
    const ascc_particles *p = state->particles;
    const size_t count = p->boundary_count;
    motion_job job = {.p = p, .motion = state->motion};
    ascc_workers_run(state->tools.workers, count, 8192, look_at_rows, &job);
    state->advance.wall = p->wall_position;
    state->advance.walls_move = atomic_load(&job.moves);
    if (!state->advance.walls_move)
        return place_bodies(state, NULL);
    job.to = ascc_arena_take(state->tools.arena, count * (size_t)p->dimension, sizeof *job.to);
    if (!job.to)
        return ascc_fail(state->tools.message, ASCC_ERROR_MEMORY, "no memory for %zu walls", count);
    ascc_workers_run(state->tools.workers, count, 4096, move_rows, &job);
    state->advance.wall = job.to;
    state->advance.wall_velocity = own_velocity(state);
    if (!state->advance.wall_velocity)
        return ascc_fail(state->tools.message, ASCC_ERROR_MEMORY, "no memory for %zu walls", count);
    double farthest;
    const uint64_t bits = atomic_load(&job.farthest);
    memcpy(&farthest, &bits, sizeof farthest);
    state->advance.wall_way = sqrt(farthest);
    const size_t bad = atomic_load(&job.bad); /* says once more why */
    return bad ? move_row(&job, bad - 1, state->tools.message) : place_bodies(state, job.to);
}

/* A way back reads a step's volumes after later steps have found others: those of walls that move are its own. */
ascc_status ascc_find_wall_volumes(ascc_step_state *state, double support)
{
    const ascc_particles *p = state->particles;
    const size_t count = p->boundary_count;
    const ascc_status status =
        ascc_wall_volumes_update(state->walls, &state->tools, state->advance.wall, p->wall_normal,
                                 count, p->dimension, support);
    state->wall_volume = state->walls->volume;
    if (status != ASCC_OK || !state->advance.walls_move || !state->network->keeps_values)
        return status;
    float *own = ascc_arena_take(state->tools.arena, count, sizeof *own);
    if (!own)
        return ascc_fail(state->tools.message, ASCC_ERROR_MEMORY, "no memory for %zu walls", count);
    memcpy(own, state->walls->volume, count * sizeof *own);
    state->wall_volume = own;
    return ASCC_OK;
}
