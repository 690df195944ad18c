/* A better network where detail is wanted, in the step of another model. SPDX-License-Identifier: MIT
 *
 *     weight   0 0 0 0 0 .3 .7 1 1 1 1     of each particle, the host's
 *     base     x x x x x  x  x             what the step's own network computes,
 *     better         . .  x  x x x x x     and the other: '.' it only sees
 *
 * The last layer of either network holds numbers of single particles, and pair impulses are linear in them. Each
 * network's are multiplied with its share of the particle before impulses are made of them, so that a pair is
 * rounded and cancels in each as ever, and the impulses of both are added: momentum is exact whatever the weights.
 * The better one runs on a set of its own, what has a weight and what is near; farther fluid it does not see.
 * Everything after the networks runs once, over all.
 */
#include "detail.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "points/blocks.h"

/* How far beyond what has a weight the better network sees, spacings at least; in blocks, of which it is so many. */
#define SIGHT 4.0
#define REACH 1

#define ALIKE 1e-6

static bool alike(double a, double b)
{
    return fabs(a - b) <= ALIKE * fabs(a);
}

/* Is its output made of pairs of fluid particles, and of what these hold? */
static bool has_pairs(const ascc_plan *plan)
{
    const int32_t source = plan->output.term.source;
    return plan->layer_count == 0 ||
           (plan->output.conserves && ascc_plan_value_set(plan->layer, source) == ASCC_SET_FLUID);
}

const char *ascc_detail_obstacle(const ascc_plan *base, const ascc_plan *better)
{
    const ascc_relaxation *a = &base->relaxation, *b = &better->relaxation;
    if (!has_pairs(base) || !has_pairs(better))
        return "the output of one is not made of pairs of what fluid particles hold";
    if (base->advection != better->advection)
        return "they see particles at other places";
    if (!a->pressure.count != !b->pressure.count)
        return "one has a relaxation, the other has none";
    if (a->pressure.count && !(alike(a->support, b->support) && alike(a->amount, b->amount)))
        return "their relaxations differ in support or rest volume";
    return NULL;
}

/* The set that the better network sees. */
typedef struct near_set {
    ascc_particles particles; /* rows that it has; walls are the step's own */
    size_t *row;              /* [fluid] of the step's set */
    float *share;             /* [fluid] */
    uint8_t *walls;           /* [boundary] 1 = sees it */
} near_set;

static ascc_status no_memory(const ascc_step_state *state)
{
    return ascc_fail(state->tools.message, ASCC_ERROR_MEMORY, "no memory for the detail");
}

/* ---- Which rows ---- */

/* Blocks of space with fluid, and which of them hold some with a weight. */
typedef struct sight {
    ascc_blocks blocks;
    uint8_t *weighted; /* [block] */
    double edge;
    int32_t dimension;
    int64_t last[3]; /* the block looked at, and whether it is near one with a weight */
    uint32_t number;
    bool is_near;
} sight;

static bool lend_sight(sight *s, ascc_arena *arena, const ascc_particles *p)
{
    *s = (sight){.weighted = ascc_arena_lend(arena, p->fluid_count, 1),
                 .edge = SIGHT / REACH * p->spacing,
                 .dimension = p->dimension,
                 .last = {INT64_MAX, 0, 0}};
    return s->weighted && ascc_blocks_lend(&s->blocks, arena, p->fluid_count);
}

/* Rows that follow one another lie mostly in one block. */
static bool is_last(sight *s, const double *place)
{
    int64_t at[3];
    ascc_block_of(place, s->dimension, s->edge, at);
    const bool same = memcmp(at, s->last, sizeof at) == 0;
    memcpy(s->last, at, sizeof at);
    return same;
}

static uint32_t add_place(sight *s, const double *place)
{
    const size_t before = s->blocks.count;
    if (!is_last(s, place))
        s->number = ascc_blocks_add(&s->blocks, s->last);
    if (s->blocks.count > before)
        s->weighted[s->number] = 0;
    return s->number;
}

static void note(void *data, uint32_t block)
{
    sight *s = data;
    s->is_near |= s->weighted[block] != 0;
}

static bool is_near(sight *s, const int64_t at[3])
{
    s->is_near = false;
    ascc_blocks_around(&s->blocks, at, s->dimension, REACH, note, s);
    return s->is_near;
}

static void choose_walls(sight *s, const ascc_particles *p, uint8_t *walls)
{
    s->last[0] = INT64_MAX;
    for (size_t i = 0; i < p->boundary_count; i++)
        walls[i] = is_last(s, p->wall_position + i * (size_t)p->dimension) ? s->is_near
                                                                           : is_near(s, s->last);
}

/* The rows with a weight, and those in blocks near theirs; false without memory. */
static bool choose_rows(const ascc_step_state *state, ascc_arena *arena, near_set *near)
{
    const ascc_particles *p = state->particles;
    const size_t n = p->fluid_count;
    size_t count = 0;
    sight s;
    near->row = ascc_arena_take(arena, n, sizeof *near->row);
    near->walls = ascc_arena_take(arena, p->boundary_count, 1);
    const ascc_arena_mark mark = ascc_arena_mark_of(arena);
    uint32_t *of = ascc_arena_lend(arena, n, sizeof *of);
    uint8_t *seen = ascc_arena_lend(arena, n, 1);
    if (!near->row || !near->walls || !of || !seen || !lend_sight(&s, arena, p))
        return false;
    for (size_t i = 0; i < n; i++) {
        of[i] = add_place(&s, p->position + i * (size_t)p->dimension);
        s.weighted[of[i]] |= p->detail[i] > 0.0;
    }
    for (size_t b = 0; b < s.blocks.count; b++)
        seen[b] = s.weighted[b] || is_near(&s, s.blocks.at[b]);
    for (size_t i = 0; i < n; i++)
        if (seen[of[i]])
            near->row[count++] = i;
    choose_walls(&s, p, near->walls);
    near->particles.fluid_count = count;
    ascc_arena_return(arena, mark);
    return true;
}

/* ---- The set ---- */

static void *gather(const near_set *near, ascc_arena *arena, const void *from, size_t size)
{
    const size_t count = near->particles.fluid_count;
    unsigned char *to = ascc_arena_take(arena, count, size);
    for (size_t i = 0; to && i < count; i++)
        memcpy(to + i * size, (const unsigned char *)from + near->row[i] * size, size);
    return to;
}

static bool gather_fields(const ascc_particles *from, ascc_arena *arena, near_set *near)
{
    const size_t count = near->particles.fluid_count;
    near->particles = *from;
    near->particles.fluid_count = count;
    for (size_t f = 0; f < ASCC_FIELD_COUNT; f++) {
        const ascc_particle_field *field = &ascc_particle_fields[f];
        if (field->kind != ASCC_FLUID)
            continue;
        void *rows = gather(near, arena, ascc_field_rows(from, field),
                            ascc_field_row_size(field, from->dimension, from->past_count));
        if (!rows)
            return false;
        ascc_field_point(&near->particles, field, rows);
    }
    near->share = ascc_arena_take(arena, count, sizeof *near->share);
    for (size_t i = 0; near->share && i < count; i++)
        near->share[i] = (float)near->particles.detail[i];
    return near->share != NULL;
}

static void *zeros(ascc_arena *arena, size_t count)
{
    int64_t *to = ascc_arena_take(arena, count, sizeof *to);
    if (to)
        memset(to, 0, count * sizeof *to);
    return to;
}

/* The better step's state, as far as its engine reads and fills it; false without memory. */
static bool open_state(const ascc_step_state *from, const near_set *near, ascc_step_state *state)
{
    ascc_step *step = from->detail;
    ascc_arena *arena = &step->arena;
    const size_t d = (size_t)near->particles.dimension, size = d * sizeof(double);
    *state = ascc_step_open(step, &near->particles, from->motion);
    state->turn = from->turn;
    state->tools =
        (ascc_search_tools){arena, from->tools.workers, from->tools.kernels, from->tools.message};
    state->share = near->share;
    state->walls_seen = near->walls;
    state->joins = true;
    state->advance = from->advance;
    if (from->sleep.idle) {
        state->sleep.idle = gather(near, arena, from->sleep.idle, 1);
        if (!state->sleep.idle)
            return false;
    }
    state->advance.seen = gather(near, arena, from->advance.seen, size);
    state->advance.velocity = gather(near, arena, from->advance.velocity, size);
    state->impulses.fluid = zeros(arena, near->particles.fluid_count * d);
    state->impulses.wall = zeros(arena, near->particles.boundary_count * d);
    return state->advance.seen && state->advance.velocity && state->impulses.fluid &&
           state->impulses.wall;
}

/* ---- One of both ---- */

static ascc_status add(int64_t *to, int64_t impulse, const ascc_step_state *state, const char *kind,
                       size_t row)
{
    return __builtin_add_overflow(*to, impulse, to)
               ? ascc_fail(state->tools.message, ASCC_ERROR_RANGE,
                           "the networks give %s row %zu an impulse too large to hold", kind, row)
               : ASCC_OK;
}

static ascc_status add_impulses(ascc_step_state *state, const ascc_step_state *better,
                                const near_set *near)
{
    const size_t d = (size_t)near->particles.dimension;
    const size_t fluid = near->particles.fluid_count * d;
    const size_t walls = near->particles.boundary_count * d;
    ascc_status status = ASCC_OK;
    for (size_t k = 0; k < fluid && status == ASCC_OK; k++)
        status = add(&state->impulses.fluid[near->row[k / d] * d + k % d],
                     better->impulses.fluid[k], state, "fluid", near->row[k / d]);
    for (size_t k = 0; k < walls && status == ASCC_OK; k++)
        status = add(&state->impulses.wall[k], better->impulses.wall[k], state, "boundary", k / d);
    return status;
}

/* Pressures that the relaxation begins with: of each network its share. */
static ascc_status join_guesses(ascc_step_state *state, const ascc_step_state *better,
                                const near_set *near)
{
    const size_t hosts = state->particles->fluid_count;
    const ascc_hierarchy *h = &state->hierarchy, *b = &better->hierarchy;
    const size_t n = h->set[ASCC_SET_FLUID].count;
    if (!state->run.guess && !better->run.guess)
        return ASCC_OK;
    float *guess = ascc_arena_take(state->tools.arena, hosts, sizeof *guess);
    if (!guess)
        return no_memory(state);
    if (!state->run.guess) {
        state->run.guess = ascc_arena_take(state->tools.arena, n, sizeof *guess);
        if (!state->run.guess)
            return no_memory(state);
        memset(state->run.guess, 0, n * sizeof *guess);
    }
    memset(guess, 0, hosts * sizeof *guess);
    for (size_t i = 0; better->run.guess && i < b->set[ASCC_SET_FLUID].count; i++) {
        const size_t own = ascc_hierarchy_host_row(b, ASCC_SET_FLUID, i);
        guess[near->row[own]] = near->share[own] * better->run.guess[i];
    }
    for (size_t i = 0; i < n; i++) {
        const size_t row = ascc_hierarchy_host_row(h, ASCC_SET_FLUID, i);
        state->run.guess[i] = state->share[row] * state->run.guess[i] + guess[row];
    }
    return ASCC_OK;
}

/* What a relaxation of both models does at most: of each model its own, as far as rows are its. */
static bool join_relaxations(ascc_step_state *state)
{
    const ascc_relaxation *a = &state->network->plan->relaxation;
    const ascc_relaxation *b = &state->detail->model->plan.relaxation;
    ascc_relaxation *both = ascc_arena_take(state->tools.arena, 1, sizeof *both);
    if (!both)
        return false;
    *both = *a;
    both->pressure.count =
        b->pressure.count > a->pressure.count ? b->pressure.count : a->pressure.count;
    both->divergence.count =
        b->divergence.count > a->divergence.count ? b->divergence.count : a->divergence.count;
    if (b->viscosity.count) {
        both->viscosity = b->viscosity;
        both->viscosity_below = b->viscosity_below;
    }
    if (b->rounds > a->rounds) {
        both->rounds = b->rounds;
        both->again = b->again;
        both->left = b->left;
    }
    both->limit = fmax(a->limit, b->limit);
    both->current_direction |= b->current_direction;
    state->relaxation = both;
    state->part[0] = a;
    state->part[1] = b;
    return true;
}

/* Shares of the base: 1 - weight. */
static bool take_shares(ascc_step_state *state)
{
    const ascc_particles *p = state->particles;
    float *share = ascc_arena_take(state->tools.arena, p->fluid_count, sizeof *share);
    for (size_t i = 0; share && i < p->fluid_count; i++)
        share[i] = (float)(1.0 - p->detail[i]);
    state->share = share;
    return share != NULL;
}

ascc_status ascc_engine_detail(ascc_step_state *state)
{
    ascc_step *step = state->detail;
    ascc_step_state better;
    near_set near = {.row = NULL};
    ascc_arena_reset(&step->arena);
    if (!choose_rows(state, &step->arena, &near) ||
        !gather_fields(state->particles, &step->arena, &near) ||
        !open_state(state, &near, &better) || !take_shares(state))
        return no_memory(state);
    ascc_status status = better.engine(&better);
    if (status == ASCC_OK && better.trust && step->statistics.distance_count)
        step->statistics.distance_row = near.row[step->statistics.distance_row];
    ascc_stage_lap(state, "detail");
    if (status == ASCC_OK)
        status = state->engine(state);
    if (status == ASCC_OK)
        status = add_impulses(state, &better, &near);
    if (status == ASCC_OK)
        status = join_guesses(state, &better, &near);
    if (status == ASCC_OK && !join_relaxations(state))
        status = no_memory(state);
    step->statistics.scratch_size = ascc_arena_size(&step->arena);
    ascc_stage_lap(state, "detail");
    return status;
}
