/* The adjoint of the relaxation (step/relaxation.c has the formulas; docs/training.md), from what its sweeps left.
 * SPDX-License-Identifier: MIT
 *
 * With P the map from pressures to pushes, d = -P p, the sweeps are p' = max(0, p + omega (c - P^T P p) r),
 * r the responses: so a sweep's way back is made of the same two maps, on the same pairs, by the same kernels.
 *
 * The pairs' gradients g collect their own from every sweep: of a divergence of moves m, c_i (m_i - m_j), and of
 * pushes by p, -(p_i + p_j) b_i, with c and b the gradients of divergence and push. Both sides of a pair
 * together give (c_i + c_j) (m_i - m_j) - (p_i + p_j) (b_i - b_j). So each sweep leaves its four with the rows, and
 * all of them go to positions in one pass over unordered pairs.
 */
#include "relaxation_reverse.h"

#include <math.h>
#include <string.h>

#include "hyperviscosity_reverse.h"
#include "model/relaxation.h"

/* What a sweep leaves with a row: (c_i + c_j) times the difference of moves, and likewise of pushes. */
typedef struct side {
    float move[3], by_change;
    float by_push[3], pressure; /* by_push: its negative */
} side;

/* What a row has but for those. */
typedef struct head {
    float response[3], twice; /* 2 by_square times own; 2 by_square */
    float density;            /* gradient of it */
} head;

/* Pairs of a row and what they are made of. */
typedef struct batch {
    size_t count;
    uint32_t neighbor[ASCC_PAIR_BATCH];
    float x[ASCC_PAIR_BATCH], y[ASCC_PAIR_BATCH], z[ASCC_PAIR_BATCH], distance[ASCC_PAIR_BATCH];
    float slope[ASCC_PAIR_BATCH], curvature[ASCC_PAIR_BATCH]; /* of the spline, times the volume */
} batch;

typedef struct reverse {
    const ascc_step_state *state;
    const ascc_relaxation *constants;
    const ascc_sweeps *sweeps;
    const ascc_rows *wall_rows;
    const ascc_relaxation_trace *trace;
    ascc_arena *arena;
    size_t count, d;
    double unit; /* supports of a unit of the host */
    float limit, amount, repulsion, share, inverse_support;
    const double *before; /* [row][3] before the step, if corrections lie along those lines */
    side *side;           /* [row][sides] */
    size_t sides, used;
    head *head; /* [row] */
    /* Of squares of the pairs' gradients, from a hyperviscosity: [row] of their sums, [pair]; else NULL. */
    const float *by_squares, *by_square;
    /* Gradients, [row], [row][3] or rows of 4: */
    float *by_pressure, *by_change, *by_excess, *by_response, *by_push, *divergence;
    float *by;         /* of the corrections */
    float *by_place;   /* [row][3] */
    double *by_before; /* [row][3] likewise of `before` */
    /* Of what scales with the rest volume, by its logarithm; of the lattice's response; of epsilon and the sweeps: */
    double *by_volume, *by_lattice, *by_epsilon, *by_omega;
} reverse;

static float dot(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static float *zeros(const reverse *r, size_t each)
{
    float *taken = ascc_arena_take(r->arena, r->count * each + 1, sizeof *taken);
    if (taken)
        memset(taken, 0, r->count * each * sizeof *taken);
    return taken;
}

static size_t host_row(const reverse *r, size_t i)
{
    return ascc_hierarchy_host_row(&r->state->hierarchy, ASCC_SET_FLUID, i);
}

/* ---- Pairs ---- */

/* Slopes and curvatures of a batch of unit volumes. */
static void find_spline(batch *b)
{
    for (size_t k = 0; k < b->count; k++) {
        const float q = b->distance[k], far = 1.0f - q;
        const float near = q < 0.5f ? 0.5f - q : 0.0f;
        b->slope[k] = -6.0f * (far * far - 4.0f * near * near);
        b->curvature[k] = 12.0f * (far - 4.0f * near);
    }
}

static float spline_of(float q)
{
    const float far = 1.0f - q, near = q < 0.5f ? 0.5f - q : 0.0f;
    return 2.0f * far * far * far - 8.0f * near * near * near;
}

/* The pairs of row i whose neighbours come after it, from *at on; false if there are none left. */
static bool next_pairs(const reverse *r, size_t i, size_t *at, batch *b)
{
    const ascc_relaxation_trace *t = r->trace;
    const size_t end = t->pairs.end[i];
    const ascc_pairs pairs = {.x = b->x, .y = b->y, .z = b->z, .distance = b->distance};
    b->count = 0;
    while (*at < end && b->count < ASCC_PAIR_BATCH) {
        const uint32_t j = t->pairs.neighbor[(*at)++];
        b->neighbor[b->count] = j;
        b->count += j > i;
    }
    if (!b->count)
        return false;
    r->state->tools.kernels->directions(t->low, b->neighbor, b->count, t->low + i * 4,
                                        r->inverse_support, &pairs);
    find_spline(b);
    for (size_t k = 0; k < b->count; k++) {
        b->slope[k] *= r->amount;
        b->curvature[k] *= r->amount;
    }
    return true;
}

/* The same of walls within the support: those that are not have no slope. */
static bool next_walls(const reverse *r, size_t i, size_t *at, batch *b)
{
    const ascc_relaxation_trace *t = r->trace;
    const ascc_rows *rows = r->wall_rows;
    const ascc_coordinates points = {t->wall_low[0], t->wall_low[1], t->wall_low[2]};
    const ascc_pairs pairs = {.x = b->x, .y = b->y, .z = b->z, .distance = b->distance};
    const int32_t *place = t->low + i * 4;
    if (*at >= rows->count[i])
        return false;
    b->count = ascc_min_size(ASCC_PAIR_BATCH, rows->count[i] - *at);
    memcpy(b->neighbor, rows->neighbor + rows->start[i] + *at, b->count * sizeof *b->neighbor);
    *at += b->count;
    r->state->tools.kernels->geometry(&points, b->neighbor, b->count, place[0], place[1], place[2],
                                      r->inverse_support, ASCC_MAPPING_DIRECTION, &pairs);
    find_spline(b);
    for (size_t k = 0; k < b->count; k++) {
        const bool acts = b->distance[k] > 0.0f && b->distance[k] < 1.0f;
        const float volume = acts ? t->wall_volume[b->neighbor[k]] : 0.0f;
        b->slope[k] *= volume;
        b->curvature[k] *= volume;
    }
    return true;
}

/* to = along u (u . a) + across (a - u (u . a)) */
static void bend(const float u[3], float along, float across, const float a[3], float to[3])
{
    const float radial = (along - across) * dot(u, a);
    for (int c = 0; c < 3; c++)
        to[c] = across * a[c] + radial * u[c];
}

/* To the places of both sides from the gradient of the vector between them. */
static void add_places(const reverse *r, size_t i, size_t j, const float by_difference[3])
{
    for (size_t c = 0; c < 3; c++) {
        r->by_place[i * 3 + c] -= by_difference[c];
        r->by_place[j * 3 + c] += by_difference[c];
    }
}

/* ---- What is applied ---- */

/* The gradient of a correction before it was turned to the line of the places before the step; that of the
 * line is added to these. */
static void unturn(const reverse *r, size_t i, size_t j, const float correction[3], float by[3])
{
    double line[3], square = 0.0, along = 0.0, turned = 0.0;
    for (size_t c = 0; c < 3; c++) {
        line[c] = r->before[j * 3 + c] - r->before[i * 3 + c];
        square += line[c] * line[c];
        along += line[c] * (double)by[c];
        turned += line[c] * (double)correction[c];
    }
    const double scale = square > 0.0 ? 1.0 / square : 0.0;
    along *= scale;
    turned *= scale;
    for (size_t c = 0; c < 3; c++) {
        const double by_line =
            (double)by[c] * turned + (double)correction[c] * along - 2.0 * along * turned * line[c];
        r->by_before[i * 3 + c] -= by_line;
        r->by_before[j * 3 + c] += by_line;
        by[c] = (float)(along * line[c]);
    }
}

/* The gradient of a correction before it was limited. */
static void unlimit(const float correction[3], float limit, float by[3])
{
    const float square = dot(correction, correction);
    if (!(square > limit * limit))
        return;
    const float share = limit / sqrtf(square), along = dot(correction, by) / square;
    for (int c = 0; c < 3; c++)
        by[c] = share * (by[c] - along * correction[c]);
}

/* Pairs of the fluid count as if nothing were turned, limited or repelled: what these change. by: of both sides, the
 * difference. */
static void mend_pair(const reverse *r, size_t i, const batch *b, size_t k, float pressure)
{
    const size_t j = b->neighbor[k];
    const float u[3] = {b->x[k], b->y[k], b->z[k]}, q = b->distance[k];
    const float lack = r->repulsion - q, apart = lack > 0.0f ? r->share * lack : 0.0f;
    const float size = apart - pressure * b->slope[k];
    float correction[3], by[3], one[3], rest[3], back[3];
    for (size_t c = 0; c < 3; c++) {
        correction[c] = -size * u[c];
        one[c] = by[c] = r->by[i * 4 + c] - r->by[j * 4 + c];
    }
    if (r->before) {
        const float length = fabsf(size), share = length > r->limit ? r->limit / length : 1.0f;
        for (int c = 0; c < 3; c++)
            back[c] = share * correction[c];
        unturn(r, i, j, back, one);
    }
    unlimit(correction, r->limit, one);
    for (int c = 0; c < 3; c++)
        rest[c] = by[c] - one[c];
    const float by_pressure = -b->slope[k] * dot(u, rest);
    *r->by_volume += (double)(pressure * by_pressure);
    r->by_pressure[i] += by_pressure;
    r->by_pressure[j] += by_pressure;
    bend(u, -b->curvature[k] * pressure, -b->slope[k] / q * pressure, rest, back);
    add_places(r, i, j, back);
    if (apart > 0.0f) {
        bend(u, r->share, -apart / q, one, back);
        add_places(r, i, j, back);
    }
}

static void mend_pairs(const reverse *r, size_t i, const float *pressure)
{
    batch b;
    for (size_t at = r->trace->pairs.start[i]; next_pairs(r, i, &at, &b);)
        for (size_t k = 0; k < b.count; k++)
            mend_pair(r, i, &b, k, pressure[i] + pressure[b.neighbor[k]]);
}

static void mend_walls(const reverse *r, size_t i, float pressure)
{
    batch b;
    for (size_t at = 0; next_walls(r, i, &at, &b);)
        for (size_t k = 0; k < b.count; k++) {
            const float u[3] = {b.x[k], b.y[k], b.z[k]};
            const float limit = r->limit * r->trace->wall_volume[b.neighbor[k]] / r->amount;
            float correction[3], one[3], rest[3], back[3];
            if (b.slope[k] == 0.0f)
                continue;
            for (size_t c = 0; c < 3; c++) {
                correction[c] = pressure * b.slope[k] * u[c];
                one[c] = r->by[i * 4 + c];
            }
            unlimit(correction, limit, one);
            if (dot(correction, correction) >
                limit * limit) /* walls' share goes with 1 over the volume */
                *r->by_volume -= (double)(limit / sqrtf(dot(correction, correction)) *
                                          dot(r->by + i * 4, correction));
            for (size_t c = 0; c < 3; c++)
                rest[c] = r->by[i * 4 + c] - one[c];
            r->by_pressure[i] -= b.slope[k] * dot(u, rest);
            bend(u, -b.curvature[k] * pressure, -b.slope[k] / b.distance[k] * pressure, rest, back);
            for (size_t c = 0; c < 3; c++)
                r->by_place[i * 3 + c] -= back[c];
        }
}

/* Can a pair of this row be turned, limited or repelled? Slopes are at most 2 volumes. */
static bool is_special(const reverse *r, size_t i, const float *pressure)
{
    const ascc_gradients *pairs = &r->trace->pairs;
    float most = pressure[i];
    if (r->before || (r->repulsion > 0.0f && r->trace->near[i]))
        return true;
    for (size_t k = pairs->start[i]; k < pairs->end[i]; k++)
        most = pressure[pairs->neighbor[k]] > most ? pressure[pairs->neighbor[k]] : most;
    return 2.0f * r->amount * (pressure[i] + most) > 0.99f * r->limit;
}

static side *next_side(reverse *r)
{
    return r->side + r->used++;
}

/* Back through the one application of the last pressures. */
static void apply_back(reverse *r)
{
    const float *pressure = r->trace->pressure + (size_t)r->sweeps->count * r->count;
    side *to = next_side(r);
    r->state->tools.kernels->divergence(&r->trace->pairs, 0, r->count, r->trace->own, r->by,
                                        r->by_pressure);
    for (size_t i = 0; i < r->count; i++) {
        r->by_pressure[i] = -r->by_pressure[i];
        to[i * r->sides] = (side){.by_push = {-r->by[i * 4], -r->by[i * 4 + 1], -r->by[i * 4 + 2]},
                                  .pressure = pressure[i]};
    }
    for (size_t i = 0; i < r->count; i++) {
        if (is_special(r, i, pressure))
            mend_pairs(r, i, pressure);
        if (2.0f * r->amount * pressure[i] > 0.99f * r->limit)
            mend_walls(r, i, pressure[i]);
    }
}

/* ---- Sweeps ---- */

/* Back through sweep s: by_pressure of what it left becomes that of what it began with. */
static void sweep_back(reverse *r, int32_t s)
{
    const ascc_relaxation_trace *t = r->trace;
    const ascc_kernels *kernels = r->state->tools.kernels;
    const float *pressure = t->pressure + (size_t)s * r->count, *next = pressure + r->count;
    const float *change = t->change + (size_t)s * r->count;
    const float *pushes = t->push + (size_t)s * r->count * 4;
    const float omega = (float)r->sweeps->omega[s];
    const bool moved = s > 0 || t->guessed;
    for (size_t i = 0; i < r->count; i++) {
        r->by_pressure[i] = next[i] > 0.0f ? r->by_pressure[i] : 0.0f;
        const float by = omega * r->by_pressure[i];
        const float left = t->excess[i] + (moved ? change[i] : 0.0f);
        r->by_omega[s] += (double)(r->by_pressure[i] * left * t->response[i]);
        r->by_response[i] += by * left;
        r->by_change[i] = by * t->response[i];
        r->by_excess[i] += r->by_change[i];
    }
    if (!moved)
        return;
    kernels->push(&t->pairs, 0, r->count, r->by_change, t->own, r->by_push);
    kernels->divergence(&t->pairs, 0, r->count, t->own, r->by_push, r->divergence);
    side *to = next_side(r);
    for (size_t i = 0; i < r->count; i++) {
        side *one = &to[i * r->sides];
        memcpy(one->move, pushes + i * 4, sizeof one->move);
        one->by_change = r->by_change[i];
        memcpy(one->by_push, r->by_push + i * 4, sizeof one->by_push);
        one->pressure = pressure[i];
        r->by_pressure[i] += r->divergence[i];
    }
}

static void sweeps_back(reverse *r)
{
    for (int32_t s = r->sweeps->count; s > 0; s--)
        sweep_back(r, s - 1);
}

/* ---- Places ---- */

/* Responses and, if they are what sweeps reduced, densities. */
static void fill_heads(const reverse *r, bool densities)
{
    const ascc_relaxation_trace *t = r->trace;
    double by_softening = 0.0;
    for (size_t i = 0; i < r->count; i++) {
        head *to = &r->head[i];
        to->twice = -2.0f * r->by_response[i] * t->response[i] * t->response[i];
        for (int c = 0; c < 3; c++)
            to->response[c] = to->twice * t->own[c][i];
        to->twice += r->by_squares ? 2.0f * r->by_squares[i] : 0.0f;
        to->density = densities ? r->by_excess[i] : 0.0f;
        *r->by_volume += (double)(to->density * r->amount); /* of itself */
        by_softening -= (double)(r->by_response[i] * t->response[i] * t->response[i]);
    }
    *r->by_epsilon += by_softening * r->constants->lattice_response;
    *r->by_lattice += by_softening * r->constants->epsilon;
}

/* Adds what a pair's gradient has from all sweeps, both sides together. */
static void add_sides(const side *restrict a, const side *restrict b, size_t count,
                      float to[restrict 3])
{
    for (size_t s = 0; s < count; s++) {
        const float change = a[s].by_change + b[s].by_change;
        const float pressure = a[s].pressure + b[s].pressure;
        for (int c = 0; c < 3; c++)
            to[c] += change * (a[s].move[c] - b[s].move[c]) +
                     pressure * (a[s].by_push[c] - b[s].by_push[c]);
    }
}

/* pair: how many pairs came before. */
static void pass_pairs(const reverse *r, size_t i, batch *b, size_t *pair)
{
    const side *own = r->side + i * r->sides;
    const head *here = &r->head[i];
    for (size_t at = r->trace->pairs.start[i]; next_pairs(r, i, &at, b);)
        for (size_t k = 0; k < b->count; k++, (*pair)++) {
            const size_t j = b->neighbor[k];
            const head *there = &r->head[j];
            const float u[3] = {b->x[k], b->y[k], b->z[k]};
            const float own_square = r->by_square ? 2.0f * r->by_square[*pair] : 0.0f;
            float by[3], by_difference[3];
            for (int c = 0; c < 3; c++)
                by[c] = here->response[c] - there->response[c];
            add_sides(own, r->side + j * r->sides, r->used, by);
            bend(u, -b->curvature[k], -b->slope[k] / b->distance[k], by, by_difference);
            const float twice = here->twice + there->twice + own_square;
            const float density = here->density + there->density;
            const float radial = b->slope[k] * (b->curvature[k] * twice + density);
            *r->by_volume += (double)(b->slope[k] * (twice * b->slope[k] - dot(by, u)) +
                                      density * r->amount * spline_of(b->distance[k]));
            for (int c = 0; c < 3; c++)
                by_difference[c] += radial * u[c];
            add_places(r, i, j, by_difference);
        }
}

/* The same for the row's side alone; and what walls that move add to its divergence. */
static void pass_walls(const reverse *r, size_t i, batch *b)
{
    const side *own = r->side + i * r->sides, none[ASCC_MAX_SWEEPS + 2] = {0};
    const head *here = &r->head[i];
    const float *const *move = r->trace->wall_move;
    float all[3] = {here->response[0], here->response[1], here->response[2]};
    add_sides(own, none, r->used, all);
    for (size_t at = 0; next_walls(r, i, &at, b);)
        for (size_t k = 0; k < b->count; k++) {
            const float u[3] = {b->x[k], b->y[k], b->z[k]};
            float by[3], by_difference[3];
            if (b->slope[k] == 0.0f)
                continue;
            for (int c = 0; c < 3; c++)
                by[c] = all[c] - (move[0] ? r->by_excess[i] * move[c][b->neighbor[k]] : 0.0f);
            bend(u, -b->curvature[k], -b->slope[k] / b->distance[k], by, by_difference);
            for (size_t c = 0; c < 3; c++)
                r->by_place[i * 3 + c] -= by_difference[c] + here->density * b->slope[k] * u[c];
        }
}

static void geometry_back(const reverse *r, bool densities)
{
    batch b;
    size_t pair = 0;
    fill_heads(r, densities);
    for (size_t i = 0; i < r->count; i++) {
        pass_pairs(r, i, &b, &pair);
        if (r->wall_rows->count[i])
            pass_walls(r, i, &b);
    }
}

/* ---- Rounds ---- */

static bool open_reverse(reverse *r, const ascc_step_state *state, ascc_arena *arena,
                         const ascc_sweeps *sweeps, const ascc_relaxation_trace *trace,
                         const ascc_rows *wall_rows)
{
    const ascc_relaxation *constants = &state->network->plan->relaxation;
    *r = (reverse){.state = state,
                   .constants = constants,
                   .sweeps = sweeps,
                   .wall_rows = wall_rows,
                   .trace = trace,
                   .arena = arena,
                   .count = state->hierarchy.set[ASCC_SET_FLUID].count,
                   .d = (size_t)state->particles->dimension,
                   .unit = state->length_unit / constants->support,
                   .limit = (float)(constants->limit / constants->support),
                   .amount = (float)constants->amount,
                   .share = (float)(0.5 * constants->stiffness),
                   .inverse_support = (float)(state->hierarchy.scale.unit / constants->support),
                   .sides = (size_t)sweeps->count + 2};
    float **const numbers[] = {&r->by_pressure, &r->by_change, &r->by_excess, &r->by_response,
                               &r->divergence};
    bool room = true;
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
        room &= (*numbers[i] = zeros(r, 1)) != NULL;
    r->side = ascc_arena_take(arena, r->count, r->sides * sizeof *r->side);
    r->head = ascc_arena_take(arena, r->count, sizeof *r->head);
    r->by_push = zeros(r, 4);
    r->by = zeros(r, 4);
    r->by_place = zeros(r, 3);
    return room && r->side && r->head && r->by_push && r->by && r->by_place;
}

/* The gradient of corrections: that of velocities, a step long, and of positions, if they move these. */
static void gather_by(const reverse *r, const double *velocity, const double *position)
{
    const double step = 1.0 / (r->unit * r->state->motion->time_step);
    for (size_t i = 0; i < r->count; i++) {
        const size_t row = host_row(r, i) * r->d;
        for (size_t c = 0; c < r->d; c++)
            r->by[i * 4 + c] =
                (float)(velocity[row + c] * step + (position ? position[row + c] / r->unit : 0.0));
    }
}

/* host[host's row][dimension] += factor * from[row][stride] */
static void scatter(const reverse *r, const float *from, size_t stride, double factor, double *host)
{
    for (size_t i = 0; i < r->count; i++)
        for (size_t c = 0; c < r->d; c++)
            host[host_row(r, i) * r->d + c] += (double)from[i * stride + c] * factor;
}

/* Places before the step, and room for their gradients; true if corrections do not depend on them. */
static bool find_lines(reverse *r, const double *before)
{
    if (!r->constants->current_direction)
        return true;
    double *line = ascc_arena_take(r->arena, r->count, 3 * sizeof *line);
    r->by_before = ascc_arena_take(r->arena, r->count, 3 * sizeof *r->by_before);
    if (!line || !r->by_before)
        return false;
    memset(r->by_before, 0, r->count * 3 * sizeof *r->by_before);
    for (size_t i = 0; i < r->count; i++)
        for (size_t c = 0; c < 3; c++)
            line[i * 3 + c] = c < r->d ? before[host_row(r, i) * r->d + c] * r->unit : 0.0;
    r->before = line;
    return true;
}

/* Pressures began with a value of the network, in its units. */
static void guess_back(const reverse *r, double *by_guess)
{
    const double unit = ascc_step_share(r->state) / r->constants->lattice_response;
    for (size_t i = 0; i < r->count; i++) {
        by_guess[host_row(r, i)] = unit * (double)r->by_pressure[i];
        *r->by_lattice -=
            (double)(r->by_pressure[i] * r->trace->pressure[i]) / r->constants->lattice_response;
    }
}

static void find_constants(reverse *r, ascc_constant_gradients *by, double *by_omega,
                           double *by_lattice)
{
    r->by_volume = &by->volume;
    r->by_epsilon = &by->epsilon;
    r->by_omega = by_omega;
    r->by_lattice = by_lattice;
}

/* How the lattice's response goes with the logarithm of the rest volume, by a difference. */
static double lattice_by_volume(const reverse *r)
{
    const double step = 1e-4;
    ascc_relaxation more = *r->constants, less = *r->constants;
    more.rest_volume *= 1.0 + step;
    less.rest_volume *= 1.0 - step;
    ascc_relaxation_derive(&more, (int32_t)r->d);
    ascc_relaxation_derive(&less, (int32_t)r->d);
    return (more.lattice_response - less.lattice_response) / (2.0 * step);
}

/* x' = x + d, v' = v + d / dt. */
static ascc_status pressure_back(const ascc_step_state *state, ascc_arena *arena,
                                 const ascc_relaxation_round *round,
                                 const ascc_relaxation_gradients *gradients)
{
    reverse r;
    if (!open_reverse(&r, state, arena, &state->network->plan->relaxation.pressure, &round->trace,
                      round->rows[1]) ||
        !find_lines(&r, gradients->before))
        return ASCC_ERROR_MEMORY;
    r.repulsion = (float)(r.constants->repulsion / r.constants->support);
    double by_lattice = 0.0;
    find_constants(&r, gradients->by_constants, gradients->by_constants->pressure, &by_lattice);
    gather_by(&r, gradients->velocity, gradients->position);
    apply_back(&r);
    sweeps_back(&r);
    if (round->trace.guessed)
        guess_back(&r, gradients->by_guess);
    geometry_back(&r, true);
    scatter(&r, r.by_place, 3, r.unit, gradients->position);
    for (size_t i = 0; r.by_before && i < r.count; i++)
        for (size_t c = 0; c < r.d; c++)
            gradients->by_before[host_row(&r, i) * r.d + c] += r.by_before[i * 3 + c] * r.unit;
    *r.by_volume += by_lattice * lattice_by_volume(&r);
    return ASCC_OK;
}

/* From the velocities that a hyperviscosity left, also in r->by, to those that it began with. */
static ascc_status smoothing_back(reverse *r, double *velocity)
{
    const size_t pairs = ascc_smoothing_pairs(r->trace, r->count);
    const ascc_smoothing_gradients gradients = {
        .velocity = r->by,
        .by_lattice = r->by_lattice,
        .by_squares = zeros(r, 1),
        .by_square = ascc_arena_take(r->arena, pairs, sizeof *gradients.by_square)};
    if (!gradients.by_squares || !gradients.by_square)
        return ASCC_ERROR_MEMORY;
    r->by_squares = gradients.by_squares;
    r->by_square = gradients.by_square;
    const ascc_status status = ascc_smoothing_backward(r->state, r->arena, &gradients);
    for (size_t i = 0; i < r->count; i++)
        for (size_t c = 0; c < r->d; c++)
            velocity[host_row(r, i) * r->d + c] =
                (double)r->by[i * 4 + c] * r->unit * r->state->motion->time_step;
    return status;
}

/* v' = v + d / dt with d from the divergence of v dt at the positions that the step leaves. */
static ascc_status divergence_back(const ascc_step_state *state, ascc_arena *arena,
                                   const ascc_relaxation_gradients *gradients)
{
    reverse r;
    const ascc_relaxation_trace *trace = &state->relaxed.divergence;
    if (!open_reverse(&r, state, arena, &state->network->plan->relaxation.divergence, trace,
                      state->relaxed.round[state->relaxed.rounds - 1].rows[1]))
        return ASCC_ERROR_MEMORY;
    double by_lattice = 0.0;
    find_constants(&r, gradients->by_constants, gradients->by_constants->divergence, &by_lattice);
    gather_by(&r, gradients->velocity, NULL);
    if (trace->coefficient && smoothing_back(&r, gradients->velocity) != ASCC_OK)
        return ASCC_ERROR_MEMORY;
    apply_back(&r);
    sweeps_back(&r);
    side *to = next_side(&r);
    for (size_t i = 0; i < r.count; i++) {
        const float *move = trace->move + i * 4;
        to[i * r.sides] = (side){.move = {move[0], move[1], move[2]}, .by_change = r.by_excess[i]};
    }
    geometry_back(&r, false);
    scatter(&r, r.by_place, 3, r.unit, gradients->position);
    state->tools.kernels->push(&trace->pairs, 0, r.count, r.by_excess, trace->own, r.by_push);
    scatter(&r, r.by_push, 4, -state->motion->time_step * r.unit, gradients->velocity);
    *r.by_volume += by_lattice * lattice_by_volume(&r);
    return ASCC_OK;
}

ascc_status ascc_relaxation_backward(const ascc_step_state *state, ascc_arena *arena,
                                     const ascc_relaxation_gradients *gradients)
{
    ascc_status status = ASCC_OK;
    if (state->relaxed.divergence.low) {
        ascc_arena_reset(arena);
        status = divergence_back(state, arena, gradients);
    }
    for (int32_t n = state->relaxed.rounds; status == ASCC_OK && n > 0; n--) {
        const ascc_relaxation_round *round = &state->relaxed.round[n - 1];
        if (!round->trace.low)
            break;
        ascc_arena_reset(arena);
        status = pressure_back(state, arena, round, gradients);
    }
    return status;
}
