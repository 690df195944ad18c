/* The fast particles that nobody meets: what falls out of a scene does not cut everybody's steps.
 * SPDX-License-Identifier: MIT
 *
 * A particle farther from all others and from walls than influence reaches in a step, plus what both may go in it,
 * has no part in what a network computes for them, whatever way it goes. Only a few are looked at: spray that
 * falls away together is fluid. */
#include "lone.h"

#include <math.h>
#include <stdatomic.h>
#include <string.h>

#define MOST 64 /* bits of a word */
#define WORDS 4 /* of a fast particle: its place, and its speed */

typedef struct lone_job {
    const ascc_particles *p;
    double reach;             /* squared */
    double fast[MOST][WORDS]; /* the fast ones, of all processes */
    size_t row[MOST];         /* of these the rows that are here; SIZE_MAX = elsewhere */
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
    const bool fluid = job->place == job->p->position;
    uint64_t near = 0;
    for (size_t n = 0; n < job->count; n++) {
        double square = 0.0;
        for (size_t c = 0; c < d; c++)
            square += (x[c] - job->fast[n][c]) * (x[c] - job->fast[n][c]);
        if (square <= job->reach && !(fluid && job->row[n] == i))
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

/* The fast ones of this process, one more than a few at most; the greatest speed of the others. */
static double find_fast(lone_job *job, double slow)
{
    const ascc_particles *p = job->p;
    const size_t d = (size_t)p->dimension;
    double speed = 0.0;
    for (size_t i = 0; i < p->fluid_count && job->count <= MOST; i++) {
        const double own = speed_of(p, i);
        if (own <= slow) {
            speed = fmax(speed, own);
        } else if (job->count++ < MOST) {
            double *fast = job->fast[job->count - 1];
            memcpy(fast, p->position + i * d, d * sizeof *fast);
            fast[WORDS - 1] = own;
            job->row[job->count - 1] = i;
        }
    }
    return speed;
}

/* And those of all others. */
static ascc_status join_fast(lone_job *job, ascc_halo *halo)
{
    const size_t own = job->count;
    size_t row[MOST], first, count = WORDS * own;
    const ascc_status status =
        halo->join(halo, (uint64_t *)(void *)job->fast, (size_t)WORDS * MOST, &count, &first);
    job->count = count / WORDS;
    if (status != ASCC_OK || job->count > MOST)
        return status;
    memcpy(row, job->row, own * sizeof *row);
    for (size_t n = 0; n < job->count; n++)
        job->row[n] = SIZE_MAX;
    memcpy(job->row + first / WORDS, row, own * sizeof *row);
    return status;
}

ascc_status ascc_speed_in_company(ascc_context *context, const ascc_particles *p, ascc_halo *halo,
                                  double slow, double reach, double *speed)
{
    lone_job job = {.p = p, .reach = reach * reach, .place = p->position};
    double found = find_fast(&job, slow);
    ascc_status status = halo ? join_fast(&job, halo) : ASCC_OK;
    if (status != ASCC_OK || job.count > MOST)
        return status;
    ascc_workers_run(context->workers, p->fluid_count, 8192, look_around, &job);
    job.place = p->wall_position;
    ascc_workers_run(context->workers, p->boundary_count, 8192, look_around, &job);
    const uint64_t near = atomic_load_explicit(&job.near, memory_order_relaxed);
    for (size_t n = 0; n < job.count; n++)
        if (near >> n & 1)
            found = fmax(found, job.fast[n][WORDS - 1]);
    if (halo)
        status = ascc_halo_largest(halo, &found, 1);
    if (status == ASCC_OK)
        *speed = found;
    return status;
}
