/* Symplectic Euler in integer momenta. SPDX-License-Identifier: MIT */
#include "integrate.h"

#include <inttypes.h>
#include <math.h>

static ascc_status too_fast(const ascc_particles *p, size_t i, ascc_message *message)
{
    return ascc_fail(message, ASCC_ERROR_RANGE,
                     "fluid particle %" PRIu64 " (row %zu): momentum too large to hold", p->id[i],
                     i);
}

typedef struct integrate_job {
    const ascc_particles *p;
    const ascc_motion *motion;
    const int64_t *impulse;
    ascc_advance *advance;
    atomic_size_t bad; /* 1 + first row that fails */
} integrate_job;

static inline ascc_status begin_row(const integrate_job *job, size_t i, ascc_message *message)
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
            return too_fast(p, i, message);
        /* both within 2^61: the sum cannot overflow */
        const double before = (double)p->momentum[k] * p->quantum / p->mass[i];
        const double after = (double)(p->momentum[k] + whole) * p->quantum / p->mass[i];
        const double carried =
            mean ? (double)(p->momentum[k] + half) * p->quantum / p->mass[i] : after;
        advance->external[k] = mean ? half : whole;
        advance->velocity[k] = after;
        advance->position[k] = p->position[k];
        if (motion->advection != ASCC_ADVECT_NONE)
            advance->position[k] += dt * (mean ? 0.5 * (before + after) : carried);
    }
    return ASCC_OK;
}

static void begin_rows(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    integrate_job *job = data;
    ascc_message message;
    for (size_t i = begin; i < end; i++)
        if (begin_row(job, i, &message) != ASCC_OK) {
            ascc_note_first(&job->bad, i);
            return;
        }
}

ascc_status ascc_integrate_begin(ascc_workers *workers, const ascc_particles *p,
                                 const ascc_motion *motion, ascc_advance *advance,
                                 ascc_message *message)
{
    integrate_job job = {.p = p, .motion = motion, .advance = advance};
    ascc_workers_run(workers, p->fluid_count, 1024, begin_rows, &job);
    const size_t bad = atomic_load(&job.bad); /* says once more why */
    return bad ? begin_row(&job, bad - 1, message) : ASCC_OK;
}

static inline ascc_status end_row(const integrate_job *job, size_t i, ascc_message *message)
{
    const ascc_particles *p = job->p;
    const ascc_motion *motion = job->motion;
    ascc_advance *advance = job->advance;
    const size_t d = (size_t)p->dimension;
    const double dt = motion->time_step;
    double moved = 0.0;
    for (size_t c = 0; c < d; c++) {
        const size_t k = i * d + c;
        int64_t sum;
        if (__builtin_add_overflow(p->momentum[k] + advance->external[k], job->impulse[k], &sum) ||
            sum > ASCC_MOMENTUM_LIMIT || sum < -ASCC_MOMENTUM_LIMIT)
            return too_fast(p, i, message);
        const double step = dt * ((double)sum * p->quantum / p->mass[i]);
        advance->momentum[k] = sum;
        advance->position[k] = p->position[k] + step;
        moved += step * step;
        if (!(fabs(advance->position[k]) <= ASCC_POSITION_LIMIT * p->spacing))
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
    return ASCC_OK;
}

static void end_rows(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    integrate_job *job = data;
    ascc_message message;
    for (size_t i = begin; i < end; i++)
        if (end_row(job, i, &message) != ASCC_OK) {
            ascc_note_first(&job->bad, i);
            return;
        }
}

ascc_status ascc_integrate_end(ascc_workers *workers, const ascc_particles *p,
                               const ascc_motion *motion, const int64_t *impulse,
                               ascc_advance *advance, ascc_message *message)
{
    integrate_job job = {.p = p, .motion = motion, .impulse = impulse, .advance = advance};
    ascc_workers_run(workers, p->fluid_count, 1024, end_rows, &job);
    const size_t bad = atomic_load(&job.bad);
    return bad ? end_row(&job, bad - 1, message) : ASCC_OK;
}
