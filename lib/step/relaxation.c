/* Pressure from densities, by a few weighted Jacobi sweeps, and the one convolution that applies it (paper
 * Eq. 2; docs/method.md). SPDX-License-Identifier: MIT
 *
 * In supports, with g_ij = V grad_i w(x_i - x_j) towards j, c the excess of density and p the pressure:
 *
 *     d_i = - sum_j (p_i + p_j) g_ij - sum_walls p_i g_ib                  push
 *     c_i = excess_i + sum_j g_ij . (d_i - d_j) + sum_walls g_ib . d_i     divergence
 *     p_i = max(0, p_i + omega c_i / (D_i + epsilon D_lattice))          from 0, or a channel of the network
 *
 * Geometry stays as it is while sweeps go on; d is applied once, at the end, as pair impulses. The
 * same sweeps on velocities, with their divergence in place of the excess, end their approach.
 */
#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "active_rows.h"
#include "hyperviscosity.h"
#include "network/early_rows.h"
#include "relaxation_pairs.h"

#define ROWS 256       /* of a block of work */
#define SET_ASIDE 4096 /* pairs, so that workers seldom meet at the counter */
/* How far the network may take a particle from where it saw it, units: differences fit 32 bits. */
#define FARTHEST (((int64_t)1 << 30) - ((int64_t)1 << 27))
/* Sweeps look for rows to leave out where less than this share has a pressure: there marks cost less than they save. */
#define LOOSE 0.25
/* The same of rows that pushes move: those that are pushed, times how many that is for each with a pressure, are less
 * than this many times all rows. */
#define AROUND 2.0
/* Compressions are summed in integers. */
#define COMPRESSION_UNIT 0x1p-24

/* Pairs that a worker has set aside and not used. */
typedef struct pair_room {
    size_t next, end;
} pair_room;

/* Rows are those of ASCC_SET_FLUID. Vectors are three arrays. */
typedef struct relaxation {
    ascc_step_state *state;
    const ascc_relaxation *constants;
    const ascc_rows *rows, *wall_rows;
    size_t count;
    float inverse_support;    /* of a unit */
    int32_t *low;             /* positions [count][4] */
    const float *wall_volume; /* of wall rows */
    /* Of walls that move: where they end, if the network saw them elsewhere, and, if sweeps are on velocities,
     * how far they go, supports; and what that adds to each row. Else NULL. */
    int32_t *wall_low[3];
    float *wall_move[3], *inflow;
    ascc_pair_sum sum;
    /* What the pairs are; those of a row lie together, rows in any order: */
    size_t *start, *end; /* [count] */
    uint32_t *neighbor;
    size_t capacity;    /* pairs there is room for */
    atomic_size_t used; /* set aside; more than the capacity: rows are missing */
    pair_room *aside;   /* [slots] */
    float *g[3], *weight;
    float *own[3];                                       /* sum of g, walls included */
    float *push[3];                                      /* the same by weight */
    float *excess, *response, *pressure, *change, *move; /* move: rows of 4 */
    float *smoothing;                                    /* of a hyperviscosity, if there is one */
    uint8_t *near;       /* rows with neighbours within the repulsion */
    const float *guess;  /* [count] pressures times D_lattice; NULL = 0 */
    const double *place; /* [count][3] before the step, if corrections lie along those lines */
    float *scratch;      /* [slots][4][room] */
    size_t room;
    ascc_relaxation_trace *trace; /* of a step whose values are kept, else NULL */
    float omega, other; /* of the sweep under way; of the model that has the rest of rows */
    const float *share; /* [count] of rows; NULL = there is one model */
    bool slows;         /* sweeps are on velocities, not densities */
    float repulsion;    /* below this distance, in supports */
    ascc_active_rows active;
    bool loose; /* most rows have no pressure: those that are not pushed stay as they are, */
    bool few;   /* and few are moved, likewise */
    size_t pressed_first,
        pressed_last; /* rows with a pressure when marks began anew; behind the last sweep */
    atomic_size_t pressed, pushed; /* of the sweep under way; rows that it pushes */
    atomic_size_t bad;
    atomic_uint_least64_t compression, largest;
} relaxation;

static ascc_gradients gradients(const relaxation *r)
{
    return (ascc_gradients){.start = r->start,
                            .end = r->end,
                            .neighbor = r->neighbor,
                            .g = {r->g[0], r->g[1], r->g[2]},
                            .weight = r->sum.uniform ? NULL : r->weight};
}

/* ---- Memory ---- */

static ascc_status no_memory(const ascc_step_state *state)
{
    return ascc_fail(state->tools.message, ASCC_ERROR_MEMORY, "no memory for the relaxation");
}

/* Lent, but taken if a way back reads it. */
static void *room_for(const relaxation *r, size_t count, size_t element)
{
    ascc_arena *arena = r->state->tools.arena;
    return r->trace ? ascc_arena_take(arena, count, element)
                    : ascc_arena_lend(arena, count, element);
}

static bool vector_room(const relaxation *r, float *vector[3], size_t count)
{
    for (int c = 0; c < 3; c++) {
        vector[c] = room_for(r, count, sizeof *vector[c]);
        if (!vector[c])
            return false;
    }
    return true;
}

static size_t whole_vectors(size_t count)
{
    return (count + 7) / 8 * 8;
}

static bool is_idle(const relaxation *r, size_t i)
{
    return ascc_hierarchy_is_idle(&r->state->hierarchy, i);
}

static bool take_pairs(relaxation *r, size_t capacity)
{
    r->capacity = capacity;
    r->neighbor = room_for(r, capacity, sizeof *r->neighbor);
    if (!r->sum.uniform)
        r->weight = room_for(r, capacity, sizeof *r->weight);
    return r->neighbor && (r->sum.uniform || r->weight) && vector_room(r, r->g, capacity);
}

/* How many of the entries of lists are within the support where they lie evenly, in whole vectors. */
static double even_pairs(const relaxation *r, size_t entries)
{
    const double ratio = 1.0 / ((double)r->inverse_support * r->rows->radius);
    const double share =
        r->state->particles->dimension == 2 ? ratio * ratio : ratio * ratio * ratio;
    return (share < 1.0 ? share : 1.0) * (double)entries + 3.5 * (double)r->count;
}

/* Room for as many pairs as the last relaxation kept and some more; the first time for as many as there should be;
 * where a way back reads them, for all that the lists have. */
static bool make_room_for_pairs(relaxation *r)
{
    const size_t aside = (size_t)ascc_workers_count(r->state->tools.workers) * SET_ASIDE;
    size_t entries = 0, most = 0, expected = *r->state->expected_pairs;
    for (size_t i = 0; i < r->count; i++) {
        entries += is_idle(r, i) ? 0 : r->rows->count[i];
        most += is_idle(r, i) ? 0 : whole_vectors(r->rows->count[i]);
    }
    if (!expected)
        expected = (size_t)even_pairs(r, entries);
    return take_pairs(r, aside + (r->trace ? most : ascc_min_size(most, expected + expected / 16)));
}

static bool lend_memory(relaxation *r)
{
    ascc_arena *arena = r->state->tools.arena;
    const size_t n = r->count;
    const size_t slots = (size_t)ascc_workers_count(r->state->tools.workers);
    float **const numbers[] = {&r->excess, &r->response, &r->pressure, &r->change};
    bool room = true;
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
        room &= (*numbers[i] = room_for(r, n, sizeof(float))) != NULL;
    r->low = room_for(r, n, 4 * sizeof *r->low);
    r->start = room_for(r, n, sizeof *r->start);
    r->end = room_for(r, n, sizeof *r->end);
    r->move = ascc_arena_lend(arena, n, 4 * sizeof *r->move);
    r->near = room_for(r, n, 1);
    if (!room || !r->start || !r->end || !r->low || !r->move || !r->near ||
        !vector_room(r, r->own, n))
        return false;
    r->room = whole_vectors(ascc_max_size(r->rows->longest, r->wall_rows->longest));
    r->aside = ascc_arena_lend(arena, slots, sizeof *r->aside);
    r->scratch = ascc_arena_lend(arena, slots * r->room, 4 * sizeof *r->scratch);
    memcpy(r->push, r->own, sizeof r->push);
    if (r->slows && r->constants->viscosity.count) {
        r->smoothing = room_for(r, n, sizeof *r->smoothing);
        if (!r->smoothing)
            return false;
    }
    if ((!r->sum.uniform && !vector_room(r, r->push, n)) ||
        (!r->slows && !ascc_active_rows_open(&r->active, arena, n)))
        return false;
    return r->aside && r->scratch && make_room_for_pairs(r);
}

/* ---- Geometry ---- */

static bool find_place(relaxation *r, size_t i)
{
    const ascc_hierarchy *h = &r->state->hierarchy;
    const size_t d = (size_t)r->state->particles->dimension;
    const size_t row = ascc_hierarchy_host_row(h, ASCC_SET_FLUID, i);
    for (size_t c = 0; c < 3; c++) {
        int64_t at = 0;
        if (c < d &&
            !ascc_scale_apply(&h->scale,
                              r->state->advance.position[row * d + c] * r->state->length_unit, &at))
            return false;
        const int64_t moved = at - h->set[ASCC_SET_FLUID].position[c][i];
        if (moved > FARTHEST || moved < -FARTHEST)
            return false;
        r->low[i * 4 + c] = (int32_t)(uint32_t)(uint64_t)at;
    }
    return true;
}

static void find_places(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    relaxation *r = data;
    for (size_t i = begin; i < end; i++)
        if (!find_place(r, i)) {
            ascc_note_first(&r->bad, i);
            return;
        }
    for (size_t i = begin; r->slows && i < end; i++)
        ascc_relaxation_velocity(r->state, i, r->move + i * 4);
}

/* Is there another particle within the repulsion? The row itself is among its neighbours. */
static uint8_t has_near(const relaxation *r, const float *distance, size_t count)
{
    size_t near = 0;
    for (size_t k = 0; k < count; k++)
        near += distance[k] < r->repulsion;
    return near > 1;
}

/* Unit vectors and distances, in supports, from row i to neighbours among the fluid or walls. */
static void find_directions(const relaxation *r, size_t i, bool walls, const uint32_t *neighbor,
                            size_t count, const ascc_pairs *pairs)
{
    const ascc_kernels *kernels = r->state->tools.kernels;
    int32_t *const *seen = r->state->hierarchy.set[ASCC_SET_BOUNDARY].low;
    int32_t *const *wall = r->wall_low[0] ? r->wall_low : seen;
    const ascc_coordinates points = {wall[0], wall[1], wall[2]};
    const int32_t *at = r->low + i * 4;
    if (walls)
        kernels->geometry(&points, neighbor, count, at[0], at[1], at[2], r->inverse_support,
                          ASCC_MAPPING_DIRECTION, pairs);
    else
        kernels->directions(r->low, neighbor, count, at, r->inverse_support, pairs);
}

/* Sets room aside for all that a row's list has; false if there is none. What is not used is given back. */
static bool begin_row(relaxation *r, size_t i, pair_room *aside)
{
    const size_t most = whole_vectors(r->rows->count[i]);
    if (most > aside->end - aside->next) {
        const size_t wanted = ascc_max_size(most, SET_ASIDE);
        aside->next = atomic_fetch_add_explicit(&r->used, wanted, memory_order_relaxed);
        aside->end = aside->next + wanted;
    }
    r->start[i] = r->end[i] = aside->next;
    return aside->next + most <= r->capacity;
}

/* Keeps the gradients of a row's fluid pairs; sums as the kernel gives them. */
static void look(relaxation *r, size_t i, float *scratch, float sum[8])
{
    const ascc_kernels *kernels = r->state->tools.kernels;
    const uint32_t *neighbor = r->rows->neighbor + r->rows->start[i];
    const size_t count = r->rows->count[i], at = r->start[i];
    const ascc_pairs pairs = {.x = scratch,
                              .y = scratch + r->room,
                              .z = scratch + 2 * r->room,
                              .distance = scratch + 3 * r->room};
    float *const g[3] = {r->g[0] + at, r->g[1] + at, r->g[2] + at};
    find_directions(r, i, false, neighbor, count, &pairs);
    r->near[i] = has_near(r, pairs.distance, count);
    kernels->spline(&pairs, neighbor, count, (float)r->constants->amount, NULL, sum);
    r->end[i] =
        at + kernels->keep_gradients(&pairs, neighbor, count, (uint32_t)i, r->neighbor + at, g);
}

/* What walls that approach row i add to its divergence, from the gradients of its pairs. */
static float inflow_of(const relaxation *r, const ascc_pairs *pairs, const uint32_t *neighbor,
                       size_t count)
{
    float sum = 0.0f;
    for (size_t k = 0; k < count; k++)
        sum -= pairs->x[k] * r->wall_move[0][neighbor[k]] +
               pairs->y[k] * r->wall_move[1][neighbor[k]] +
               pairs->z[k] * r->wall_move[2][neighbor[k]];
    return sum;
}

static void look_at_walls(const relaxation *r, size_t i, float *scratch, float sum[8])
{
    const uint32_t *neighbor = r->wall_rows->neighbor + r->wall_rows->start[i];
    const size_t count = r->wall_rows->count[i];
    const ascc_pairs pairs = {.x = scratch,
                              .y = scratch + r->room,
                              .z = scratch + 2 * r->room,
                              .distance = scratch + 3 * r->room};
    find_directions(r, i, true, neighbor, count, &pairs);
    r->state->tools.kernels->spline(&pairs, neighbor, count, (float)r->constants->amount,
                                    r->wall_volume, sum);
    if (r->inflow)
        r->inflow[i] = inflow_of(r, &pairs, neighbor, count);
}

/* Of unequal masses: a pair pushes row i by twice the other's share of both masses. Returns D. */
static float weigh(relaxation *r, size_t i, const float wall[3])
{
    float by_weight[3] = {wall[0], wall[1], wall[2]}, squares = 0.0f, along = 0.0f;
    const double mass = r->sum.mass[i];
    for (size_t k = r->start[i]; k < r->end[i]; k++) {
        const double other = r->sum.mass[r->neighbor[k]];
        const float weight = (float)(ascc_pair_mass(mass, other) / mass);
        const float back = (float)(ascc_pair_mass(mass, other) / other);
        r->weight[k] = weight;
        for (int c = 0; c < 3; c++) {
            by_weight[c] += weight * r->g[c][k];
            squares += back * r->g[c][k] * r->g[c][k];
        }
    }
    for (int c = 0; c < 3; c++) {
        r->push[c][i] = by_weight[c];
        along += by_weight[c] * r->own[c][i];
    }
    return (along > 0.0f ? along : 0.0f) + squares;
}

/* How fast the fluid becomes denser, in place of how dense it is. */
static void find_divergence(relaxation *r, size_t begin, size_t end)
{
    const ascc_gradients pairs = gradients(r);
    for (size_t i = begin; i < end; i++)
        if (r->excess[i] < -ASCC_SURFACE)
            r->response[i] = 0.0f;
    r->state->tools.kernels->divergence(&pairs, begin, end, r->own, r->move, r->excess);
    for (size_t i = begin; r->inflow && i < end; i++)
        if (r->wall_rows->count[i])
            r->excess[i] += r->inflow[i];
}

/* A row without pairs, which stays as it is. */
static void leave_out(relaxation *r, size_t i)
{
    r->start[i] = r->end[i] = 0;
    r->near[i] = 0;
    if (r->smoothing)
        r->smoothing[i] = 0.0f;
    r->excess[i] = r->response[i] = 0.0f;
    for (int c = 0; c < 3; c++)
        r->own[c][i] = r->push[c][i] = 0.0f;
}

/* Of a row with these squares of its gradients: so much that its pairs together take no more than there is, and
 * nothing at free surfaces. */
static float smoothing_of(const relaxation *r, size_t i, float squares)
{
    const float lattice = (float)r->constants->lattice_response;
    const ascc_relaxation *const *part = r->state->part;
    const float own = !r->share || part[0]->viscosity.count ? 1.0f : 0.0f;
    const float rest = r->share && part[1]->viscosity.count ? 1.0f : 0.0f;
    const float share = r->share ? r->share[i] * own + (1.0f - r->share[i]) * rest : own;
    return r->excess[i] < -ASCC_SURFACE ? 0.0f : share / (squares > lattice ? squares : lattice);
}

static void look_around(void *data, size_t begin, size_t end, int32_t slot)
{
    relaxation *r = data;
    float *scratch = r->scratch + (size_t)slot * 4 * r->room;
    pair_room *aside = &r->aside[slot];
    const float least = (float)(r->constants->epsilon * r->constants->lattice_response);
    for (size_t i = begin; i < end; i++) {
        float sum[8], wall[8] = {0};
        if (is_idle(r, i)) {
            leave_out(r, i);
            continue;
        }
        if (!begin_row(r, i, aside)) {
            aside->next = aside->end; /* it counts as used, and the row is looked at again */
            continue;
        }
        look(r, i, scratch, sum);
        aside->next = r->end[i];
        if (r->wall_rows->count[i])
            look_at_walls(r, i, scratch, wall);
        float square = sum[4];
        for (int c = 0; c < 3; c++) {
            r->own[c][i] = sum[1 + c] + wall[1 + c];
            square += r->own[c][i] * r->own[c][i];
        }
        if (!r->sum.uniform)
            square = weigh(r, i, wall + 1);
        r->excess[i] = (sum[0] + wall[0]) - 1.0f;
        if (r->smoothing)
            r->smoothing[i] = smoothing_of(r, i, sum[4]);
        r->response[i] = 1.0f / (square + least);
    }
    if (r->slows && atomic_load_explicit(&r->used, memory_order_relaxed) <= r->capacity)
        find_divergence(r, begin, end);
}

/* Finds the pairs; again with more room, if there is not enough. False without memory. */
static bool find_pairs(relaxation *r)
{
    ascc_workers *workers = r->state->tools.workers;
    for (;;) {
        memset(r->aside, 0, (size_t)ascc_workers_count(workers) * sizeof *r->aside);
        atomic_store(&r->used, 0);
        ascc_workers_run(workers, r->count, ROWS, look_around, r);
        const size_t used = atomic_load(&r->used);
        *r->state->expected_pairs = used;
        if (used <= r->capacity)
            return true;
        if (!take_pairs(r, used + used / 8))
            return false;
    }
}

/* Volumes of the walls that the step sees. */
static bool lend_volumes(relaxation *r)
{
    const ascc_hierarchy *h = &r->state->hierarchy;
    const size_t count = h->set[ASCC_SET_BOUNDARY].count;
    float *volume = room_for(r, count, sizeof *volume);
    for (size_t i = 0; volume && i < count; i++)
        volume[i] = r->state->wall_volume[ascc_hierarchy_wall_row(h, i)];
    r->wall_volume = volume;
    return volume != NULL;
}

/* Where walls end, of which the network saw where they were. */
static bool lend_wall_places(relaxation *r)
{
    const ascc_hierarchy *h = &r->state->hierarchy;
    const size_t count = h->set[ASCC_SET_BOUNDARY].count,
                 d = (size_t)r->state->particles->dimension;
    if (!r->state->advance.walls_move || r->state->motion->advection != ASCC_ADVECT_NONE)
        return true;
    for (size_t c = 0; c < 3; c++) {
        r->wall_low[c] = room_for(r, count, sizeof(int32_t));
        if (!r->wall_low[c])
            return false;
        for (size_t i = 0; i < count; i++) {
            const double *wall = r->state->advance.wall + ascc_hierarchy_wall_row(h, i) * d;
            int64_t at = h->set[ASCC_SET_BOUNDARY].position[c][i];
            if (c < d)
                (void)ascc_scale_apply(&h->scale, wall[c] * r->state->length_unit, &at);
            r->wall_low[c][i] = (int32_t)(uint32_t)(uint64_t)at;
        }
    }
    return true;
}

/* How far walls go in the step, if sweeps are on velocities. */
static bool lend_wall_moves(relaxation *r)
{
    const ascc_hierarchy *h = &r->state->hierarchy;
    const ascc_particles *p = r->state->particles;
    const size_t count = h->set[ASCC_SET_BOUNDARY].count, d = (size_t)p->dimension;
    const double unit = r->state->motion->time_step * r->state->length_unit / r->constants->support;
    if (!r->slows || !r->state->advance.walls_move)
        return true;
    r->inflow = ascc_arena_lend(r->state->tools.arena, r->count, sizeof *r->inflow);
    if (!r->inflow || !vector_room(r, r->wall_move, count))
        return false;
    for (size_t i = 0; i < count; i++)
        for (size_t c = 0; c < 3; c++)
            r->wall_move[c][i] =
                c < d ? (float)(p->wall_velocity[ascc_hierarchy_wall_row(h, i) * d + c] * unit)
                      : 0.0f;
    return true;
}

/* ---- A way back ---- */

/* What is known before the sweeps begin; false without memory. */
static bool begin_trace(const relaxation *r)
{
    ascc_relaxation_trace *t = r->trace;
    const ascc_sweeps *sweeps = r->slows ? &r->constants->divergence : &r->constants->pressure;
    const size_t n = r->count, count = (size_t)sweeps->count;
    int32_t *const *seen = r->state->hierarchy.set[ASCC_SET_BOUNDARY].low;
    float *move = room_for(r, n, 4 * sizeof *move);
    t->pressure = room_for(r, (count + 1) * n, sizeof *t->pressure);
    t->change = room_for(r, count * n, sizeof *t->change);
    t->push = room_for(r, count * n, 4 * sizeof *t->push);
    if (!move || !t->pressure || !t->change || !t->push)
        return false;
    memcpy(move, r->move, n * 4 * sizeof *move);
    for (int c = 0; c < 3; c++) {
        t->wall_low[c] = r->wall_low[0] ? r->wall_low[c] : seen[c];
        t->wall_move[c] = r->wall_move[c];
        t->own[c] = r->own[c];
    }
    t->pairs = gradients(r);
    t->wall_volume = r->wall_volume;
    t->excess = r->excess;
    t->response = r->response;
    t->near = r->near;
    t->move = move;
    t->low = r->low;
    return true;
}

/* Sweep k has been made of the pressures before it; k = -1: none yet. */
static void trace_sweep(const relaxation *r, int32_t k)
{
    ascc_relaxation_trace *t = r->trace;
    const size_t n = r->count, at = (size_t)(k + 1) * n;
    if (k < 0 && !r->guess) {
        memset(t->pressure, 0, n * sizeof *t->pressure);
        return;
    }
    memcpy(t->pressure + at, r->pressure, n * sizeof *t->pressure);
    if (k < 0)
        return;
    memcpy(t->change + at - n, r->change, n * sizeof *t->change);
    memcpy(t->push + 4 * (at - n), r->move, 4 * n * sizeof *t->push);
}

/* What pairs read of ghosts. sure: nothing can have failed since the last time. */
static ascc_halo_refresh fresh_pressure(const relaxation *r, bool sure)
{
    return (ascc_halo_refresh){ASCC_SET_FLUID, sure, 1, {{r->pressure, sizeof *r->pressure}}};
}

static ascc_halo_refresh fresh_move(const relaxation *r, bool sure)
{
    return (ascc_halo_refresh){ASCC_SET_FLUID, sure, 1, {{r->move, 4 * sizeof *r->move}}};
}

/* Everything that sweeps read. slows: of velocities. */
static ascc_status open_relaxation(relaxation *r, ascc_step_state *state, bool slows)
{
    ascc_relaxed *relaxed = &state->relaxed;
    const ascc_network_run *run = &state->run;
    const ascc_search_tools *tools = &state->tools;
    const ascc_relaxation *constants = state->relaxation;
    ascc_relaxation_round *round = &relaxed->round[relaxed->rounds - 1];
    *r =
        (relaxation){.state = state,
                     .constants = constants,
                     .share = state->part[0] ? state->shares : NULL,
                     .rows = round->rows[0],
                     .wall_rows = round->rows[1],
                     .count = state->hierarchy.set[ASCC_SET_FLUID].count,
                     .inverse_support = (float)(state->hierarchy.scale.unit / constants->support),
                     .repulsion = slows ? 0.0f : (float)(constants->repulsion / constants->support),
                     .slows = slows};
    if (state->network->keeps_values)
        r->trace = slows ? &relaxed->divergence : &round->trace;
    if (r->count > INT32_MAX)
        return ascc_fail(tools->message, ASCC_ERROR_RANGE, "more than 2^31 particles to relax");
    ascc_status status = ascc_find_wall_volumes(state, constants->support / state->length_unit);
    if (status == ASCC_OK)
        status = ascc_pair_sum_open(&r->sum, run, ASCC_SET_FLUID, state->particles->mass, 4);
    if (status != ASCC_OK)
        return status;
    if (!lend_volumes(r) || !lend_wall_places(r) || !lend_wall_moves(r) || !lend_memory(r))
        return no_memory(state);
    ascc_workers_run(tools->workers, r->count, 4 * ROWS, find_places, r);
    const size_t bad = atomic_load(&r->bad);
    if (bad) {
        const size_t row = ascc_hierarchy_host_row(&state->hierarchy, ASCC_SET_FLUID, bad - 1);
        return ascc_fail(tools->message, ASCC_ERROR_RANGE,
                         "fluid particle %" PRIu64
                         " (row %zu): the network takes it too far to relax",
                         state->particles->id[row], row);
    }
    const ascc_halo_refresh move = fresh_move(r, false);
    status = slows ? ascc_hierarchy_refresh(&state->hierarchy, &move) : ASCC_OK;
    if (status != ASCC_OK)
        return status;
    return !find_pairs(r) || (r->trace && !begin_trace(r)) ? no_memory(state) : ASCC_OK;
}

/* ---- Sweeps ---- */

/* Of rows [begin, end) those that are active; the others have none. */
static void push_active(relaxation *r, const ascc_gradients *pairs, size_t begin, size_t end)
{
    size_t pushed = 0;
    for (size_t i = begin, next; i < end; i = next) {
        next = ascc_active_run(r->active.pushed, i, end);
        if (r->active.pushed[i]) {
            r->state->tools.kernels->push(pairs, i, next, r->pressure, r->push, r->move);
            pushed += next - i;
        } else {
            memset(r->move + i * 4, 0, (next - i) * 4 * sizeof *r->move);
        }
    }
    atomic_fetch_add_explicit(&r->pushed, pushed, memory_order_relaxed);
}

static void diverge_active(const relaxation *r, const ascc_gradients *pairs, size_t begin,
                           size_t end)
{
    for (size_t i = begin, next; i < end; i = next) {
        next = ascc_active_run(r->active.moved, i, end);
        if (r->active.moved[i])
            r->state->tools.kernels->divergence(pairs, i, next, r->own, r->move, r->change);
        else
            memset(r->change + i, 0, (next - i) * sizeof *r->change);
    }
}

static void push_rows(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    relaxation *r = data;
    const ascc_gradients pairs = gradients(r);
    if (r->loose) {
        push_active(r, &pairs, begin, end);
        return;
    }
    r->state->tools.kernels->push(&pairs, begin, end, r->pressure, r->push, r->move);
    for (size_t i = begin; r->state->hierarchy.idle && i < end; i++)
        for (size_t c = 0; is_idle(r, i) && c < 4; c++)
            r->move[i * 4 + c] = 0.0f;
}

static float omega_of(const relaxation *r, size_t i)
{
    return r->share ? r->share[i] * r->omega + (1.0f - r->share[i]) * r->other : r->omega;
}

/* Sweep k of a model that may have fewer of them, and fewer rounds. */
static float omega_at(const relaxation *r, const ascc_relaxation *constants, int32_t k)
{
    const ascc_sweeps *sweeps = r->slows ? &constants->divergence : &constants->pressure;
    const bool runs = r->slows || r->state->relaxed.rounds <= constants->rounds;
    return runs && k < sweeps->count ? (float)sweeps->omega[k] : 0.0f;
}

static void begin_sweep(relaxation *r, int32_t k)
{
    const ascc_relaxation *const *part = r->state->part;
    r->omega = omega_at(r, part[0] ? part[0] : r->constants, k);
    r->other = part[0] ? omega_at(r, part[1], k) : 0.0f;
}

static void relax_rows(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    relaxation *r = data;
    const ascc_gradients pairs = gradients(r);
    size_t pressed = 0;
    if (r->few)
        diverge_active(r, &pairs, begin, end);
    else
        r->state->tools.kernels->divergence(&pairs, begin, end, r->own, r->move, r->change);
    for (size_t i = begin; i < end; i++) {
        const float pressure =
            r->pressure[i] + omega_of(r, i) * (r->excess[i] + r->change[i]) * r->response[i];
        r->pressure[i] = pressure > 0.0f ? pressure : 0.0f;
        pressed += pressure > 0.0f;
    }
    atomic_fetch_add_explicit(&r->pressed, pressed, memory_order_relaxed);
}

static void guess_rows(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    relaxation *r = data;
    const float unit = (float)(ascc_step_share(r->state) / r->constants->lattice_response);
    for (size_t i = begin; i < end; i++)
        r->pressure[i] = unit * r->guess[i];
}

/* The first sweep of all without a guess: nothing has moved yet. */
static void begin_rows(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    relaxation *r = data;
    size_t pressed = 0;
    for (size_t i = begin; i < end; i++) {
        const float pressure = omega_of(r, i) * r->excess[i] * r->response[i];
        r->change[i] = 0.0f;
        r->pressure[i] = pressure > 0.0f ? pressure : 0.0f;
        pressed += pressure > 0.0f;
    }
    atomic_fetch_add_explicit(&r->pressed, pressed, memory_order_relaxed);
}

/* Marks rows that the pressures push, where most have none. Rows without a turn of their own cannot mark theirs. */
static void look_for_active(relaxation *r, const ascc_gradients *pairs)
{
    const size_t pressed = atomic_exchange(&r->pressed, 0);
    if (r->slows || r->state->hierarchy.idle)
        return;
    if (r->loose ? 2 * pressed < r->pressed_first : (double)pressed < LOOSE * (double)r->count) {
        ascc_active_rows_clear(&r->active);
        r->pressed_first = pressed;
        r->loose = true;
    }
    if (r->loose)
        ascc_active_rows_press(&r->active, r->state->tools.workers, pairs, r->pressure);
    r->pressed_last = pressed;
}

/* Marks rows that the pushes move, if these will be few: where pressures are scattered, rows around them are many, and
 * around those there are all. */
static void look_for_moved(relaxation *r, const ascc_gradients *pairs)
{
    const double pushed = (double)atomic_exchange(&r->pushed, 0);
    const double around = pushed * pushed;
    r->few = r->loose && around < AROUND * (double)r->count * (double)r->pressed_last;
    if (r->few)
        ascc_active_rows_move(&r->active, r->state->tools.workers, pairs);
}

static ascc_status sweep(relaxation *r, const ascc_sweeps *sweeps)
{
    const ascc_gradients pairs = gradients(r);
    const ascc_hierarchy *h = &r->state->hierarchy;
    const ascc_search_tools *tools = &r->state->tools;
    const ascc_halo_refresh first = fresh_pressure(r, false), move = fresh_move(r, true),
                            pressure = fresh_pressure(r, true);
    ascc_status status = ASCC_OK;
    if (r->guess)
        status = ascc_early_rows_run(h, tools, 16 * ROWS, guess_rows, r, &first);
    if (r->trace) {
        r->trace->guessed = r->guess != NULL;
        trace_sweep(r, -1);
    }
    for (int32_t k = 0; k < sweeps->count && status == ASCC_OK; k++) {
        begin_sweep(r, k);
        if (k > 0 || r->guess) {
            (void)ascc_early_rows_run(h, tools, ROWS, push_rows, r, &move);
            look_for_moved(r, &pairs);
            (void)ascc_early_rows_run(h, tools, ROWS, relax_rows, r, &pressure);
        } else {
            status = ascc_early_rows_run(h, tools, 16 * ROWS, begin_rows, r, &first);
        }
        look_for_active(r, &pairs);
        if (r->trace)
            trace_sweep(r, k);
    }
    return status;
}

/* ---- Impulses ---- */

/* Unit vectors times what pairs that are too near lack, all in supports; 0 for the others. */
static bool find_repulsion(const relaxation *r, const ascc_pairs *pairs, size_t count,
                           float apart[3][ASCC_PAIR_BATCH])
{
    const float distance = r->repulsion, share = (float)(0.5 * r->constants->stiffness);
    bool any = false;
    for (size_t k = 0; k < count; k++)
        any |= pairs->distance[k] < distance;
    for (size_t k = 0; any && k < count; k++) {
        const float lack = distance - pairs->distance[k];
        const float size = lack > 0.0f ? share * lack : 0.0f;
        apart[0][k] = size * pairs->x[k];
        apart[1][k] = size * pairs->y[k];
        apart[2][k] = size * pairs->z[k];
    }
    return any;
}

/* Turned to lie along the lines between the places: no torque about these. */
static void turn(const relaxation *r, size_t i, const ascc_pair_batch *b,
                 float term[ASCC_PAIR_BATCH][4])
{
    for (size_t k = 0; k < b->count; k++) {
        const double *here = r->place + i * 3, *there = r->place + (size_t)b->neighbor[k] * 3;
        double line[3], square = 0.0, along = 0.0;
        for (int c = 0; c < 3; c++) {
            line[c] = there[c] - here[c];
            square += line[c] * line[c];
            along += line[c] * (double)term[k][c];
        }
        for (int c = 0; c < 3; c++)
            term[k][c] = square > 0.0 ? (float)(along / square * line[c]) : 0.0f;
    }
}

/* Corrections of row i by the pairs of a batch, in supports; no pair gives more than the limit, no wall more
 * than its share of it: of walls twice as dense each has half. */
static void corrections(const relaxation *r, size_t i, ascc_pair_batch *b, bool walls,
                        float term[ASCC_PAIR_BATCH][4])
{
    float geometry[4][ASCC_PAIR_BATCH], apart[3][ASCC_PAIR_BATCH], sum[8];
    const ascc_kernels *kernels = r->state->tools.kernels;
    const ascc_pairs pairs = {
        .x = geometry[0], .y = geometry[1], .z = geometry[2], .distance = geometry[3]};
    const float limit = (float)(r->constants->limit / r->constants->support);
    const float amount = (float)r->constants->amount;
    find_directions(r, i, walls, b->neighbor, b->count, &pairs);
    const bool near = !walls && find_repulsion(r, &pairs, b->count, apart);
    kernels->spline(&pairs, b->neighbor, b->count, amount, walls ? r->wall_volume : NULL, sum);
    for (size_t k = 0; k < b->count; k++) {
        const float p = r->pressure[i] + (walls ? 0.0f : r->pressure[b->neighbor[k]]);
        float size = 0.0f;
        for (int c = 0; c < 3; c++) {
            term[k][c] = -(p * geometry[c][k] + (near ? apart[c][k] : 0.0f));
            size += term[k][c] * term[k][c];
        }
        term[k][3] = 0.0f;
        const float most = walls ? limit * (r->wall_volume[b->neighbor[k]] / amount) : limit;
        if (size > most * most) {
            const float share = most / sqrtf(size);
            for (int c = 0; c < 3; c++)
                term[k][c] *= share;
        }
    }
    if (r->place && !walls)
        turn(r, i, b, term);
}

/* Is one of the pairs with a row that has no turn of its own? */
static bool touches_idle(const relaxation *r, size_t i)
{
    bool touches = false;
    for (size_t k = r->start[i]; r->state->hierarchy.idle && k < r->end[i]; k++)
        touches |= is_idle(r, r->neighbor[k]);
    return touches;
}

/* Of a row without repulsion what was kept is all. */
static bool evaluate_kept(ascc_pair_sum *sum, size_t i)
{
    const relaxation *r = sum->data;
    if (r->near[i] || touches_idle(r, i))
        return false;
    if (r->loose && !r->active.pushed[i])
        return true;
    const ascc_gradients pairs = gradients(r);
    const ascc_pressures pressures = {.pressure = r->pressure,
                                      .limit = (float)(r->constants->limit / r->constants->support),
                                      .factor = ascc_relaxation_quanta(r->state),
                                      .mass = sum->mass,
                                      .uniform = sum->uniform,
                                      .place = r->place};
    if (!r->state->tools.kernels->pressure_impulses(&pairs, &pressures, i, ASCC_IMPULSE_LIMIT,
                                                    sum->sum))
        ascc_pair_sum_note_bad(sum, i);
    return true;
}

static void evaluate(ascc_pair_sum *sum, size_t i, ascc_pair_batch *b)
{
    const relaxation *r = sum->data;
    const double f = ascc_relaxation_quanta(r->state), factor[4] = {f, f, f, 0.0};
    float term[ASCC_PAIR_BATCH][4];
    double mass[ASCC_PAIR_BATCH];
    corrections(r, i, b, false, term);
    mass[0] = sum->mass[i];
    for (size_t k = 0; k < b->count && !sum->uniform; k++)
        mass[k] = ascc_pair_mass(sum->mass[i], sum->mass[b->neighbor[k]]);
    if (!r->state->tools.kernels->pair_impulses(term[0], factor, mass, !sum->uniform,
                                                ASCC_IMPULSE_LIMIT, b->neighbor, b->count,
                                                sum->sum + i * 4, sum->sum))
        ascc_pair_sum_note_bad(sum, i);
}

static void evaluate_walls(ascc_pair_sum *sum, size_t i, ascc_pair_batch *b)
{
    const relaxation *r = sum->data;
    const double factor = ascc_relaxation_quanta(r->state) * sum->mass[i];
    float term[ASCC_PAIR_BATCH][4];
    double impulse[3][ASCC_PAIR_BATCH];
    if (r->pressure[i] == 0.0f)
        return;
    corrections(r, i, b, true, term);
    for (int c = 0; c < 3; c++)
        for (size_t k = 0; k < b->count; k++)
            impulse[c][k] = factor * (double)term[k][c];
    ascc_pair_sum_add_walls(sum, i, b, impulse);
}

/* Impulses of the pressure: of walls added to theirs, of the fluid into given[host's rows][dimension]. */
static ascc_status apply(relaxation *r, int64_t *given)
{
    const ascc_impulses to = {given, r->state->impulses.wall};
    uint64_t pairs;
    r->sum.data = r;
    r->sum.whole = evaluate_kept;
    r->sum.skip_coincident = false; /* where the network saw them; now they may be apart */
    ascc_pair_sum_run(&r->sum, r->rows, evaluate);
    ascc_pair_sum_run_walls(&r->sum, r->wall_rows, r->state->impulses.wall, evaluate_walls);
    const size_t bad = atomic_load(&r->sum.bad_row);
    if (bad)
        return ascc_fail(r->state->tools.message, ASCC_ERROR_RANGE,
                         "the relaxation gives fluid row %zu an impulse too large to hold",
                         ascc_hierarchy_host_row(&r->state->hierarchy, ASCC_SET_FLUID, bad - 1));
    return ascc_pair_sum_give(&r->sum, r->pressure, 1, &to, &pairs);
}

/* ---- The stages ---- */

/* Does another round change this row? */
static bool goes_on(const relaxation *r, size_t i)
{
    const ascc_relaxation *const *part = r->state->part;
    const int32_t most = r->constants->rounds;
    return !r->share || (r->share[i] >= 0.5f && part[0]->rounds == most) ||
           (r->share[i] <= 0.5f && part[1]->rounds == most);
}

/* Mean of what is left of the excess as the last sweep began, and the largest of rows that go on. */
static void measure_rows(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    relaxation *r = data;
    uint64_t sum = 0, largest = 0;
    for (size_t i = begin; i < end; i++) {
        const float c = r->excess[i] + r->change[i];
        const uint64_t units = c > 0.0f ? (uint64_t)((double)c / COMPRESSION_UNIT) : 0;
        sum += units;
        largest = units > largest && goes_on(r, i) ? units : largest;
    }
    atomic_fetch_add_explicit(&r->compression, sum, memory_order_relaxed);
    uint_least64_t seen = atomic_load_explicit(&r->largest, memory_order_relaxed);
    while (seen < largest &&
           !atomic_compare_exchange_weak_explicit(&r->largest, &seen, largest, memory_order_relaxed,
                                                  memory_order_relaxed))
        ;
}

static ascc_status measure(relaxation *r, ascc_compression *to)
{
    ascc_halo *halo = r->state->halo;
    size_t count = r->count;
    atomic_store(&r->compression, 0);
    atomic_store(&r->largest, 0);
    ascc_workers_run(r->state->tools.workers, r->count, 16 * ROWS, measure_rows, r);
    uint64_t sum = atomic_load(&r->compression), largest = atomic_load(&r->largest);
    if (halo) {
        ascc_status status = halo->sum(halo, &sum, 1);
        if (status == ASCC_OK)
            status = halo->largest(halo, &largest, 1);
        if (status != ASCC_OK)
            return status;
        count = halo->total;
    }
    to->mean = COMPRESSION_UNIT * (double)sum / (double)count;
    to->largest = COMPRESSION_UNIT * (double)largest;
    return ASCC_OK;
}

/* Room for impulses, [host's rows][dimension]: that of the velocities that the network saw, which nothing reads any more. */
static int64_t *given_of(const ascc_step_state *state)
{
    return (int64_t *)(void *)state->advance.velocity;
}

/* Positions before the step; false without memory. */
static bool find_lines(relaxation *r)
{
    const ascc_particles *p = r->state->particles;
    const size_t d = (size_t)p->dimension;
    if (!r->constants->current_direction)
        return true;
    double *place = ascc_arena_lend(r->state->tools.arena, r->count, 3 * sizeof *place);
    for (size_t i = 0; place && i < r->count; i++) {
        const size_t row = ascc_hierarchy_host_row(&r->state->hierarchy, ASCC_SET_FLUID, i);
        for (size_t c = 0; c < 3; c++)
            place[i * 3 + c] = c < d ? p->position[row * d + c] : 0.0;
    }
    r->place = place;
    return place != NULL;
}

/* The neighbours that the next round begins with: the network's lists, and once particles have been moved far,
 * new ones. */
static ascc_status begin_round(ascc_step_state *state)
{
    ascc_relaxed *relaxed = &state->relaxed;
    ascc_relaxation_round *round = &relaxed->round[relaxed->rounds++];
    for (int i = 0; i < 2; i++)
        round->rows[i] = relaxed->rounds == 1 ? &state->run.rows[state->network->relaxation_key[i]]
                                              : (round - 1)->rows[i];
    if (relaxed->rounds == 2)
        return ascc_relaxation_pairs_find(state, round->rows);
    return ASCC_OK;
}

static ascc_status relax(ascc_step_state *state, relaxation *r, int64_t *given,
                         ascc_compression *found)
{
    ascc_step_statistics *s = state->statistics;
    const bool first = state->relaxed.rounds == 1;
    ascc_status status = open_relaxation(r, state, false);
    if (status == ASCC_OK && !find_lines(r))
        status = no_memory(state);
    if (status != ASCC_OK)
        return status;
    if (first)
        r->guess = state->run.guess;
    memset(r->change, 0, r->count * sizeof *r->change);
    status = measure(r, found);
    if (status == ASCC_OK && first)
        s->compression_before = *found;
    if (status == ASCC_OK && !first && found->largest <= r->constants->left) {
        state->relaxed.round[--state->relaxed.rounds].trace.low = NULL; /* as if it had not begun */
        return ASCC_OK;
    }
    if (status == ASCC_OK)
        status = sweep(r, &r->constants->pressure);
    if (status == ASCC_OK)
        status = measure(r, &s->compression_after);
    s->sweeps = (uint64_t)(state->relaxed.rounds * r->constants->pressure.count);
    if (status == ASCC_OK)
        status = apply(r, given);
    return status == ASCC_OK ? ascc_advance_further(state, given) : status;
}

/* found: the compression that it begins with. */
static ascc_status run_round(ascc_step_state *state, ascc_compression *found)
{
    ascc_status status = begin_round(state);
    if (status != ASCC_OK)
        return status;
    const ascc_arena_mark mark = ascc_arena_mark_of(state->tools.arena);
    relaxation r;
    status = relax(state, &r, given_of(state), found);
    ascc_arena_return(state->tools.arena, mark);
    return status;
}

ascc_status ascc_stage_relaxation(ascc_step_state *state)
{
    const ascc_relaxation *constants = state->relaxation;
    if (!constants->pressure.count || ascc_step_is_empty(state))
        return ASCC_OK;
    ascc_compression found;
    ascc_status status = run_round(state, &found);
    while (status == ASCC_OK && state->relaxed.rounds < constants->rounds &&
           found.largest > constants->again) {
        status = ascc_stage_contact(state); /* the next one begins where walls let particles be */
        if (status == ASCC_OK)
            status = run_round(state, &found);
    }
    ascc_stage_lap(state, "relaxation");
    return status;
}

static ascc_status slow_down(ascc_step_state *state, relaxation *r, int64_t *given)
{
    ascc_status status = open_relaxation(r, state, true);
    if (status != ASCC_OK)
        return status;
    status = sweep(r, &r->constants->divergence);
    if (status == ASCC_OK && r->constants->divergence.count) {
        status = apply(r, given);
        if (status == ASCC_OK)
            status = ascc_relaxation_add(state, given);
    }
    if (status != ASCC_OK || !r->smoothing)
        return status;
    float *weight = r->g[0]; /* which nothing reads any more but a way back */
    if (r->trace)
        weight = room_for(r, r->capacity, sizeof *weight);
    if (!weight)
        return no_memory(state);
    const ascc_smoothing smoothing = {.state = state,
                                      .pairs = gradients(r),
                                      .rows = r->rows,
                                      .sum = &r->sum,
                                      .coefficient = r->smoothing,
                                      .weight = weight,
                                      .count = r->count,
                                      .trace = r->trace,
                                      .given = given};
    return ascc_smooth_velocities(&smoothing);
}

ascc_status ascc_stage_divergence(ascc_step_state *state)
{
    const ascc_relaxation *constants = state->relaxation;
    if (!(constants->divergence.count || constants->viscosity.count) || ascc_step_is_empty(state))
        return ASCC_OK;
    const ascc_arena_mark mark = ascc_arena_mark_of(state->tools.arena);
    relaxation r;
    const ascc_status status = slow_down(state, &r, given_of(state));
    ascc_arena_return(state->tools.arena, mark);
    ascc_stage_lap(state, "divergence");
    return status;
}
