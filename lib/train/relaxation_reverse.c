/* The relaxation once more in doubles, and its adjoint (step/relaxation.c has the formulas; docs/training.md).
 * SPDX-License-Identifier: MIT
 *
 * With P the map from pressures to pushes, d = -P p, the sweeps are p' = max(0, p + omega (c - P^T P p) r),
 * r the responses: so a sweep's way back is made of the same two maps. What they and the densities are made
 * of, the gradients g of pairs, collects its own gradient pair by pair, which at the end goes to positions.
 */
#include "relaxation_reverse.h"

#include <math.h>
#include <string.h>

/* A neighbour of a row, in supports. */
typedef struct neighbor {
    size_t at;  /* fluid row, or wall row */
    bool fluid; /* else a wall */
    double u[3], distance;
    double g[3];             /* volume * gradient */
    double slope, curvature; /* volume * derivatives of the spline by distance */
    double limit;            /* of its correction */
    double by_g[3];          /* gradient */
} neighbor;

/* What sweeps read of a neighbour in the fluid: 32 bytes, some twenty times a step. */
typedef struct fluid_pair {
    double g[3];
    size_t at;
} fluid_pair;

typedef struct reverse {
    const ascc_step_state *state;
    const ascc_relaxation *constants;
    const ascc_sweeps *sweeps;
    const ascc_rows *const *rows; /* neighbours among fluid and walls */
    ascc_arena *arena;
    size_t count, d;
    double unit; /* supports of a unit of the host */
    /* In the order of the fluid's rows: */
    double *place;  /* [row][3] */
    double *before; /* [row][3] before the step, if corrections lie along those lines */
    size_t *start;  /* [row + 1] */
    neighbor *pair;
    size_t *fluid_start; /* [row + 1] */
    fluid_pair *fluid;   /* of `pair`, in its order */
    double *own;         /* [row][3] sum of g */
    double *excess;      /* [row] what sweeps take away */
    double *response;    /* [row] */
    double *pressure;    /* [sweep + 1][row] */
    double *push;        /* [sweep][row][3] by the pressure before it */
    double *change;      /* [sweep][row] */
    double repulsion;
    const double *moving; /* velocities of the host's walls, or NULL: all rest */
    /* Gradients: */
    double *by_push;     /* [row][3] */
    double *by_pressure; /* [row] */
    double *by_excess, *by_response;
    double *by_place;  /* [row][3] */
    double *by_before; /* [row][3] likewise of `before` */
    double *scratch;   /* [row][3] */
} reverse;

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static double *zeros(const reverse *r, size_t each)
{
    double *taken = ascc_arena_take(r->arena, r->count * each + 1, sizeof *taken);
    if (taken)
        memset(taken, 0, r->count * each * sizeof *taken);
    return taken;
}

/* ---- Forwards ---- */

/* to[row][3] = factor * host[host's row][dimension] */
static void gather(const reverse *r, const double *host, double factor, double *to)
{
    for (size_t i = 0; i < r->count; i++) {
        const size_t row = ascc_hierarchy_host_row(&r->state->hierarchy, ASCC_SET_FLUID, i);
        for (size_t c = 0; c < 3; c++)
            to[i * 3 + c] = c < r->d ? host[row * r->d + c] * factor : 0.0;
    }
}

/* Fills a pair of these places; false if it is too far apart to act. */
static bool look_at(const reverse *r, const double from[3], const double to[3], double volume,
                    neighbor *n)
{
    double square = 0.0;
    for (int c = 0; c < 3; c++) {
        n->u[c] = to[c] - from[c];
        square += n->u[c] * n->u[c];
        n->by_g[c] = 0.0;
    }
    if (square >= 1.0)
        return false;
    const double q = n->distance = sqrt(square);
    const double far = 1.0 - q, near = q < 0.5 ? 0.5 - q : 0.0;
    n->slope = -6.0 * volume * (far * far - 4.0 * near * near);
    n->curvature = 12.0 * volume * (far - 4.0 * near);
    n->limit = r->constants->limit / r->constants->support * volume / r->constants->amount;
    for (int c = 0; c < 3; c++) {
        n->u[c] = q > 0.0 ? n->u[c] / q : 0.0;
        n->g[c] = -n->slope * n->u[c];
    }
    return true;
}

static double density_of(double q, double volume)
{
    const double far = 1.0 - q, near = q < 0.5 ? 0.5 - q : 0.0;
    return volume * (2.0 * far * far * far - 8.0 * near * near * near);
}

/* The pairs of row i behind those before it. Returns the density that they make. */
static double look_around(reverse *r, size_t i)
{
    const ascc_step_state *state = r->state;
    const ascc_hierarchy *h = &state->hierarchy;
    const double amount = r->constants->amount;
    double density = amount; /* its own */
    size_t at = r->start[i];
    for (int list = 0; list < 2; list++) {
        const ascc_rows *rows = r->rows[list];
        for (uint32_t k = 0; k < rows->count[i]; k++) {
            const size_t j = rows->neighbor[rows->start[i] + k];
            double place[3] = {0.0, 0.0, 0.0}, volume = amount;
            neighbor *n = &r->pair[at];
            if (!list && j == i)
                continue;
            if (list) {
                const size_t row = ascc_hierarchy_wall_row(h, j);
                volume = (double)state->wall_volume[row];
                for (size_t c = 0; c < r->d; c++)
                    place[c] = state->advance.wall[row * r->d + c] * r->unit;
            }
            if (!look_at(r, r->place + i * 3, list ? place : r->place + j * 3, volume, n))
                continue;
            n->at = j;
            n->fluid = list == 0;
            density += density_of(n->distance, volume);
            at++;
        }
    }
    r->start[i + 1] = at;
    return density;
}

static bool take_pairs(reverse *r)
{
    size_t most = 1;
    for (int list = 0; list < 2; list++) {
        const ascc_rows *rows = r->rows[list];
        for (size_t i = 0; i < r->count; i++)
            most += rows->count[i];
    }
    r->pair = ascc_arena_take(r->arena, most, sizeof *r->pair);
    r->start = ascc_arena_take(r->arena, r->count + 1, sizeof *r->start);
    r->fluid = ascc_arena_take(r->arena, most, sizeof *r->fluid);
    r->fluid_start = ascc_arena_take(r->arena, r->count + 1, sizeof *r->fluid_start);
    return r->pair && r->start && r->fluid && r->fluid_start;
}

/* Pairs, densities and responses at r->place. */
static void find_geometry(reverse *r)
{
    const double least = r->constants->epsilon * r->constants->lattice_response;
    size_t at = 0;
    r->start[0] = r->fluid_start[0] = 0;
    for (size_t i = 0; i < r->count; i++) {
        double square = 0.0, own[3] = {0.0, 0.0, 0.0};
        r->excess[i] = look_around(r, i) - 1.0;
        for (size_t k = r->start[i]; k < r->start[i + 1]; k++) {
            const neighbor *n = &r->pair[k];
            square += n->fluid ? dot(n->g, n->g) : 0.0;
            if (n->fluid)
                r->fluid[at++] = (fluid_pair){{n->g[0], n->g[1], n->g[2]}, n->at};
            for (int c = 0; c < 3; c++)
                own[c] += n->g[c];
        }
        r->fluid_start[i + 1] = at;
        memcpy(r->own + i * 3, own, sizeof own);
        r->response[i] = 1.0 / (square + dot(own, own) + least);
    }
}

/* to[row] = -P pressure; of gradients: the adjoint of `divergence`, less its sign. */
static void push(const reverse *r, const double *pressure, double *to)
{
    for (size_t i = 0; i < r->count; i++) {
        double sum[3];
        for (size_t c = 0; c < 3; c++)
            sum[c] = pressure[i] * r->own[i * 3 + c];
        for (size_t k = r->fluid_start[i]; k < r->fluid_start[i + 1]; k++)
            for (int c = 0; c < 3; c++)
                sum[c] += pressure[r->fluid[k].at] * r->fluid[k].g[c];
        for (size_t c = 0; c < 3; c++)
            to[i * 3 + c] = -sum[c];
    }
}

/* to[row] = P^T move */
static void divergence(const reverse *r, const double *move, double *to)
{
    for (size_t i = 0; i < r->count; i++) {
        double sum = dot(r->own + i * 3, move + i * 3);
        for (size_t k = r->fluid_start[i]; k < r->fluid_start[i + 1]; k++)
            sum -= dot(r->fluid[k].g, move + r->fluid[k].at * 3);
        to[i] = sum;
    }
}

/* Pressures begin with a value of the network, in its units. */
static void guess(reverse *r)
{
    const int32_t value = r->constants->guess;
    const double unit = ascc_step_share(r->state) / r->constants->lattice_response;
    for (size_t i = 0; value && i < r->count; i++)
        r->pressure[i] = unit * (double)r->state->run.value[value].rectified[i * ascc_padded(1)];
}

static void guess_back(const reverse *r, double *by_guess)
{
    const double unit = ascc_step_share(r->state) / r->constants->lattice_response;
    for (size_t i = 0; r->constants->guess && i < r->count; i++)
        by_guess[ascc_hierarchy_host_row(&r->state->hierarchy, ASCC_SET_FLUID, i)] =
            unit * r->by_pressure[i];
}

static void sweep(reverse *r)
{
    for (int32_t s = 0; s < r->sweeps->count; s++) {
        const double *pressure = r->pressure + (size_t)s * r->count;
        double *next = r->pressure + ((size_t)s + 1) * r->count;
        double *change = r->change + (size_t)s * r->count;
        double *pushes = r->push + (size_t)s * r->count * 3;
        push(r, pressure, pushes);
        divergence(r, pushes, change);
        for (size_t i = 0; i < r->count; i++) {
            const double p =
                pressure[i] + r->sweeps->omega[s] * (r->excess[i] + change[i]) * r->response[i];
            next[i] = p > 0.0 ? p : 0.0;
        }
    }
}

/* ---- Back ---- */

/* How far a neighbour that is a wall goes in the step, supports. */
static void wall_move(const reverse *r, const neighbor *n, double move[3])
{
    const size_t row = ascc_hierarchy_wall_row(&r->state->hierarchy, n->at);
    for (size_t c = 0; c < 3; c++)
        move[c] =
            c < r->d ? r->moving[row * r->d + c] * r->state->motion->time_step * r->unit : 0.0;
}

/* What walls that move take from divergences. */
static void add_inflow(reverse *r)
{
    for (size_t i = 0; r->moving && i < r->count; i++)
        for (size_t k = r->start[i]; k < r->start[i + 1]; k++) {
            double move[3];
            if (r->pair[k].fluid)
                continue;
            wall_move(r, &r->pair[k], move);
            r->excess[i] -= dot(r->pair[k].g, move);
        }
}

/* The gradients of pairs that this has. */
static void pass_inflow(reverse *r)
{
    for (size_t i = 0; r->moving && i < r->count; i++)
        for (size_t k = r->start[i]; k < r->start[i + 1]; k++) {
            double move[3];
            if (r->pair[k].fluid)
                continue;
            wall_move(r, &r->pair[k], move);
            for (int c = 0; c < 3; c++)
                r->pair[k].by_g[c] -= r->by_excess[i] * move[c];
        }
}

/* Gradients of pairs that a divergence of these moves has. */
static void pass_divergence(reverse *r, const double *move, const double *by_change)
{
    for (size_t i = 0; i < r->count; i++)
        for (size_t k = r->start[i]; k < r->start[i + 1]; k++) {
            neighbor *n = &r->pair[k];
            for (size_t c = 0; c < 3; c++)
                n->by_g[c] +=
                    by_change[i] * (move[i * 3 + c] - (n->fluid ? move[n->at * 3 + c] : 0.0));
        }
}

/* Gradients of pairs that a sweep has: its divergence, and the pushes before that by these pressures. */
static void pass_sweep(reverse *r, const double *move, const double *by_change,
                       const double *pressure, const double *by_push)
{
    for (size_t i = 0; i < r->count; i++)
        for (size_t k = r->start[i]; k < r->start[i + 1]; k++) {
            neighbor *n = &r->pair[k];
            const double p = pressure[i] + (n->fluid ? pressure[n->at] : 0.0);
            for (size_t c = 0; c < 3; c++)
                n->by_g[c] +=
                    by_change[i] * (move[i * 3 + c] - (n->fluid ? move[n->at * 3 + c] : 0.0)) -
                    p * by_push[i * 3 + c];
        }
}

/* Back through sweep s: by_pressure of what it left becomes that of what it began with. */
static void sweep_back(reverse *r, int32_t s)
{
    const double *pressure = r->pressure + (size_t)s * r->count, *next = pressure + r->count;
    const double *change = r->change + (size_t)s * r->count;
    const double *pushes = r->push + (size_t)s * r->count * 3;
    double *by_change = r->scratch, *by_push = r->by_push;
    for (size_t i = 0; i < r->count; i++) {
        const double by = next[i] > 0.0 ? r->sweeps->omega[s] * r->by_pressure[i] : 0.0;
        if (!(next[i] > 0.0))
            r->by_pressure[i] = 0.0;
        r->by_response[i] += by * (r->excess[i] + change[i]);
        by_change[i] = by * r->response[i];
        r->by_excess[i] += by_change[i];
    }
    push(r, by_change, by_push);
    for (size_t k = 0; k < 3 * r->count; k++)
        by_push[k] = -by_push[k];
    pass_sweep(r, pushes, by_change, pressure, by_push);
    divergence(r, by_push, r->scratch);
    for (size_t i = 0; i < r->count; i++)
        r->by_pressure[i] -= r->scratch[i];
}

/* M a for M = along u u^T + across (1 - u u^T). */
static void bend(const double u[3], double along, double across, const double a[3], double to[3])
{
    const double radial = dot(u, a);
    for (int c = 0; c < 3; c++)
        to[c] = across * a[c] + (along - across) * radial * u[c];
}

/* The gradient of a correction before it was turned to the line of the places before the step; that of the
 * line is added to these. */
static void unturn(reverse *r, size_t i, size_t j, const double correction[3], double by[3])
{
    double line[3], by_line[3], square = 0.0;
    for (size_t c = 0; c < 3; c++) {
        line[c] = r->before[j * 3 + c] - r->before[i * 3 + c];
        square += line[c] * line[c];
    }
    const double scale = square > 0.0 ? 1.0 / square : 0.0;
    const double along = dot(line, by) * scale, turned = dot(line, correction) * scale;
    for (size_t c = 0; c < 3; c++) {
        by_line[c] = by[c] * turned + correction[c] * along - 2.0 * along * turned * line[c];
        r->by_before[i * 3 + c] -= by_line[c];
        r->by_before[j * 3 + c] += by_line[c];
        by[c] = along * line[c];
    }
}

static double share_of_limit(const double correction[3], double limit)
{
    const double size = sqrt(dot(correction, correction));
    return size > limit ? limit / size : 1.0;
}

/* The gradient of a correction before it was limited to this share. */
static void unlimit(const double correction[3], double share, double by[3])
{
    if (share == 1.0)
        return;
    const double along = dot(correction, by) / dot(correction, correction);
    for (int c = 0; c < 3; c++)
        by[c] = share * (by[c] - along * correction[c]);
}

static void add_place(reverse *r, size_t i, const neighbor *n, const double by_difference[3])
{
    for (size_t c = 0; c < 3; c++) {
        r->by_place[i * 3 + c] -= by_difference[c];
        if (n->fluid)
            r->by_place[n->at * 3 + c] += by_difference[c];
    }
}

/* Back through the one application of the last pressures, whose gradient is by: pair by pair, for each
 * side on its own. */
static void apply_back(reverse *r, const double *by)
{
    const double *pressure = r->pressure + (size_t)r->sweeps->count * r->count;
    const double share = 0.5 * r->constants->stiffness;
    for (size_t i = 0; i < r->count; i++)
        for (size_t k = r->start[i]; k < r->start[i + 1]; k++) {
            neighbor *n = &r->pair[k];
            const double p = pressure[i] + (n->fluid ? pressure[n->at] : 0.0);
            const double lack = n->fluid ? r->repulsion - n->distance : 0.0;
            const double apart = lack > 0.0 ? share * lack : 0.0;
            double correction[3], one[3], back[3];
            if (!n->fluid && pressure[i] == 0.0)
                continue;
            memcpy(one, by + i * 3, sizeof one);
            for (int c = 0; c < 3; c++)
                correction[c] = -(p * n->g[c] + apart * n->u[c]);
            const double limited = share_of_limit(correction, n->limit);
            if (r->before && n->fluid) {
                for (int c = 0; c < 3; c++)
                    back[c] = limited * correction[c];
                unturn(r, i, n->at, back, one);
            }
            unlimit(correction, limited, one);
            const double by_pressure = -dot(n->g, one);
            r->by_pressure[i] += by_pressure;
            if (n->fluid)
                r->by_pressure[n->at] += by_pressure;
            for (int c = 0; c < 3; c++)
                n->by_g[c] -= p * one[c];
            if (apart > 0.0 && n->distance > 0.0) {
                bend(n->u, share, -apart / n->distance, one, back);
                add_place(r, i, n, back);
            }
        }
}

/* From gradients of pairs, densities and responses to places. */
static void geometry_back(reverse *r, bool densities)
{
    for (size_t i = 0; i < r->count; i++) {
        const double by_square = -r->by_response[i] * r->response[i] * r->response[i];
        for (size_t k = r->start[i]; k < r->start[i + 1]; k++) {
            neighbor *n = &r->pair[k];
            double by_difference[3];
            for (size_t c = 0; c < 3; c++)
                n->by_g[c] += 2.0 * by_square * (r->own[i * 3 + c] + (n->fluid ? n->g[c] : 0.0));
            if (n->distance == 0.0)
                continue;
            bend(n->u, -n->curvature, -n->slope / n->distance, n->by_g, by_difference);
            for (int c = 0; c < 3; c++) /* density falls with distance as g tells */
                by_difference[c] -= densities ? r->by_excess[i] * n->g[c] : 0.0;
            add_place(r, i, n, by_difference);
        }
    }
}

static bool take_memory(reverse *r)
{
    const size_t sweeps = (size_t)r->sweeps->count;
    r->place = zeros(r, 3);
    r->own = zeros(r, 3);
    r->excess = zeros(r, 1);
    r->response = zeros(r, 1);
    r->pressure = zeros(r, sweeps + 1);
    r->push = zeros(r, 3 * sweeps);
    r->change = zeros(r, sweeps);
    r->by_push = zeros(r, 3);
    r->by_pressure = zeros(r, 1);
    r->by_excess = zeros(r, 1);
    r->by_response = zeros(r, 1);
    r->by_place = zeros(r, 3);
    r->scratch = zeros(r, 3);
    return r->place && r->own && r->excess && r->response && r->pressure && r->push && r->change &&
           r->by_push && r->by_pressure && r->by_excess && r->by_response && r->by_place &&
           r->scratch && take_pairs(r);
}

static bool open_reverse(reverse *r, const ascc_step_state *state, ascc_arena *arena,
                         const ascc_sweeps *sweeps, const ascc_relaxation_round *round,
                         const double *position)
{
    const ascc_relaxation *constants = &state->network->plan->relaxation;
    *r = (reverse){.state = state,
                   .constants = constants,
                   .sweeps = sweeps,
                   .rows = round->rows,
                   .arena = arena,
                   .count = state->hierarchy.set[ASCC_SET_FLUID].count,
                   .d = (size_t)state->particles->dimension,
                   .unit = state->length_unit / constants->support};
    if (!take_memory(r))
        return false;
    gather(r, position, r->unit, r->place);
    find_geometry(r);
    return true;
}

/* host[host's row][dimension] += factor * from[row][3] */
static void scatter(const reverse *r, const double *from, double factor, double *host)
{
    for (size_t i = 0; i < r->count; i++) {
        const size_t row = ascc_hierarchy_host_row(&r->state->hierarchy, ASCC_SET_FLUID, i);
        for (size_t c = 0; c < r->d; c++)
            host[row * r->d + c] += from[i * 3 + c] * factor;
    }
}

/* x' = x + d, v' = v + d / dt. */
static ascc_status pressure_back(const ascc_step_state *state, ascc_arena *arena,
                                 const ascc_relaxation_round *round,
                                 const ascc_relaxation_gradients *gradients)
{
    reverse r;
    const bool first = round == state->relaxed.round;
    if (!open_reverse(&r, state, arena, &state->network->plan->relaxation.pressure, round,
                      round->position))
        return ASCC_ERROR_MEMORY;
    double *by = zeros(&r, 3), *line = zeros(&r, 3), *velocity = zeros(&r, 3);
    r.by_before = zeros(&r, 3);
    if (!by || !line || !velocity || !r.by_before)
        return ASCC_ERROR_MEMORY;
    gather(&r, gradients->position, 1.0 / r.unit, by);
    gather(&r, gradients->velocity, 1.0 / (r.unit * state->motion->time_step), velocity);
    for (size_t k = 0; k < 3 * r.count; k++)
        by[k] += velocity[k];
    if (r.constants->current_direction) {
        gather(&r, gradients->before, r.unit, line);
        r.before = line;
    }
    r.repulsion = r.constants->repulsion / r.constants->support;
    if (first)
        guess(&r);
    sweep(&r);
    apply_back(&r, by);
    for (int32_t s = r.sweeps->count; s > 0; s--)
        sweep_back(&r, s - 1);
    if (first)
        guess_back(&r, gradients->by_guess);
    geometry_back(&r, true);
    scatter(&r, r.by_place, r.unit, gradients->position);
    scatter(&r, r.by_before, r.unit, gradients->by_before);
    return ASCC_OK;
}

/* v' = v + d / dt with d from the divergence of v dt at the positions that the step leaves. */
static ascc_status divergence_back(const ascc_step_state *state, ascc_arena *arena,
                                   const ascc_relaxation_gradients *gradients)
{
    reverse r;
    if (!open_reverse(&r, state, arena, &state->network->plan->relaxation.divergence,
                      &state->relaxed.round[state->relaxed.rounds - 1], state->advance.position))
        return ASCC_ERROR_MEMORY;
    double *by = zeros(&r, 3), *move = zeros(&r, 3);
    if (!by || !move)
        return ASCC_ERROR_MEMORY;
    const double step = state->motion->time_step * r.unit; /* supports a step of a velocity */
    gather(&r, gradients->velocity, 1.0 / step, by);
    gather(&r, state->relaxed.velocity, step, move);
    for (size_t i = 0; i < r.count; i++)
        if (r.excess[i] < -(double)ASCC_SURFACE)
            r.response[i] = 0.0;
    divergence(&r, move, r.excess);
    r.moving = state->advance.wall_velocity;
    add_inflow(&r);
    sweep(&r);
    apply_back(&r, by);
    for (int32_t s = r.sweeps->count; s > 0; s--)
        sweep_back(&r, s - 1);
    pass_divergence(&r, move, r.by_excess);
    pass_inflow(&r);
    geometry_back(&r, false);
    scatter(&r, r.by_place, r.unit, gradients->position);
    push(&r, r.by_excess, by);
    scatter(&r, by, -step, gradients->velocity);
    return ASCC_OK;
}

ascc_status ascc_relaxation_backward(const ascc_step_state *state, ascc_arena *arena,
                                     const ascc_relaxation_gradients *gradients)
{
    const ascc_relaxation *constants = &state->network->plan->relaxation;
    ascc_status status = ASCC_OK;
    if (constants->divergence.count && state->relaxed.velocity) {
        ascc_arena_reset(arena);
        status = divergence_back(state, arena, gradients);
    }
    for (int32_t n = state->relaxed.rounds; status == ASCC_OK && n > 0; n--) {
        const ascc_relaxation_round *round = &state->relaxed.round[n - 1];
        if (!round->position)
            break;
        ascc_arena_reset(arena);
        status = pressure_back(state, arena, round, gradients);
    }
    return status;
}
