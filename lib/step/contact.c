/* Walls that nothing passes: motion through a wall ends at a distance from it, momentum goes to the wall
 * (contact.h). SPDX-License-Identifier: MIT */
#include "contact.h"

#include <math.h>
#include <string.h>

#include "network/sheets.h"

/* Of a disc, in spacings: discs on a square lattice one spacing apart leave no gap. */
#define DISC 0.71
/* A particle this much closer than the contact distance, in spacings, is still held there. */
#define SLACK 0.25
/* Depths below this, in spacings, are rounding. */
#define NOTHING 1e-9

/* ---- One way and one wall ---- */

/* Where a wall is when so much of the step has passed: `at`, or the set's own numbers while walls rest. */
static const double *wall_at(const ascc_contact *job, size_t row, double when, double at[3])
{
    const ascc_step_state *state = job->state;
    const size_t d = (size_t)state->particles->dimension;
    const double *begin = state->particles->wall_position + row * d;
    const double *end = state->advance.wall + row * d;
    for (size_t c = 0; begin != end && c < d; c++)
        at[c] = begin[c] + when * (end[c] - begin[c]);
    return begin != end ? at : begin;
}

/* The first that is met, in an order that is not the host's. */
static bool comes_first(const ascc_meeting *a, const ascc_meeting *b)
{
    if (a->share != b->share)
        return a->share < b->share;
    return a->push > b->push || (a->push == b->push && a->wall < b->wall);
}

void ascc_contact_try(const ascc_contact *job, const ascc_way *way, uint32_t wall,
                      ascc_meeting *first)
{
    const ascc_step_state *state = job->state;
    const ascc_particles *p = state->particles;
    const size_t d = (size_t)p->dimension, row = ascc_hierarchy_wall_row(&state->hierarchy, wall);
    const double *n = p->wall_normal + row * d, *w1 = state->advance.wall + row * d;
    double place[3], begin = 0.0, end = 0.0, square = 0.0, along = 0.0;
    for (size_t c = 0; c < d; c++)
        end += (way->to[c] - w1[c]) * n[c];
    if (!(end < job->distance - job->nothing)) /* most */
        return;
    const double *w0 = wall_at(job, row, way->when, place);
    for (size_t c = 0; c < d; c++)
        begin += (way->from[c] - w0[c]) * n[c];
    const bool sheet = state->hierarchy.sheets && state->hierarchy.sheets->is_sheet[wall];
    if (!(end < begin - job->nothing &&
          (sheet ? begin >= 0.0 : begin > job->distance - job->slack)))
        return;
    ascc_meeting m = {.wall = wall};
    m.share = begin > job->distance ? (begin - job->distance) / (begin - end) : 0.0;
    m.push = (begin < job->distance ? begin : job->distance) - end;
    for (size_t c = 0; c < d; c++) {
        const double at = way->from[c] + m.share * (way->to[c] - way->from[c]) -
                          (w0[c] + m.share * (w1[c] - w0[c]));
        square += at * at;
        along += at * n[c];
        m.normal[c] = n[c];
    }
    if (square - along * along <= job->disc * job->disc && comes_first(&m, first))
        *first = m;
}

/* Momentum that takes the particle from its place to the end of its way in a step; the wall has the rest. */
static bool end_at(const ascc_contact *job, size_t row, size_t wall, const double *to)
{
    ascc_step_state *state = job->state;
    const ascc_particles *p = state->particles;
    const size_t d = (size_t)p->dimension;
    const double dt = state->motion->time_step;
    for (size_t c = 0; c < d; c++) {
        const size_t k = row * d + c;
        const double velocity = (to[c] - p->position[k]) / dt;
        int64_t momentum;
        if (!ascc_to_quanta(p->mass[row] * velocity, p->quantum, &momentum) ||
            momentum > ASCC_MOMENTUM_LIMIT || momentum < -ASCC_MOMENTUM_LIMIT)
            return false;
        const int64_t before =
            __atomic_fetch_add(&state->impulses.wall[wall * d + c],
                               state->advance.momentum[k] - momentum, __ATOMIC_RELAXED);
        if (before >= ASCC_WALL_LIMIT || before <= -ASCC_WALL_LIMIT)
            return false;
        state->advance.momentum[k] = momentum;
        state->advance.position[k] =
            p->position[k] + dt * ((double)momentum * p->quantum / p->mass[row]);
    }
    return true;
}

bool ascc_contact_bend(const ascc_contact *job, size_t row, const ascc_meeting *m, ascc_way *way)
{
    const ascc_step_state *state = job->state;
    const size_t d = (size_t)state->particles->dimension;
    const size_t wall = ascc_hierarchy_wall_row(&state->hierarchy, m->wall);
    const bool last = ++way->meetings == ASCC_MEETINGS;
    double place[3];
    way->when += m->share * (1.0 - way->when);
    const double *now = wall_at(job, wall, way->when, place);
    for (size_t c = 0; c < d; c++) {
        way->from[c] += m->share * (way->to[c] - way->from[c]);
        way->to[c] = last ? way->from[c] + (state->advance.wall[wall * d + c] - now[c])
                          : way->to[c] + m->push * m->normal[c];
    }
    return end_at(job, row, wall, way->to);
}

/* ---- All ways, with the walls of the lists ---- */

typedef struct near_job {
    ascc_contact *contact;
    ascc_way *way;    /* [set rows] of those that are left */
    uint8_t *is_left; /* [set rows] 1 = the lists may lack walls of what is left of the way */
} near_job;

/* Do the lists have all walls that this way may meet? */
static bool is_covered(const ascc_contact *job, size_t i, const ascc_way *way)
{
    const ascc_hierarchy *h = &job->state->hierarchy;
    const size_t d = (size_t)job->state->particles->dimension;
    double from = 0.0, to = 0.0;
    for (size_t c = 0; c < d; c++) {
        const double seen = (double)h->set[ASCC_SET_FLUID].position[c][i] * job->seen_unit;
        from += (way->from[c] - seen) * (way->from[c] - seen);
        to += (way->to[c] - seen) * (way->to[c] - seen);
    }
    const double most = job->reach - job->near;
    return most >= 0.0 && from <= most * most && to <= most * most;
}

/* Follows a row's way to its end, or to where the lists no longer tell; false where that cannot be held. */
static bool follow(near_job *job, size_t i)
{
    ascc_contact *contact = job->contact;
    const ascc_step_state *state = contact->state;
    const ascc_particles *p = state->particles;
    const size_t d = (size_t)p->dimension;
    const size_t row = ascc_hierarchy_host_row(&state->hierarchy, ASCC_SET_FLUID, i);
    const uint32_t *neighbor = contact->rows->neighbor + contact->rows->start[i];
    ascc_way way = {.meetings = 0};
    for (size_t c = 0; c < d; c++) {
        way.from[c] = p->position[row * d + c];
        way.to[c] = state->advance.position[row * d + c];
    }
    while (way.meetings < ASCC_MEETINGS) {
        if (!is_covered(contact, i, &way)) {
            job->is_left[i] = 1;
            job->way[i] = way;
            return true;
        }
        ascc_meeting first = ascc_no_meeting();
        for (size_t k = 0; k < contact->rows->count[i]; k++)
            ascc_contact_try(contact, &way, neighbor[k], &first);
        if (first.share > 1.0)
            return true;
        if (!ascc_contact_bend(contact, row, &first, &way))
            return false;
    }
    return true;
}

static void follow_rows(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    near_job *job = data;
    for (size_t i = begin; i < end; i++)
        if (!ascc_hierarchy_is_idle(&job->contact->state->hierarchy, i) && !follow(job, i)) {
            ascc_note_first(&job->contact->bad, i);
            return;
        }
}

/* The list of whoever asks for contact: the output, or the relaxation. */
static const ascc_rows *walls_around(const ascc_network_run *run)
{
    return run->plan->output.contact > 0.0 ? ascc_term_list(run, &run->plan->output.term, 1)
                                           : &run->rows[run->network->relaxation_key[1]];
}

static ascc_contact open_contact(ascc_step_state *state, double distance)
{
    const double spacing = state->network->plan->spacing / state->length_unit;
    const ascc_rows *rows = walls_around(&state->run);
    ascc_contact contact = {.state = state,
                            .rows = rows,
                            .distance = distance / state->length_unit,
                            .seen_unit = state->hierarchy.scale.unit / state->length_unit,
                            .disc = DISC * spacing,
                            .slack = SLACK * spacing,
                            .nothing = NOTHING * spacing};
    contact.near = hypot(contact.distance, contact.disc) + state->advance.wall_way;
    contact.reach =
        rows->limit ? 0.0 : rows->radius * state->hierarchy.scale.unit / state->length_unit;
    return contact;
}

/* Ways beyond the lists, in the order of the set. */
static ascc_status follow_far(near_job *job, size_t count)
{
    ascc_contact *contact = job->contact;
    const ascc_search_tools *tools = &contact->state->tools;
    size_t left = 0;
    for (size_t i = 0; i < count; i++)
        left += job->is_left[i];
    if (!left)
        return ASCC_OK;
    size_t *row = ascc_arena_lend(tools->arena, left, sizeof *row);
    if (!row)
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for contact");
    left = 0;
    for (size_t i = 0; i < count; i++)
        if (job->is_left[i]) {
            row[left] = i;
            job->way[left++] = job->way[i];
        }
    return ascc_contact_far(contact, job->way, row, left);
}

static ascc_status follow_all(ascc_step_state *state, double distance)
{
    const ascc_search_tools *tools = &state->tools;
    const size_t count = state->hierarchy.set[ASCC_SET_FLUID].count;
    if (count == 0 || state->hierarchy.set[ASCC_SET_BOUNDARY].count == 0)
        return ASCC_OK;
    ascc_contact contact = open_contact(state, distance);
    const ascc_arena_mark mark = ascc_arena_mark_of(tools->arena);
    near_job job = {&contact, ascc_arena_lend(tools->arena, count, sizeof *job.way),
                    ascc_arena_lend(tools->arena, count, 1)};
    if (!job.way || !job.is_left)
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for contact");
    memset(job.is_left, 0, count); /* idle rows too */
    ascc_workers_run(tools->workers, count, 256, follow_rows, &job);
    ascc_status status = ASCC_OK;
    if (!atomic_load(&contact.bad))
        status = follow_far(&job, count);
    ascc_arena_return(tools->arena, mark);
    const size_t bad = atomic_load(&contact.bad);
    if (status == ASCC_OK && bad)
        return ascc_fail(tools->message, ASCC_ERROR_RANGE,
                         "fluid row %zu: a wall gives it a momentum too large to hold",
                         ascc_hierarchy_host_row(&state->hierarchy, ASCC_SET_FLUID, bad - 1));
    return status;
}

ascc_status ascc_stage_contact(ascc_step_state *state)
{
    const ascc_plan *plan = state->network->plan;
    const double distance = fmax(plan->output.contact, plan->relaxation.contact);
    if (!(distance > 0.0) || ascc_step_is_empty(state) || state->particles->boundary_count == 0)
        return ASCC_OK;
    const ascc_status status = follow_all(state, distance);
    return status == ASCC_OK ? ascc_advance_refresh(state) : status;
}
