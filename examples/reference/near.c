/* Neighbour lists of the reference solvers, on the library's fixed-radius search.
 * SPDX-License-Identifier: MIT */
#include "near.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "points/search.h"

#define MOST_NEIGHBORS 4096

typedef struct near_state {
    near_lists lists; /* first, so that a pointer to one is a pointer to the other */
    ascc_context *context;
    ascc_arena arena;
    double
        *built; /* [points][dimension], when the lists were made, in the arena; moving ones first */
    bool valid;
} near_state;

near_lists *near_create(const near_options *options)
{
    near_state *n = calloc(1, sizeof *n);
    if (!n)
        return NULL;
    n->lists.options = *options;
    const ascc_context_options wanted = {.size = sizeof wanted,
                                         .thread_count = options->thread_count};
    if (ascc_context_create(&wanted, &n->context) != ASCC_OK) {
        free(n);
        return NULL;
    }
    ascc_arena_open(&n->arena, &n->context->allocator);
    return &n->lists;
}

void near_destroy(near_lists **lists)
{
    near_state *n = (near_state *)*lists;
    if (!n)
        return;
    ascc_arena_close(&n->arena);
    ascc_context_destroy(&n->context);
    free(n);
    *lists = NULL;
}

void near_run(near_lists *lists, size_t count, ascc_range_function function, void *data)
{
    ascc_workers_run(((near_state *)lists)->context->workers, count, 64, function, data);
}

void near_forget(near_lists *lists)
{
    ((near_state *)lists)->valid = false;
}

bool near_current(const near_lists *lists, size_t moving, const double *position, size_t stride)
{
    const near_state *n = (const near_state *)lists;
    const double half = 0.5 * lists->options.skin;
    const size_t d = (size_t)lists->options.dimension;
    if (!n->valid || moving != lists->moving)
        return false;
    for (size_t i = 0; i < moving; i++) {
        double square = 0.0;
        for (size_t c = 0; c < d; c++) {
            const double moved = position[i * stride + c] - n->built[i * d + c];
            square += moved * moved;
        }
        if (!(square < half * half))
            return false;
    }
    return true;
}

/* ---- Ghosts ---- */

typedef struct ghost_list {
    uint32_t *owner;
    double (*shift)[3];
    size_t count, capacity;
} ghost_list;

static bool add_ghost(ghost_list *ghosts, ascc_arena *arena, uint32_t owner, const double shift[3])
{
    if (ghosts->count == ghosts->capacity) {
        const size_t capacity = 2 * ghosts->capacity + 256;
        uint32_t *owners = ascc_arena_take(arena, capacity, sizeof *owners);
        double(*shifts)[3] = ascc_arena_take(arena, capacity, sizeof *shifts);
        if (!owners || !shifts)
            return false;
        if (ghosts->count) {
            memcpy(owners, ghosts->owner, ghosts->count * sizeof *owners);
            memcpy(shifts, ghosts->shift, ghosts->count * sizeof *shifts);
        }
        *ghosts = (ghost_list){owners, shifts, ghosts->count, capacity};
    }
    ghosts->owner[ghosts->count] = owner;
    memcpy(ghosts->shift[ghosts->count++], shift, sizeof *ghosts->shift);
    return true;
}

/* Copies of one point: every image in the shell of width `reach` around the box. */
static bool add_images(ghost_list *ghosts, ascc_arena *arena, const near_options *o, uint32_t i,
                       const double *x)
{
    const double reach = o->radius + o->skin;
    for (int image = 1; image < 27; image++) {
        const int step[3] = {image % 3, image / 3 % 3, image / 9};
        double shift[3] = {0};
        bool inside = true;
        for (int c = 0; c < 3 && inside; c++) {
            if (step[c] == 0)
                continue;
            shift[c] = step[c] == 1 ? o->period[c] : -o->period[c];
            const double at = c < o->dimension ? x[c] + shift[c] : 0.0;
            inside = o->period[c] > 0.0 && at > -reach && at < o->period[c] + reach;
        }
        if (inside && !add_ghost(ghosts, arena, i, shift))
            return false;
    }
    return true;
}

static bool make_ghosts(near_state *n, const double *position, size_t stride)
{
    const near_options *o = &n->lists.options;
    ghost_list ghosts = {0};
    const bool periodic = o->period[0] > 0.0 || o->period[1] > 0.0 || o->period[2] > 0.0;
    for (size_t i = 0; periodic && i < n->lists.moving; i++)
        if (!add_images(&ghosts, &n->arena, o, (uint32_t)i, position + i * stride))
            return false;
    n->lists.ghosts = ghosts.count;
    n->lists.owner = ghosts.owner;
    n->lists.shift = (const double(*)[3])ghosts.shift;
    return true;
}

/* ---- Lists ---- */

/* All points at their places: moving, fixed, ghosts. */
static bool place_points(near_state *n, const double *position, size_t stride)
{
    const near_lists *l = &n->lists;
    const size_t d = (size_t)l->options.dimension, own = l->moving + l->fixed;
    n->built = ascc_arena_take(&n->arena, (own + l->ghosts) * d, sizeof *n->built);
    for (size_t i = 0; n->built && i < own + l->ghosts; i++)
        for (size_t c = 0; c < d; c++)
            n->built[i * d + c] =
                i < own ? position[i * stride + c]
                        : position[l->owner[i - own] * stride + c] + l->shift[i - own][c];
    return n->built != NULL;
}

/* Rows of the fixed points: the moving rows turned round, moving points ascending. */
static ascc_status turn_rows(near_state *n, const ascc_rows *rows)
{
    near_lists *l = &n->lists;
    size_t *start = ascc_arena_take(&n->arena, l->fixed + 2, sizeof *start);
    if (!start)
        return ascc_fail(&l->message, ASCC_ERROR_MEMORY, "no memory for %zu walls", l->fixed);
    memset(start, 0, (l->fixed + 2) * sizeof *start);
    const size_t first = l->moving, end = l->moving + l->fixed;
    for (size_t i = 0; i < l->moving; i++)
        for (uint32_t k = 0; k < rows->count[i]; k++) {
            const uint32_t j = rows->neighbor[rows->start[i] + k];
            if (j >= first && j < end)
                start[j - first + 2]++;
        }
    for (size_t w = 2; w < l->fixed + 2; w++)
        start[w] += start[w - 1];
    uint32_t *index = ascc_arena_take(&n->arena, start[l->fixed + 1], sizeof *index);
    if (!index)
        return ascc_fail(&l->message, ASCC_ERROR_MEMORY, "no memory for %zu walls", l->fixed);
    for (size_t i = 0; i < l->moving; i++)
        for (uint32_t k = 0; k < rows->count[i]; k++) {
            const uint32_t j = rows->neighbor[rows->start[i] + k];
            if (j >= first && j < end)
                index[start[j - first + 1]++] = (uint32_t)i;
        }
    l->wall_start = start;
    l->wall_index = index;
    return ASCC_OK;
}

static ascc_status search(near_state *n)
{
    near_lists *l = &n->lists;
    const ascc_search_tools tools = {&n->arena, n->context->workers, &n->context->kernels,
                                     &l->message};
    const size_t count = l->moving + l->fixed + l->ghosts;
    uint8_t *wanted = ascc_arena_take(&n->arena, count, 1);
    if (!wanted)
        return ascc_fail(&l->message, ASCC_ERROR_MEMORY, "no memory for %zu points", count);
    for (size_t i = 0; i < count; i++)
        wanted[i] = i < l->moving;
    const ascc_search_options within = {.dimension = l->options.dimension,
                                        .radius = l->options.radius + l->options.skin,
                                        .query = {.at = n->built, .count = count},
                                        .skip_self = true,
                                        .max_neighbors = MOST_NEIGHBORS,
                                        .expected =
                                            l->moving * (l->options.dimension == 3 ? 160 : 40),
                                        .wanted = wanted};
    ascc_search near;
    const ascc_status status = ascc_search_run(&near, &tools, &within);
    if (status != ASCC_OK)
        return status;
    l->start = near.rows.start;
    l->count = near.rows.count;
    l->index = near.rows.neighbor;
    return turn_rows(n, &near.rows);
}

ascc_status near_update(near_lists *lists, size_t moving, size_t fixed, const double *position,
                        size_t stride)
{
    near_state *n = (near_state *)lists;
    ascc_arena_reset(&n->arena);
    n->valid = false;
    lists->moving = moving;
    lists->fixed = fixed;
    if (!make_ghosts(n, position, stride))
        return ascc_fail(&lists->message, ASCC_ERROR_MEMORY, "no memory for ghosts of %zu points",
                         moving);
    if (!place_points(n, position, stride))
        return ascc_fail(&lists->message, ASCC_ERROR_MEMORY, "no memory for %zu points", moving);
    const ascc_status status = search(n);
    n->valid = status == ASCC_OK;
    lists->rebuilds += n->valid;
    return status;
}
