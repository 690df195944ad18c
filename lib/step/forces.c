/* External forces, and where the network sees the fluid (docs/method.md, section 1).
 * SPDX-License-Identifier: MIT */
#include <inttypes.h>
#include <string.h>

#include "stage.h"

typedef struct forces_job {
    const ascc_particles *p;
    const ascc_motion *motion;
    ascc_advance *advance;
    atomic_size_t bad; /* 1 + first row that fails */
} forces_job;

static bool push_row(const forces_job *job, size_t i)
{
    const ascc_particles *p = job->p;
    const ascc_motion *motion = job->motion;
    ascc_advance *advance = job->advance;
    const size_t d = (size_t)p->dimension;
    const double dt = motion->time_step;
    const bool mean = motion->advection == ASCC_ADVECT_MEAN;
    for (size_t c = 0; c < d; c++) {
        const size_t k = i * d + c;
        const double a =
            motion->gravity[c] + (motion->acceleration ? motion->acceleration[k] : 0.0);
        const double given = p->mass[i] * (dt * a);
        int64_t whole, half;
        if (!ascc_to_quanta(given, p->quantum, &whole) ||
            !ascc_to_quanta(0.5 * given, p->quantum, &half))
            return false;
        /* both within 2^61: the sum cannot overflow */
        const double before = (double)p->momentum[k] * p->quantum / p->mass[i];
        const double after = (double)(p->momentum[k] + whole) * p->quantum / p->mass[i];
        advance->external[k] = mean ? half : whole;
        advance->velocity[k] = after;
        advance->seen[k] = p->position[k];
        if (motion->advection != ASCC_ADVECT_NONE)
            advance->seen[k] += dt * (mean ? 0.5 * (before + after) : after);
    }
    return true;
}

static void push_rows(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    forces_job *job = data;
    for (size_t i = begin; i < end; i++)
        if (!push_row(job, i)) {
            ascc_note_first(&job->bad, i);
            return;
        }
}

static bool take_advance(ascc_step_state *state)
{
    const ascc_particles *p = state->particles;
    ascc_advance *advance = &state->advance;
    ascc_arena *arena = state->tools.arena;
    const size_t d = (size_t)p->dimension, n = p->fluid_count * d, w = p->boundary_count * d;
    advance->seen = advance->position = ascc_arena_take(arena, n, sizeof(double));
    advance->velocity = ascc_arena_take(arena, n, sizeof(double));
    advance->momentum = ascc_arena_take(arena, n, sizeof(int64_t));
    advance->external = ascc_arena_take(arena, n, sizeof(int64_t));
    state->impulses.fluid = ascc_arena_take(arena, n, sizeof(int64_t));
    state->impulses.wall = ascc_arena_take(arena, w, sizeof(int64_t));
    if (!advance->seen || !advance->velocity || !advance->momentum || !advance->external ||
        !state->impulses.fluid || !state->impulses.wall)
        return false;
    memset(state->impulses.fluid, 0, n * sizeof(int64_t));
    memset(state->impulses.wall, 0, w * sizeof(int64_t));
    return true;
}

ascc_status ascc_stage_forces(ascc_step_state *state)
{
    const ascc_particles *p = state->particles;
    if (!take_advance(state))
        return ascc_fail(state->tools.message, ASCC_ERROR_MEMORY, "no memory for %zu particles",
                         p->fluid_count);
    forces_job job = {.p = p, .motion = state->motion, .advance = &state->advance};
    ascc_workers_run(state->tools.workers, p->fluid_count, 1024, push_rows, &job);
    const size_t bad = atomic_load(&job.bad);
    if (!bad)
        return ASCC_OK;
    return ascc_fail(state->tools.message, ASCC_ERROR_RANGE,
                     "fluid particle %" PRIu64 " (row %zu): momentum too large to hold",
                     p->id[bad - 1], bad - 1);
}
