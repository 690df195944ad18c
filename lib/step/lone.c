/* The fast particles that nobody meets: what falls out of a scene does not cut everybody's steps.
 * SPDX-License-Identifier: MIT
 *
 * A particle farther from all others and from walls than influence reaches in a step, plus what both may go in it,
 * has no part in what a network computes for them, whatever way it goes. Only a few are looked at: spray that
 * falls away together is fluid. */
#include "lone.h"

#include <math.h>
#include <stdatomic.h>

#define MOST 64 /* bits of a word */

typedef struct lone_job {
    const ascc_particles *p;
    double reach;     /* squared */
    size_t row[MOST]; /* of the fast ones */
    size_t count;
    const double *place; /* of those that they may meet: fluid, then walls */
    atomic_uint_least64_t
        near; /* of which these have company; the order of threads doesn't matter */
} lone_job;

static double speed_of(const ascc_particles *p, size_t i)
{
    double square = 0.0;
    for (int32_t c = 0; c < p->dimension; c++) {
        const double v = ascc_velocity(p, i, c);
        square += v * v;
    }
    return sqrt(square);
}

/* Fast ones near to row i of the places; nobody keeps itself company. */
static uint64_t near_to(const lone_job *job, size_t i)
{
    const size_t d = (size_t)job->p->dimension;
    const double *x = job->place + i * d;
    uint64_t near = 0;
    for (size_t n = 0; n < job->count; n++) {
        const double *other = job->p->position + job->row[n] * d;
        double square = 0.0;
        for (size_t c = 0; c < d; c++)
            square += (x[c] - other[c]) * (x[c] - other[c]);
        if (square <= job->reach && x != other)
            near |= (uint64_t)1 << n;
    }
    return near;
}

static void look_around(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    lone_job *job = data;
    uint64_t near = 0;
    for (size_t i = begin; i < end; i++)
        near |= near_to(job, i);
    (void)atomic_fetch_or_explicit(&job->near, near, memory_order_relaxed);
}

double ascc_speed_in_company(ascc_context *context, const ascc_particles *p, double fastest,
                             double slow, double reach)
{
    lone_job job = {.p = p, .reach = reach * reach};
    double speed = 0.0;
    for (size_t i = 0; i < p->fluid_count; i++) {
        const double own = speed_of(p, i);
        if (own <= slow)
            speed = fmax(speed, own);
        else if (job.count == MOST)
            return fastest;
        else
            job.row[job.count++] = i;
    }
    job.place = p->position;
    ascc_workers_run(context->workers, p->fluid_count, 8192, look_around, &job);
    job.place = p->wall_position;
    ascc_workers_run(context->workers, p->boundary_count, 8192, look_around, &job);
    const uint64_t near = atomic_load_explicit(&job.near, memory_order_relaxed);
    for (size_t n = 0; n < job.count; n++)
        if (near >> n & 1)
            speed = fmax(speed, speed_of(p, job.row[n]));
    return speed;
}
