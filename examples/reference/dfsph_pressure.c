/* DFSPH: pairs and densities, and the two pressure solvers. SPDX-License-Identifier: MIT
 *
 * Both solvers look for pressures k_i >= 0 whose accelerations
 *     a_i = -sum_j (k_i + k_j) g_ij - k_i B_i
 * end a compression, by relaxed Jacobi iterations
 *     k_i <- max(0, k_i - (w_i - c L(a)_i) / (2 c D_i)),   L(a)_i = sum_j g_ij . (a_i - a_j) + B_i . a_i
 * with c = dt^2 and w = 1 - (density after the step) for the one, c = dt and w = -(rate of compression) for
 * the other. D_i is what L answers to k_i alone. Free bodies take part: L has their accelerations by
 * the same pressures in it.
 *
 * Iterations run in single precision, walls as one vector a particle; the velocities that come out are summed in
 * double precision over products that are exact opposites for i and j.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dfsph_state.h"

#define ROWS_LEAST_FLAT 7 /* neighbours without which a rate of compression tells nothing */
#define ROWS_LEAST 20

typedef struct sweep {
    dfsph *s;
    float *pressure;
    double gain; /* c */
    uint32_t least;
    double force[DFSPH_BODIES][3], spin[DFSPH_BODIES][3]; /* accelerations of bodies */
} sweep;

/* Cubic spline of support 1 without its factor, and its slope; q at most 1. */
static inline double spline(double q, double *slope)
{
    const double a = 1.0 - q, b = q < 0.5 ? 0.5 - q : 0.0;
    *slope = 24.0 * b * b - 6.0 * a * a;
    return 2.0 * a * a * a - 8.0 * b * b * b;
}

/* ---- Pairs and densities ---- */

/* Adds wall point j to the sums of row i; g = V_b grad W. */
static void touch_wall(dfsph *s, size_t i, size_t j, const double g[3])
{
    const size_t body = s->wall_body[j - s->fluid];
    for (int c = 0; c < 3; c++)
        s->wall_sum[i][c] += g[c];
    if (body == 0)
        return;
    dfsph_touch *t = &s->touch[(body - 1) * s->fluid + i];
    const double *center = s->body[body - 1].center;
    double arm[3], torque[3];
    for (int c = 0; c < 3; c++)
        arm[c] = s->x[j][c] - center[c];
    rigid_cross(arm, g, torque);
    for (int c = 0; c < 3; c++) {
        t->force[c] += g[c];
        t->torque[c] += torque[c];
    }
}

static void look_row(dfsph *s, size_t i)
{
    const uint32_t *index = s->lists->index + s->lists->start[i];
    uint32_t *row = s->pair_row + s->lists->start[i];
    dfsph_four *pair = s->pair + s->lists->start[i];
    const double inverse = 1.0 / s->support, steep = s->normalisation * inverse;
    double density = s->volume * s->normalisation, sum[3] = {0}, squares = 0.0;
    uint32_t count = 0, near = 0;
    memset(s->wall_sum[i], 0, sizeof *s->wall_sum);
    for (size_t k = 0; k < s->body_count; k++)
        s->touch[k * s->fluid + i] = (dfsph_touch){{0}, {0}};
    for (uint32_t k = 0; k < s->lists->count[i]; k++) {
        const size_t j = index[k];
        double r[3], square = 0.0, slope;
        for (int c = 0; c < 3; c++) {
            r[c] = s->x[i][c] - s->x[j][c];
            square += r[c] * r[c];
        }
        if (!(square < s->support * s->support))
            continue;
        near++;
        const double distance = sqrt(square), weight = spline(distance * inverse, &slope);
        const double volume = j < s->fluid ? s->volume : s->wall_volume[j - s->fluid];
        /* coincident points push each other nowhere */
        const double factor = distance > 0.0 ? volume * steep * slope / distance : 0.0;
        const double g[3] = {factor * r[0], factor * r[1], factor * r[2]};
        density += volume * s->normalisation * weight;
        if (j >= s->fluid) {
            touch_wall(s, i, j, g);
            continue;
        }
        row[count] = (uint32_t)j;
        pair[count++] = (dfsph_four){(float)g[0], (float)g[1], (float)g[2], 0.0f};
        for (int c = 0; c < 3; c++) {
            sum[c] += g[c];
            squares += g[c] * g[c];
        }
    }
    for (int c = 0; c < 3; c++) {
        sum[c] += s->wall_sum[i][c];
        squares += sum[c] * sum[c];
    }
    s->density[i] = density;
    s->near_count[i] = near;
    s->pair_count[i] = count;
    s->slope[i] = (dfsph_four){(float)sum[0], (float)sum[1], (float)sum[2], 0.0f};
    /* where points overlap, that many answer alike: iterations would diverge */
    s->inverse[i] = (float)(density > 1.0 ? density * squares : squares);
}

static void look_rows(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    for (size_t i = begin; i < end; i++)
        look_row(data, i);
}

static double length(const double a[3])
{
    return sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
}

/* A body answers to all particles at once, which would make Jacobi iterations diverge for a light one: D_i
 * grows by a bound on the sum of that row. */
static void stiffen(dfsph *s, const rigid *b, const dfsph_touch *touch)
{
    double force = 0.0, torque = 0.0, turns = 0.0;
    for (size_t i = 0; i < s->fluid; i++) {
        force += length(touch[i].force);
        torque += length(touch[i].torque);
    }
    for (int c = 0; c < 3; c++)
        turns = fmax(turns, fabs(b->inverse_inertia[c][0]) + fabs(b->inverse_inertia[c][1]) +
                                fabs(b->inverse_inertia[c][2]));
    for (size_t i = 0; i < s->fluid; i++)
        s->inverse[i] += (float)(s->mass * (b->inverse_mass * force * length(touch[i].force) +
                                            turns * torque * length(touch[i].torque)));
}

static ascc_status reserve_pairs(dfsph *s)
{
    size_t most = 0;
    for (size_t i = 0; i < s->fluid; i++)
        if (s->lists->start[i] + s->lists->count[i] > most)
            most = s->lists->start[i] + s->lists->count[i];
    if (most <= s->pair_capacity)
        return ASCC_OK;
    most += most / 4;
    free(s->pair);
    free(s->pair_row);
    s->pair_capacity = 0;
    s->pair = malloc(most * sizeof *s->pair);
    s->pair_row = malloc(most * sizeof *s->pair_row);
    if (!s->pair || !s->pair_row)
        return ascc_fail(&s->message, ASCC_ERROR_MEMORY, "no memory for %zu pairs", most);
    s->pair_capacity = most;
    return ASCC_OK;
}

ascc_status dfsph_look(dfsph *s)
{
    const bool driven = s->wall_drift >= 0.5 * s->options.skin * s->options.spacing;
    if (driven || !near_current(s->lists, s->fluid, s->x[0], 3)) {
        ascc_status status = near_update(s->lists, s->fluid, s->walls, s->x[0], 3);
        if (status != ASCC_OK)
            return ascc_fail(&s->message, status, "%s", s->lists->message.text);
        status = reserve_pairs(s);
        if (status != ASCC_OK)
            return status;
        s->wall_drift = 0.0;
    }
    near_run(s->lists, s->fluid, look_rows, s);
    for (size_t k = 0; k < s->body_count; k++)
        if (s->body[k].kind == RIGID_FREE)
            stiffen(s, &s->body[k], s->touch + k * s->fluid);
    for (size_t i = 0; i < s->fluid; i++) /* alone, a particle has no slope and needs no pressure */
        s->inverse[i] = s->inverse[i] > 1e-9f ? 1.0f / s->inverse[i] : 0.0f;
    return ASCC_OK;
}

ascc_status dfsph_weigh_walls(dfsph *s, size_t first, size_t count)
{
    const near_options options = {.dimension = s->options.dimension,
                                  .thread_count = s->options.thread_count,
                                  .radius = s->support};
    near_lists *lists = near_create(&options);
    if (!lists)
        return ascc_fail(&s->message, ASCC_ERROR_MEMORY, "no memory for %zu walls", count);
    const double(*x)[3] = (const double(*)[3])s->x + s->fluid + first;
    const ascc_status status = near_update(lists, count, 0, x[0], 3);
    for (size_t w = 0; status == ASCC_OK && w < count; w++) {
        double sum = 1.0, slope;
        for (uint32_t k = 0; k < lists->count[w]; k++) {
            const double *other = x[lists->index[lists->start[w] + k]];
            const double r[3] = {x[w][0] - other[0], x[w][1] - other[1], x[w][2] - other[2]};
            sum += spline(length(r) / s->support, &slope);
        }
        s->wall_volume[first + w] = 1.0 / (s->normalisation * sum);
    }
    if (status != ASCC_OK)
        (void)ascc_fail(&s->message, status, "wall %s", lists->message.text);
    near_destroy(&lists);
    return status;
}

/* ---- Solvers ---- */

static inline float sum_of(dfsph_four a)
{
    return a[0] + a[1] + a[2];
}

/* a_i by the present pressures. */
static void accelerate(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const sweep *w = data;
    const dfsph *s = w->s;
    for (size_t i = begin; i < end; i++) {
        const uint32_t *row = s->pair_row + s->lists->start[i];
        const dfsph_four *pair = s->pair + s->lists->start[i];
        dfsph_four sum = w->pressure[i] * s->slope[i];
        for (uint32_t k = 0; k < s->pair_count[i]; k++)
            sum += w->pressure[row[k]] * pair[k];
        s->push[i] = -sum;
    }
}

/* What bodies accelerate by. */
static void accelerate_bodies(sweep *w)
{
    dfsph *s = w->s;
    for (size_t k = 0; k < s->body_count; k++) {
        const rigid *b = &s->body[k];
        const dfsph_touch *touch = s->touch + k * s->fluid;
        double force[3] = {0}, torque[3] = {0};
        for (size_t i = 0; b->kind == RIGID_FREE && i < s->fluid; i++)
            for (int c = 0; c < 3 && w->pressure[i] > 0.0f; c++) {
                force[c] += (double)w->pressure[i] * touch[i].force[c];
                torque[c] += (double)w->pressure[i] * touch[i].torque[c];
            }
        for (int c = 0; c < 3; c++) {
            w->force[k][c] = s->mass * b->inverse_mass * force[c];
            w->spin[k][c] = 0.0;
            for (int e = 0; e < 3; e++)
                w->spin[k][c] += s->mass * b->inverse_inertia[c][e] * torque[e];
        }
    }
}

/* One iteration of pressures, and what they left to do. */
static void relax(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const sweep *w = data;
    const dfsph *s = w->s;
    const float gain = (float)w->gain, step = (float)(0.5 / w->gain);
    for (size_t i = begin; i < end; i++) {
        const uint32_t *row = s->pair_row + s->lists->start[i];
        const dfsph_four *pair = s->pair + s->lists->start[i];
        dfsph_four sum = s->push[i] * s->slope[i];
        for (uint32_t k = 0; k < s->pair_count[i]; k++)
            sum -= pair[k] * s->push[row[k]];
        float rate = sum_of(sum);
        for (size_t k = 0; k < s->body_count; k++)
            for (int c = 0; c < 3 && s->body[k].kind == RIGID_FREE; c++)
                rate -= (float)(w->force[k][c] * s->touch[k * s->fluid + i].force[c] +
                                w->spin[k][c] * s->touch[k * s->fluid + i].torque[c]);
        const bool lonely = s->near_count[i] < w->least;
        const float residual = lonely ? 0.0f : s->wanted[i] - gain * rate;
        s->residual[i] = residual < 0.0f ? residual : 0.0f;
        const float pressure = w->pressure[i] - step * residual * s->inverse[i];
        w->pressure[i] = pressure > 0.0f && !lonely ? pressure : 0.0f;
    }
}

/* Velocities changed by the pressures; exact opposites, so in double precision. */
static void push_rows(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const sweep *w = data;
    const dfsph *s = w->s;
    for (size_t i = begin; i < end; i++) {
        const uint32_t *row = s->pair_row + s->lists->start[i];
        const dfsph_four *pair = s->pair + s->lists->start[i];
        double sum[3] = {0};
        for (uint32_t k = 0; k < s->pair_count[i]; k++) {
            const double both = (double)(w->pressure[i] + w->pressure[row[k]]);
            for (int c = 0; c < 3; c++)
                sum[c] += both * (double)pair[k][c];
        }
        for (int c = 0; c < 3; c++)
            s->change[i][c] = -sum[c] - (double)w->pressure[i] * s->wall_sum[i][c];
    }
}

/* Impulses of the pressures on walls and bodies. */
static void push_bodies(sweep *w, double dt)
{
    dfsph *s = w->s;
    double wall[3] = {0};
    for (size_t i = 0; i < s->fluid; i++)
        for (int c = 0; c < 3 && w->pressure[i] > 0.0f; c++)
            wall[c] += (double)w->pressure[i] * s->wall_sum[i][c];
    for (size_t k = 0; k < s->body_count; k++) {
        double force[3] = {0}, torque[3] = {0};
        const dfsph_touch *touch = s->touch + k * s->fluid;
        for (size_t i = 0; i < s->fluid; i++)
            for (int c = 0; c < 3 && w->pressure[i] > 0.0f; c++) {
                force[c] += s->mass * (double)w->pressure[i] * touch[i].force[c];
                torque[c] += s->mass * (double)w->pressure[i] * touch[i].torque[c];
            }
        rigid_push(&s->body[k], force, torque, dt);
        for (int c = 0; c < 3; c++) {
            s->body[k].impulse[c] += dt * force[c];
            s->body[k].angular[c] += dt * torque[c];
            wall[c] -= force[c] / s->mass;
        }
    }
    for (int c = 0; c < 3; c++)
        s->wall_impulse[c] += dt * s->mass * wall[c];
}

/* Iterates until what is left, as a mean over the fluid, is below `enough`. Returns the iterations. */
static uint64_t solve(sweep *w, int32_t least, double enough, double dt)
{
    dfsph *s = w->s;
    int32_t done = 0;
    for (double left = INFINITY; done < s->options.iterations && (done < least || left > enough);
         done++) {
        near_run(s->lists, s->fluid, accelerate, w);
        accelerate_bodies(w);
        near_run(s->lists, s->fluid, relax, w);
        left = 0.0;
        for (size_t i = 0; i < s->fluid; i++)
            left -= (double)s->residual[i];
        left /= (double)s->fluid;
    }
    near_run(s->lists, s->fluid, push_rows, w);
    for (size_t i = 0; i < s->fluid; i++)
        for (int c = 0; c < 3; c++)
            s->v[i][c] += dt * s->change[i][c];
    push_bodies(w, dt);
    return (uint64_t)done;
}

/* wanted = -(rate of compression by the present velocities). */
static void find_rates(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    dfsph *s = data;
    for (size_t i = begin; i < end; i++) {
        const uint32_t *row = s->pair_row + s->lists->start[i];
        const dfsph_four *pair = s->pair + s->lists->start[i];
        const double *v = s->v[i];
        double rate = 0.0;
        for (uint32_t k = 0; k < s->pair_count[i]; k++)
            for (int c = 0; c < 3; c++)
                rate += (double)pair[k][c] * (v[c] - s->v[row[k]][c]);
        for (int c = 0; c < 3; c++)
            rate += s->wall_sum[i][c] * v[c];
        for (size_t k = 0; k < s->body_count; k++) {
            const dfsph_touch *t = &s->touch[k * s->fluid + i];
            for (int c = 0; c < 3; c++)
                rate -= s->body[k].velocity[c] * t->force[c] + s->body[k].spin[c] * t->torque[c];
        }
        s->wanted[i] = (float)-rate;
    }
}

void dfsph_end_compression(dfsph *s, double dt)
{
    sweep w = {.s = s, .pressure = s->hold, .gain = dt * dt};
    near_run(s->lists, s->fluid, find_rates, s);
    for (size_t i = 0; i < s->fluid; i++) {
        /* 1 - density, or what may be let go of it */
        const double static_part = fmax(1.0 - s->density[i], -dt * s->options.release);
        s->wanted[i] = (float)(static_part + dt * (double)s->wanted[i]);
        s->hold[i] *= s->wanted[i] < 0.0f ? 0.5f : 0.0f;
    }
    s->totals.density_iterations += solve(&w, 2, s->options.density_error, dt);
}

void dfsph_end_divergence(dfsph *s, double dt)
{
    const uint32_t least = s->options.dimension == 2 ? ROWS_LEAST_FLAT : ROWS_LEAST;
    sweep w = {.s = s, .pressure = s->calm, .gain = dt, .least = least};
    near_run(s->lists, s->fluid, find_rates, s);
    for (size_t i = 0; i < s->fluid; i++) {
        s->wanted[i] = fminf(s->wanted[i], 0.0f);
        s->calm[i] *= s->wanted[i] < 0.0f && s->near_count[i] >= least ? 0.5f : 0.0f;
    }
    s->totals.divergence_iterations += solve(&w, 1, s->options.divergence_error / dt, dt);
}
