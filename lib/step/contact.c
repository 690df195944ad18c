/* Walls that nothing passes: motion through a wall ends at a distance from it, momentum goes to the wall.
 * SPDX-License-Identifier: MIT
 *
 * Each wall particle w with normal n stands for a disc. What moves from x0 to x1 meets it where it comes
 * closer to the disc's plane than the contact distance c, no farther from the axis than its radius:
 *
 *         x0 .                    the rest of the way goes on along the wall,
 *             \      n            from p to x1 + (c - (x1 - w).n) n,
 *      c ......p..+..^......      where it may meet the next one
 *               \    |
 *      ----------\---w------
 */
#include "stage.h"

#include <inttypes.h>
#include <math.h>

/* Walls that one particle may meet in a step, one after the other: three make a corner. */
#define MEETINGS 4
/* Of a disc, in spacings: discs on a square lattice one spacing apart leave no gap. */
#define DISC 0.71
/* A particle this much closer than the contact distance, in spacings, is still held there. */
#define SLACK 0.25
/* Depths below this, in spacings, are rounding. */
#define NOTHING 1e-9

typedef struct contact_job {
    const ascc_network_run *run;
    const ascc_rows *rows; /* walls around the fluid */
    const ascc_particles *p;
    double time_step, distance, disc_square, slack, nothing;
    ascc_advance *advance;
    int64_t *wall;
    atomic_size_t bad; /* 1 + first set row that fails */
} contact_job;

typedef struct meeting {
    double when;   /* share of the way, > 1 = none */
    double push;   /* along the wall's normal, at the end of the way */
    uint32_t wall; /* in the step's own order, which the host's rows do not decide */
} meeting;

/* Where the way from `from` to `to` meets this wall; meeting.when > 1 if it does not. */
static meeting meet(const contact_job *job, uint32_t wall, const double *from, const double *to)
{
    const size_t d = (size_t)job->p->dimension,
                 row = ascc_hierarchy_wall_row(job->run->hierarchy, wall);
    const double *w = job->p->wall_position + row * d, *n = job->p->wall_normal + row * d;
    meeting m = {.when = 2.0, .wall = wall};
    double begin = 0.0, end = 0.0, square = 0.0, along = 0.0;
    for (size_t c = 0; c < d; c++) {
        begin += (from[c] - w[c]) * n[c];
        end += (to[c] - w[c]) * n[c];
    }
    if (!(end < job->distance - job->nothing && end < begin - job->nothing &&
          begin > job->distance - job->slack))
        return m;
    const double when = begin > job->distance ? (begin - job->distance) / (begin - end) : 0.0;
    for (size_t c = 0; c < d; c++) {
        const double at = from[c] + when * (to[c] - from[c]) - w[c];
        square += at * at;
        along += at * n[c];
    }
    if (square - along * along > job->disc_square)
        return m;
    m.when = when;
    m.push = (begin < job->distance ? begin : job->distance) - end;
    return m;
}

/* The first wall on the way; of walls met at once the one that pushes most, then the one that comes first. */
static meeting first_meeting(const contact_job *job, size_t i, const double *from, const double *to)
{
    const uint32_t *neighbor = job->rows->neighbor + job->rows->start[i];
    meeting first = {.when = 2.0};
    for (size_t k = 0; k < job->rows->count[i]; k++) {
        const meeting m = meet(job, neighbor[k], from, to);
        if (m.when < first.when ||
            (m.when <= 1.0 && m.when == first.when &&
             (m.push > first.push || (m.push == first.push && m.wall < first.wall))))
            first = m;
    }
    return first;
}

/* Momentum that takes the particle from its place to `to` in a step; the wall has the rest. */
static bool end_at(contact_job *job, size_t row, size_t wall, const double *to)
{
    const ascc_particles *p = job->p;
    const size_t d = (size_t)p->dimension;
    for (size_t c = 0; c < d; c++) {
        const size_t k = row * d + c;
        const double velocity = (to[c] - p->position[k]) / job->time_step;
        int64_t momentum;
        if (!ascc_to_quanta(p->mass[row] * velocity, p->quantum, &momentum) ||
            momentum > ASCC_MOMENTUM_LIMIT || momentum < -ASCC_MOMENTUM_LIMIT)
            return false;
        const int64_t before = __atomic_fetch_add(
            &job->wall[wall * d + c], job->advance->momentum[k] - momentum, __ATOMIC_RELAXED);
        if (before >= ASCC_WALL_LIMIT || before <= -ASCC_WALL_LIMIT)
            return false;
        job->advance->momentum[k] = momentum;
        job->advance->position[k] =
            p->position[k] + job->time_step * ((double)momentum * p->quantum / p->mass[row]);
    }
    return true;
}

static bool hold_row(contact_job *job, size_t i)
{
    const size_t d = (size_t)job->p->dimension;
    const ascc_hierarchy *h = job->run->hierarchy;
    const size_t row = ascc_hierarchy_host_row(h, ASCC_SET_FLUID, i);
    double from[3], to[3];
    for (size_t c = 0; c < d; c++) {
        from[c] = job->p->position[row * d + c];
        to[c] = job->advance->position[row * d + c];
    }
    for (int n = 0; n < MEETINGS; n++) {
        const meeting m = first_meeting(job, i, from, to);
        if (m.when > 1.0)
            break;
        const size_t wall = ascc_hierarchy_wall_row(job->run->hierarchy, m.wall);
        const double *normal = job->p->wall_normal + wall * d;
        for (size_t c = 0; c < d; c++) {
            from[c] += m.when * (to[c] - from[c]);
            to[c] = n + 1 < MEETINGS ? to[c] + m.push * normal[c] : from[c];
        }
        if (!end_at(job, row, wall, to))
            return false;
    }
    return true;
}

static void hold_rows(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    contact_job *job = data;
    for (size_t i = begin; i < end; i++)
        if (!ascc_hierarchy_is_idle(job->run->hierarchy, i) && job->rows->count[i] &&
            !hold_row(job, i)) {
            ascc_note_first(&job->bad, i);
            return;
        }
}

/* The list of whoever asks for contact: the output, or the relaxation. */
static const ascc_rows *walls_around(const ascc_network_run *run)
{
    return run->plan->output.contact > 0.0 ? ascc_term_list(run, &run->plan->output.term, 1)
                                           : &run->rows[run->network->relaxation_key[1]];
}

ascc_status ascc_stage_contact(ascc_step_state *state)
{
    const ascc_plan *plan = state->network->plan;
    const ascc_particles *p = state->particles;
    const double distance = fmax(plan->output.contact, plan->relaxation.contact);
    if (!(distance > 0.0) || p->fluid_count == 0)
        return ASCC_OK;
    const double spacing = plan->spacing / state->length_unit;
    contact_job job = {.run = &state->run,
                       .rows = walls_around(&state->run),
                       .p = p,
                       .time_step = state->motion->time_step,
                       .distance = distance / state->length_unit,
                       .disc_square = DISC * DISC * spacing * spacing,
                       .slack = SLACK * spacing,
                       .nothing = NOTHING * spacing,
                       .advance = &state->advance,
                       .wall = state->impulses.wall};
    ascc_workers_run(state->tools.workers, state->hierarchy.set[ASCC_SET_FLUID].count, 256,
                     hold_rows, &job);
    const size_t bad = atomic_load(&job.bad);
    if (bad)
        return ascc_fail(state->tools.message, ASCC_ERROR_RANGE,
                         "fluid row %zu: a wall gives it a momentum too large to hold",
                         ascc_hierarchy_host_row(&state->hierarchy, ASCC_SET_FLUID, bad - 1));
    return ASCC_OK;
}
