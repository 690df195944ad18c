/* Contact of what goes farther than the neighbour lists reach: walls are searched along the ways.
 * SPDX-License-Identifier: MIT
 *
 * A way is cut into pieces no longer than two disc radii, and the walls around the middle of each piece are all
 * that it may meet. A meeting bends the way, so there are as many rounds as walls that one particle may meet; each
 * round searches only for those that are still under way, among the walls in the box around them.
 */
#include <math.h>

#include "contact.h"
#include "points/search.h"

/* A way longer than this many pieces has longer ones. */
#define MOST_PIECES 512

typedef struct far_job {
    ascc_contact *contact;
    ascc_way *way;
    const size_t *row;    /* of the fluid's set */
    uint32_t *first;      /* [count + 1] pieces of ways */
    const uint32_t *wall; /* of a source of the search: row of the boundary's set */
    const ascc_search *search;
} far_job;

static double length_of(const ascc_way *way)
{
    double square = 0.0;
    for (int c = 0; c < 3; c++)
        square += (way->to[c] - way->from[c]) * (way->to[c] - way->from[c]);
    return sqrt(square);
}

/* Pieces of all ways; half the length of the longest in *half. */
static size_t cut(const far_job *job, size_t count, double *half)
{
    const double piece = 2.0 * job->contact->disc;
    size_t at = 0;
    *half = 0.5 * piece;
    for (size_t k = 0; k < count; k++) {
        const double length = length_of(&job->way[k]), pieces = ceil(length / piece);
        const size_t n = pieces < MOST_PIECES ? (pieces > 1.0 ? (size_t)pieces : 1) : MOST_PIECES;
        job->first[k] = (uint32_t)at;
        *half = fmax(*half, 0.5 * length / (double)n);
        at += n;
    }
    job->first[count] = (uint32_t)at;
    return at;
}

/* Middles of pieces [pieces][d], and the box around them. */
static void place_middles(const far_job *job, size_t count, size_t d, double *middle, double low[3],
                          double high[3])
{
    for (size_t c = 0; c < d; c++) {
        low[c] = INFINITY;
        high[c] = -INFINITY;
    }
    for (size_t k = 0; k < count; k++) {
        const ascc_way *way = &job->way[k];
        const size_t first = job->first[k], n = job->first[k + 1] - first;
        for (size_t i = 0; i < n; i++)
            for (size_t c = 0; c < d; c++) {
                const double share = ((double)i + 0.5) / (double)n;
                const double x = way->from[c] + share * (way->to[c] - way->from[c]);
                middle[(first + i) * d + c] = x;
                low[c] = fmin(low[c], x);
                high[c] = fmax(high[c], x);
            }
    }
}

/* Walls of the box, this much wider on each side, and where they end. Returns how many. */
static size_t gather_walls(const ascc_step_state *state, const double low[3], const double high[3],
                           double margin, uint32_t *wall, double *place)
{
    const size_t d = (size_t)state->particles->dimension;
    const ascc_hierarchy *h = &state->hierarchy;
    size_t count = 0;
    for (size_t b = 0; b < h->set[ASCC_SET_BOUNDARY].count; b++) {
        const double *at = state->advance.wall + ascc_hierarchy_wall_row(h, b) * d;
        bool inside = true;
        for (size_t c = 0; c < d; c++) {
            place[count * d + c] = at[c];
            inside &= at[c] >= low[c] - margin && at[c] <= high[c] + margin;
        }
        if (inside)
            wall[count++] = (uint32_t)b;
    }
    return count;
}

/* One meeting of each way; those without one have all of theirs. */
static void meet_ways(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    far_job *job = data;
    ascc_contact *contact = job->contact;
    const ascc_rows *rows = &job->search->rows;
    for (size_t k = begin; k < end; k++) {
        ascc_meeting first = ascc_no_meeting();
        for (size_t i = job->first[k]; i < job->first[k + 1]; i++)
            for (size_t n = 0; n < rows->count[i]; n++)
                ascc_contact_try(contact, &job->way[k],
                                 job->wall[rows->neighbor[rows->start[i] + n]], &first);
        if (first.share > 1.0) {
            job->way[k].meetings = ASCC_MEETINGS;
            continue;
        }
        const size_t row =
            ascc_hierarchy_host_row(&contact->state->hierarchy, ASCC_SET_FLUID, job->row[k]);
        if (!ascc_contact_bend(contact, row, &first, &job->way[k]))
            ascc_note_first(&contact->bad, job->row[k]);
    }
}

static ascc_status fail_memory(const ascc_search_tools *tools)
{
    return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for contact");
}

/* Searches walls around the pieces of `count` ways, and lets each meet one. */
static ascc_status meet_once(far_job *job, size_t count)
{
    const ascc_step_state *state = job->contact->state;
    const ascc_search_tools *tools = &state->tools;
    const size_t d = (size_t)state->particles->dimension;
    const size_t walls = state->hierarchy.set[ASCC_SET_BOUNDARY].count;
    double half, low[3], high[3];
    const size_t pieces = cut(job, count, &half);
    const double radius = half + job->contact->near;
    double *middle = ascc_arena_lend(tools->arena, pieces, d * sizeof *middle);
    uint32_t *wall = ascc_arena_lend(tools->arena, walls, sizeof *wall);
    double *place = ascc_arena_lend(tools->arena, walls + 1, d * sizeof *place);
    if (!middle || !wall || !place)
        return fail_memory(tools);
    place_middles(job, count, d, middle, low, high);
    const size_t source = gather_walls(state, low, high, radius, wall, place);
    if (!source) {
        for (size_t k = 0; k < count; k++)
            job->way[k].meetings = ASCC_MEETINGS;
        return ASCC_OK;
    }
    ascc_search search;
    const ascc_search_options options = {.dimension = (int32_t)d,
                                         .radius = radius,
                                         .query = {middle, pieces, "place of fluid"},
                                         .source = {place, source, "boundary particle"}};
    const ascc_status status = ascc_search_run(&search, tools, &options);
    job->wall = wall;
    job->search = &search;
    if (status == ASCC_OK)
        ascc_workers_run(tools->workers, count, 64, meet_ways, job);
    return status;
}

ascc_status ascc_contact_far(ascc_contact *contact, ascc_way *way, const size_t *row, size_t count)
{
    const ascc_search_tools *tools = &contact->state->tools;
    size_t *under_way = ascc_arena_lend(tools->arena, count, sizeof *under_way);
    far_job job = {.contact = contact, .way = way, .row = under_way};
    job.first = ascc_arena_lend(tools->arena, count + 1, sizeof *job.first);
    if (!under_way || !job.first)
        return fail_memory(tools);
    for (size_t k = 0; k < count; k++)
        under_way[k] = row[k];
    while (count && !atomic_load(&contact->bad)) {
        const ascc_arena_mark mark = ascc_arena_mark_of(tools->arena);
        const ascc_status status = meet_once(&job, count);
        ascc_arena_return(tools->arena, mark);
        if (status != ASCC_OK)
            return status;
        size_t left = 0;
        for (size_t k = 0; k < count; k++)
            if (way[k].meetings < ASCC_MEETINGS) {
                under_way[left] = under_way[k];
                way[left++] = way[k];
            }
        count = left;
    }
    return ASCC_OK;
}
