/* New momenta and positions from the impulses: symplectic Euler in integers (docs/method.md, section 1).
 * SPDX-License-Identifier: MIT */
#include <inttypes.h>
#include <math.h>

#include "stage.h"

typedef struct advance_job {
    const ascc_particles *p;
    const ascc_motion *motion;
    const int64_t *impulse;
    bool further;        /* from momenta that the step has reached, not from those before it */
    const uint8_t *idle; /* NULL = none */
    ascc_advance *advance;
    atomic_size_t bad; /* 1 + first row that fails */
} advance_job;

static ascc_status advance_row(const advance_job *job, size_t i, ascc_message *message)
{
    const ascc_particles *p = job->p;
    const ascc_motion *motion = job->motion;
    ascc_advance *advance = job->advance;
    const size_t d = (size_t)p->dimension;
    const double dt = motion->time_step;
    double moved = 0.0, position[3];
    int64_t sum[3];
    for (size_t c = 0; c < d; c++) {
        const size_t k = i * d + c;
        const int64_t from =
            job->further ? advance->momentum[k] : p->momentum[k] + advance->external[k];
        if (__builtin_add_overflow(from, job->impulse[k], &sum[c]) ||
            sum[c] > ASCC_MOMENTUM_LIMIT || sum[c] < -ASCC_MOMENTUM_LIMIT)
            return ascc_fail(message, ASCC_ERROR_RANGE,
                             "fluid particle %" PRIu64 " (row %zu): momentum too large to hold",
                             p->id[i], i);
        const double step = dt * ((double)sum[c] * p->quantum / p->mass[i]);
        position[c] = p->position[k] + step;
        moved += step * step;
        if (!(fabs(position[c]) <= ASCC_POSITION_LIMIT * p->spacing))
            return ascc_fail(message, ASCC_ERROR_RANGE,
                             "fluid particle %" PRIu64 " (row %zu): position out of range",
                             p->id[i], i);
    }
    if (motion->max_displacement > 0.0 &&
        moved > motion->max_displacement * motion->max_displacement)
        return ascc_fail(message, ASCC_ERROR_RANGE,
                         "fluid particle %" PRIu64
                         " (row %zu) would move %g, more than max_displacement = %g",
                         p->id[i], i, sqrt(moved), motion->max_displacement);
    for (size_t c = 0; c < d; c++) {
        advance->momentum[i * d + c] = sum[c];
        advance->position[i * d + c] = position[c];
    }
    return ASCC_OK;
}

/* Fluid that nothing moves: it keeps what it is given apart, for its support. */
static void stay(const advance_job *job, size_t i)
{
    const size_t d = (size_t)job->p->dimension;
    for (size_t k = i * d; k < (i + 1) * d; k++) {
        const uint64_t given =
            job->further ? (uint64_t)job->advance->momentum[k] + (uint64_t)job->impulse[k] : 0;
        job->advance->momentum[k] = (int64_t)given;
        job->advance->position[k] = job->p->position[k];
    }
}

static void advance_rows(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    advance_job *job = data;
    ascc_message message;
    for (size_t i = begin; i < end; i++)
        if (job->idle && job->idle[i]) {
            stay(job, i);
        } else if (advance_row(job, i, &message) != ASCC_OK) {
            ascc_note_first(&job->bad, i);
            return;
        }
}

static ascc_status advance_all(ascc_step_state *state, const int64_t *impulse, bool further)
{
    advance_job job = {.p = state->particles,
                       .motion = state->motion,
                       .impulse = impulse,
                       .further = further,
                       .idle = state->sleep.idle,
                       .advance = &state->advance};
    ascc_workers_run(state->tools.workers, job.p->fluid_count, 1024, advance_rows, &job);
    const size_t bad = atomic_load(&job.bad); /* says once more why */
    return bad ? advance_row(&job, bad - 1, state->tools.message) : ASCC_OK;
}

ascc_status ascc_advance_refresh(ascc_step_state *state)
{
    const size_t size = (size_t)state->particles->dimension * 8;
    const ascc_halo_refresh refresh = {
        ASCC_SET_FLUID,
        false,
        2,
        {{state->advance.position, size}, {state->advance.momentum, size}}};
    return ascc_halo_exchange(state->halo, &refresh, NULL);
}

ascc_status ascc_stage_advance(ascc_step_state *state)
{
    const ascc_status status = advance_all(state, state->impulses.fluid, false);
    return status == ASCC_OK ? ascc_advance_refresh(state) : status;
}

ascc_status ascc_advance_further(ascc_step_state *state, const int64_t *impulse)
{
    const ascc_status status = advance_all(state, impulse, true);
    return status == ASCC_OK ? ascc_advance_refresh(state) : status;
}
