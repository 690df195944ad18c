/* Which fluid sleeps in this step, and what it receives. SPDX-License-Identifier: MIT
 *
 *   block  blocks of four spacings, by what moves in them: calm, restless, violent
 *
 *     a a a a . . .     a  awake: moves
 *     a a r r r . .     r  asleep, one block from what is awake: still, but the others see it with all it
 *     r r r . . . .        has, and act on it; what it receives goes to the support
 *     . . . . . . .     .  asleep, idle: only seen by the network from afar
 */
#include <math.h>
#include <string.h>

#include "points/blocks.h"
#include "points/rest.h"
#include "stage.h"

/* How long blocks must be calm, s. */
#define CALM 0.5
/* The share of it after which what comes among fluid that sleeps does so, too: longer than anything falls as slowly. */
#define JOINS 0.25
/* Sums of a block are integers: speeds, in shares of the limit, times 2^16; squares of these over 2^16. */
#define UNIT 65536.0
#define FASTEST 1024.0 /* speeds beyond are cut to it */
/* The mean velocity of a calm block, in limits: fluid that flows is not fluid that trembles. */
#define DRIFT 0.75
/* Of the mean velocity that support would have to give, in what gravity gives in a step. */
#define LACK (1.0 / 3.0)
/* Of the squares of speeds, above which a block wakes those around it; of one particle in it. */
#define VIOLENT 2.25
#define VIOLENT_ONE 64.0

typedef struct block {
    uint32_t awake;  /* rows */
    int32_t least;   /* steps that all rows that are awake have been calm */
    uint64_t square; /* sum over them */
    int64_t mean[3]; /* likewise */
    bool fast, asleep, disturbed;
    bool restless, violent, near_violent, near_restless, near_awake;
} block;

typedef struct ascc_sleep_blocks {
    ascc_step_state *state;
    ascc_blocks blocks;
    block *block;
    uint32_t *of;       /* [rows] */
    double limit, fall; /* speeds: of what may sleep; what gravity gives in a step */
    int32_t calm, code; /* steps; what sleeping rows hold */
    int64_t reach;      /* blocks */
    int32_t *rest;
    bool (*is)(const block *b); /* visits look for this */
    bool found;
} judgement;

/* ---- What blocks hold ---- */

static int64_t share_of(double speed, double limit)
{
    const double share = fmax(-FASTEST, fmin(FASTEST, speed / limit));
    return (int64_t)floor(share * UNIT + 0.5);
}

/* Adds a velocity to what moves in a block. */
static void add_motion(block *b, const ascc_particles *p, size_t i, const int64_t *momentum,
                       double limit)
{
    uint64_t square = 0;
    for (int32_t c = 0; c < p->dimension; c++) {
        const double velocity = (double)momentum[c] * p->quantum / p->mass[i];
        const int64_t share = share_of(velocity, limit);
        square += (uint64_t)(share * share) >> 16;
        b->mean[c] += share;
    }
    b->awake++;
    b->square += square;
    b->fast |= (double)square > VIOLENT_ONE * UNIT;
}

static void add_row(judgement *j, size_t i)
{
    const ascc_particles *p = j->state->particles;
    block *b = &j->block[j->of[i]];
    if (!ascc_is_asleep(p->rest[i])) {
        add_motion(b, p, i, p->momentum + i * (size_t)p->dimension, j->limit);
        return;
    }
    b->asleep = true;
    b->disturbed |= p->rest[i] != j->code;
}

/* drift: that a calm block may have. */
static void judge(block *b, double drift_limit)
{
    double drift = 0.0;
    for (int c = 0; c < 3; c++)
        drift += (double)b->mean[c] * (double)b->mean[c];
    const double whole = UNIT * (double)b->awake;
    /* A mean of few that tremble is not 0: its square is about theirs over their number. */
    const double still =
        (drift_limit * drift_limit + 1.0 / fmax(1.0, (double)b->awake)) * whole * whole;
    b->violent = b->disturbed || (b->awake && (b->fast || (double)b->square > VIOLENT * whole));
    b->restless = b->violent || (b->awake && ((double)b->square > whole || drift > still));
}

/* Walls that move, and rows that the host accelerates, disturb the blocks around them. */
static void disturb(void *data, uint32_t number)
{
    ((judgement *)data)->block[number].disturbed = true;
}

static bool is_moved(const double *numbers, size_t d)
{
    bool moved = false;
    for (size_t c = 0; numbers && c < d; c++)
        moved |= numbers[c] != 0.0;
    return moved;
}

static void look_outside(judgement *j)
{
    const ascc_particles *p = j->state->particles;
    const size_t d = (size_t)p->dimension;
    const double *acceleration = j->state->motion->acceleration;
    int64_t at[3], last[3] = {INT64_MAX, 0, 0};
    for (size_t i = 0; acceleration && i < p->fluid_count; i++)
        j->block[j->of[i]].disturbed |= is_moved(acceleration + i * d, d);
    for (size_t i = 0; j->state->advance.walls_move && i < p->boundary_count; i++) {
        if (!is_moved(p->wall_velocity + i * d, d))
            continue;
        ascc_block_of(p->wall_position + i * d, p->dimension, ascc_rest_edge(p), at);
        if (memcmp(at, last, sizeof at) != 0)
            ascc_blocks_around(&j->blocks, at, p->dimension, j->reach, disturb, j);
        memcpy(last, at, sizeof last);
    }
}

/* ---- What is around them ---- */

static bool is_violent(const block *b)
{
    return b->violent;
}

static bool is_awake(const block *b)
{
    return b->awake > 0;
}

/* With rows that are not ready to sleep. */
static bool is_unready(const block *b)
{
    return b->awake > 0 && (b->restless || b->least < INT32_MAX);
}

static void look(void *data, uint32_t number)
{
    judgement *j = data;
    j->found |= j->is(&j->block[number]);
}

static bool near(judgement *j, size_t number, bool (*is)(const block *b))
{
    j->found = false;
    j->is = is;
    ascc_blocks_around(&j->blocks, j->blocks.at[number], j->state->particles->dimension, j->reach,
                       look, j);
    return j->found;
}

/* ---- The judgement ---- */

/* Steps that rows have been calm, of which half are forgotten where they are not; those that wake begin with 0. */
static void count_calm(judgement *j)
{
    const ascc_particles *p = j->state->particles;
    for (size_t b = 0; b < j->blocks.count; b++) {
        j->block[b].near_violent = near(j, b, is_violent);
        j->block[b].least = INT32_MAX;
    }
    for (size_t i = 0; i < p->fluid_count; i++) {
        const block *b = &j->block[j->of[i]];
        const int32_t before = p->rest[i];
        if (!ascc_is_asleep(before))
            j->rest[i] = b->restless ? before / 2 : before < j->calm ? before + 1 : j->calm;
        else
            j->rest[i] = b->near_violent || b->restless ? 0 : before;
        if (b->asleep && !b->near_violent && !b->restless && j->rest[i] > JOINS * j->calm)
            j->rest[i] = j->code;
    }
    for (size_t i = 0; i < p->fluid_count; i++) {
        block *b = &j->block[j->of[i]];
        if (j->rest[i] >= 0 && j->rest[i] < j->calm && j->rest[i] < b->least)
            b->least = j->rest[i];
    }
}

/* Blocks of which all rows have been calm, those around them, too, sleep from now on. */
static void put_to_sleep(judgement *j)
{
    const ascc_particles *p = j->state->particles;
    for (size_t b = 0; b < j->blocks.count; b++)
        j->block[b].awake = 0;
    for (size_t i = 0; i < p->fluid_count; i++)
        j->block[j->of[i]].awake += !ascc_is_asleep(j->rest[i]);
    for (size_t b = 0; b < j->blocks.count; b++)
        j->block[b].near_restless = near(j, b, is_unready);
    for (size_t i = 0; i < p->fluid_count; i++)
        if (!j->block[j->of[i]].near_restless)
            j->rest[i] = j->code;
    for (size_t b = 0; b < j->blocks.count; b++)
        if (!j->block[b].near_restless)
            j->block[b].awake = 0;
    for (size_t b = 0; b < j->blocks.count; b++)
        j->block[b].near_awake = near(j, b, is_awake);
}

/* ---- The stage ---- */

/* A negative number for the host's gravity: another one wakes all. */
static int32_t code_of(const ascc_step_state *state)
{
    double gravity[3];
    uint64_t hash = 1;
    memcpy(gravity, state->motion->gravity, sizeof gravity);
    ascc_turn_reals(&state->turn, true, gravity, 1, state->particles->dimension);
    for (int c = 0; c < 3; c++) {
        uint64_t bits;
        const double g = gravity[c] + 0.0; /* -0 is 0 */
        memcpy(&bits, &g, sizeof bits);
        hash = (hash ^ bits) * UINT64_C(0x9e3779b97f4a7c15);
        hash ^= hash >> 31;
    }
    return -1 - (int32_t)(hash & 0x3fffffff);
}

static ascc_status no_memory(const ascc_step_state *state)
{
    return ascc_fail(state->tools.message, ASCC_ERROR_MEMORY, "no memory for the sleeping fluid");
}

static bool open_judgement(judgement *j, ascc_step_state *state, double fall)
{
    const ascc_particles *p = state->particles;
    const ascc_plan *plan = state->network->plan;
    ascc_arena *arena = state->tools.arena;
    const size_t n = p->fluid_count, slots = ascc_blocks_slots(n);
    const double steps = ceil(CALM / state->motion->time_step * (1.0 - 1e-9));
    const double edge = ascc_rest_edge(p) * state->length_unit;
    int64_t(*at)[3] = ascc_arena_take(arena, n, sizeof *at);
    uint32_t *slot = ascc_arena_take(arena, slots, sizeof *slot);
    *j = (judgement){
        .state = state,
        .fall = fall,
        .limit = fall * state->motion->sleep_speed,
        .calm = steps < 1e6 ? (int32_t)steps : 1000000,
        .code = code_of(state),
        .reach = (int64_t)ceil(
            (fmax(ascc_plan_support_radius(plan), plan->relaxation.reach) + plan->spacing) / edge)};
    j->of = ascc_arena_take(arena, n, sizeof *j->of);
    if (!at || !slot || !j->of)
        return false;
    ascc_blocks_open(&j->blocks, at, slot, slots);
    for (size_t i = 0; i < n; i++) {
        int64_t place[3];
        ascc_block_of(p->position + i * (size_t)p->dimension, p->dimension, ascc_rest_edge(p),
                      place);
        j->of[i] = ascc_blocks_add(&j->blocks, place);
    }
    j->block = ascc_arena_take(arena, j->blocks.count, sizeof *j->block);
    if (j->block)
        memset(j->block, 0, j->blocks.count * sizeof *j->block);
    return j->block != NULL;
}

static void decide(judgement *j, ascc_sleep *sleep, uint8_t *still, uint8_t *idle)
{
    const size_t n = j->state->particles->fluid_count;
    for (size_t i = 0; i < n; i++)
        add_row(j, i);
    look_outside(j);
    for (size_t b = 0; b < j->blocks.count; b++)
        judge(&j->block[b], DRIFT);
    count_calm(j);
    put_to_sleep(j);
    for (size_t i = 0; i < n; i++) {
        still[i] = ascc_is_asleep(j->rest[i]);
        idle[i] = still[i] && !j->block[j->of[i]].near_awake;
        sleep->count += still[i];
        sleep->idle_count += idle[i];
    }
    if (sleep->count) {
        sleep->still = still;
        sleep->idle = idle;
    }
}

/* A step that lets nothing sleep wakes what does. */
static ascc_status wake_all(ascc_step_state *state)
{
    const ascc_particles *p = state->particles;
    bool any = false;
    for (size_t i = 0; i < p->fluid_count; i++)
        any |= p->rest[i] != 0;
    if (!any)
        return ASCC_OK;
    state->sleep.rest = ascc_arena_take(state->tools.arena, p->fluid_count, sizeof(int32_t));
    if (!state->sleep.rest)
        return no_memory(state);
    memset(state->sleep.rest, 0, p->fluid_count * sizeof *state->sleep.rest);
    return ASCC_OK;
}

ascc_status ascc_stage_sleep(ascc_step_state *state)
{
    const size_t n = state->particles->fluid_count;
    const double fall = state->motion->time_step * ascc_vector_length(state->motion->gravity);
    if (state->halo) /* ghosts are idle: what they do is computed elsewhere */
        state->sleep.idle = state->halo->ghost;
    if (state->halo || !(state->motion->sleep_speed * fall > 0.0) || n == 0)
        return wake_all(state);
    ascc_arena *arena = state->tools.arena;
    judgement *j = state->sleep.blocks = ascc_arena_take(arena, 1, sizeof *j);
    state->sleep.rest = ascc_arena_take(arena, n, sizeof *state->sleep.rest);
    uint8_t *still = ascc_arena_take(arena, n, 1), *idle = ascc_arena_take(arena, n, 1);
    const bool room = j && state->sleep.rest && still && idle && open_judgement(j, state, fall);
    if (room) {
        j->rest = state->sleep.rest;
        decide(j, &state->sleep, still, idle);
    }
    ascc_stage_lap(state, "sleep");
    return room ? ASCC_OK : no_memory(state);
}

/* Blocks that lack a third of their support wake after this step: those that would be restless with what they
 * received, were the limit what gravity gives. */
static void wake_pushed(judgement *j, const ascc_sleep *sleep)
{
    const size_t n = j->state->particles->fluid_count;
    for (size_t b = 0; b < j->blocks.count; b++)
        judge(&j->block[b], LACK);
    for (size_t i = 0; i < n; i++)
        if (sleep->still[i] && !sleep->idle[i] && j->block[j->of[i]].restless)
            sleep->rest[i] = 0;
}

/* What sleeping rows have, and have received, goes to the support. */
ascc_status ascc_stage_support(ascc_step_state *state)
{
    const ascc_particles *p = state->particles;
    const size_t d = (size_t)p->dimension;
    uint64_t sum[3] = {0, 0, 0};
    judgement *j = state->sleep.blocks;
    if (!state->sleep.still)
        return ASCC_OK;
    memset(j->block, 0, j->blocks.count * sizeof *j->block);
    for (size_t i = 0; i < p->fluid_count; i++) {
        if (state->sleep.still[i] && !state->sleep.idle[i])
            add_motion(&j->block[j->of[i]], p, i, state->advance.momentum + i * d, j->fall);
        for (size_t c = 0; state->sleep.still[i] && c < d; c++) {
            const size_t k = i * d + c;
            if (state->sleep.idle[i]) /* with what pairs gave after it was told to stay */
                sum[c] += (uint64_t)p->momentum[k] + (uint64_t)state->advance.external[k] +
                          (uint64_t)state->impulses.fluid[k];
            sum[c] += (uint64_t)state->advance.momentum[k];
            state->advance.momentum[k] = 0;
            state->advance.position[k] = p->position[k];
        }
    }
    wake_pushed(j, &state->sleep);
    for (size_t c = 0; c < d; c++)
        state->sleep.support[c] = (int64_t)sum[c];
    ascc_stage_lap(state, "sleep");
    return ASCC_OK;
}
