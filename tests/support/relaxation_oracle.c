/* Relaxations in doubles. SPDX-License-Identifier: MIT */
#include "relaxation_oracle.h"

#include <stdlib.h>
#include <string.h>

enum { MOST = 64 };

/* In supports; a neighbour is a particle or, behind them, a wall. */
typedef struct scene {
    const ascc_relaxation *constants;
    size_t d, fluid, all;
    double place[2 * MOST][3], volume[2 * MOST], before[MOST][3];
    double g[MOST][2 * MOST][3], response[MOST], density[MOST];
    double p[MOST], move[MOST][3];
} scene;

static double spline(double q)
{
    if (q >= 1.0)
        return 0.0;
    return 2.0 * pow(1.0 - q, 3.0) - (q < 0.5 ? 8.0 * pow(0.5 - q, 3.0) : 0.0);
}

static double steepness(double q)
{
    if (q >= 1.0)
        return 0.0;
    return 6.0 * pow(1.0 - q, 2.0) - (q < 0.5 ? 24.0 * pow(0.5 - q, 2.0) : 0.0);
}

/* The unit vector from i to k; returns their distance. */
static double between(const scene *s, size_t i, size_t k, double u[3])
{
    double square = 0.0;
    for (size_t c = 0; c < 3; c++) {
        u[c] = s->place[k][c] - s->place[i][c];
        square += u[c] * u[c];
    }
    for (size_t c = 0; c < 3; c++)
        u[c] = square > 0.0 ? u[c] / sqrt(square) : 0.0;
    return sqrt(square);
}

static void find_geometry(scene *s)
{
    const double least = s->constants->epsilon * s->constants->lattice_response;
    for (size_t i = 0; i < s->fluid; i++) {
        double own[3] = {0.0, 0.0, 0.0}, square = 0.0;
        s->density[i] = 0.0;
        for (size_t k = 0; k < s->all; k++) {
            double u[3];
            const double q = between(s, i, k, u);
            s->density[i] += s->volume[k] * spline(q);
            for (size_t c = 0; c < 3; c++) {
                s->g[i][k][c] = s->volume[k] * steepness(q) * u[c];
                own[c] += s->g[i][k][c];
                square += k < s->fluid ? s->g[i][k][c] * s->g[i][k][c] : 0.0;
            }
        }
        for (size_t c = 0; c < 3; c++)
            square += own[c] * own[c];
        s->response[i] = 1.0 / (square + least);
    }
}

static double divergence(const scene *s, size_t i)
{
    double sum = 0.0;
    for (size_t k = 0; k < s->all; k++)
        for (size_t c = 0; c < 3; c++)
            sum += s->g[i][k][c] * (s->move[i][c] - (k < s->fluid ? s->move[k][c] : 0.0));
    return sum;
}

/* The correction that neighbour k gives i, limited and turned. */
static void correction(const scene *s, size_t i, size_t k, double repulsion, double to[3])
{
    const ascc_relaxation *r = s->constants;
    const double p = s->p[i] + (k < s->fluid ? s->p[k] : 0.0);
    double u[3], size = 0.0, line[3], square = 0.0, along = 0.0;
    const double q = between(s, i, k, u);
    for (size_t c = 0; c < 3; c++) {
        to[c] = -p * s->g[i][k][c];
        if (k < s->fluid && q < repulsion)
            to[c] -= 0.5 * r->stiffness * (repulsion - q) * u[c];
        size += to[c] * to[c];
    }
    const double limit = r->limit / r->support * s->volume[k] / r->amount;
    for (size_t c = 0; c < 3 && sqrt(size) > limit; c++)
        to[c] *= limit / sqrt(size);
    if (!r->current_direction || repulsion < 0.0 || k >= s->fluid)
        return;
    for (size_t c = 0; c < 3; c++) {
        line[c] = s->before[k][c] - s->before[i][c];
        square += line[c] * line[c];
        along += line[c] * to[c];
    }
    for (size_t c = 0; c < 3; c++)
        to[c] = square > 0.0 ? along / square * line[c] : 0.0;
}

/* move = what the pressures push. */
static void push(scene *s)
{
    memset(s->move, 0, sizeof s->move);
    for (size_t i = 0; i < s->fluid; i++)
        for (size_t k = 0; k < s->all; k++)
            for (size_t c = 0; c < 3; c++)
                s->move[i][c] -= (s->p[i] + (k < s->fluid ? s->p[k] : 0.0)) * s->g[i][k][c];
}

/* move = what the sweeps against this excess push, pressures as they are at first. repulsion < 0: of
 * velocities. */
static void sweep(scene *s, const ascc_sweeps *sweeps, const double excess[MOST], double repulsion)
{
    double next[MOST] = {0.0};
    for (int32_t n = 0; n < sweeps->count; n++) {
        push(s);
        for (size_t i = 0; i < s->fluid; i++)
            next[i] = fmax(0.0, s->p[i] + sweeps->omega[n] * s->response[i] *
                                              (excess[i] + divergence(s, i)));
        memcpy(s->p, next, sizeof next);
    }
    memset(s->move, 0, sizeof s->move);
    for (size_t i = 0; i < s->fluid; i++)
        for (size_t k = 0; k < s->all; k++) {
            double part[3];
            correction(s, i, k, repulsion, part);
            for (size_t c = 0; c < 3; c++)
                s->move[i][c] += k == i ? 0.0 : part[c];
        }
}

static void put_places(scene *s, const double *position)
{
    for (size_t i = 0; i < s->fluid; i++)
        for (size_t c = 0; c < s->d; c++)
            s->place[i][c] = position[i * s->d + c] / s->constants->support;
}

static void relax_velocities(scene *s, double step, double *velocity)
{
    double excess[MOST];
    for (size_t i = 0; i < s->fluid; i++) {
        s->response[i] = s->density[i] - 1.0 < -0.35 ? 0.0 : s->response[i];
        for (size_t c = 0; c < s->d; c++)
            s->move[i][c] = velocity[i * s->d + c] * step;
    }
    for (size_t i = 0; i < s->fluid; i++)
        excess[i] = divergence(s, i);
    memset(s->p, 0, sizeof s->p);
    sweep(s, &s->constants->divergence, excess, -1.0);
    for (size_t i = 0; i < s->fluid; i++)
        for (size_t c = 0; c < s->d; c++)
            velocity[i * s->d + c] += s->move[i][c] / step;
}

/* How rough velocities are (docs/method.md), of pairs of these coefficients. */
static void roughness(const scene *s, const double coefficient[MOST], double velocity[MOST][3],
                      double rough[MOST][3])
{
    for (size_t i = 0; i < s->fluid; i++) {
        memset(rough[i], 0, sizeof rough[i]);
        for (size_t k = 0; k < s->fluid; k++) {
            double square = 0.0;
            for (size_t c = 0; c < 3; c++)
                square += s->g[i][k][c] * s->g[i][k][c];
            for (size_t c = 0; c < 3; c++)
                rough[i][c] += fmin(coefficient[i], coefficient[k]) * square *
                               (velocity[i][c] - velocity[k][c]);
        }
    }
}

/* A viscosity's bound goes with the step's gravity, of a model that has one. */
static double bound_under(const ascc_plan *plan, const double gravity[3])
{
    double own = 0.0, here = 0.0;
    for (size_t c = 0; c < 3; c++) {
        own = hypot(own, plan->gravity[c]);
        here = hypot(here, gravity[c]);
    }
    return plan->relaxation.viscosity_below * (own > 0.0 ? here / own : 1.0);
}

static void smooth_velocities(const scene *s, double step, double below, double *velocity)
{
    const ascc_relaxation *r = s->constants;
    double coefficient[MOST] = {0.0}, v[MOST][3] = {{0.0}}, rough[MOST][3], twice[MOST][3];
    for (size_t i = 0; i < s->fluid; i++) {
        double squares = 0.0;
        for (size_t k = 0; k < s->fluid; k++)
            for (size_t c = 0; c < 3; c++)
                squares += s->g[i][k][c] * s->g[i][k][c];
        if (s->density[i] - 1.0 >= -0.35)
            coefficient[i] = 1.0 / fmax(squares, r->lattice_response);
        for (size_t c = 0; c < s->d; c++)
            v[i][c] = velocity[i * s->d + c] * step;
    }
    for (int32_t n = 0; n < r->viscosity.count; n++) {
        roughness(s, coefficient, v, rough);
        for (size_t i = 0; i < s->fluid; i++) {
            double square = 0.0;
            for (size_t c = 0; c < 3; c++)
                square += rough[i][c] * rough[i][c];
            const double left = fmax(0.0, 1.0 - square / pow(below * step, 2.0));
            for (size_t c = 0; c < 3; c++)
                rough[i][c] *= left * left;
        }
        roughness(s, coefficient, rough, twice);
        for (size_t i = 0; i < s->fluid; i++)
            for (size_t c = 0; c < 3; c++)
                v[i][c] -= r->viscosity.omega[n] * twice[i][c];
    }
    for (size_t i = 0; i < s->fluid; i++)
        for (size_t c = 0; c < s->d; c++)
            velocity[i * s->d + c] = v[i][c] / step;
}

void relaxation_oracle(const ascc_plan *plan, size_t fluid, size_t walls, const double *wall,
                       const double *before, const double *guess, const double gravity[3],
                       double *position, double *velocity)
{
    const ascc_relaxation *r = &plan->relaxation;
    const double step = plan->time_step / r->support;
    scene *s = calloc(1, sizeof *s);
    if (!s || fluid > MOST || walls > MOST)
        abort();
    *s =
        (scene){.constants = r, .d = (size_t)plan->dimension, .fluid = fluid, .all = fluid + walls};
    for (size_t k = 0; k < s->all; k++) {
        s->volume[k] = r->amount;
        for (size_t c = 0; c < s->d; c++)
            s->place[k][c] = k < fluid ? 0.0 : wall[(k - fluid) * s->d + c] / r->support;
        if (k < fluid)
            for (size_t c = 0; c < s->d; c++)
                s->before[k][c] = before[k * s->d + c] / r->support;
    }
    for (size_t k = fluid; k < s->all; k++) {
        double sum = 0.0, u[3];
        for (size_t b = fluid; b < s->all; b++)
            sum += spline(between(s, k, b, u));
        s->volume[k] = 1.0 / sum;
    }
    put_places(s, position);
    find_geometry(s);
    bool again = true;
    for (int32_t n = 0; n < r->rounds && again; n++) {
        double excess[MOST], most = 0.0;
        again = false;
        for (size_t i = 0; i < fluid; i++) {
            excess[i] = s->density[i] - 1.0;
            most = fmax(most, excess[i]);
            again |= excess[i] > r->again;
            s->p[i] = guess && n == 0 ? guess[i] / r->lattice_response : 0.0;
        }
        if (n > 0 && most <= r->left)
            break;
        sweep(s, &r->pressure, excess, r->repulsion / r->support);
        for (size_t i = 0; i < fluid; i++)
            for (size_t c = 0; c < s->d; c++) {
                position[i * s->d + c] += s->move[i][c] * r->support;
                velocity[i * s->d + c] += s->move[i][c] / step;
            }
        put_places(s, position);
        find_geometry(s);
    }
    if (r->divergence.count)
        relax_velocities(s, step, velocity);
    if (r->viscosity.count)
        smooth_velocities(s, step, bound_under(plan, gravity), velocity);
    free(s);
}
